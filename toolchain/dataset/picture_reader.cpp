#include "toolchain/dataset/picture_reader.h"

#include <algorithm>
#include <cctype>
#include <optional>

#include "ports/media/jpeg.h"
#include "ports/media/png.h"
#include "toolchain/dataset/read_file.h"
#include "toolchain/error.h"

namespace figurine::dataset {

namespace {

using ports::ImageU8;

bool is_png(std::span<const std::byte> bytes) {
  return bytes.size() >= 4 && bytes[0] == std::byte{0x89} && bytes[1] == std::byte{'P'} &&
         bytes[2] == std::byte{'N'} && bytes[3] == std::byte{'G'};
}

bool is_jpeg(std::span<const std::byte> bytes) {
  return bytes.size() >= 2 && bytes[0] == std::byte{0xff} && bytes[1] == std::byte{0xd8};
}

template <class T>
T value_of(Result<T> result) {
  if (!result.ok()) throw InputError(result.status().message());
  return std::move(result).value();
}

ImageU8 decode(const std::string& path) {
  const ports::MappedFile file = map_file(path);
  if (is_png(file.bytes())) return value_of(ports::decode_png(file.bytes(), path));
  if (is_jpeg(file.bytes())) return value_of(ports::decode_jpeg(file.bytes(), path));
  throw InputError(path + ": neither PNG nor JPEG");
}

// What is inside of a picture of one colour on black.
ImageU8 mask_of_colour(const ImageU8& image, const std::string& path) {
  ImageU8 mask(image.width_px, image.height_px, 1);
  std::optional<std::array<uint8_t, 3>> colour;
  for (size_t i = 0; i < mask.pixels.size(); ++i) {
    const uint8_t* p = &image.pixels[i * image.channels];
    if (p[0] == 0 && p[1] == 0 && p[2] == 0) continue;
    const std::array<uint8_t, 3> here{p[0], p[1], p[2]};
    if (colour && *colour != here) {
      throw InputError(path + ": has several colours; a mask is grey, or one colour on black");
    }
    colour = here;
    mask.pixels[i] = 255;
  }
  return mask;
}

bool is_grey(const ImageU8& image) {
  for (size_t i = 0; i < image.pixels.size(); i += image.channels) {
    if (image.pixels[i] != image.pixels[i + 1] || image.pixels[i] != image.pixels[i + 2])
      return false;
  }
  return true;
}

ImageU8 channel(const ImageU8& image, uint32_t which) {
  ImageU8 out(image.width_px, image.height_px, 1);
  for (size_t i = 0; i < out.pixels.size(); ++i)
    out.pixels[i] = image.pixels[i * image.channels + which];
  return out;
}

}  // namespace

bool is_picture_name(const std::string& name) {
  const size_t dot = name.rfind('.');
  if (dot == std::string::npos) return false;
  std::string ending = name.substr(dot);
  std::transform(ending.begin(), ending.end(), ending.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return ending == ".jpg" || ending == ".jpeg" || ending == ".png";
}

PictureSize read_picture_size(const std::string& path) {
  const ports::MappedFile file = map_file(path);
  if (is_png(file.bytes())) {
    const ports::PngSize size = value_of(ports::decode_png_size(file.bytes(), path));
    return {size.width_px, size.height_px};
  }
  if (file.bytes().empty()) throw InputError(path + ": empty file, no picture");
  if (!is_jpeg(file.bytes())) throw InputError(path + ": neither PNG nor JPEG");
  const ports::JpegSize size = value_of(ports::decode_jpeg_size(file.bytes(), path));
  return {size.width_px, size.height_px};
}

ImageU8 read_colour(const std::string& path) {
  ImageU8 image = decode(path);
  if (image.channels == 3) return image;
  ImageU8 rgb(image.width_px, image.height_px, 3);
  for (size_t i = 0; i < rgb.pixels.size() / 3; ++i) {
    const uint8_t* from = &image.pixels[i * image.channels];
    for (size_t c = 0; c < 3; ++c) {
      rgb.pixels[3 * i + c] =
          image.channels == 1 ? from[0] : static_cast<uint8_t>((from[c] * from[3] + 127) / 255);
    }
  }
  return rgb;
}

ImageU8 read_mask(const std::string& path) {
  ImageU8 image = decode(path);
  if (image.channels == 4) {
    const ImageU8 alpha = channel(image, 3);
    const auto [least, most] = std::minmax_element(alpha.pixels.begin(), alpha.pixels.end());
    if (*least != *most) image = alpha;  // a cut-out person
  }
  if (image.channels > 1) image = is_grey(image) ? channel(image, 0) : mask_of_colour(image, path);
  const uint8_t most = *std::max_element(image.pixels.begin(), image.pixels.end());
  if (most == 1) {  // labels
    for (uint8_t& value : image.pixels) value = static_cast<uint8_t>(255 * value);
  } else if (most > 1 && most < 128) {
    throw InputError(path + ": its brightest value is " + std::to_string(most) +
                     "; masks are 255 inside (or 1, of labels 0 and 1)");
  }
  return image;
}

}  // namespace figurine::dataset
