// A population of seven on a cylinder whose joints are called like a person's: five train, one
// validates, one tests. What differs between them is for the test to say.
#pragma once

#include <deque>
#include <memory>
#include <string>
#include <vector>

#include "formats/writer/population_writer.h"
#include "runtime/test_packages.h"

namespace figurine::tests {

struct SmallMembersOptions {
  bool own_networks = true;  // otherwise one for all
  bool maps = true;          // they have static values
  bool own_maps = true;      // otherwise alike
  bool own_shapes = true;
  std::vector<std::string> joint_names = kPersonJoints;
};

struct SmallMembers {
  static constexpr size_t kMembers = 7, kTraining = 5;
  SyntheticBody body;
  AlignedBytes bytes;
  std::unique_ptr<Package> package;

  explicit SmallMembers(const SmallMembersOptions& options)
      : body(make_test_body({.joint_names = options.joint_names})) {
    const auto make = [&](uint64_t seed) {
      return make_test_avatar(body, {.seed = seed, .network_step = 2, .static_part = options.maps});
    };
    const SyntheticAvatar common = make(99);
    std::deque<SyntheticAvatar> own;
    std::deque<std::vector<float>> shapes;
    std::vector<Avatar> avatars;
    for (size_t m = 0; m < kMembers; ++m) {
      own.push_back(make(m));
      Avatar& avatar = avatars.emplace_back(common.package->avatar());
      avatar.name = "person" + std::to_string(m);
      if (options.own_networks) avatar.network = own.back().package->avatar().network;
      if (options.own_maps) avatar.static_part = own.back().package->avatar().static_part;
      shapes.push_back({0.1f * static_cast<float>(m), 0.2f - 0.03f * static_cast<float>(m * m)});
      if (options.own_shapes) avatar.shape = shapes.back();
    }
    NewPopulation population{.name = "people", .initial = common.package->avatar().network};
    if (!options.own_networks) {
      population.shared = &common.package->avatar();
      population.coding = DifferenceCoding::kNone;
    }
    for (size_t m = 0; m < kMembers; ++m) {
      const Split split = m < kTraining    ? Split::kTrain
                          : m == kTraining ? Split::kValidation
                                           : Split::kTest;
      population.members.push_back({&avatars[m], &common.package->provenance(), split});
    }
    const auto written = write_population(population);
    FIG_CHECK(written.ok(), written.status().message().c_str());
    bytes = AlignedBytes(*written);
    auto opened = Package::open(bytes.bytes(), "people");
    FIG_CHECK(opened.ok(), opened.status().message().c_str());
    package = std::make_unique<Package>(std::move(opened).value());
  }
};

}  // namespace figurine::tests
