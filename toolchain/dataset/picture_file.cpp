#include "toolchain/dataset/picture_file.h"

#include <filesystem>
#include <vector>

#include "ports/host/files.h"
#include "ports/media/jpeg.h"
#include "ports/media/png.h"
#include "toolchain/error.h"

namespace figurine::dataset {

namespace {

constexpr int kQuality = 88;

std::string extension_of(const std::string& path) {
  return std::filesystem::path(path).extension().string();
}

}  // namespace

void check_picture_name(const std::string& path) {
  if (extension_of(path) != ".png" && extension_of(path) != ".jpg")
    throw InputError(path + ": a picture's name must end in .png or .jpg");
}

void write_picture(const std::string& path, const ports::ImageU8& image) {
  check_picture_name(path);
  const std::vector<std::byte> bytes = value_or_throw(
      extension_of(path) == ".png" ? ports::encode_png(image) : ports::encode_jpeg(image, kQuality),
      path);
  throw_if_error(ports::write_file_atomically(path, bytes), "cannot save");
}

}  // namespace figurine::dataset
