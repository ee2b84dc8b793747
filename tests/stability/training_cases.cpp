// Training where gradients explode, vanish or have nothing to say: what is learnt is finite, what
// cannot be learnt from is refused in a line. Only where the toolchain is built.
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "ports/media/png.h"
#include "tests/stability/scene.h"
#include "tests/toolchain/train/small_capture.h"
#include "toolchain/model/head.h"
#include "toolchain/model/splatter.h"
#include "toolchain/train/run_directory.h"
#include "toolchain/train/tensor_file.h"
#include "toolchain/train/trainer.h"

namespace figurine::stability {
namespace training {
namespace {

namespace fs = std::filesystem;

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
constexpr float kInfinity = std::numeric_limits<float>::infinity();

template <class Scalar>
model::GaussianBuffer<Scalar> to_buffer(const GaussianSet& set) {
  model::GaussianBuffer<Scalar> buffer;
  buffer.resize(set.count(), set.sh_degree);
  std::copy(set.position_m.begin(), set.position_m.end(), buffer.position_m.begin());
  std::copy(set.covariance_factor.begin(), set.covariance_factor.end(),
            buffer.covariance_factor.begin());
  std::copy(set.opacity.begin(), set.opacity.end(), buffer.opacity.begin());
  std::copy(set.sh.begin(), set.sh.end(), buffer.sh.begin());
  return buffer;
}

// Gradients of the sum of all colours and of alpha, each weighted by a wave over the picture, or of
// alpha alone.
template <class Scalar>
model::GaussianBuffer<Scalar> gradients_of(const GaussianSet& set, const Camera& camera,
                                           bool antialiased, bool of_alpha_alone = false) {
  const model::GaussianBuffer<Scalar> gaussians = to_buffer<Scalar>(set);
  const model::PixelRect crop{0, 0, camera.width_px, camera.height_px};
  const size_t pixels = size_t(crop.width) * crop.height;
  model::Splatter<Scalar> splatter({.threads = 1, .antialiased = antialiased});
  std::vector<Scalar> image(4 * pixels), weights(4 * pixels);
  for (size_t i = 0; i < weights.size(); ++i)
    weights[i] = of_alpha_alone ? Scalar(i >= 3 * pixels) : Scalar(std::sin(0.37 * double(i)));
  splatter.forward(gaussians.view(), camera, crop, image.data());
  model::GaussianBuffer<Scalar> gradients;
  gradients.resize(gaussians.count, gaussians.sh_degree);
  splatter.backward(image.data(), weights.data(), gradients.gradients());
  return gradients;
}

template <class Scalar>
std::vector<double> all_of(const model::GaussianBuffer<Scalar>& buffer) {
  std::vector<double> all;
  for (const std::vector<Scalar>* part :
       {&buffer.position_m, &buffer.covariance_factor, &buffer.opacity, &buffer.sh})
    all.insert(all.end(), part->begin(), part->end());
  return all;
}

double count_not_finite(const std::vector<double>& values) {
  return double(std::count_if(values.begin(), values.end(),
                              [](double value) { return !std::isfinite(value); }));
}

// Distance of the float gradients of one kind from the double ones, in shares of their length.
template <class Values, class True>
double share_lost(const Values& values, const True& truth) {
  double distance = 0, length = 0;
  for (size_t i = 0; i < truth.size(); ++i) {
    distance += (values[i] - truth[i]) * (values[i] - truth[i]);
    length += truth[i] * truth[i];
  }
  return length == 0 ? std::sqrt(distance) : std::sqrt(distance / length);
}

void add_gradients(Rows& rows, const std::string& name, const GaussianSet& set, double limit,
                   bool antialiased = false) {
  const Camera camera = front_camera(96);
  const auto single = gradients_of<float>(set, camera, antialiased);
  rows.push_back(
      {name, "gradients that are not finite", Bound::kAtMost, 0, count_not_finite(all_of(single))});
  const auto exact = gradients_of<double>(set, camera, antialiased);
  rows.push_back(
      {name, "distance of the gradients from float64, share of their length, worst kind",
       Bound::kAtMost, limit,
       std::max({share_lost(single.position_m, exact.position_m),
                 share_lost(single.covariance_factor, exact.covariance_factor),
                 share_lost(single.opacity, exact.opacity), share_lost(single.sh, exact.sh)})});
}

Rows gradients_of_degenerate_gaussians() {
  Rows rows;
  const auto cloud = [](const Vector& scale_m, uint32_t count = 400) {
    return make_cloud({.count = count, .scale_m = scale_m});
  };
  add_gradients(rows, "training: discs of thickness 0", cloud({0.05f, 0.05f, 0}), 1e-3);
  add_gradients(rows, "training: points of extent 0", cloud({0, 0, 0}), 1e-3);
  add_gradients(rows, "training: needles of 5 m by 5 nm", cloud({5, 5e-9f, 5e-9f}), 1e-3);
  // Even layers: what is left of their edges is the difference of large sums over the picture.
  add_gradients(rows, "training: Gaussians of 1,000 km", cloud({1e6f, 1e6f, 1e6f}, 20), 5e-2);
  add_gradients(rows, "training, antialiased: Gaussians of a tenth of a pixel",
                cloud({0.002f, 0.002f, 0.0006f}), 1e-3, true);
  add_gradients(rows, "training, antialiased: points, lines and discs", cloud({0.05f, 0, 0}), 1e-3,
                true);
  GaussianSet broken = cloud({0.03f, 0.03f, 0.01f});
  for (size_t i = 0; i < broken.position_m.size(); i += 7)
    broken.position_m[i] = i % 2 == 0 ? kNan : kInfinity;
  for (size_t i = 0; i < broken.opacity.size(); i += 5) broken.opacity[i] = kNan;
  const std::vector<double> all = all_of(gradients_of<float>(broken, front_camera(96), false));
  rows.push_back({"training: NaN and infinity among sound Gaussians",
                  "gradients that are not finite", Bound::kAtMost, 0, count_not_finite(all)});
  return rows;
}

// Two layers that cover every pixel evenly, the first in front: alpha is 1 - (1 - a)(1 - b), so
// that its sum over P pixels changes by P (1 - b) and by P (1 - a).
Rows gradients_of_layers() {
  const float a = 0.3f, b = 0.6f;
  GaussianSet layers;
  layers.add({0, 0, 0.2f}, factor_of({1, 0, 0, 0}, {1e4f, 1e4f, 1e-3f}), a, {1, 1, 1});
  layers.add({0, 0, -0.2f}, factor_of({1, 0, 0, 0}, {1e4f, 1e4f, 1e-3f}), b, {1, 1, 1});
  const Camera camera = front_camera(96);
  const auto gradients = gradients_of<float>(layers, camera, false, true);
  const double pixels = double(camera.width_px) * camera.height_px;
  const double wanted[2] = {pixels * (1 - double(b)), pixels * (1 - double(a))};
  double error = 0;
  for (size_t i = 0; i < 2; ++i)
    error = std::max(error, std::abs(gradients.opacity[i] - wanted[i]) / wanted[i]);
  Rows rows{{"training: two even layers", "relative error of dL/dopacity from the closed form",
             Bound::kAtMost, 1e-5, error}};
  // A hundred opaque ones: no light is left, and no gradient divides by it.
  GaussianSet opaque;
  for (int i = 0; i < 100; ++i) {
    opaque.add({0, 0, -0.01f * float(i)}, factor_of({1, 0, 0, 0}, {1e4f, 1e4f, 1e-3f}), 1,
               {1, 1, 1});
  }
  rows.push_back({"training: 100 layers of opacity 1", "gradients that are not finite",
                  Bound::kAtMost, 0,
                  count_not_finite(all_of(gradients_of<float>(opaque, camera, false)))});
  return rows;
}

// How a training ends, and whether all that it left can be used.
struct End {
  bool refused = false;
  size_t not_finite = 0;  // files that hold a value that is none, or cannot be read
  bool usable = false;    // it ended with weights and a PSNR that is a number
};

End train(const testing_tools::SmallCapture& capture, const std::string& data,
          const std::string& run, const std::function<void(train::TrainSettings&)>& change = {}) {
  train::TrainRequest request{.data = data,
                              .body = capture.body,
                              .run = run,
                              .settings = train::preset_settings("nano"),
                              .quiet = true};
  request.settings.schedule.budget = {.iterations = 20, .seconds = 0};
  request.settings.threads = 1;
  request.settings.network_size = 16;
  request.settings.static_grids = train::parse_static_grids("all:T", "stability");
  if (change) change(request.settings);
  End end;
  try {
    end.usable = std::isfinite(train::train_avatar(request).psnr_db) &&
                 fs::exists(train::RunDirectory{run}.weights());
  } catch (const InputError&) {
    end.refused = true;
  }
  for (const std::string& file :
       {train::RunDirectory{run}.weights(), train::RunDirectory{run}.checkpoint()}) {
    if (!fs::exists(file)) continue;
    try {
      (void)train::read_tensor_file(file);
    } catch (const InputError&) {
      ++end.not_finite;
    }
  }
  return end;
}

Rows exploding_steps() {
  const testing_tools::SmallCapture& capture = testing_tools::small_capture();
  size_t not_finite = 0, ended = 0;
  const double rates[] = {1, 1e3, 1e30};
  for (const double rate : rates) {
    for (const double clip : {0.0, 1.0}) {
      const std::string run = capture.folder.path("rate_" + std::to_string(ended));
      const End end = train(capture, capture.data, run, [&](train::TrainSettings& settings) {
        settings.schedule.peak = rate;
        settings.static_learning_rate = rate;
        settings.clip_gradient = clip;
      });
      not_finite += end.not_finite + (!end.refused && !end.usable);
      ++ended;
    }
  }
  return {{"training: learning rates of 1 to 1e30", "neither refused nor finite", Bound::kAtMost, 0,
           double(not_finite)}};
}

// One image of one pose: inputs do not vary at all, and a picture can be learnt.
Rows one_image() {
  const testing_tools::SmallCapture& capture = testing_tools::small_capture();
  const train::PackageFile body = train::open_package(capture.body, PackageKind::kBody);
  const std::string folder = capture.folder.path("one");
  const std::vector<ports::MotionClip> still = {testing_tools::SmallCapture::swinging_clip(1)};
  Rows rows;
  const auto end_of = [&](uint32_t frames, uint32_t views, const std::string& name) {
    capture::capture_identities({.output = folder + name,
                                 .seed = 5,
                                 .frames = frames,
                                 .cameras = {.views = views, .width_px = 96, .height_px = 96},
                                 .tool = "stability",
                                 .sources = {"still: made by the test"}},
                                body.package, still, nullptr);
    return train(capture, folder + name + "/" + capture::identity_name(0), folder + name + "_run");
  };
  const End one = end_of(1, 1, "_image");
  rows.push_back({"training: one image", "neither refused nor finite", Bound::kAtMost, 0,
                  double(one.not_finite + (!one.refused && !one.usable))});
  const End pose = end_of(1, 8, "_pose");
  rows.push_back({"training: one pose, so that no input varies", "neither refused nor finite",
                  Bound::kAtMost, 0, double(pose.not_finite + (!pose.refused && !pose.usable))});
  return rows;
}

Rows blank_masks() {
  const testing_tools::SmallCapture& capture = testing_tools::small_capture();
  const std::string data = capture.folder.path("blank");
  fs::copy(capture.data, data, fs::copy_options::recursive);
  for (const fs::directory_entry& entry : fs::recursive_directory_iterator(data)) {
    if (entry.path().string().find("fmask") == std::string::npos || !entry.is_regular_file())
      continue;
    const std::string path = entry.path().string();
    const ports::MappedFile bytes = value_or_throw(ports::MappedFile::open(path), path);
    ports::ImageU8 mask = value_or_throw(ports::decode_png(bytes.bytes(), path), path);
    std::fill(mask.pixels.begin(), mask.pixels.end(), uint8_t{0});
    throw_if_error(
        ports::write_file_atomically(path, value_or_throw(ports::encode_png(mask), path)), path);
  }
  const End end = train(capture, data, capture.folder.path("blank_run"));
  return {{"training: masks that are blank", "trainings not refused", Bound::kAtMost, 0,
           double(!end.refused)}};
}

}  // namespace
}  // namespace training

std::span<const Case> training_cases() {
  static const Case kCases[] = {
      {"GradientsOfDegenerateGaussians", training::gradients_of_degenerate_gaussians},
      {"GradientsOfLayers", training::gradients_of_layers},
      {"ExplodingSteps", training::exploding_steps},
      {"OneImage", training::one_image},
      {"BlankMasks", training::blank_masks}};
  return kCases;
}

}  // namespace figurine::stability
