#include "ports/media/png.h"

#include <png.h>

#include <cstring>

namespace figurine::ports {

namespace {

// libpng's simplified interface frees its state by itself on success and on error, but not when the
// caller stops half way.
struct PngImage {
  png_image image;
  PngImage() {
    std::memset(&image, 0, sizeof(image));
    image.version = PNG_IMAGE_VERSION;
  }
  ~PngImage() { png_image_free(&image); }
};

png_uint_32 png_format(uint32_t channels) {
  if (channels == 1) return PNG_FORMAT_GRAY;
  return channels == 3 ? PNG_FORMAT_RGB : PNG_FORMAT_RGBA;
}

}  // namespace

Result<std::vector<std::byte>> encode_png(const ImageU8& image) {
  if (!image.sound())
    return Status(StatusCode::kInvalidArgument,
                  "png: image size, channels and pixels do not agree");
  PngImage png;
  png.image.width = image.width_px;
  png.image.height = image.height_px;
  png.image.format = png_format(image.channels);
  const auto stride = static_cast<png_int_32>(image.width_px * image.channels);
  png_alloc_size_t size = PNG_IMAGE_PNG_SIZE_MAX(png.image);
  std::vector<std::byte> bytes(size);
  if (!png_image_write_to_memory(&png.image, bytes.data(), &size, 0, image.pixels.data(), stride,
                                 nullptr)) {
    return Status(StatusCode::kOutOfMemory, std::string("png: ") + png.image.message);
  }
  bytes.resize(size);
  return bytes;
}

Result<ImageU8> decode_png(std::span<const std::byte> bytes, const std::string& name) {
  PngImage png;
  if (!png_image_begin_read_from_memory(&png.image, bytes.data(), bytes.size())) {
    return Status(StatusCode::kCorrupt, name + ": png: " + png.image.message);
  }
  // 16 bits a channel are taken for linear light unless they say otherwise, and would be
  // brightened: cameras and masks mean what they store.
  png.image.flags |= PNG_IMAGE_FLAG_16BIT_sRGB;
  uint32_t channels = 1;
  if (png.image.format & PNG_FORMAT_FLAG_ALPHA) {
    channels = 4;
  } else if (png.image.format & PNG_FORMAT_FLAG_COLOR) {
    channels = 3;
  }
  if (png.image.width > 16384 || png.image.height > 16384) {
    return Status(StatusCode::kLimitExceeded, name + ": png: more than 16384 pixels a side");
  }
  // Inflating cannot give more than about 1,032 times the file: a small file that claims a huge
  // picture is refused before memory is taken.
  if (uint64_t(png.image.width) * png.image.height / 8 > uint64_t(bytes.size()) * 1100) {
    return Status(StatusCode::kCorrupt, name + ": png: too short for its size");
  }
  png.image.format = png_format(channels);
  ImageU8 image(png.image.width, png.image.height, channels);
  if (!png_image_finish_read(&png.image, nullptr, image.pixels.data(),
                             static_cast<png_int_32>(image.width_px * channels), nullptr)) {
    return Status(StatusCode::kCorrupt, name + ": png: " + png.image.message);
  }
  // Warnings (a bad checksum of an optional chunk) are not errors; a short image is one that libpng
  // reports above.
  return image;
}

Result<PngSize> decode_png_size(std::span<const std::byte> bytes, const std::string& name) {
  PngImage png;
  if (!png_image_begin_read_from_memory(&png.image, bytes.data(), bytes.size()))
    return Status(StatusCode::kCorrupt, name + ": png: " + png.image.message);
  return PngSize{png.image.width, png.image.height};
}

}  // namespace figurine::ports
