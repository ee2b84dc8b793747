#include "toolchain/dataset/picture_file.h"

#include <filesystem>
#include <vector>

#include "ports/host/files.h"
#include "ports/media/png.h"
#include "toolchain/dataset/jpeg.h"
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
  const std::vector<std::byte> bytes = extension_of(path) == ".png"
                                           ? value_or_throw(ports::encode_png(image), path)
                                           : encode_jpeg(image, kQuality);
  throw_if_error(ports::write_file_atomically(path, bytes), "cannot save");
}

}  // namespace figurine::dataset
