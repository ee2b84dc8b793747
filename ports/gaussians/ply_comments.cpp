#include "ports/gaussians/ply_comments.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <string_view>

#include "ports/gaussians/ply.h"

namespace figurine::ports {

namespace {

std::string lower(std::string_view text) {
  std::string result(text);
  std::transform(result.begin(), result.end(), result.begin(),
                 [](char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c + 32) : c; });
  return result;
}

// The comment without key and the colon or blank behind it; nothing if it begins otherwise.
std::optional<std::string> value_of(const std::string& comment, std::string_view key) {
  if (!comment.starts_with(key)) return std::nullopt;
  const std::string_view rest = std::string_view(comment).substr(key.size());
  if (!rest.empty() && rest.front() != ':' && rest.front() != '=' && rest.front() != ' ' &&
      rest.front() != '\t')
    return std::nullopt;
  const size_t start = std::min(rest.find_first_not_of(":= \t"), rest.size());
  return std::string(rest.substr(start));
}

std::string_view first_word(const std::string& value) {
  return std::string_view(value).substr(0, std::min(value.find_first_of(" \t;,"), value.size()));
}

std::optional<UpAxis> up_of(const std::string& value) {
  if (value == "x" || value == "+x") return UpAxis::kPlusX;
  if (value == "z" || value == "+z") return UpAxis::kPlusZ;
  double up[3];
  const char *at = value.data(), *end = value.data() + value.size();
  for (double& component : up) {
    while (at != end && *at == ' ') ++at;
    const auto [stop, error] = std::from_chars(at, end, component);
    if (error != std::errc() || !std::isfinite(component)) return std::nullopt;
    at = stop;
  }
  const auto largest = static_cast<size_t>(
      std::max_element(up, up + 3, [](double a, double b) { return std::abs(a) < std::abs(b); }) -
      up);
  if (up[largest] == 0) return std::nullopt;
  return static_cast<UpAxis>(2 * largest + (up[largest] < 0 ? 1 : 0));
}

}  // namespace

PlyDrawing read_drawing_comments(std::span<const std::string> comments) {
  PlyDrawing drawing;
  for (const std::string& original : comments) {
    const std::string comment = lower(original);
    if (const auto mode = value_of(comment, "splatrendermode")) {
      const std::string_view word = first_word(*mode);
      if (word == "mip" || word == "default") drawing.antialiased = word == "mip";
      drawing.flat = word == "2dgs";
    } else if (const auto said = value_of(comment, "antialiased")) {
      const std::string_view word = first_word(*said);
      drawing.antialiased = word != "0" && word != "false" && word != "no" && word != "off";
    } else if (const auto rasterize = value_of(comment, "rasterize_mode")) {
      const std::string_view word = first_word(*rasterize);
      if (word == "antialiased" || word == "classic") drawing.antialiased = word == "antialiased";
    } else if (const auto axis = value_of(comment, "vertical axis")) {
      if (const std::optional<UpAxis> up = up_of(*axis)) drawing.up = up;
    }
  }
  return drawing;
}

std::vector<std::string> drawing_comments(bool antialiased, std::optional<UpAxis> up) {
  constexpr const char* kVectors[] = {"1 0 0", "-1 0 0", "0 1 0", "0 -1 0", "0 0 1", "0 0 -1"};
  std::vector<std::string> comments;
  if (up) comments.push_back(std::string("Vertical axis: ") + kVectors[static_cast<size_t>(*up)]);
  comments.push_back(std::string("SplatRenderMode: ") + (antialiased ? "mip" : "default"));
  return comments;
}

}  // namespace figurine::ports
