// Makes a GaussianCloud of Gaussians as files store them, one by one: looks whether each can be
// drawn, and in the end where the origin of the scene is.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>

#include "ports/gaussians/gaussian_cloud.h"

namespace figurine::ports {

// In the units of the splatter, before they are looked at.
struct StoredGaussian {
  std::array<double, 3> position_m{};
  std::array<double, 3> scale_m{};          // standard deviations along its own axes
  std::array<double, 4> rotation{};         // wxyz, of any length; of none at all: unrotated
  double opacity = 0;                       // [0,1]
  std::array<double, size_t(3) * 16> sh{};  // [(d+1)^2,3], as many as the degree has
};

// What of f_rest is read: whole bands, at most degree 3.
struct ShLayout {
  uint32_t degree = 0;
  size_t stored_per_channel = 0;  // coefficients above degree 0 that the file has
  std::string remark;             // of bands that are not read; empty if all are
};
// of: so many values above degree 0 for the three channels together. False if they are no
// multiple of three.
bool find_sh_layout(size_t values, ShLayout& layout);

class CloudBuilder {
 public:
  // Memory for count Gaussians is reserved.
  CloudBuilder(std::string container, uint32_t sh_degree, size_t count);

  // row: what the file calls it, counted from 0. One that cannot be drawn is left out and counted:
  // a value that is not finite, a position, scale or colour beyond floats.
  void add(uint64_t row, const StoredGaussian& gaussian);
  void leave_out(uint64_t row, const std::string& why);
  void remark(std::string text) { cloud_.remarks.push_back(std::move(text)); }
  void set_up(UpAxis up) { cloud_.up = up; }
  void set_antialiased() { cloud_.antialiased = true; }

  // Moves the positions by the scene's origin.
  GaussianCloud finish() &&;

 private:
  GaussianCloud cloud_;
  std::vector<double> position_m_;  // [n,3] as in the file
  uint64_t unrotated_ = 0;
};

}  // namespace figurine::ports
