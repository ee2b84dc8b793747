#include "toolchain/population/learners.h"

#include "toolchain/error.h"
#include "toolchain/train/slots.h"

namespace figurine::population {

std::vector<Identity> learners(const Recipe& recipe, uint32_t count) {
  std::vector<Identity> chosen;
  for (const Identity& identity : identities_of(recipe)) {
    if (identity.split == Split::kTrain && chosen.size() < count) chosen.push_back(identity);
  }
  return chosen;
}

std::vector<std::string> run_all(const RunAllOptions& options, size_t count,
                                 const std::function<std::string(size_t)>& job,
                                 const std::function<std::string(size_t)>& name,
                                 const std::function<void(size_t)>& waiting) {
  std::vector<std::string> results(count);
  std::string failure;
  size_t finished = 0;
  const auto ended = [&](size_t i, const train::JobResult& result) {
    ++finished;
    if (result.done) results[i] = result.text;
    if (!result.done && !result.interrupted && failure.empty())
      failure = name(i) + ": " + result.text;
  };
  train::run_in_slots(count, {.slots = options.slots}, job, ended, [&] { waiting(finished); });
  if (!failure.empty()) throw InputError(options.what + (": " + failure));
  return results;
}

}  // namespace figurine::population
