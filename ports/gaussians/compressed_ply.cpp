#include "ports/gaussians/compressed_ply.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "ports/gaussians/cloud_builder.h"
#include "ports/gaussians/ply_comments.h"

namespace figurine::ports {

namespace {

constexpr uint64_t kChunkGaussians = 256;

// An element's rows where they lie in the file.
class Rows {
 public:
  Rows() = default;
  Rows(const PlyElement& element, std::span<const std::byte> bytes, bool swap)
      : element_(&element), bytes_(bytes), swap_(swap), row_bytes_(element.row_bytes()) {
    size_t offset = 0;
    for (const PlyProperty& property : element.properties) {
      offsets_.push_back(offset);
      offset += size_of(property.type);
    }
  }

  explicit operator bool() const { return element_ != nullptr; }
  uint64_t count() const { return element_->count; }
  double value(uint64_t row, size_t column) const {
    return load_ply_value(bytes_.data() + row * row_bytes_ + offsets_[column],
                          element_->properties[column].type, swap_);
  }

 private:
  const PlyElement* element_ = nullptr;
  std::span<const std::byte> bytes_;
  bool swap_ = false;
  size_t row_bytes_ = 0;
  std::vector<size_t> offsets_;
};

// The columns of wanted names, all of one type; an error names the first that is missing.
template <size_t N>
std::string find_all(const PlyElement& element, const std::array<const char*, N>& names,
                     PlyType type, std::array<size_t, N>& columns) {
  for (size_t i = 0; i < N; ++i) {
    const std::optional<size_t> found = element.find(names[i]);
    if (!found) return "element " + element.name + " has no property " + names[i];
    if (element.properties[*found].type != type)
      return "the property " + std::string(names[i]) + " has another type than it should";
    columns[i] = *found;
  }
  return "";
}

constexpr std::array<const char*, 12> kRanges{
    "min_x",       "min_y",       "min_z",       "max_x",       "max_y",       "max_z",
    "min_scale_x", "min_scale_y", "min_scale_z", "max_scale_x", "max_scale_y", "max_scale_z"};
constexpr std::array<const char*, 6> kColourRanges{"min_r", "min_g", "min_b",
                                                   "max_r", "max_g", "max_b"};
constexpr std::array<const char*, 4> kPacked{"packed_position", "packed_rotation", "packed_scale",
                                             "packed_color"};

struct Layout {
  std::array<size_t, 12> ranges{};
  std::array<size_t, 6> colour_ranges{};
  std::array<size_t, 4> packed{};
  bool has_colour_ranges = false;
  std::vector<size_t> rest;  // columns of element sh
  ShLayout sh;
};

std::string find_layout(const PlyHeader& header, Layout& layout) {
  const PlyElement* chunk = header.find("chunk");
  const PlyElement* vertex = header.find("vertex");
  if (chunk == nullptr) return "has packed_position and no element chunk";
  if (std::string error = find_all(*chunk, kRanges, PlyType::kF32, layout.ranges); !error.empty())
    return error;
  layout.has_colour_ranges = chunk->find("min_r").has_value();
  if (layout.has_colour_ranges) {
    std::string error = find_all(*chunk, kColourRanges, PlyType::kF32, layout.colour_ranges);
    if (!error.empty()) return error;
  }
  if (std::string error = find_all(*vertex, kPacked, PlyType::kU32, layout.packed); !error.empty())
    return error;
  if (chunk->count < (vertex->count + kChunkGaussians - 1) / kChunkGaussians) {
    return std::to_string(chunk->count) + " chunks of 256 for " + std::to_string(vertex->count) +
           " vertices";
  }
  const PlyElement* sh = header.find("sh");
  if (sh == nullptr) return "";
  if (sh->count != vertex->count)
    return "element sh has " + std::to_string(sh->count) + " rows, the vertices " +
           std::to_string(vertex->count);
  for (size_t k = 0; k < sh->properties.size(); ++k) {
    const std::optional<size_t> found = sh->find("f_rest_" + std::to_string(k));
    if (!found || sh->properties[*found].type != PlyType::kU8)
      return "element sh has no uchar f_rest_" + std::to_string(k);
    layout.rest.push_back(*found);
  }
  return find_sh_layout(layout.rest.size(), layout.sh)
             ? ""
             : std::to_string(layout.rest.size()) +
                   " f_rest properties, no multiple of three channels";
}

double unit(uint32_t packed, unsigned shift, unsigned bits) {
  const uint32_t most = (1u << bits) - 1;
  return static_cast<double>(packed >> shift & most) / most;
}

// Three values in 11, 10 and 11 bits, from the top.
std::array<double, 3> unit3(uint32_t packed) {
  return {unit(packed, 21, 11), unit(packed, 11, 10), unit(packed, 0, 11)};
}

std::array<double, 4> rotation_of(uint32_t packed) {
  const size_t largest = packed >> 30;
  std::array<double, 4> q{};
  double squares = 0;
  for (size_t i = 0, at = 0; i < 4; ++i) {
    if (i == largest) continue;
    q[i] = (unit(packed, static_cast<unsigned>(20 - 10 * at++), 10) - 0.5) * std::sqrt(2.0);
    squares += q[i] * q[i];
  }
  q[largest] = std::sqrt(std::max(0.0, 1 - squares));
  return q;
}

// Bytes 0 and 255 are the ends of [-4, 4], the others the middles of its steps.
double rest_of(double byte) {
  const double share = byte == 0 ? 0 : byte == 255 ? 1 : (byte + 0.5) / 256;
  return (share - 0.5) * 8;
}

StoredGaussian unpack(uint64_t i, const Layout& layout, const Rows& chunks, const Rows& vertices,
                      const Rows& sh, bool flat) {
  const uint64_t chunk = i / kChunkGaussians;
  const auto packed = [&](size_t k) {
    return static_cast<uint32_t>(vertices.value(i, layout.packed[k]));
  };
  // Column k of the lower ends and k + 3 of the upper ones.
  const auto between = [&](size_t low_column, size_t high_column, double share) {
    const double low = chunks.value(chunk, low_column), high = chunks.value(chunk, high_column);
    return low * (1 - share) + high * share;
  };
  StoredGaussian gaussian;
  const std::array<double, 3> position = unit3(packed(0)), scale = unit3(packed(2));
  const uint32_t colour = packed(3);
  for (size_t k = 0; k < 3; ++k) {
    gaussian.position_m[k] = between(layout.ranges[k], layout.ranges[3 + k], position[k]);
    gaussian.scale_m[k] =
        flat && k == 2 ? 0
                       : std::exp(between(layout.ranges[6 + k], layout.ranges[9 + k], scale[k]));
    double value = unit(colour, static_cast<unsigned>(24 - 8 * k), 8);
    if (layout.has_colour_ranges)
      value = between(layout.colour_ranges[k], layout.colour_ranges[3 + k], value);
    gaussian.sh[k] = (value - double(kShOffset)) / double(kSh0);
  }
  gaussian.rotation = rotation_of(packed(1));
  gaussian.opacity = unit(colour, 0, 8);
  const size_t bands = sh_coefficients(layout.sh.degree) - 1;
  for (size_t channel = 0; channel < 3; ++channel) {
    for (size_t k = 0; k < bands; ++k) {
      const size_t column = layout.rest[channel * layout.sh.stored_per_channel + k];
      gaussian.sh[3 * (1 + k) + channel] = rest_of(sh.value(i, column));
    }
  }
  return gaussian;
}

}  // namespace

Result<GaussianCloud> read_compressed_ply(std::span<const std::byte> bytes, const PlyHeader& header,
                                          const std::string& name) {
  const auto error = [&](StatusCode code, const std::string& what) {
    return Status(code, name + ": compressed ply: " + what);
  };
  if (header.encoding == PlyEncoding::kAscii)
    return error(StatusCode::kUnsupported, "in ascii; binary ones are read");
  Layout layout;
  if (const std::string wrong = find_layout(header, layout); !wrong.empty())
    return error(StatusCode::kCorrupt, wrong);

  std::span<const std::byte> left = bytes.subspan(header.size_bytes);
  Rows chunks, vertices, sh;
  for (const PlyElement& element : header.elements) {
    if (element.properties.empty()) continue;
    if (element.has_list())
      return error(StatusCode::kUnsupported, "element " + quoted(element.name) + " has a list");
    const uint64_t possible = left.size() / element.row_bytes();
    if (element.count > possible || element.count > std::numeric_limits<uint32_t>::max()) {
      return error(StatusCode::kCorrupt, "declares " + std::to_string(element.count) +
                                             " rows of element " + quoted(element.name) +
                                             ", the data holds at most " +
                                             std::to_string(possible));
    }
    const size_t size = element.count * element.row_bytes();
    const Rows rows(element, left.first(size), header.encoding == PlyEncoding::kBigEndian);
    if (element.name == "chunk") chunks = rows;
    if (element.name == "vertex") vertices = rows;
    if (element.name == "sh") sh = rows;
    left = left.subspan(size);
  }

  const PlyDrawing drawing = read_drawing_comments(header.comments);
  CloudBuilder builder("compressed ply", layout.sh.degree, vertices.count());
  for (uint64_t i = 0; i < vertices.count(); ++i)
    builder.add(i, unpack(i, layout, chunks, vertices, sh, drawing.flat));
  if (!layout.sh.remark.empty()) builder.remark(layout.sh.remark);
  if (drawing.flat) builder.remark("2D Gaussians, drawn as discs");
  if (!left.empty())
    builder.remark(std::to_string(left.size()) + " bytes behind the last element not read");
  if (drawing.antialiased.value_or(false)) builder.set_antialiased();
  if (drawing.up) builder.set_up(*drawing.up);
  return std::move(builder).finish();
}

}  // namespace figurine::ports
