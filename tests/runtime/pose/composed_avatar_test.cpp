// Avatars whose network runs on a grid coarser than the texels, with a static part, or with nothing
// but one, against their definition in plain loops: in fixed point to the bit, in float against
// float64. And what a pose need not compute again.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <deque>
#include <memory>
#include <vector>

#include "figurine/avatar.h"
#include "figurine/gaussian.h"
#include "figurine/texel_grid.h"
#include "runtime/nn/quantise_network.h"
#include "runtime/nn/reference_network.h"
#include "runtime/pose/random_static_part.h"
#include "runtime/src/base/float_math.h"
#include "runtime/src/pose/posed_avatar.h"
#include "runtime/src/splat/view.h"
#include "runtime/test_packages.h"

namespace figurine::composed_avatar_test {
namespace {

using kernels::kLanes;
using tests::Random;
using tests::SyntheticPose;

constexpr uint32_t kSize = 32;  // T

// The test body without some of its texels: two charts one column apart, which share cells of every
// coarser grid, a ragged edge, and a last block that is not full.
struct RaggedBody {
  tests::SyntheticBody whole = tests::make_test_body({.uv_size = kSize, .joints = 5});
  std::deque<std::vector<float>> floats;
  std::vector<uint32_t> texel, border_texel, border_source;
  std::vector<uint8_t> joints;
  Body body = whole.body();

  RaggedBody() {
    const Body& all = whole.body();
    std::vector<uint32_t> rows, row_of(all.texel_count(), ~0u);
    for (uint32_t i = 0; i < all.texel_count(); ++i) {
      const uint32_t u = all.texel[i] % kSize, v = all.texel[i] / kSize;
      if (u == 14 || (v > 20 && (u * 7 + v * 3) % 5 == 0)) continue;
      row_of[i] = static_cast<uint32_t>(rows.size());
      rows.push_back(i);
    }
    for (const uint32_t row : rows) texel.push_back(all.texel[row]);
    for (size_t i = 0; i < all.border_texel.size(); ++i) {
      if (row_of[all.border_source[i]] == ~0u) continue;
      border_texel.push_back(all.border_texel[i]);
      border_source.push_back(row_of[all.border_source[i]]);
    }
    body.texel = texel, body.border_texel = border_texel, body.border_source = border_source;
    body.texel_position_m = pick(all.texel_position_m, rows, 3);
    body.texel_normal = pick(all.texel_normal, rows, 3);
    body.texel_weights = pick(all.texel_weights, rows, kSkinInfluences);
    body.texel_spacing_m = pick(all.texel_spacing_m, rows, 1);
    std::vector<float>& basis = floats.emplace_back();
    for (uint32_t s = 0; s < all.shape_count(); ++s) {
      const auto picked = pick(all.texel_shape_basis_m.subspan(s * 3 * all.texel_count()), rows, 3);
      basis.insert(basis.end(), picked.begin(), picked.end());
    }
    body.texel_shape_basis_m = basis;
    for (const uint32_t row : rows) {
      const uint8_t* const from = &all.texel_joints[size_t{row} * kSkinInfluences];
      joints.insert(joints.end(), from, from + kSkinInfluences);
    }
    body.texel_joints = joints;
  }
  RaggedBody(const RaggedBody&) = delete;

  std::span<const float> pick(std::span<const float> from, const std::vector<uint32_t>& rows,
                              size_t each) {
    std::vector<float>& picked = floats.emplace_back();
    for (const uint32_t row : rows)
      picked.insert(picked.end(), &from[row * each], &from[row * each] + each);
    return picked;
  }
};

struct Form {
  uint32_t network_step = 1;  // T / T_n; 0: no network
  bool static_part = false;
  uint32_t sh_degree = 0;
  bool smallest_extents = false;
};

// An avatar in memory, with random weights and values in both precisions.
struct ComposedAvatar {
  Avatar avatar;
  std::deque<std::vector<float>> floats;
  tests::RandomStaticPart static_part;
  std::vector<uint8_t> extents;
  std::unique_ptr<tests::QuantisedNetwork> quantised;

