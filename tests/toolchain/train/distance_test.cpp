// An avatar from nearer and farther, at the smallest size that shows anything: the person
// photographed again is the person of the capture, and every row says what it is called.
#include "toolchain/reconstruction/distance.h"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "tests/toolchain/train/small_capture.h"
#include "toolchain/capture/retake.h"
#include "toolchain/error.h"
#include "toolchain/pictures/avatar_pictures.h"
#include "toolchain/train/trained_avatar.h"
#include "toolchain/train/trainer.h"

namespace figurine::reconstruction::distance_test {
namespace {

namespace fs = std::filesystem;
using testing_tools::small_capture;
using testing_tools::TemporaryFolder;

const std::string& trained_run() {
  static const TemporaryFolder folder;
  static const std::string run = [] {
    train::TrainRequest request{.data = small_capture().data,
                                .body = small_capture().body,
                                .run = folder.path("run"),
                                .settings = train::preset_settings("nano"),
                                .quiet = true};
    request.settings.schedule.budget = {.iterations = 60, .seconds = 0};
    request.settings.threads = 1;
    train::train_avatar(request);
    return folder.path("run");
  }();
  return run;
}

TEST(Retake, IsWhatTheCapturePhotographed) {
  const train::PackageFile body = train::open_package(small_capture().body, PackageKind::kBody);
  const dataset::Dataset data =
      dataset::Dataset::open(small_capture().data, {.body = &body.package.body()});
  capture::Retake retake(small_capture().data, body.package, "");
  for (const size_t frame : {size_t{0}, size_t{9}}) {
    retake.set_pose(data.frames()[frame].pose());
    for (const size_t camera : {size_t{0}, data.cameras().size() - 1}) {
      const capture::Rendering again = retake.render(data.cameras()[camera].camera);
      const dataset::CaptureImage stored = data.load_image(frame, camera);
      ASSERT_EQ(again.alpha.pixels.size(), stored.alpha.size());
      size_t inside = 0, different = 0;
      double error = 0;
      for (size_t i = 0; i < stored.alpha.size(); ++i) {
        inside += stored.alpha[i] > 127;
        different += std::abs(int{again.alpha.pixels[i]} - int{stored.alpha[i]}) > 2;
        for (size_t c = 0; c < 3 && stored.alpha[i] > 127; ++c)
          error += std::pow(int{again.colour.pixels[3 * i + c]} - int{stored.rgb[3 * i + c]}, 2);
      }
      ASSERT_GT(inside, 100u);
      EXPECT_LE(different, inside / 500) << "frame " << frame << ", camera " << camera;
      EXPECT_LT(std::sqrt(error / double(3 * inside)), 6) << "JPEG's own error";
    }
  }
}

TEST(Retake, RefusesWhatItCannotRepeat) {
  const train::PackageFile body = train::open_package(small_capture().body, PackageKind::kBody);
  const TemporaryFolder folder;
  const auto refusal = [&](const std::string& from, const std::string& to) {
    std::ifstream file(small_capture().data + "/figurine.json");
    std::string text{std::istreambuf_iterator<char>(file), {}};
    const size_t at = text.find(from);
    FIG_CHECK(at != std::string::npos, from.c_str());
    text.replace(at, from.size(), to);
    std::ofstream(folder.path("figurine.json")) << text;
    try {
      capture::Retake(folder.path(), body.package, "");
    } catch (const InputError& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  EXPECT_NE(refusal("\"folds\":\"pose\"", "\"folds\":\"flat\"").find("folds: 'flat'"),
            std::string::npos);
  EXPECT_NE(refusal("\"limits\"", "\"bounds\"").find("figurine.json: "), std::string::npos);
  EXPECT_NE(refusal("\"name\":\"mannequin\"", "\"name\":\"makehuman\"")
                .find("figurine.json: body: is 'makehuman'"),
            std::string::npos);
  try {
    capture::Retake(folder.path("nowhere"), body.package, "");
    FAIL() << "accepted";
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what()).find("nowhere/figurine.json"), std::string::npos);
  }
}

TEST(Distance, HasARowForEveryScaleAndFraming) {
  train::TrainedAvatar avatar = train::TrainedAvatar::open({.run = trained_run()});
  const TemporaryFolder folder;
  const nlohmann::json report = evaluate_distance(avatar, {.makehuman = "",
                                                           .scales = {0.25, 2, 8},
                                                           .poses = 2,
                                                           .views = 1,
                                                           .pictures = folder.path(),
                                                           .quiet = true});
  const nlohmann::json& scales = report.at("scales");
  ASSERT_EQ(scales.size(), 4u) << "1 is always there";
  const double expected[] = {0.25, 1, 2, 8};
  for (size_t i = 0; i < 4; ++i) {
    EXPECT_EQ(scales[i].at("scale"), expected[i]);
    for (const char* framing : {"body", "bust"}) {
      const nlohmann::json& group = scales[i].at(framing);
      EXPECT_EQ(group.at("images"), expected[i] > 4 ? 1 : 2);
      EXPECT_GT(group.at("psnr_db").get<double>(), 8) << expected[i] << framing;
      EXPECT_GT(group.at("coverage_ratio").get<double>(), 0.3);
      EXPECT_TRUE(
          fs::exists(folder.path(std::to_string(int(expected[i])) + "_" + framing + ".png")) ||
          i == 0);
    }
  }
  EXPECT_TRUE(fs::exists(folder.path("0.25_bust.png")));
  const nlohmann::json& one = scales[1].at("body");
  EXPECT_EQ(one.at("psnr_db"), one.at("resampled_psnr_db"));
  // The truth of the capture itself, but for JPEG: the same picture of the same pose and camera.
  const size_t frame = [&] {
    size_t at = 0;
    while (avatar.data().frames()[at].split == dataset::FrameSplit::kTrain) ++at;
    return at;
  }();
  size_t camera = 0;
  while (!avatar.data().cameras()[camera].held_out) ++camera;
  const nlohmann::json alone =
      evaluate_distance(avatar, {.scales = {1}, .poses = 1, .views = 1, .quiet = true});
  const double stored_db = measure::foreground_error(
                               pictures::render_picture(avatar, pictures::pose_frame(avatar, frame),
                                                        avatar.data().cameras()[camera].camera),
                               pictures::true_picture(avatar.data(), frame, camera))
                               .psnr_db();
  EXPECT_NEAR(alone.at("scales")[0].at("body").at("psnr_db").get<double>(), stored_db, 0.3);
  // The bounds are those of their rows.
  const nlohmann::json& lattice = report.at("lattice");
  ASSERT_EQ(lattice.at("rows").size(), 2u) << "body and bust at 2; 4 was not asked for";
  bool all = true;
  for (const nlohmann::json& row : lattice.at("rows")) {
    const bool passed = row.at("highpass_ratio").get<double>() <= 1 &&
                        row.at("psnr_db").get<double>() >= row.at("enlarged_psnr_db").get<double>();
    EXPECT_EQ(row.at("passed"), passed);
    EXPECT_EQ(row.at("psnr_db"), scales[2].at(row.at("framing")).at("psnr_db"));
    all = all && passed;
  }
  EXPECT_EQ(lattice.at("passed"), all);
  ASSERT_EQ(report.at("holes").at("rows").size(), 2u);
  for (const nlohmann::json& row : report.at("holes").at("rows"))
    EXPECT_EQ(row.at("filled_share"), scales[1].at(row.at("framing")).at("filled_share"));
}

}  // namespace
}  // namespace figurine::reconstruction::distance_test
