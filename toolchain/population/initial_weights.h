// The weights that all members of a population start from, learnt over some training identities, so
// that a member is soon what it can be and all members stay near each other.
//
// Reptile: every round fine-tunes a few identities from the present weights, side by side, and
// moves the weights a part of the way to the mean of what came out:  w <- w + step_r (mean_k w_k -
// w), step_r falling linearly. Identities take turns. The first round starts from the common random
// weights and takes the whole step.
//
// Based on: Nichol, Achiam, Schulman, On First-Order Meta-Learning Algorithms, 2018 (the rule, its
// batched form); Tancik et al., Learned Initializations for Optimizing Coordinate-Based Neural
// Representations, 2021 (that it pays for networks that are signals).
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "toolchain/population/member.h"
#include "toolchain/train/tensor_file.h"

namespace figurine::population {

// w + step (mean of fine_tuned - w), tensor by tensor, summed in double. weights may be empty if
// step is 1. InputError if tensors differ in name or shape.
train::TensorFile reptile_step(const train::TensorFile& weights,
                               const std::vector<train::TensorFile>& fine_tuned, double step);

double reptile_step_size(const InitialWeightsRecipe& recipe, uint32_t round);

struct InitialWeightsProgress {
  size_t captured = 0, people = 0;  // first come the captures, then the rounds
  uint32_t round = 0, rounds = 0;
  double share = 0;    // of the round
  double psnr_db = 0;  // training PSNR at the end of the last round's fine-tunings
};

// Makes state.initial_weights(), or goes on with it; nothing to do if it is there or the recipe has
// no rounds. `slots` processes of one thread at a time. Throws InputError naming the identity, or
// Interrupted.
void make_initial_weights(const Workshop& workshop, unsigned slots,
                          const std::function<void(const InitialWeightsProgress&)>& show);

}  // namespace figurine::population
