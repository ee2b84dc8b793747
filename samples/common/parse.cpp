#include "samples/common/parse.h"

#include <charconv>
#include <cmath>

namespace figurine::samples {

namespace {

template <class T>
bool parse_number(std::string_view text, T& value) {
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  return error == std::errc() && end == text.data() + text.size();
}

Status invalid(const std::string& what) { return Status(StatusCode::kInvalidArgument, what); }

std::string quoted(std::string_view text) { return "'" + std::string(text) + "'"; }

}  // namespace

std::optional<std::vector<double>> parse_numbers(std::string_view text, size_t max_count) {
  std::vector<double> values;
  while (true) {
    const size_t comma = text.find(',');
    double value = 0;
    if (!parse_number(text.substr(0, comma), value) || !std::isfinite(value) ||
        values.size() == max_count)
      return std::nullopt;
    values.push_back(value);
    if (comma == std::string_view::npos) return values;
    text.remove_prefix(comma + 1);
  }
}

Result<ImageSize> parse_size(std::string_view text) {
  const size_t cross = text.find('x');
  ImageSize size;
  if (cross == std::string_view::npos || !parse_number(text.substr(0, cross), size.width_px) ||
      !parse_number(text.substr(cross + 1), size.height_px)) {
    return invalid("size " + quoted(text) + " is not WIDTHxHEIGHT");
  }
  for (const uint32_t side : {size.width_px, size.height_px}) {
    if (side < 1 || side > 16384)
      return invalid("size " + quoted(text) + ": a side is not within 1 and 16384 pixels");
  }
  return size;
}

Result<FrameRange> parse_frames(std::string_view text) {
  FrameRange range;
  const size_t colon = text.find(':');
  if (colon == std::string_view::npos) {
    if (!parse_number(text, range.first) || range.first == UINT32_MAX)
      return invalid("frames " + quoted(text) + ": not N, A:B or A:B:STEP");
    range.end = range.first + 1;
    return range;
  }
  const std::string_view first = text.substr(0, colon);
  std::string_view end = text.substr(colon + 1), step;
  const size_t second_colon = end.find(':');
  if (second_colon != std::string_view::npos) {
    step = end.substr(second_colon + 1);
    end = end.substr(0, second_colon);
  }
  uint32_t last = 0;
  const bool has_step = second_colon != std::string_view::npos;
  if ((!first.empty() && !parse_number(first, range.first)) ||
      (!end.empty() && !parse_number(end, last)) || (has_step && !parse_number(step, range.step))) {
    return invalid("frames " + quoted(text) + ": not N, A:B or A:B:STEP");
  }
  if (range.step < 1) return invalid("frames " + quoted(text) + ": the step must be at least 1");
  if (!end.empty()) range.end = last;
  if (range.end && *range.end <= range.first)
    return invalid("frames " + quoted(text) + ": holds no frame");
  return range;
}

Result<Background> parse_background(std::string_view text) {
  if (text == "alpha") return Background{};
  if (text == "black") return Background{{{0, 0, 0}}};
  if (text == "grey") return Background{{{0.5f, 0.5f, 0.5f}}};
  if (text == "white") return Background{{{1, 1, 1}}};
  std::array<float, 3> colour{};
  if (text.size() == 7 && text[0] == '#') {
    uint32_t code = 0;
    const auto [end, error] = std::from_chars(text.data() + 1, text.data() + 7, code, 16);
    if (error == std::errc() && end == text.data() + 7) {
      for (int k = 0; k < 3; ++k)
        colour[k] = static_cast<float>((code >> (16 - 8 * k)) & 255) / 255.0f;
      return Background{colour};
    }
  }
  const std::optional<std::vector<double>> values = parse_numbers(text, 3);
  bool sound = values && values->size() == 3;
  for (int k = 0; sound && k < 3; ++k) {
    sound = (*values)[k] >= 0 && (*values)[k] <= 1;
    colour[k] = static_cast<float>((*values)[k]);
  }
  if (!sound)
    return invalid("background " + quoted(text) +
                   ": not alpha, black, grey, white, #RRGGBB or R,G,B within 0 and 1");
  return Background{colour};
}

Result<Placement> parse_placement(std::string_view text) {
  const std::optional<std::vector<double>> values = parse_numbers(text, 3);
  if (!values || values->size() < 2)
    return invalid("place " + quoted(text) + ": not X,Z or X,Z,HEADING");
  for (const double value : *values) {
    if (std::abs(value) > 1e4)
      return invalid("place " + quoted(text) + ": a value is beyond 10000");
  }
  return Placement{static_cast<float>((*values)[0]), static_cast<float>((*values)[1]),
                   values->size() == 3 ? static_cast<float>((*values)[2]) : 0.0f};
}

Result<NumberedName> NumberedName::parse(const std::string& text) {
  NumberedName result;
  const size_t percent = text.find('%');
  if (percent == std::string::npos) {
    result.before_ = text;
    return result;
  }
  size_t at = percent + 1;
  if (at < text.size() && text[at] == '0') ++at;
  if (at < text.size() && text[at] >= '1' && text[at] <= '9' && at > percent + 1)
    result.digits_ = static_cast<uint32_t>(text[at++] - '0');
  if (at >= text.size() || text[at] != 'd' || text.find('%', at) != std::string::npos) {
    return invalid(text + ": a numbered name has one %d or %04d in it");
  }
  result.before_ = text.substr(0, percent);
  result.after_ = text.substr(at + 1);
  result.numbered_ = true;
  return result;
}

std::string NumberedName::name(uint32_t number) const {
  if (!numbered_) return before_;
  std::string digits = std::to_string(number);
  if (digits.size() < digits_) digits.insert(0, digits_ - digits.size(), '0');
  return before_ + digits + after_;
}

}  // namespace figurine::samples
