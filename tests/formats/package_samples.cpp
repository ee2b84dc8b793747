#include "formats/package_samples.h"

namespace figurine::samples {

namespace {

// Eighths in [-1, 1): a short repeating pattern, exact in binary.
float pattern(size_t i) {
  return static_cast<float>(static_cast<int>((i * 7 + 3) % 16) - 8) / 8.0f;
}

std::vector<float> patterned(size_t count) {
  std::vector<float> values(count);
  for (size_t i = 0; i < count; ++i) values[i] = pattern(i);
  return values;
}

// The first 33 bytes of a PNG: signature and header chunk, which is what a package checks of it.
std::vector<uint8_t> png_start(uint8_t width, uint8_t height) {
  return {0x89, 'P', 'N',   'G', '\r', '\n', 0x1A,   '\n', 0, 0, 0, 13, 'I', 'H', 'D', 'R', 0,
          0,    0,   width, 0,   0,    0,    height, 8,    2, 0, 0, 0,  0,   0,   0,   0};
}

}  // namespace

Provenance make_provenance() {
  return {.tool = "figurine-tests 1",
          .created = "",
          .settings = {{"command", "sample --seed 1\nsecond line"}, {"seed", "1"}},
          .sources = {"none", "m\xC3\xBChelos"},
          .quality = {{"psnr_pose_db", 31.25}, {"psnr_view_db", 30.5}},
          .licence_name = "CC0-1.0",
          .licence_url = "https://creativecommons.org/publicdomain/zero/1.0/",
          .authors = {"figurine"},
          .avatar_permission = "everyone",
          .commercial_usage = "corporation",
          .depicted_person = "synthetic"};
}

BodySample::BodySample() {
  constexpr uint32_t kJoints = 3, kShapes = 2, kTexels = 5, kSize = 8;
  parents = {-1, 0, 1};
  joint_position = {0, 1, 0, 0, 1.25f, 0, 0, 1.5f, 0.125f};
  joint_shape_basis = patterned(kShapes * kJoints * 3);
  texel = {9, 10, 17, 18, 63};
  texel_position = patterned(kTexels * 3);
  for (uint32_t i = 0; i < kTexels; ++i) {
    const float normal[3] = {i % 3 == 0 ? 1.0f : 0.0f, i % 3 == 1 ? 1.0f : 0.0f,
                             i % 3 == 2 ? -1.0f : 0.0f};
    texel_normal.insert(texel_normal.end(), normal, normal + 3);
    const uint8_t joints[kSkinInfluences] = {static_cast<uint8_t>(i % kJoints), 1, 2};
    texel_joints.insert(texel_joints.end(), joints, joints + kSkinInfluences);
    const float weights[kSkinInfluences] = {0.5f, 0.375f, 0.125f};
    texel_weights.insert(texel_weights.end(), weights, weights + kSkinInfluences);
  }
  texel_spacing.assign(kTexels, 0.0078125f);
  texel_shape_basis = patterned(kShapes * kTexels * 3);
  border_texel = {1, 8, 62};
  border_source = {0, 0, 4};
  body = {.name = "sample body",
          .uv_size = kSize,
          .joint_names = {"pelvis", "spine1", "head"},
          .parents = parents,
          .joint_position_m = joint_position,
          .joint_shape_basis_m = joint_shape_basis,
          .texel = texel,
          .texel_position_m = texel_position,
          .texel_normal = texel_normal,
          .texel_joints = texel_joints,
          .texel_weights = texel_weights,
          .texel_spacing_m = texel_spacing,
          .texel_shape_basis_m = texel_shape_basis,
          .border_texel = border_texel,
          .border_source = border_source};
}

namespace {

// Points an avatar's layers at patterned weights of the network's shapes.
void fill_network(AvatarSample& sample) {
  Network& network = sample.avatar.network;
  const std::vector<ValueShape> shapes = *infer_shapes(network, false);
  sample.weights.assign(network.layers.size(), {});
  sample.biases.assign(network.layers.size(), {});
  for (size_t i = 0; i < network.layers.size(); ++i) {
    Layer& layer = network.layers[i];
    if (layer.op != LayerOp::kConv2d) continue;
    sample.weights[i] = patterned(size_t{layer.out_channels} * layer.kernel * layer.kernel *
                                  shapes[layer.inputs[0]].channels);
    sample.biases[i] = patterned(layer.out_channels);
    layer.weights = sample.weights[i];
    layer.bias = sample.biases[i];
  }
  sample.budget.macs_per_frame = count_macs(network, shapes);
}

}  // namespace

AvatarSample::AvatarSample() {
  avatar.name = "sample avatar";
  avatar.body_name = "sample body";
  avatar.body_hash = {0x0123456789abcdefu, 0xfedcba9876543210u};
  avatar.preset = "none";
  avatar.template_mode = TemplateMode::kShaped;
  shape = {0.5f, -1.25f};
  avatar.shape = shape;
  avatar.map_statistics = {.mean = {0, 0.125f, 0, 0, 0, 0.25f}, .scale = {2, 2, 2, 1, 1, 0.5f}};
  avatar.fourier_octaves = 1;
  avatar.decoding = {.offset_scale_m = 0.0625f,
                     .spacing_scale = 0.5f,
                     .max_log_scale = 3,
                     .opacity_bias = 2,
                     .sh_degree = 1};
  avatar.network = make_pose_unet(8, kMapChannels + 4, 2, head_channels(1));
  budget = {.peak_memory_bytes = 1 << 20, .macs_per_frame = 0, .gaussians = 5};
  fill_network(*this);
  pose_mean = {0.25f, 0, -0.5f};
  pose_covariance = {0.5f, 0.125f, 0, 0.125f, 0.25f, 0.0625f, 0, 0.0625f, 1};
  avatar.pose_statistics = {
      .joints = {2}, .mean = pose_mean, .covariance = pose_covariance, .distances = {}};
  golden_rotations = {1, 0, 0, 0, 0, 1, 0, 0, 0.5f, 0.5f, 0.5f, 0.5f};
  golden_png = png_start(16, 24);
  avatar.golden.root_translation_m = {0.25f, 0, -1};
  avatar.golden.rotations = golden_rotations;
  avatar.golden.camera = {.width_px = 16,
                          .height_px = 24,
                          .fx_px = 20,
                          .fy_px = 21,
                          .cx_px = 8,
                          .cy_px = 12.5f,
                          .near_m = 0.125f};
  avatar.golden.camera.view_from_world = {0, 0, 1, 0.5f, 1, 0, 0, 0.25f, 0, 1, 0, 3};
  avatar.golden.background = {0.5f, 0.25f, 1};
  avatar.golden.png = golden_png;
}

FixedPointAvatarSample::FixedPointAvatarSample() {
  avatar.name = "sample avatar in fixed point";
  const size_t count = avatar.network.layers.size();
  // One quantisation for all that pool, upsample and concatenation tie together; the first value is
  // tied to nothing.
  avatar.fixed_point.values.assign(count, {.scale = 0.0625f, .zero_point = -3});
  avatar.fixed_point.values[0] = {.scale = 0x1p-12f, .zero_point = 0};
  avatar.fixed_point.values[1] = {.scale = 0.125f, .zero_point = -128};
  avatar.fixed_point.convolutions.resize(count);
  fixed_weights.resize(count);
  fixed_scales.resize(count);
  fixed_biases.resize(count);
  for (size_t i = 0; i < count; ++i) {
    Layer& layer = avatar.network.layers[i];
    if (layer.op != LayerOp::kConv2d) continue;
    for (size_t k = 0; k < layer.weights.size(); ++k)
      fixed_weights[i].push_back(static_cast<int8_t>(int(k * 37 + i) % 255 - 127));
    for (uint32_t o = 0; o < layer.out_channels; ++o) {
      fixed_scales[i].push_back(0.00390625f * static_cast<float>(o % 3 + 1));
      fixed_biases[i].push_back(static_cast<int32_t>(o * 101) - 200);
    }
    avatar.fixed_point.convolutions[i] = {fixed_weights[i], fixed_scales[i], fixed_biases[i]};
    layer.weights = layer.bias = {};
  }
  avatar.golden.fixed_point_hash = {0x1111222233334444u, 0x5555666677778888u};
  avatar.golden.fixed_point_library = "sample library 1";
}

FixedPointAvatarSample& FixedPointAvatarSample::with_floats() {
  for (size_t i = 0; i < avatar.network.layers.size(); ++i) {
    avatar.network.layers[i].weights = weights[i];
    avatar.network.layers[i].bias = biases[i];
  }
  return *this;
}

StaticAvatarSample::StaticAvatarSample() {
  avatar.name = "sample avatar with a static part";
  avatar.uv_size = 8;
  avatar.network = {
      .input_size = 4,
      .input_channels = kMapChannels + 4,
      .layers = {
          {.op = LayerOp::kConv2d, .inputs = {0, 0}, .out_channels = 2, .kernel = 3, .relu = true},
          {.op = LayerOp::kMaxPool2, .inputs = {1, 0}},
          {.op = LayerOp::kUpsample2, .inputs = {2, 0}},
          {.op = LayerOp::kConcat, .inputs = {1, 3}},
          {.op = LayerOp::kConv2d,
           .inputs = {4, 0},
           .out_channels = head_channels(1),
           .kernel = 1}}};
  fill_network(*this);
  for (uint32_t k = 0; k < 2 * kStaticColour; ++k)
    geometry.push_back(static_cast<int8_t>(int(k * 37) % 255 - 127));
  for (uint32_t k = 0; k < 5 * 3; ++k)
    colour.push_back(static_cast<int8_t>(int(k * 53) % 255 - 127));
  for (uint32_t c = 0; c < kStaticColour; ++c)
    geometry_scale.push_back(0.00390625f * static_cast<float>(c + 1));
  colour_scale = {0.0078125f, 0.015625f, 0.00390625f};
  avatar.static_part.groups = {{.first_channel = 0,
                                .channels = kStaticColour,
                                .grid_size = 2,
                                .values = geometry,
                                .scale = geometry_scale},
                               {.first_channel = kStaticColour,
                                .channels = 3,
                                .grid_size = 8,
                                .values = colour,
                                .scale = colour_scale}};
}

StaticOnlyAvatarSample::StaticOnlyAvatarSample() {
  avatar.name = "sample avatar without a network";
  avatar.network = {};
  avatar.fourier_octaves = 0;
  budget.macs_per_frame = 0;
  avatar.golden.fixed_point_hash = {0x1111222233334444u, 0x5555666677778888u};
}

FilteredAvatarSample::FilteredAvatarSample() : extents{0, 1, 100, 254, 255} {
  avatar.name = "sample avatar with filters";
  avatar.smallest_extents = {.scale_m = 0x1p-17f, .codes = extents};
  avatar.antialiased = true;
}

KnownPosesAvatarSample::KnownPosesAvatarSample() : pose_distances{0.5f, 1, 1, 2, 4} {
  avatar.name = "sample avatar that knows poses";
  pose_mean = {0, 0, 0, 0.25f, 0, -0.5f};
  pose_covariance.assign(36, 0);
  for (size_t i = 0; i < 6; ++i) pose_covariance[7 * i] = i < 3 ? 0.25f : 0.0625f;
  pose_covariance[3] = pose_covariance[18] = 0.03125f;  // the root's tilt forward goes with joint 2
  avatar.pose_statistics = {.joints = {0, 2},
                            .mean = pose_mean,
                            .covariance = pose_covariance,
                            .distances = pose_distances};
}

PopulationSample::PopulationSample(DifferenceCoding coding)
    : initial(std::make_unique<AvatarSample>()) {
  for (size_t m = 0; m < 3; ++m) {
    AvatarSample& sample = *avatars.emplace_back(std::make_unique<AvatarSample>());
    sample.avatar.name = m == 2 ? "m\xC3\xBCller" : "00000" + std::to_string(m);
    sample.shape[0] += static_cast<float>(m);
    sample.avatar.map_statistics.mean[1] = 0.125f * static_cast<float>(m);
    sample.golden_rotations[4] = 0.5f * static_cast<float>(m);
    sample.avatar.golden.camera.cx_px += static_cast<float>(m);
    sample.pose_mean[0] = 0.25f * static_cast<float>(m);
    for (size_t i = 0; i < sample.weights.size(); ++i) {
      // Multiples of 2^-10 times 0 to 16: exact, and one row in three does not differ at all.
      for (size_t k = 0; k < sample.weights[i].size(); ++k) {
        if (k % 3 != m)
          sample.weights[i][k] += 0x1p-10f * static_cast<float>(int((k * 5 + i) % 33) - 16);
      }
      for (float& bias : sample.biases[i]) bias += 0.0625f * static_cast<float>(m);
    }
    Provenance& own = provenance.emplace_back(make_provenance());
    own.settings.push_back({"data.seed", std::to_string(m)});
    own.quality = {{"psnr_pose_db", 27.5 + static_cast<double>(m)}};
    if (m == 1) own.quality.push_back({"psnr_view_db", 28.25});
    if (m == 2) own.licence_name = "CC-BY-4.0";
  }
  population = {.name = "sample population",
                .initial = initial->avatar.network,
                .coding = coding,
                .members = {},
                .budget = initial->budget};
  for (size_t m = 0; m < 3; ++m)
    population.members.push_back({&avatars[m]->avatar, &provenance[m], static_cast<Split>(m)});
}

StaticPopulationSample::StaticPopulationSample(DifferenceCoding coding)
    : initial(std::make_unique<StaticAvatarSample>()) {
  const bool alike = coding == DifferenceCoding::kNone;
  initial->avatar.name = "shared";
  initial->avatar.antialiased = true;
  for (size_t m = 0; m < 3; ++m) {
    StaticAvatarSample& sample = *avatars.emplace_back(std::make_unique<StaticAvatarSample>());
    sample.avatar.name = "person " + std::to_string(m);
    sample.avatar.antialiased = true;
    sample.shape[0] += static_cast<float>(m);
    // Some differ by more than half of the range, so that the difference wraps.
    for (size_t k = 0; k < sample.geometry.size(); ++k) {
      sample.geometry[k] =
          static_cast<int8_t>((sample.geometry[k] + 127 + int(m * k * 11)) % 255 - 127);
    }
    for (size_t k = 0; k < sample.colour.size(); ++k)
      sample.colour[k] = static_cast<int8_t>(int(k + m) % 2 == 0 ? -127 : 127);
    sample.geometry_scale[2] *= static_cast<float>(1 + m);
    if (alike && m == 2) {
      sample.avatar.network = {};
      sample.avatar.fourier_octaves = 0;
    } else if (!alike) {
      for (std::vector<float>& weights : sample.weights) {
        for (size_t k = 0; k < weights.size(); ++k)
          weights[k] += 0x1p-10f * static_cast<float>(k % 7 * m);
      }
    }
    Provenance& own = provenance.emplace_back(make_provenance());
    own.quality = {{"psnr_pose_db", 27.5 + static_cast<double>(m)}};
  }
  population = {.name = "sample population with static parts",
                .initial = initial->avatar.network,
                .shared = alike ? &initial->avatar : nullptr,
                .coding = coding,
                .members = {},
                .budget = initial->budget};
  for (size_t m = 0; m < 3; ++m)
    population.members.push_back({&avatars[m]->avatar, &provenance[m], static_cast<Split>(m)});
}

std::string to_string(SampleKind kind) {
  if (kind == SampleKind::kFixedPointAvatar) return "fixed_point_avatar";
  if (kind == SampleKind::kHalfPopulation) return "half_population";
  if (kind == SampleKind::kStaticAvatar) return "static_avatar";
  if (kind == SampleKind::kStaticOnlyAvatar) return "static_only_avatar";
  if (kind == SampleKind::kFilteredAvatar) return "filtered_avatar";
  if (kind == SampleKind::kStaticPopulation) return "static_population";
  if (kind == SampleKind::kStaticSampler) return "static_sampler";
  if (kind == SampleKind::kKnownPosesAvatar) return "known_poses_avatar";
  return figurine::to_string(package_kind(kind));
}

PackageKind package_kind(SampleKind kind) {
  switch (kind) {
    case SampleKind::kBody:
      return PackageKind::kBody;
    case SampleKind::kAvatar:
    case SampleKind::kFixedPointAvatar:
    case SampleKind::kStaticAvatar:
    case SampleKind::kStaticOnlyAvatar:
    case SampleKind::kFilteredAvatar:
    case SampleKind::kKnownPosesAvatar:
      return PackageKind::kAvatar;
    case SampleKind::kMotion:
      return PackageKind::kMotion;
    case SampleKind::kPopulation:
    case SampleKind::kHalfPopulation:
    case SampleKind::kStaticPopulation:
      return PackageKind::kPopulation;
    case SampleKind::kSampler:
    case SampleKind::kStaticSampler:
      return PackageKind::kSampler;
  }
  return {};
}

Result<std::vector<std::byte>> write_sample(SampleKind kind) {
  switch (kind) {
    case SampleKind::kBody:
      return BodySample().write();
    case SampleKind::kAvatar:
      return AvatarSample().write();
    case SampleKind::kFixedPointAvatar:
      return FixedPointAvatarSample().write();
    case SampleKind::kMotion:
      return MotionSample().write();
    case SampleKind::kPopulation:
      return PopulationSample(DifferenceCoding::kInt8).write();
    case SampleKind::kHalfPopulation:
      return PopulationSample(DifferenceCoding::kHalf).write();
    case SampleKind::kStaticPopulation:
      return StaticPopulationSample().write();
    case SampleKind::kSampler:
      return SamplerSample().write();
    case SampleKind::kStaticSampler:
      return StaticSamplerSample().write();
    case SampleKind::kStaticAvatar:
      return StaticAvatarSample().write();
    case SampleKind::kStaticOnlyAvatar:
      return StaticOnlyAvatarSample().write();
    case SampleKind::kFilteredAvatar:
      return FilteredAvatarSample().write();
    case SampleKind::kKnownPosesAvatar:
      return KnownPosesAvatarSample().write();
  }
  return Status(StatusCode::kInvalidArgument, "no such sample");
}

SamplerSample::SamplerSample() {
  const FixedPointAvatarSample avatar;
  const Avatar& from = avatar.avatar;
  sampler.kind() = from.kind();
  sampler.name = "sample sampler";
  sampler.shape_count = 2;
  sampler.map_statistics = from.map_statistics;
  sampler.decoding = from.decoding;
  sampler.values = from.fixed_point.values;
  const std::vector<size_t> tokens = sampler_token_sizes(sampler);
  for (size_t token = 0; token < tokens.size(); ++token) {
    const auto rank = static_cast<uint32_t>(token % 2 + 1);
    sampler.ranks.push_back(rank);
    for (size_t k = 0; k < rank * tokens[token]; ++k)
      directions.push_back(static_cast<int8_t>(int(k * 29 + token) % 255 - 127));
    for (uint32_t k = 0; k < rank; ++k)
      direction_scale.push_back(token == 3 && k == 1 ? 0
                                                     : 0x1p-12f * static_cast<float>(token + 1));
    for (size_t i = 0; i < tokens[token]; ++i) mean.push_back(pattern(i + token));
  }
  sampler.denoiser = {.d_model = 8, .blocks = 2, .heads = 2, .feed_forward = 12};
  fill_denoiser(tokens.size());
  norm = patterned(size_t{2 * sampler.denoiser.blocks + 1} * 2 * sampler.denoiser.d_model);
  pose_mean = avatar.pose_mean;
  pose_covariance = avatar.pose_covariance;
  golden_rotations = avatar.golden_rotations;
  report =
      "{\n  \"command\": \"sample\",\n  \"held_out\": {\"psnr_pose_db\": [21.25, 20.5], \"name\": "
      "\"m\xC3\xBCller\"}\n}\n";
  sampler.mean = mean;
  sampler.directions = directions;
  sampler.direction_scale = direction_scale;
  sampler.matrices = matrices;
  sampler.row_scale = row_scale;
  sampler.bias = bias;
  sampler.position = position;
  sampler.norm = norm;
  sampler.pose_statistics = {.joints = from.pose_statistics.joints,
                             .mean = pose_mean,
                             .covariance = pose_covariance,
                             .distances = {}};
  sampler.golden = from.golden;  // its picture and its hash are an avatar's
  sampler.golden.rotations = golden_rotations;
  sampler.golden.png = {};
  sampler.golden.fixed_point_hash = {0, 0};
  sampler.golden.fixed_point_library.clear();
  sampler.noise = {.dimension = direction_scale.size(),
                   .noisy_dimension_snr = 0.125,
                   .decided_dimension_snr = 128,
                   .clean_snr = 8192,
                   .band_share = 0.75};
  sampler.steps = 16;
  sampler.method = SolverMethod::kDpmSolverPlusPlus2M;
  sampler.golden_seeds = {{.seed = 7,
                           .steps = 16,
                           .method = SolverMethod::kDpmSolverPlusPlus2M,
                           .hash = {0x0102030405060708u, 0x1112131415161718u}},
                          {.seed = 0xFFFFFFFFFFFFFFFFu,
                           .steps = 1000,
                           .method = SolverMethod::kDdim,
                           .hash = {0x2122232425262728u, 0x3132333435363738u}}};
  sampler.population_hash = {0x4142434445464748u, 0x5152535455565758u};
  sampler.report = report;
  budget = avatar.budget;
}

MotionSample::MotionSample() {
  root_translation = patterned(3 * 3);
  for (uint32_t frame = 0; frame < 3; ++frame) {
    const float poses[8] = {1, 0, 0, 0, 0.5f, frame == 1 ? -0.5f : 0.5f, 0.5f, 0.5f};
    rotations.insert(rotations.end(), poses, poses + 8);
  }
  motion = {.name = "sample motion",
            .frames_per_second = 30,
            .joint_names = {"pelvis", "spine1"},
            .frame_count = 3,
            .root_translation_m = root_translation,
            .rotations = rotations};
}

void SamplerSample::fill_denoiser(size_t tokens) {
  size_t rows = 0;
  for (const MatrixShape& matrix : denoiser_matrices(sampler.denoiser, sampler.ranks)) {
    for (size_t k = 0; k < size_t{matrix.rows} * matrix.columns; ++k)
      matrices.push_back(static_cast<int8_t>(int(k * 53 + rows) % 255 - 127));
    rows += matrix.rows;
  }
  for (size_t n = 0; n < rows; ++n) row_scale.push_back(0x1p-10f * static_cast<float>(n % 3 + 1));
  bias = patterned(rows);
  position = patterned((tokens + 1) * sampler.denoiser.d_model);
}

StaticSamplerSample::StaticSamplerSample() : geometry_row{1, 0}, colour_row{4, 0, 3, 1, 2} {
  network.with_floats();
  sampler.name = "sample sampler of static parts";
  sampler.network = network.avatar.network;
  sampler.fixed_point = network.avatar.fixed_point;
  sampler.shares_network = true;
  sampler.uv_size = 8;
  sampler.antialiased = true;
  for (uint32_t c = 0; c < kStaticColour; ++c)
    geometry_scale.push_back(0.00390625f * static_cast<float>(c + 1));
  colour_scale = {0.0078125f, 0.015625f, 0.00390625f};
  sampler.static_groups = {{0, kStaticColour, 2, geometry_scale, geometry_row, {1, 1}},
                           {kStaticColour, 3, 8, colour_scale, colour_row, {3, 2}}};
  fill_space();
}

void StaticSamplerSample::fill_space() {
  const std::vector<size_t> tokens = sampler_token_sizes(sampler);
  sampler.ranks.clear();
  for (std::vector<float>* values : {&mean, &direction_scale, &row_scale, &bias, &position})
    values->clear();
  directions.clear(), matrices.clear();
  for (size_t token = 0; token < tokens.size(); ++token) {
    const auto rank = static_cast<uint32_t>(token % 2 + 1);
    sampler.ranks.push_back(rank);
    for (size_t k = 0; k < rank * tokens[token]; ++k)
      directions.push_back(static_cast<int8_t>(int(k * 29 + token) % 255 - 127));
    for (uint32_t k = 0; k < rank; ++k)
      direction_scale.push_back(0x1p-10f * static_cast<float>(token + 1));
    for (size_t i = 0; i < tokens[token]; ++i) mean.push_back(pattern(i + token));
  }
  fill_denoiser(tokens.size());
  sampler.mean = mean;
  sampler.directions = directions;
  sampler.direction_scale = direction_scale;
  sampler.matrices = matrices;
  sampler.row_scale = row_scale;
  sampler.bias = bias;
  sampler.position = position;
  sampler.noise.dimension = direction_scale.size();
}

}  // namespace figurine::samples
