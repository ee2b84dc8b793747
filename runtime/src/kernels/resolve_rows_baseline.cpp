// A blended tile's pixels to bytes or floats: the specification of every other kernel.
#include "runtime/src/kernels/kernel.h"

namespace figurine::kernels {
namespace {

uint8_t to_byte(float value) {
  value = value > 0 ? value : 0;  // NaN too
  value = value < 1 ? value : 1;
  return static_cast<uint8_t>(static_cast<int32_t>(value * 255.0f + 0.5f));
}

struct BytePixel {
  uint8_t channel[4];
  void set(int i, float value) { channel[i] = to_byte(value); }
};

struct FloatPixel {
  float channel[4];
  void set(int i, float value) { channel[i] = value; }
};

template <class Pixel>
void over_background(const float* colour, float transmittance, const float* background,
                     Pixel& pixel) {
  for (int c = 0; c < 3; ++c) pixel.set(c, colour[c] + transmittance * background[c]);
  pixel.set(3, 1.0f);
}

// Where nothing was blended all four channels are 0.
template <class Pixel>
void straight(const float* colour, float transmittance, Pixel& pixel) {
  const float alpha = 1.0f - transmittance;
  const bool seen = alpha > 0;
  for (int c = 0; c < 3; ++c) pixel.set(c, seen ? colour[c] / alpha : 0.0f);
  pixel.set(3, seen ? alpha : 0.0f);
}

template <class Pixel>
void resolve(const ResolveRowsJob& job) {
  const TilePixels& pixels = *job.pixels;
  for (int32_t row = 0; row < job.rows; ++row) {
    const int32_t first = (job.first_row + row) * kTileSize;
    uint8_t* out = job.out + static_cast<uint64_t>(row) * job.stride_bytes;
    for (int32_t x = 0; x < job.width; ++x) {
      const int32_t i = first + x;
      const float colour[3] = {pixels.red[i], pixels.green[i], pixels.blue[i]};
      const float transmittance = __builtin_fabsf(pixels.transmittance[i]);
      Pixel pixel;
      if (job.background != nullptr) {
        over_background(colour, transmittance, job.background, pixel);
      } else {
        straight(colour, transmittance, pixel);
      }
      __builtin_memcpy(out + static_cast<uint64_t>(x) * sizeof(pixel), &pixel, sizeof(pixel));
    }
  }
}

}  // namespace

void resolve_rows_baseline(const ResolveRowsJob& job) {
  job.format == kResolveRgba8 ? resolve<BytePixel>(job) : resolve<FloatPixel>(job);
}

}  // namespace figurine::kernels
