// figurine-inspect as its users meet it: exit codes, one line for each refusal, JSON that does not
// drift, differences that are the right ones.
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>

#include "formats/package_samples.h"

namespace figurine::inspect_test {
namespace {

const std::string kGolden = FIGURINE_SOURCE_DIR "/tests/golden/packages/";

struct Outcome {
  int exit_code = -1;
  std::string out, err;
};

std::string read_text(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

// A folder of this process, gone when it ends.
const std::string& scratch() {
  struct Folder {
    Folder()
        : path(testing::TempDir() + "figurine_inspect_test_" + std::to_string(getpid()) + "/") {
      std::filesystem::create_directories(path);
    }
    ~Folder() { std::filesystem::remove_all(path); }
    std::string path;
  };
  static const Folder folder;
  return folder.path;
}

std::string write_bytes(const std::string& name, const std::vector<std::byte>& bytes) {
  const std::string path = scratch() + name;
  std::ofstream(path, std::ios::binary)
      .write(reinterpret_cast<const char*>(bytes.data()), std::streamsize(bytes.size()));
  return path;
}

// In the golden folder, so that paths in the output are short and the same everywhere.
Outcome inspect(const std::string& arguments) {
  const std::string out = scratch() + "out", err = scratch() + "err";
  const int status = std::system(("cd '" + kGolden + "' && '" FIGURINE_INSPECT "' " + arguments +
                                  " > '" + out + "' 2> '" + err + "'")
                                     .c_str());
  return {.exit_code = WIFEXITED(status) ? WEXITSTATUS(status) : -1,
          .out = read_text(out),
          .err = read_text(err)};
}

bool contains(const std::string& text, const std::string& words) {
  return text.find(words) != std::string::npos;
}

void expect_refused(const Outcome& run, const std::string& words) {
  EXPECT_EQ(run.exit_code, 1);
  EXPECT_EQ(run.out, "");
  EXPECT_TRUE(contains(run.err, words)) << run.err;
  EXPECT_EQ(run.err.find('\n'), run.err.size() - 1) << run.err;
  EXPECT_EQ(run.err.rfind("figurine-inspect: ", 0), 0u) << run.err;
}

TEST(Inspect, PrintsTheDocumentedJsonOfEachKind) {
  for (const std::string kind :
       {"body", "avatar", "fixed_point_avatar", "static_avatar", "static_only_avatar",
        "filtered_avatar", "motion", "population", "half_population", "static_population",
        "sampler", "static_sampler", "known_poses_avatar"}) {
    const Outcome run = inspect(kind + "_v1.fgn --json --tensors");
    EXPECT_EQ(run.exit_code, 0) << run.err;
    EXPECT_EQ(run.err, "");
    const std::string expected_path = kGolden + kind + "_v1.json";
    if (std::getenv("FIGURINE_UPDATE_GOLDEN") != nullptr)
      std::ofstream(expected_path, std::ios::binary) << run.out;
    EXPECT_EQ(run.out, read_text(expected_path)) << expected_path;
  }
}

TEST(Inspect, PrintsWhatADeviceNeedsToKnow) {
  const Outcome avatar = inspect("avatar_v1.fgn");
  EXPECT_EQ(avatar.exit_code, 0);
  for (const char* words :
       {"peak memory       1.05 MB", "MACs a frame      27352", "Gaussians         5", "metre",
        "OpenCV", "sRGB", "853 parameters", "fedcba98765432100123456789abcdef",
        "psnr_pose_db = 31.25", "CC0-1.0", "synthetic"}) {
    EXPECT_TRUE(contains(avatar.out, words)) << words << "\n" << avatar.out;
  }
  EXPECT_FALSE(contains(avatar.out, "network.0.weights"));
  const Outcome fixed = inspect("fixed_point_avatar_v1.fgn --tensors");
  for (const char* words :
       {"precision         q8",
        "in fixed point 55556666777788881111222233334444 by sample library 1", "fixed.0.weights",
        "i8 ", "input int16             0.000244141     0",
        "0     conv 3x3 relu           0.125  -128", "23    conv 1x1                float"}) {
    EXPECT_TRUE(contains(fixed.out, words)) << words << "\n" << fixed.out;
  }
  EXPECT_FALSE(contains(avatar.out + inspect("avatar_v1.fgn --tensors").out, "weight scale"));
  const Outcome body = inspect("body_v1.fgn --tensors");
  for (const char* words : {"0 pelvis  1 spine1  2 head", "rest pose",
                            "8x8 texels, 5 covered, 3 border", "body.texel_weights", "[5,8]"}) {
    EXPECT_TRUE(contains(body.out, words)) << words << "\n" << body.out;
  }
}

TEST(Inspect, SaysWhatTakesHowManyBytes) {
  const Outcome parts = inspect("static_avatar_v1.fgn");
  EXPECT_EQ(parts.exit_code, 0) << parts.err;
  for (const char* words :
       {"header                         64", "network in float             1188",
        "static part                    93", "pose statistics                48",
        "golden frame                   81", "shape coefficients              8",
        "map               8x8 texels", "input 4x4x10, 5 layers", "static part       93 bytes",
        "channels 0 to 10: 2 cells of 2x2, 66 bytes", "channels 11 to 13: 5 cells of 8x8, 27 bytes",
        "required 0x4"}) {
    EXPECT_TRUE(contains(parts.out, words)) << words << "\n" << parts.out;
  }
  const Outcome only = inspect("static_only_avatar_v1.fgn");
  for (const char* words : {"network           none", "precision         f32, q8"})
    EXPECT_TRUE(contains(only.out, words)) << words << "\n" << only.out;
  EXPECT_FALSE(contains(only.out, "network in"));
  EXPECT_TRUE(contains(inspect("avatar_v1.fgn").out, "static part       none"));
  const Outcome filtered = inspect("filtered_avatar_v1.fgn");
  for (const char* words :
       {"smallest extents                5", "smallest extents  0.00 to 1.95 mm, 5 bytes",
        "antialiased       yes", "required 0xc"})
    EXPECT_TRUE(contains(filtered.out, words)) << words << "\n" << filtered.out;
  EXPECT_TRUE(contains(inspect("fixed_point_avatar_v1.fgn").out, "network in fixed point"));
  EXPECT_TRUE(contains(inspect("known_poses_avatar_v1.fgn").out,
                       "pose statistics   2 joints; training poses at 0.50 to 4.00, half of them "
                       "within 1.00"));
  EXPECT_TRUE(contains(inspect("avatar_v1.fgn").out, "pose statistics   1 joints"));
}

TEST(Inspect, ListsThePopulationsMembers) {
  const Outcome run = inspect("population_v1.fgn --tensors");
  EXPECT_EQ(run.exit_code, 0) << run.err;
  for (const char* words :
       {"members           3: 1 train, 1 validation, 1 test",
        "int8, one scale an output channel, entropy-coded", "853 parameters",
        "number  name     split           bytes  psnr_pose_db  psnr_view_db",
        "not stated here; each member has its own", "0  000000   train             831",
        "27.50             -", "1  000001   validation", "28.50         28.25",
        "2  m\xC3\xBCller   test", "population.code", "initial.0.weights",
        "pose.factor               f16  [3,6]"}) {
    EXPECT_TRUE(contains(run.out, words)) << words << "\n" << run.out;
  }
  EXPECT_TRUE(contains(inspect("half_population_v1.fgn").out, "16-bit floats"));
  const Outcome diff = inspect("population_v1.fgn --diff half_population_v1.fgn");
  EXPECT_TRUE(contains(diff.out, "/population/coding: \"q8\" -> \"f16\"")) << diff.out;
  EXPECT_TRUE(contains(diff.out, "population.difference: only in b")) << diff.out;
  EXPECT_TRUE(
      contains(inspect("population_v1.fgn --diff population_v1.fgn").out, "the same content"));
}

TEST(Inspect, SaysHowASamplerSamples) {
  const Outcome run = inspect("sampler_v1.fgn --tensors");
  EXPECT_EQ(run.exit_code, 0) << run.err;
  for (const char* words :
       {"kind              sampler", "MACs a frame      27352",
        "855 values on 24 directions, 16 tokens, 4639 bytes",
        "d_model 8, 2 blocks, 2 heads, feed-forward 12, 1896 parameters, 4448 bytes",
        "dimension 24: 24 x SNR 0.125 at the noisy end", "16 steps of dpmpp2m",
        "7, 16 steps of dpmpp2m: 11121314151617180102030405060708",
        "18446744073709551615, 1000 steps of ddim: 3132333435363738",
        "population 51525354555657584142434445464748", "14  layer 23           69        1",
        "15  shape               2        2", "/held_out/psnr_pose_db/0  21.25",
        "denoiser.norm             f32  [5,2,8]", "input int16             0.000244141     0",
        "23    conv 1x1                float"}) {
    EXPECT_TRUE(contains(run.out, words)) << words << "\n" << run.out;
  }

  samples::SamplerSample sample;
  sample.sampler.steps = 12;
  sample.report = "{\"held_out\": {\"psnr_pose_db\": [21.25, 20.0]}}";
  sample.sampler.report = sample.report;
  sample.matrices[5] = 0;
  const Outcome diff =
      inspect("sampler_v1.fgn --diff " + write_bytes("sampler.fgn", *sample.write()));
  for (const char* words :
       {"/sampler/steps: 16 -> 12", "/sampler/report/held_out/psnr_pose_db/1: 20.5 -> 20.0",
        "denoiser.matrices: 1 of 1408 values differ", "sampler.report: u8 [92] -> u8"}) {
    EXPECT_TRUE(contains(diff.out, words)) << words << "\n" << diff.out;
  }
}

TEST(Inspect, ShowsAReportWhateverItsText) {
  const auto inspected = [](const std::string& report, const std::string& options) {
    samples::SamplerSample sample;
    sample.sampler.report = report;
    const Outcome run = inspect(write_bytes("report.fgn", *sample.write()) + options);
    EXPECT_EQ(run.exit_code, 0) << run.err;
    return run.out;
  };
  EXPECT_TRUE(contains(inspected("", " --json"), "\"report\": null"));
  EXPECT_FALSE(contains(inspected("", ""), "evaluation"));
  EXPECT_TRUE(contains(inspected("no JSON", " --json"), "\"report\": \"no JSON\""));
  // What JSON's escapes hide is printed as escapes.
  const std::string escaped = inspected("{\"\\u001b[2J\": \"\\u009b31m\"}", "");
  EXPECT_TRUE(contains(escaped, "/\\u001b[2J  \"\\u009b31m\"")) << escaped;
  // Nested beyond what a walk on the stack can bear: a text.
  const std::string deep(200'000, '[');
  EXPECT_TRUE(contains(inspected(deep, ""), "[[[["));
  EXPECT_TRUE(contains(inspected(std::string(40, '[') + std::string(40, ']'), " --json"),
                       "\"report\": \"[[[["));
  EXPECT_TRUE(contains(inspected(std::string(100'000, '[') + std::string(100'000, ']'), " --json"),
                       "\"report\": \"[[[["));
  const std::string many = inspected(
      "[1" + std::string(200, ' ') +
          [] {
            std::string rest;
            for (int i = 2; i <= 50; ++i) rest += "," + std::to_string(i);
            return rest;
          }() +
          "]",
      "");
  EXPECT_TRUE(contains(many, "/39  40\n  and 10 more")) << many;
}

TEST(Inspect, RefusesUnsoundPackagesWithOneLine) {
  std::vector<std::byte> bytes = *samples::AvatarSample().write();
  bytes[bytes.size() / 2] ^= std::byte{4};
  expect_refused(inspect(write_bytes("flipped.fgn", bytes)), "checksum does not match");
  expect_refused(inspect(write_bytes("flipped.fgn", bytes) + " --json"), "checksum does not match");
  expect_refused(inspect("avatar_v1.fgn --diff " + write_bytes("flipped.fgn", bytes)),
                 "checksum does not match");
  bytes.resize(100);
  expect_refused(inspect(write_bytes("cut.fgn", bytes)), "cut.fgn: header.file_bytes");
  expect_refused(inspect(write_bytes("empty.fgn", {})), "empty.fgn: header: the file has 0 bytes");
  expect_refused(inspect("no_such_file.fgn"), "no_such_file.fgn");
  expect_refused(inspect("avatar_v1.json"), "avatar_v1.json: header.magic: not a figurine package");
  expect_refused(inspect("."), ".");
}

TEST(Inspect, WrongUsageExitsTwo) {
  for (const char* arguments :
       {"", "--no-such-option", "avatar_v1.fgn body_v1.fgn", "avatar_v1.fgn --diff",
        "body_v1.fgn --diff body_v1.fgn --tensors"}) {
    const Outcome run = inspect(arguments);
    EXPECT_EQ(run.exit_code, 2) << arguments;
    EXPECT_EQ(run.out, "") << arguments;
  }
  EXPECT_EQ(inspect("--help").exit_code, 0);
  EXPECT_EQ(inspect("--version").exit_code, 0);
}

TEST(Inspect, DiffNamesEveryDifferenceAndNoOther) {
  EXPECT_TRUE(contains(inspect("avatar_v1.fgn --diff avatar_v1.fgn").out, "the same content"));
  EXPECT_TRUE(contains(inspect("avatar_v1.fgn --json --diff avatar_v1.fgn").out, "\"same\": true"));

  samples::AvatarSample sample;
  sample.avatar.name = "other";
  sample.weights[0][7] += 0.25f;
  sample.weights[0][9] -= 0.5f;
  sample.avatar.shape = sample.avatar.shape.first(1);
  const std::string other = write_bytes("other.fgn", *sample.write());
  const Outcome text = inspect("avatar_v1.fgn --diff " + other);
  EXPECT_EQ(text.exit_code, 0) << text.err;
  EXPECT_TRUE(contains(text.out, "/name: \"sample avatar\" -> \"other\"")) << text.out;
  EXPECT_TRUE(contains(text.out, "/avatar/shape/1: -1.25 -> null")) << text.out;
  EXPECT_TRUE(contains(text.out, "avatar.shape: f32 [2] -> f32 [1]")) << text.out;
  EXPECT_TRUE(
      contains(text.out, "network.0.weights: 2 of 180 values differ, largest difference 0.5,"))
      << text.out;
  EXPECT_TRUE(contains(text.out, "2 fields and 2 tensors differ")) << text.out;
  EXPECT_TRUE(
      contains(inspect("avatar_v1.fgn --json --diff " + other).out, "\"max_abs_difference\": 0.5"));

  const Outcome kinds = inspect("avatar_v1.fgn --diff motion_v1.fgn");
  EXPECT_EQ(kinds.exit_code, 0);
  EXPECT_TRUE(contains(kinds.out, "/kind: \"avatar\" -> \"motion\"")) << kinds.out;
  EXPECT_TRUE(contains(kinds.out, "motion.rotations: only in b")) << kinds.out;
}

TEST(Inspect, SaysWhatIsReadOfFilesOfGaussians) {
  const Outcome line = inspect("../../data/gaussians/scene.compressed.ply");
  EXPECT_EQ(line.exit_code, 0) << line.err;
  EXPECT_EQ(
      line.out,
      "../../data/gaussians/scene.compressed.ply: 260 Gaussians of degree 3 (compressed ply), "
      "up -y (assumed)\n");
  const Outcome json = inspect("--json ../../data/gaussians/scene.splat");
  EXPECT_EQ(json.exit_code, 0) << json.err;
  for (const char* field : {"\"kind\": \"gaussians\"", "\"gaussians\": 260", "\"up\": \"-y\"",
                            "\"up_stated\": false", "\"left_out\": 0"})
    EXPECT_NE(json.out.find(field), std::string::npos) << field << json.out;
  for (const char* arguments : {"--tensors ../../data/gaussians/scene.splat",
                                "../../data/cases/ply-truncated/in.ply", "none.spz"}) {
    const Outcome refused = inspect(arguments);
    EXPECT_EQ(refused.exit_code, 1) << arguments;
    EXPECT_EQ(refused.out, "");
    EXPECT_EQ(std::count(refused.err.begin(), refused.err.end(), '\n'), 1) << refused.err;
  }
}

}  // namespace
}  // namespace figurine::inspect_test
