// People seen through a network: each has V pictures in the same poses from the same sides, as a
// MemberSet draws them.
//
// A picture goes through the network once a call, however many it is compared with; the embeddings
// of one pose and side are in memory at a time, those of all people (0.7 MB a person for
// figurine-features, 2.5 for LPIPS at 256 x 256).
//
// Letters: A people, R others whom they are compared with, V pictures of a person, F features of a
// picture.
#pragma once

#include <cstdint>
#include <vector>

#include "toolchain/features/feature_network.h"
#include "toolchain/measure/metrics.h"
#include "toolchain/measure/weight_space.h"

namespace figurine::generation {

using People = std::vector<std::vector<measure::Picture>>;  // of V pictures each

// Means over the V pairs of pictures of the same pose and side. Equal people are 0 apart; what is
// nearer than rounding counts as equal.
struct PeopleDistances {
  measure::RowMatrix to_references;  // [A,R]
  measure::RowMatrix within;         // [A,A]
};
// references: may be empty. threads: of the network. Throws InputError if the network cannot take
// the pictures, or Interrupted.
PeopleDistances measure_distances(const features::PerceptualNetwork& network, const People& people,
                                  const People& references, uint32_t threads);

// [A V, F], person by person.
measure::RowMatrix measure_features(const features::FeatureNetwork& network, const People& people,
                                    uint32_t threads);

}  // namespace figurine::generation
