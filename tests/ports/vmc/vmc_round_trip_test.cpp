// The shipped motions, sent by VMC and read again, on the shipped body.
#include "ports/vmc/vmc_round_trip.h"

#include <gtest/gtest.h>

#include "figurine/package.h"
#include "ports/host/files.h"

namespace figurine::ports::vmc_round_trip_test {
namespace {

struct Loaded {
  MappedFile file;
  Package package;
  explicit Loaded(const std::string& name)
      : file(std::move(MappedFile::open(FIGURINE_SOURCE_DIR "/samples/packages/" + name)).value()),
        package(std::move(Package::open(file.bytes(), name)).value()) {}
};

TEST(VmcRoundTrip, MotionsComeBackWithinHalfADegree) {
  const Loaded body("body-128.fgn");
  for (const char* name : {"walk.fgn", "dance.fgn"}) {
    const Loaded motion(name);
    for (const size_t datagram_bytes : {size_t{0}, size_t{1400}}) {
      const tests::RoundTrip trip =
          tests::measure_round_trip(body.package.body(), motion.package.motion(), datagram_bytes);
      std::printf("%s: %g degrees at %s, root %g m\n", name, trip.worst_deg,
                  trip.worst_joint.c_str(), trip.worst_root_m);
      // Floats of the wire, products of up to ten rotations: 1e-5 degrees.
      EXPECT_LE(trip.worst_deg, 1e-4);
      EXPECT_LE(trip.worst_root_m, 1e-5);
      EXPECT_EQ(trip.malformed + trip.dropped, 0u);
    }
  }
}

// In VRM's T-pose palms look down: knuckles lie from front to back, thumbs forward.
TEST(VmcRoundTrip, TheShippedBodysPalmsLookDown) {
  const Loaded package("body-128.fgn");
  const Body& body = package.package.body();
  const HumanoidRig rig =
      std::move(HumanoidRig::create(body.joint_names, body.mean_skeleton())).value();
  std::vector<float> rotations(4 * rig.joint_count());
  std::array<float, 3> root{};
  rig.to_body(HumanoidPose(), rotations, root);
  std::vector<Affine> world(rig.joint_count());
  skinning_transforms(body.mean_skeleton(), {root, rotations}, world);
  const auto at = [&](const std::string& name) {
    const auto j =
        static_cast<size_t>(std::find(body.joint_names.begin(), body.joint_names.end(), name) -
                            body.joint_names.begin());
    const auto p = transform_point(world[j], &body.joint_position_m[3 * j]);
    return glm::dvec3(p[0], p[1], p[2]);
  };
  for (const char* side : {"left_", "right_"}) {
    const glm::dvec3 knuckles = at(std::string(side) + "index1") - at(std::string(side) + "pinky1");
    const double tilt_deg = std::atan2(knuckles.y, knuckles.z) * 180 / 3.14159265358979323846;
    std::printf("%sknuckles rise by %g degrees to the front\n", side, tilt_deg);
    EXPECT_LT(std::abs(tilt_deg), 5);  // no twist of the forearm is needed
  }
}

}  // namespace
}  // namespace figurine::ports::vmc_round_trip_test
