#include "ports/media/pfm.h"

#include <bit>
#include <charconv>
#include <cmath>
#include <cstring>
#include <string_view>

namespace figurine::ports {

static_assert(std::endian::native == std::endian::little, "rows are copied as they lie in memory");

Result<std::vector<std::byte>> encode_pfm(const ImageF32& image) {
  if (!image.sound())
    return Status(StatusCode::kInvalidArgument,
                  "pfm: image size, channels and pixels do not agree");
  const char* magic = image.channels == 1 ? "Pf" : image.channels == 3 ? "PF" : "PF4";
  const std::string header = std::string(magic) + "\n" + std::to_string(image.width_px) + " " +
                             std::to_string(image.height_px) + "\n-1.0\n";
  const size_t row_bytes = size_t(image.width_px) * image.channels * sizeof(float);
  std::vector<std::byte> bytes(header.size() + row_bytes * image.height_px);
  std::memcpy(bytes.data(), header.data(), header.size());
  for (uint32_t y = 0; y < image.height_px; ++y) {
    std::memcpy(bytes.data() + header.size() + row_bytes * y, image.at(0, image.height_px - 1 - y),
                row_bytes);
  }
  return bytes;
}

Result<ImageF32> decode_pfm(std::span<const std::byte> bytes, const std::string& name) {
  const auto corrupt = [&](const char* what) {
    return Status(StatusCode::kCorrupt, name + ": pfm: " + what);
  };
  // Four tokens, each ended by exactly one white space; the header is short.
  std::string_view text(reinterpret_cast<const char*>(bytes.data()),
                        std::min<size_t>(bytes.size(), 128));
  size_t position = 0;
  const auto token = [&]() -> std::string_view {
    const size_t end = text.find_first_of(" \n\t\r", position);
    if (end == std::string_view::npos) return {};
    const std::string_view result = text.substr(position, end - position);
    position = end + 1;
    return result;
  };
  const std::string_view magic = token(), width_text = token(), height_text = token(),
                         scale_text = token();
  const uint32_t channels = magic == "Pf" ? 1 : magic == "PF" ? 3 : magic == "PF4" ? 4 : 0;
  if (channels == 0) return corrupt("does not start with Pf, PF or PF4");
  const auto number = [](std::string_view from, auto& to) {
    const auto [end, error] = std::from_chars(from.data(), from.data() + from.size(), to);
    return error == std::errc() && end == from.data() + from.size();
  };
  uint32_t width = 0, height = 0;
  double scale = 0;
  if (!number(width_text, width) || !number(height_text, height) || width < 1 || height < 1 ||
      width > 16384 || height > 16384) {
    return corrupt("the size is not two numbers from 1 to 16384");
  }
  if (!number(scale_text, scale) || scale == 0 || !std::isfinite(scale))
    return corrupt("the scale is not a finite number other than zero");
  const size_t row_bytes = size_t(width) * channels * sizeof(float);
  if (bytes.size() - position != row_bytes * height)
    return corrupt("the length does not fit the size");
  ImageF32 image(width, height, channels);
  for (uint32_t y = 0; y < height; ++y)
    std::memcpy(image.at(0, height - 1 - y), bytes.data() + position + row_bytes * y, row_bytes);
  if (scale > 0) {
    for (float& value : image.pixels) {
      const auto bits = std::bit_cast<uint32_t>(value);
      value = std::bit_cast<float>(__builtin_bswap32(bits));
    }
  }
  return image;
}

}  // namespace figurine::ports
