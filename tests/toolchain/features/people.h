// Small synthetic populations on disk.
#pragma once

#include <string>
#include <vector>

#include "formats/writer/population_writer.h"
#include "gtest/gtest.h"
#include "ports/host/files.h"
#include "runtime/test_packages.h"
#include "toolchain/error.h"
#include "toolchain/temporary_folder.h"

namespace figurine::features::test {

using testing_tools::TemporaryFolder;

// How many members of every part, and from where on their weights are others.
struct PeopleOptions {
  size_t training = 5, validation = 1, test = 1;
  size_t other_from = 1000;
};

inline void write_bytes(const std::string& path, std::span<const std::byte> bytes) {
  ASSERT_TRUE(ports::write_file_atomically(path, bytes).ok()) << path;
}

inline void write_people(const std::string& path, const PeopleOptions& options = {}) {
  const tests::SyntheticBody body = tests::make_test_body();
  const tests::SyntheticAvatar initial = tests::make_test_avatar(body, {.seed = 99});
  const size_t count = options.training + options.validation + options.test;
  std::vector<tests::SyntheticAvatar> avatars;
  for (size_t m = 0; m < count; ++m) {
    const uint64_t seed = m < options.other_from ? m : 1000 + m;
    avatars.push_back(tests::make_test_avatar(body, {.shape = {0.1f * static_cast<float>(m), 0.2f},
                                                     .seed = seed,
                                                     .name = "person" + std::to_string(m)}));
  }
  NewPopulation population{.name = "people", .initial = initial.package->avatar().network};
  for (size_t m = 0; m < count; ++m) {
    const Split split = m < options.training                        ? Split::kTrain
                        : m < options.training + options.validation ? Split::kValidation
                                                                    : Split::kTest;
    population.members.push_back(
        {&avatars[m].package->avatar(), &avatars[m].package->provenance(), split});
  }
  const auto bytes = write_population(population);
  ASSERT_TRUE(bytes.ok()) << bytes.status().message();
  write_bytes(path, *bytes);
}

inline void write_body(const std::string& path, uint64_t seed = 1) {
  const tests::SyntheticBody body = tests::make_test_body({.seed = seed});
  write_bytes(path, body.bytes.bytes());
}

// The message of the InputError that f throws; "none" if it throws none.
template <class F>
std::string input_error(F&& f) {
  try {
    f();
  } catch (const InputError& error) {
    return error.what();
  }
  return "none";
}

inline bool is_one_line(const std::string& message) {
  return message.find('\n') == std::string::npos;
}

}  // namespace figurine::features::test
