// Train, pack, open, and hold the runtime's picture against the trainer's: the whole line at the
// smallest size.
#include <gtest/gtest.h>

#include <cstring>
#include <nlohmann/json.hpp>

#include "ports/host/files.h"
#include "ports/media/png.h"
#include "tests/toolchain/train/small_capture.h"
#include "toolchain/body/atlas.h"
#include "toolchain/quantize/calibration.h"
#include "toolchain/reconstruction/reconstruction.h"
#include "toolchain/reconstruction/requantization.h"
#include "toolchain/train/avatar_file.h"
#include "toolchain/train/avatar_model.h"
#include "toolchain/train/known_poses.h"
#include "toolchain/train/pack_avatar.h"
#include "toolchain/train/pack_population.h"
#include "toolchain/train/trainer.h"
#include "toolchain/verify/parity.h"

namespace figurine::verify::parity_test {
namespace {

using testing_tools::small_capture;
using testing_tools::TemporaryFolder;

constexpr double kWanted_db = 60;

struct PackedRun {
  TemporaryFolder folder;
  std::string run = folder.path("run"), path = folder.path("avatar.fgn");

  explicit PackedRun(TemplateMode mode,
                     const testing_tools::SmallCapture& capture = small_capture(),
                     bool filters = false) {
    train::TrainRequest request{.data = capture.data,
                                .body = capture.body,
                                .run = run,
                                .settings = train::preset_settings("nano"),
                                .quiet = true};
    request.settings.template_mode = mode;
    request.settings.smallest_extent = request.settings.antialiased = filters;
    request.settings.schedule.budget = {.iterations = 200, .seconds = 0};
    request.settings.threads = 1;
    train::train_avatar(request);
    train::TrainedAvatar avatar = train::TrainedAvatar::open({.run = run});
    throw_if_error(
        ports::write_file_atomically(path, train::pack_avatar(avatar, {run}, {.name = "swinger"})),
        path);
  }
};

// Made once: three tests look at the shaped one.
const PackedRun& packed_run(TemplateMode mode) {
  static const PackedRun shaped(TemplateMode::kShaped), mean(TemplateMode::kMean);
  return mode == TemplateMode::kShaped ? shaped : mean;
}

void expect_parity(const PackedRun& packed) {
  train::TrainedAvatar avatar = train::TrainedAvatar::open({.run = packed.run});
  const train::PackageFile package = train::open_package(packed.path, PackageKind::kAvatar);
  const ParityReport report = compare_with_runtime(avatar, package.package.avatar(), {.views = 6});
  std::printf("parity %.2f dB, worst %.2f dB, largest error %.3g\n", report.psnr_db,
              report.worst_psnr_db, report.largest_error);
  ASSERT_EQ(report.views.size(), 6u);
  for (const ParityView& view : report.views)
    EXPECT_GT(view.foreground, 100u) << "the person is not in the picture";
  EXPECT_GE(report.worst_psnr_db, kWanted_db);
}

TEST(Parity, OfShapedTemplateIsAtLeast60dB) { expect_parity(packed_run(TemplateMode::kShaped)); }
TEST(Parity, OfMeanTemplateIsAtLeast60dB) { expect_parity(packed_run(TemplateMode::kMean)); }

// Smallest extents and the antialiased filter, on the device as in training.
TEST(Parity, WithFiltersIsAtLeast60dB) {
  const PackedRun packed(TemplateMode::kShaped, small_capture(), true);
  expect_parity(packed);
  const train::PackageFile package = train::open_package(packed.path, PackageKind::kAvatar);
  EXPECT_EQ(package.package.required_features(), kFeatureFilters);
  // Without either the picture is another one.
  Avatar without = package.package.avatar();
  train::TrainedAvatar avatar = train::TrainedAvatar::open({.run = packed.run});
  without.antialiased = false;
  EXPECT_LT(compare_with_runtime(avatar, without, {.views = 2}).psnr_db, 50);
  without.antialiased = true, without.smallest_extents = {};
  EXPECT_LT(compare_with_runtime(avatar, without, {.views = 2}).psnr_db, 50);
}

// A layout that is not the mesh's own: captured, trained, packed and drawn like any other.
TEST(Parity, OfAWeightedLayoutIsAtLeast60dB) {
  body::BodyModel model = body::make_mannequin();
  body::AtlasOptions atlas{.uv_size = 32, .coarsest_grid = 32, .attempts = 100};
  atlas.weight[static_cast<size_t>(body::BodyPart::kHands)] = 3;
  model.surface = body::pack_atlas(model.surface, atlas);
  body::TexelBody texels = body::make_texel_body(model, 32);
  texels.states_mesh_places = true;
  const testing_tools::SmallCapture capture(texels);
  const PackedRun packed(TemplateMode::kShaped, capture);
  expect_parity(packed);
  train::TrainedAvatar avatar = train::TrainedAvatar::open({.run = packed.run});
  const nlohmann::json report = reconstruction::evaluate_reconstruction(avatar, {.quiet = true});
  const double psnr = report.at("held_out_poses").at("psnr_db"),
               flat = report.at("held_out_poses").at("flat_psnr_db");
  std::printf("held-out poses: %.2f dB, flat colour %.2f dB\n", psnr, flat);
  EXPECT_GT(psnr, flat + 2);
}

// Into a package from before, and the bytes are those of one that was packed with it.
TEST(Pack, KnownPosesCanBeAddedLater) {
  const PackedRun& packed = packed_run(TemplateMode::kShaped);
  const train::PackageFile file = train::open_package(packed.path, PackageKind::kAvatar);
  train::TrainedAvatar avatar = train::TrainedAvatar::open({.run = packed.run});
  std::vector<std::vector<float>> poses;
  for (const dataset::CaptureFrame& frame : avatar.data().frames()) {
    if (frame.split == dataset::FrameSplit::kTrain) poses.push_back(frame.rotations);
  }
  EXPECT_LT(poses.size(), avatar.data().frames().size()) << "held-out poses are not known";
  Avatar silent = file.package.avatar();
  silent.pose_statistics = {};
  const AlignedBytes before(value_or_throw(
      write_package(silent, file.package.budget(), file.package.provenance()), "silent"));
  const Package opened = value_or_throw(Package::open(before.bytes(), "silent"), "silent");
  const std::vector<std::byte> after =
      train::with_known_poses(opened, train::known_poses(poses, avatar.body().joint_count()));
  const ports::MappedFile packed_with_it =
      value_or_throw(ports::MappedFile::open(packed.path), packed.path);
  const std::span<const std::byte> wanted = packed_with_it.bytes();
  EXPECT_TRUE(std::equal(after.begin(), after.end(), wanted.begin(), wanted.end()));
}

TEST(Pack, SaysWhatADeviceNeedsToKnow) {
  const PackedRun& packed = packed_run(TemplateMode::kShaped);
  const train::PackageFile file = train::open_package(packed.path, PackageKind::kAvatar);
  const Avatar& avatar = file.package.avatar();
  const train::PackageFile body = train::open_package(small_capture().body, PackageKind::kBody);
  EXPECT_TRUE(check_avatar_fits_body(avatar, body.package).ok());
  EXPECT_EQ(avatar.name, "swinger");
  EXPECT_EQ(avatar.preset, "nano");
  EXPECT_EQ(count_parameters(avatar.network), 11326u);
  EXPECT_EQ(file.package.budget().gaussians, body.package.body().texel_count());
  EXPECT_GT(file.package.budget().macs_per_frame, 0u);
  EXPECT_EQ(avatar.pose_statistics.joints.size(), 22u);
  EXPECT_EQ(avatar.pose_statistics.covariance.size(), 66u * 66u);
  EXPECT_EQ(avatar.pose_statistics.distances.size(), train::kPoseDistances);
  EXPECT_EQ(file.package.optional_features(), kOptionalPoseDistances);
  EXPECT_EQ(file.package.provenance().depicted_person, "synthetic");
  EXPECT_FALSE(file.package.provenance().sources.empty());
  const Result<ports::ImageU8> golden =
      ports::decode_png(std::as_bytes(avatar.golden.png), "golden");
  ASSERT_TRUE(golden.ok()) << golden.status().message();
  EXPECT_EQ(golden->width_px, avatar.golden.camera.width_px);
  // A picture of somebody, not of the background.
  size_t different = 0;
  for (uint8_t value : golden->pixels) different += value < 120 || value > 136;
  EXPECT_GT(different, golden->pixels.size() / 50);
  const GoldenRun run = draw_golden_frame(file.package, body.package);
  EXPECT_GT(run.memory_bytes, 10000u);
  EXPECT_EQ(run.fixed_point_hash, (std::array<uint64_t, 2>{0, 0}));
}

// The trainer's imitation and the device's integers make the same head, so only the splatters' sums
// differ.
TEST(Parity, InFixedPointIsAtLeast60dB) {
  const PackedRun& packed = packed_run(TemplateMode::kShaped);
  train::TrainedAvatar avatar = train::TrainedAvatar::open({.run = packed.run});
  std::vector<float> storage;
  const Network network = avatar.model().unet().export_network(storage);
  const quantize::QuantisedNetwork quantised(
      network, quantize::choose_scales(network, quantize::observe_activations(avatar, 8), {}));
  const TemporaryFolder folder;
  const std::string path = folder.path("q8.fgn");
  const train::PackOptions options{.float_weights = false, .fixed_point = quantised.view()};
  throw_if_error(
      ports::write_file_atomically(path, train::pack_avatar(avatar, {packed.run}, options)), path);
  const train::PackageFile file = train::open_package(path, PackageKind::kAvatar);
  EXPECT_FALSE(file.package.avatar().holds(Precision::kFloat32));
  EXPECT_LT(double(std::filesystem::file_size(path)),
            0.6 * double(std::filesystem::file_size(packed.path)));  // nano: its index is half
  const ParityReport report = compare_with_runtime(
      avatar, file.package.avatar(), {.views = 6, .precision = Precision::kFixedPoint});
  std::printf("fixed point: %.2f dB, worst %.2f dB, largest error %.3g\n", report.psnr_db,
              report.worst_psnr_db, report.largest_error);
  EXPECT_GE(report.worst_psnr_db, kWanted_db);
  const train::PackageFile body = train::open_package(small_capture().body, PackageKind::kBody);
  const GoldenRun run = draw_golden_frame(file.package, body.package);
  EXPECT_NE(run.fixed_point_hash, (std::array<uint64_t, 2>{0, 0}));
  EXPECT_EQ(run.fixed_point_hash, draw_golden_frame(file.package, body.package).fixed_point_hash);
}

TEST(Population, OfARunCostsLessThanItMay) {
  const PackedRun& packed = packed_run(TemplateMode::kShaped);
  const std::string folder = std::filesystem::path(packed.path).parent_path();
  for (const DifferenceCoding coding : {DifferenceCoding::kInt8, DifferenceCoding::kHalf}) {
    const std::string path = folder + "/population.fgn";
    const std::vector<std::byte> bytes =
        train::pack_population({.inputs = {packed.run}, .coding = coding, .quiet = true});
    throw_if_error(ports::write_file_atomically(path, bytes), path);
    train::TrainedAvatar avatar = train::TrainedAvatar::open({.run = packed.run});
    const train::AvatarFile member = train::open_avatar(path + "#" + capture::identity_name(0));
    std::filesystem::remove(path);  // the map stays
    const nlohmann::json report =
        reconstruction::evaluate_requantization(avatar, member.avatar, {.quiet = true});
    const ParityReport parity = compare_with_runtime(avatar, member.avatar, {.views = 6});
    const double loss_db = report.at("poses").at("loss_db");
    std::printf("%s: %zu bytes, loss %.4f dB, to the run's own pictures %.1f dB\n",
                to_string(coding), bytes.size(), loss_db, parity.psnr_db);
    EXPECT_LE(std::abs(loss_db), 0.2);
    EXPECT_GE(parity.psnr_db, coding == DifferenceCoding::kInt8 ? 40 : 55);
  }
}

TEST(Pack, IsTheSameBytesTwice) {
  const PackedRun& packed = packed_run(TemplateMode::kShaped);
  train::TrainedAvatar avatar = train::TrainedAvatar::open({.run = packed.run});
  const std::vector<std::byte> once = train::pack_avatar(avatar, {packed.run}, {}),
                               twice = train::pack_avatar(avatar, {packed.run}, {});
  EXPECT_EQ(once.size(), twice.size());
  EXPECT_EQ(std::memcmp(once.data(), twice.data(), once.size()), 0);
}

}  // namespace
}  // namespace figurine::verify::parity_test
