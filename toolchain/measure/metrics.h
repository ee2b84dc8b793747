// How close a picture of a person is to the truth. Definitions once, for every report of the
// project (docs/numerics.md, "Picture quality").
//
// All on stored sRGB values in [0,1], both pictures over the same background, errors pooled over
// pixels, channels and images before the logarithm.
//   foreground  pixels whose true alpha exceeds 0.5, over mid-grey. This is "PSNR" wherever a
//               report says no more.
//   crop        all pixels of the bounding box of true alpha > 0, over black: flattered by the
//               black around the person, never a target.
//   head        foreground pixels inside the projected head box.
//   high-pass   h = picture - mean of its 3x3 neighbourhood, over foreground pixels whose eight
//               neighbours are foreground too. Ratio: sum of h^2, prediction over truth; 1 is as
//               sharp as the truth, a blurred face passes PSNR and fails this. Correlation: sum of
//               h h' over the root of the product of both energies; noise passes the ratio and
//               fails this.
//   filled      share of the pixels deep inside the person (foreground 3 pixels around, opaque
//               themselves) where the prediction covers at least 0.98: the rest are holes.
//   difference  PSNR of (frame t+1 - frame t), prediction against truth, over pixels that are
//               foreground in both true frames: shimmer.
//   outline     true alpha above 0.5 against predicted: intersection over union, and the share of
//               the truth that the prediction leaves uncovered: what hair or a skirt is worth that
//               was not learnt.
//   flat        PSNR of a person of one colour (the best one for the very pixels it is judged on)
//               with a perfect mask: what dark clothes give for free.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

namespace figurine::measure {

// Premultiplied colour and coverage, 8 bits as stored: what a viewer would be sent.
struct Picture {
  uint32_t width_px = 0;
  uint32_t height_px = 0;
  std::vector<uint8_t> rgba;  // [H,W,4]
};

struct Box {
  int x0 = 0, y0 = 0, x1 = 0, y1 = 0;  // half open
  bool empty() const { return x1 <= x0 || y1 <= y0; }
};

inline constexpr float kMidGrey = 0.5f;

inline constexpr uint8_t kForegroundAlpha = 127;  // 127/255 < 0.5 < 128/255
inline bool is_foreground(const Picture& picture, size_t pixel) {
  return picture.rgba[4 * pixel + 3] > kForegroundAlpha;
}

// Premultiplied float RGBA, as a splatter leaves it, clamped and rounded to the nearest 8-bit
// value. rgba: [H,W,4].
Picture quantise_picture(uint32_t width_px, uint32_t height_px, std::span<const float> rgba);

// Where alpha > 0; empty if nowhere.
Box bounding_box(const Picture& picture);

// Sum of squared errors and how many values were summed.
struct SquaredError {
  double sum = 0;
  uint64_t count = 0;
  void add(const SquaredError& other) {
    sum += other.sum;
    count += other.count;
  }
  double mse() const { return count == 0 ? 0 : sum / static_cast<double>(count); }
  // -10 log10(mse) for a peak of 1. No pixel: NaN. No error: infinity.
  double psnr_db() const;
};

SquaredError foreground_error(const Picture& prediction, const Picture& truth);
SquaredError foreground_error(const Picture& prediction, const Picture& truth, const Box& inside);
SquaredError crop_error(const Picture& prediction, const Picture& truth);
SquaredError difference_error(const Picture& prediction0, const Picture& prediction1,
                              const Picture& truth0, const Picture& truth1);

// Pixels inside either outline, alpha above 0.5.
struct Outline {
  uint64_t both = 0, truth = 0, prediction = 0;
  void add(const Outline& other) {
    both += other.both, truth += other.truth, prediction += other.prediction;
  }
  double iou() const { return ratio(both, truth + prediction - both); }
  double uncovered_share() const { return ratio(truth - both, truth); }

 private:
  static double ratio(uint64_t part, uint64_t whole) {
    return whole == 0 ? 0 : static_cast<double>(part) / static_cast<double>(whole);
  }
};
Outline compare_outlines(const Picture& prediction, const Picture& truth);

struct HighPass {
  double prediction = 0;  // energies
  double truth = 0;
  double product = 0;  // sum of the prediction's value times the truth's
  void add(const HighPass& other) {
    prediction += other.prediction;
    truth += other.truth;
    product += other.product;
  }
  double ratio() const { return truth > 0 ? prediction / truth : 0; }
  // In [-1,1]; 0 where either has no energy.
  double correlation() const {
    return prediction > 0 && truth > 0 ? product / std::sqrt(prediction * truth) : 0;
  }
};
HighPass high_pass(const Picture& prediction, const Picture& truth);
HighPass high_pass(const Picture& prediction, const Picture& truth, const Box& inside);

// How well the prediction closes the person's inside.
struct Filled {
  uint64_t inside = 0;  // pixels that are looked at
  uint64_t filled = 0;  // of those, how many the prediction covers
  void add(const Filled& other) { inside += other.inside, filled += other.filled; }
  // No pixel: NaN.
  double share() const {
    return inside == 0 ? std::numeric_limits<double>::quiet_NaN()
                       : static_cast<double>(filled) / static_cast<double>(inside);
  }
};
// Looked at are pixels whose whole neighbourhood of 7x7 lies in the picture and in the foreground:
// an outline that is off by less is an error of its own (compare_outlines), and no hole. And whose
// own true alpha is at least 0.98: hair that can be seen through has nothing to fill.
Filled count_filled(const Picture& prediction, const Picture& truth);

// The error of the best single colour c: sum over foreground of (true - (a c + (1 - a) grey))^2,
// minimised over c at the end.
class FlatColour {
 public:
  void add(const Picture& truth);
  SquaredError error() const;
  std::array<double, 3> colour() const;

 private:
  std::array<double, 3> alpha_residual_{0, 0, 0};  // sum a r,  r = true - (1 - a) grey
  std::array<double, 3> residual2_{0, 0, 0};       // sum r^2
  double alpha2_ = 0;                              // sum a^2
  uint64_t pixels_ = 0;
};

}  // namespace figurine::measure
