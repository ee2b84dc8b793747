// A run as an avatar package: network, static part, decoding, shape, how unusual a pose is, where
// it all came from, and a golden frame to test a device against.
#pragma once

#include <string>
#include <vector>

#include "figurine/package.h"
#include "toolchain/train/owned_pose.h"
#include "toolchain/train/trained_avatar.h"

namespace figurine::train {

struct PackOptions {
  std::string name;                // empty: the data folder's name
  bool golden = true;              // an expected picture of the float weights
  bool network = true;             // false: the static part alone, a member of a population of one
                                   // network (pack_population.h). Without a picture, then
  uint64_t peak_memory_bytes = 0;  // what the runtime needs for one instance; 0: not known yet
  bool float_weights = true;       // may be left out if there is fixed_point
  FixedPointNetwork fixed_point;   // borrowed; empty: none
  std::array<uint64_t, 2> fixed_point_hash{0, 0};  // of the golden frame; zero: not known yet
  std::string fixed_point_library;                 // that it was made with
  std::vector<KeyValue> settings;                  // behind the run's own in the provenance
  // Licence and consent. Empty fields are filled in for captures of figurine's own (synthetic
  // persons): CC0-1.0, everyone, corporation, "synthetic". For anybody else licence_name and
  // depicted_person have to be given.
  std::string licence_name, licence_url;
  std::string avatar_permission, commercial_usage, depicted_person;
  std::vector<std::string> authors;
};

// The pose and the camera of the golden frame: of the poses of the held-out block (the middle one
// of all if nothing is held out) and the cameras of whole bodies, those two that face each other
// most nearly, so that whoever opens a package sees a face; at 256 pixels or less a side.
struct GoldenView {
  OwnedPose pose;
  Camera camera;
};
GoldenView choose_golden_view(const TrainedAvatar& avatar);

// The package's bytes; the golden picture is of the static part as the package holds it. Throws
// InputError: a run with frozen pose (a device always poses) or static colours as a sum, missing
// consent, no weights, a network left out that the run has changed.
std::vector<std::byte> pack_avatar(TrainedAvatar& avatar, const RunDirectory& run,
                                   const PackOptions& options);

}  // namespace figurine::train
