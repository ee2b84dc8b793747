// One network for all members of a population, learnt with the first training people together: they
// take turns, each with a static map of its own (toolchain/train/trainer.h, more_data). What stays
// is the network, and the mean of their maps, where members begin.
#pragma once

#include <functional>

#include "toolchain/population/member.h"

namespace figurine::population {

struct SharedNetworkProgress {
  size_t captured = 0, people = 0;  // first come the captures, then the training
  double share = 0;                 // of the training
};

// Makes state.shared() and state.initial_weights(), or goes on with them; nothing to do if they are
// there. `slots` processes capture; the training has as many threads as it has poses an iteration,
// at most `slots`, which its result does not depend on. Throws InputError naming the identity, or
// Interrupted.
void make_shared_network(const Workshop& workshop, unsigned slots,
                         const std::function<void(const SharedNetworkProgress&)>& show);

}  // namespace figurine::population
