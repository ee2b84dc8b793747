#include "ports/gaussians/ply.h"

#include <algorithm>
#include <array>
#include <bit>
#include <charconv>
#include <cmath>
#include <cstring>
#include <limits>
#include <optional>
#include <string_view>

#include "ports/gaussians/decompose.h"

namespace figurine::ports {

namespace {

static_assert(std::endian::native == std::endian::little,
              "multi-byte values are read as they lie in memory, or swapped");

constexpr size_t kMaxHeaderBytes = 1 << 20;
constexpr size_t kMaxProperties = 4096;
constexpr double kMaxLogit = 16;      // sigmoid(16) = 1 - 1.1e-7: one step of a float below 1
constexpr double kMinLogScale = -30;  // 1e-13 m

enum class Encoding { kAscii, kLittleEndian, kBigEndian };
enum class Type : uint8_t { kI8, kU8, kI16, kU16, kI32, kU32, kF32, kF64 };

constexpr size_t size_of(Type type) {
  constexpr size_t kSizes[] = {1, 1, 2, 2, 4, 4, 4, 8};
  return kSizes[static_cast<size_t>(type)];
}

std::optional<Type> parse_type(std::string_view word) {
  constexpr std::pair<std::string_view, Type> kNames[] = {
      {"char", Type::kI8},    {"int8", Type::kI8},     {"uchar", Type::kU8},
      {"uint8", Type::kU8},   {"short", Type::kI16},   {"int16", Type::kI16},
      {"ushort", Type::kU16}, {"uint16", Type::kU16},  {"int", Type::kI32},
      {"int32", Type::kI32},  {"uint", Type::kU32},    {"uint32", Type::kU32},
      {"float", Type::kF32},  {"float32", Type::kF32}, {"double", Type::kF64},
      {"float64", Type::kF64}};
  for (const auto& [name, type] : kNames) {
    if (word == name) return type;
  }
  return std::nullopt;
}

struct Property {
  std::string name;
  Type type = Type::kF32;
  std::optional<Type> list_count;  // of a list: the type of its length
};

struct Element {
  std::string name;
  uint64_t count = 0;
  std::vector<Property> properties;