  ComposedAvatar(const Body& body, const Form& form) : static_part(body, 1) {
    Random random(1);
    avatar.fourier_octaves = form.network_step == 0 ? 0 : 1;
    avatar.decoding.sh_degree = form.sh_degree;
    avatar.decoding.max_offset = 1;
    avatar.decoding.max_log_scale = 0.5f;
    avatar.shape = floats.emplace_back(std::vector<float>{0.5f, -0.5f});
    if (form.network_step != 0) add_network(body, form, random);
    if (form.static_part) avatar.static_part = static_part.part;
    if (!form.smallest_extents) return;
    for (uint32_t i = 0; i < body.texel_count(); ++i)
      extents.push_back(static_cast<uint8_t>(i * 37 % 256));
    avatar.smallest_extents = {.scale_m = 1e-5f, .codes = extents};
  }
  ComposedAvatar(const ComposedAvatar&) = delete;

  void add_network(const Body& body, const Form& form, Random& random) {
    avatar.network = make_pose_unet(kSize / form.network_step, kMapChannels + 4, 8,
                                    head_channels(form.sh_degree));
    const std::vector<ValueShape> shapes = *infer_shapes(avatar.network, false);
    for (Layer& layer : avatar.network.layers) {
      if (layer.op != LayerOp::kConv2d) continue;
      const uint32_t fan_in = layer.kernel * layer.kernel * shapes[layer.inputs[0]].channels;
      std::vector<float>&weights = floats.emplace_back(size_t{layer.out_channels} * fan_in),
      &bias = floats.emplace_back(layer.out_channels);
      for (float& weight : weights)
        weight = std::sqrt(2.0f / static_cast<float>(fan_in)) * random.normal();
      for (float& value : bias) value = 0.05f * random.normal();
      layer.weights = weights, layer.bias = bias;
    }
    quantised = std::make_unique<tests::QuantisedNetwork>(
        avatar.network, tests::network_input(avatar, body, tests::make_test_pose(body, 1).view()));
    avatar.fixed_point = quantised->fixed;
  }
};

// The sum over a texel's taps of values in rows of `channels`, or the texel's own where the grid
// has every texel.
template <class Scalar, class ValueAt>
Scalar between(const GridTaps& taps, bool coarse, ValueAt value_at) {
  if (!coarse) return value_at(taps.row[0]);
  const auto part = [&](int k) {
    return static_cast<Scalar>(taps.weight[k]) * value_at(taps.row[k]);
  };
  return (part(0) + part(1)) + (part(2) + part(3));
}

// h' of every texel by figurine/avatar.h: [N,head_channels]. network: the outputs for all cells of
// the network's grid, [T_n,T_n,head_channels]; empty: none.
template <class Scalar>
std::vector<Scalar> compose(const Avatar& avatar, const Body& body,
                            const std::vector<Scalar>& network) {
  const uint32_t channels = head_channels(avatar.decoding.sh_degree), texels = body.texel_count();
  std::vector<Scalar> heads(size_t{texels} * channels, Scalar(0));
  if (!network.empty()) {
    const TexelGrid grid = make_texel_grid(body, avatar.network.input_size);
    const std::vector<GridTaps> taps = make_grid_taps(body, grid);
    for (uint32_t i = 0; i < texels; ++i) {
      for (uint32_t c = 0; c < channels; ++c) {
        heads[size_t{i} * channels + c] = between<Scalar>(
            taps[i], grid.size != kSize,
            [&](uint32_t row) { return network[size_t{grid.cell[row]} * channels + c]; });
      }
    }
  }
  if (avatar.static_part.empty()) return heads;
  std::vector<Scalar> s(size_t{texels} * kStaticChannels, Scalar(0));
  for (const StaticGroup& group : avatar.static_part.groups) {
    const TexelGrid grid = make_texel_grid(body, group.grid_size);
    const std::vector<GridTaps> taps = make_grid_taps(body, grid);
    for (uint32_t i = 0; i < texels; ++i) {
      for (uint32_t c = 0; c < group.channels; ++c) {
        s[size_t{i} * kStaticChannels + group.first_channel + c] =
            between<Scalar>(taps[i], grid.size != kSize, [&](uint32_t row) {
              return static_cast<Scalar>(group.scale[c]) *
                     static_cast<Scalar>(group.values[size_t{row} * group.channels + c]);
            });
      }
    }
  }
  for (uint32_t i = 0; i < texels; ++i) {
    Scalar* const h = &heads[size_t{i} * channels];
    const Scalar* const own = &s[size_t{i} * kStaticChannels];
    for (uint32_t c = 0; c < kStaticColour; ++c) h[c] += own[c];
    for (uint32_t c = kStaticColour; c < channels; ++c) {
      const Scalar log_gain = own[kStaticColour + (c - kStaticColour) % 3];
      const Scalar gain = std::is_same_v<Scalar, float>
                              ? static_cast<Scalar>(exp_float(static_cast<float>(log_gain)))
                              : std::exp(log_gain);
      h[c] = c < kStaticChannels ? (h[c] + Scalar(kHalfColour)) * gain - Scalar(kHalfColour)
                                 : h[c] * gain;
    }
  }
  return heads;
}

std::vector<float> evaluate_q8(const Avatar& avatar, const Body& body, const PoseView& pose) {
  std::vector<int16_t> input;
  for (const float value : tests::network_input(avatar, body, pose))
    input.push_back(quantise_input(value, avatar.fixed_point.values[0].scale));
  return evaluate_fixed_point(avatar.network, avatar.fixed_point, input).result;
}

// A body with all that a pose is worked out in.
struct Stage32 {
  explicit Stage32(uint32_t threads = 1) : pool(std::move(ThreadPool::create(threads)).value()) {
    FIG_CHECK(
        blocks.ensure(ragged.body) && scratch.ensure(ragged.body.joint_count(), blocks.count()),
        "memory");
  }
  const Body& body() const { return ragged.body; }

