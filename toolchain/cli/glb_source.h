// Where a .glb is from and under which terms, for the provenance of what is made from it.
#pragma once

#include <string>

namespace figurine::cli {

// A clip in a folder of the unpacked npm package @dcl/wearable-preview is named with that package, its version and its licence, as
// package.json beside the folder states them. Any other is the user's, whatever project its folder lies in.
std::string glb_source(const std::string& path);

}  // namespace figurine::cli
