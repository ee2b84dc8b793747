// The smallest extents of a person's texels (SmallestExtents in figurine/avatar.h): what the
// sharpest training view that saw a texel could resolve of it. Measured once, before training, and
// rounded then to what a package holds, so that training, evaluation and device have the same.
// Based on: Yu et al., Mip-Splatting, CVPR 2024 (the 3D smoothing filter and its sampling rate).
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "figurine/avatar.h"
#include "toolchain/dataset/dataset.h"

namespace figurine::train {

class AvatarModel;

class SmallestExtentMap {
 public:
  // Of so many texels, without any extents yet.
  explicit SmallestExtentMap(size_t texels) : texels_(texels) {}

  // Throws InputError "WHERE: smallest extents: reason".
  void set(float scale_m, std::vector<uint8_t> codes, const std::string& where);

  bool empty() const { return codes_.empty(); }
  size_t texels() const { return texels_; }
  SmallestExtents view() const;                                     // borrows from this object
  const std::vector<float>& extent_m() const { return extent_m_; }  // [texels], or empty

 private:
  size_t texels_;
  float scale_m_ = 0;
  std::vector<uint8_t> codes_;
  std::vector<float> extent_m_;
};

// In steps of 1/255 of the largest, at least one step each. extent_m: [texels] > 0.
void round_extents(const std::vector<float>& extent_m, const std::string& where,
                   SmallestExtentMap& map);

// sqrt(0.2) depth / focal length of the view, of all that saw it, where that is least. A view saw a
// texel if it lies inside the picture and its mask, and its surface faces the camera; what is in
// front of it is not asked. Views are those of training cameras at kExtentPoses training poses,
// spread evenly. A texel that no view saw has the largest extent of all that were seen. [texels]
// metres. Throws InputError if none was seen, or an image is damaged.
inline constexpr size_t kExtentPoses = 24;
std::vector<float> measure_extents(const dataset::Dataset& data, const AvatarModel& model);

}  // namespace figurine::train
