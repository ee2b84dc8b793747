// A population of seven, small enough to be learnt in a test, and the body that it stands on.
#pragma once

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "formats/writer/population_writer.h"
#include "ports/host/files.h"
#include "runtime/test_packages.h"

namespace figurine::tests {

// Five members train, one validates, one tests; `bend_test` changes the weights of the last.
inline void write_people(const std::string& path, bool bend_test = false) {
  const SyntheticBody body = make_test_body();
  const SyntheticAvatar initial = make_test_avatar(body, {.seed = 99});
  std::vector<SyntheticAvatar> avatars;
  for (size_t m = 0; m < 7; ++m) {
    const uint64_t seed = m == 6 && bend_test ? 1000 : m;
    avatars.push_back(make_test_avatar(body, {.shape = {0.1f * static_cast<float>(m), 0.2f},
                                              .seed = seed,
                                              .name = "person" + std::to_string(m)}));
  }
  NewPopulation population{.name = "people", .initial = initial.package->avatar().network};
  for (size_t m = 0; m < avatars.size(); ++m) {
    const Split split = m < 5 ? Split::kTrain : m == 5 ? Split::kValidation : Split::kTest;
    population.members.push_back(
        {&avatars[m].package->avatar(), &avatars[m].package->provenance(), split});
  }
  const auto bytes = write_population(population);
  ASSERT_TRUE(bytes.ok()) << bytes.status().message();
  ASSERT_TRUE(ports::write_file_atomically(path, *bytes).ok());
}

}  // namespace figurine::tests
