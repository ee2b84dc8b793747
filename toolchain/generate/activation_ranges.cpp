#include "toolchain/generate/activation_ranges.h"

#include "toolchain/error.h"
#include "toolchain/evaluate/member_pictures.h"
#include "toolchain/train/avatar_model.h"
#include "toolchain/train/progress.h"

namespace figurine::generate {

ActivationRanges observe_training_members(const Population& population, const Package& body, uint32_t poses,
                                          const quantize::CalibrationOptions& options, bool quiet) {
  if (body.content_hash() != population.body_hash) {
    throw InputError("population '" + population.name + "': stands on body " + format_hash(population.body_hash) + ", " + body.body().name +
                     " is " + format_hash(body.content_hash()));
  }
  train::TrainSettings settings = train::preset_settings(population.preset);
  settings.fourier_octaves = population.fourier_octaves;
  train::AvatarModel model(body.body(), {}, settings, false);
  // The network sees the mean template in every pose: its input is the same for all members.
  std::vector<torch::Tensor> inputs;
  for (const train::OwnedPose& pose : evaluate::fixed_poses(population, nullptr, poses)) inputs.push_back(model.pose(pose.view()).input);

  ActivationRanges ranges{.values = {}, .members = 0, .poses = poses};
  quantize::ActivationStatistics statistics{.group = quantize::scale_groups(population.network),
                                            .histograms = std::vector<quantize::Histogram>(population.network.layers.size() + 1)};
  train::Progress progress("ranges", quiet);
  for (size_t m = 0; m < population.size(); ++m) {
    if (population.members[m].split != Split::kTrain) continue;
    progress.show(static_cast<double>(m) / static_cast<double>(population.size()), "member " + population.members[m].name);
    const evaluate::OpenedMember member(population, m);
    model.unet().import_network(member.avatar.network);
    for (const torch::Tensor& input : inputs) {
      quantize::count_values(population.network, model.unet().evaluate_values(input), statistics);
    }
    ++ranges.members;
  }
  ranges.values = quantize::choose_value_scales(population.network, statistics, options);
  return ranges;
}

}  // namespace figurine::generate
