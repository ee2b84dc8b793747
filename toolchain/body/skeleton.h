// The 55 joints that every body of this project has (ports/motion/skeleton.h), under this folder's
// names.
#pragma once

#include "ports/motion/skeleton.h"

namespace figurine::body {

using ports::joint_names;
using ports::joint_parents;
using ports::kJointCount;
using enum ports::Joint;

}  // namespace figurine::body
