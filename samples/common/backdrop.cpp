#include "samples/common/backdrop.h"

#include <algorithm>
#include <cmath>
#include <span>
#include <utility>

#include "ports/host/clock.h"
#include "ports/media/cover.h"
#include "ports/media/yuv.h"

namespace figurine::samples {

namespace {

constexpr uint64_t kLook_ns = 100'000'000;  // how often the end is looked for while nothing comes

std::span<const uint8_t> row_of(const ports::ImageU8& image, uint32_t y) {
  return {image.at(0, y), size_t{image.channels} * image.width_px};
}

// Opaque RGB into the frame's format.
void pack(const ports::ImageU8& rgb, YcbcrMatrix matrix, RenderedFrame& frame) {
  const uint32_t width = rgb.width_px, height = rgb.height_px;
  const auto packed_row = [&](size_t row, size_t bytes) {
    return std::span(frame.packed).subspan(row * bytes, bytes);
  };
  switch (frame.format) {
    case PixelFormat::kRgb24:
      frame.u8.pixels = rgb.pixels;
      return;
    case PixelFormat::kRgba8:
      for (size_t i = 0; i < size_t{width} * height; ++i) {
        std::copy_n(&rgb.pixels[3 * i], 3, &frame.u8.pixels[4 * i]);
        frame.u8.pixels[4 * i + 3] = 255;
      }
      return;
    case PixelFormat::kBgr24:
      for (size_t i = 0; i < rgb.pixels.size(); i += 3)
        std::reverse_copy(&rgb.pixels[i], &rgb.pixels[i] + 3, &frame.packed[i]);
      return;
    case PixelFormat::kYuyv:
      for (uint32_t y = 0; y < height; ++y)
        ports::yuyv_row(row_of(rgb, y), matrix, packed_row(y, size_t{2} * width));
      return;
    case PixelFormat::kNv12:
      for (uint32_t y = 0; y < height; ++y)
        ports::luma_row(row_of(rgb, y), matrix, packed_row(y, width));
      for (uint32_t y = 0; y < height; y += 2) {
        ports::interleaved_chroma_row(row_of(rgb, y), row_of(rgb, y + 1), matrix,
                                      packed_row(height + y / 2, width));
      }
      return;
    case PixelFormat::kRgbaF32:
    case PixelFormat::kBgra8:
      FIG_CHECK(false, "a format that live pictures have");
  }
}

}  // namespace

Result<std::unique_ptr<Backdrop>> Backdrop::open(const std::string& path, const Options& options) {
  Result<std::unique_ptr<ports::V4l2Capture>> capture =
      ports::V4l2Capture::open(path, {.width_px = options.size.width_px,
                                      .height_px = options.size.height_px,
                                      .frames_per_second = options.frames_per_second,
                                      .system = options.system});
  if (!capture.ok()) return capture.status();
  return std::unique_ptr<Backdrop>(new Backdrop(path, options, std::move(*capture)));
}

Backdrop::Backdrop(std::string path, const Options& options,
                   std::unique_ptr<ports::V4l2Capture> capture)
    : path_(std::move(path)), options_(options), capture_(std::move(capture)) {
  thread_ = std::thread([this] { run(); });
}

Backdrop::~Backdrop() {
  stop_ = true;
  thread_.join();
}

void Backdrop::run() {
  ports::ImageU8 picture;
  ports::CoverScaler scaler;
  while (!stop_) {
    const Result<bool> came = capture_->next(picture, ports::now_ns() + kLook_ns);
    if (!came.ok()) {
      {
        const std::lock_guard lock(mutex_);
        newest_.reset();
        counts_.lost = true;
      }
      options_.say(came.status().message() + "; the background colour takes its place");
      return;
    }
    std::shared_ptr<ports::ImageU8> covered;
    if (*came) {
      covered =
          std::make_shared<ports::ImageU8>(options_.size.width_px, options_.size.height_px, 3);
      scaler.scale(picture, *covered);
    }
    const std::lock_guard lock(mutex_);
    counts_.broken = capture_->broken_pictures();
    if (!*came) continue;
    newest_ = std::move(covered);
    ++counts_.pictures;
  }
}

std::shared_ptr<const ports::ImageU8> Backdrop::newest() const {
  const std::lock_guard lock(mutex_);
  return newest_;
}

Backdrop::Counts Backdrop::counts() const {
  const std::lock_guard lock(mutex_);
  return counts_;
}

void compose(const RenderedFrame& figures, const ports::ImageU8* behind,
             const std::array<float, 3>& colour, YcbcrMatrix matrix, ports::ImageU8& scratch,
             RenderedFrame& frame) {
  const uint32_t width = figures.size.width_px, height = figures.size.height_px;
  FIG_CHECK(figures.format == PixelFormat::kRgba8 && frame.size.width_px == width &&
                frame.size.height_px == height,
            "figures in RGBA, of the frame's size");
  FIG_CHECK(behind == nullptr ||
                (behind->channels == 3 && behind->width_px == width && behind->height_px == height),
            "a picture of the frame's size");
  if (scratch.width_px != width || scratch.height_px != height)
    scratch = ports::ImageU8(width, height, 3);
  uint32_t plain[3];
  for (size_t c = 0; c < 3; ++c)
    plain[c] = static_cast<uint32_t>(std::lround(std::clamp(colour[c], 0.0f, 1.0f) * 255));
  for (size_t i = 0; i < size_t{width} * height; ++i) {
    const uint8_t* const in = &figures.u8.pixels[4 * i];
    const uint32_t alpha = in[3];
    for (size_t c = 0; c < 3; ++c) {
      const uint32_t ground = behind != nullptr ? behind->pixels[3 * i + c] : plain[c];
      scratch.pixels[3 * i + c] =
          static_cast<uint8_t>((alpha * in[c] + (255 - alpha) * ground + 127) / 255);
    }
  }
  pack(scratch, matrix, frame);
}

}  // namespace figurine::samples
