// A package behind a handle, and what packages, poses and cameras are between C and C++.
#pragma once

#include "figurine.h"
#include "figurine/package.h"
#include "runtime/src/base/memory.h"
#include "runtime/src/c/handles.h"

namespace figurine::c {

struct PackageObject final : Object {
  static constexpr ObjectKind kKind = ObjectKind::kPackage;
  PackageObject(Buffer<std::byte>&& bytes, Package&& opened)
      : copy(std::move(bytes)), package(std::move(opened)) {}
  Buffer<std::byte> copy;  // empty where the bytes are the caller's
  Package package;
};

// kMismatch "a KIND is wanted, not a KIND".
Status check_kind(const Package& package, PackageKind wanted);

Result<PoseView> pose_of(const fig_pose* pose);
Result<Camera> camera_of(const fig_camera* camera);

}  // namespace figurine::c
