#include "toolchain/train/sample_feed.h"

#include <algorithm>
#include <cstring>

#include "toolchain/error.h"
#include "toolchain/random/counter.h"
#include "toolchain/tensor_operations.h"

namespace figurine::train {

namespace {

constexpr size_t kAhead = 4;                        // samples prepared before they are asked for
constexpr size_t kMaxImageBytes = size_t{4} << 30;  // of cached crops
constexpr uint64_t kBackgroundStream = 0x6267, kWindowStream = 0x7764;
constexpr uint64_t kMaxViews = 64;  // of a sample

std::vector<std::pair<size_t, size_t>> training_pairs(const dataset::Dataset& data) {
  std::vector<std::pair<size_t, size_t>> pairs;
  for (size_t frame = 0; frame < data.frames().size(); ++frame) {
    for (size_t camera = 0; camera < data.cameras().size(); ++camera) {
      if (data.role(frame, camera) == dataset::Role::kTrain) pairs.emplace_back(frame, camera);
    }
  }
  if (pairs.empty())
    throw InputError(data.directory() +
                     ": no training image (all cameras or all frames are held out)");
  return pairs;
}

}  // namespace

CroppedImage crop_to_mask(const dataset::CaptureImage& image, uint32_t margin_px) {
  uint32_t x0 = image.width_px, y0 = image.height_px, x1 = 0, y1 = 0;
  for (uint32_t y = 0; y < image.height_px; ++y) {
    for (uint32_t x = 0; x < image.width_px; ++x) {
      if (image.alpha[size_t(y) * image.width_px + x] == 0) continue;
      x0 = std::min(x0, x), x1 = std::max(x1, x + 1), y0 = std::min(y0, y),
      y1 = std::max(y1, y + 1);
    }
  }
  CroppedImage crop;
  if (x1 <= x0) {
    crop.rect = {0, 0, image.width_px, image.height_px};
  } else {
    const auto lower = [&](uint32_t value) { return value > margin_px ? value - margin_px : 0; };
    crop.rect.x = lower(x0), crop.rect.y = lower(y0);
    crop.rect.width = std::min(image.width_px, x1 + margin_px) - crop.rect.x;
    crop.rect.height = std::min(image.height_px, y1 + margin_px) - crop.rect.y;
  }
  crop.rgba.resize(size_t(crop.rect.width) * crop.rect.height * 4);
  for (uint32_t y = 0; y < crop.rect.height; ++y) {
    for (uint32_t x = 0; x < crop.rect.width; ++x) {
      const size_t from = size_t(crop.rect.y + y) * image.width_px + crop.rect.x + x;
      uint8_t* to = &crop.rgba[(size_t(y) * crop.rect.width + x) * 4];
      std::memcpy(to, &image.rgb[3 * from], 3);
      to[3] = image.alpha[from];
    }
  }
  return crop;
}

torch::Tensor target_of(const CroppedImage& image, const model::PixelRect& rect) {
  torch::Tensor target = torch::zeros({4, int64_t(rect.height), int64_t(rect.width)});
  float* planes = target.data_ptr<float>();
  const size_t plane = size_t(rect.width) * rect.height;
  // The overlap of both rectangles, in image coordinates.
  const uint32_t x0 = std::max(rect.x, image.rect.x),
                 x1 = std::min(rect.x + rect.width, image.rect.x + image.rect.width);
  const uint32_t y0 = std::max(rect.y, image.rect.y),
                 y1 = std::min(rect.y + rect.height, image.rect.y + image.rect.height);
  for (uint32_t y = y0; y < y1; ++y) {
    for (uint32_t x = x0; x < x1; ++x) {
      const uint8_t* from =
          &image.rgba[(size_t(y - image.rect.y) * image.rect.width + (x - image.rect.x)) * 4];
      float* to = planes + size_t(y - rect.y) * rect.width + (x - rect.x);
      for (int c = 0; c < 4; ++c) to[c * plane] = static_cast<float>(from[c]) * (1.0f / 255.0f);
    }
  }
  return target;
}

model::PixelRect window_on_person(const torch::Tensor& target, uint32_t side_px, float unit) {
  const auto height = static_cast<uint32_t>(target.size(1)),
             width = static_cast<uint32_t>(target.size(2));
  if (side_px == 0) return {0, 0, width, height};
  const float* const mask = target[3].const_data_ptr<float>();
  const size_t pixels = size_t(width) * height;
  const auto inside = [](float value) { return value > 0.5f; };
  const auto count = static_cast<size_t>(std::count_if(mask, mask + pixels, inside));
  size_t centre = size_t(height / 2) * width + width / 2;
  if (count > 0) {
    size_t left = std::min(count - 1, static_cast<size_t>(double(unit) * double(count)));
    for (centre = 0; !inside(mask[centre]) || left-- > 0;) ++centre;
  }
  const auto around = [&](size_t at, uint32_t size) {
    const uint32_t side = std::min(side_px, size);
    const size_t first = at > side / 2 ? at - side / 2 : 0;
    return std::pair{static_cast<uint32_t>(std::min<size_t>(first, size - side)), side};
  };
  const auto [x, w] = around(centre % width, width);
  const auto [y, h] = around(centre / width, height);
  return {x, y, w, h};
}

SampleFeed::SampleFeed(const dataset::Dataset& data, const AvatarModel& model,
                       uint64_t first_sample)
    : data_(data),
      model_(model),
      pairs_(training_pairs(data)),
      order_(model.settings().seed, pairs_.size()),
      next_sample_(first_sample),
      worker_([this] { work(); }) {}

SampleFeed::~SampleFeed() {
  {
    const std::lock_guard lock(mutex_);
    stop_ = true;
  }
  changed_.notify_all();
  worker_.join();
}

Sample SampleFeed::next() {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [&] { return !ready_.empty() || error_; });
  if (ready_.empty()) std::rethrow_exception(error_);
  Sample sample = std::move(ready_.front());
  ready_.pop_front();
  lock.unlock();
  changed_.notify_all();
  return sample;
}

