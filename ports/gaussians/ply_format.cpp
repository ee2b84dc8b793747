#include "ports/gaussians/ply_format.h"

#include <algorithm>
#include <array>
#include <bit>
#include <charconv>
#include <cstring>
#include <limits>

namespace figurine::ports {

static_assert(std::endian::native == std::endian::little,
              "multi-byte values are read as they lie in memory, or swapped");

namespace {

constexpr size_t kMaxHeaderBytes = 1 << 20;
constexpr size_t kMaxProperties = 4096;
constexpr std::string_view kByteOrderMark = "\xEF\xBB\xBF";

std::optional<PlyType> parse_type(std::string_view word) {
  constexpr std::pair<std::string_view, PlyType> kNames[] = {
      {"char", PlyType::kI8},    {"int8", PlyType::kI8},     {"uchar", PlyType::kU8},
      {"uint8", PlyType::kU8},   {"short", PlyType::kI16},   {"int16", PlyType::kI16},
      {"ushort", PlyType::kU16}, {"uint16", PlyType::kU16},  {"int", PlyType::kI32},
      {"int32", PlyType::kI32},  {"uint", PlyType::kU32},    {"uint32", PlyType::kU32},
      {"float", PlyType::kF32},  {"float32", PlyType::kF32}, {"double", PlyType::kF64},
      {"float64", PlyType::kF64}};
  for (const auto& [name, type] : kNames) {
    if (word == name) return type;
  }
  return std::nullopt;
}

bool is_blank(char c) { return c == ' ' || c == '\t' || c == '\r' || c == '\n'; }

std::vector<std::string_view> split(std::string_view line) {
  std::vector<std::string_view> words;
  for (size_t at = 0; (at = line.find_first_not_of(" \t\r", at)) != std::string_view::npos;) {
    const size_t end = std::min(line.find_first_of(" \t\r", at), line.size());
    words.push_back(line.substr(at, end - at));
    at = end;
  }
  return words;
}

// What stands behind the line's first word, without the blanks around it.
std::string rest_of(std::string_view line, std::string_view first) {
  std::string_view rest(
      first.data() + first.size(),
      static_cast<size_t>(line.data() + line.size() - first.data()) - first.size());
  while (!rest.empty() && is_blank(rest.front())) rest.remove_prefix(1);
  while (!rest.empty() && is_blank(rest.back())) rest.remove_suffix(1);
  return std::string(rest);
}

class HeaderParser {
 public:
  // One line of the header but the first and the last. An error says what is wrong with it.
  std::string take(std::string_view line, size_t number) {
    const std::vector<std::string_view> words = split(line);
    if (words.empty()) return "";
    if (words[0] == "comment" || words[0] == "obj_info") {
      header.comments.push_back(rest_of(line, words[0]));
      return "";
    }
    if (words[0] == "format" && words.size() >= 2) return take_format(words[1]);
    if (words[0] == "element" && words.size() == 3) return take_element(words[1], words[2]);
    if (words[0] == "property" && words.size() >= 3) return take_property(words, number);
    return "line " + std::to_string(number) + " is no header line: " + quoted(words[0]);
  }

  PlyHeader header;
  bool has_format = false;

 private:
  std::string take_format(std::string_view format) {
    has_format = true;
    if (format == "ascii") {
      header.encoding = PlyEncoding::kAscii;
    } else if (format == "binary_little_endian") {
      header.encoding = PlyEncoding::kLittleEndian;
    } else if (format == "binary_big_endian") {
      header.encoding = PlyEncoding::kBigEndian;
    } else {
      return "unknown format " + quoted(format);
    }
    return "";
  }

  std::string take_element(std::string_view name, std::string_view count) {
    PlyElement element{.name = std::string(name), .count = 0, .properties = {}};
    const auto [stop, error] =
        std::from_chars(count.data(), count.data() + count.size(), element.count);
    if (error != std::errc() || stop != count.data() + count.size())
      return "element " + quoted(name) + " has the count " + quoted(count);
    if (header.find(name) != nullptr) return "two elements are called " + quoted(name);
    header.elements.push_back(std::move(element));
    return "";
  }

