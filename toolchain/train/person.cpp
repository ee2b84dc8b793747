#include "toolchain/train/person.h"

#include <algorithm>

#include "toolchain/tensor_operations.h"

namespace figurine::train {

namespace {

std::vector<std::unique_ptr<AvatarModel>> make_models(const Body& body,
                                                      const dataset::Dataset& data,
                                                      const TrainSettings& settings) {
  TrainSettings of_lane = settings;
  of_lane.threads /= lane_count(settings);
  std::vector<std::unique_ptr<AvatarModel>> models;
  for (unsigned lane = 0; lane < lane_count(settings); ++lane) {
    models.push_back(std::make_unique<AvatarModel>(body, data.shape(), of_lane, settings.bf16));
    if (lane > 0) models[lane]->share_parts(*models[0]);
  }
  return models;
}

}  // namespace

unsigned lane_count(const TrainSettings& settings) {
  return std::min(settings.poses_per_iteration, settings.threads);
}

model::OptimiserOptions adamw_options(const TrainSettings& settings, double weight_decay) {
  return {.beta1 = settings.beta1,
          .beta2 = settings.beta2,
          .epsilon = settings.epsilon,
          .weight_decay = weight_decay};
}

torch::Tensor FrozenOutputs::get(size_t frame, const std::function<torch::Tensor()>& compute) {
  constexpr size_t kMostBytes = size_t{1} << 29;
  {
    const std::lock_guard lock(mutex_);
    if (const auto found = outputs_.find(frame); found != outputs_.end()) return found->second;
  }
  torch::Tensor output = compute();
  const std::lock_guard lock(mutex_);
  if (bytes_ + output.nbytes() <= kMostBytes && outputs_.emplace(frame, output).second)
    bytes_ += output.nbytes();
  return output;
}

Person::Person(const Body& body, const dataset::Dataset& data, const TrainSettings& settings,
               RunDirectory run_directory, nlohmann::json run_json)
    : run(std::move(run_directory)),
      description(std::move(run_json)),
      static_optimiser({}, {}),
      data_(data),
      models_(make_models(body, data, settings)) {
  const auto values = static_cast<uint64_t>(model().statics().values.numel());
  static_optimiser = model::Optimiser(model::adamw_group(values), adamw_options(settings, 0));
}

void Person::share_network(Person& other) {
  for (const auto& model : models_) model->unet().share_weights(other.model().unet());
}

void Person::start_feed(uint64_t first_sample) {
  feed_ = std::make_unique<SampleFeed>(data_, model(), first_sample);
}

StaticMap mean_statics(const std::vector<std::unique_ptr<Person>>& people) {
  StaticMap mean = people[0]->model().statics();
  mean.values = torch::zeros_like(mean.values);
  for (const auto& person : people) mean.values.add_(person->model().statics().values);
  mean.values.div_(static_cast<double>(people.size()));
  return mean;
}

}  // namespace figurine::train
