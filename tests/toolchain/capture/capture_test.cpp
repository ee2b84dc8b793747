// Whole captures of the mannequin: same bytes for the same seed, readable by the reader, with
// cameras and poses that agree with the pictures.
#include "toolchain/capture/capture.h"

#include <cmath>
#include <filesystem>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>

#include "formats/writer/package_writer.h"
#include "gtest/gtest.h"
#include "ports/host/files.h"
#include "toolchain/body/mannequin.h"
#include "toolchain/body/texel_body.h"
#include "toolchain/dataset/dataset.h"
#include "toolchain/error.h"
#include "toolchain/temporary_folder.h"

namespace figurine::capture::capture_test {
namespace {

namespace fs = std::filesystem;

using testing_tools::TemporaryFolder;

const Package& mannequin() {
  static const TemporaryFolder folder;
  static const ports::MappedFile file = [] {
    const std::string path = folder.path() + "/mannequin.fgn";
    Provenance provenance;
    provenance.tool = "test";
    throw_if_error(ports::write_file_atomically(
                       path, write_package(body::make_texel_body(body::make_mannequin(), 32).view(),
                                           provenance)
                                 .value()),
                   path);
    return ports::MappedFile::open(path).value();
  }();
  static const Package package = Package::open(file.bytes(), "mannequin").value();
  return package;
}

// Everything moves: legs and arms swing, the trunk sways, fingers curl.
ports::MotionClip swinging_clip(uint32_t frames) {
  ports::MotionClip clip;
  clip.name = "swinging";
  clip.frame_count = frames;
  for (uint32_t f = 0; f < frames; ++f) {
    clip.root_translation_m.insert(clip.root_translation_m.end(),
                                   {0.01f * static_cast<float>(f), 0, 0});
    for (uint32_t j = 0; j < body::kJointCount; ++j) {
      const double angle = 0.25 * std::sin(0.4 * f + 1.7 * j);
      clip.rotations.insert(clip.rotations.end(), {static_cast<float>(std::cos(angle / 2)),
                                                   static_cast<float>(std::sin(angle / 2)), 0, 0});
    }
  }
  return clip;
}

CaptureRequest small_request(const std::string& output) {
  return {.output = output,
          .seed = 5,
          .frames = 15,
          .cameras = {.views = 6, .width_px = 96, .height_px = 80},
          .tool = "test",
          .sources = {"swinging: made by the test"}};
}

CaptureEnd capture(const CaptureRequest& request, const CaptureCallback& callback = nullptr) {
  return capture_identities(request, mannequin(), {swinging_clip(60)}, callback);
}

std::map<std::string, std::string> all_files(const std::string& directory) {
  std::map<std::string, std::string> files;
  for (const auto& entry : fs::recursive_directory_iterator(directory)) {
    if (!entry.is_regular_file()) continue;
    std::ifstream file(entry.path(), std::ios::binary);
    files[fs::relative(entry.path(), directory).string()] = {std::istreambuf_iterator<char>(file),
                                                             {}};
  }
  return files;
}

std::string input_error(const std::function<void()>& f) {
  try {
    f();
  } catch (const InputError& error) {
    return error.what();
  }
  ADD_FAILURE() << "no InputError";
  return "";
}

// One finished capture for all tests that only read.
const std::string& finished() {
  static const TemporaryFolder folder;
  static const std::string path = [] {
    capture(small_request(folder.path()));
    return folder.path() + "/000000";
  }();
  return path;
}

TEST(Capture, SameSeedSameBytesForAnyThreads) {
  const TemporaryFolder folder;
  CaptureRequest request = small_request(folder.path());
  request.threads = 3;
  EXPECT_EQ(capture(request), CaptureEnd::kComplete);
  const auto one = all_files(finished()), three = all_files(folder.path() + "/000000");
  EXPECT_EQ(one.size(), 15u * 6 * 2 + 15 + 4);
  EXPECT_TRUE(one == three);
}

TEST(Capture, AnotherSeedIsAnotherPerson) {
  const TemporaryFolder folder;
  CaptureRequest request = small_request(folder.path());
  request.seed = 6;
  request.frames = 2;
  capture(request);
  const dataset::Dataset a = dataset::Dataset::open(finished()),
                         b = dataset::Dataset::open(folder.path() + "/000000");
  EXPECT_NE(a.shape(), b.shape());
  EXPECT_NE(a.load_image(0, 0).rgb, b.load_image(0, 0).rgb);
}

TEST(Capture, ResumedRunEqualsAnUninterruptedOne) {
  const TemporaryFolder folder;
  CaptureRequest request = small_request(folder.path());
  EXPECT_EQ(capture(request, [](const CaptureProgress& p) { return p.images_done < 17; }),
            CaptureEnd::kStopped);
  const std::string identity = folder.path() + "/000000";
  EXPECT_NE(input_error([&] { dataset::Dataset::open(identity); }).find("interrupted"),
            std::string::npos);
  EXPECT_NE(input_error([&] { capture(request); }).find("--resume"), std::string::npos);
  // What a crash may leave: an empty image and a temporary. The one is made again, the other does
  // not disturb.
  std::ofstream(identity + "/images_lr/C01/0005_img.jpg", std::ios::trunc);
  request.resume = true;
  EXPECT_EQ(capture(request), CaptureEnd::kComplete);
  EXPECT_TRUE(all_files(identity) == all_files(finished()));
}

TEST(Capture, ResumeRefusesOtherSettings) {
  const TemporaryFolder folder;
  CaptureRequest request = small_request(folder.path());
  request.frames = 2;
  capture(request);
  request.resume = true;
  request.seed = 9;
  EXPECT_NE(input_error([&] { capture(request); }).find("other settings"), std::string::npos);
}

TEST(Capture, FoldsFollowThePoseOrNot) {
  std::map<FoldMode, std::map<std::string, std::string>> files;
  for (const FoldMode mode : {FoldMode::kPose, FoldMode::kRest, FoldMode::kOff}) {
    const TemporaryFolder folder;
    CaptureRequest request = small_request(folder.path());
    request.frames = 1;
    request.folds = mode;
    capture(request);
    files[mode] = all_files(folder.path() + "/000000");
    EXPECT_NE(files[mode]["figurine.json"].find(std::string("\"folds\":\"") + to_string(mode)),
              std::string::npos);
    EXPECT_EQ(files[mode]["fmask_lr/C01/0005_img_fmask.png"],
              files[FoldMode::kPose]["fmask_lr/C01/0005_img_fmask.png"])
        << "outlines stay";
  }
  const std::string image = "images_lr/C01/0005_img.jpg";
  EXPECT_NE(files[FoldMode::kPose][image], files[FoldMode::kRest][image]);
  EXPECT_NE(files[FoldMode::kPose][image], files[FoldMode::kOff][image]);
}

TEST(Capture, TheMannequinHasNoWardrobe) {
  const TemporaryFolder folder;
  CaptureRequest request = small_request(folder.path());
  request.limits.outfits = {"male_worksuit01"};
  EXPECT_NE(input_error([&] { capture(request); }).find("no wardrobe"), std::string::npos);
}

TEST(Capture, ReaderFindsSplitsAndProvenance) {
  const dataset::Dataset data =
      dataset::Dataset::open(finished(), {.body_hash = format_hash(mannequin().content_hash())});
  EXPECT_EQ(data.frames().size(), 15u);
  EXPECT_EQ(data.cameras().size(), 6u);
  EXPECT_EQ(data.body_name(), "mannequin");
  EXPECT_EQ(data.seed(), 5u);
  ASSERT_EQ(data.sources().size(), 1u);
  std::map<dataset::Role, int> roles;
  for (size_t f = 0; f < 15; ++f) {
    for (size_t c = 0; c < 6; ++c) ++roles[data.role(f, c)];
  }
  for (const dataset::CaptureCamera& camera : data.cameras())
    EXPECT_EQ(camera.framing, dataset::Framing::kBody);
  EXPECT_EQ(roles[dataset::Role::kHeldOutView], 12);
  EXPECT_EQ(roles[dataset::Role::kHeldOutPoseBlock], 10);
  EXPECT_EQ(roles[dataset::Role::kHeldOutPoseInterleaved], 5);
  EXPECT_EQ(roles[dataset::Role::kTrain], 60);
  EXPECT_NE(input_error([] {
              dataset::Dataset::open(finished(), {.body_hash = std::string(32, '0')});
            }).find("body"),
            std::string::npos);
}

// Texels may lie elsewhere than in the body that was captured with: poses and shape mean the same.
TEST(Capture, TrainsABodyOfTheSameSkeleton) {
  const body::TexelBody finer = body::make_texel_body(body::make_mannequin(), 48);
  Body body = finer.view();
  const std::string hash(32, '0');
  EXPECT_EQ(dataset::Dataset::open(finished(), {.body = &body, .body_hash = hash}).body_hash(),
            format_hash(mannequin().content_hash()));
  std::vector<float> joints(body.joint_position_m.begin(), body.joint_position_m.end());
  joints[7] += 1e-4f;
  body.joint_position_m = joints;
  EXPECT_NE(input_error([&] {
              dataset::Dataset::open(finished(), {.body = &body, .body_hash = hash});
            }).find("captured with body"),
            std::string::npos);
}

TEST(Capture, BustCamerasStandBesideTheOthersAndChangeNothingForThem) {
  const TemporaryFolder folder;
  CaptureRequest request = small_request(folder.path());
  request.frames = 3;
  request.cameras.bust_views = 7;
  request.cameras.bust_scale = 0.75f;
  capture(request);
  const std::string identity = folder.path() + "/000000";
  const dataset::Dataset data = dataset::Dataset::open(identity);
  ASSERT_EQ(data.cameras().size(), 13u);
  size_t held_out[2] = {0, 0}, filled[2] = {0, 0};
  for (size_t c = 0; c < 13; ++c) {
    const bool bust = data.cameras()[c].framing == dataset::Framing::kBust;
    EXPECT_EQ(bust, c >= 6);
    EXPECT_EQ(data.cameras()[c].name[0], bust ? 'B' : 'C');
    held_out[bust] += data.cameras()[c].held_out;
    const Camera& camera = data.cameras()[c].camera;
    EXPECT_EQ(camera.width_px, bust ? 72u : 96u);
    EXPECT_EQ(camera.height_px, bust ? 60u : 80u);
    EXPECT_NEAR(camera.cx_px, 0.5f * static_cast<float>(camera.width_px), 1e-4);
    EXPECT_NEAR(camera.fy_px / static_cast<float>(camera.height_px),
                data.cameras()[0].camera.fy_px / 80, 1e-6)
        << "one lens";
    for (const uint8_t alpha : data.load_image(0, c).alpha) filled[bust] += alpha > 127;
  }
  EXPECT_EQ(held_out[0], 1u);
  EXPECT_EQ(held_out[1], 1u) << "one in six of each framing";
  EXPECT_GT(filled[1] * 6, filled[0] * 7) << "more pixels of person than in a larger image";

  request.cameras.bust_views = 0;
  const TemporaryFolder other;
  request.output = other.path();
  capture(request);
  const std::map<std::string, std::string> with = all_files(identity),
                                           without = all_files(other.path() + "/000000");
  EXPECT_EQ(without.at("figurine.json").find("bust"), std::string::npos) << "as ever";
  for (const auto& [name, bytes] : without) {
    if (name == "figurine.json" || name == "camera_extrinsics.json") continue;
    EXPECT_EQ(with.at(name), bytes) << name;
  }
}

// Joints deep inside the body, skinned with the pose that was read and projected with the camera
// that was read, lie on the mask.
TEST(Capture, JointsProjectInsideTheMask) {
  const dataset::Dataset data = dataset::Dataset::open(finished());
  const Body& body = mannequin().body();
  std::vector<float> joints(size_t{body.joint_count()} * 3), texels(size_t{body.texel_count()} * 3);
  shape_body(body, data.shape(), joints, texels);
  int checked = 0;
  for (size_t f = 0; f < data.frames().size(); ++f) {
    std::vector<Affine> transforms(body.joint_count());
    skinning_transforms({body.parents, joints}, data.frames()[f].pose(), transforms);
    for (size_t c = 0; c < data.cameras().size(); ++c) {
      const dataset::CaptureImage image = data.load_image(f, c);
      const Camera& camera = data.cameras()[c].camera;
      for (uint32_t joint : {body::kPelvis, body::kSpine2, body::kHead, body::kLeftKnee,
                             body::kRightKnee, body::kLeftElbow, body::kRightElbow}) {
        const std::array<float, 3> p =
            transform_point(transforms[joint], &joints[size_t{joint} * 3]);
        const auto& m = camera.view_from_world;
        const float z = m[8] * p[0] + m[9] * p[1] + m[10] * p[2] + m[11];
        const float x =
            camera.fx_px * (m[0] * p[0] + m[1] * p[1] + m[2] * p[2] + m[3]) / z + camera.cx_px;
        const float y =
            camera.fy_px * (m[4] * p[0] + m[5] * p[1] + m[6] * p[2] + m[7]) / z + camera.cy_px;
        ASSERT_TRUE(x > 0 && x < 96 && y > 0 && y < 80);
        EXPECT_GT(image.alpha[static_cast<size_t>(y) * 96 + static_cast<size_t>(x)], 127)
            << "frame " << f << " camera " << c << " joint " << joint;
        ++checked;
      }
    }
  }
  EXPECT_EQ(checked, 15 * 6 * 7);
}

// Without figurine.json the same folder is plain MVHumanNet data: the body pose must come out the
// same, the hands at rest.
TEST(Capture, SmplxFilesHoldTheSameBodyPose) {
  const TemporaryFolder folder;
  const std::string copy = folder.path() + "/copy";
  fs::copy(finished(), copy, fs::copy_options::recursive);
  fs::remove(copy + "/figurine.json");
  const Body& body = mannequin().body();
  const dataset::Dataset full = dataset::Dataset::open(finished()),
                         plain = dataset::Dataset::open(copy, {.body = &body});
  ASSERT_EQ(plain.frames().size(), full.frames().size());
  ASSERT_EQ(plain.cameras().size(), full.cameras().size());
  float worst_rotation = 0, worst_translation = 0;
  for (size_t f = 0; f < full.frames().size(); ++f) {
    const auto &a = full.frames()[f], &b = plain.frames()[f];
    for (int i = 0; i < 3; ++i)
      worst_translation =
          std::max(worst_translation, std::fabs(a.root_translation_m[i] - b.root_translation_m[i]));
    for (uint32_t j = 0; j < 25; ++j) {
      float same = 0;
      for (uint32_t k = 0; k < 4; ++k) same += a.rotations[j * 4 + k] * b.rotations[j * 4 + k];
      worst_rotation = std::max(worst_rotation, 1 - std::fabs(same));
    }
  }
  EXPECT_LT(worst_rotation, 1e-6f);
  EXPECT_LT(worst_translation, 1e-5f);
  EXPECT_EQ(plain.frames()[0].rotations[25 * 4], 1.0f);
  EXPECT_LT(full.frames()[0].rotations[25 * 4], 1.0f);
  std::printf("largest difference: rotation %.2g, translation %.2g m\n",
              static_cast<double>(worst_rotation), static_cast<double>(worst_translation));
}

TEST(Capture, ImagesAreBlackWhereTheMaskIs) {
  const dataset::CaptureImage image = dataset::Dataset::open(finished()).load_image(3, 2);
  int outside = 0;
  for (size_t i = 0; i < image.alpha.size(); ++i) {
    // JPEG rings a few pixels beyond the outline: look where a whole 8x8 block lies outside.
    const size_t x = i % 96, y = i / 96;
    bool empty = true;
    for (size_t v = y / 8 * 8; v < y / 8 * 8 + 8; ++v) {
      for (size_t u = x / 8 * 8; u < x / 8 * 8 + 8; ++u)
        empty = empty && image.alpha[v * 96 + u] == 0;
    }
    if (!empty) continue;
    ++outside;
    for (size_t c = 0; c < 3; ++c) ASSERT_EQ(image.rgb[i * 3 + c], 0);
  }
  EXPECT_GT(outside, 1000);
}

TEST(Capture, DamagedFigurineJsonIsNamed) {
  const std::vector<std::pair<std::string, std::string>> damages = {
      {"version", "7"},
      {"shape", "[null]"},
      {"background", "\"green\""},
      {"held_out_cameras", "[\"C99\"]"},
      {"bust_cameras", "[\"B07\"]"},
      {"frames", "[]"},
      {"body", "{}"}};
  for (const auto& [field, value] : damages) {
    const TemporaryFolder folder;
    const std::string copy = folder.path() + "/copy";
    fs::copy(finished(), copy, fs::copy_options::recursive);
    nlohmann::json about = nlohmann::json::parse(std::ifstream(copy + "/figurine.json"));
    about[field] = nlohmann::json::parse(value);
    std::ofstream(copy + "/figurine.json") << about.dump();
    const std::string message = input_error([&] { dataset::Dataset::open(copy); });
    // Without a frame in the file, no image has a pose: that is what the message says.
    EXPECT_NE(message.find(field == "frames" ? "no frame" : field), std::string::npos) << message;
    EXPECT_EQ(message.find('\n'), std::string::npos);
  }
}

TEST(Capture, ContactSheetShowsPeople) {
  const ports::ImageU8 sheet = contact_sheet(finished(), 3, 2);
  EXPECT_EQ(sheet.width_px, 3u * 50);
  EXPECT_EQ(sheet.height_px, 160u);
  const ports::ImageU8 people = people_sheet({finished(), finished(), finished()}, 2);
  EXPECT_EQ(people.width_px, 2u * 50);
  EXPECT_EQ(people.height_px, 160u);
  EXPECT_EQ(people.at(75, 120)[0], 118) << "an empty cell is mid-grey";
}

}  // namespace
}  // namespace figurine::capture::capture_test
