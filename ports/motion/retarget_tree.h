// Clips that are trees of nodes (BVH, glTF) in terms of the 55 joints, and onto a body.
#pragma once

#include "ports/motion/clip_tree.h"
#include "ports/motion/retarget.h"

namespace figurine::ports {

struct TreeKind {
  bool is_gltf = false;  // BVH otherwise: which neutral poses are looked for, and in which order
};

// Errors name the file, the joint or field and the reason; kUnsupported where no T-pose is found,
// with the option that says which pose to take.
Result<MotionClip> retarget_tree(ClipTree& tree, TreeKind kind, const figurine::Body& body,
                                 const RetargetOptions& options, RetargetReport* report);

}  // namespace figurine::ports
