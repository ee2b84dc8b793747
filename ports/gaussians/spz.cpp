#include "ports/gaussians/spz.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <optional>
#include <utility>
#include <vector>

#include "figurine/detail/half.h"
#include "ports/gaussians/cloud_builder.h"
#include "ports/gaussians/spz_unpack.h"

namespace figurine::ports {

namespace {

constexpr uint32_t kMagic = 0x5053474e;  // "NGSP"
constexpr size_t kHeaderBytes = 16, kZstdHeaderBytes = 32;
constexpr uint8_t kAntialiased = 1, kHasExtensions = 2;
constexpr uint32_t kCoordinateSystem = 0xADBE0003;  // an extension: what the axes are
constexpr size_t kMaxExtensionBytes = 1 << 16;
constexpr double kColourScale = 0.15;  // of f_dc; not kSh0
// Real scenes pack 1.2 to 4 times. More than 100 is a bomb, unless it is small.
constexpr uint64_t kMaxRatio = 100, kSmallBytes = 1 << 20;

struct Header {
  uint32_t version = 0, count = 0;
  uint8_t sh_degree = 0, fractional_bits = 0, flags = 0, streams = 0;
  uint32_t table_offset = 0;  // of version 4

  size_t position_bytes() const { return version == 1 ? 6 : 9; }
  size_t rotation_bytes() const { return version < 3 ? 3 : 4; }
  size_t sh_bytes() const { return 3 * ((sh_degree + size_t(1)) * (sh_degree + size_t(1)) - 1); }
};

// Bytes a Gaussian in each of the six streams, in the file's order: position, opacity, colour,
// scale, rotation, spherical harmonics.
std::array<size_t, 6> stream_widths(const Header& header) {
  return {header.position_bytes(), 1, 3, 3, header.rotation_bytes(), header.sh_bytes()};
}

uint64_t little(const std::byte* data, size_t bytes) {
  uint64_t value = 0;
  std::memcpy(&value, data, bytes);  // little-endian machines alone (ply_format.cpp)
  return value;
}

Header parse_header(const std::byte* data) {
  return {.version = static_cast<uint32_t>(little(data + 4, 4)),
          .count = static_cast<uint32_t>(little(data + 8, 4)),
          .sh_degree = static_cast<uint8_t>(data[12]),
          .fractional_bits = static_cast<uint8_t>(data[13]),
          .flags = static_cast<uint8_t>(data[14]),
          .streams = static_cast<uint8_t>(data[15])};
}

class SpzReader {
 public:
  SpzReader(std::span<const std::byte> bytes, const std::string& name)
      : bytes_(bytes), name_(name) {}

  Result<GaussianCloud> read() {
    FIG_RETURN_IF_ERROR(unpack());
    return build();
  }

 private:
  Status error(StatusCode code, const std::string& what) const {
    return {code, name_ + ": spz: " + what};
  }
  Status corrupt(const std::string& what) const { return error(StatusCode::kCorrupt, what); }

  Status unpack() {
    if (bytes_.size() < kHeaderBytes) return corrupt("shorter than its header");
    if (little(bytes_.data(), 2) == 0x8b1f) return unpack_gzip();
    if (little(bytes_.data(), 4) != kMagic) return corrupt("neither gzip nor 'NGSP'");
    header_ = parse_header(bytes_.data());
    return header_.version == 4 ? unpack_zstd_streams() : take_bare();
  }

  // What the header declares, before memory is taken for it.
  Status check_header() {
    if (header_.version < 1 || header_.version > 4) {
      return error(StatusCode::kUnsupported,
                   "version " + std::to_string(header_.version) + "; 1 to 4 are read");
    }
    if (header_.sh_degree > 4) {
      return error(StatusCode::kUnsupported, "spherical harmonics of degree " +
                                                 std::to_string(header_.sh_degree) +
                                                 "; 0 to 4 are read");
    }
    if (header_.version > 1 && header_.fractional_bits > 24)
      return corrupt(std::to_string(header_.fractional_bits) + " fractional bits of 24");
    uint64_t a_gaussian = 0;
    for (const size_t width : stream_widths(header_)) a_gaussian += width;
    const uint64_t unpacked = a_gaussian * header_.count;
    if (unpacked > std::max(kSmallBytes, kMaxRatio * bytes_.size())) {
      return error(StatusCode::kLimitExceeded, "declares " + std::to_string(header_.count) +
                                                   " Gaussians, " + std::to_string(unpacked) +
                                                   " bytes, in a file of " +
                                                   std::to_string(bytes_.size()));
    }
    unpacked_.resize(unpacked);
    return {};
  }

