#include "samples/program.h"

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <sstream>

#include "formats/writer/package_writer.h"
#include "formats/writer/population_writer.h"
#include "runtime/test_packages.h"

namespace figurine::tests {

namespace {

std::string read_file(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  std::ostringstream content;
  content << file.rdbuf();
  return content.str();
}

void write_file(const std::filesystem::path& path, std::span<const std::byte> bytes) {
  std::ofstream file(path, std::ios::binary);
  file.write(reinterpret_cast<const char*>(bytes.data()),
             static_cast<std::streamsize>(bytes.size()));
  FIG_CHECK(file.good(), "a test file cannot be written");
}

}  // namespace

TestFolder::TestFolder() {
  std::string pattern = (std::filesystem::temp_directory_path() / "figurine-test-XXXXXX").string();
  FIG_CHECK(::mkdtemp(pattern.data()) != nullptr, "no temporary folder");
  path_ = pattern;
}

TestFolder::~TestFolder() {
  std::error_code error;
  std::filesystem::remove_all(path_, error);
}

std::string TestFolder::path(const std::string& name) const {
  return name.empty() ? path_.string() : (path_ / name).string();
}

void TestFolder::write(const std::string& name, const std::string& content) const {
  write_file(path_ / name, std::as_bytes(std::span(content)));
}

std::string TestFolder::read(const std::string& name) const { return read_file(path_ / name); }

std::vector<std::string> TestFolder::names() const {
  std::vector<std::string> names;
  for (const auto& entry : std::filesystem::directory_iterator(path_))
    names.push_back(entry.path().filename().string());
  std::sort(names.begin(), names.end());
  return names;
}

size_t ProgramRun::error_lines() const {
  return static_cast<size_t>(std::count(err.begin(), err.end(), '\n'));
}

ProgramRun run_figurine(const std::string& arguments, const RunOptions& options) {
  const TestFolder streams;  // beside the working folder, which is inspected for leftovers
  const std::string folder = options.folder.empty() ? streams.path() : options.folder;
  const std::string command = "cd '" + folder + "' && " + options.before + " " +
                              options.environment + " '" FIGURINE_PROGRAM "' " + arguments +
                              " > '" + streams.path("out") + "' 2> '" + streams.path("err") + "'";
  const int status = std::system(("bash -c \"" + command + "\"").c_str());
  ProgramRun run;
  run.exit_code = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  run.out = streams.read("out");
  run.err = streams.read("err");
  return run;
}

const char* figurine_program() { return FIGURINE_PROGRAM; }

ProgramRun run_shell(const std::string& command, const TestFolder& folder) {
  const TestFolder streams;
  const int status = std::system(("cd '" + folder.path() + "' && { " + command + "; } > '" +
                                  streams.path("out") + "' 2> '" + streams.path("err") + "'")
                                     .c_str());
  return {WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status), streams.read("out"),
          streams.read("err")};
}

void write_golden_avatar(const TestFolder& folder, const std::string& name, const std::string& png,
                         Held held, const std::array<uint64_t, 2>& fixed_point_hash) {
  const SyntheticBody body = make_test_body();
  const SyntheticAvatar synthetic = make_test_avatar(body, {.held = held});
  Avatar avatar = synthetic.package->avatar();
  avatar.golden.png = {reinterpret_cast<const uint8_t*>(png.data()), png.size()};
  avatar.golden.fixed_point_hash = fixed_point_hash;
  if (held != Held::kFloat32) avatar.golden.fixed_point_library = "a library";
  const Result<std::vector<std::byte>> bytes =
      write_package(avatar, synthetic.package->budget(), synthetic.package->provenance());
  FIG_CHECK(bytes.ok(), bytes.status().message().c_str());
  write_file(folder.path(name), *bytes);
}

void write_test_packages(const TestFolder& folder) {
  const SyntheticBody body = make_test_body();
  const SyntheticBody other = make_test_body({.seed = 2});
  const SyntheticAvatar avatar = make_test_avatar(body);
  write_file(folder.path("body.fgn"), body.bytes.bytes());
  write_file(folder.path("avatar.fgn"), avatar.bytes.bytes());
  write_file(folder.path("both.fgn"), make_test_avatar(body, {.held = Held::kBoth}).bytes.bytes());
  write_file(folder.path("fixed.fgn"),
             make_test_avatar(body, {.held = Held::kFixedPoint}).bytes.bytes());
  write_file(folder.path("filtered.fgn"), make_test_avatar(body, {.filters = true}).bytes.bytes());
  write_file(folder.path("knowing.fgn"),
             make_test_avatar(body, {.known_poses = true}).bytes.bytes());
  write_file(folder.path("other_body.fgn"), other.bytes.bytes());

  const SyntheticAvatar people[] = {make_test_avatar(body, {.seed = 5, .name = "ada"}),
                                    make_test_avatar(body, {.seed = 6, .name = "bob"})};
  NewPopulation population{.name = "test people", .initial = avatar.package->avatar().network};
  for (const SyntheticAvatar& person : people) {
    population.members.push_back(
        {&person.package->avatar(), &person.package->provenance(), Split::kTrain});
  }
  const Result<std::vector<std::byte>> packed = write_population(population);
  FIG_CHECK(packed.ok(), packed.status().message().c_str());
  write_file(folder.path("people.fgn"), *packed);

  constexpr uint32_t kFrames = 12;
  std::vector<float> translations, rotations;
  for (uint32_t frame = 0; frame < kFrames; ++frame) {
    const SyntheticPose pose = make_test_pose(body.body(), frame);
    translations.insert(translations.end(),
                        {0.1f * static_cast<float>(frame), 0, 0});  // walks along x
    for (size_t j = 0; j < pose.rotations.size(); j += 4) {
      double length2 = 0;
      for (int k = 0; k < 4; ++k) length2 += double(pose.rotations[j + k]) * pose.rotations[j + k];
      for (int k = 0; k < 4; ++k)
        rotations.push_back(static_cast<float>(pose.rotations[j + k] / std::sqrt(length2)));
    }
  }
  Motion motion{.name = "test walk",
                .frames_per_second = 30,
                .joint_names = body.body().joint_names,
                .frame_count = kFrames,
                .root_translation_m = translations,
                .rotations = rotations};
  const Result<std::vector<std::byte>> bytes = write_package(motion, {.tool = "test"});
  FIG_CHECK(bytes.ok(), bytes.status().message().c_str());
  write_file(folder.path("motion.fgn"), *bytes);
}

}  // namespace figurine::tests
