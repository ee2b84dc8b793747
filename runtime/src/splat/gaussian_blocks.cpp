#include "runtime/src/splat/gaussian_blocks.h"

namespace figurine {

bool GaussianArrays::ensure(uint32_t count, uint32_t sh_degree) {
  const size_t n = count;
  return position_m.ensure(n * 3) && covariance_factor.ensure(n * 9) && opacity.ensure(n) &&
         sh.ensure(n * 3 * sh_coefficients(sh_degree));
}

void GaussianArrays::store(const kernels::GaussianBlock& from, uint32_t block, uint32_t lanes,
                           uint32_t sh_degree) {
  const size_t sh_values = size_t{3} * sh_coefficients(sh_degree);
  for (uint32_t lane = 0; lane < lanes; ++lane) {
    const size_t i = size_t{block} * kernels::kLanes + lane;
    for (size_t k = 0; k < 3; ++k) position_m[3 * i + k] = from.position_m[k][lane];
    for (size_t k = 0; k < 9; ++k) covariance_factor[9 * i + k] = from.factor[k][lane];
    opacity[i] = from.opacity[lane];
    for (size_t k = 0; k < sh_values; ++k) sh[sh_values * i + k] = from.sh[k][lane];
  }
}

GaussianView GaussianArrays::view(uint32_t count, uint32_t sh_degree) const {
  const size_t n = count;
  return {.count = count,
          .sh_degree = sh_degree,
          .position_m = position_m.span(3 * n),
          .covariance_factor = covariance_factor.span(9 * n),
          .opacity = opacity.span(n),
          .sh = sh.span(3 * n * sh_coefficients(sh_degree))};
}

uint32_t load_block(const GaussianView& view, uint32_t block, kernels::GaussianBlock& out) {
  const uint32_t lanes = lanes_of_block(block, view.count);
  const size_t sh_values = size_t{3} * sh_coefficients(view.sh_degree);
  for (uint32_t lane = 0; lane < lanes; ++lane) {
    const size_t i = size_t{block} * kernels::kLanes + lane;
    for (size_t k = 0; k < 3; ++k) out.position_m[k][lane] = view.position_m[3 * i + k];
    for (size_t k = 0; k < 9; ++k) out.factor[k][lane] = view.covariance_factor[9 * i + k];
    out.opacity[lane] = view.opacity[i];
    for (size_t k = 0; k < sh_values; ++k) out.sh[k][lane] = view.sh[sh_values * i + k];
  }
  return lanes;
}

}  // namespace figurine