  Status unpack_gzip() {
    Gunzip gunzip(bytes_);
    std::array<std::byte, kHeaderBytes> start{};
    if (!gunzip.fill(start)) return corrupt(gunzip.why());
    if (little(start.data(), 4) != kMagic) return corrupt("gzip, but of something else");
    header_ = parse_header(start.data());
    if (header_.version == 4) return corrupt("version 4 is not packed by gzip");
    FIG_RETURN_IF_ERROR(check_header());
    if (!gunzip.fill(unpacked_)) {
      return corrupt("declares " + std::to_string(header_.count) + " Gaussians: " + gunzip.why());
    }
    extensions_.resize(kMaxExtensionBytes);
    size_t size = 0;
    if (!gunzip.fill_to_end(extensions_, size)) return corrupt(gunzip.why());
    extensions_.resize(size);
    return {};
  }

  // Versions 1 to 3 without their packing.
  Status take_bare() {
    FIG_RETURN_IF_ERROR(check_header());
    const std::span<const std::byte> body = bytes_.subspan(kHeaderBytes);
    if (body.size() < unpacked_.size()) {
      return corrupt("declares " + std::to_string(header_.count) +
                     " Gaussians, the data ends early");
    }
    std::copy_n(body.begin(), unpacked_.size(), unpacked_.begin());
    const auto rest = body.subspan(unpacked_.size());
    extensions_.assign(rest.begin(), rest.end());
    return {};
  }

  // A header, extensions, a table of sizes, and the streams one by one; those of no bytes are not
  // there.
  Status unpack_zstd_streams() {
    if (bytes_.size() < kZstdHeaderBytes) return corrupt("shorter than its header");
    header_.table_offset = static_cast<uint32_t>(little(bytes_.data() + 16, 4));
    FIG_RETURN_IF_ERROR(check_header());
    const std::array<size_t, 6> widths = stream_widths(header_);
    const size_t wanted = header_.count == 0 ? 0 : header_.sh_degree == 0 ? 5 : 6;
    if (header_.streams != wanted) {
      return corrupt(std::to_string(header_.streams) + " streams, " + std::to_string(wanted) +
                     " belong to its degree");
    }
    const size_t table_bytes = wanted * 16;
    if (header_.table_offset < kZstdHeaderBytes || header_.table_offset > bytes_.size() ||
        bytes_.size() - header_.table_offset < table_bytes) {
      return corrupt("the table of streams is not in the file");
    }
    extensions_.assign(bytes_.begin() + kZstdHeaderBytes, bytes_.begin() + header_.table_offset);
    const std::byte* table = bytes_.data() + header_.table_offset;
    std::span<const std::byte> packed = bytes_.subspan(header_.table_offset + table_bytes);
    std::span<std::byte> to = unpacked_;
    for (size_t i = 0; i < wanted; ++i) {
      const uint64_t packed_size = little(table + 16 * i, 8), size = little(table + 16 * i + 8, 8);
      const std::string stream = "stream " + std::to_string(i);
      if (size != widths[i] * uint64_t(header_.count)) {
        return corrupt(stream + " has " + std::to_string(size) + " bytes, its Gaussians " +
                       std::to_string(widths[i] * uint64_t(header_.count)));
      }
      if (packed_size > packed.size()) return corrupt(stream + " ends behind the file");
      if (!unpack_zstd(packed.first(packed_size), to.first(size)))
        return corrupt(stream + " is damaged");
      packed = packed.subspan(packed_size);
      to = to.subspan(size);
    }
    trailing_ = packed.size();
    return {};
  }

  // Records of a type, a length and so many bytes: which axes the data have is the only one of
  // interest.
  Status take_extensions(CloudBuilder& builder) const {
    std::span<const std::byte> left = extensions_;
    if ((header_.flags & kHasExtensions) == 0) {
      const size_t unknown = trailing_ + left.size();
      if (unknown > 0)
        builder.remark(std::to_string(unknown) + " bytes beside the Gaussians not read");
      return {};
    }
    size_t skipped = 0;
    while (left.size() >= 8) {
      const auto type = static_cast<uint32_t>(little(left.data(), 4));
      const uint64_t size = little(left.data() + 4, 4);
      if (size > left.size() - 8) return corrupt("an extension ends behind its place");
      if (type == kCoordinateSystem && size == 4) {
        FIG_RETURN_IF_ERROR(take_axes(little(left.data() + 8, 4), builder));
      } else {
        ++skipped;
      }
      left = left.subspan(8 + size);
    }
    if (skipped > 0) builder.remark("skipped " + std::to_string(skipped) + " extensions");
    return {};
  }

