// The frame of figurine's pages: self-contained HTML, no script, nothing from the network, readable
// in light and dark and on a phone. What is on a page is its writer's; how it looks is here.
#pragma once

#include <cstddef>
#include <span>
#include <string>

namespace figurine::samples {

// Text for any place in a page, an attribute's value included: what HTML reserves is escaped, what
// is no character of UTF-8, or a control character, becomes U+FFFD. Texts of packages are hostile.
std::string escape_html(const std::string& text);

// A whole page. title is text; style (CSS beside the frame's own) and body are HTML.
std::string html_page(const std::string& title, const std::string& body,
                      const std::string& style = "");

// Parts of a body, of text: an entry of a <dl class="facts">; a picture in a <figure>.
std::string html_fact(const std::string& name, const std::string& value);
std::string html_figure(std::span<const std::byte> png, const std::string& caption);

}  // namespace figurine::samples
