#include "runtime/src/pose/avatar_network.h"

#include <algorithm>
#include <new>
#include <string>
#include <utility>
#include <vector>

#include "figurine/gaussian.h"
#include "runtime/src/nn/fixed_point_runner.h"
#include "runtime/src/nn/network_runner.h"

namespace figurine {
namespace {

static_assert(FixedPointRunner::kWantedGroup == kernels::kLanes);

Status corrupt(const std::string& what) { return Status(StatusCode::kCorrupt, "avatar: " + what); }

Status check_fits(const Avatar& avatar, const BodyGrid& grid,
                  const std::vector<ValueShape>& shapes) {
  if (shapes.front().size != grid.size() || shapes.back().size != grid.size()) {
    return corrupt("the network maps " + std::to_string(shapes.front().size) +
                   " texels a side to " + std::to_string(shapes.back().size) +
                   ", its grid over the body has " + std::to_string(grid.size()));
  }
  if (avatar.fourier_octaves > 16 ||
      shapes.front().channels != kMapChannels + 4 * avatar.fourier_octaves) {
    return corrupt("the network reads " + std::to_string(shapes.front().channels) +
                   " channels, the maps have 6 + 4 x " + std::to_string(avatar.fourier_octaves));
  }
  if (avatar.decoding.sh_degree > kMaxShDegree ||
      shapes.back().channels != head_channels(avatar.decoding.sh_degree)) {
    return corrupt("the network writes " + std::to_string(shapes.back().channels) +
                   " channels, which is not the head of SH degree " +
                   std::to_string(avatar.decoding.sh_degree));
  }
  return {};
}

Status check_holds(const Avatar& avatar, Precision precision) {
  if (avatar.holds(precision)) return {};
  const std::string held = avatar.holds(Precision::kFixedPoint) ? "q8" : "f32";
  return Status(StatusCode::kUnsupported, "avatar '" + avatar.name + "': its network is there in " +
                                              held + " alone, not in " + to_string(precision) +
                                              "; `figurine-train pack --precision " +
                                              to_string(precision) +
                                              "` makes a package that has it");
}

// Dense: XNNPACK evaluates every cell.
class FloatAvatarNetwork : public AvatarNetwork {
 public:
  static Result<std::unique_ptr<AvatarNetwork>> create(const Avatar& avatar, const BodyGrid& grid,
                                                       uint32_t input_channels, ThreadPool& pool) {
    Result<std::unique_ptr<NetworkRunner>> runner = NetworkRunner::create(avatar.network, pool);
    if (!runner.ok()) return runner.status();
    draw_fourier_channels(grid.size(), avatar.fourier_octaves, kMapChannels, input_channels,
                          (*runner)->input());
    std::unique_ptr<AvatarNetwork> network(new (std::nothrow) FloatAvatarNetwork(
        std::move(runner).value(), grid, input_channels, head_channels(avatar.decoding.sh_degree)));
    if (network == nullptr) return out_of_memory("an avatar's network");
    return network;
  }

  MapTarget input() override { return {runner_->input().data(), input_channels_}; }
  Status run(std::span<const uint32_t>) override { return runner_->run(); }
  void run_further(std::span<const uint32_t>) override {}
  Status run_all() override { return runner_->run(); }
  std::span<const float> outputs() const override { return std::as_const(*runner_).output(); }
  void find_heads(const float* outputs, const uint32_t (&rows)[kernels::kLanes],
                  const float* (&heads)[kernels::kLanes]) const override {
    const std::span<const uint32_t> cell = grid_.cell();
    for (uint32_t lane = 0; lane < kernels::kLanes; ++lane)
      heads[lane] = outputs + size_t{cell[rows[lane]]} * head_channels_;
  }
  uint64_t macs() const override { return runner_->macs(); }
  uint64_t memory_bytes() const override { return runner_->memory_bytes(); }

 private:
  FloatAvatarNetwork(std::unique_ptr<NetworkRunner> runner, const BodyGrid& grid,
                     uint32_t input_channels, uint32_t head_channels)
      : runner_(std::move(runner)),
        grid_(grid),
        input_channels_(input_channels),
        head_channels_(head_channels) {}

