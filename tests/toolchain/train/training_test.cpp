// Training itself, at the smallest size that shows anything: it beats a flat colour, a resumed run
// equals an uninterrupted one, bad input is refused.
#include <dlfcn.h>
#include <gtest/gtest.h>
#include <sys/resource.h>

#include <algorithm>
#include <cmath>
#include <csignal>
#include <fstream>
#include <nlohmann/json.hpp>

#include "tests/toolchain/train/requests.h"
#include "toolchain/error.h"
#include "toolchain/model/perceptual.h"
#include "toolchain/model/threads.h"
#include "toolchain/pictures/contact_sheet.h"
#include "toolchain/reconstruction/idle_channels.h"
#include "toolchain/reconstruction/reconstruction.h"
#include "toolchain/tensor_operations.h"
#include "toolchain/train/facing.h"
#include "toolchain/train/interrupt.h"
#include "toolchain/train/lanes.h"
#include "toolchain/train/pack_avatar.h"
#include "toolchain/train/sample_feed.h"
#include "toolchain/train/trained_avatar.h"
#include "toolchain/train/trainer.h"

namespace figurine::train::training_test {
namespace {

namespace fs = std::filesystem;
using testing_tools::both_parts;
using testing_tools::bytes_of;
using testing_tools::bytes_of_resumed;
using testing_tools::error_of;
using testing_tools::request;
using testing_tools::small_capture;
using testing_tools::TemporaryFolder;

constexpr uint64_t kIterations = 200;

// One run that several tests look at.
const std::string& trained_run() {
  static const TemporaryFolder folder;
  static const std::string run = [] {
    train_avatar(request(folder.path("run"), kIterations));
    return folder.path("run");
  }();
  return run;
}

// The BLAS that scripts/setup installs; two trainings side by side have a core each.
TEST(Training, ItsThreadsAreOpenBlasToo) {
  const auto blas_threads =
      reinterpret_cast<int (*)()>(dlsym(RTLD_DEFAULT, "openblas_get_num_threads"));
  ASSERT_NE(blas_threads, nullptr);
  const TemporaryFolder folder;
  model::use_threads(2);
  ASSERT_EQ(blas_threads(), 2);
  train_avatar(request(folder.path("run"), 2));
  EXPECT_EQ(blas_threads(), 1);
  TrainedAvatar::open({.run = folder.path("run"), .threads = 2});
  EXPECT_EQ(blas_threads(), 2);
  model::use_threads(1);
}

TEST(Training, BeatsAFlatColourOnHeldOutViewsAndPoses) {
  TrainedAvatar avatar = TrainedAvatar::open({.run = trained_run()});
  const nlohmann::json report = reconstruction::evaluate_reconstruction(avatar, {.quiet = true});
  for (const char* group : {"held_out_views", "held_out_poses"}) {
    const double psnr = report.at(group).at("psnr_db"), flat = report.at(group).at("flat_psnr_db");
    std::printf("%s: %.2f dB, flat colour %.2f dB\n", group, psnr, flat);
    EXPECT_GT(psnr, flat + 2) << group;
  }
}

TEST(Evaluation, TellsCloseUpsFromWholePeople) {
  TrainedAvatar avatar = TrainedAvatar::open({.run = trained_run()});
  const nlohmann::json report = reconstruction::evaluate_reconstruction(avatar, {.quiet = true});
  const nlohmann::json &poses = report.at("held_out_poses"), &views = report.at("held_out_views");
  const dataset::Dataset& data = avatar.data();
  const auto held_out =
      std::count_if(data.frames().begin(), data.frames().end(),
                    [](const auto& frame) { return frame.split != dataset::FrameSplit::kTrain; });
  EXPECT_EQ(poses.at("images"), 7 * held_out) << "one of eight cameras is held out";
  const auto field_of_view = [](const Camera& camera) {
    return camera.fx_px / static_cast<float>(camera.width_px);
  };
  for (const dataset::CaptureCamera& seen : data.cameras())
    EXPECT_NEAR(field_of_view(seen.camera), field_of_view(data.cameras()[0].camera), 1e-4f);
  EXPECT_EQ(poses.at("bust_images"), 2 * held_out);
  EXPECT_FALSE(views.contains("bust_images")) << "of two cameras none is held out";
  for (const char* key : {"bust_psnr_db", "bust_head_psnr_db"}) {
    EXPECT_GT(poses.at(key).get<double>(), 10) << key;
    EXPECT_NE(poses.at(key), poses.at(std::string(key).substr(5)));
  }
  EXPECT_GT(poses.at("highpass_correlation").get<double>(), 0) << "close-ups' is noise so soon";
  for (const char* prefix : {"", "bust_"}) {
    const double correlation = poses.at(std::string(prefix) + "highpass_correlation"),
                 filled = poses.at(std::string(prefix) + "filled_share");
    EXPECT_LE(std::abs(correlation), 1) << prefix;
    EXPECT_GE(filled, 0) << prefix;
    EXPECT_LE(filled, 1) << prefix;
  }
}

TEST(ContactSheet, ShowsSeveralAvatarsBesideTheTruth) {
  TrainedAvatar avatar = TrainedAvatar::open({.run = trained_run()});
  const pictures::ContactSheetOptions small{
      .poses = 1, .person_height_px = 60, .detail_height_px = 20};
  const ports::ImageU8 one = pictures::make_contact_sheet({&avatar}, small),
                       two = pictures::make_contact_sheet({&avatar, &avatar}, small);
  const uint32_t tile = (one.width_px - 12) / 2;
  ASSERT_EQ(two.width_px, 3 * (tile + 2) + 8);
  ASSERT_EQ(two.height_px, one.height_px);
  for (uint32_t y = 0; y < one.height_px; ++y) {
    for (uint32_t x = 0; x < 2 * (tile + 2); ++x)
      ASSERT_TRUE(
          std::ranges::equal(std::span(two.at(4 + x, y), 3), std::span(one.at(4 + x, y), 3)))
          << x << " " << y;
    for (uint32_t x = 0; x < tile; ++x)
      ASSERT_TRUE(std::ranges::equal(std::span(two.at(4 + 2 * (tile + 2) + x, y), 3),
                                     std::span(one.at(4 + tile + 2 + x, y), 3)))
          << x << " " << y;
  }
  EXPECT_THROW(pictures::make_contact_sheet({}, {}), InputError);
}

TEST(ContactSheet, ShowsHeadAndShouldersBelowWholePeople) {
  TrainedAvatar avatar = TrainedAvatar::open({.run = trained_run()});
  const ports::ImageU8 sheet = pictures::make_contact_sheet(
      {&avatar}, {.poses = 1, .person_height_px = 60, .detail_height_px = 20});
  // One pair of square tiles between the rows of 60 and of twice 20, and gaps of 4.
  const uint32_t tile = (sheet.width_px - 12) / 2;
  EXPECT_EQ(sheet.height_px, 60 + tile + 2 * 20 + 5 * 4);
  bool drawn = false;
  for (uint32_t y = 68; y < 68 + tile; ++y) drawn = drawn || sheet.at(4, y)[0] != 255;
  EXPECT_TRUE(drawn) << "the row is not left white";
}

TEST(IdleChannels, AreThoseThatNoPoseTurnsOn) {
  model::PoseUNet unet(make_pose_unet(16, 6, 4, head_channels(0)), {});
  const torch::Tensor input = torch::ones({16, 16, 6});
  reconstruction::IdleChannels fresh(unet);
  EXPECT_EQ(fresh.idle(), fresh.channels()) << "nothing was looked at";
  fresh.look_at(input);
  EXPECT_LT(fresh.idle(), fresh.channels() / 2) << "as it is initialised, most pass";
  // The first convolution's channel 2 has a bias that nothing reaches, and no weights.
  torch::NoGradGuard no_gradient;
  float* const weights = unet.weights().mutable_data_ptr<float>();
  std::fill_n(weights + 2 * 54, 54, 0.0f);
  weights[4 * 54 + 2] = -1;
  reconstruction::IdleChannels idle(unet);
  idle.look_at(input);
  EXPECT_GT(idle.idle(), fresh.idle());
  unet.weights().fill_(-1);
  reconstruction::IdleChannels dead(unet);
  dead.look_at(input);
  EXPECT_EQ(dead.idle(), dead.channels());
}

TEST(GoldenView, ShowsTheFace) {
  const TrainedAvatar avatar = TrainedAvatar::open({.run = trained_run()});
  const GoldenView view = choose_golden_view(avatar);
  // The same pose through the eyes of the rule itself, and no better one in the block.
  dataset::CaptureFrame golden;
  golden.rotations = view.pose.rotations;
  const float chosen = facing(avatar.body(), golden, view.camera);
  EXPECT_GT(chosen, 0.8f);
  for (const dataset::CaptureFrame& frame : avatar.data().frames()) {
    if (frame.split != dataset::FrameSplit::kBlock) continue;
    for (const dataset::CaptureCamera& camera : avatar.data().cameras()) {
      if (camera.framing != dataset::Framing::kBody) continue;
      EXPECT_LE(facing(avatar.body(), frame, camera.camera), chosen);
    }
  }
}

TEST(Facing, IsTheCosineBetweenTheFaceAndTheWayToTheCamera) {
  const PackageFile body = open_package(small_capture().body, PackageKind::kBody);
  dataset::CaptureFrame frame;
  for (uint32_t j = 0; j < dataset::kSmplxJoints; ++j)
    frame.rotations.insert(frame.rotations.end(), {1, 0, 0, 0});
  const auto seen_from = [](float azimuth_deg) {
    return make_orbit_camera({.azimuth_deg = azimuth_deg}, 64, 64).value();
  };
  EXPECT_NEAR(facing(body.package.body(), frame, seen_from(0)), 1, 1e-6);
  EXPECT_NEAR(facing(body.package.body(), frame, seen_from(60)), 0.5, 1e-6);
  EXPECT_NEAR(facing(body.package.body(), frame, seen_from(180)), -1, 1e-6);
  // The root turns by 90 degrees towards +x, the head nods by 60 (about its own axis, now along
  // -z).
  const float half = std::sqrt(0.5f);
  frame.rotations[0] = half, frame.rotations[2] = half;
  EXPECT_NEAR(facing(body.package.body(), frame, seen_from(90)), 1, 1e-6);
  frame.rotations[15 * 4] = std::sqrt(0.75f), frame.rotations[15 * 4 + 1] = 0.5f;
  EXPECT_NEAR(facing(body.package.body(), frame, seen_from(90)), 0.5, 1e-6);
}

TEST(Training, LowersTheLossFromTheFirstLogRowToTheLast) {
  const std::vector<LogRow> rows = load_log({trained_run()}, kIterations);
  ASSERT_EQ(rows.size(), 4u);
  EXPECT_LT(rows.back().loss, 0.7 * rows.front().loss);
  EXPECT_GT(rows.back().psnr_db, rows.front().psnr_db + 3);
}

TEST(Training, ResumedAfterAnInterruptEqualsAnUninterruptedRunBitwise) {
  const TemporaryFolder folder;
  TrainRequest straight = request(folder.path("straight"), 56);
  // Stopped on the ramp and before the first row of the log, at 50; resumed beyond both.
  straight.settings.schedule.ramp_iterations = 45;
  straight.settings.threads = 2;
  straight.settings.views_per_pose = 3;
  straight.settings.background =
      TrainingBackground::kRandom;  // the counter-based generator has to go on as well
  train_avatar(straight);
  TrainRequest broken = straight;
  broken.run = folder.path("broken");
  broken.stop_after = 37;
  EXPECT_THROW(train_avatar(broken), Interrupted);
  EXPECT_EQ(read_run({broken.run}).json.at("status"), "interrupted");
  broken.stop_after = 0;
  broken.resume = true;
  const TrainResult result = train_avatar(broken);
  EXPECT_EQ(result.state.iteration, 56u);
  const std::vector<LogRow> rows = load_log({broken.run}, 56), truth = load_log({straight.run}, 56);
  ASSERT_EQ(rows.size(), truth.size());
  ASSERT_FALSE(rows.empty());
  // Their losses are means since the row before or the resumption, whichever is later.
  for (size_t i = 0; i < rows.size(); ++i) EXPECT_EQ(rows[i].iteration, truth[i].iteration);
  EXPECT_EQ(bytes_of(RunDirectory{broken.run}.weights()),
            bytes_of(RunDirectory{straight.run}.weights()));
}

TEST(Training, OfSeveralPosesAnIterationGivesTheSameBitsOnOneThreadAndOnTwo) {
  const TemporaryFolder folder;
  TrainRequest side_by_side = request(folder.path("side_by_side"), 10);
  side_by_side.settings.poses_per_iteration = 3;  // one lane takes two of them
  side_by_side.settings.threads = 2;
  train_avatar(side_by_side);
  TrainRequest in_turn = side_by_side;
  in_turn.run = folder.path("in_turn");
  in_turn.settings.threads = 1;
  in_turn.stop_after = 4;
  EXPECT_THROW(train_avatar(in_turn), Interrupted);
  in_turn.stop_after = 0;
  in_turn.resume = true;
  train_avatar(in_turn);
  EXPECT_EQ(bytes_of(RunDirectory{in_turn.run}.weights()),
            bytes_of(RunDirectory{side_by_side.run}.weights()));
  TrainRequest one = request(folder.path("one"), 10);
  train_avatar(one);
  EXPECT_NE(bytes_of(RunDirectory{one.run}.weights()),
            bytes_of(RunDirectory{side_by_side.run}.weights()));
}

// The mannequin has neither hair nor skirt, so the weights to start from hold all Gaussians 10 cm
// beside it.
TEST(Training, WithStandoffGivesTheSameBitsResumedAndOnAnyNumberOfThreads) {
  const TemporaryFolder folder;
  TensorFile weights = read_tensor_file(RunDirectory{trained_run()}.weights());
  weights.tensors.at("layer.14.bias").values.at(0) += 2;
  write_tensor_file(folder.path("beside.safetensors"), weights);
  TrainRequest off = request(folder.path("off"), 12);
  off.settings.init = folder.path("beside.safetensors");
  off.settings.poses_per_iteration = 2;
  off.settings.standoff_weight = 0;
  train_avatar(off);
  TrainRequest one = off;
  one.run = folder.path("one");
  one.settings.standoff_weight = preset_settings("nano").standoff_weight;
  train_avatar(one);
  TrainRequest two = one;
  two.run = folder.path("two");
  two.settings.threads = 2;
  two.stop_after = 5;  // while it pulls
  EXPECT_THROW(train_avatar(two), Interrupted);
  two.stop_after = 0;
  two.resume = true;
  train_avatar(two);
  EXPECT_TRUE(bytes_of(RunDirectory{one.run}.weights()) ==
              bytes_of(RunDirectory{two.run}.weights()));
  EXPECT_FALSE(bytes_of(RunDirectory{one.run}.weights()) ==
               bytes_of(RunDirectory{off.run}.weights()));
}

TEST(Lanes, PassOnWhatTheLowestLaneThrewAndGoOn) {
  Lanes lanes(3, [] {});
  std::array<int, 3> calls{};
  try {
    lanes.run([&](unsigned lane) {
      ++calls[lane];
      if (lane > 0) throw InputError("lane " + std::to_string(lane));
    });
    FAIL() << "nothing was thrown";
  } catch (const InputError& error) {
    EXPECT_STREQ(error.what(), "lane 1");
  }
  lanes.run([&](unsigned lane) { ++calls[lane]; });
  EXPECT_EQ(calls, (std::array<int, 3>{2, 2, 2}));
}

TEST(Training, OfAStaticPartAndACoarseNetworkBeatsTheNetworkAlone) {
  const TemporaryFolder folder;
  train_avatar(both_parts(folder.path("run"), kIterations));
  TrainedAvatar both = TrainedAvatar::open({.run = folder.path("run")}),
                alone = TrainedAvatar::open({.run = trained_run()});
  const nlohmann::json report = reconstruction::evaluate_reconstruction(both, {.quiet = true}),
                       plain = reconstruction::evaluate_reconstruction(alone, {.quiet = true});
  for (const char* group : {"held_out_views", "held_out_poses"}) {
    const double psnr = report.at(group).at("psnr_db"), other = plain.at(group).at("psnr_db");
    std::printf("%s: %.2f dB, the network alone %.2f dB\n", group, psnr, other);
    EXPECT_GT(psnr, other + 0.5) << group;
  }
  const nlohmann::json& parts = report.at("parts");
  EXPECT_EQ(parts.at("network").at("size"), 16);
  EXPECT_EQ(parts.at("network").at("parameters"), 11326);
  const uint64_t values = uint64_t{14} * both.body().texel_count();
  EXPECT_EQ(parts.at("static").at("values"), values);
  EXPECT_EQ(parts.at("static").at("bytes"), values + 4 * 14);
  EXPECT_EQ(read_run({folder.path("run")}).json.at("parts"), parts);
  EXPECT_EQ(report.at("rectified_channels"), 14 * 8);
  EXPECT_LT(report.at("idle_channels"), 14 * 4);
  EXPECT_TRUE(plain.at("parts").at("static").is_null());
}

TEST(Training, OfStaticValuesAloneBeatsAFlatColour) {
  const TemporaryFolder folder;
  TrainRequest alone = request(folder.path("run"), 150);
  alone.settings.network = false;
  alone.settings.static_grids = parse_static_grids("colour:T,rest:T/2", "test");
  train_avatar(alone);
  const TensorFile weights = read_tensor_file(RunDirectory{alone.run}.weights());
  EXPECT_EQ(weights.tensors.size(), 2u);
  TrainedAvatar avatar = TrainedAvatar::open({.run = alone.run});
  EXPECT_EQ(weights.tensors.at("static.0").shape,
            (std::vector<int64_t>{avatar.body().texel_count(), 3}));
  EXPECT_THROW(avatar.model().unet(), InputError);
  const nlohmann::json report = reconstruction::evaluate_reconstruction(avatar, {.quiet = true});
  const double psnr = report.at("held_out_views").at("psnr_db"),
               flat = report.at("held_out_views").at("flat_psnr_db");
  std::printf("held-out views: %.2f dB, flat colour %.2f dB\n", psnr, flat);
  EXPECT_GT(psnr, flat + 1);
  EXPECT_TRUE(report.at("parts").at("network").is_null());
}

TEST(Training, OfBothPartsGivesTheSameBitsResumedAndOnAnyNumberOfThreads) {
  const TemporaryFolder folder;
  TrainRequest straight = both_parts(folder.path("straight"), 12);
  straight.settings.static_grids = parse_static_grids("colour:T,rest:T/2", "test");
  straight.settings.static_penalty = 1e-3;
  straight.settings.clip_gradient = 1e-3;
  straight.settings.poses_per_iteration = 2;
  train_avatar(straight);
  const std::string weights = bytes_of(RunDirectory{straight.run}.weights());
  EXPECT_TRUE(weights == bytes_of_resumed(straight, folder.path("broken"), 5));
  // Every one of these settings counts.
  const auto without = [&](const char* name, auto change) {
    TrainRequest other = straight;
    other.run = folder.path(name);
    change(other.settings);
    train_avatar(other);
    EXPECT_FALSE(weights == bytes_of(RunDirectory{other.run}.weights())) << name;
    return read_tensor_file(RunDirectory{other.run}.weights());
  };
  without("no_penalty", [](TrainSettings& settings) { settings.static_penalty = 0; });
  without("no_clip", [](TrainSettings& settings) { settings.clip_gradient = 0; });
  without("sum", [](TrainSettings& s) { s.static_colour = model::StaticColour::kSum; });
  const TensorFile still =
      without("still", [](TrainSettings& settings) { settings.static_learning_rate = 0; });
  for (const float value : still.tensors.at("static.1").values) ASSERT_EQ(value, 0);
}

// Differences of means over 4x4 pixels.
class CoarseDifference : public model::PictureDistance {
 public:
  uint32_t least_side_px() const override { return 4; }
  torch::Tensor between(const torch::Tensor& seen, const torch::Tensor& truth) const override {
    return torch::avg_pool2d((seen - truth).unsqueeze(0), 4).square().mean();
  }
};

TEST(Training, WithAPerceptualLossGivesTheSameBitsResumedAndOnAnyNumberOfThreads) {
  const TemporaryFolder folder;
  TrainRequest straight = request(folder.path("straight"), 10);
  straight.settings.poses_per_iteration = 2;
  straight.settings.views_per_pose = 2;
  straight.settings.perceptual = {
      .file = "coarse", .name = "coarse", .hash = "1", .weight = 1, .window_px = 24};
  straight.perceptual = std::make_shared<const CoarseDifference>();
  train_avatar(straight);
  const nlohmann::json said = read_run({straight.run}).json;
  EXPECT_EQ(said.at("settings").at("loss").at("perceptual").at("network"), "coarse");
  EXPECT_GT(said.at("breakdown_ms").at("perceptual"), 0);
  const std::string weights = bytes_of(RunDirectory{straight.run}.weights());
  EXPECT_TRUE(weights == bytes_of_resumed(straight, folder.path("broken"), 4));
  const auto with = [&](const char* name, auto change) {
    TrainRequest other = straight;
    other.run = folder.path(name);
    change(other);
    train_avatar(other);
    return bytes_of(RunDirectory{other.run}.weights());
  };
  const auto without = [](TrainRequest& other) {
    other.settings.perceptual = {};
    other.perceptual = nullptr;
  };
  const auto of_no_weight = [](TrainRequest& other) { other.settings.perceptual.weight = 0; };
  const std::string none = with("none", without);
  EXPECT_FALSE(weights == none);
  EXPECT_TRUE(none == with("zero", of_no_weight));
  EXPECT_FALSE(weights ==
               with("all", [](TrainRequest& r) { r.settings.perceptual.window_px = 0; }));
  TrainRequest bad = straight;
  bad.run = folder.path("bad");
  bad.perceptual = nullptr;
  EXPECT_NE(error_of(bad).find("perceptual"), std::string::npos) << error_of(bad);
}

TEST(SampleFeed, WindowLiesInsideAroundAPixelOfThePerson) {
  torch::Tensor target = torch::zeros({4, 20, 30});
  target[3][2][28] = 1;
  target[3][15][10] = 1;
  target[3][18][3] = 0.4f;
  const auto is = [](const model::PixelRect& rect, uint32_t x, uint32_t y, uint32_t w, uint32_t h) {
    return rect.x == x && rect.y == y && rect.width == w && rect.height == h;
  };
  EXPECT_TRUE(is(window_on_person(target, 8, 0.0f), 22, 0, 8, 8));  // of the first pixel, moved
  EXPECT_TRUE(is(window_on_person(target, 8, 0.49f), 22, 0, 8, 8));
  EXPECT_TRUE(is(window_on_person(target, 8, 0.5f), 6, 11, 8, 8));
  EXPECT_TRUE(is(window_on_person(target, 8, 0.99999994f), 6, 11, 8, 8));
  EXPECT_TRUE(is(window_on_person(target, 24, 0.9f), 0, 0, 24, 20)) << "as large as there is";
  EXPECT_TRUE(is(window_on_person(target, 0, 0.9f), 0, 0, 30, 20));
  EXPECT_TRUE(is(window_on_person(torch::zeros({4, 20, 30}), 8, 0.9f), 11, 6, 8, 8));
}

TEST(Training, FromAnotherRunTakesItsStaticPartOrTheNetworkAlone) {
  const TemporaryFolder folder;
  train_avatar(both_parts(folder.path("first"), 10));
  const TensorFile first = read_tensor_file(RunDirectory{folder.path("first")}.weights());
  TrainRequest still = both_parts(folder.path("still"), 3);
  still.settings.init = folder.path("first");
  still.settings.static_learning_rate = 0;
  train_avatar(still);
  EXPECT_EQ(read_tensor_file(RunDirectory{still.run}.weights()).tensors.at("static.0").values,
            first.tensors.at("static.0").values);
  TrainRequest plain = request(folder.path("plain"), 3);
  plain.settings.network_size = 16;
  plain.settings.init = folder.path("first");
  train_avatar(plain);
  EXPECT_FALSE(read_tensor_file(RunDirectory{plain.run}.weights()).tensors.contains("static.0"));
  TrainRequest finer = still;
  finer.run = folder.path("finer");
  finer.settings.static_grids = parse_static_grids("all:T/2", "test");
  EXPECT_NE(error_of(finer).find("static.0"), std::string::npos) << error_of(finer);
}

TEST(Training, OfBothPartsIsPackedWithTheNetworksGridAndRoundedValues) {
  const TemporaryFolder folder;
  TrainRequest both = both_parts(folder.path("run"), 20);
  both.settings.static_grids = parse_static_grids("colour:T,rest:T/2", "test");
  train_avatar(both);
  TrainedAvatar avatar = TrainedAvatar::open({.run = both.run});
  const torch::Tensor own = avatar.model().statics().values.clone();
  const AlignedBytes bytes(pack_avatar(avatar, {both.run}, {}));
  EXPECT_TRUE(torch::equal(avatar.model().statics().values, own)) << "packing changed the run";
  const Package package = value_or_throw(Package::open(bytes.bytes(), "package"), "package");
  const Avatar& packed = package.avatar();
  EXPECT_EQ(packed.network.input_size, 16u);
  EXPECT_EQ(packed.texels_a_side(), 32u);
  EXPECT_FALSE(packed.golden.png.empty());
  ASSERT_EQ(packed.static_part.groups.size(), 2u);
  EXPECT_TRUE(validate_static_part(packed.static_part, avatar.body()).ok());
  StaticMap& map = avatar.model().statics();
  take_static_part(packed.static_part, head_layout(both.settings), map);
  float largest_scale = 0;
  for (const StaticGroup& group : packed.static_part.groups) {
    for (const float scale : group.scale) largest_scale = std::max(largest_scale, scale);
  }
  EXPECT_GT(map.values.abs().max().item<float>(), 20 * largest_scale);
  EXPECT_LT((map.values - own).square().mean().sqrt().item<float>(), largest_scale);
}

TEST(Training, WithStaticColoursAsASumIsRefusedByPack) {
  const TemporaryFolder folder;
  TrainRequest sum = both_parts(folder.path("run"), 3);
  sum.settings.static_colour = model::StaticColour::kSum;
  train_avatar(sum);
  TrainedAvatar avatar = TrainedAvatar::open({.run = sum.run});
  EXPECT_THROW(pack_avatar(avatar, {sum.run}, {}), InputError);
}

TEST(AvatarModel, SeesOnACoarseGridWhatTheSourceTexelsShow) {
  TrainSettings settings = preset_settings("nano");
  const PackageFile body = open_package(small_capture().body, PackageKind::kBody);
  const dataset::Dataset data =
      dataset::Dataset::open(small_capture().data, {.body = &body.package.body()});
  const AvatarModel fine(body.package.body(), data.shape(), settings, false);
  settings.network_size = 8;
  const AvatarModel coarse(body.package.body(), data.shape(), settings, false);
  const OwnedPose pose = fine.from_capture(data.frames()[7]);
  const torch::Tensor at_texels = fine.pose(pose.view()).input.flatten(0, 1),
                      at_cells = coarse.pose(pose.view()).input.flatten(0, 1);
  const TexelGrid grid = make_texel_grid(body.package.body(), 8);
  torch::Tensor maps = torch::zeros({64, kMapChannels});
  for (size_t i = 0; i < grid.cell.size(); ++i)
    maps[grid.cell[i]] =
        at_texels[body.package.body().texel[grid.source[i]]].narrow(0, 0, kMapChannels);
  for (size_t i = 0; i < grid.border_cell.size(); ++i)
    maps[grid.border_cell[i]] = maps[grid.cell[grid.border_source[i]]];
  EXPECT_TRUE(torch::equal(at_cells.narrow(1, 0, kMapChannels), maps));
  std::vector<float> fourier(64 * 20);
  draw_fourier_channels(8, 5, 0, 20, fourier);
  EXPECT_TRUE(torch::equal(at_cells.narrow(1, kMapChannels, 20),
                           torch::from_blob(fourier.data(), {64, 20})));
}

TEST(RoundedMap, ComesBackWithNoLargerErrorThanStepsOfTheLargestValueGive) {
  TrainSettings settings = preset_settings("nano");
  settings.static_grids = parse_static_grids("colour:T,opacity:T/4", "test");
  const PackageFile body = open_package(small_capture().body, PackageKind::kBody);
  const model::HeadLayout layout = head_layout(settings);
  StaticMap map(model::HeadComposer(body.package.body(), layout));
  map.values.copy_(
      torch::randn({map.values.numel()}, at::make_generator<at::CPUGeneratorImpl>(uint64_t{3})));
  const auto colours = [](const StaticMap& of) {
    return of.values.narrow(0, 0, of.shapes[0][0] * 3).view({of.shapes[0][0], 3});
  };
  colours(map).select(1, 1).zero_();  // a channel that says nothing
  const RoundedMap rounded(map, layout);
  const StaticPart part = rounded.view();
  ASSERT_EQ(part.groups.size(), 2u);
  EXPECT_EQ(rounded.value_count(), size_t(map.values.numel()));
  EXPECT_EQ(part.groups[1].grid_size, 8u);
  EXPECT_EQ(part.groups[0].scale[1], 1.0f / 127);
  EXPECT_TRUE(validate_static_part(part, body.package.body()).ok());
  StaticMap back = map;
  back.values = map.values.clone();
  take_static_part(part, layout, back);
  for (const int64_t channel : {0, 1, 2}) {
    const torch::Tensor values = colours(map).select(1, channel);
    const double step = std::max(1e-9, values.abs().max().item<double>() / 127);
    const torch::Tensor plain = (values / step).round() * step;
    const double error = (colours(back).select(1, channel) - values).square().mean().item<double>(),
                 most = (plain - values).square().mean().item<double>();
    std::printf("channel %d: mean squared error %.3g, of max |s| / 127 %.3g\n", int(channel), error,
                most);
    EXPECT_LE(error, most * (1 + 1e-5));
    EXPECT_EQ(error == 0, channel == 1);
  }
  StaticPart other = part;
  other.groups.pop_back();
  EXPECT_THROW(take_static_part(other, layout, back), InputError);
  other = part;
  other.groups[1].grid_size = 16;
  EXPECT_THROW(take_static_part(other, layout, back), InputError);
}

TEST(Training, OfAFinishedRunHasNothingToResume) {
  const TemporaryFolder folder;
  TrainRequest once = request(folder.path("run"), 5);
  train_avatar(once);
  const std::string weights = bytes_of(RunDirectory{once.run}.weights());
  once.resume = true;
  EXPECT_TRUE(train_avatar(once).was_finished);
  EXPECT_EQ(bytes_of(RunDirectory{once.run}.weights()), weights);
}

TEST(Training, WithFrozenPoseSeesOneInputPerRootOrientation) {
  TrainSettings settings = preset_settings("nano");
  settings.freeze_pose = true;
  const PackageFile body = open_package(small_capture().body, PackageKind::kBody);
  const dataset::Dataset data =
      dataset::Dataset::open(small_capture().data, {.body = &body.package.body()});
  const AvatarModel frozen(body.package.body(), data.shape(), settings, false);
  settings.freeze_pose = false;
  const AvatarModel moving(body.package.body(), data.shape(), settings, false);
  OwnedPose a = frozen.from_capture(data.frames()[0]), b = frozen.from_capture(data.frames()[9]);
  std::copy_n(a.rotations.begin(), 4,
              b.rotations.begin());  // one root orientation, two articulations
  EXPECT_TRUE(torch::equal(frozen.pose(a.view()).input, frozen.pose(b.view()).input));
  EXPECT_FALSE(torch::equal(moving.pose(a.view()).input, moving.pose(b.view()).input));
  // The Gaussians are skinned with the true pose all the same.
  const PosedBody posed_frozen = frozen.pose(b.view()), posed_moving = moving.pose(b.view());
  for (size_t j = 0; j < posed_frozen.world_from_rest.size(); ++j)
    EXPECT_EQ(posed_frozen.world_from_rest[j].m, posed_moving.world_from_rest[j].m);
  // Turning the root turns the input.
  b.rotations[0] = 0, b.rotations[1] = 0, b.rotations[2] = 1, b.rotations[3] = 0;
  EXPECT_FALSE(torch::equal(frozen.pose(a.view()).input, frozen.pose(b.view()).input));
}

TEST(Training, WithFrozenPoseTrainsAndIsRefusedByPack) {
  const TemporaryFolder folder;
  TrainRequest frozen = request(folder.path("run"), 20);
  frozen.settings.freeze_pose = true;
  train_avatar(frozen);
  TrainedAvatar avatar = TrainedAvatar::open({.run = frozen.run});
  EXPECT_THROW(pack_avatar(avatar, {frozen.run}, {}), InputError);
}

TEST(Training, WithMeanTemplateWarmupAndWholeImagesRuns) {
  const TemporaryFolder folder;
  TrainRequest mean = request(folder.path("run"), 40);
  mean.settings.template_mode = TemplateMode::kMean;
  mean.settings.warmup_iterations = 20;
  mean.settings.background = TrainingBackground::kGrey;
  mean.settings.whole_image_period = 1;
  EXPECT_EQ(train_avatar(mean).state.iteration, 40u);
}

TEST(Training, FromTheWeightsOfAnotherRunStartsThere) {
  const TemporaryFolder folder;
  TrainRequest second = request(folder.path("second"), 50);
  second.settings.init = trained_run();
  train_avatar(second);
  EXPECT_LT(load_log({second.run}, 50)[0].loss, 0.8 * load_log({trained_run()}, 50)[0].loss);
}

TEST(Training, PutsTheRootOfTheMeanTemplateWhereThePersonsWas) {
  TrainSettings settings = preset_settings("nano");
  settings.template_mode = TemplateMode::kMean;
  const PackageFile body = open_package(small_capture().body, PackageKind::kBody);
  const dataset::Dataset data =
      dataset::Dataset::open(small_capture().data, {.body = &body.package.body()});
  const AvatarModel mean(body.package.body(), data.shape(), settings, false);
  std::vector<float> joints(body.package.body().joint_position_m.size()),
      texels(body.package.body().texel_position_m.size());
  shape_body(body.package.body(), data.shape(), joints, texels);
  const OwnedPose pose = mean.from_capture(data.frames()[0]);
  const std::array<float, 3> root = root_position(body.package.body().mean_skeleton(), pose.view());
  for (int k = 0; k < 3; ++k)
    EXPECT_NEAR(root[k], joints[k] + data.frames()[0].root_translation_m[k], 1e-6);
}

TEST(SampleFeed, CropHoldsTheMaskAndItsMargin) {
  dataset::CaptureImage image{.width_px = 20,
                              .height_px = 10,
                              .rgb = std::vector<uint8_t>(600, 7),
                              .alpha = std::vector<uint8_t>(200, 0)};
  image.alpha[3 * 20 + 5] = 9;
  image.alpha[6 * 20 + 18] = 255;
  const CroppedImage crop = crop_to_mask(image, 2);
  EXPECT_EQ(crop.rect.x, 3u);
  EXPECT_EQ(crop.rect.y, 1u);
  EXPECT_EQ(crop.rect.width, 17u);  // to column 19, cut at the image
  EXPECT_EQ(crop.rect.height, 8u);
  EXPECT_EQ(crop.rgba[(2 * 17 + 2) * 4 + 3], 9);
  // The target of the whole image has the crop in its place and zeros around.
  const torch::Tensor target = target_of(crop, {0, 0, 20, 10});
  EXPECT_EQ(target[3][6][18].item<float>(), 1);
  EXPECT_EQ(target[3][0][0].item<float>(), 0);
  EXPECT_EQ(target[0][0][0].item<float>(), 0);
  EXPECT_NEAR(target[0][6][18].item<float>(), 7 / 255.0, 1e-6);
}

TEST(SampleFeed, CropOfAPersonWhomTheBorderCutsEndsThere) {
  // Head and shoulders: the mask runs out of the image below and to the right.
  dataset::CaptureImage image{.width_px = 12,
                              .height_px = 10,
                              .rgb = std::vector<uint8_t>(360, 7),
                              .alpha = std::vector<uint8_t>(120, 0)};
  for (size_t y = 4; y < 10; ++y) {
    for (size_t x = 5; x < 12; ++x) image.alpha[y * 12 + x] = 255;
  }
  const CroppedImage crop = crop_to_mask(image, 3);
  EXPECT_EQ(crop.rect.x, 2u);
  EXPECT_EQ(crop.rect.y, 1u);
  EXPECT_EQ(crop.rect.x + crop.rect.width, 12u);
  EXPECT_EQ(crop.rect.y + crop.rect.height, 10u);
  EXPECT_EQ(crop.rgba.size(), size_t{10 * 9 * 4});
  EXPECT_EQ(crop.rgba.back(), 255) << "the last pixel is the image's own corner";
  const torch::Tensor target = target_of(crop, crop.rect);
  EXPECT_EQ(target[3].sum().item<float>(), 42) << "every pixel of the mask is in it";
  EXPECT_EQ(target[3][8][9].item<float>(), 1);
}

TEST(TrainingInput, IsRefusedWithOneClearLine) {
  const TemporaryFolder folder;
  TrainRequest bad = request(folder.path("run"), 5);
  bad.data = folder.path("nowhere");
  EXPECT_NE(error_of(bad).find("nowhere"), std::string::npos) << error_of(bad);
  bad = request(folder.path("run"), 5);
  bad.body = small_capture().data + "/figurine.json";
  EXPECT_NE(error_of(bad).find("figurine.json"), std::string::npos) << error_of(bad);
  bad = request(folder.path("run"), 5);
  bad.settings = preset_settings("edge");
  bad.settings.schedule.budget = {.iterations = 5, .seconds = 0};
  EXPECT_NE(error_of(bad).find("T = 32"), std::string::npos) << error_of(bad);
  bad = request(folder.path("run"), 5);
  bad.settings.init = folder.path("no_weights");
  EXPECT_NE(error_of(bad).find("no_weights"), std::string::npos) << error_of(bad);
  bad = request(folder.path("run"), 5);
  bad.settings.network_size = 20;
  EXPECT_NE(error_of(bad).find("network_size"), std::string::npos) << error_of(bad);
  bad = request(folder.path("run"), 5);
  bad.settings.network = false;
  EXPECT_NE(error_of(bad).find("static_grids"), std::string::npos) << error_of(bad);
  bad = request(folder.path("run"), 5);
  bad.settings.static_grids = parse_static_grids("all:T,colour:T/2", "test");
  EXPECT_NE(error_of(bad).find("two groups"), std::string::npos) << error_of(bad);
  bad = request(folder.path("absent"), 5);
  bad.resume = true;
  EXPECT_NE(error_of(bad).find("no run to resume"), std::string::npos) << error_of(bad);
}

TEST(TrainingInput, ARunThatIsThereIsNotOverwritten) {
  const TemporaryFolder folder;
  const TrainRequest once = request(folder.path("run"), 5);
  train_avatar(once);
  EXPECT_NE(error_of(once).find("--resume"), std::string::npos);
}

TEST(TrainingInput, ADamagedImageStopsTheRunAndIsNamed) {
  const TemporaryFolder folder;
  fs::copy(small_capture().data, folder.path("data"), fs::copy_options::recursive);
  for (const auto& entry : fs::recursive_directory_iterator(folder.path("data") + "/images_lr")) {
    if (entry.path().extension() == ".jpg")
      fs::resize_file(entry.path(), fs::file_size(entry.path()) * 3 / 4);
  }
  TrainRequest damaged = request(folder.path("run"), 5);
  damaged.data = folder.path("data");
  EXPECT_NE(error_of(damaged).find(".jpg"), std::string::npos) << error_of(damaged);
}

TEST(TrainingInput, ACutOffCheckpointIsRefusedByName) {
  const TemporaryFolder folder;
  TrainRequest stopped = request(folder.path("run"), 20);
  stopped.stop_after = 5;
  EXPECT_THROW(train_avatar(stopped), Interrupted);
  fs::resize_file(RunDirectory{stopped.run}.checkpoint(), 1000);
  stopped.resume = true;
  stopped.stop_after = 0;
  EXPECT_NE(error_of(stopped).find("checkpoint.safetensors"), std::string::npos)
      << error_of(stopped);
}

// Files above this size cannot be written while it lives: what a full disk looks like to a program,
// without one.
class FullDisk {
 public:
  explicit FullDisk(rlim_t limit_bytes) : handler_(std::signal(SIGXFSZ, SIG_IGN)) {
    getrlimit(RLIMIT_FSIZE, &before_);
    const rlimit limit{limit_bytes, before_.rlim_max};
    setrlimit(RLIMIT_FSIZE, &limit);
  }
  ~FullDisk() {
    setrlimit(RLIMIT_FSIZE, &before_);
    std::signal(SIGXFSZ, handler_);
  }

