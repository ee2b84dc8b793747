// Files of a run: what is written reads back equal, and what is damaged is refused with a reason.
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>

#include "toolchain/error.h"
#include "toolchain/model/optimiser.h"
#include "toolchain/model/unet.h"
#include "toolchain/tensor_operations.h"
#include "toolchain/train/run_directory.h"

namespace figurine::train::run_directory_test {
namespace {

namespace fs = std::filesystem;

class RunDirectoryTest : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::temp_directory_path() /
              ("figurine_run_" +
               std::string(::testing::UnitTest::GetInstance()->current_test_info()->name()));
    fs::remove_all(folder_);
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }
  std::string path(const std::string& name) const { return (folder_ / name).string(); }

  std::string read_error(const std::string& file) {
    try {
      read_tensor_file(file);
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  }

  fs::path folder_;
};

TensorFile example() {
  TensorFile file;
  file.metadata["note"] = "ten \"quoted\" words";
  file.tensors["a"] = {{2, 3}, {1, 2, 3, 4, 5, -0.0f}};
  file.tensors["b"] = {{1}, {std::nextafter(1.0f, 2.0f)}};
  file.tensors["empty"] = {{0, 4}, {}};
  return file;
}

TEST_F(RunDirectoryTest, TensorFileReadsBackToTheBit) {
  write_tensor_file(path("x.safetensors"), example());
  const TensorFile read = read_tensor_file(path("x.safetensors"));
  EXPECT_EQ(read.metadata, example().metadata);
  ASSERT_EQ(read.tensors.size(), 3u);
  EXPECT_EQ(read.tensors.at("a").shape, (std::vector<int64_t>{2, 3}));
  EXPECT_EQ(read.tensors.at("b").values[0], std::nextafter(1.0f, 2.0f));
  EXPECT_TRUE(std::signbit(read.tensors.at("a").values[5]));
}

TEST_F(RunDirectoryTest, TensorFileRefusesEveryPrefix) {
  write_tensor_file(path("x.safetensors"), example());
  std::ifstream file(path("x.safetensors"), std::ios::binary);
  const std::string bytes((std::istreambuf_iterator<char>(file)), {});
  for (size_t length = 0; length < bytes.size(); ++length) {
    std::ofstream(path("cut"), std::ios::binary)
        .write(bytes.data(), static_cast<std::streamsize>(length));
    ASSERT_NE(read_error(path("cut")), "") << "prefix of " << length << " bytes was accepted";
  }
}

// Ten of thirteen damaged checkpoints were resumed without a word: values that stay finite, digits
// that stay digits.
TEST_F(RunDirectoryTest, TensorFileRefusesEveryChangedByte) {
  write_tensor_file(path("x.safetensors"), example());
  std::ifstream file(path("x.safetensors"), std::ios::binary);
  const std::string bytes((std::istreambuf_iterator<char>(file)), {});
  for (size_t at = 0; at < bytes.size(); ++at) {
    for (const int change : {1, 0x10, 0x80}) {
      std::string damaged = bytes;
      damaged[at] = static_cast<char>(damaged[at] ^ change);
      std::ofstream(path("damaged"), std::ios::binary) << damaged;
      try {
        read_checkpoint_file(path("damaged"));
        FAIL() << "byte " << at << " ^ " << change;
      } catch (const InputError& error) {
        EXPECT_NE(std::string(error.what()).find("damaged: "), std::string::npos) << error.what();
      }
    }
  }
  std::ofstream(path("longer"), std::ios::binary) << bytes << '\0';
  EXPECT_NE(read_error(path("longer")).find("checksum"), std::string::npos);
}

TEST_F(RunDirectoryTest, OnlyACheckpointNeedsAChecksum) {
  const std::string header = R"({"w": {"dtype": "F32", "shape": [1], "data_offsets": [0, 4]}})";
  const uint64_t length = header.size();
  std::ofstream file(path("theirs"), std::ios::binary);
  file.write(reinterpret_cast<const char*>(&length), 8);
  file << header << std::string(4, '\0');
  file.close();
  EXPECT_EQ(read_error(path("theirs")), "");
  EXPECT_FALSE(read_tensor_file(path("theirs")).checked);
  try {
    read_checkpoint_file(path("theirs"));
    FAIL() << "accepted";
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what()).find("checksum: missing"), std::string::npos);
  }
}

