// A tiny folder in MVHumanNet's layout, made file by file, so that tests can break it one field at
// a time.
#pragma once

#include <filesystem>
#include <fstream>
#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "gtest/gtest.h"
#include "ports/media/jpeg.h"
#include "ports/media/png.h"
#include "toolchain/error.h"
#include "toolchain/temporary_folder.h"

namespace figurine::dataset::test {

using testing_tools::TemporaryFolder;

inline void write_text(const std::string& path, const std::string& text) {
  std::filesystem::create_directories(std::filesystem::path(path).parent_path());
  std::ofstream(path, std::ios::binary) << text;
}

inline std::string read_text(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

inline void write_bytes(const std::string& path, const std::vector<std::byte>& bytes) {
  write_text(path, std::string(reinterpret_cast<const char*>(bytes.data()), bytes.size()));
}

// Protocol 2: the pickle of a float 2.0 is these twelve bytes.
inline std::string pickle_of_two() {
  return std::string("\x80\x02G\x40\x00\x00\x00\x00\x00\x00\x00.", 12);
}

inline constexpr uint32_t kWidth = 32, kHeight = 24;

// A grey image with a value of its own for every frame and camera.
inline ports::ImageU8 plain_image(uint8_t value) {
  ports::ImageU8 image(kWidth, kHeight, 3);
  std::fill(image.pixels.begin(), image.pixels.end(), value);
  return image;
}

inline ports::ImageU8 left_half_mask() {
  ports::ImageU8 mask(kWidth, kHeight, 1);
  for (uint32_t y = 0; y < kHeight; ++y) {
    for (uint32_t x = 0; x < kWidth / 2; ++x) *mask.at(x, y) = 255;
  }
  return mask;
}

struct FolderSettings {
  std::vector<uint32_t> cameras = {1, 2, 41};
  std::vector<uint32_t> frames = {5, 10, 15, 20};
  std::vector<uint32_t> poses = {0, 1, 2};  // pose files; frame 20 has none
  std::vector<double> rh = {0, 0, 0}, th = {0, 0, 0};
  std::vector<double> shapes = std::vector<double>(10, 0.0);
};

inline std::string camera_name(uint32_t number) { return "CC" + std::to_string(32871000 + number); }

inline void write_folder(const TemporaryFolder& folder, const FolderSettings& settings = {}) {
  using nlohmann::json;
  json extrinsics = json::object();
  for (uint32_t camera : settings.cameras) {
    extrinsics[std::to_string(camera) + "_" + camera_name(camera) + ".png"] = {
        {"focal_length", 80.0},
        {"image_center", {32.0, 24.0}},
        {"rotation", {{1, 0, 0}, {0, -1, 0}, {0, 0, -1}}},
        {"translation", {0.25, 0.5, 1.5}}};
    for (uint32_t frame : settings.frames) {
      char number[16];
      std::snprintf(number, sizeof number, "%04u", frame);
      write_bytes(folder / ("images_lr/" + camera_name(camera) + "/" + number + "_img.jpg"), [&] {
        std::filesystem::create_directories(folder / ("images_lr/" + camera_name(camera)));
        return ports::encode_jpeg(plain_image(static_cast<uint8_t>(100 + frame)), 95).value();
      }());
      write_bytes(folder / ("fmask_lr/" + camera_name(camera) + "/" + number + "_img_fmask.png"),
                  ports::encode_png(left_half_mask()).value());
    }
  }
  write_text(folder / "camera_extrinsics.json", extrinsics.dump());
  write_text(folder / "camera_intrinsics.json",
             json{{"intrinsics", {{80.0, 0.0, 33.0}, {0.0, 82.0, 25.0}, {0.0, 0.0, 1.0}}},
                  {"dist", json::array()}}
                 .dump());
  write_text(folder / "camera_scale.pkl", pickle_of_two());
  for (uint32_t pose : settings.poses) {
    char number[16];
    std::snprintf(number, sizeof number, "%06u", pose);
    std::vector<double> poses(87, 0.0);
    poses[3 * 4 + 1] = 0.1 * (pose + 1);  // left knee, about y
    poses[78] = 0.3;                      // jaw, about x
    const json person = {{"id", 0},
                         {"Rh", {settings.rh}},
                         {"Th", {settings.th}},
                         {"poses", {poses}},
                         {"expression", {std::vector<double>(10, 0.0)}},
                         {"shapes", {settings.shapes}}};
    write_text(folder / (std::string("smplx/smpl/") + number + ".json"),
               json::array({person}).dump());
  }
}

// The message of the InputError that f throws; a failure if it throws none.
inline std::string input_error(const std::function<void()>& f) {
  try {
    f();
  } catch (const InputError& error) {
    return error.what();
  }
  ADD_FAILURE() << "no InputError";
  return "";
}

}  // namespace figurine::dataset::test
