#include "runtime/src/pose/avatar_network.h"

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

Status check_fits(const Avatar& avatar, const Body& body, const std::vector<ValueShape>& shapes) {
  if (shapes.front().size != body.uv_size || shapes.back().size != body.uv_size) {
    return corrupt("the network maps " + std::to_string(shapes.front().size) +
                   " texels a side to " + std::to_string(shapes.back().size) + ", the body has " +
                   std::to_string(body.uv_size));
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

// Dense: XNNPACK evaluates every texel.
class FloatAvatarNetwork : public AvatarNetwork {
 public:
  static Result<std::unique_ptr<AvatarNetwork>> create(const Avatar& avatar, const Body& body,
                                                       uint32_t input_channels, ThreadPool& pool) {
    Result<std::unique_ptr<NetworkRunner>> runner = NetworkRunner::create(avatar.network, pool);
    if (!runner.ok()) return runner.status();
    draw_fourier_channels(body.uv_size, avatar.fourier_octaves, kMapChannels, input_channels,
                          (*runner)->input());
    std::unique_ptr<AvatarNetwork> network(
        new (std::nothrow) FloatAvatarNetwork(std::move(runner).value(), body.texel, input_channels,
                                              head_channels(avatar.decoding.sh_degree)));
    if (network == nullptr) return out_of_memory("an avatar's network");
    return network;
  }

  MapTarget input() override { return {runner_->input().data(), input_channels_}; }
  Status run(std::span<const uint32_t>) override { return runner_->run(); }
  const float* head(size_t i) const override {
    return &std::as_const(*runner_).output()[size_t{texel_[i]} * head_channels_];
  }
  Precision precision() const override { return Precision::kFloat32; }
  uint64_t macs() const override { return runner_->macs(); }
  uint64_t memory_bytes() const override { return runner_->memory_bytes(); }

 private:
  FloatAvatarNetwork(std::unique_ptr<NetworkRunner> runner, std::span<const uint32_t> texel,
                     uint32_t input_channels, uint32_t head_channels)
      : runner_(std::move(runner)),
        texel_(texel),
        input_channels_(input_channels),
        head_channels_(head_channels) {}

  std::unique_ptr<NetworkRunner> runner_;
  std::span<const uint32_t> texel_;
  uint32_t input_channels_, head_channels_;
};

// The Fourier channels are constants to the runner, and its head is evaluated where it is wanted.
class FixedPointAvatarNetwork : public AvatarNetwork {
 public:
  static Result<std::unique_ptr<AvatarNetwork>> create(const Avatar& avatar, const Body& body,
                                                       ThreadPool& pool,
                                                       const KernelTable& kernels) {
    const uint32_t fourier_channels = 4 * avatar.fourier_octaves;
    std::vector<float> fourier(size_t{body.uv_size} * body.uv_size * fourier_channels);
    draw_fourier_channels(body.uv_size, avatar.fourier_octaves, 0, fourier_channels, fourier);
    std::vector<uint32_t> drawn(body.texel.begin(), body.texel.end());
    drawn.insert(drawn.end(), body.border_texel.begin(), body.border_texel.end());
    Result<std::unique_ptr<FixedPointRunner>> runner =
        FixedPointRunner::create(avatar.network, avatar.fixed_point,
                                 {.varying_channels = kMapChannels,
                                  .constants = fourier,
                                  .drawn = drawn,
                                  .wanted = body.texel},
                                 pool, kernels);
    if (!runner.ok()) return runner.status();
    std::unique_ptr<AvatarNetwork> network(new (std::nothrow) FixedPointAvatarNetwork(
        std::move(runner).value(), head_channels(avatar.decoding.sh_degree)));
    if (network == nullptr) return out_of_memory("an avatar's network");
    return network;
  }

  MapTarget input() override { return {runner_->input().data(), runner_->input_stride()}; }
  Status run(std::span<const uint32_t> wanted_blocks) override {
    return runner_->run(wanted_blocks);
  }
  const float* head(size_t i) const override {
    return &std::as_const(*runner_).output()[i * head_channels_];
  }
  Precision precision() const override { return Precision::kFixedPoint; }
  uint64_t macs() const override { return runner_->macs(); }
  uint64_t memory_bytes() const override { return runner_->memory_bytes(); }

 private:
  FixedPointAvatarNetwork(std::unique_ptr<FixedPointRunner> runner, uint32_t head_channels)
      : runner_(std::move(runner)), head_channels_(head_channels) {}

  std::unique_ptr<FixedPointRunner> runner_;
  uint32_t head_channels_;
};

}  // namespace

Result<std::unique_ptr<AvatarNetwork>> AvatarNetwork::create(const Avatar& avatar, const Body& body,
                                                             Precision precision, ThreadPool& pool,
                                                             const KernelTable& kernels) {
  FIG_RETURN_IF_ERROR(check_holds(avatar, precision));
  const Result<std::vector<ValueShape>> shapes = infer_shapes(avatar.network, false);
  if (!shapes.ok()) return shapes.status();
  FIG_RETURN_IF_ERROR(check_fits(avatar, body, *shapes));
  if (precision == Precision::kFixedPoint) {
    return FixedPointAvatarNetwork::create(avatar, body, pool, kernels);
  }
  return FloatAvatarNetwork::create(avatar, body, shapes->front().channels, pool);
}

}  // namespace figurine
