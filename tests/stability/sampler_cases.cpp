// The device's sampler beyond what a trained one is: any seed, any number of steps, denoisers that
// blow up, vanish or saturate.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>

#include "figurine/avatar_sampler.h"
#include "figurine/package.h"
#include "runtime/sample/random_sampler.h"
#include "runtime/src/sample/device_transformer.h"
#include "runtime/src/sample/weight_decoder.h"
#include "tests/stability/rows.h"
#include "tests/stability/scene.h"

namespace figurine::stability {

namespace sampler {
namespace {

using tests::RandomSampler;

struct Outcome {
  Status status;
  size_t not_finite = 0;
  bool is_sound = false;  // in fixed point
};

Outcome sample(const Sampler& sampler, const SampleRequest& request) {
  SampledAvatar person;
  Outcome outcome{AvatarSampler::create(sampler).value()->sample(request, person), 0, false};
  if (!outcome.status.ok()) return outcome;
  const Avatar& avatar = person.avatar();
  for (const Layer& layer : avatar.network.layers)
    outcome.not_finite += count_not_finite(layer.weights) + count_not_finite(layer.bias);
  outcome.is_sound = validate_fixed_point(avatar.network, avatar.fixed_point).ok();
  return outcome;
}

// Requests that must give an avatar: how many gave none, a value that is not finite, or unsound
// integers.
size_t failures(const Sampler& sampler, std::span<const SampleRequest> requests) {
  size_t failed = 0;
  for (const SampleRequest& request : requests) {
    const Outcome outcome = sample(sampler, request);
    failed += outcome.status.ok() && outcome.not_finite == 0 && outcome.is_sound ? 0 : 1;
  }
  return failed;
}

Rows every_request() {
  const RandomSampler sampler;
  std::vector<SampleRequest> seeds, steps, mixes;
  for (const uint64_t seed :
       {uint64_t{0}, uint64_t{1}, uint64_t{1} << 32, std::numeric_limits<uint64_t>::max()})
    seeds.push_back({.seed = seed});
  for (const SolverMethod method : {SolverMethod::kDdim, SolverMethod::kDpmSolverPlusPlus2M}) {
    for (const uint32_t count : {1u, 2u, 3u, 250u, 1000u})
      steps.push_back({.seed = 1, .steps = count, .method = method});
  }
  for (const double mix : {0.0, 1e-300, 0.5, std::nextafter(1.0, 0.0), 1.0})
    mixes.push_back({.seed = 1, .to = 2, .mix = mix});
  return {{"a sampler of random numbers, seeds 0 to 2^64 - 1", "avatars that fail", Bound::kAtMost,
           0, double(failures(sampler.view, seeds))},
          {"1 to 1000 evaluations, both solvers", "avatars that fail", Bound::kAtMost, 0,
           double(failures(sampler.view, steps))},
          {"mixes of two seeds from 0 to 1", "avatars that fail", Bound::kAtMost, 0,
           double(failures(sampler.view, mixes))}};
}

// Matrices a thousand times too large, far too small, and of nothing: the norms hold what lies
// between, and fixed point what comes out.
Rows denoisers_out_of_scale() {
  Rows rows;
  for (const float contrast : {0.0f, 1e-20f, 1e-6f, 1e3f}) {
    tests::RandomSamplerShape shape;
    shape.contrast = std::max(contrast, std::numeric_limits<float>::min() * 1e5f);
    RandomSampler sampler(shape);
    if (contrast == 0) std::fill(sampler.matrices.begin(), sampler.matrices.end(), int8_t{0});
    const SampleRequest request{.seed = 1};
    char name[96];
    std::snprintf(name, sizeof(name), "a denoiser whose matrices are %g of their size",
                  static_cast<double>(contrast));
    rows.push_back({name, "avatars that fail", Bound::kAtMost, 0,
                    double(failures(sampler.view, {&request, 1}))});
  }
  return rows;
}

// What cannot be a network in fixed point is an error in one line, never an avatar of NaN. A
// package's own floats end at 1e6.
Rows denoisers_that_overflow() {
  size_t accepted = 0;
  for (const float scale : {1e6f, 1e30f, 3e38f}) {
    RandomSampler sampler;
    std::fill(sampler.row_scale.begin(), sampler.row_scale.end(), scale);
    const Outcome outcome = sample(sampler.view, {.seed = 1});
    accepted += outcome.status.ok() && (outcome.not_finite > 0 || !outcome.is_sound) ? 1 : 0;
  }
  return {{"a denoiser whose sums are beyond fixed point, or overflow float", "unsound avatars",
           Bound::kAtMost, 0, double(accepted)}};
}

// The step of an int16 activation against the largest of its row, with one value a thousand times
// the others.
Rows outliers_among_activations() {
  tests::RandomSamplerShape shape;
  shape.denoiser = {.d_model = 64, .blocks = 2, .heads = 4, .feed_forward = 1024};
  RandomSampler plain(shape), spiked(shape);
  for (size_t k = 0; k < spiked.position.size(); k += 64) spiked.position[k] = 100;
  Rows rows;
  const size_t size = plain.direction_scale.size();
  std::vector<float> z(size), a(size), b(size);
  for (const RandomSampler* sampler : {&plain, &spiked}) {
    const auto transformer = DeviceTransformer::create(sampler->view).value();
    fill_normal(1, 0, z);
    transformer->predict(z, 0, a);
    for (float& value : z) value *= 1 + 1e-6f;  // below every rounding
    transformer->predict(z, 0, b);
    double error = 0, power = 0;
    for (size_t k = 0; k < size; ++k) error += std::pow(a[k] - b[k], 2), power += std::pow(a[k], 2);
    rows.push_back({sampler == &plain ? "tokens as they come"
                                      : "tokens with one value a thousand times the others",
                    "relative change of the prediction for a millionth of the input",
                    Bound::kAtMost, 1e-2, std::sqrt(error / power)});
  }
  return rows;
}

// A map whose sampled values lie far outside of what training members have, or are next to nothing,
// in scales from the smallest to huge: integers stay within 127 of either sign, where clamped and
// rounded doubles would be, and a value of nothing is nothing.
Rows maps_of_extreme_values() {
  constexpr float kValues[] = {0,     -0.0f, 1e-45f, -1e-38f, 1e-6f, 0.5f,
                               -1.0f, 127,   -1e4f,  3e38f,   -3e38f};
  const std::vector<float> scales{std::numeric_limits<float>::min(), 1e-6f, 0.01f, 1e30f};
  const std::vector<uint32_t> row{2, 0, 1};
  Sampler sampler;
  sampler.static_groups.push_back({.first_channel = 0,
                                   .channels = static_cast<uint32_t>(scales.size()),
                                   .grid_size = 2,
                                   .scale = scales,
                                   .row = row,
                                   .patch_rows = {2, 1}});
  size_t outside = 0, wrong = 0, misplaced = 0;
  std::vector<int8_t> integers;
  for (const float value : kValues) {
    const std::vector<float> patches(row.size() * scales.size(), value);
    const StaticPart part = decode_static_part(sampler, patches, integers);
    for (size_t i = 0; i < integers.size(); ++i) {
      const double exact = double{value} / double{scales[i % scales.size()]};
      outside += std::abs(int{integers[i]}) > 127;
      wrong += std::abs(std::clamp(exact, -127.0, 127.0) - integers[i]) > 0.5 + 1e-5;
    }
    misplaced += part.groups[0].values.size() != integers.size();
  }
  // Every cell where its row says: patches count up, one value a cell.
  std::vector<float> counted;
  for (size_t k = 0; k < row.size(); ++k) counted.insert(counted.end(), scales.size(), 0.01f * k);
  decode_static_part(sampler, counted, integers);
  for (size_t k = 0; k < row.size(); ++k)
    misplaced += integers[size_t{row[k]} * scales.size() + 2] != static_cast<int>(k);
  return {{"maps of values from 1e-45 to 3e38", "integers outside of 127 of either sign",
           Bound::kAtMost, 0, double(outside)},
          {"maps of values from 1e-45 to 3e38", "integers that are not the nearest within range",
           Bound::kAtMost, 0, double(wrong)},
          {"maps of values from 1e-45 to 3e38", "cells elsewhere than their row says",
           Bound::kAtMost, 0, double(misplaced)}};
}

constexpr Case kCases[] = {{"SamplerRequests", every_request},
                           {"SamplerOutOfScale", denoisers_out_of_scale},
                           {"SamplerOverflow", denoisers_that_overflow},
                           {"SamplerOutliers", outliers_among_activations},
                           {"SampledMaps", maps_of_extreme_values}};

}  // namespace
}  // namespace sampler

std::span<const Case> sampler_cases() { return sampler::kCases; }

}  // namespace figurine::stability
