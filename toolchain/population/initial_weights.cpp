#include "toolchain/population/initial_weights.h"

#include <cstdio>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "ports/host/files.h"
#include "toolchain/error.h"
#include "toolchain/population/learners.h"
#include "toolchain/train/interrupt.h"
#include "toolchain/train/trainer.h"

namespace figurine::population {

namespace {

namespace fs = std::filesystem;

constexpr const char* kHistoryHead = "round,step,psnr_db,seconds\n";

std::string round_name(uint32_t round) {
  char digits[16];
  std::snprintf(digits, sizeof(digits), "%05u", round);
  return digits;
}

// One round's weights and what was logged until then, in one file each: the newest complete pair is
// where work goes on.
struct Rounds {
  std::string folder;
  std::string weights(uint32_t after) const {
    return folder + "/after_" + round_name(after) + ".safetensors";
  }
  std::string history(uint32_t after) const {
    return folder + "/after_" + round_name(after) + ".csv";
  }
  std::string run(uint32_t round, size_t k) const {
    return folder + "/run_" + round_name(round) + "_" + std::to_string(k);
  }

  uint32_t done(uint32_t rounds) const {
    for (uint32_t after = rounds; after > 0; --after) {
      if (fs::exists(weights(after)) && fs::exists(history(after))) return after;
    }
    return 0;
  }
};

std::string read_text(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

void save_text(const std::string& path, const std::string& text) {
  throw_if_error(ports::write_file_atomically(path, std::as_bytes(std::span(text))), "cannot save");
}

struct FineTuning {
  std::string data, run, init;
  uint64_t seed = 1;
};

// Leaves the weights in the run's folder; returns run.json's figures.
std::string fine_tune(const Workshop& workshop, const FineTuning& tuning) {
  const InitialWeightsRecipe& recipe = workshop.recipe.initial;
  train::TrainRequest request{
      .data = tuning.data,
      .body = workshop.state.body(),
      .run = tuning.run,
      .settings = workshop.recipe.training,
      .command = "figurine-train population, initial weights of " + workshop.recipe.name,
      .resume = fs::exists(train::RunDirectory{tuning.run}.run_json()),
      .quiet = true};
  request.settings.init = tuning.init;
  request.settings.seed = tuning.seed;
  request.settings.schedule.budget = {.iterations = recipe.iterations, .seconds = 0};
  if (recipe.standoff_weight) request.settings.standoff_weight = *recipe.standoff_weight;
  if (recipe.learning_rate > 0) request.settings.schedule.peak = recipe.learning_rate;
  train::train_avatar(request);
  // Not from its result: a run that was finished before does not know its means any more.
  const nlohmann::json run = train::read_json(train::RunDirectory{tuning.run}.run_json());
  return nlohmann::json{{"psnr_db", run.at("running").at("psnr_db")},
                        {"seconds", run.at("train_seconds")}}
      .dump();
}

void forget(const Rounds& rounds, uint32_t round, size_t per_round) {
  for (size_t k = 0; k < per_round; ++k) fs::remove_all(rounds.run(round, k));
  if (round > 0) fs::remove(rounds.weights(round)), fs::remove(rounds.history(round));
}

}  // namespace

train::TensorFile reptile_step(const train::TensorFile& weights,
                               const std::vector<train::TensorFile>& fine_tuned, double step) {
  train::TensorFile next;
  for (const auto& [name, first] : fine_tuned.at(0).tensors) {
    train::NamedTensor& out = next.tensors[name] = first;
    const auto old = weights.tensors.find(name);
    if (step < 1 && (old == weights.tensors.end() || old->second.shape != first.shape))
      throw InputError(name + ": is not in the weights");
    for (const train::TensorFile& file : fine_tuned) {
      const auto found = file.tensors.find(name);
      if (found == file.tensors.end() || found->second.shape != first.shape)
        throw InputError(name + ": fine-tuned weights differ in shape");
    }
    for (size_t i = 0; i < out.values.size(); ++i) {
      double mean = 0;
      for (const train::TensorFile& file : fine_tuned)
        mean += double{file.tensors.at(name).values[i]};
      mean /= static_cast<double>(fine_tuned.size());
      const double from = step < 1 ? double{old->second.values[i]} : 0;
      out.values[i] = static_cast<float>(step < 1 ? from + step * (mean - from) : mean);
    }
  }
  return next;
}

double reptile_step_size(const InitialWeightsRecipe& recipe, uint32_t round) {
  if (round == 0) return 1;  // from the common random weights
  const double share =
      recipe.rounds > 1 ? static_cast<double>(round) / static_cast<double>(recipe.rounds - 1) : 1;
  return recipe.first_step + share * (recipe.last_step - recipe.first_step);
}

void make_initial_weights(const Workshop& workshop, unsigned slots,
                          const std::function<void(const InitialWeightsProgress&)>& show) {
  const InitialWeightsRecipe& recipe = workshop.recipe.initial;
  const State& state = workshop.state;
  if (recipe.rounds == 0 || fs::exists(state.initial_weights())) return;
  const Rounds rounds{state.initial() + "/rounds"};
  train::make_folder(rounds.folder);
  const std::string captures = state.initial() + "/captures";
  const std::vector<Identity> people = learners(workshop.recipe, recipe.identities);
  InitialWeightsProgress at{.people = people.size(), .rounds = recipe.rounds};
  const auto count_captures = [&](size_t finished) {
    at.captured = finished;
    show(at);
  };
  run_all(
      {.what = "initial weights", .slots = slots}, people.size(),
      [&](size_t i) { return capture_identity(workshop, people[i], captures), std::string(); },
      [&](size_t i) { return people[i].name(); }, count_captures);
  at.captured = people.size();

  uint32_t round = rounds.done(recipe.rounds);
  std::string history = round > 0 ? read_text(rounds.history(round)) : kHistoryHead;
  for (; round < recipe.rounds; ++round) {
    const auto person = [&](size_t k) -> const Identity& {
      return people[(size_t{round} * recipe.per_round + k) % people.size()];
    };
    const auto job = [&](size_t k) {
      return fine_tune(workshop, {.data = captures + "/" + person(k).name(),
                                  .run = rounds.run(round, k),
                                  .init = round > 0 ? rounds.weights(round) : "",
                                  .seed = round + 1});
    };
    const std::vector<std::string> results = run_all(
        {.what = "initial weights", .slots = slots}, recipe.per_round, job,
        [&](size_t k) { return person(k).name(); },
        [&](size_t finished) {
          at.round = round, at.share = static_cast<double>(finished) / recipe.per_round;
          show(at);
        });
    std::vector<train::TensorFile> fine_tuned;
    double psnr_db = 0, seconds = 0;
    for (size_t k = 0; k < results.size(); ++k) {
      const nlohmann::json result = nlohmann::json::parse(results[k]);
      psnr_db += result.at("psnr_db").get<double>() / static_cast<double>(results.size());
      seconds += result.at("seconds").get<double>();
      fine_tuned.push_back(
          train::read_tensor_file(train::RunDirectory{rounds.run(round, k)}.weights()));
    }
    const double step = reptile_step_size(recipe, round);
    const train::TensorFile before =
        round > 0 ? train::read_tensor_file(rounds.weights(round)) : train::TensorFile{};
    train::write_tensor_file(rounds.weights(round + 1), reptile_step(before, fine_tuned, step));
    char line[96];
    std::snprintf(line, sizeof(line), "%u,%.4f,%.3f,%.2f\n", round, step, psnr_db, seconds);
    history += line;
    save_text(rounds.history(round + 1), history);
    forget(rounds, round, recipe.per_round);
    at.psnr_db = psnr_db;
  }
  save_text(state.initial() + "/history.csv", history);
  train::write_tensor_file(state.initial_weights(),
                           train::read_tensor_file(rounds.weights(recipe.rounds)));
  fs::remove_all(rounds.folder);
  fs::remove_all(captures);
}

}  // namespace figurine::population