  bool has_list() const {
    return std::any_of(properties.begin(), properties.end(),
                       [](const Property& p) { return p.list_count.has_value(); });
  }
  size_t row_bytes() const {
    size_t bytes = 0;
    for (const Property& property : properties) bytes += size_of(property.type);
    return bytes;
  }
};

struct Header {
  Encoding encoding = Encoding::kLittleEndian;
  std::vector<Element> elements;
  size_t size_bytes = 0;
};

std::vector<std::string_view> split(std::string_view line) {
  std::vector<std::string_view> words;
  for (size_t at = 0; (at = line.find_first_not_of(" \t\r", at)) != std::string_view::npos;) {
    const size_t end = std::min(line.find_first_of(" \t\r", at), line.size());
    words.push_back(line.substr(at, end - at));
    at = end;
  }
  return words;
}

// A name or word of the file as it may appear in a message: printable and short.
std::string quoted(std::string_view word) {
  std::string text = "'";
  for (const char c : word.substr(0, 40)) text += (c >= 32 && c < 127) ? c : '?';
  return text + (word.size() > 40 ? "...'" : "'");
}

Result<Header> parse_header(std::string_view text, const std::string& name) {
  const auto corrupt = [&](const std::string& what) {
    return Status(StatusCode::kCorrupt, name + ": ply: " + what);
  };
  Header header;
  bool has_format = false;
  size_t properties = 0;
  text = text.substr(0, kMaxHeaderBytes);
  for (size_t line_number = 1, at = 0;; ++line_number) {
    const size_t end = text.find('\n', at);
    if (end == std::string_view::npos) {
      return line_number == 1 ? corrupt("does not start with 'ply'")
                              : corrupt("the header has no end_header");
    }
    const std::vector<std::string_view> words = split(text.substr(at, end - at));
    at = end + 1;
    if (line_number == 1) {
      if (words.size() != 1 || words[0] != "ply") return corrupt("does not start with 'ply'");
      continue;
    }
    if (words.empty() || words[0] == "comment" || words[0] == "obj_info") continue;
    if (words[0] == "end_header") {
      if (!has_format) return corrupt("the header has no format");
      header.size_bytes = at;
      return header;
    }
    if (words[0] == "format" && words.size() >= 2) {
      if (words[1] == "ascii") {
        header.encoding = Encoding::kAscii;
      } else if (words[1] == "binary_little_endian") {
        header.encoding = Encoding::kLittleEndian;
      } else if (words[1] == "binary_big_endian") {
        header.encoding = Encoding::kBigEndian;
      } else {
        return corrupt("unknown format " + quoted(words[1]));
      }
      has_format = true;
    } else if (words[0] == "element" && words.size() == 3) {
      Element element{.name = std::string(words[1]), .count = 0, .properties = {}};
      const auto [stop, error] =
          std::from_chars(words[2].data(), words[2].data() + words[2].size(), element.count);
      if (error != std::errc() || stop != words[2].data() + words[2].size()) {
        return corrupt("element " + quoted(words[1]) + " has the count " + quoted(words[2]));
      }
      header.elements.push_back(std::move(element));
    } else if (words[0] == "property" && words.size() >= 3) {
      if (header.elements.empty()) return corrupt("a property before any element");
      const bool is_list = words[1] == "list" && words.size() == 5;
      const std::optional<Type> type = parse_type(words[is_list ? 3 : 1]);
      const std::optional<Type> list_count = is_list ? parse_type(words[2]) : std::nullopt;
      if (!type || (is_list && !list_count) || (!is_list && words.size() != 3)) {
        return corrupt("line " + std::to_string(line_number) + " declares no known property type");
      }
      if (++properties > kMaxProperties)
        return corrupt("more than " + std::to_string(kMaxProperties) + " properties");
      header.elements.back().properties.push_back({std::string(words.back()), *type, list_count});
    } else {
      return corrupt("line " + std::to_string(line_number) +
                     " is no header line: " + quoted(words[0]));
    }
  }
}

// One value of a binary file, at data.
double load(const std::byte* data, Type type, bool swap) {
  std::array<std::byte, 8> bytes{};
  const size_t size = size_of(type);
  std::memcpy(bytes.data(), data, size);
  if (swap) std::reverse(bytes.begin(), bytes.begin() + size);
  const auto as = [&]<class T>(T) {
    T value;
    std::memcpy(&value, bytes.data(), sizeof(T));
    return static_cast<double>(value);
  };
  switch (type) {
    case Type::kI8:
      return as(int8_t{});
    case Type::kU8:
      return as(uint8_t{});
    case Type::kI16:
      return as(int16_t{});
    case Type::kU16:
      return as(uint16_t{});
    case Type::kI32:
      return as(int32_t{});
    case Type::kU32:
      return as(uint32_t{});
    case Type::kF32:
      return as(float{});
    case Type::kF64:
      return as(double{});
  }
  return 0;
}

// Walks the values of a body, ascii or binary. read() is false at the end of the data or on a word
// that is no number.
class Cursor {
 public:
  Cursor(std::span<const std::byte> body, Encoding encoding) : body_(body), encoding_(encoding) {}

  bool read(Type type, double& value) {
    if (encoding_ == Encoding::kAscii) return read_word(value);
    if (body_.size() - at_ < size_of(type)) return false;
    value = load(body_.data() + at_, type, encoding_ == Encoding::kBigEndian);
    at_ += size_of(type);
    return true;
  }

  // Past one row of an element that nobody asked for.
  bool skip_row(const Element& element) {
    double value = 0;
    for (const Property& property : element.properties) {
      uint64_t repeat = 1;
      if (property.list_count) {
        if (!read(*property.list_count, value) || !(value >= 0 && value <= 4294967295.0))
          return false;
        repeat = static_cast<uint64_t>(value);
        if (repeat > left()) return false;
      }
      for (uint64_t i = 0; i < repeat; ++i) {
        if (!read(property.type, value)) return false;
      }
    }
    return true;
  }

