// figurine_model_bench [THREADS [ROUNDS [bf16|f32 [T_n]]]]: milliseconds of every part of a
// training iteration at T = 128 with static values, network at T_n (128) (medians of interleaved
// rounds). Not a test.
#include <time.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <random>
#include <string>
#include <vector>

#include "tests/toolchain/model/synthetic_body.h"
#include "toolchain/model/allocator.h"
#include "toolchain/model/compose.h"
#include "toolchain/model/head.h"
#include "toolchain/model/loss.h"
#include "toolchain/model/optimiser.h"
#include "toolchain/model/render.h"
#include "toolchain/model/splatter.h"
#include "toolchain/model/ssim.h"
#include "toolchain/model/unet.h"
#include "toolchain/tensor_operations.h"

namespace {

using namespace figurine;
using namespace figurine::model;

double now_ms() {
  return std::chrono::duration<double, std::milli>(
             std::chrono::steady_clock::now().time_since_epoch())
      .count();
}

// Of all threads of the process: on a busy machine with one thread the only figure that means
// something.
double cpu_ms() {
  timespec t;
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
  return 1e3 * static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_nsec);
}

struct Row {
  std::string name;
  std::function<void()> run;
  std::vector<double> ms, cpu;
};

}  // namespace

int main(int argc, char** argv) {
  const uint32_t threads = argc > 1 ? static_cast<uint32_t>(std::atoi(argv[1])) : 2;
  const int rounds = argc > 2 ? std::atoi(argv[2]) : 30;
  const uint32_t size = argc > 4 ? static_cast<uint32_t>(std::atoi(argv[4])) : 128;
  keep_freed_memory();
  const testing::SyntheticBody capsule(128, 77);
  const std::vector<Affine> transforms = capsule.bent();
  Camera camera = *make_orbit_camera({.azimuth_deg = 20,
                                      .elevation_deg = 5,
                                      .distance_m = 3,
                                      .vertical_fov_deg = 34,
                                      .target_m = {0, 0.87f, 0}},
                                     512, 512);
  const HeadFrame frame{.body = &capsule.body,
                        .texel_position_m = capsule.position,
                        .world_from_rest = transforms,
                        .decoding = {}};
  std::mt19937 random(1);
  std::normal_distribution<float> normal;
  const HeadLayout layout{
      .network_size = size, .channels = head_channels(0), .statics = {{0, 14, 128}}};
  const HeadComposer composer(capsule.body, layout);
  std::vector<float> head(size_t(composer.texel_count()) * 14), head_gradient(head.size()),
      statics(composer.static_count()), static_gradient(statics.size()),
      network(size_t(size) * size * 14, 0.1f), network_gradient(network.size());
  for (float& value : head) value = 0.3f * normal(random);
  const PixelRect crop{0, 0, 512, 512};
  std::vector<float> image(4 * 512 * 512), image_gradient(image.size());
  for (float& value : image_gradient) value = normal(random);
  GaussianBuffer<float> gaussians, gradients;
  gradients.resize(capsule.body.texel_count(), 0);
  Splatter<float> splatter({.threads = threads});
  torch::set_num_threads(static_cast<int>(threads));
  const bool bf16 = argc <= 3 || std::string(argv[3]) == "bf16";
  PoseUNet unet(
      make_pose_unet(size, 26, 32, head_channels(0)),
      {.precision = bf16 ? model::Precision::kBfloat16 : model::Precision::kFloat32, .seed = 1});
  Optimiser adamw(adamw_group(unet.parameter_count()), {}), muon(unet.muon_groups(), {});
  AvatarRenderer renderer({.threads = threads});
  const torch::Tensor input = torch::randn({size, size, 26}),
                      head_weights = torch::randn({size, size, 14});
  torch::Tensor unet_head;
  SsimScratch<float> scratch;
  std::vector<float> ssim_gradient(3 * 512 * 512), other(3 * 512 * 512, 0.4f);
  const torch::Tensor target = torch::rand({4, 512, 512});
  LossTerms terms;
  const LossOptions loss_options{.threads = threads};
  const auto iterate = [&] {
    unet.zero_gradients();
    const torch::Tensor output = unet.forward(input);
    torch::Tensor rows = torch::empty({composer.texel_count(), 14});
    composer.forward(output.const_data_ptr<float>(), statics.data(), threads,
                     rows.mutable_data_ptr<float>());
    rows.requires_grad_();
    const torch::Tensor picture = renderer.render(rows, frame, {camera, crop});
    image_loss(picture, target, {0.5f, 0.5f, 0.5f}, loss_options, &terms).backward();
    torch::Tensor gradient = torch::empty_like(output);
    composer.backward(output.const_data_ptr<float>(), statics.data(),
                      rows.grad().const_data_ptr<float>(), threads,
                      gradient.mutable_data_ptr<float>(), static_gradient.data());
    output.backward(gradient);
    adamw.step(unet.weights(), unet.gradients(), 1e-4);
  };
  std::vector<Row> rows{
      {"compose",
       [&] { composer.forward(network.data(), statics.data(), threads, head.data()); },
       {},
       {}},
      {"compose backward",
       [&] {
         composer.backward(network.data(), statics.data(), head_gradient.data(), threads,
                           network_gradient.data(), static_gradient.data());
       },
       {},
       {}},
      {"decode", [&] { decode_head(frame, head.data(), threads, gaussians); }, {}, {}},
      {"splat forward",
       [&] { splatter.forward(gaussians.view(), camera, crop, image.data()); },
       {},
       {}},
      {"splat backward",
       [&] { splatter.backward(image.data(), image_gradient.data(), gradients.gradients()); },
       {},
       {}},
      {"decode backward",
       [&] { decode_head_backward(frame, head.data(), gradients, threads, head_gradient.data()); },
       {},
       {}},
      {"SSIM, both ways",
       [&] {
         ssim<float>({image.data(), other.data(), 3, 512, 512}, threads, scratch,
                     ssim_gradient.data());
       },
       {},
       {}},
      {"whole loss",
       [&] {
         image_loss(torch::from_blob(image.data(), {4, 512, 512}), target, {0.5f, 0.5f, 0.5f},
                    loss_options, &terms);
       },
       {},
       {}},
      {"UNet forward", [&] { unet_head = unet.forward(input); }, {}, {}},
      {"UNet backward", [&] { unet.zero_gradients(), unet_head.backward(head_weights); }, {}, {}},
      {"AdamW", [&] { adamw.step(unet.weights(), unet.gradients(), 1e-5); }, {}, {}},
      {"Muon", [&] { muon.step(unet.weights(), unet.gradients(), 1e-5); }, {}, {}},
      {"whole iteration", iterate, {}, {}},
  };
  for (int round = 0; round < rounds; ++round) {
    for (Row& row : rows) {
      const double start = now_ms(), start_cpu = cpu_ms();
      row.run();
      row.ms.push_back(now_ms() - start);
      row.cpu.push_back(cpu_ms() - start_cpu);
    }
  }
  const SplatterStatistics& statistics = splatter.statistics();
  std::printf("%u threads, %u Gaussians, %llu visible, %llu pairs, %llu blocks\n", threads,
              gaussians.count, static_cast<unsigned long long>(statistics.visible),
              static_cast<unsigned long long>(statistics.pairs),
              static_cast<unsigned long long>(statistics.blocks));
  for (Row& row : rows) {
    std::sort(row.ms.begin(), row.ms.end());
    std::sort(row.cpu.begin(), row.cpu.end());
    std::printf("%-18s %8.3f ms (best %.3f), CPU %8.3f ms (best %.3f)\n", row.name.c_str(),
                row.ms[row.ms.size() / 2], row.ms.front(), row.cpu[row.cpu.size() / 2],
                row.cpu.front());
  }
  return 0;
}