  Result<std::unique_ptr<PosedAvatar>> try_create(const Avatar& avatar, Precision precision) {
    return PosedAvatar::create(avatar, body(), blocks, nullptr, precision, pool, best_kernels());
  }
  std::unique_ptr<PosedAvatar> create(const Avatar& avatar,
                                      Precision precision = Precision::kFixedPoint) {
    Result<std::unique_ptr<PosedAvatar>> posed = try_create(avatar, precision);
    FIG_CHECK(posed.ok(), posed.status().message().c_str());
    return std::move(posed).value();
  }
  NetworkUse pose(PosedAvatar& posed, const PoseJob& job) {
    StageClock clock;
    const Result<NetworkUse> use = posed.pose(job, scratch, clock);
    FIG_CHECK(use.ok(), use.status().message().c_str());
    return *use;
  }
  // The wanted blocks' Gaussians.
  std::vector<kernels::GaussianBlock> decode(const PosedAvatar& posed) {
    std::vector<kernels::GaussianBlock> gaussians;
    for (const uint32_t block : scratch.wanted_blocks())
      posed.decode(scratch, block, posed.sh_degree(),
                   gaussians.emplace_back(kernels::GaussianBlock{}));
    return gaussians;
  }

  // What the kernel makes of these heads and of the transforms of the last pose: decoding and
  // skinning alone, which posed_texels_test holds to its definition.
  std::vector<kernels::GaussianBlock> decode(const Avatar& avatar,
                                             const std::vector<float>& heads) {
    std::vector<float> joints(body().joint_position_m.size()), place(3 * body().texel_count());
    shape_body(body(), avatar.shape, joints, place);
    const uint32_t channels = head_channels(avatar.decoding.sh_degree);
    std::vector<kernels::GaussianBlock> gaussians;
    for (const uint32_t block : scratch.wanted_blocks()) {
      kernels::CanonicalBlock texels;
      kernels::ExtentBlock smallest;
      const bool widens = !avatar.smallest_extents.empty();
      kernels::DecodeSkinJob job{.head = {},
                                 .taps = nullptr,
                                 .static_part = nullptr,
                                 .smallest = widens ? &smallest : nullptr,
                                 .texels = &texels,
                                 .transforms = &scratch.transforms[block],
                                 .offset_scale_m = avatar.decoding.offset_scale_m,
                                 .max_offset = avatar.decoding.max_offset,
                                 .max_log_scale = avatar.decoding.max_log_scale,
                                 .opacity_bias = avatar.decoding.opacity_bias,
                                 .sh_values = 3 * sh_coefficients(avatar.decoding.sh_degree),
                                 .gaussians = &gaussians.emplace_back(kernels::GaussianBlock{})};
      for (uint32_t lane = 0; lane < kLanes; ++lane) {
        const uint32_t i = texel_of_lane(block, lane, body().texel_count());
        for (uint32_t k = 0; k < 3; ++k) texels.position_m[k][lane] = place[3 * i + k];
        texels.extent_m[lane] = avatar.decoding.spacing_scale * body().texel_spacing_m[i];
        if (widens) {
          smallest.smallest_m[lane] = 1e-5f * static_cast<float>(avatar.smallest_extents.codes[i]);
        }
        job.head[0][lane] = &heads[size_t{i} * channels];
      }
      best_kernels().decode_skin(job);
    }
    return gaussians;
  }