 private:
  rlimit before_{};
  void (*handler_)(int);
};

size_t count_files(const std::string& folder) {
  return static_cast<size_t>(
      std::distance(fs::directory_iterator(folder), fs::directory_iterator()));
}

TEST(Training, OnAFullDiskStopsWithOneLineAndGoesOnFromTheLastCheckpoint) {
  const TemporaryFolder folder;
  const TrainRequest straight = request(folder.path("straight"), 20);
  train_avatar(straight);
  TrainRequest full = request(folder.path("full"), 20);
  full.stop_after = 7;
  EXPECT_THROW(train_avatar(full), Interrupted);
  const RunDirectory run{full.run};
  const std::string checkpoint = bytes_of(run.checkpoint());
  const size_t files = count_files(full.run);
  full.stop_after = 0;
  full.resume = true;
  {
    const FullDisk disk(checkpoint.size() / 2);
    EXPECT_NE(error_of(full).find("checkpoint.safetensors: cannot write"), std::string::npos)
        << error_of(full);
  }
  EXPECT_EQ(bytes_of(run.checkpoint()), checkpoint);
  EXPECT_EQ(count_files(full.run), files);  // nothing half-written is left behind
  EXPECT_EQ(train_avatar(full).state.iteration, 20u);
  EXPECT_EQ(bytes_of(run.weights()), bytes_of(RunDirectory{straight.run}.weights()));
}

TEST(Training, OfALossThatIsNotFiniteStopsAndNamesTheIteration) {
  const TemporaryFolder folder;
  TensorFile weights = read_tensor_file(RunDirectory{trained_run()}.weights());
  // Colours whose squares overflow float: SSIM becomes infinity over infinity.
  std::vector<float>& head_bias = weights.tensors.at("layer.14.bias").values;
  for (size_t channel = 11; channel < 14; ++channel) head_bias.at(channel) = 1e25f;
  write_tensor_file(folder.path("bright.safetensors"), weights);
  TrainRequest bright = request(folder.path("run"), 5);
  bright.settings.init = folder.path("bright.safetensors");
  const std::string error = error_of(bright);
  EXPECT_NE(error.find("iteration 0"), std::string::npos) << error;
  EXPECT_NE(error.find("not finite"), std::string::npos) << error;
  EXPECT_FALSE(fs::exists(RunDirectory{bright.run}.weights()));
}

}  // namespace
}  // namespace figurine::train::training_test
