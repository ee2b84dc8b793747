// Runs the built figurine the way a user does, in a folder of its own with synthetic packages in
// it.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "runtime/test_packages.h"

namespace figurine::tests {

// A fresh folder below the system's temporary one, removed with everything in it.
class TestFolder {
 public:
  TestFolder();
  ~TestFolder();
  TestFolder(const TestFolder&) = delete;
  TestFolder& operator=(const TestFolder&) = delete;
  std::string path(const std::string& name = "") const;
  void write(const std::string& name, const std::string& content) const;
  std::string read(const std::string& name) const;
  bool has(const std::string& name) const { return std::filesystem::exists(path(name)); }
  std::vector<std::string> names() const;  // of everything in it, hidden files included, sorted

 private:
  std::filesystem::path path_;
};

struct ProgramRun {
  int exit_code = -1;  // 128 + the signal if one ended it
  std::string out, err;
  size_t error_lines() const;
};

struct RunOptions {
  std::string environment;  // "NAME=value NAME=value "
  std::string before;       // shell commands in front, such as "ulimit -f 8;"
  std::string folder;       // working folder
};

// "figurine ARGUMENTS", arguments as the shell reads them.
ProgramRun run_figurine(const std::string& arguments, const RunOptions& options = {});
// The path of figurine, for what a shell does with it: pipes, jobs.
const char* figurine_program();
ProgramRun run_shell(const std::string& command, const TestFolder& folder);

// The avatar of write_test_packages with a golden picture in it, an 8-bit RGB PNG of its golden
// camera; empty: none. With a hash, that is the golden frame's in fixed point, made by "a library".
void write_golden_avatar(const TestFolder& folder, const std::string& name, const std::string& png,
                         Held held = Held::kFloat32,
                         const std::array<uint64_t, 2>& fixed_point_hash = {0, 0});

// Writes body.fgn, the avatar in float (avatar.fgn), in fixed point (fixed.fgn) and in both
// (both.fgn), motion.fgn (12 frames, 30 a second), other_body.fgn, which does not fit the avatar,
// and people.fgn, a population of "ada" and "bob".
void write_test_packages(const TestFolder& folder);

}  // namespace figurine::tests
