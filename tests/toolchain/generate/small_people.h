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

// The same, of one network at half the texels' side, each with a map of its own: the mean of two
// whose shares say where a person lies.
inline void write_people_of_one_network(const std::string& path) {
  const SyntheticBody body = make_test_body();
  const auto make = [&](uint64_t seed) {
    return make_test_avatar(body, {.seed = seed, .network_step = 2, .static_part = true});
  };
  const SyntheticAvatar shared = make(99), one = make(1), two = make(2);
  const std::vector<StaticGroup>& groups = shared.package->avatar().static_part.groups;
  std::vector<Avatar> avatars(7, shared.package->avatar());
  std::vector<std::vector<std::vector<int8_t>>> values(7);  // [people][groups]
  std::vector<std::vector<float>> shapes;
  for (size_t m = 0; m < 7; ++m) {
    for (size_t g = 0; g < groups.size(); ++g) {
      std::vector<int8_t>& own = values[m].emplace_back(groups[g].values.size());
      const std::span<const int8_t> a = one.package->avatar().static_part.groups[g].values,
                                    b = two.package->avatar().static_part.groups[g].values;
      for (size_t i = 0; i < own.size(); ++i)
        own[i] = static_cast<int8_t>((a[i] * int(m) + b[i] * (6 - int(m))) / 8 + int(i * m) % 3);
    }
    shapes.push_back({0.1f * static_cast<float>(m), 0.2f});
  }
  NewPopulation population{.name = "people",
                           .initial = shared.package->avatar().network,
                           .shared = &shared.package->avatar(),
                           .coding = DifferenceCoding::kNone};
  for (size_t m = 0; m < 7; ++m) {
    avatars[m].name = "person" + std::to_string(m);
    avatars[m].shape = shapes[m];
    for (size_t g = 0; g < groups.size(); ++g)
      avatars[m].static_part.groups[g].values = values[m][g];
    const Split split = m < 5 ? Split::kTrain : m == 5 ? Split::kValidation : Split::kTest;
    population.members.push_back({&avatars[m], &shared.package->provenance(), split});
  }
  const auto bytes = write_population(population);
  ASSERT_TRUE(bytes.ok()) << bytes.status().message();
  ASSERT_TRUE(ports::write_file_atomically(path, *bytes).ok());
}

}  // namespace figurine::tests
