// Training with smallest extents and the antialiased filter: the same bits resumed, what a package
// holds of them, and what the extents are measured from.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>

#include "tests/toolchain/train/requests.h"
#include "toolchain/error.h"
#include "toolchain/tensor_operations.h"
#include "toolchain/train/avatar_model.h"
#include "toolchain/train/interrupt.h"
#include "toolchain/train/pack_avatar.h"
#include "toolchain/train/trained_avatar.h"
#include "toolchain/train/trainer.h"

namespace figurine::train::filters_test {
namespace {

using testing_tools::bytes_of;
using testing_tools::bytes_of_resumed;
using testing_tools::request;
using testing_tools::small_capture;
using testing_tools::TemporaryFolder;

TrainRequest filtered(const std::string& run, uint64_t iterations) {
  TrainRequest both = request(run, iterations);
  both.settings.smallest_extent = both.settings.antialiased = true;
  return both;
}

TEST(TrainingFilters, WithFiltersGivesTheSameBitsResumedAndOnAnyNumberOfThreads) {
  const TemporaryFolder folder;
  TrainRequest straight = filtered(folder.path("straight"), 12);
  straight.settings.poses_per_iteration = 2;
  train_avatar(straight);
  const std::string weights = bytes_of(RunDirectory{straight.run}.weights());
  EXPECT_TRUE(weights == bytes_of_resumed(straight, folder.path("broken"), 5));
  // Both count, and without either a run has neither extents nor words of them.
  for (bool TrainSettings::* const off :
       {&TrainSettings::smallest_extent, &TrainSettings::antialiased}) {
    TrainRequest other = straight;
    other.run = folder.path(off == &TrainSettings::antialiased ? "no_antialiasing" : "no_extents");
    other.settings.*off = false;
    train_avatar(other);
    const TensorFile a = read_tensor_file(RunDirectory{other.run}.weights()),
                     b = read_tensor_file(RunDirectory{straight.run}.weights());
    EXPECT_NE(a.tensors.at("layer.3.weight").values, b.tensors.at("layer.3.weight").values);
    EXPECT_EQ(a.tensors.contains("smallest_extent.code"), other.settings.smallest_extent);
  }
  EXPECT_TRUE(read_run({straight.run}).json.at("settings").at("antialiased"));
}

TEST(TrainingFilters, WithFiltersIsPackedWithThem) {
  const TemporaryFolder folder;
  const TrainRequest both = filtered(folder.path("run"), 5);
  train_avatar(both);
  TrainedAvatar avatar = TrainedAvatar::open({.run = both.run});
  const AlignedBytes bytes(pack_avatar(avatar, {both.run}, {}));
  const Package package = value_or_throw(Package::open(bytes.bytes(), "package"), "package");
  const Avatar& packed = package.avatar();
  EXPECT_TRUE(packed.antialiased);
  EXPECT_TRUE(validate_smallest_extents(packed.smallest_extents, avatar.body()).ok());
  const std::vector<float>& held = avatar.model().smallest_extents()->extent_m();
  for (size_t i = 0; i < held.size(); ++i)
    ASSERT_EQ(packed.smallest_extents.extent_m(i), held[i]) << "training and device have the same";
  const nlohmann::json parts = read_run({both.run}).json.at("parts");
  EXPECT_EQ(parts.at("smallest_extent").at("bytes"), held.size());
  // Weights of another person's bring no extents, and a damaged file is refused by name.
  train_avatar(request(folder.path("plain"), 3));
  TrainRequest started = filtered(folder.path("started"), 3);
  started.settings.init = folder.path("plain");
  train_avatar(started);
  TensorFile file = read_tensor_file(RunDirectory{both.run}.weights());
  file.tensors.at("smallest_extent.code").values.at(3) = 0.5f;
  write_tensor_file(RunDirectory{both.run}.weights(), file);
  try {
    TrainedAvatar::open({.run = both.run});
    FAIL() << "accepted";
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what()).find("smallest_extent.code"), std::string::npos);
  }
}

