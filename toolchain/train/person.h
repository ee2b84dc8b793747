// One person of a training: the capture, the models that look at it, and what no other person's
// pictures change, which is the static part. The network may be everybody's.
#pragma once

#include <functional>
#include <memory>
#include <mutex>
#include <nlohmann/json.hpp>
#include <unordered_map>
#include <vector>

#include "toolchain/model/optimiser.h"
#include "toolchain/train/avatar_model.h"
#include "toolchain/train/run_directory.h"
#include "toolchain/train/sample_feed.h"

namespace figurine::train {

// Poses side by side, each on threads of its own. Never more lanes than threads: poses beyond them
// wait for their turn.
unsigned lane_count(const TrainSettings& settings);

model::OptimiserOptions adamw_options(const TrainSettings& settings, double weight_decay);

// A network that stays says the same of a pose every time: what it said, kept by the pose's frame,
// up to half a gigabyte. May be called from several threads.
class FrozenOutputs {
 public:
  torch::Tensor get(size_t frame, const std::function<torch::Tensor()>& compute);

 private:
  std::mutex mutex_;
  std::unordered_map<size_t, torch::Tensor> outputs_;
  size_t bytes_ = 0;
};

class Person {
 public:
  // body and data are borrowed. settings: the run's. run: what evaluation and packing open.
  Person(const Body& body, const dataset::Dataset& data, const TrainSettings& settings,
         RunDirectory run, nlohmann::json description);

  // From now on the network is the other person's, in the same memory.
  void share_network(Person& other);

  const dataset::Dataset& data() const { return data_; }
  // A lane's renderer has that lane's share of the threads; the parts are the same for all.
  AvatarModel& model(unsigned lane = 0) { return *models_[lane]; }
  const AvatarModel& model() const { return *models_[0]; }

  // Samples begin at this one. Before next_sample().
  void start_feed(uint64_t first_sample);
  Sample next_sample() { return feed_->next(); }

  RunDirectory run;
  nlohmann::json description;  // its run.json
  model::Optimiser static_optimiser;
  torch::Tensor reference;  // of the warm-up; undefined without one
  FrozenOutputs outputs;    // of a network that nothing learns of

 private:
  const dataset::Dataset& data_;
  std::vector<std::unique_ptr<AvatarModel>> models_;  // [lanes]
  std::unique_ptr<SampleFeed> feed_;
};

// [P] the mean of everybody's static values: where a further person may start.
StaticMap mean_statics(const std::vector<std::unique_ptr<Person>>& people);

}  // namespace figurine::train
