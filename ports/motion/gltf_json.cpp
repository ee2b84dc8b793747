#include "ports/motion/gltf_json.h"

namespace figurine::ports {
namespace {

constexpr double kMaxMagnitude = 1e6;
constexpr size_t kMaxJsonValues = size_t{1} << 21;
constexpr size_t kMaxJsonDepth = 64;

const nlohmann::json& nothing() {
  static const nlohmann::json null;
  return null;
}

// Reads the text through without keeping anything: what is wrong with it, and how large it gets.
class Measure : public nlohmann::json_sax<nlohmann::json> {
 public:
  using Json = nlohmann::json;
  std::string error;

  bool null() override { return value(); }
  bool boolean(bool) override { return value(); }
  bool number_integer(Json::number_integer_t) override { return value(); }
  bool number_unsigned(Json::number_unsigned_t) override { return value(); }
  bool number_float(Json::number_float_t, const Json::string_t&) override { return value(); }
  bool string(Json::string_t&) override { return value(); }
  bool binary(Json::binary_t&) override { return value(); }
  bool start_object(size_t) override { return deeper(); }
  bool key(Json::string_t&) override { return value(); }
  bool end_object() override { return --depth_, true; }
  bool start_array(size_t) override { return deeper(); }
  bool end_array() override { return --depth_, true; }
  bool parse_error(size_t position, const std::string&,
                   const nlohmann::detail::exception& exception) override {
    error = exception.id == 101 ? "not valid at byte " + std::to_string(position)
                                : "a number is out of range";
    return false;
  }

 private:
  bool value() {
    if (++values_ <= kMaxJsonValues) return true;
    error = "more than 2^21 values";
    return false;
  }
  bool deeper() {
    if (++depth_ > kMaxJsonDepth) error = "nested deeper than 64";
    return error.empty() && value();
  }
  size_t values_ = 0, depth_ = 0;
};

int sextet(char c) {
  if (c >= 'A' && c <= 'Z') return c - 'A';
  if (c >= 'a' && c <= 'z') return c - 'a' + 26;
  if (c >= '0' && c <= '9') return c - '0' + 52;
  if (c == '+' || c == '-') return 62;  // RFC 4648, both alphabets
  return c == '/' || c == '_' ? 63 : -1;
}

}  // namespace

std::string gltf_excerpt(const std::string& text, size_t longest) {
  std::string out = text.substr(0, longest);
  for (char& c : out) {
    if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) c = '?';
  }
  return out;
}

Field Field::missing(const char* key) const {
  return {nothing(), path_.empty() ? key : path_ + "." + key, *error_};
}

Field Field::operator[](const char* key) const {
  const Field named = missing(key);
  if (!is_object()) {
    fail("not an object");
    return named;
  }
  const auto found = value_->find(key);
  if (found == value_->end()) {
    named.fail("missing");
    return named;
  }
  return {*found, named.path_, *error_};
}

Field Field::of(const Field& array) const {
  const uint64_t index = count();
  const size_t size = ok() ? array.size() : 0;
  if (index < size) return array[static_cast<size_t>(index)].with(*error_);
  fail(std::to_string(index) + ": there are only " + std::to_string(size) + " " + array.path_);
  return {nothing(), path_, *error_};
}

double Field::number() const {
  if (!value_->is_number()) {
    fail("not a number");
    return 0;
  }
  const double number = value_->get<double>();
  if (std::abs(number) <= kMaxMagnitude) return number;
  fail("not finite or out of range");
  return 0;
}

const std::string& Field::whole_text() const {
  static const std::string none;
  if (value_->is_string()) return value_->get_ref<const std::string&>();
  fail("not a string");
  return none;
}

bool Field::flag_or_false(const char* key) const {
  if (!has(key)) return false;
  const Field field = (*this)[key];
  if (field.value_->is_boolean()) return field.value_->get<bool>();
  field.fail("neither true nor false");
  return false;
}

Result<nlohmann::json> parse_gltf_json(std::span<const std::byte> text, const std::string& where) {
  const auto* first = reinterpret_cast<const char*>(text.data());
  const auto* last = first + text.size();
  Measure measure;
  if (!nlohmann::json::sax_parse(first, last, &measure)) {
    return Status(StatusCode::kCorrupt,
                  where + ": JSON: " + (measure.error.empty() ? "not valid" : measure.error));
  }
  return nlohmann::json::parse(first, last, nullptr, false);
}

bool decode_data_uri(const std::string& uri, std::vector<std::byte>& bytes) {
  constexpr std::string_view kBase64 = ";base64,";
  const size_t comma = uri.find(',');
  if (!uri.starts_with("data:") || comma == std::string::npos || comma < kBase64.size() ||
      std::string_view(uri).substr(comma + 1 - kBase64.size(), kBase64.size()) != kBase64) {
    return false;
  }
  size_t end = uri.size();
  while (end > comma + 1 && uri[end - 1] == '=') --end;
  bytes.clear();
  bytes.reserve((end - comma) * 3 / 4);
  uint32_t word = 0;
  int bits = 0;
  for (size_t i = comma + 1; i < end; ++i) {
    const int six = sextet(uri[i]);
    if (six < 0) return false;
    word = (word << 6 | static_cast<uint32_t>(six)) & 0xFFFFFF;
    bits += 6;
    if (bits < 8) continue;
    bits -= 8;
    bytes.push_back(static_cast<std::byte>(word >> bits & 0xFF));
  }
  return bits < 6;
}

}  // namespace figurine::ports
