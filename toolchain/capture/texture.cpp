#include "toolchain/capture/texture.h"

#include <xmmintrin.h>

#include <algorithm>
#include <cmath>

#include "ports/host/files.h"
#include "ports/media/png.h"
#include "toolchain/error.h"

namespace figurine::capture {

float linear_from_srgb(float encoded) {
  return encoded <= 0.04045f ? encoded / 12.92f : std::pow((encoded + 0.055f) / 1.055f, 2.4f);
}

float srgb_from_linear(float linear) {
  return linear <= 0.0031308f ? linear * 12.92f : 1.055f * std::pow(linear, 1 / 2.4f) - 0.055f;
}

Texture::Texture(const ports::ImageU8& image, TextureEncoding encoding) {
  std::array<float, 256> decode;
  for (int i = 0; i < 256; ++i) {
    decode[i] = encoding == TextureEncoding::kColour ? linear_from_srgb(static_cast<float>(i) / 255)
                                                     : static_cast<float>(i) / 127.5f - 1;
  }
  Level base;
  base.width = static_cast<int>(image.width_px);
  base.height = static_cast<int>(image.height_px);
  base.texels.resize(size_t{image.width_px} * image.height_px);
  const uint32_t channels = image.channels;
  for (size_t i = 0; i < base.texels.size(); ++i) {
    const uint8_t* p = &image.pixels[i * channels];
    const float alpha = channels == 4 && encoding == TextureEncoding::kColour
                            ? static_cast<float>(p[3]) / 255
                            : 1.0f;
    has_alpha_ = has_alpha_ || alpha < 1;
    for (uint32_t c = 0; c < 3; ++c) base.texels[i][c] = decode[p[channels == 1 ? 0 : c]] * alpha;
    base.texels[i][3] = alpha;
  }
  levels_.push_back(std::move(base));
  while (levels_.back().width > 1 || levels_.back().height > 1) {
    const Level& fine = levels_.back();
    Level coarse;
    coarse.width = std::max(1, fine.width / 2);
    coarse.height = std::max(1, fine.height / 2);
    coarse.texels.resize(size_t(coarse.width) * coarse.height);
    for (int y = 0; y < coarse.height; ++y) {
      for (int x = 0; x < coarse.width; ++x) {
        const int x0 = 2 * x, y0 = 2 * y, x1 = std::min(x0 + 1, fine.width - 1),
                  y1 = std::min(y0 + 1, fine.height - 1);
        for (int c = 0; c < 4; ++c) {
          const auto at = [&](int tx, int ty) {
            return fine.texels[size_t(ty) * fine.width + tx][c];
          };
          coarse.texels[size_t(y) * coarse.width + x][c] =
              (at(x0, y0) + at(x1, y0) + at(x0, y1) + at(x1, y1)) / 4;
        }
      }
    }
    levels_.push_back(std::move(coarse));
  }
}

Rgba Texture::bilinear(const Level& level, float u, float v) {
  u = (u - std::floor(u)) * static_cast<float>(level.width) - 0.5f;
  v = (v - std::floor(v)) * static_cast<float>(level.height) - 0.5f;
  const float fu = std::floor(u), fv = std::floor(v);
  const float a = u - fu, b = v - fv;
  const auto wrap = [](int i, int n) { return i < 0 ? i + n : i >= n ? i - n : i; };
  const int x0 = wrap(static_cast<int>(fu), level.width),
            x1 = wrap(static_cast<int>(fu) + 1, level.width);
  const int y0 = wrap(static_cast<int>(fv), level.height),
            y1 = wrap(static_cast<int>(fv) + 1, level.height);
  const auto texel = [&](int x, int y, float weight) {
    return _mm_mul_ps(_mm_loadu_ps(level.texels[size_t(y) * level.width + x].data()),
                      _mm_set1_ps(weight));
  };
  alignas(16) std::array<float, 4> out;
  _mm_store_ps(out.data(), _mm_add_ps(_mm_add_ps(_mm_add_ps(texel(x0, y0, (1 - a) * (1 - b)),
                                                            texel(x1, y0, a * (1 - b))),
                                                 texel(x0, y1, (1 - a) * b)),
                                      texel(x1, y1, a * b)));
  return {{out[0], out[1], out[2]}, out[3]};
}

Rgba Texture::sample(float u, float v, float level) const {
  level = std::clamp(level, 0.0f, static_cast<float>(levels_.size() - 1));
  const int fine = static_cast<int>(level);
  const float t = level - static_cast<float>(fine);
  const Rgba a = bilinear(levels_[fine], u, v);
  if (t == 0) return a;
  const Rgba b = bilinear(levels_[fine + 1], u, v);
  return {mix(a.colour, b.colour, t), a.alpha + (b.alpha - a.alpha) * t};
}

ports::ImageU8 read_png(const std::string& path) {
  Result<ports::MappedFile> file = ports::MappedFile::open(path);
  if (!file.ok()) throw InputError(file.status().message());
  Result<ports::ImageU8> image = ports::decode_png(file->bytes(), path);
  if (!image.ok()) throw InputError(image.status().message());
  return std::move(image).value();
}

namespace {

struct PixelRegion {
  int left, top, right, bottom;  // right and bottom excluded
};

PixelRegion to_pixels(const ports::ImageU8& image, const Region& region) {
  const auto w = static_cast<float>(image.width_px), h = static_cast<float>(image.height_px);
  const auto clip = [](float x, float size) {
    return static_cast<int>(std::clamp(std::round(x * size), 0.0f, size));
  };
  return {clip(region.left, w), clip(region.top, h), clip(region.right, w), clip(region.bottom, h)};
}

}  // namespace

void clone_region(ports::ImageU8& image, const Region& region, std::array<float, 2> shift) {
  const PixelRegion box = to_pixels(image, region);
  const int dx = static_cast<int>(std::lround(shift[0] * static_cast<float>(image.width_px)));
  const int dy = static_cast<int>(std::lround(shift[1] * static_cast<float>(image.height_px)));
  const float feather = std::max(2.0f, 0.012f * static_cast<float>(image.width_px));
  const ports::ImageU8 source = image;
  for (int y = box.top; y < box.bottom; ++y) {
    for (int x = box.left; x < box.right; ++x) {
      const int sx = std::clamp(x + dx, 0, static_cast<int>(image.width_px) - 1),
                sy = std::clamp(y + dy, 0, static_cast<int>(image.height_px) - 1);
      const int rim = std::min({x - box.left, box.right - 1 - x, y - box.top, box.bottom - 1 - y});
      const float weight = std::min(1.0f, static_cast<float>(rim + 1) / feather);
      uint8_t* to = image.at(static_cast<uint32_t>(x), static_cast<uint32_t>(y));
      const uint8_t* from = source.at(static_cast<uint32_t>(sx), static_cast<uint32_t>(sy));
      for (uint32_t c = 0; c < image.channels; ++c) {
        to[c] = static_cast<uint8_t>(std::lround(static_cast<float>(to[c]) * (1 - weight) +
                                                 static_cast<float>(from[c]) * weight));
      }
    }
  }
}

void recolour_region(ports::ImageU8& image, const Region& region, float hue_turn_rad,
                     float saturation_scale, float value_scale) {
  const PixelRegion box = to_pixels(image, region);
  // A rotation about the grey axis (1,1,1)/sqrt(3): Rodrigues' formula, colour split into grey and
  // chroma.
  const float cosine = std::cos(hue_turn_rad), sine = std::sin(hue_turn_rad) / std::sqrt(3.0f);
  for (int y = box.top; y < box.bottom; ++y) {
    for (int x = box.left; x < box.right; ++x) {
      uint8_t* p = image.at(static_cast<uint32_t>(x), static_cast<uint32_t>(y));
      const Vec3 rgb{static_cast<float>(p[0]), static_cast<float>(p[1]), static_cast<float>(p[2])};
      const float grey = (rgb.x + rgb.y + rgb.z) / 3;
      const Vec3 chroma = rgb - Vec3{grey, grey, grey};
      const Vec3 turned =
          chroma * cosine +
          Vec3{chroma.z - chroma.y, chroma.x - chroma.z, chroma.y - chroma.x} * sine;
      const Vec3 out = (Vec3{grey, grey, grey} + turned * saturation_scale) * value_scale;
      p[0] = static_cast<uint8_t>(std::lround(std::clamp(out.x, 0.0f, 255.0f)));
      p[1] = static_cast<uint8_t>(std::lround(std::clamp(out.y, 0.0f, 255.0f)));
      p[2] = static_cast<uint8_t>(std::lround(std::clamp(out.z, 0.0f, 255.0f)));
    }
  }
}

namespace {

// 0 .. 1: how much of a dye a pixel takes. rgb: 0 .. 1.
float take_up(Fibre fibre, Vec3 rgb, float luma) {
  constexpr float kSoft = 0.08f;
  const auto over = [](float x, float threshold) {
    return std::clamp((x - threshold) / kSoft, 0.0f, 1.0f);
  };
  switch (fibre) {
    case Fibre::kAll:
      return 1;
    case Fibre::kBlue:
      return over(rgb.z - rgb.x, 0.01f);
    case Fibre::kRed:
      return over(rgb.x - rgb.z, 0.04f);
    case Fibre::kNotRed:
      return 1 - over(rgb.x - rgb.z, 0.04f);
    case Fibre::kNeutral:
      return (1 - over(std::fabs(rgb.x - rgb.z), 0.03f)) * over(luma, 0.05f);
    case Fibre::kDark:
      return 1 - over(luma, 0.35f);
  }
  return 0;
}

}  // namespace

void dye_region(ports::ImageU8& image, const ports::ImageU8& undyed, const Region& region,
                const DyeBath& bath) {
  const PixelRegion box = to_pixels(image, region);
  const auto colour = [](const uint8_t* p) {
    return Vec3{static_cast<float>(p[0]), static_cast<float>(p[1]), static_cast<float>(p[2])} *
           (1.0f / 255);
  };
  for (int y = box.top; y < box.bottom; ++y) {
    for (int x = box.left; x < box.right; ++x) {
      uint8_t* p = image.at(static_cast<uint32_t>(x), static_cast<uint32_t>(y));
      const Vec3 rgb = colour(undyed.at(static_cast<uint32_t>(x), static_cast<uint32_t>(y)));
      const float luma = 0.299f * rgb.x + 0.587f * rgb.y + 0.114f * rgb.z;
      const Vec3 out = mix(colour(p), bath.dye * (luma / bath.reference),
                           bath.amount * take_up(bath.fibre, rgb, luma)) *
                       255;
      p[0] = static_cast<uint8_t>(std::lround(std::clamp(out.x, 0.0f, 255.0f)));
      p[1] = static_cast<uint8_t>(std::lround(std::clamp(out.y, 0.0f, 255.0f)));
      p[2] = static_cast<uint8_t>(std::lround(std::clamp(out.z, 0.0f, 255.0f)));
    }
  }
}

}  // namespace figurine::capture
