// The people whom what all members share is learnt from, and the processes that do it.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "toolchain/population/recipe.h"

namespace figurine::population {

// The first `count` training identities in the order of the recipe.
std::vector<Identity> learners(const Recipe& recipe, uint32_t count);

struct RunAllOptions {
  const char* what = "";  // before a failure's message
  unsigned slots = 1;
};
// Runs job(i) for i in [0, count) in processes and throws the first failure as an InputError that
// begins with name(i); what they returned. waiting(number of those that have ended) is called
// between. Throws Interrupted.
std::vector<std::string> run_all(const RunAllOptions& options, size_t count,
                                 const std::function<std::string(size_t)>& job,
                                 const std::function<std::string(size_t)>& name,
                                 const std::function<void(size_t)>& waiting);

}  // namespace figurine::population
