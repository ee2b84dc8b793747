#include "runtime/src/pose/posed_avatar.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <new>
#include <string>
#include <vector>

#include "runtime/src/base/float_math.h"

namespace figurine {
namespace {

constexpr uint32_t kChunk = 512;  // texels that one task decodes or skins

Status corrupt(const std::string& what) { return Status(StatusCode::kCorrupt, "avatar: " + what); }

Status check_network(const Avatar& avatar, const Body& body,
                     const std::vector<ValueShape>& shapes) {
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
  if (avatar.shape.size() > body.shape_count())
    return corrupt("more shape coefficients than the body has directions");
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

// a b for row-major [3,3] matrices.
void multiply3(const float* a, const float* b, float* product) {
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j)
      product[3 * i + j] = a[3 * i] * b[j] + a[3 * i + 1] * b[3 + j] + a[3 * i + 2] * b[6 + j];
  }
}

}  // namespace

bool GaussianArrays::ensure(size_t count, uint32_t sh_degree) {
  return position_m.ensure(count * 3) && covariance_factor.ensure(count * 9) &&
         opacity.ensure(count) && sh.ensure(count * 3 * sh_coefficients(sh_degree));
}

GaussianView GaussianArrays::view(uint32_t count, uint32_t sh_degree) const {
  const size_t n = count;
  return {.count = count,
          .sh_degree = sh_degree,
          .position_m = position_m.span(3 * n),
          .covariance_factor = covariance_factor.span(9 * n),
          .opacity = opacity.span(n),
          .sh = sh.span(3 * n * sh_coefficients(sh_degree))};
}

Result<std::unique_ptr<PosedAvatar>> PosedAvatar::create(const Avatar& avatar, const Body& body,
                                                         Precision precision, ThreadPool& pool) {
  FIG_RETURN_IF_ERROR(check_holds(avatar, precision));
  const Result<std::vector<ValueShape>> shapes = infer_shapes(avatar.network, false);
  if (!shapes.ok()) return shapes.status();
  FIG_RETURN_IF_ERROR(check_network(avatar, body, *shapes));

  std::unique_ptr<PosedAvatar> posed(new (std::nothrow) PosedAvatar(avatar, body, pool));
  if (posed == nullptr) return out_of_memory("an avatar");
  posed->input_channels_ = shapes->front().channels;
  FIG_RETURN_IF_ERROR(precision == Precision::kFixedPoint ? posed->create_fixed_point(avatar)
                                                          : posed->create_float(avatar));

  const size_t joints = body.joint_count(), texels = body.texel_count();
  if (!posed->joint_position_m_.ensure(joints * 3) ||
      !posed->texel_position_m_.ensure(texels * 3) || !posed->transforms_.ensure(joints)) {
    return out_of_memory("an avatar's joints and texels");
  }
  const std::span<const float> shape =
      avatar.template_mode == TemplateMode::kShaped ? avatar.shape : std::span<const float>();
  shape_body(body, shape, posed->joint_position_m_.span(joints * 3),
             posed->texel_position_m_.span(texels * 3));
  return posed;
}

Status PosedAvatar::create_float(const Avatar& avatar) {
  Result<std::unique_ptr<NetworkRunner>> network = NetworkRunner::create(avatar.network, pool_);
  if (!network.ok()) return network.status();
  float_ = std::move(network).value();
  // Constant, so drawn once; the pose maps leave these channels alone.
  draw_fourier_channels(body_.uv_size, avatar.fourier_octaves, kMapChannels, input_channels_,
                        float_->input());
  return {};
}

Status PosedAvatar::create_fixed_point(const Avatar& avatar) {
  const uint32_t fourier_channels = 4 * avatar.fourier_octaves;
  std::vector<float> fourier(size_t(body_.uv_size) * body_.uv_size * fourier_channels);
  draw_fourier_channels(body_.uv_size, avatar.fourier_octaves, 0, fourier_channels, fourier);
  std::vector<uint32_t> drawn(body_.texel.begin(), body_.texel.end());
  drawn.insert(drawn.end(), body_.border_texel.begin(), body_.border_texel.end());
  Result<std::unique_ptr<FixedPointRunner>> network =
      FixedPointRunner::create(avatar.network, avatar.fixed_point,
                               {.varying_channels = kMapChannels,
                                .constants = fourier,
                                .drawn = drawn,
                                .wanted = body_.texel},
                               pool_);
  if (!network.ok()) return network.status();
  fixed_point_ = std::move(network).value();
  return {};
}

void PosedAvatar::draw_maps(const PoseView& pose) {
  const std::span<Affine> scratch = transforms_.span(body_.joint_count());
  if (fixed_point_ != nullptr) {
    draw_pose_maps(body_, pose, statistics_, scratch, fixed_point_->input_stride(),
                   fixed_point_->input());
  } else {
    draw_pose_maps(body_, pose, statistics_, scratch, input_channels_, float_->input());
  }
}