  std::unique_ptr<NetworkRunner> runner_;
  const BodyGrid& grid_;
  uint32_t input_channels_, head_channels_;
};

// The Fourier channels are constants to the runner, and its head is evaluated where it is wanted.
class FixedPointAvatarNetwork : public AvatarNetwork {
 public:
  static Result<std::unique_ptr<AvatarNetwork>> create(const Avatar& avatar, const BodyGrid& grid,
                                                       ThreadPool& pool,
                                                       const KernelTable& kernels) {
    const uint32_t fourier_channels = 4 * avatar.fourier_octaves;
    const size_t constants = size_t{grid.size()} * grid.size() * fourier_channels,
                 cells = grid.cell().size() + grid.border_cell().size();
    Buffer<float> fourier;
    Buffer<uint32_t> drawn;
    if (!fourier.ensure(constants) || !drawn.ensure(cells))
      return out_of_memory("an avatar's network");
    draw_fourier_channels(grid.size(), avatar.fourier_octaves, 0, fourier_channels,
                          fourier.span(constants));
    std::ranges::copy(grid.border_cell(), std::ranges::copy(grid.cell(), drawn.data()).out);
    Result<std::unique_ptr<FixedPointRunner>> runner =
        FixedPointRunner::create(avatar.network, avatar.fixed_point,
                                 {.varying_channels = kMapChannels,
                                  .constants = fourier.span(constants),
                                  .drawn = drawn.span(cells),
                                  .wanted = grid.cell()},
                                 pool, kernels);
    if (!runner.ok()) return runner.status();
    std::unique_ptr<FixedPointAvatarNetwork> network(new (std::nothrow) FixedPointAvatarNetwork(
        std::move(runner).value(), grid, head_channels(avatar.decoding.sh_degree)));
    if (network == nullptr || !network->evaluated_.ensure(grid.cell_blocks()) ||
        !network->groups_.ensure(grid.cell_blocks())) {
      return out_of_memory("an avatar's network");
    }
    return std::unique_ptr<AvatarNetwork>(std::move(network));
  }

  MapTarget input() override { return {runner_->input().data(), runner_->input_stride()}; }
  Status run(std::span<const uint32_t> wanted_blocks) override {
    std::fill_n(evaluated_.data(), grid_.cell_blocks(), uint8_t{0});
    return runner_->run(take_missing(wanted_blocks));
  }
  void run_further(std::span<const uint32_t> wanted_blocks) override {
    runner_->run_further(take_missing(wanted_blocks));
  }
  Status run_all() override {
    std::fill_n(evaluated_.data(), grid_.cell_blocks(), uint8_t{1});
    return runner_->run();
  }
  std::span<const float> outputs() const override { return std::as_const(*runner_).output(); }
  void find_heads(const float* outputs, const uint32_t (&rows)[kernels::kLanes],
                  const float* (&heads)[kernels::kLanes]) const override {
    for (uint32_t lane = 0; lane < kernels::kLanes; ++lane)
      heads[lane] = outputs + size_t{rows[lane]} * head_channels_;
  }
  uint64_t macs() const override { return runner_->macs(); }
  uint64_t memory_bytes() const override {
    return runner_->memory_bytes() + evaluated_.memory_bytes() + groups_.memory_bytes();
  }

 private:
  FixedPointAvatarNetwork(std::unique_ptr<FixedPointRunner> runner, const BodyGrid& grid,
                          uint32_t head_channels)
      : runner_(std::move(runner)), grid_(grid), head_channels_(head_channels) {}

  // The groups of cells that the blocks of texels need and that are not evaluated yet; from here on
  // they count as evaluated.
  std::span<const uint32_t> take_missing(std::span<const uint32_t> wanted_blocks) {
    size_t count = 0;
    for (const uint32_t block : wanted_blocks) {
      for (const uint32_t group : grid_.cell_blocks_of(block)) {
        if (evaluated_[group] != 0) continue;
        evaluated_[group] = 1;
        groups_[count++] = group;
      }
    }
    return groups_.span(count);
  }

  std::unique_ptr<FixedPointRunner> runner_;
  const BodyGrid& grid_;
  uint32_t head_channels_;
  Buffer<uint8_t> evaluated_;  // [cell blocks] in the last run and since
  Buffer<uint32_t> groups_;    // [cell blocks]
};

}  // namespace

Result<std::unique_ptr<AvatarNetwork>> AvatarNetwork::create(const Avatar& avatar,
                                                             const BodyGrid& grid,
                                                             Precision precision, ThreadPool& pool,
                                                             const KernelTable& kernels) {
  FIG_RETURN_IF_ERROR(check_holds(avatar, precision));
  const Result<std::vector<ValueShape>> shapes = infer_shapes(avatar.network, false);
  if (!shapes.ok()) return shapes.status();
  FIG_RETURN_IF_ERROR(check_fits(avatar, grid, *shapes));
  if (precision == Precision::kFixedPoint) {
    return FixedPointAvatarNetwork::create(avatar, grid, pool, kernels);
  }
  return FloatAvatarNetwork::create(avatar, grid, shapes->front().channels, pool);
}

}  // namespace figurine
