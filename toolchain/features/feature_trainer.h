// Trains figurine-features on a population's training members: who is this, in whatever pose, from
// whatever side?
//
// Every training member is drawn in the same poses from the same cameras; a batch is a shuffled
// part of these pictures, moved and scaled a little. The loss is the cross-entropy of a softmax
// over the training members on cosines, with a margin; its class vectors are thrown away in the
// end. No blur, noise or colour is part of the augmentation: the features must not become blind to
// what a bad avatar looks like. Then every layer of the perceptual distance gets a floor of its
// norm, half the mean of what training pictures have, and one weight for all of its channels, so
// that two different training members in one pose and view are on average 1 apart, each layer with
// an equal share.
//
// Gradients are made in pieces of eight pictures, each on one thread, and added in the order of the
// pieces, and everything that is drawn is a function of (seed, iteration, place in the batch): the
// weights do not depend on the number of threads, and a resumed training goes on with the same
// bits. No member of another part is ever opened.
//
//   FEATURES.safetensors             when it is done: weights, and in its metadata where they come
//       from
//   FEATURES.safetensors.checkpoint  until then: what --resume needs
//
// Based on: Wang et al., CosFace: Large Margin Cosine Loss for Deep Face Recognition, 2018, eq. 4;
// Zhang et al., 2018.
#pragma once

#include <cstdint>
#include <string>

#include "toolchain/train/schedule.h"

namespace figurine::features {

struct FeatureSettings {
  uint32_t poses = 8;
  uint32_t views = 0;  // 0: six, or fewer where there are so many members that the pictures would
                       // not fit into memory
  uint32_t batch = 48;
  double weight_decay = 0.01;
  uint64_t seed = 1;
  train::Schedule schedule{.peak = 2e-3,
                           .ramp_iterations = 50,
                           .floor_fraction = 0.01,
                           .budget = {.iterations = 1200, .seconds = 0}};
};

struct FeatureRequest {
  std::string population, body;  // packages
  std::string motion;  // package whose poses are drawn; empty: golden poses of training members
  std::string output;  // .safetensors to write
  FeatureSettings settings;
  std::string command;  // as typed, for the metadata
  uint32_t threads = 1;
  bool resume = false;  // goes on by the checkpoint's own settings
  bool quiet = false;
  double checkpoint_period_s = 60;
  uint64_t stop_after = 0;  // interrupt before this iteration, as Ctrl-C would; 0: never (tests)
};

struct FeatureResult {
  uint64_t iteration = 0;
  double seconds = 0;   // of training; drawing the pictures not counted
  double loss = 0;      // mean over the last iterations
  double accuracy = 0;  // share of the pictures of the last iterations that were told right, with
                        // the margin against them
  uint64_t pictures = 0, members = 0;
  bool was_finished = false;
};

// Throws InputError or train::Interrupted (state saved).
FeatureResult train_features(const FeatureRequest& request);

}  // namespace figurine::features