Status PosedAvatar::run_network() {
  return fixed_point_ != nullptr ? fixed_point_->run() : float_->run();
}

const float* PosedAvatar::head(size_t i) const {
  const size_t channels = head_channels(decoding_.sh_degree);
  if (fixed_point_ != nullptr)
    return &fixed_point_->output()[i * channels];  // covered texels alone
  return &std::as_const(*float_).output()[size_t(body_.texel[i]) * channels];
}

// Head outputs to canonical Gaussians: position = texel + offset, factor = R S.
void PosedAvatar::decode(uint32_t begin, uint32_t end, GaussianArrays& gaussians) const {
  const uint32_t sh_values = 3 * sh_coefficients(decoding_.sh_degree);
  const float limit = decoding_.max_log_scale;
  for (size_t i = begin; i < end; ++i) {
    const float* h = head(i);
    for (uint32_t k = 0; k < 3; ++k)
      gaussians.position_m[3 * i + k] =
          texel_position_m_[3 * i + k] + decoding_.offset_scale_m * h[k];

    const float quaternion[4] = {1.0f + h[6], h[7], h[8], h[9]};
    const std::array<float, 9> rotation = rotation_from_quaternion(quaternion);
    const float spacing = decoding_.spacing_scale * body_.texel_spacing_m[i];
    float scale[3];
    for (uint32_t k = 0; k < 3; ++k)
      scale[k] =
          spacing * exp_float(h[3 + k] < -limit ? -limit : (h[3 + k] > limit ? limit : h[3 + k]));
    for (uint32_t r = 0; r < 3; ++r) {
      for (uint32_t k = 0; k < 3; ++k)
        gaussians.covariance_factor[9 * i + 3 * r + k] = rotation[3 * r + k] * scale[k];
    }
    gaussians.opacity[i] = logistic(h[10] + decoding_.opacity_bias);
    std::memcpy(&gaussians.sh[i * sh_values], h + 11, sh_values * sizeof(float));
  }
}

// Canonical to world: the centre by the blended transform, the factor by its linear part A itself
// (no rotation is extracted from it).
void PosedAvatar::skin(uint32_t begin, uint32_t end, GaussianArrays& gaussians) const {
  for (size_t i = begin; i < end; ++i) {
    const Affine transform =
        blend(transforms_.span(body_.joint_count()), &body_.texel_joints[i * kSkinInfluences],
              &body_.texel_weights[i * kSkinInfluences]);
    const std::array<float, 3> position = transform_point(transform, &gaussians.position_m[3 * i]);
    const std::array<float, 12>& m = transform.m;
    const float linear[9] = {m[0], m[1], m[2], m[4], m[5], m[6], m[8], m[9], m[10]};
    float factor[9];
    multiply3(linear, &gaussians.covariance_factor[9 * i], factor);
    std::memcpy(&gaussians.position_m[3 * i], position.data(), sizeof(position));
    std::memcpy(&gaussians.covariance_factor[9 * i], factor, sizeof(factor));
  }
}

Status PosedAvatar::pose(const PoseView& pose, GaussianArrays& gaussians, StageClock& clock) {
  {
    const StageClock::Scope timed(clock, Stage::kMaps);
    draw_maps(pose);
  }
  {
    const StageClock::Scope timed(clock, Stage::kNetwork);
    FIG_RETURN_IF_ERROR(run_network());
  }
  const uint32_t texels = body_.texel_count(), chunks = (texels + kChunk - 1) / kChunk;
  const auto for_each_chunk = [&](const auto& task) {
    pool_.for_each(chunks, [&](size_t chunk) {
      const uint32_t begin = static_cast<uint32_t>(chunk) * kChunk;
      task(begin, std::min(begin + kChunk, texels));
    });
  };
  {
    const StageClock::Scope timed(clock, Stage::kDecode);
    for_each_chunk([&](uint32_t begin, uint32_t end) { decode(begin, end, gaussians); });
  }
  const StageClock::Scope timed(clock, Stage::kSkin);
  skinning_transforms({body_.parents, joint_position_m_.span(3 * size_t(body_.joint_count()))},
                      pose, transforms_.span(body_.joint_count()));
  for_each_chunk([&](uint32_t begin, uint32_t end) { skin(begin, end, gaussians); });
  return {};
}

uint64_t PosedAvatar::memory_bytes() const {
  const uint64_t network =
      fixed_point_ != nullptr ? fixed_point_->memory_bytes() : float_->memory_bytes();
  return network + joint_position_m_.memory_bytes() + texel_position_m_.memory_bytes() +
         transforms_.memory_bytes();
}

}  // namespace figurine
