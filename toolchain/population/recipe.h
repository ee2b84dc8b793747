// The recipe of a population: everything that decides its members, in one JSON file that is
// committed (docs/population.md). The same recipe on the same kind of CPU gives the same weights to
// the bit.
#pragma once

#include <array>
#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "formats/writer/population_writer.h"
#include "toolchain/body/atlas.h"
#include "toolchain/capture/camera_rings.h"
#include "toolchain/capture/wardrobe.h"
#include "toolchain/train/settings.h"

namespace figurine::population {

// A piece of a clip. clip: a path, or a file name that is looked for among CMU's clips and the
// emotes (find_clip).
struct MotionPiece {
  std::string name, clip;
  std::optional<uint32_t> start, frames;
  std::string neutral;  // as --neutral of the motion commands: which of its poses is a T-pose;
                        // empty: told by the clip
};

// Consecutive identities of one part of the split that choose from the same wardrobe.
struct IdentityGroup {
  Split split = Split::kTrain;
  uint32_t first = 0, count = 0;
  capture::WardrobeLimits limits;
};

// How the weights that all members start from are learnt (initial_weights.h).
struct InitialWeightsRecipe {
  uint32_t identities = 0;               // the first ones of the training part
  uint32_t rounds = 0;                   // 0: the common random weights are the initial ones
  uint32_t per_round = 2;                // identities fine-tuned in a round, side by side
  uint64_t iterations = 0;               // of a fine-tuning
  double first_step = 0, last_step = 0;  // how far the weights move towards the fine-tuned ones,
                                         // falling linearly over the rounds
  double learning_rate = 0;              // of a fine-tuning; training's if 0
  std::optional<float> standoff_weight;  // of a fine-tuning; training's if not given
};

// One network for all members, learnt together with the first identities of the training part, who
// take turns (shared_network.h). Members then learn a static map alone, from the learners' mean.
struct SharedNetworkRecipe {
  uint32_t identities = 0;   // 0: none, every member has a network of its own
  uint64_t iterations = 0;   // of all of them together
  uint32_t poses = 1;        // an iteration, of one of them
  double learning_rate = 0;  // training's if 0
};

struct Recipe {
  std::string name;
  bool mannequin = false;  // the procedural body instead of MakeHuman's: needs no data
  // Texels a square metre by part of the body (toolchain/body/atlas.h); none: the mesh's own
  // layout.
  std::optional<std::array<double, body::kBodyPartCount>> atlas_weight;
  uint64_t seed = 1;  // of the people; identity k depends on (seed, k) alone
  std::vector<MotionPiece> motions;
  uint32_t frames = 0;  // of a capture
  capture::CameraRingsOptions cameras;
  std::vector<IdentityGroup> groups;
  InitialWeightsRecipe initial;  // or
  SharedNetworkRecipe shared;
  train::TrainSettings
      training;  // preset included; .init is the place of the initial weights once they are there
  uint32_t levels = kMostLevels;  // of the package's differences (population_writer.h); the members
                                  // do not depend on it
  std::vector<uint32_t> frozen;   // identities that are trained a second time with the body pose
                                  // frozen, for comparison
  std::vector<uint32_t> scratch;  // identities that are trained a second time from the common
                                  // random weights, for comparison
  std::vector<uint32_t> rounded;  // identities whose loss by the package's rounding is measured
  uint32_t view_frame_step =
      4;  // evaluation looks at every n-th training pose from held-out cameras
};

struct Identity {
  uint32_t number = 0;
  Split split = Split::kTrain;
  const IdentityGroup* group = nullptr;
  std::string name() const;  // "000012"
};

// Throws InputError "FILE: FIELD: reason"; unknown fields are errors, for they are misspelt ones.
Recipe read_recipe(const std::string& path);

// All identities in the order of their groups. Borrows the recipe.
std::vector<Identity> identities_of(const Recipe& recipe);

// {"train": [NAME...], "validation": [...], "test": [...], "only_test": {"outfits": [...], "skins":
// [...]}}: the form that pack --population --split reads.
nlohmann::json split_of(const Recipe& recipe);

// Looks beside the recipe, in Debian's assimp-testmodels and in $FIGURINE_EMOTES. InputError naming
// all of them.
std::string find_clip(const std::string& clip, const std::string& recipe_path);

}  // namespace figurine::population