  std::string take_property(const std::vector<std::string_view>& words, size_t number) {
    if (header.elements.empty()) return "a property before any element";
    const bool is_list = words[1] == "list" && words.size() == 5;
    const std::optional<PlyType> type = parse_type(words[is_list ? 3 : 1]);
    const std::optional<PlyType> list_count = is_list ? parse_type(words[2]) : std::nullopt;
    if (!type || (is_list && !list_count) || (!is_list && words.size() != 3))
      return "line " + std::to_string(number) + " declares no known property type";
    if (++properties_ > kMaxProperties)
      return "more than " + std::to_string(kMaxProperties) + " properties";
    header.elements.back().properties.push_back({std::string(words.back()), *type, list_count});
    return "";
  }

  size_t properties_ = 0;
};

}  // namespace

size_t size_of(PlyType type) {
  constexpr size_t kSizes[] = {1, 1, 2, 2, 4, 4, 4, 8};
  return kSizes[static_cast<size_t>(type)];
}

bool PlyElement::has_list() const {
  return std::any_of(properties.begin(), properties.end(),
                     [](const PlyProperty& p) { return p.list_count.has_value(); });
}

size_t PlyElement::row_bytes() const {
  size_t bytes = 0;
  for (const PlyProperty& property : properties)
    bytes += size_of(property.list_count.value_or(property.type));
  return bytes;
}

std::optional<size_t> PlyElement::find(std::string_view wanted) const {
  for (size_t i = 0; i < properties.size(); ++i) {
    if (properties[i].name == wanted) return i;
  }
  return std::nullopt;
}

const PlyElement* PlyHeader::find(std::string_view wanted) const {
  for (const PlyElement& element : elements) {
    if (element.name == wanted) return &element;
  }
  return nullptr;
}

std::string quoted(std::string_view word) {
  std::string text = "'";
  for (const char c : word.substr(0, 40)) text += (c >= 32 && c < 127) ? c : '?';
  return text + (word.size() > 40 ? "...'" : "'");
}

Result<PlyHeader> parse_ply_header(std::span<const std::byte> bytes, const std::string& name) {
  const auto corrupt = [&](const std::string& what) {
    return Status(StatusCode::kCorrupt, name + ": ply: " + what);
  };
  std::string_view text(reinterpret_cast<const char*>(bytes.data()),
                        std::min(bytes.size(), kMaxHeaderBytes));
  size_t at = text.starts_with(kByteOrderMark) ? kByteOrderMark.size() : 0;
  const std::string_view start = text.substr(at, 5);
  if (!start.starts_with("ply") || start.size() < 4 || !is_blank(start[3]))
    return corrupt("does not start with 'ply'");
  const char line_end = start.starts_with("ply\r") && start.back() != '\n' ? '\r' : '\n';
  HeaderParser parser;
  for (size_t number = 1;; ++number) {
    const size_t end = text.find(line_end, at);
    if (end == std::string_view::npos)
      return corrupt(number == 1 ? "does not start with 'ply'" : "the header has no end_header");
    const std::string_view line = text.substr(at, end - at);
    at = end + 1;
    const std::vector<std::string_view> words = split(line);
    if (number == 1) {
      if (words.size() != 1) return corrupt("does not start with 'ply'");
      continue;
    }
    if (!words.empty() && words[0] == "end_header") break;
    if (const std::string wrong = parser.take(line, number); !wrong.empty()) return corrupt(wrong);
  }
  if (!parser.has_format) return corrupt("the header has no format");
  parser.header.size_bytes = at;
  return std::move(parser.header);
}

double load_ply_value(const std::byte* data, PlyType type, bool swap) {
  std::array<std::byte, 8> bytes{};
  const size_t size = size_of(type);
  std::memcpy(bytes.data(), data, size);
  if (swap) std::reverse(bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(size));
  const auto as = [&]<class T>(T) {
    T value;
    std::memcpy(&value, bytes.data(), sizeof(T));
    return static_cast<double>(value);
  };
  switch (type) {
    case PlyType::kI8:
      return as(int8_t{});
    case PlyType::kU8:
      return as(uint8_t{});
    case PlyType::kI16:
      return as(int16_t{});
    case PlyType::kU16:
      return as(uint16_t{});
    case PlyType::kI32:
      return as(int32_t{});
    case PlyType::kU32:
      return as(uint32_t{});
    case PlyType::kF32:
      return as(float{});
    case PlyType::kF64:
      return as(double{});
  }
  return 0;
}

bool PlyCursor::skip_blanks(bool lines) {
  const char* text = reinterpret_cast<const char*>(body_.data());
  bool ended = false;
  while (at_ < body_.size() && is_blank(text[at_])) {
    if (text[at_] == '\n') {
      if (!lines) return true;
      ended = true;
    }
    ++at_;
  }
  return ended;
}

void PlyCursor::skip_line() {
  while (at_ < body_.size() && body_[at_] != std::byte{'\n'}) ++at_;
}

void PlyCursor::begin_row() {
  if (encoding_ != PlyEncoding::kAscii) return;
  skip_blanks(true);
  row_broken_ = false;
}

bool PlyCursor::end_row() {
  if (encoding_ != PlyEncoding::kAscii) return true;
  const bool at_end = skip_blanks(false) || at_ == body_.size();
  if (first_row_) rows_are_lines_ = at_end && !row_broken_;
  first_row_ = false;
  if (!rows_are_lines_ || at_end) return true;
  skip_line();
  return false;
}

PlyCursor::Read PlyCursor::read(PlyType type, double& value) {
  if (encoding_ == PlyEncoding::kAscii) return read_word(value);
  if (left() < size_of(type)) return Read::kDataEnd;
  value = load_ply_value(body_.data() + at_, type, encoding_ == PlyEncoding::kBigEndian);
  at_ += size_of(type);
  return Read::kValue;
}

PlyCursor::Read PlyCursor::skip_list(PlyType count, PlyType item) {
  double length = 0, value = 0;
  if (const Read one = read(count, length); one != Read::kValue)
    return one == Read::kNoNumber ? Read::kDataEnd : one;
  // Where the items end is then unknown; no item has less than a byte.
  if (!(length >= 0 && length <= static_cast<double>(left()))) return Read::kDataEnd;
  const auto items = static_cast<uint64_t>(length);
  if (encoding_ != PlyEncoding::kAscii) {
    if (items * size_of(item) > left()) return Read::kDataEnd;
    at_ += items * size_of(item);
    return Read::kValue;
  }
  Read worst = Read::kValue;
  for (uint64_t i = 0; i < items; ++i) {
    const Read one = read_word(value);
    if (one == Read::kRowEnd || one == Read::kDataEnd) return one;
    if (one != Read::kValue) worst = one;
  }
  return worst;
}

PlyCursor::Read PlyCursor::read_word(double& value) {
  const char* text = reinterpret_cast<const char*>(body_.data());
  if (skip_blanks(!rows_are_lines_)) {
    if (rows_are_lines_) return Read::kRowEnd;
    row_broken_ = true;
  }
  if (at_ == body_.size()) return Read::kDataEnd;
  size_t end = at_;
  while (end < body_.size() && !is_blank(text[end])) ++end;
  size_t start = at_;
  at_ = end;
  if (end - start > 1 && text[start] == '+' && text[start + 1] != '-')
    ++start;  // from_chars takes no plus sign
  const auto [stop, error] = std::from_chars(text + start, text + end, value);
  if (error == std::errc::result_out_of_range) {
    // Beyond a double: nothing or infinity, with the sign of the word.
    const std::string_view word(text + start, end - start);
    const bool tiny =
        word.find("e-") != std::string_view::npos || word.find("E-") != std::string_view::npos;
    value = tiny ? 0.0 : std::numeric_limits<double>::infinity();
    if (word.front() == '-') value = -value;
    return Read::kValue;
  }
  return error == std::errc() && stop == text + end ? Read::kValue : Read::kNoNumber;
}

bool PlyCursor::skip(const PlyElement& element) {
  if (element.properties.empty()) return true;  // rows of nothing, however many
  if (encoding_ != PlyEncoding::kAscii && !element.has_list()) {
    if (element.count > left() / element.row_bytes()) return false;
    at_ += element.count * element.row_bytes();
    return true;
  }
  rows_are_lines_ = false;
  double value = 0;
  for (uint64_t i = 0; i < element.count; ++i) {
    for (const PlyProperty& property : element.properties) {
      const Read one = property.list_count ? skip_list(*property.list_count, property.type)
                                           : read(property.type, value);
      if (one != Read::kValue) return false;
    }
  }
  first_row_ = true;
  return true;
}

bool PlyCursor::only_blanks_left() {
  skip_blanks(true);
  return at_ == body_.size();
}

}  // namespace figurine::ports