  // Numbered from LDB = 1 to RBU = 16, by where x, y and z point.
  Status take_axes(uint64_t system, CloudBuilder& builder) const {
    constexpr const char* kSystems[] = {"",    "LDB", "RDB", "LUB", "RUB", "LDF",
                                        "RDF", "LUF", "RUF", "LFD", "RFD", "LFU",
                                        "RFU", "LBD", "RBD", "LBU", "RBU"};
    if (system == 0) return {};
    if (system >= std::size(kSystems))
      return corrupt("unknown axes, number " + std::to_string(system));
    const std::string axes = kSystems[system];
    const bool y_vertical = axes[1] == 'U' || axes[1] == 'D';
    const char forward = y_vertical ? axes[2] : axes[1], up = y_vertical ? axes[1] : axes[2];
    // Right, up, back is right-handed, and so is whatever turns two of them round. The swap of y
    // and z is one more mirror.
    const bool mirrored = ((axes[0] == 'L') != (up == 'D')) != ((forward == 'F') != !y_vertical);
    if (mirrored) return error(StatusCode::kUnsupported, "left-handed axes (" + axes + ")");
    builder.set_up(y_vertical ? (up == 'U' ? UpAxis::kPlusY : UpAxis::kMinusY)
                              : (up == 'U' ? UpAxis::kPlusZ : UpAxis::kMinusZ));
    return {};
  }

  Result<GaussianCloud> build() {
    ShLayout sh;
    find_sh_layout(header_.sh_bytes(), sh);
    CloudBuilder builder("spz " + std::to_string(header_.version), sh.degree, header_.count);
    const std::array<size_t, 6> widths = stream_widths(header_);
    std::array<const std::byte*, 6> streams{};
    const std::byte* at = unpacked_.data();
    for (size_t i = 0; i < streams.size(); ++i) {
      streams[i] = at;
      at += widths[i] * header_.count;
    }
    for (uint32_t i = 0; i < header_.count; ++i) {
      builder.add(i, gaussian_of(streams, sh.degree));
      for (size_t s = 0; s < streams.size(); ++s) streams[s] += widths[s];
    }
    if (!sh.remark.empty()) builder.remark(sh.remark);
    if ((header_.flags & kAntialiased) != 0) builder.set_antialiased();
    FIG_RETURN_IF_ERROR(take_extensions(builder));
    return std::move(builder).finish();
  }

  StoredGaussian gaussian_of(const std::array<const std::byte*, 6>& streams,
                             uint32_t sh_degree) const {
    const auto byte = [](const std::byte* data) { return static_cast<double>(*data); };
    StoredGaussian gaussian;
    for (size_t k = 0; k < 3; ++k) {
      gaussian.position_m[k] = position(streams[0], k);
      gaussian.sh[k] = (byte(streams[2] + k) / 255 - 0.5) / kColourScale;
      gaussian.scale_m[k] = std::exp(byte(streams[3] + k) / 16 - 10);
    }
    gaussian.opacity = byte(streams[1]) / 255;
    gaussian.rotation = header_.version < 3 ? first_three(streams[4]) : smallest_three(streams[4]);
    const size_t values = 3 * (sh_coefficients(sh_degree) - size_t(1));
    for (size_t k = 0; k < values; ++k) gaussian.sh[3 + k] = (byte(streams[5] + k) - 128) / 128;
    return gaussian;
  }

  double position(const std::byte* data, size_t k) const {
    if (header_.version == 1) return to_float(Half{static_cast<uint16_t>(little(data + 2 * k, 2))});
    const auto bits = static_cast<uint32_t>(little(data + 3 * k, 3));
    const auto fixed = static_cast<int32_t>(bits << 8) >> 8;  // the sign of 24 bits
    return std::ldexp(static_cast<double>(fixed), -header_.fractional_bits);
  }

  // x, y and z in a byte each; w is what is missing to length one.
  static std::array<double, 4> first_three(const std::byte* data) {
    std::array<double, 4> wxyz{};
    double squares = 0;
    for (size_t k = 0; k < 3; ++k) {
      wxyz[1 + k] = static_cast<double>(data[k]) / 127.5 - 1;
      squares += wxyz[1 + k] * wxyz[1 + k];
    }
    wxyz[0] = std::sqrt(std::max(0.0, 1 - squares));
    return wxyz;
  }

  // Two bits name the largest of x, y, z, w; the others have a sign and nine bits each, the last
  // one lowest.
  static std::array<double, 4> smallest_three(const std::byte* data) {
    auto packed = static_cast<uint32_t>(little(data, 4));
    const size_t largest = packed >> 30;
    std::array<double, 4> xyzw{};
    double squares = 0;
    for (size_t k = 4; k-- > 0;) {
      if (k == largest) continue;
      const double size = std::sqrt(0.5) * (packed & 511u) / 511;
      xyzw[k] = (packed & 512u) != 0 ? -size : size;
      squares += size * size;
      packed >>= 10;
    }
    xyzw[largest] = std::sqrt(std::max(0.0, 1 - squares));
    return {xyzw[3], xyzw[0], xyzw[1], xyzw[2]};
  }

  std::span<const std::byte> bytes_;
  const std::string& name_;
  Header header_;
  std::vector<std::byte> unpacked_;  // the six streams, one after the other
  std::vector<std::byte> extensions_;
  size_t trailing_ = 0;
};

}  // namespace

Result<GaussianCloud> read_spz(std::span<const std::byte> bytes, const std::string& name) {
  return SpzReader(bytes, name).read();
}

}  // namespace figurine::ports