// Against the sharpest of all views, and of those that have a texel in their picture, whatever
// hides it: none is sharper than the first, and most texels come close to the second.
TEST(SmallestExtents, AreThoseOfTheSharpestViewThatSawATexel) {
  const PackageFile body = open_package(small_capture().body, PackageKind::kBody);
  const dataset::Dataset data =
      dataset::Dataset::open(small_capture().data, {.body = &body.package.body()});
  TrainSettings settings = preset_settings("nano");
  settings.smallest_extent = true;
  const AvatarModel model(body.package.body(), data.shape(), settings, false);
  const std::vector<float> measured = measure_extents(data, model);
  ASSERT_EQ(measured.size(), body.package.body().texel_count());
  std::vector<double> sharpest(measured.size(), 1e9), inside = sharpest;
  double largest = 0;
  for (size_t frame = 0; frame < data.frames().size(); ++frame) {
    if (data.frames()[frame].split != dataset::FrameSplit::kTrain) continue;
    const OwnedPose pose = model.from_capture(data.frames()[frame]);
    const PosedBody posed = model.pose(pose.view());
    const model::HeadFrame head = model.head_frame(posed);
    for (size_t camera = 0; camera < data.cameras().size(); ++camera) {
      if (data.cameras()[camera].held_out) continue;
      const Camera& view = data.cameras()[camera].camera;
      for (size_t i = 0; i < measured.size(); ++i) {
        const Affine transform =
            blend(posed.world_from_rest, &model.body().texel_joints[i * kSkinInfluences],
                  &model.body().texel_weights[i * kSkinInfluences]);
        const auto world = transform_point(transform, &head.texel_position_m[3 * i]);
        const auto seen = transform_point({view.view_from_world}, world.data());
        const double extent = std::sqrt(0.2) * seen[2] / view.fx_px;
        sharpest[i] = std::min(sharpest[i], extent);
        const float x = view.fx_px * seen[0] / seen[2] + view.cx_px,
                    y = view.fy_px * seen[1] / seen[2] + view.cy_px;
        if (x >= 0 && y >= 0 && x < float(view.width_px) && y < float(view.height_px))
          inside[i] = std::min(inside[i], extent);
        largest = std::max(largest, extent);
      }
    }
  }
  size_t close = 0;
  for (size_t i = 0; i < measured.size(); ++i) {
    EXPECT_GE(measured[i], sharpest[i] * (1 - 1e-5)) << "texel " << i;
    EXPECT_LE(measured[i], largest * (1 + 1e-5)) << "texel " << i;
    close += measured[i] < 1.1 * inside[i];
  }
  std::printf("%zu of %zu texels within 1.1 of the sharpest view that holds them\n", close,
              measured.size());
  EXPECT_GT(close, measured.size() / 2);
  // Close-ups: a head has smaller extents than feet, which they do not hold.
  const auto mean_of = [&](std::initializer_list<int> joints) {
    double sum = 0, count = 0;
    for (size_t i = 0; i < measured.size(); ++i) {
      const int joint = model.body().texel_joints[i * kSkinInfluences];
      if (std::find(joints.begin(), joints.end(), joint) == joints.end()) continue;
      sum += measured[i], ++count;
    }
    return sum / count;
  };
  EXPECT_LT(mean_of({15}), 0.8 * mean_of({7, 8, 10, 11}));
  SmallestExtentMap map(measured.size());
  round_extents(measured, "test", map);
  const float step = map.view().scale_m;
  EXPECT_FLOAT_EQ(step * 255, *std::max_element(measured.begin(), measured.end()));
  for (size_t i = 0; i < measured.size(); ++i) {
    EXPECT_NEAR(map.extent_m()[i], measured[i], 0.51 * step);
    EXPECT_GT(map.extent_m()[i], 0);
  }
  EXPECT_THROW(map.set(step, std::vector<uint8_t>(3, 1), "test"), InputError);
  EXPECT_THROW(map.set(1, std::vector<uint8_t>(measured.size(), 1), "test"), InputError);
}

}  // namespace
}  // namespace figurine::train::filters_test