void SampleFeed::work() {
  for (;;) {
    {
      std::unique_lock lock(mutex_);
      changed_.wait(lock, [&] { return stop_ || ready_.size() < kAhead; });
      if (stop_) return;
    }
    try {
      Sample sample = prepare(next_sample_++);
      const std::lock_guard lock(mutex_);
      ready_.push_back(std::move(sample));
    } catch (...) {
      const std::lock_guard lock(mutex_);
      error_ = std::current_exception();
      stop_ = true;
    }
    changed_.notify_all();
  }
}

std::shared_ptr<const CroppedImage> SampleFeed::image(size_t pair) {
  if (const auto found = images_.find(pair); found != images_.end()) return found->second;
  const auto [frame, camera] = pairs_[pair];
  auto crop = std::make_shared<const CroppedImage>(
      crop_to_mask(data_.load_image(frame, camera), model_.settings().crop_margin_px));
  if (image_bytes_ + crop->rgba.size() <= kMaxImageBytes) {
    image_bytes_ += crop->rgba.size();
    images_.emplace(pair, crop);
  }
  return crop;
}

SampleView SampleFeed::prepare_view(uint64_t number, size_t index, size_t pair) {
  const TrainSettings& settings = model_.settings();
  const size_t camera = pairs_[pair].second;
  const std::shared_ptr<const CroppedImage> truth = image(pair);
  SampleView view{.camera = camera,
                  .view = {.camera = data_.cameras()[camera].camera, .crop = truth->rect},
                  .target = {},
                  .window = {}};
  // Gaussians could hide from the loss outside the crop: now and then it looks at the whole image.
  if (settings.whole_image_period > 0 &&
      number % settings.whole_image_period == settings.whole_image_period - 1) {
    view.view.crop = {0, 0, view.view.camera.width_px, view.view.camera.height_px};
    view.loss_scale = float(view.view.crop.width) * float(view.view.crop.height) /
                      (float(truth->rect.width) * float(truth->rect.height));
  }
  view.target = target_of(*truth, view.view.crop);
  if (!settings.perceptual.file.empty()) {
    view.window = window_on_person(
        view.target, settings.perceptual.window_px,
        random::random_unit(settings.seed, kWindowStream, kMaxViews * number + index));
  }
  return view;
}

Sample SampleFeed::prepare(uint64_t number) {
  const TrainSettings& settings = model_.settings();
  const size_t pair = order_.item(number), frame = pairs_[pair].first;
  Sample sample{.number = number, .frame = frame, .posed = {}, .views = {}};
  // Further views of the same pose are spread over its cameras, so that they show different sides
  // of the person.
  const auto of_other_frame = [&](const std::pair<size_t, size_t>& other) {
    return other.first != frame;
  };
  const auto here = pairs_.begin() + static_cast<std::ptrdiff_t>(pair);
  const size_t first = static_cast<size_t>(
      std::find_if(std::make_reverse_iterator(here), pairs_.rend(), of_other_frame).base() -
      pairs_.begin());
  const size_t count =
      static_cast<size_t>(std::find_if(here, pairs_.end(), of_other_frame) - pairs_.begin()) -
      first;
  const size_t views = std::min<size_t>(settings.views_per_pose, count);
  for (size_t v = 0; v < views; ++v)
    sample.views.push_back(
        prepare_view(number, v, first + (pair - first + v * count / views) % count));
  sample.posed = model_.pose(model_.from_capture(data_.frames()[frame]).view());
  switch (settings.background) {
    case TrainingBackground::kBlack:
      break;
    case TrainingBackground::kGrey:
      sample.background = {0.5f, 0.5f, 0.5f};
      break;
    case TrainingBackground::kRandom:
      for (uint64_t c = 0; c < 3; ++c)
        sample.background[c] =
            random::random_unit(settings.seed, kBackgroundStream, 3 * number + c);
      break;
  }
  return sample;
}

}  // namespace figurine::train
