// What the training loop eats: samples, each one training pose with its UNet input, and one or more
// images of it, cropped; prepared on a thread of its own, a few samples ahead.
//
// Which images a sample has depends on (seed, its number) alone. Images are decoded at their first
// use and kept as 8-bit crops around the mask (about 0.3 MB at 512x512), up to a limit; past it
// they are decoded again.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <deque>
#include <exception>
#include <memory>
#include <mutex>
#include <thread>
#include <unordered_map>
#include <vector>

#include "toolchain/dataset/dataset.h"
#include "toolchain/model/render.h"
#include "toolchain/random/shuffled_order.h"
#include "toolchain/train/avatar_model.h"

namespace figurine::train {

struct SampleView {
  size_t camera = 0;  // of the data set's list
  model::RenderView view;
  torch::Tensor target;     // [4,h,w] premultiplied RGB and mask of view.crop
  model::PixelRect window;  // of the target, where the perceptual loss looks; empty without one
  float loss_scale =
      1;  // crop area over mask box area: keeps a pixel's weight when the whole image is looked at
};

struct Sample {
  uint64_t number = 0;  // counted from the start of the training
  size_t frame = 0;     // of the data set's list
  PosedBody posed;
  std::vector<SampleView> views;  // of that frame, the shuffled order's own first
  std::array<float, 3> background{0, 0, 0};
};

struct CroppedImage {
  model::PixelRect rect;      // inside the full image
  std::vector<uint8_t> rgba;  // [rect.height, rect.width, 4] premultiplied
};

// The part of an image within margin_px of the pixels with alpha > 0; the whole image if there are
// none.
CroppedImage crop_to_mask(const dataset::CaptureImage& image, uint32_t margin_px);

// [4,h,w] float of `rect`, zero where the crop has nothing.
torch::Tensor target_of(const CroppedImage& image, const model::PixelRect& rect);

// The square of side_px around one of the target's pixels with mask > 0.5, `unit` in [0,1) says
// which, moved to lie inside the target and as large as that allows. The middle where no pixel has
// such a mask. side_px = 0: all of the target.
model::PixelRect window_on_person(const torch::Tensor& target, uint32_t side_px, float unit);

class SampleFeed {
 public:
  // data and model are borrowed. Throws InputError if there is no training image.
  SampleFeed(const dataset::Dataset& data, const AvatarModel& model, uint64_t first_sample);
  ~SampleFeed();
  SampleFeed(const SampleFeed&) = delete;
  SampleFeed& operator=(const SampleFeed&) = delete;

  // Samples first_sample, first_sample + 1, ... Rethrows what went wrong while preparing
  // (InputError on a damaged image).
  Sample next();

  size_t image_count() const { return pairs_.size(); }

 private:
  Sample prepare(uint64_t number);
  SampleView prepare_view(uint64_t number, size_t view, size_t pair);
  std::shared_ptr<const CroppedImage> image(size_t pair);
  void work();

  const dataset::Dataset& data_;
  const AvatarModel& model_;
  std::vector<std::pair<size_t, size_t>>
      pairs_;  // (frame, camera) of all training images, by frame
  random::ShuffledOrder order_;
  std::unordered_map<size_t, std::shared_ptr<const CroppedImage>> images_;
  size_t image_bytes_ = 0;

  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<Sample> ready_;
  std::exception_ptr error_;
  bool stop_ = false;
  uint64_t next_sample_;
  std::thread worker_;  // last: everything above exists before it starts
};

}  // namespace figurine::train