TEST_F(RunDirectoryTest, TensorFileNamesWhatIsWrong) {
  EXPECT_NE(read_error(path("absent")).find("absent"), std::string::npos);
  const auto write = [&](const std::string& header, size_t data_bytes, float value = 0) {
    std::ofstream file(path("bad"), std::ios::binary);
    const uint64_t length = header.size();
    file.write(reinterpret_cast<const char*>(&length), 8);
    file << header;
    for (size_t i = 0; i < data_bytes / 4; ++i)
      file.write(reinterpret_cast<const char*>(&value), 4);
  };
  write(R"({"w": {"dtype": "F16", "shape": [2], "data_offsets": [0, 4]}})", 4);
  EXPECT_NE(read_error(path("bad")).find("tensor w: dtype"), std::string::npos);
  write(R"({"w": {"dtype": "F32", "shape": [2], "data_offsets": [0, 4]}})", 4);
  EXPECT_NE(read_error(path("bad")).find("tensor w: shape"), std::string::npos);
  write(R"({"w": {"dtype": "F32", "shape": [4611686018427387904, 4], "data_offsets": [0, 4]}})", 4);
  EXPECT_NE(read_error(path("bad")).find("tensor w: shape"), std::string::npos)
      << "the product overflows 64 bits";
  write(R"({"w": {"dtype": "F32", "shape": [1], "data_offsets": [0, 4]}})", 4, std::nanf(""));
  EXPECT_NE(read_error(path("bad")).find("not finite"), std::string::npos);
}

TEST_F(RunDirectoryTest, CheckpointRestoresWeightsMomentsAndCounters) {
  const TrainSettings settings = preset_settings("nano");
  model::PoseUNet unet(make_network(settings), {.seed = 3}),
      other(make_network(settings), {.seed = 4});
  model::Optimiser optimiser(unet.muon_groups(), {}), restored(unet.muon_groups(), {});
  optimiser.first_moment.uniform_(-1, 1);
  optimiser.second_moment.uniform_(0, 1);
  optimiser.steps = 123456;
  const RunDirectory run{folder_.string()};
  TrainingState state{.iteration = 123456, .seconds = 1.0 / 3, .stages = {.loss = 0.1}};
  save_checkpoint(run, state, {.unet = &unet}, {.unet = &optimiser});
  const TrainingState read = load_checkpoint(run, {.unet = &other}, {.unet = &restored});
  EXPECT_EQ(read.iteration, state.iteration);
  EXPECT_EQ(read.seconds, state.seconds);
  EXPECT_EQ(read.stages.loss, 0.1);
  EXPECT_EQ(restored.steps, optimiser.steps);
  EXPECT_TRUE(torch::equal(other.weights(), unet.weights()));
  EXPECT_TRUE(torch::equal(restored.first_moment, optimiser.first_moment));
  EXPECT_TRUE(torch::equal(restored.second_moment, optimiser.second_moment));
}

TEST_F(RunDirectoryTest, WeightsOfAnotherShapeAreRefusedByName) {
  model::PoseUNet nano(make_network(preset_settings("nano")), {});
  save_weights({folder_.string()}, {.unet = &nano});
  TrainSettings wider = preset_settings("nano");
  wider.fourier_octaves = 0;
  model::PoseUNet other(make_network(wider), {});
  try {
    load_weights(folder_.string(), other);
    FAIL() << "accepted";
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what()).find("layer.0.weight"), std::string::npos) << error.what();
  }
}

TEST_F(RunDirectoryTest, SettingsReadBackEqual) {
  TrainSettings settings = preset_settings("paper");
  settings.template_mode = TemplateMode::kMean;
  settings.freeze_pose = true;
  settings.schedule.budget = {.iterations = 77, .seconds = 0};
  settings.background = TrainingBackground::kRandom;
  settings.bf16 = true;
  const nlohmann::json json = to_json(settings);
  EXPECT_EQ(to_json(settings_from_json(json, "test")), json);
}

TEST_F(RunDirectoryTest, PresetsSayWhatTheyAre) {
  const TrainSettings edge = preset_settings("edge"), paper = preset_settings("paper");
  EXPECT_EQ(to_json(edge).at("static_grids"), "all:T");
  EXPECT_EQ(to_json(edge).at("network_size"), 64);
  EXPECT_EQ(texel_side(edge), 128u);
  EXPECT_TRUE(edge.antialiased && !edge.smallest_extent);
  // The paper to the letter.
  EXPECT_FALSE(to_json(paper).contains("static_grids"));
  EXPECT_FALSE(paper.smallest_extent || paper.antialiased);
  EXPECT_EQ(network_side(paper), 256u);
  EXPECT_EQ(paper.decoding.sh_degree, 3u);
  EXPECT_EQ(paper.fourier_octaves, 0u);
}

// run.json of before presets had static values does not mention them: it had none.
TEST_F(RunDirectoryTest, AnOldRunOfEdgeIsWhatItWas) {
  const TrainSettings read =
      settings_from_json(to_json(network_alone(preset_settings("edge"))), "test");
  EXPECT_TRUE(read.static_grids.empty());
  EXPECT_EQ(network_side(read), 128u);
}

