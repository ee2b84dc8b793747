// A motion from any file that figurine reads, on a body, and the words that its provenance needs.
#pragma once

#include <string>

#include "figurine/body.h"
#include "toolchain/body/motion_clip.h"
#include "toolchain/body/retarget.h"

namespace figurine::body {

// Where a clip is from and under which terms: CMU's sentence for .bvh; for a .glb in the unpacked
// npm package @dcl/wearable-preview that package, its version and its licence, as package.json
// beside the folder states them; the provenance of a motion package .fgn. Anything else is the
// user's, whatever project its folder lies in.
std::string clip_source(const std::string& path);

// Reads .bvh, .npz and .glb, moved onto the body by `options`, and .fgn as it is. InputError naming
// the file, also for any other ending.
MotionClip read_clip(const std::string& path, const figurine::Body& body,
                     const RetargetOptions& options, RetargetReport* report = nullptr);

}  // namespace figurine::body
