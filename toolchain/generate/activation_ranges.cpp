#include "toolchain/generate/activation_ranges.h"

#include "figurine/pose.h"
#include "toolchain/error.h"
#include "toolchain/model/unet.h"
#include "toolchain/tensor_operations.h"
#include "toolchain/train/grid_body.h"
#include "toolchain/train/opened_member.h"
#include "toolchain/train/progress.h"

namespace figurine::generate {

namespace {

// [T,T,Cin] standardised maps, Fourier channels behind them. All members share how their maps are
// standardised.
torch::Tensor network_input(const Population& population, const Body& body, const PoseView& pose) {
  const uint32_t size = population.network.input_size, channels = population.network.input_channels;
  const train::GridBody grid(body, size);
  torch::Tensor input = torch::zeros({size, size, channels});
  const std::span<float> values{input.data_ptr<float>(), static_cast<size_t>(input.numel())};
  if (population.fourier_octaves > 0)
    draw_fourier_channels(size, population.fourier_octaves, kMapChannels, channels, values);
  std::vector<Affine> world_from_rest(body.joint_count());
  draw_pose_maps(grid.view(), pose, population.members.front().map_statistics, world_from_rest,
                 channels, values);
  return input;
}

}  // namespace

ActivationRanges observe_training_members(const Population& population, const Package& body,
                                          uint32_t poses,
                                          const quantize::CalibrationOptions& options, bool quiet) {
  if (body.content_hash() != population.body_hash) {
    throw InputError("population '" + population.name + "': stands on body " +
                     format_hash(population.body_hash) + ", " + body.body().name + " is " +
                     format_hash(body.content_hash()));
  }
  // The network sees the mean template in every pose: its input is the same for all members.
  model::PoseUNet unet(population.network, {.precision = model::Precision::kFloat32});
  std::vector<torch::Tensor> inputs;
  for (const train::OwnedPose& pose : train::fixed_poses(population, nullptr, poses)) {
    inputs.push_back(network_input(population, body.body(), pose.view()));
  }

  ActivationRanges ranges{.values = {}, .members = 0, .poses = poses};
  quantize::ActivationStatistics statistics{
      .group = quantize::scale_groups(population.network),
      .histograms = std::vector<quantize::Histogram>(population.network.layers.size() + 1)};
  train::Progress progress("ranges", quiet);
  for (size_t m = 0; m < population.size(); ++m) {
    if (population.members[m].split != Split::kTrain) continue;
    if (ranges.members > 0 && population.coding == DifferenceCoding::kNone) break;  // all alike
    progress.show(static_cast<double>(m) / static_cast<double>(population.size()),
                  "member " + population.members[m].name);
    const train::OpenedMember member(population, m);
    unet.import_network(member.avatar.network);
    for (const torch::Tensor& input : inputs) {
      quantize::count_values(population.network, unet.evaluate_values(input), statistics);
    }
    ++ranges.members;
  }
  ranges.values = quantize::choose_value_scales(population.network, statistics, options);
  return ranges;
}

}  // namespace figurine::generate