TEST_F(RunDirectoryTest, SettingsOfBothPartsReadBackEqualAndDefaultsAreNotWritten) {
  TrainSettings settings = network_alone(preset_settings("edge"));
  const nlohmann::json plain = to_json(settings);
  for (const char* key :
       {"network", "network_size", "channels", "uv_size", "static_grids", "static_colour",
        "static_learning_rate", "clip_gradient", "smallest_extent", "antialiased", "freeze_network",
        "network_rank", "network_adapter", "network_basis"}) {
    EXPECT_FALSE(plain.contains(key)) << key;
  }
  EXPECT_EQ(plain.at("loss").dump(),
            R"({"l1":1.0,"lpips":0.0,"mask":)" + nlohmann::json(settings.mask_weight).dump() +
                R"(,"ssim":)" + nlohmann::json(settings.ssim_weight).dump() + "}");
  EXPECT_EQ(network_side(settings), 128u);
  settings.uv_size = 256;
  settings.network_size = 64;
  settings.channels = 16;
  settings.clip_gradient = 0.5;
  settings.smallest_extent = settings.antialiased = true;
  settings.init = "other";
  settings.freeze_network = true;
  settings.adapter = {.kind = model::AdapterKind::kBasis, .rank = 4, .basis = "b.safetensors"};
  settings.perceptual = {
      .file = "f.npz", .name = "LPIPS", .hash = "12", .weight = 0.5f, .window_px = 0};
  settings.static_colour = model::StaticColour::kSum;
  settings.static_learning_rate = 5e-3;
  settings.static_grids = parse_static_grids("colour:T,rest:T/2", "test");
  const nlohmann::json json = to_json(settings);
  EXPECT_EQ(json.at("static_grids"), "colour:T,rest:T/2");
  const TrainSettings read = settings_from_json(json, "test");
  EXPECT_EQ(to_json(read), json);
  const model::HeadLayout layout = head_layout(read);
  EXPECT_EQ(layout.network_size, 64u);
  ASSERT_EQ(layout.statics.size(), 2u);
  EXPECT_EQ(layout.statics[0].first, kStaticColour);
  EXPECT_EQ(layout.statics[0].grid_size, 256u);
  EXPECT_EQ(layout.statics[1].count, kStaticColour);
  EXPECT_EQ(layout.statics[1].grid_size, 128u);
  EXPECT_EQ(network_channels(read), 16u);
  EXPECT_TRUE(read.smallest_extent);
  EXPECT_TRUE(read.antialiased);
}

TEST_F(RunDirectoryTest, StaticGridsAreRefusedByName) {
  const auto refusal = [](const std::string& text) {
    try {
      parse_static_grids(text, "--static-grids");
    } catch (const InputError& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  EXPECT_NE(refusal("hair:T").find("\"hair\""), std::string::npos) << refusal("hair:T");
  EXPECT_NE(refusal("all:T/3").find("\"T/3\""), std::string::npos) << refusal("all:T/3");
  EXPECT_NE(refusal("").find("static_grids"), std::string::npos) << refusal("");
  EXPECT_NE(refusal("all:T,").find("static_grids"), std::string::npos) << refusal("all:T,");
  EXPECT_TRUE(parse_static_grids("none", "test").empty());
}

TEST_F(RunDirectoryTest, SettingsOfOlderRunsHaveNoStandoff) {
  nlohmann::json json = to_json(preset_settings("nano"));
  EXPECT_GT(settings_from_json(json, "run.json").standoff_weight, 0);
  json.erase("standoff_weight");
  EXPECT_EQ(settings_from_json(json, "run.json").standoff_weight, 0);
}

TEST_F(RunDirectoryTest, SettingsNameTheFieldThatIsWrong) {
  nlohmann::json json = to_json(preset_settings("nano"));
  json["standoff_weight"] = -1;
  EXPECT_THROW(settings_from_json(json, "run.json"), InputError);
  json = to_json(preset_settings("nano"));
  json["threads"] = 0;
  EXPECT_THROW(settings_from_json(json, "run.json"), InputError);
  json = to_json(preset_settings("nano"));
  json["background"] = "blue";
  try {
    settings_from_json(json, "run.json");
    FAIL() << "accepted";
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what()).find("background"), std::string::npos);
  }
}

TEST_F(RunDirectoryTest, LogIsCutAtTheCheckpoint) {
  const RunDirectory run{folder_.string()};
  save_log(run, {{50, 1.5, 2e-3, 0.1, 20}, {100, 3.0, 1e-3, 0.05, 25}});
  EXPECT_EQ(load_log(run, 100).size(), 2u);
  const std::vector<LogRow> rows = load_log(run, 99);
  ASSERT_EQ(rows.size(), 1u);
  EXPECT_EQ(rows[0].iteration, 50u);
  EXPECT_NEAR(rows[0].psnr_db, 20, 1e-3);
}

TEST_F(RunDirectoryTest, ParameterCountsAreTheDesigns) {
  const auto count = [](const char* preset, uint32_t octaves) {
    TrainSettings settings = preset_settings(preset);
    settings.fourier_octaves = octaves;
    return model::PoseUNet(make_network(settings), {}).parameter_count();
  };
  EXPECT_EQ(count("nano", 0), 9886u);
  EXPECT_EQ(count("nano", 5), 11326u);
  EXPECT_EQ(count("edge", 0), 150094u);
  EXPECT_EQ(count("edge", 5), 155854u);
  EXPECT_EQ(count("paper", 0), 598011u);
}

}  // namespace
}  // namespace figurine::train::run_directory_test
