// Writes one identity in MVHumanNet's layout, so that the one reader (toolchain/dataset) serves
// real and synthetic captures alike (docs/capture.md).
#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "figurine/pose.h"
#include "ports/host/folder_lock.h"
#include "toolchain/capture/camera_rings.h"
#include "toolchain/capture/mesh.h"
#include "toolchain/capture/renderer.h"
#include "toolchain/capture/sequence.h"
#include "toolchain/capture/wardrobe.h"

namespace figurine::capture {

// Everything about an identity that is not pixels.
struct IdentityRecord {
  uint32_t identity = 0;
  uint64_t seed = 0;
  std::string tool;
  std::string body_name, body_hash, skeleton_hash;
  std::vector<std::string> sources;
  std::string folds;  // to_string(FoldMode)
  WardrobeLimits limits;
  std::array<float, 3> root_rest_m{0, 0, 0};  // of the person's own shape
};

class IdentityLayout {
 public:
  // directory is made if it is not there. InputError if it holds a capture of another request, or
  // one at all without `resume`.
  IdentityLayout(std::string directory, const IdentityRecord& record, const Person& person,
                 const std::vector<RingCamera>& cameras, const std::vector<CapturedPose>& sequence);

  // Cameras, poses and figurine.json (complete: false), as far as not there yet. From then on the
  // folder is this object's: InputError if another process is at work in it.
  void begin(bool resume);
  bool has_image(size_t frame, size_t camera) const;
  void write_image(size_t frame, size_t camera, const Rendering& rendering) const;
  // figurine.json once more, now complete.
  void finish() const;

 private:
  void describe_cameras();
  std::string image_path(size_t frame, size_t camera) const;
  std::string mask_path(size_t frame, size_t camera) const;
  void write_json(const std::string& path, const nlohmann::ordered_json& value) const;

  std::string directory_;
  std::optional<ports::FolderLock> lock_;
  std::array<float, 3> root_rest_m_;
  nlohmann::ordered_json about_;  // figurine.json
  const std::vector<RingCamera>& cameras_;
  const std::vector<CapturedPose>& sequence_;
};

}  // namespace figurine::capture
