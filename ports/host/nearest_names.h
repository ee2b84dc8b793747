// What a misspelt name may have meant.
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace figurine::ports {

// Up to three of the names that a misspelt one may have meant, the likeliest first: by the number
// of letters to change, add, leave out or swap with a neighbour. Empty where none is near.
std::vector<std::string> nearest_names(std::string_view name, std::span<const std::string> names);

}  // namespace figurine::ports