  uint64_t left() const { return body_.size() - at_; }

 private:
  bool read_word(double& value) {
    const char* text = reinterpret_cast<const char*>(body_.data());
    const auto blank = [](char c) { return c == ' ' || c == '\n' || c == '\t' || c == '\r'; };
    while (at_ < body_.size() && blank(text[at_])) ++at_;
    size_t end = at_;
    while (end < body_.size() && !blank(text[end])) ++end;
    if (end - at_ > 1 && text[at_] == '+' && text[at_ + 1] != '-')
      ++at_;  // from_chars takes no plus sign
    const auto [stop, error] = std::from_chars(text + at_, text + end, value);
    if (error == std::errc::result_out_of_range) {
      // Too small or too large for a double: which of them does not matter to a float, the sign of
      // the exponent decides.
      const std::string_view word(text + at_, end - at_);
      const bool tiny =
          word.find("e-") != std::string_view::npos || word.find("E-") != std::string_view::npos;
      value = tiny ? 0.0 : std::numeric_limits<double>::infinity();
    } else if (error != std::errc() || stop != text + end) {
      return false;
    }
    at_ = end;
    return true;
  }

  std::span<const std::byte> body_;
  Encoding encoding_;
  size_t at_ = 0;
};

// Which property of the vertex element each value of a Gaussian comes from.
struct Columns {
  std::array<size_t, 3> position, dc, scale;
  std::array<size_t, 4> rotation;
  size_t opacity = 0;
  std::vector<size_t> rest;
  uint32_t sh_degree = 0;
};

Result<Columns> find_columns(const Element& vertex, const std::string& name) {
  const auto find = [&](const std::string& wanted) -> std::optional<size_t> {
    for (size_t i = 0; i < vertex.properties.size(); ++i) {
      if (vertex.properties[i].name == wanted) return i;
    }
    return std::nullopt;
  };
  if (find("packed_position")) {
    return Status(StatusCode::kUnsupported, name +
                                                ": ply: compressed Gaussians (packed_position) are "
                                                "not read; convert to the plain layout");
  }
  Columns columns;
  std::string missing;
  const auto require = [&](const std::string& wanted, size_t& column) {
    const std::optional<size_t> found = find(wanted);
    if (found) {
      column = *found;
    } else if (missing.empty()) {
      missing = wanted;
    }
  };
  for (int k = 0; k < 3; ++k)
    require(std::string(1, static_cast<char>('x' + k)), columns.position[k]);
  for (int k = 0; k < 3; ++k) require("f_dc_" + std::to_string(k), columns.dc[k]);
  require("opacity", columns.opacity);
  for (int k = 0; k < 3; ++k) require("scale_" + std::to_string(k), columns.scale[k]);
  for (int k = 0; k < 4; ++k) require("rot_" + std::to_string(k), columns.rotation[k]);
  if (!missing.empty())
    return Status(StatusCode::kCorrupt, name + ": ply: the vertices have no property " + missing);
  const auto rest_count = static_cast<size_t>(
      std::count_if(vertex.properties.begin(), vertex.properties.end(),
                    [](const Property& p) { return p.name.starts_with("f_rest_"); }));
  uint32_t degree = 0;
  while (degree <= kMaxShDegree && 3 * (sh_coefficients(degree) - 1) != rest_count) ++degree;
  if (degree > kMaxShDegree) {
    const bool higher = rest_count == 72;  // degree 4
    return Status(higher ? StatusCode::kUnsupported : StatusCode::kCorrupt,
                  name + ": ply: " + std::to_string(rest_count) +
                      " f_rest properties; 0, 9, 24 or 45 (degree 0 to 3) are read");
  }
  columns.sh_degree = degree;
  columns.rest.resize(rest_count);
  for (size_t k = 0; k < rest_count; ++k) require("f_rest_" + std::to_string(k), columns.rest[k]);
  if (!missing.empty())
    return Status(StatusCode::kCorrupt, name + ": ply: the vertices have no property " + missing);
  return columns;
}

// One Gaussian from its row of stored values. False if it cannot be splatted.
bool append_gaussian(const std::vector<double>& row, const Columns& columns, GaussianCloud& cloud) {
  float position[3], factor[9], colour[3 * sh_coefficients(kMaxShDegree)];
  double rotation[4], length2 = 0;
  for (int k = 0; k < 4; ++k) {
    rotation[k] = row[columns.rotation[k]];
    length2 += rotation[k] * rotation[k];
  }
  if (!(length2 > 0) || !std::isfinite(length2)) return false;
  const double norm = 1 / std::sqrt(length2);
  const double w = rotation[0] * norm, x = rotation[1] * norm, y = rotation[2] * norm,
               z = rotation[3] * norm;
  const double matrix[9] = {
      1 - 2 * (y * y + z * z), 2 * (x * y - w * z),     2 * (x * z + w * y),  //
      2 * (x * y + w * z),     1 - 2 * (x * x + z * z), 2 * (y * z - w * x),  //
      2 * (x * z - w * y),     2 * (y * z + w * x),     1 - 2 * (x * x + y * y)};
  const auto narrow = [](double value, float& to) {
    to = static_cast<float>(value);
    return std::isfinite(to);
  };
  bool finite = true;
  for (int k = 0; k < 3; ++k) {
    finite = narrow(row[columns.position[k]], position[k]) && finite;
    const double scale = std::exp(row[columns.scale[k]]);
    for (int i = 0; i < 3; ++i)
      finite = narrow(matrix[3 * i + k] * scale, factor[3 * i + k]) && finite;
    finite = narrow(row[columns.dc[k]], colour[k]) && finite;
  }
  const size_t per_channel = columns.rest.size() / 3;
  for (size_t k = 0; k < columns.rest.size();
       ++k) {  // channel-major in the file, coefficient-major here
    finite =
        narrow(row[columns.rest[k]], colour[3 * (1 + k % per_channel) + k / per_channel]) && finite;
  }
  const double opacity =
      1 / (1 + std::exp(-row[columns.opacity]));  // exact 0 and 1 for infinite logits
  if (!finite || std::isnan(opacity)) return false;
  cloud.position_m.insert(cloud.position_m.end(), position, position + 3);
  cloud.covariance_factor.insert(cloud.covariance_factor.end(), factor, factor + 9);
  cloud.opacity.push_back(static_cast<float>(opacity));
  cloud.sh.insert(cloud.sh.end(), colour, colour + 3 * (1 + per_channel));
  return true;
}

}  // namespace

Result<GaussianCloud> read_gaussian_ply(std::span<const std::byte> bytes, const std::string& name) {
  const auto corrupt = [&](const std::string& what) {
    return Status(StatusCode::kCorrupt, name + ": ply: " + what);
  };
  const Result<Header> header =
      parse_header({reinterpret_cast<const char*>(bytes.data()), bytes.size()}, name);
  if (!header.ok()) return header.status();
  const auto vertex = std::find_if(header->elements.begin(), header->elements.end(),
                                   [](const Element& e) { return e.name == "vertex"; });
  if (vertex == header->elements.end()) return corrupt("there is no element vertex");
  if (vertex->has_list())
    return corrupt("the vertices have a list property, which Gaussians do not");
  const Result<Columns> columns = find_columns(*vertex, name);
  if (!columns.ok()) return columns.status();

  Cursor cursor(bytes.subspan(header->size_bytes), header->encoding);
  for (auto element = header->elements.begin(); element != vertex; ++element) {
    if (element->properties.empty()) continue;  // rows of nothing, however many
    for (uint64_t i = 0; i < element->count; ++i) {
      if (!cursor.skip_row(*element))
        return corrupt("the data of element " + quoted(element->name) + " ends early");
    }
  }
  // Before anything is reserved: the rows must be able to lie in what is left of the file. An ascii
  // value takes at least a digit and a blank.
  const size_t least_row = header->encoding == Encoding::kAscii ? 2 * vertex->properties.size() - 1
                                                                : vertex->row_bytes();
  const uint64_t possible = header->encoding == Encoding::kAscii
                                ? (cursor.left() + 1) / (least_row + 1)
                                : cursor.left() / least_row;
  if (vertex->count > possible || vertex->count > std::numeric_limits<uint32_t>::max()) {
    return corrupt("declares " + std::to_string(vertex->count) +
                   " vertices, the data holds at most " + std::to_string(possible));
  }
  GaussianCloud cloud;
  cloud.sh_degree = columns->sh_degree;
  const size_t count = vertex->count;
  cloud.position_m.reserve(3 * count);
  cloud.covariance_factor.reserve(9 * count);
  cloud.opacity.reserve(count);
  cloud.sh.reserve(3 * size_t(sh_coefficients(cloud.sh_degree)) * count);
  std::vector<double> row(vertex->properties.size());
  for (uint64_t i = 0; i < vertex->count; ++i) {
    for (size_t p = 0; p < row.size(); ++p) {
      if (!cursor.read(vertex->properties[p].type, row[p])) {
        return corrupt("vertex " + std::to_string(i) + " has no number for " +
                       vertex->properties[p].name);
      }
    }
    if (!append_gaussian(row, *columns, cloud)) ++cloud.left_out;
  }
  return cloud;
}

std::vector<std::byte> write_gaussian_ply(const GaussianView& gaussians,
                                          const std::vector<std::string>& comments) {
  const uint32_t coefficients = sh_coefficients(gaussians.sh_degree), rest = coefficients - 1;
  std::string header = "ply\nformat binary_little_endian 1.0\n";
  for (const std::string& comment : comments) header += "comment " + comment + "\n";
  header += "element vertex " + std::to_string(gaussians.count) + "\n";
  const auto declare = [&](const std::string& property) {
    header += "property float " + property + "\n";
  };
  for (const char* property : {"x", "y", "z", "nx", "ny", "nz"}) declare(property);
  for (int k = 0; k < 3; ++k) declare("f_dc_" + std::to_string(k));
  for (uint32_t k = 0; k < 3 * rest; ++k) declare("f_rest_" + std::to_string(k));
  declare("opacity");
  for (int k = 0; k < 3; ++k) declare("scale_" + std::to_string(k));
  for (int k = 0; k < 4; ++k) declare("rot_" + std::to_string(k));
  header += "end_header\n";

  const size_t floats = 6 + 3 * size_t(coefficients) + 1 + 3 + 4;
  std::vector<std::byte> bytes(header.size() + floats * sizeof(float) * gaussians.count);
  std::memcpy(bytes.data(), header.data(), header.size());
  std::vector<float> row(floats);
  for (uint32_t i = 0; i < gaussians.count; ++i) {
    float* to = row.data();
    to = std::copy_n(&gaussians.position_m[3 * size_t(i)], 3, to);
    to = std::fill_n(to, 3, 0.0f);
    const float* colour = &gaussians.sh[3 * size_t(coefficients) * i];
    to = std::copy_n(colour, 3, to);
    for (int channel = 0; channel < 3; ++channel) {
      for (uint32_t k = 1; k <= rest; ++k) *to++ = colour[3 * k + channel];
    }
    const double opacity = gaussians.opacity[i];
    *to++ = static_cast<float>(
        std::clamp(std::log(opacity) - std::log1p(-opacity), -kMaxLogit, kMaxLogit));
    const ScaleRotation shape = decompose(&gaussians.covariance_factor[9 * size_t(i)]);
    for (const double scale : shape.scale)
      *to++ = static_cast<float>(std::max(std::log(scale), kMinLogScale));
    for (const double value : shape.quaternion) *to++ = static_cast<float>(value);
    std::memcpy(bytes.data() + header.size() + floats * sizeof(float) * i, row.data(),
                floats * sizeof(float));
  }
  return bytes;
}

}  // namespace figurine::ports
