#include "samples/common/html_page.h"

#include <algorithm>
#include <cstdint>
#include <string_view>

namespace figurine::samples {

namespace {

constexpr const char* kStyle = R"css(
:root { --paper: #fbfbf9; --ink: #1d2125; --soft: #667079; --line: #dcdfe1; --card: #ffffff;
        --accent: #b5432a; --blue: #2b6a99; color-scheme: light dark; }
@media (prefers-color-scheme: dark) {
  :root { --paper: #16181b; --ink: #e8e9ea; --soft: #98a1a9; --line: #33383d; --card: #1d2024;
          --accent: #f08a6b; --blue: #7db9e3; }
}
* { box-sizing: border-box; }
body { margin: 0 auto; max-width: 1180px; padding: 40px 28px 64px; background: var(--paper);
       color: var(--ink);
       font: 15px/1.55 system-ui, "Segoe UI", "DejaVu Sans", sans-serif; }
@media (max-width: 600px) { body { padding: 20px 14px 40px; } }
h1 { font-size: 26px; font-weight: 650; margin: 0 0 4px; letter-spacing: -0.01em;
     overflow-wrap: anywhere; }
h2 { font-size: 18px; font-weight: 650; margin: 44px 0 6px; }
p { max-width: 78ch; margin: 6px 0 14px; overflow-wrap: anywhere; }
.soft, .facts dt { color: var(--soft); }
.facts { display: grid; grid-template-columns: repeat(auto-fit, minmax(190px, 1fr));
         gap: 14px 28px; margin: 22px 0 8px; padding: 16px 20px;
         background: var(--card); border: 1px solid var(--line); border-radius: 8px; }
.facts dt { font-size: 12.5px; }
.facts dd { margin: 0; overflow-wrap: anywhere; font-variant-numeric: tabular-nums; }
h1, dd, td, li, figcaption { unicode-bidi: isolate; }
figure { margin: 0; padding: 14px 14px 8px; background: var(--card);
         border: 1px solid var(--line); border-radius: 8px; }
figcaption { font-size: 13px; color: var(--soft); padding: 4px 4px 6px; overflow-wrap: anywhere; }
.wide { overflow-x: auto; }
table { border-collapse: collapse; width: 100%; margin: 18px 0;
        font-variant-numeric: tabular-nums; }
th { text-align: right; font-weight: 600; font-size: 13px; color: var(--soft);
     border-bottom: 1.5px solid var(--line); padding: 6px 10px; }
td { text-align: right; border-bottom: 1px solid var(--line); padding: 6px 10px; }
th:first-child, td:first-child { text-align: left; }
.pictures { display: grid; grid-template-columns: repeat(auto-fit, minmax(200px, 1fr)); gap: 18px; }
.pictures img { width: 100%; display: block; border-radius: 4px; }
)css";

// Bytes of the well-formed UTF-8 character in front of text; 0: there is none.
size_t character_bytes(std::string_view text) {
  const auto byte = [&](size_t i) {
    return i < text.size() ? static_cast<unsigned char>(text[i]) : 0u;
  };
  const unsigned first = byte(0);
  if (first < 0x80) return 1;
  const size_t size = first >= 0xF0 ? 4 : first >= 0xE0 ? 3 : 2;
  if (first < 0xC2 || first > 0xF4) return 0;
  for (size_t i = 1; i < size; ++i) {
    if ((byte(i) & 0xC0) != 0x80) return 0;
  }
  const bool overlong = (first == 0xE0 && byte(1) < 0xA0) || (first == 0xF0 && byte(1) < 0x90);
  const bool none = (first == 0xED && byte(1) > 0x9F) || (first == 0xF4 && byte(1) > 0x8F);
  return overlong || none ? 0 : size;
}

std::string base64(std::span<const std::byte> bytes) {
  constexpr char kDigits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  text.reserve((bytes.size() + 2) / 3 * 4);
  for (size_t i = 0; i < bytes.size(); i += 3) {
    uint32_t group = 0;
    for (size_t k = 0; k < 3; ++k)
      group = group << 8 | (i + k < bytes.size() ? static_cast<uint32_t>(bytes[i + k]) : 0);
    for (size_t k = 0; k < 4; ++k)
      text +=
          k <= std::min<size_t>(3, bytes.size() - i) ? kDigits[group >> (18 - 6 * k) & 63] : '=';
  }
  return text;
}

}  // namespace

std::string escape_html(const std::string& text) {
  constexpr const char* kNone = "\xEF\xBF\xBD";
  std::string result;
  for (size_t i = 0; i < text.size();) {
    const size_t size = character_bytes(std::string_view(text).substr(i));
    const std::string_view character = std::string_view(text).substr(i, std::max<size_t>(size, 1));
    i += character.size();
    const char c = character[0];
    if (size == 0 || (size == 1 && ((c < ' ' && c != '\n' && c != '\t') || c == 127))) {
      result += kNone;
    } else if (size == 2 && c == '\xC2' && static_cast<unsigned char>(character[1]) < 0xA0) {
      result += kNone;  // control characters beyond ASCII
    } else if (c == '&') {
      result += "&amp;";
    } else if (c == '<') {
      result += "&lt;";
    } else if (c == '>') {
      result += "&gt;";
    } else if (c == '"') {
      result += "&quot;";
    } else if (c == '\'') {
      result += "&#39;";
    } else {
      result += character;
    }
  }
  return result;
}

std::string html_page(const std::string& title, const std::string& body, const std::string& style) {
  return "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><meta name=\"viewport\" "
         "content=\"width=device-width, initial-scale=1\">\n<title>" +
         escape_html(title) + "</title><style>" + kStyle + style + "</style></head><body>\n" +
         body + "</body></html>\n";
}

std::string html_fact(const std::string& name, const std::string& value) {
  return "<div><dt>" + escape_html(name) + "</dt><dd>" + escape_html(value) + "</dd></div>\n";
}

std::string html_figure(std::span<const std::byte> png, const std::string& caption) {
  return "<figure><img alt=\"" + escape_html(caption) + "\" src=\"data:image/png;base64," +
         base64(png) + "\"><figcaption>" + escape_html(caption) + "</figcaption></figure>\n";
}

}  // namespace figurine::samples
