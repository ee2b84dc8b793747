// The reader against a folder of MVHumanNet's layout with all its peculiarities, and against
// damage.
#include "toolchain/dataset/dataset.h"

#include <sys/stat.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "toolchain/body/body_model.h"
#include "toolchain/body/mannequin.h"
#include "toolchain/body/texel_body.h"
#include "toolchain/dataset/mvhumannet_folder.h"

namespace figurine::dataset::dataset_test {
namespace {

using test::input_error;
using test::TemporaryFolder;
using test::write_folder;
using test::write_text;

// Any body with 55 joints serves: only the pelvis' rest position matters.
const body::TexelBody& mannequin() {
  static const body::TexelBody texels = body::make_texel_body(body::make_mannequin(), 32);
  return texels;
}

Dataset open(const std::string& path) {
  static const Body body = mannequin().view();
  return Dataset::open(path, {.body = &body});
}

TEST(Dataset, HalvesACamerasOwnIntrinsicsAndScalesTranslations) {
  const TemporaryFolder folder;
  write_folder(folder);
  const Dataset data = open(folder.path());
  const Camera& camera = data.cameras()[0].camera;
  EXPECT_EQ(camera.width_px, test::kWidth);
  EXPECT_EQ(camera.height_px, test::kHeight);
  EXPECT_EQ(camera.fx_px, 40.0f);
  EXPECT_EQ(camera.fy_px, 40.0f);
  EXPECT_EQ(camera.cx_px, 16.0f);
  EXPECT_EQ(camera.cy_px, 12.0f);
  const std::array<float, 12> expected{1, 0, 0, 0.5f, 0, -1, 0, 1, 0, 0, -1, 3};
  EXPECT_EQ(camera.view_from_world, expected);
}

TEST(Dataset, LeavesOutCamera41AndFramesWithoutPose) {
  const TemporaryFolder folder;
  write_folder(folder);
  const Dataset data = open(folder.path());
  ASSERT_EQ(data.cameras().size(), 2u);
  EXPECT_EQ(data.cameras()[1].name, test::camera_name(2));
  EXPECT_EQ(data.cameras()[1].framing, Framing::kBody) << "where nothing is said";
  EXPECT_EQ(data.cameras_left_out(), 1u);
  ASSERT_EQ(data.frames().size(), 3u);
  EXPECT_EQ(data.frames_without_pose(), 1u);
}

TEST(Dataset, PoseIndexIsFrameOverFiveMinusOne) {
  const TemporaryFolder folder;
  write_folder(folder, {.poses = {1}});
  const Dataset data = open(folder.path());
  ASSERT_EQ(data.frames().size(), 1u);
  EXPECT_EQ(data.frames()[0].number, 10u);
  // Pose file 1 turns the left knee by 0.2 rad about y.
  EXPECT_NEAR(data.frames()[0].rotations[4 * 4 + 0], std::cos(0.1), 1e-6);
  EXPECT_NEAR(data.frames()[0].rotations[4 * 4 + 2], std::sin(0.1), 1e-6);
}

TEST(Dataset, JawAndEyesAreTheLastNineNumbersAndHandsStayAtRest) {
  const TemporaryFolder folder;
  write_folder(folder);
  const Dataset data = open(folder.path());
  const std::vector<float>& q = data.frames()[0].rotations;
  EXPECT_NEAR(q[22 * 4 + 1], std::sin(0.15), 1e-6);
  for (uint32_t joint = 25; joint < 55; ++joint) EXPECT_EQ(q[joint * 4], 1.0f) << joint;
}

// World point = R(Rh) x + Th for every point of the posed model, the pelvis included: our root
// translation must bring the same.
TEST(Dataset, RhAndThTurnAboutTheOriginNotThePelvis) {
  const TemporaryFolder folder;
  const double angle = 0.7;
  write_folder(folder, {.rh = {0, 0, angle}, .th = {0.1, -0.2, 0.3}});
  const Dataset data = open(folder.path());
  const body::JointPositions rest = mannequin().joint_m;
  const Body body = mannequin().view();
  std::vector<Affine> transforms(55);
  skinning_transforms(body.mean_skeleton(), data.frames()[0].pose(), transforms);
  float worst = 0;
  for (int joint : {0, 1, 6}) {  // turned by the root alone
    const float* p = &rest[static_cast<size_t>(joint) * 3];
    const std::array<float, 3> ours = transform_point(transforms[static_cast<size_t>(joint)], p);
    const double expected[3] = {std::cos(angle) * p[0] - std::sin(angle) * p[1] + 0.1,
                                std::sin(angle) * p[0] + std::cos(angle) * p[1] - 0.2, p[2] + 0.3};
    for (int i = 0; i < 3; ++i)
      worst = std::max(worst,
                       static_cast<float>(std::fabs(ours[static_cast<size_t>(i)] - expected[i])));
  }
  EXPECT_LT(worst, 1e-6f);
  RecordProperty("largest_error_m", std::to_string(worst));
}

TEST(Dataset, PelvisRestPositionFollowsTheShape) {
  const TemporaryFolder flat, tall;
  test::FolderSettings settings;
  settings.rh = {0, 0, std::numbers::pi};
  write_folder(flat, settings);
  settings.shapes[0] = 1;  // the mannequin's first direction is stature
  write_folder(tall, settings);
  const Body body = mannequin().view();
  const float rise = body.joint_shape_basis_m[1];
  ASSERT_GT(rise, 0.01f);
  const float difference = open(tall.path()).frames()[0].root_translation_m[1] -
                           open(flat.path()).frames()[0].root_translation_m[1];
  EXPECT_NEAR(difference, -2 * rise, 1e-5);  // upside down: the pelvis goes from r to -r
}

TEST(Dataset, MasksTheBackgroundAway) {
  const TemporaryFolder folder;
  write_folder(folder);
  const CaptureImage image = open(folder.path()).load_image(1, 0);
  EXPECT_NEAR(image.rgb[0], 110, 2);
  EXPECT_EQ(image.alpha[0], 255);
  const size_t right = test::kWidth - 1;
  EXPECT_EQ(image.rgb[right * 3], 0);
  EXPECT_EQ(image.alpha[right], 0);
}

TEST(Dataset, ReadsAllWaysToPickleAFloat) {
  const std::string bits("\x40\x00\x00\x00\x00\x00\x00\x00", 8);
  const std::string protocol4 =
      std::string("\x80\x04\x95\x0a\x00\x00\x00\x00\x00\x00\x00G", 12) + bits + ".";
  const std::vector<std::string> pickles = {std::string("F2.0\n."), std::string("G") + bits + ".",
                                            test::pickle_of_two(), protocol4};
  for (const std::string& pickle : pickles) {
    const TemporaryFolder folder;
    write_folder(folder);
    write_text(folder / "camera_scale.pkl", pickle);
    EXPECT_EQ(open(folder.path()).cameras()[0].camera.view_from_world[3], 0.5f);
  }
}

TEST(Dataset, NeverRunsAPickle) {
  const TemporaryFolder folder;
  write_folder(folder);
  write_text(folder / "camera_scale.pkl", "cos\nsystem\n(S'touch " + (folder / "pwned") + "'\ntR.");
  EXPECT_NE(input_error([&] { open(folder.path()); }).find("camera_scale.pkl"), std::string::npos);
  EXPECT_FALSE(std::filesystem::exists(folder / "pwned"));
}

TEST(Dataset, RejectsEveryPrefixOfThePickle) {
  const TemporaryFolder folder;
  write_folder(folder);
  const std::string whole = test::pickle_of_two();
  for (size_t length = 0; length < whole.size(); ++length) {
    write_text(folder / "camera_scale.pkl", whole.substr(0, length));
    EXPECT_NE(input_error([&] { open(folder.path()); }).find("camera_scale.pkl"), std::string::npos)
        << length;
  }
}

struct Damage {
  const char* name;
  std::function<void(const TemporaryFolder&)> apply;
  std::vector<std::string> mentions;
};

// Replaces the first occurrence of `from` in a file.
void edit(const std::string& path, const std::string& from, const std::string& to) {
  std::string text = test::read_text(path);
  const size_t at = text.find(from);
  ASSERT_NE(at, std::string::npos) << from;
  write_text(path, text.replace(at, from.size(), to));
}

TEST(Dataset, DamageIsNamedWithFileAndField) {
  const std::string image = "images_lr/" + test::camera_name(1) + "/0005_img.jpg";
  const std::vector<Damage> damages = {
      {"not JSON",
       [](const TemporaryFolder& f) { write_text(f / "camera_extrinsics.json", "{"); },
       {"camera_extrinsics.json", "JSON"}},
      {"missing file",
       [](const TemporaryFolder& f) { std::filesystem::remove(f / "camera_intrinsics.json"); },
       {"camera_intrinsics.json"}},
      {"missing field",
       [](const TemporaryFolder& f) {
         edit(f / "camera_extrinsics.json", "\"rotation\"", "\"rotatoin\"");
       },
       {"rotation", "missing"}},
      {"not a rotation",
       [](const TemporaryFolder& f) { edit(f / "camera_extrinsics.json", "[1,0,0]", "[1,1,0]"); },
       {"camera_extrinsics.json"}},
      {"too few numbers",
       [](const TemporaryFolder& f) {
         edit(f / "camera_extrinsics.json", "[0.25,0.5,1.5]", "[0.25,0.5]");
       },
       {"translation", "expected 3"}},
      {"not finite",
       [](const TemporaryFolder& f) { edit(f / "smplx/smpl/000000.json", "0.3", "1e999"); },
       {"000000.json"}},
      {"null number",
       [](const TemporaryFolder& f) { edit(f / "smplx/smpl/000000.json", "0.3", "null"); },
       {"000000.json", "poses", "not a number"}},
      {"intrinsics of another size",
       [](const TemporaryFolder& f) { edit(f / "camera_extrinsics.json", "[32.0,", "[1024.0,"); },
       {"camera_extrinsics.json", "image_center", "principal point"}},
      {"intrinsics transposed",
       [](const TemporaryFolder& f) {
         edit(f / "camera_intrinsics.json", "[0.0,0.0,1.0]", "[33.0,25.0,1.0]");
       },
       {"camera_intrinsics.json", "intrinsics", "transposed"}},
      {"a pipe",
       [](const TemporaryFolder& f) {
         std::filesystem::remove(f / "camera_scale.pkl");
         ASSERT_EQ(::mkfifo((f / "camera_scale.pkl").c_str(), 0600), 0);
       },
       {"camera_scale.pkl", "regular file"}},
      {"scale zero",
       [](const TemporaryFolder& f) { write_text(f / "camera_scale.pkl", "F0.0\n."); },
       {"camera_scale.pkl", "positive"}},
      {"path in a camera's name",
       [](const TemporaryFolder& f) { edit(f / "camera_extrinsics.json", "1_CC", "1_../CC"); },
       {"camera_extrinsics.json", "folder"}},
      {"empty first image",
       [&](const TemporaryFolder& f) { write_text(f / image, ""); },
       {"0005_img.jpg"}},
  };
  for (const Damage& damage : damages) {
    const TemporaryFolder folder;
    write_folder(folder);
    damage.apply(folder);
    const std::string message = input_error([&] { open(folder.path()); });
    for (const std::string& word : damage.mentions)
      EXPECT_NE(message.find(word), std::string::npos) << damage.name << ": " << message;
    EXPECT_EQ(message.find('\n'), std::string::npos) << damage.name;
  }
}

TEST(Dataset, DamagedImagesFailWhenLoaded) {
  const TemporaryFolder folder;
  write_folder(folder);
  const Dataset data = open(folder.path());
  const std::string whole = test::read_text(data.image_path(0, 0));
  for (size_t length : {whole.size() / 4, whole.size() / 2, whole.size() - 2}) {
    write_text(data.image_path(0, 0), whole.substr(0, length));
    EXPECT_NE(input_error([&] { (void)data.load_image(0, 0); }).find("0005_img.jpg"),
              std::string::npos)
        << length;
  }
  write_text(data.image_path(0, 0), whole);
  const std::string mask = test::read_text(data.mask_path(0, 0));
  write_text(data.mask_path(0, 0), mask.substr(0, mask.size() / 2));
  EXPECT_NE(input_error([&] { (void)data.load_image(0, 0); }).find("fmask"), std::string::npos);
  test::write_bytes(data.mask_path(0, 0), ports::encode_png(ports::ImageU8(8, 8, 1)).value());
  EXPECT_NE(input_error([&] { (void)data.load_image(0, 0); }).find("8x8"), std::string::npos);
}

TEST(Dataset, NeedsABodyWhereThereIsNoFigurineJson) {
  const TemporaryFolder folder;
  write_folder(folder);
  EXPECT_NE(input_error([&] { Dataset::open(folder.path()); }).find("body"), std::string::npos);
}

TEST(DefaultSplit, HoldsOutABlockEveryThirteenthAndFourCameras) {
  const Split split = default_split(119, 24);
  const auto count = [&](FrameSplit s) {
    return std::count(split.frames.begin(), split.frames.end(), s);
  };
  EXPECT_EQ(count(FrameSplit::kTrain), 104);
  EXPECT_EQ(count(FrameSplit::kInterleaved), 8);
  EXPECT_EQ(count(FrameSplit::kBlock), 7);
  EXPECT_EQ(std::count(split.held_out_camera.begin(), split.held_out_camera.end(), true), 4);
}

TEST(DefaultSplit, AlwaysLeavesSomethingToTrainOn) {
  for (uint32_t frames = 1; frames < 60; ++frames) {
    for (uint32_t cameras = 1; cameras < 30; ++cameras) {
      const Split split = default_split(frames, cameras);
      ASSERT_EQ(split.frames.size(), frames);
      ASSERT_EQ(split.held_out_camera.size(), cameras);
      ASSERT_GE(2 * std::count(split.frames.begin(), split.frames.end(), FrameSplit::kTrain),
                frames);
      ASSERT_GE(2 * std::count(split.held_out_camera.begin(), split.held_out_camera.end(), false),
                cameras);
    }
  }
}

}  // namespace
}  // namespace figurine::dataset::dataset_test
