#include "toolchain/population/shared_network.h"

#include <algorithm>
#include <filesystem>

#include "ports/host/files.h"
#include "toolchain/error.h"
#include "toolchain/population/learners.h"
#include "toolchain/train/avatar_model.h"
#include "toolchain/train/pack_avatar.h"
#include "toolchain/train/tensor_file.h"
#include "toolchain/train/trainer.h"

namespace figurine::population {

namespace {

namespace fs = std::filesystem;

// By its log, which is written with every checkpoint.
uint64_t iterations_done(const train::RunDirectory& run) {
  if (!fs::exists(run.log())) return 0;
  const std::vector<train::LogRow> rows = train::load_log(run, UINT64_MAX);
  return rows.empty() ? 0 : rows.back().iteration;
}

// The whole training, in a process of its own: LibTorch starts threads.
void train_together(const Workshop& workshop, const std::vector<std::string>& captures,
                    const std::string& run, unsigned slots) {
  const SharedNetworkRecipe& recipe = workshop.recipe.shared;
  train::TrainRequest request{
      .data = captures.front(),
      .more_data = {captures.begin() + 1, captures.end()},
      .body = workshop.state.body(),
      .run = run,
      .settings = workshop.recipe.training,
      .command = "figurine-train population, shared network of " + workshop.recipe.name,
      .resume = fs::exists(train::RunDirectory{run}.run_json()),
      .quiet = true};
  request.settings.poses_per_iteration = recipe.poses;
  request.settings.threads = std::min(recipe.poses, slots);
  request.settings.schedule.budget = {.iterations = recipe.iterations, .seconds = 0};
  if (recipe.learning_rate > 0) request.settings.schedule.peak = recipe.learning_rate;
  train::train_avatar(request);
  // The first learner with everybody's mean map in place of its own.
  const std::string first = run + "/" + fs::path(captures.front()).filename().string();
  train::TrainedAvatar mean =
      train::TrainedAvatar::open({.run = first, .data = {}, .body = {}, .threads = 1});
  train::load_initial_weights(run, mean.model().parts());
  const std::vector<std::byte> package =
      train::pack_avatar(mean, {first}, {.name = "shared", .golden = false});
  throw_if_error(ports::write_file_atomically(workshop.state.shared(), package), "cannot save");
  train::write_tensor_file(workshop.state.initial_weights(),
                           train::read_tensor_file(train::RunDirectory{run}.weights()));
}

}  // namespace

void make_shared_network(const Workshop& workshop, unsigned slots,
                         const std::function<void(const SharedNetworkProgress&)>& show) {
  const SharedNetworkRecipe& recipe = workshop.recipe.shared;
  const State& state = workshop.state;
  if (recipe.identities == 0 || fs::exists(state.initial_weights())) return;
  // Where members look for theirs: these people become members too.
  const std::string captures = state.captures(), run = state.initial() + "/run";
  const std::vector<Identity> people = learners(workshop.recipe, recipe.identities);
  SharedNetworkProgress at{.people = people.size()};
  run_all(
      {.what = "shared network", .slots = slots}, people.size(),
      [&](size_t i) { return capture_identity(workshop, people[i], captures), std::string(); },
      [&](size_t i) { return people[i].name(); },
      [&](size_t finished) {
        at.captured = finished;
        show(at);
      });
  at.captured = people.size();
  std::vector<std::string> folders;
  for (const Identity& person : people) folders.push_back(captures + "/" + person.name());
  run_all(
      {.what = "shared network", .slots = 1}, 1,
      [&](size_t) { return train_together(workshop, folders, run, slots), std::string(); },
      [&](size_t) { return workshop.recipe.name; },
      [&](size_t) {
        at.share =
            static_cast<double>(iterations_done({run})) / static_cast<double>(recipe.iterations);
        show(at);
      });
  fs::remove_all(run);
}

}  // namespace figurine::population
