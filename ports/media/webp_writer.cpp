#include "ports/media/webp_writer.h"

#include <webp/encode.h>
#include <webp/mux.h>

#include <cmath>
#include <limits>
#include <string>

namespace figurine::ports {

namespace {

// Of 0 to 100: what shows no blocks around a figure.
constexpr float kQuality = 85;
// Of 0 (fast) to 6 (small).
constexpr int kMethod = 2;

// A picture in libwebp's own memory.
struct Picture {
  WebPPicture picture;
  bool sound;
  Picture() : sound(WebPPictureInit(&picture) != 0) { picture.use_argb = 1; }
  ~Picture() {
    if (sound) WebPPictureFree(&picture);
  }
  Picture(const Picture&) = delete;
  Picture& operator=(const Picture&) = delete;
};

class WebpWriter : public VideoWriter {
 public:
  WebpWriter(AtomicFile file, const Options& options) : file_(std::move(file)), options_(options) {}

  Status start() {
    WebPAnimEncoderOptions encoder;
    if (WebPAnimEncoderOptionsInit(&encoder) == 0 || WebPConfigInit(&config_) == 0)
      return Status(StatusCode::kUnsupported, file_.path() + ": libwebp is of another version");
    config_.quality = kQuality;
    config_.method = kMethod;
    config_.thread_level = 1;
    encoder_.reset(WebPAnimEncoderNew(static_cast<int>(options_.width_px),
                                      static_cast<int>(options_.height_px), &encoder));
    return encoder_ ? Status() : out_of_memory();
  }

  Status add(const ImageU8& frame) override {
    const uint32_t channels = options_.alpha ? 4 : 3;
    if (!frame.sound() || frame.channels != channels || frame.width_px != options_.width_px ||
        frame.height_px != options_.height_px) {
      return Status(StatusCode::kInvalidArgument, file_.path() + ": a frame of another kind");
    }
    const Result<int> time_ms = next_time_ms();
    if (!time_ms.ok()) return time_ms.status();
    Picture picture;
    if (!picture.sound) return out_of_memory();
    picture.picture.width = static_cast<int>(frame.width_px);
    picture.picture.height = static_cast<int>(frame.height_px);
    const auto import = options_.alpha ? WebPPictureImportRGBA : WebPPictureImportRGB;
    if (import(&picture.picture, frame.pixels.data(),
               static_cast<int>(frame.width_px * channels)) == 0) {
      return out_of_memory();
    }
    if (WebPAnimEncoderAdd(encoder_.get(), &picture.picture, *time_ms, &config_) == 0)
      return failed();
    ++frames_;
    return {};
  }

  Status finish() override {
    if (frames_ == 0) return Status(StatusCode::kInvalidArgument, file_.path() + ": no frame");
    const Result<int> end_ms = next_time_ms();
    if (!end_ms.ok()) return end_ms.status();
    if (WebPAnimEncoderAdd(encoder_.get(), nullptr, *end_ms, nullptr) == 0) return failed();
    struct Bytes {
      WebPData data;
      Bytes() { WebPDataInit(&data); }
      ~Bytes() { WebPDataClear(&data); }
    } bytes;
    if (WebPAnimEncoderAssemble(encoder_.get(), &bytes.data) == 0) return failed();
    FIG_RETURN_IF_ERROR(
        file_.write(std::as_bytes(std::span<const uint8_t>(bytes.data.bytes, bytes.data.size))));
    return file_.commit();
  }

 private:
  struct EncoderDeleter {
    void operator()(WebPAnimEncoder* encoder) const { WebPAnimEncoderDelete(encoder); }
  };

  // When the frame begins that comes next, and the last one ends.
  Result<int> next_time_ms() const {
    const double ms = std::round(1000.0 * static_cast<double>(frames_) * options_.rate.denominator /
                                 options_.rate.numerator);
    if (ms > std::numeric_limits<int>::max()) {
      return Status(StatusCode::kLimitExceeded, file_.path() + ": longer than a .webp can be");
    }
    return static_cast<int>(ms);
  }
  Status out_of_memory() const {
    return Status(StatusCode::kOutOfMemory, file_.path() + ": no memory for a frame");
  }
  Status failed() const {
    return Status(StatusCode::kIo,
                  file_.path() + ": libwebp: " + WebPAnimEncoderGetError(encoder_.get()));
  }

  AtomicFile file_;
  Options options_;
  WebPConfig config_{};
  std::unique_ptr<WebPAnimEncoder, EncoderDeleter> encoder_;
  uint64_t frames_ = 0;
};

}  // namespace

Result<std::unique_ptr<VideoWriter>> make_webp_writer(AtomicFile file,
                                                      const VideoWriter::Options& options) {
  if (options.width_px > WEBP_MAX_DIMENSION || options.height_px > WEBP_MAX_DIMENSION) {
    return Status(StatusCode::kLimitExceeded, file.path() + ": a .webp is at most " +
                                                  std::to_string(WEBP_MAX_DIMENSION) +
                                                  " pixels a side");
  }
  auto writer = std::make_unique<WebpWriter>(std::move(file), options);
  FIG_RETURN_IF_ERROR(writer->start());
  return std::unique_ptr<VideoWriter>(std::move(writer));
}

}  // namespace figurine::ports
