// figurine-train avatar --resume keeps the run's number of threads, or says that it does not; what
// all commands have with --threads; whose threads the device's networks run on.
#include <algorithm>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>

#include "gtest/gtest.h"
#include "ports/host/cpus.h"
#include "samples/program.h"
#include "tests/toolchain/train/small_capture.h"

namespace figurine::cli::avatar_test {
namespace {

using testing_tools::small_capture;
using tests::ProgramRun;
using tests::TestFolder;

ProgramRun train(const TestFolder& folder, const std::string& arguments) {
  return tests::run_shell(FIGURINE_TRAIN " avatar -o run " + arguments, folder);
}

// A run of two iterations on one thread, as it is when it was stopped after the last.
void write_stopped_run(const TestFolder& folder) {
  const ProgramRun run =
      train(folder, "--data " + small_capture().data + " --body " + small_capture().body +
                        " --preset nano --iterations 2 --threads 1 --quiet");
  ASSERT_EQ(run.exit_code, 0) << run.err;
  const std::string path = folder.path("run/run.json");
  nlohmann::json json;
  std::ifstream(path) >> json;
  ASSERT_EQ(json.at("settings").at("threads"), 1);
  json["status"] = "interrupted";
  std::ofstream(path) << json;
}

TEST(AvatarCommand, AResumedRunKeepsItsThreadsAndSaysSo) {
  const TestFolder folder;
  write_stopped_run(folder);
  const ProgramRun resumed = train(folder, "--resume");
  ASSERT_EQ(resumed.exit_code, 0) << resumed.err;
  EXPECT_NE(resumed.err.find("run: goes on with 1 threads, as it began"), std::string::npos)
      << resumed.err;
  const ProgramRun finished = train(folder, "--resume");
  EXPECT_EQ(finished.err.find("goes on"), std::string::npos) << finished.err;
}

TEST(AvatarCommand, ItSaysWhereThreadsAreOthersThanBefore) {
  const TestFolder folder;
  write_stopped_run(folder);
  const ProgramRun resumed = train(folder, "--resume --threads 2 --force-threads");
  ASSERT_EQ(resumed.exit_code, 0) << resumed.err;
  EXPECT_NE(resumed.err.find("goes on with 2 threads, began with 1"), std::string::npos)
      << resumed.err;
}

TEST(AvatarCommand, APerceptualNetworkIsNamedInTheRunWhichGoesOnWithNoOther) {
  const TestFolder folder;
  const std::string shipped = FIGURINE_SOURCE_DIR "/samples/populations/edge_features.safetensors";
  std::filesystem::copy(shipped, folder.path("f.safetensors"));
  const std::string inputs = "--data " + small_capture().data + " --body " + small_capture().body +
                             " --preset nano --iterations 2 --threads 1 --quiet ";
  const ProgramRun run =
      train(folder, inputs + "--sh-degree 1 --perceptual f.safetensors --perceptual-weight 0.5");
  ASSERT_EQ(run.exit_code, 0) << run.err;
  const std::string path = folder.path("run/run.json");
  nlohmann::json json;
  std::ifstream(path) >> json;
  EXPECT_EQ(json.at("settings").at("decoding").at("sh_degree"), 1);
  const nlohmann::json& said = json.at("settings").at("loss").at("perceptual");
  EXPECT_EQ(said.at("network"), "figurine-features");
  EXPECT_EQ(said.at("weight"), 0.5);
  EXPECT_EQ(said.at("window_px"), 128);
  EXPECT_EQ(said.at("hash").get<std::string>().size(), 32u);
  json["status"] = "interrupted";
  std::ofstream(path) << json;
  EXPECT_EQ(train(folder, "--resume --perceptual f.safetensors --quiet").exit_code, 0);
  std::ofstream(path) << json;
  std::ofstream(folder.path("f.safetensors"), std::ios::app) << "x";
  const ProgramRun other = train(folder, "--resume --quiet");
  EXPECT_EQ(other.exit_code, 1);
  EXPECT_NE(other.err.find("f.safetensors: "), std::string::npos) << other.err;
  std::ofstream(folder.path("bad.npz")) << "no zip";
  std::filesystem::remove_all(folder.path("run"));
  const ProgramRun bad = train(folder, inputs + "--perceptual bad.npz");
  EXPECT_EQ(bad.exit_code, 1);
  EXPECT_EQ(std::count(bad.err.begin(), bad.err.end(), '\n'), 1) << bad.err;
  EXPECT_FALSE(folder.has("run"));
  EXPECT_EQ(train(folder, inputs + "--perceptual-weight 1").exit_code, 2);
}

TEST(ThreadsOption, AboveTheUsableCpusIsLoweredWithALineUnlessForced) {
  const TestFolder folder;
  write_stopped_run(folder);
  const std::string cpus = std::to_string(ports::usable_cpus());
  const ProgramRun lowered = train(folder, "--resume --threads 200");
  EXPECT_EQ(lowered.exit_code, 0) << lowered.err;
  EXPECT_NE(lowered.err.find("--threads 200: lowered to the " + cpus + " usable"),
            std::string::npos)
      << lowered.err;
  EXPECT_EQ(lowered.err.find("lowered"), lowered.err.rfind("lowered")) << lowered.err;
  const ProgramRun quiet = train(folder, "--resume --threads 200 --quiet");
  EXPECT_EQ(quiet.exit_code, 0) << quiet.err;
  EXPECT_EQ(std::count(quiet.err.begin(), quiet.err.end(), '\n'), 1)
      << "a run that is finished goes on with nothing: " << quiet.err;
  for (const char* bad : {"1000", "many", "-1", "1000 --force-threads"})
    EXPECT_EQ(train(folder, std::string("--resume --threads ") + bad).exit_code, 2) << bad;
}

// By what the dynamic linker says of itself: XNNPACK's loops are the program's own, not the
// system's.
TEST(Threads, NetworksRunOnThoseThatGiveWay) {
  const TestFolder folder;
  const ProgramRun run = tests::run_shell("LD_DEBUG=bindings " FIGURINE_TRAIN
                                          " --version 2>&1 | grep 'libXNNPACK.* `pthreadpool_'",
                                          folder);
  EXPECT_NE(run.out.find("`pthreadpool_parallelize_1d'"), std::string::npos) << run.out;
  std::istringstream lines(run.out);
  for (std::string line; std::getline(lines, line);)
    EXPECT_NE(line.find("/figurine-train [0]: "), std::string::npos) << line;
}

TEST(PackCommand, WhatHasNoNetworkHasNonePacked) {
  const TestFolder folder;
  const ProgramRun run =
      train(folder, "--data " + small_capture().data + " --body " + small_capture().body +
                        " --preset nano --network none --static-grids all:T --iterations 2 "
                        "--threads 1 --quiet");
  ASSERT_EQ(run.exit_code, 0) << run.err;
  const auto pack = [&](const std::string& options) {
    return tests::run_shell(FIGURINE_TRAIN " pack run -o a.fgn " + options, folder);
  };
  for (const char* options : {"--precision q8", "--precision f32,q8", "--qat --precision q8"}) {
    const ProgramRun refused = pack(options);
    EXPECT_EQ(refused.exit_code, 1) << options;
    EXPECT_EQ(std::count(refused.err.begin(), refused.err.end(), '\n'), 1) << refused.err;
    EXPECT_NE(refused.err.find("run: has no network"), std::string::npos) << refused.err;
    EXPECT_FALSE(std::filesystem::exists(folder.path("a.fgn")));
  }
  const ProgramRun packed = pack("");
  EXPECT_EQ(packed.exit_code, 0) << packed.err;
}

}  // namespace
}  // namespace figurine::cli::avatar_test
