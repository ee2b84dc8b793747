// A motion from any file that figurine reads, on a body, and the words that its provenance needs.
#pragma once

#include <cstddef>
#include <span>
#include <string>

#include "figurine/body.h"
#include "ports/motion/motion_clip.h"
#include "ports/motion/retarget.h"

namespace figurine::ports {

enum class ClipKind : uint8_t { kBvh, kNpz, kGltf, kPackage };

// By the name's ending, in any case of letters: .bvh; .npz; .glb, .gltf, .vrm, .vrma; .fgn.
// kUnsupported for any other.
Result<ClipKind> clip_kind(const std::string& path);

// Where a clip is from and under which terms, told by what is in it: CMU's sentence for the two
// clips of that database that Debian's assimp-testmodels holds; for a .glb in the unpacked npm
// package @dcl/wearable-preview that package, its version and its licence, as package.json beside
// the folder states them; the provenance of a motion package .fgn. Anything else is the user's, by
// its own name, whatever project its folder lies in.
Result<std::string> clip_source(const std::string& path);

// Reads a clip and moves it onto the body by `options`, and .fgn as it is. Errors name the file.
Result<MotionClip> read_clip(const std::string& path, const figurine::Body& body,
                             const RetargetOptions& options, RetargetReport* report = nullptr);
// The same of bytes; no package.
Result<MotionClip> read_clip(std::span<const std::byte> bytes, const std::string& where,
                             ClipKind kind, const figurine::Body& body,
                             const RetargetOptions& options, RetargetReport* report = nullptr);

}  // namespace figurine::ports
