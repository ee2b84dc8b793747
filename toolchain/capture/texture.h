// A texture as the renderer samples it: linear light, premultiplied alpha, a pyramid of
// box-filtered levels, trilinear lookups. Texture coordinates wrap; v is down. Premultiplied,
// because otherwise the colour that happens to lie under alpha 0 bleeds into the edges of hair.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "ports/media/image.h"
#include "toolchain/capture/vec.h"

namespace figurine::capture {

float linear_from_srgb(float encoded);
float srgb_from_linear(float linear);

struct Rgba {
  Vec3 colour;  // premultiplied
  float alpha = 0;
};

enum class TextureEncoding : uint8_t {
  kColour,  // sRGB colour, straight alpha, as in the file
  kVector,  // a tangent-space normal map: (value / 255) * 2 - 1, no alpha
};

class Texture {
 public:
  // image: 1, 3 or 4 channels.
  Texture(const ports::ImageU8& image, TextureEncoding encoding);

  // level 0 is the file's own resolution; fractional levels blend two. Clamped to the pyramid.
  Rgba sample(float u, float v, float level) const;
  bool has_alpha() const { return has_alpha_; }
  uint32_t width_px() const { return levels_[0].width; }
  uint32_t height_px() const { return levels_[0].height; }

 private:
  struct Level {
    int width = 0, height = 0;
    std::vector<std::array<float, 4>> texels;
  };
  static Rgba bilinear(const Level& level, float u, float v);

  std::vector<Level> levels_;
  bool has_alpha_ = false;
};

// Reads a PNG; InputError naming the file.
ports::ImageU8 read_png(const std::string& path);

// A rectangle of an image in fractions of its size.
struct Region {
  float left = 0, top = 0, right = 1, bottom = 1;
};

// Covers a region with what lies `shift` (fractions of the image) away from it, blended in over a
// feathered rim: how a printed emblem leaves a shirt.
void clone_region(ports::ImageU8& image, const Region& region, std::array<float, 2> shift);

// Turns the hue of all pixels in a region by an angle and scales saturation and value. Grey stays
// grey.
void recolour_region(ports::ImageU8& image, const Region& region, float hue_turn_rad,
                     float saturation_scale, float value_scale);

// Which pixels of a region a dye takes: textures put denim, stripes and grey cloth side by side.
// Edges are soft.
enum class Fibre : uint8_t { kAll, kBlue, kRed, kNotRed, kNeutral, kDark };

// Gives the chosen pixels the hue and brightness of a dye and keeps the cloth's own light and dark:
// dye * (luma / reference), mixed into `image` by `amount`. undyed: of the same size; says which
// pixels are chosen and how light they are, so that one dye does not take another's for cloth. dye:
// sRGB, 0 .. 1. reference: luma (0 .. 1) of the undyed cloth, which becomes the dye itself.
struct DyeBath {
  Fibre fibre = Fibre::kAll;
  Vec3 dye;
  float reference = 0.5f;
  float amount = 1;
};
void dye_region(ports::ImageU8& image, const ports::ImageU8& undyed, const Region& region,
                const DyeBath& bath);

}  // namespace figurine::capture
