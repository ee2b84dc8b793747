// Strings from outside: what a package may hold as text, before anything prints it.
#pragma once

#include <string_view>

namespace figurine {

// Well-formed UTF-8 (no overlong forms, surrogates or values above U+10FFFF) without control
// characters (U+0000..1F, U+7F..9F), so that a name cannot steer a terminal. Tab and newline are
// let through where allow_lines is set.
bool is_clean_text(std::string_view text, bool allow_lines);

// Not empty, [a-z0-9_.] only.
bool is_blob_name(std::string_view name);

}  // namespace figurine
