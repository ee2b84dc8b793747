// SSIM and its gradient on the CPU: a fused, separable, threaded 11x11 window. Torch's grouped
// convolutions take several times as long.
//
// As in 3DGS: Gaussian window of sigma 1.5, zero padding, constants 0.01^2 and 0.03^2, mean over
// all pixels and channels. Based on: Wang et al., Image Quality Assessment: From Error Visibility
// to Structural Similarity, 2004, eq. 13.
#pragma once

#include <cstdint>
#include <vector>

namespace figurine::model {

template <class Scalar>
struct PlanarImages {
  const Scalar* x = nullptr;  // [channels,height,width]
  const Scalar* y = nullptr;
  uint32_t channels = 0, height = 0, width = 0;
};

// Scratch that is reused from call to call.
template <class Scalar>
struct SsimScratch {
  std::vector<Scalar> tile_sums;
};

// The mean SSIM of the two images and, where gradient is not null, d(mean SSIM)/dx
// [channels,height,width]. The same for any number of threads.
template <class Scalar>
double ssim(const PlanarImages<Scalar>& images, uint32_t threads, SsimScratch<Scalar>& scratch,
            Scalar* gradient);

extern template double ssim(const PlanarImages<float>&, uint32_t, SsimScratch<float>&, float*);
extern template double ssim(const PlanarImages<double>&, uint32_t, SsimScratch<double>&, double*);

}  // namespace figurine::model
