// A sampled avatar behind a handle: what the sampler makes and a renderer takes.
#pragma once

#include "figurine/avatar_sampler.h"
#include "runtime/src/c/c_package.h"

namespace figurine::c {

struct SampledObject final : Object {
  static constexpr ObjectKind kKind = ObjectKind::kSampled;
  Pin<PackageObject> package;  // of the sampler: the avatar borrows from it
  SampledAvatar sampled;
};

}  // namespace figurine::c