  RaggedBody ragged;
  BodyBlocks blocks;
  PoseScratch scratch;
  ThreadPool pool;
};

bool same_bits(const std::vector<kernels::GaussianBlock>& a,
               const std::vector<kernels::GaussianBlock>& b) {
  return a.size() == b.size() &&
         std::memcmp(a.data(), b.data(), a.size() * sizeof(kernels::GaussianBlock)) == 0;
}

class ComposedAvatars : public ::testing::TestWithParam<Form> {};

TEST_P(ComposedAvatars, InFixedPointAreTheDefinitionToTheBit) {
  const RaggedBody ragged;
  const Body& body = ragged.body;
  ASSERT_NE(body.texel_count() % kLanes, 0u);
  const ComposedAvatar composed(body, GetParam());
  const Avatar& avatar = composed.avatar;
  const bool has_network = GetParam().network_step != 0;
  constexpr uint32_t kFrames[] = {0, 3};
  std::vector<std::vector<float>> heads;
  for (const uint32_t frame : kFrames) {
    const SyntheticPose pose = tests::make_test_pose(body, frame);
    heads.push_back(compose<float>(
        avatar, body, has_network ? evaluate_q8(avatar, body, pose.view()) : std::vector<float>()));
  }
  for (const uint32_t threads : {1u, 2u, 3u, 4u}) {
    Stage32 stage(threads);
    const std::unique_ptr<PosedAvatar> posed = stage.create(avatar);
    for (size_t i = 0; i < heads.size(); ++i) {
      const SyntheticPose pose = tests::make_test_pose(body, kFrames[i]);
      EXPECT_EQ(stage.pose(*posed, {.pose = pose.view()}),
                has_network ? NetworkUse::kRun : NetworkUse::kNone);
      ASSERT_TRUE(same_bits(stage.decode(*posed), stage.decode(avatar, heads[i])))
          << "frame " << kFrames[i] << ", " << threads << " threads";
    }
  }
}

TEST_P(ComposedAvatars, InFloatAreCloseToTheDefinitionInDouble) {
  Stage32 stage;
  const ComposedAvatar composed(stage.body(), GetParam());
  const Avatar& avatar = composed.avatar;
  const std::unique_ptr<PosedAvatar> posed = stage.create(avatar, Precision::kFloat32);
  const SyntheticPose pose = tests::make_test_pose(stage.body(), 2);
  stage.pose(*posed, {.pose = pose.view()});
  std::vector<double> network;
  if (GetParam().network_step != 0) {
    const std::vector<float> input = tests::network_input(avatar, stage.body(), pose.view());
    network = tests::run_reference<double>(avatar.network, *infer_shapes(avatar.network, true),
                                           {input.begin(), input.end()});
  }
  const std::vector<double> truth = compose<double>(avatar, stage.body(), network);
  const std::vector<kernels::GaussianBlock> gaussians = stage.decode(*posed),
                                            expected =
                                                stage.decode(avatar, {truth.begin(), truth.end()});
  double largest = 0, largest_sh = 0;
  const auto compare = [](const auto& a, const auto& b, uint32_t planes, double& error) {
    for (uint32_t k = 0; k < planes; ++k) {
      for (uint32_t lane = 0; lane < kLanes; ++lane)
        error = std::max(error, std::fabs(double{a[k][lane]} - double{b[k][lane]}));
    }
  };
  for (size_t i = 0; i < gaussians.size(); ++i) {
    compare(gaussians[i].position_m, expected[i].position_m, 3, largest);
    compare(gaussians[i].factor, expected[i].factor, 9, largest);
    compare(gaussians[i].sh, expected[i].sh, 3 * sh_coefficients(avatar.decoding.sh_degree),
            largest_sh);
  }
  std::printf("largest error, composed in float: %.2g m, colours %.2g\n", largest, largest_sh);
  // A network's 2e-5 (docs/numerics.md, the ladder) times an offset's 5 cm, and times the largest
  // gain of a colour here.
  EXPECT_LT(largest, 1e-6);
  EXPECT_LT(largest_sh, 2e-5 * 4.6);
}

// A camera that sees some blocks of texels and not others.
kernels::View partial_view(float target_y_m) {
  const Result<Camera> camera =
      make_orbit_camera({.distance_m = 0.6f, .target_m = {0, target_y_m, 0}}, 60, 40);
  FIG_CHECK(camera.ok(), camera.status().message().c_str());
  return make_view(*camera, 1.0f / 255);
}

// By a block's number in the body.
void expect_among(const std::vector<kernels::GaussianBlock>& all,
                  const std::vector<kernels::GaussianBlock>& some,
                  std::span<const uint32_t> wanted) {
  ASSERT_EQ(some.size(), wanted.size());
  for (size_t i = 0; i < wanted.size(); ++i) {
    ASSERT_EQ(std::memcmp(&some[i], &all[wanted[i]], sizeof(some[i])), 0) << "block " << wanted[i];
  }
}

TEST_P(ComposedAvatars, WantedTexelsAreWhatTheyAreAmongAll) {
  for (const Precision precision : {Precision::kFixedPoint, Precision::kFloat32}) {
    Stage32 stage;
    const ComposedAvatar composed(stage.body(), GetParam());
    const SyntheticPose pose = tests::make_test_pose(stage.body(), 3);
    const std::unique_ptr<PosedAvatar> whole = stage.create(composed.avatar, precision),
                                       part = stage.create(composed.avatar, precision);
    stage.pose(*whole, {.pose = pose.view()});
    const std::vector<kernels::GaussianBlock> all = stage.decode(*whole);
    const kernels::View view = partial_view(0.9f), other = partial_view(0.6f);
    const NetworkUse first = stage.pose(*part, {.pose = pose.view(), .view = &view});
    ASSERT_GT(stage.scratch.wanted_count, 0u);
    ASSERT_LT(stage.scratch.wanted_count, stage.blocks.count());
    expect_among(all, stage.decode(*part), stage.scratch.wanted_blocks());
    const std::vector<uint32_t> before(stage.scratch.wanted_blocks().begin(),
                                       stage.scratch.wanted_blocks().end());
    // The same pose from elsewhere: the network does not run, and what was not wanted comes to it.
    const NetworkUse second = stage.pose(*part, {.pose = pose.view(), .view = &other});
    const std::span<const uint32_t> now = stage.scratch.wanted_blocks();
    EXPECT_FALSE(std::includes(before.begin(), before.end(), now.begin(), now.end()));
    expect_among(all, stage.decode(*part), now);
    const bool has_network = GetParam().network_step != 0;
    EXPECT_EQ(first, has_network ? NetworkUse::kRun : NetworkUse::kNone);
    EXPECT_EQ(second, has_network ? NetworkUse::kUnchanged : NetworkUse::kNone);
  }
}

INSTANTIATE_TEST_SUITE_P(
    Forms, ComposedAvatars,
    ::testing::Values(Form{1, false, 0}, Form{2, false, 1}, Form{4, false, 0}, Form{1, true, 0},
                      Form{2, true, 0}, Form{4, true, 2}, Form{0, true, 0}, Form{0, true, 1},
                      Form{1, false, 0, true}, Form{2, true, 1, true}, Form{0, true, 0, true}),
    [](const auto& of) {
      const Form& form = of.param;
      return (form.network_step == 0 ? std::string("NoNetwork")
                                     : "Step" + std::to_string(form.network_step)) +
             (form.static_part ? "Static" : "") + "Sh" + std::to_string(form.sh_degree) +
             (form.smallest_extents ? "Smallest" : "");
    });

TEST(RunsOfTheNetwork, HappenForEveryOtherPoseAndWhereTheSwitchIsOff) {
  Stage32 stage;
  const ComposedAvatar composed(stage.body(), {.network_step = 2, .static_part = true});
  const std::unique_ptr<PosedAvatar> posed = stage.create(composed.avatar);
  SyntheticPose pose = tests::make_test_pose(stage.body(), 1);
  const auto use = [&](bool leave_out = true) {
    return stage.pose(*posed,
                      {.pose = pose.view(), .leave_out = {.unchanged_networks = leave_out}});
  };
  EXPECT_EQ(use(), NetworkUse::kRun);
  EXPECT_EQ(use(), NetworkUse::kUnchanged);
  EXPECT_EQ(use(false), NetworkUse::kRun);
  pose.root_translation_m[1] = std::nextafter(pose.root_translation_m[1], 9.0f);
  EXPECT_EQ(use(), NetworkUse::kRun) << "the last bit of the root's place";
  float& last = pose.rotations.back();
  last = last == 0 ? -0.0f : std::nextafter(last, 9.0f);
  EXPECT_EQ(use(), NetworkUse::kRun) << "the last bit of a rotation";
  EXPECT_EQ(use(), NetworkUse::kUnchanged);
}

TEST(RunsOfTheNetwork, AreLeftOutForSmallFiguresWhereThatIsAskedFor) {
  Stage32 stage;
  const ComposedAvatar composed(stage.body(), {.network_step = 2, .static_part = true});
  const Avatar& avatar = composed.avatar;
  const std::unique_ptr<PosedAvatar> posed = stage.create(avatar);
  const SyntheticPose old = tests::make_test_pose(stage.body(), 1),
                      now = tests::make_test_pose(stage.body(), 3);
  const kernels::View view = make_view(tests::make_test_camera(64, 64), 1.0f / 255);
  const auto use = [&](const SyntheticPose& pose, float below_px, AvatarId id = AvatarId(1)) {
    return stage.pose(*posed, {.pose = pose.view(),
                               .avatar = id,
                               .view = &view,
                               .approximation = {.network_below_px = below_px}});
  };
  EXPECT_EQ(use(old, 1000), NetworkUse::kRun) << "nothing to keep yet";
  EXPECT_EQ(use(now, 20), NetworkUse::kRun) << "the figure is about 50 pixels high";
  EXPECT_EQ(use(old, 0), NetworkUse::kRun);
  ASSERT_EQ(use(now, 100), NetworkUse::kStale);
  // The old pose's heads on the new pose's skeleton.
  const std::vector<float> heads =
      compose<float>(avatar, stage.body(), evaluate_q8(avatar, stage.body(), old.view()));
  EXPECT_TRUE(same_bits(stage.decode(*posed), stage.decode(avatar, heads)));
  EXPECT_EQ(use(old, 100), NetworkUse::kUnchanged) << "exact where it can be";
  EXPECT_EQ(use(now, 100, AvatarId(2)), NetworkUse::kRun) << "heads of another avatar";
  EXPECT_EQ(use(old, 100, AvatarId(2)), NetworkUse::kStale);
  EXPECT_EQ(stage.pose(*posed, {.pose = old.view()}), NetworkUse::kRun);
  EXPECT_EQ(use(now, 100, AvatarId(2)), NetworkUse::kRun) << "after a pose of no frame";
}

TEST(ComposedAvatarsThatDoNotFit, AreRefusedByReason) {
  Stage32 stage;
  const auto message = [&](const Avatar& avatar) {
    const Result<std::unique_ptr<PosedAvatar>> posed =
        stage.try_create(avatar, Precision::kFixedPoint);
    EXPECT_FALSE(posed.ok());
    if (posed.ok()) return std::string();
    EXPECT_EQ(posed.status().code(), StatusCode::kCorrupt);
    return posed.status().message();
  };
  EXPECT_NE(message({}).find("neither a network nor a static part"), std::string::npos);
  const ComposedAvatar composed(stage.body(), {.network_step = 2});
  Avatar odd = composed.avatar;
  odd.network.input_size = 24;
  EXPECT_NE(message(odd).find("24 cells a side"), std::string::npos) << message(odd);
}

}  // namespace
}  // namespace figurine::composed_avatar_test
