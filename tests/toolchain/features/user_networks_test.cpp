// Networks that the user brings, on random weights: what LPIPS and Inception features come out is
// what loops written down from their definitions give; what a file lacks is said in one line.
#include "toolchain/features/user_networks.h"

#include <gtest/gtest.h>
#include <torch/script.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>

#include "people.h"
#include "rectangles.h"
#include "toolchain/body/test_files.h"
#include "toolchain/model/perceptual.h"
#include "toolchain/tensor_operations.h"

namespace figurine::features::user_networks_test {

using measure::RowMatrix;

namespace {

using test::input_error;
using test::rectangles;
using Values = std::vector<double>;

// An image of the loops below: [C,H,W].
struct Planes {
  size_t channels = 0, height = 0, width = 0;
  Values values;
  double at(size_t c, size_t y, size_t x) const { return values[(c * height + y) * width + x]; }
};

Planes planes_of(const RgbView& picture) {
  return {3, picture.height_px, picture.width_px, {picture.values.begin(), picture.values.end()}};
}

// weights: [out,in,k,k]. ReLU behind it.
Planes convolved(const Planes& in, const Values& weights, const Values& bias, size_t kernel,
                 size_t stride, size_t padding) {
  Planes out{bias.size(),
             (in.height + 2 * padding - kernel) / stride + 1,
             (in.width + 2 * padding - kernel) / stride + 1,
             {}};
  for (size_t o = 0; o < out.channels; ++o) {
    for (size_t y = 0; y < out.height; ++y) {
      for (size_t x = 0; x < out.width; ++x) {
        double sum = bias[o];
        for (size_t c = 0; c < in.channels; ++c) {
          for (size_t j = 0; j < kernel; ++j) {
            for (size_t i = 0; i < kernel; ++i) {
              const size_t v = y * stride + j, u = x * stride + i;
              if (v < padding || u < padding || v - padding >= in.height || u - padding >= in.width)
                continue;
              sum += weights[((o * in.channels + c) * kernel + j) * kernel + i] *
                     in.at(c, v - padding, u - padding);
            }
          }
        }
        out.values.push_back(std::max(0.0, sum));
      }
    }
  }
  return out;
}

Planes pooled(const Planes& in) {
  Planes out{in.channels, (in.height - 3) / 2 + 1, (in.width - 3) / 2 + 1, {}};
  for (size_t c = 0; c < out.channels; ++c) {
    for (size_t y = 0; y < out.height; ++y) {
      for (size_t x = 0; x < out.width; ++x) {
        double greatest = -1e30;
        for (size_t k = 0; k < 9; ++k)
          greatest = std::max(greatest, in.at(c, 2 * y + k / 3, 2 * x + k % 3));
        out.values.push_back(greatest);
      }
    }
  }
  return out;
}

// The arrays of an LPIPS over AlexNet, random.
struct Arrays {
  std::map<std::string, std::vector<size_t>> shapes;
  std::map<std::string, Values> values;
};

constexpr const char* kLayers[] = {"net.slice1.0", "net.slice2.3", "net.slice3.6", "net.slice4.8",
                                   "net.slice5.10"};
constexpr size_t kIn[] = {3, 64, 192, 384, 256}, kOut[] = {64, 192, 384, 256, 256},
                 kKernel[] = {11, 5, 3, 3, 3};

const Arrays& random_arrays() {
  static const Arrays arrays = [] {
    Arrays made;
    tests::Random random(11);
    const auto add = [&](const std::string& name, const std::vector<size_t>& shape, float low,
                         float high) {
      size_t count = 1;
      for (const size_t side : shape) count *= side;
      made.shapes[name] = shape;
      for (size_t i = 0; i < count; ++i) made.values[name].push_back(random.uniform(low, high));
    };
    for (size_t l = 0; l < 5; ++l) {
      const float bound = std::sqrt(6.0f / static_cast<float>(kIn[l] * kKernel[l] * kKernel[l]));
      add(std::string(kLayers[l]) + ".weight", {kOut[l], kIn[l], kKernel[l], kKernel[l]}, -bound,
          bound);
      add(std::string(kLayers[l]) + ".bias", {kOut[l]}, -0.1f, 0.1f);
      add("lin" + std::to_string(l) + ".model.1.weight", {1, kOut[l], 1, 1}, 0, 1);
    }
    return made;
  }();
  return arrays;
}

void write_npz(const std::string& path, const Arrays& arrays) {
  std::map<std::string, std::string> files;
  for (const auto& [name, shape] : arrays.shapes)
    files[name] = body::test::npy_bytes("<f4", shape, arrays.values.at(name));
  files["scaling_layer.shift"] = body::test::npy_bytes(
      "<f4", {1, 3, 1, 1}, {-0.03, -0.088, -0.188});  // a whole state may be in it
  body::test::write_npz(path, files);
}

// A script whose parameters are named like the arrays: a module for every part of a name.
void write_script(const std::string& path, const Arrays& arrays) {
  struct Node {
    std::map<std::string, Node> children;
    std::string array;
  };
  Node root;
  for (const auto& [name, shape] : arrays.shapes) {
    Node* node = &root;
    size_t begin = 0;
    for (size_t dot = name.find('.'); dot != std::string::npos;
         begin = dot + 1, dot = name.find('.', begin)) {
      node = &node->children[name.substr(begin, dot - begin)];
    }
    node->children[name.substr(begin)].array = name;
  }
  int number = 0;
  const std::function<torch::jit::Module(const Node&)> build = [&](const Node& node) {
    torch::jit::Module module("__torch__.Part" + std::to_string(number++));
    for (const auto& [name, child] : node.children) {
      if (child.array.empty()) {
        module.register_module(name, build(child));
      } else {
        const std::vector<size_t>& shape = arrays.shapes.at(child.array);
        const torch::Tensor values =
            torch::tensor(arrays.values.at(child.array)).to(torch::kFloat32);
        module.register_parameter(
            name, values.view(std::vector<int64_t>(shape.begin(), shape.end())), false);
      }
    }
    return module;
  };
  build(root).save(path);
}

// Zhang et al., eq. 1, in double and in loops.
double lpips_of(const Arrays& arrays, const RgbView& a, const RgbView& b) {
  const double shift[] = {-0.030, -0.088, -0.188}, scale[] = {0.458, 0.448, 0.450};
  std::vector<Planes> layers[2];
  for (size_t p = 0; p < 2; ++p) {
    Planes x = planes_of(p == 0 ? a : b);
    for (size_t i = 0; i < x.values.size(); ++i) {
      const size_t c = i / (x.height * x.width);
      x.values[i] = (2 * x.values[i] - 1 - shift[c]) / scale[c];
    }
    for (size_t l = 0; l < 5; ++l) {
      if (l == 1 || l == 2) x = pooled(x);
      x = convolved(x, arrays.values.at(std::string(kLayers[l]) + ".weight"),
                    arrays.values.at(std::string(kLayers[l]) + ".bias"), kKernel[l], l == 0 ? 4 : 1,
                    l < 2 ? 2 : 1);
      layers[p].push_back(x);
    }
  }
  double distance = 0;
  for (size_t l = 0; l < 5; ++l) {
    const Planes &x = layers[0][l], &y = layers[1][l];
    const Values& w = arrays.values.at("lin" + std::to_string(l) + ".model.1.weight");
    const size_t positions = x.height * x.width;
    double sum = 0;
    for (size_t p = 0; p < positions; ++p) {
      double xx = 0, yy = 0;
      for (size_t c = 0; c < x.channels; ++c) {
        xx += x.values[c * positions + p] * x.values[c * positions + p],
            yy += y.values[c * positions + p] * y.values[c * positions + p];
      }
      for (size_t c = 0; c < x.channels; ++c) {
        const double d = x.values[c * positions + p] / (std::sqrt(xx) + 1e-10) -
                         y.values[c * positions + p] / (std::sqrt(yy) + 1e-10);
        sum += w[c] * d * d;
      }
    }
    distance += sum / static_cast<double>(positions);
  }
  return distance;
}

TEST(Lpips, IsWhatItsDefinitionGives) {
  const test::TemporaryFolder folder;
  write_npz(folder / "alex.npz", random_arrays());
  const LpipsAlex network = LpipsAlex::load(folder / "alex.npz");
  const RgbPictures pictures = rectangles(67, 51, 2, 1);
  const double expected = lpips_of(random_arrays(), pictures[0], pictures[1]),
               found = network.distance(pictures[0], pictures[1]);
  std::printf("  distance %.6f, relative error %.1e\n", found, std::abs(found / expected - 1));
  EXPECT_NEAR(found, expected, 1e-5 * expected);  // float activations against double ones
  EXPECT_EQ(network.distance(pictures[0], pictures[0]), 0);
  EXPECT_EQ(network.distance(pictures[1], pictures[0]), found);
  EXPECT_EQ(network.embed(pictures, 3), network.embed(pictures, 1));
  EXPECT_EQ(network.name(), "LPIPS (AlexNet, alex.npz)");
  EXPECT_EQ(network.describe().at("hash").get<std::string>().size(), 32u);
}

TEST(Lpips, IsTheSameFromAScript) {
  const test::TemporaryFolder folder;
  write_npz(folder / "alex.npz", random_arrays());
  write_script(folder / "alex.pt", random_arrays());
  const RgbPictures pictures = rectangles(64, 64, 2, 2);
  const double npz = LpipsAlex::load(folder / "alex.npz").distance(pictures[0], pictures[1]);
  EXPECT_EQ(open_networks({.features = "", .lpips = folder / "alex.pt", .inception = ""})
                .perceptual[0]
                ->distance(pictures[0], pictures[1]),
            npz);
}

torch::Tensor tensor_of(const RgbView& picture) {
  return torch::tensor(std::vector<float>(picture.values.begin(), picture.values.end()))
      .view({3, picture.height_px, picture.width_px});
}

TEST(Lpips, InALossHasTheValueAndTheGradientOfItsDefinition) {
  const test::TemporaryFolder folder;
  write_npz(folder / "alex.npz", random_arrays());
  const LossNetwork network = open_loss_network(folder / "alex.npz");
  EXPECT_EQ(network.name, "LPIPS (AlexNet, alex.npz)");
  EXPECT_EQ(network.hash, hash_of_file(folder / "alex.npz"));
  EXPECT_EQ(network.distance->least_side_px(), 31u);
  // With noise: where a picture is flat, a pool's values are equal, and the distance has a kink.
  RgbPictures pictures = rectangles(43, 39, 2, 1);
  tests::Random random(4);
  for (float& value : pictures.values) value += random.uniform(-0.1f, 0.1f);
  const torch::Tensor seen = tensor_of(pictures[0]).requires_grad_(),
                      truth = tensor_of(pictures[1]);
  const torch::Tensor distance = network.distance->between(seen, truth);
  const double expected = lpips_of(random_arrays(), pictures[0], pictures[1]);
  std::printf("  relative error of the value %.1e\n", distance.item<double>() / expected - 1);
  EXPECT_NEAR(distance.item<double>(), expected, 1e-5 * expected);
  distance.backward();
  const float* const gradient = seen.grad().const_data_ptr<float>();
  const double scale = seen.grad().square().mean().sqrt().item<double>();
  double worst = 0;
  int checked = 0, kinks = 0;
  for (size_t i = 100; i < 3u * 43 * 39; i += 487) {
    const float kept = pictures.values[i];
    const auto difference = [&](float h) {
      pictures.values[i] = kept + h;
      const double above = pictures.values[i],
                   up = lpips_of(random_arrays(), pictures[0], pictures[1]);
      pictures.values[i] = kept - h;
      const double below = pictures.values[i],
                   down = lpips_of(random_arrays(), pictures[0], pictures[1]);
      pictures.values[i] = kept;
      return (up - down) / (above - below);
    };
    // A kink of a ReLU or of the pooling inside a step shows as two steps that disagree.
    const double coarse = difference(1e-3f), fine = difference(2.5e-4f);
    if (std::abs(coarse - fine) > 1e-2 * (std::abs(fine) + scale)) {
      ++kinks;
      continue;
    }
    ++checked;
    worst = std::max(worst, std::abs(double(gradient[i]) - fine) / (std::abs(fine) + scale));
  }
  std::printf("  %d values, %d more on a kink, largest relative error %.1e\n", checked, kinks,
              worst);
  EXPECT_GE(checked, 5);
  EXPECT_LT(worst, 1e-3);  // of float activations, and of differences of the second order
}

TEST(Lpips, InALossPassesNothingOnWherePicturesAreEqual) {
  const test::TemporaryFolder folder;
  Arrays arrays = random_arrays();
  for (double& bias : arrays.values["net.slice5.10.bias"]) bias = -1e3;  // a layer that is dead
  write_npz(folder / "alex.npz", arrays);
  const LpipsAlex network = LpipsAlex::load(folder / "alex.npz");
  const RgbPictures pictures = rectangles(40, 40, 2, 3);
  const auto gradient = [&](size_t other) {
    const torch::Tensor seen = tensor_of(pictures[0]).requires_grad_();
    network.between(seen, tensor_of(pictures[other])).backward();
    return seen.grad();
  };
  EXPECT_EQ(gradient(0).abs().max().item<float>(), 0);
  EXPECT_TRUE(gradient(1).isfinite().all().item<bool>());
  EXPECT_GT(gradient(1).abs().max().item<float>(), 0);
}

TEST(Lpips, SaysWhatAFileLacks) {
  const test::TemporaryFolder folder;
  const auto refusal = [&](const std::string& name, const std::function<void(Arrays&)>& change) {
    Arrays arrays = random_arrays();
    change(arrays);
    const std::string path = folder / name;
    name.ends_with(".npz") ? write_npz(path, arrays) : write_script(path, arrays);
    const std::string message = input_error([&] { LpipsAlex::load(path); });
    EXPECT_TRUE(message.starts_with(path + ": ") && test::is_one_line(message)) << message;
    return message;
  };
  const auto without = [](Arrays& arrays) { arrays.shapes.erase("net.slice3.6.bias"); };
  EXPECT_NE(refusal("a.npz", without).find("net.slice3.6.bias: no such array"), std::string::npos);
  EXPECT_NE(refusal("a.pt", without).find("net.slice3.6.bias: no such parameter"),
            std::string::npos);
  const auto reshaped = [](Arrays& arrays) {
    arrays.shapes["lin4.model.1.weight"] = {256, 1, 1, 1};
  };
  EXPECT_NE(refusal("b.npz", reshaped)
                .find("lin4.model.1.weight: shape (256,1,1,1), expected (1,256,1,1)"),
            std::string::npos);
  EXPECT_NE(refusal("b.pt", reshaped)
                .find("lin4.model.1.weight: shape [256, 1, 1, 1], expected [1, 256, 1, 1]"),
            std::string::npos);
  EXPECT_NE(refusal("c.npz", [](Arrays& arrays) { arrays.values["lin0.model.1.weight"][5] = -0.5; })
                .find("negative weight"),
            std::string::npos);
  EXPECT_NE(refusal("d.npz", [](Arrays& arrays) { arrays.values["net.slice1.0.bias"][5] = NAN; })
                .find("not finite"),
            std::string::npos);
  body::test::write_text(folder / "e.npz", "no zip");
  EXPECT_NE(input_error([&] { LpipsAlex::load(folder / "e.npz"); }).find("not a readable .npz"),
            std::string::npos);
  body::test::write_text(folder / "e.pt", "no script");
  const std::string no_script = input_error([&] { LpipsAlex::load(folder / "e.pt"); });
  EXPECT_NE(no_script.find("not a TorchScript file"), std::string::npos);
  EXPECT_TRUE(test::is_one_line(no_script)) << no_script;
  EXPECT_NE(input_error([&] { LpipsAlex::load(folder / "none.pt"); }).find("none.pt: cannot open"),
            std::string::npos);
  write_npz(folder / "alex.npz", random_arrays());
  const LpipsAlex network = LpipsAlex::load(folder / "alex.npz");
  const RgbPictures small = rectangles(30, 64, 2, 1);
  EXPECT_NE(
      input_error([&] { network.distance(small[0], small[1]); }).find("at least 31x31, not 30x64"),
      std::string::npos);
}

void write_inception(const std::string& path, const std::string& source,
                     const torch::Tensor& kernel) {
  torch::jit::Module module("__torch__.Inception");
  module.register_parameter("kernel", kernel, false);
  module.define(source);
  module.save(path);
}

constexpr const char* kPooled =
    "def forward(self, x):\n"
    "    return torch.relu(torch.conv2d(x, self.kernel, None, [16, 16])).mean([2, 3], True)\n";

// Half-pixel centres, edges repeated; then [-1,1].
TEST(Inception, TakesPicturesResizedTo299) {
  const test::TemporaryFolder folder;
  const torch::Tensor kernel =
      torch::randn({5, 3, 7, 7}, at::make_generator<at::CPUGeneratorImpl>(uint64_t{5}));
  write_inception(folder / "net.pt", kPooled, kernel);
  const InceptionFeatures network(folder / "net.pt");
  EXPECT_EQ(network.dimension(), 5u);
  EXPECT_EQ(network.name(), "Inception (net.pt)");
  const RgbPictures pictures = rectangles(40, 28, 3, 3);
  const RowMatrix found = network.features(pictures, 2);
  EXPECT_EQ(network.features(pictures, 1), found);
  double worst = 0;
  for (size_t n = 0; n < pictures.size(); ++n) {
    const Planes in = planes_of(pictures[n]);
    Planes resized{3, 299, 299, {}};
    const auto source = [](size_t i, size_t count) {
      return std::max(0.0, (static_cast<double>(i) + 0.5) * static_cast<double>(count) / 299 - 0.5);
    };
    for (size_t c = 0; c < 3; ++c) {
      for (size_t y = 0; y < 299; ++y) {
        for (size_t x = 0; x < 299; ++x) {
          const double v = source(y, in.height), u = source(x, in.width);
          const size_t y0 = static_cast<size_t>(v), x0 = static_cast<size_t>(u),
                       y1 = std::min(y0 + 1, in.height - 1), x1 = std::min(x0 + 1, in.width - 1);
          const double fy = v - static_cast<double>(y0), fx = u - static_cast<double>(x0);
          const double value = (1 - fy) * ((1 - fx) * in.at(c, y0, x0) + fx * in.at(c, y0, x1)) +
                               fy * ((1 - fx) * in.at(c, y1, x0) + fx * in.at(c, y1, x1));
          resized.values.push_back(2 * value - 1);
        }
      }
    }
    const float* weights = kernel.data_ptr<float>();
    const Planes out =
        convolved(resized, Values(weights, weights + kernel.numel()), Values(5, 0.0), 7, 16, 0);
    for (size_t f = 0; f < 5; ++f) {
      double mean = 0;
      for (size_t p = 0; p < out.height * out.width; ++p)
        mean += out.values[f * out.height * out.width + p];
      mean /= static_cast<double>(out.height * out.width);
      worst = std::max(worst, std::abs(found(Eigen::Index(n), Eigen::Index(f)) / mean - 1));
    }
  }
  std::printf("  largest relative error %.1e\n", worst);
  EXPECT_LT(worst, 1e-4);  // resizing and convolution in float
}

TEST(Inception, SaysWhatIsWrongWithAFile) {
  const test::TemporaryFolder folder;
  const torch::Tensor kernel = torch::ones({5, 3, 7, 7});
  const auto refusal = [&](const std::string& source) {
    write_inception(folder / "net.pt", source, kernel);
    const std::string message = input_error([&] { InceptionFeatures network(folder / "net.pt"); });
    EXPECT_TRUE(message.starts_with((folder / "net.pt") + ": ") && test::is_one_line(message))
        << message;
    return message;
  };
  EXPECT_NE(refusal("def forward(self, x):\n    return torch.conv2d(x, self.kernel)\n")
                .find("forward: gives the shape [1, 5, 293, 293], expected [1,F] or [1,F,1,1]"),
            std::string::npos);
  EXPECT_NE(refusal("def forward(self, x):\n    return [x]\n").find("forward: gives a "),
            std::string::npos);
  EXPECT_NE(refusal("def forward(self, x):\n    return x.view([1, 7])\n").find("forward: "),
            std::string::npos);
  EXPECT_NE(refusal("def features(self, x):\n    return x\n")
                .find("forward: the module has no such method"),
            std::string::npos);
  body::test::write_text(folder / "text.pt", "no script");
  EXPECT_NE(input_error([&] {
              InceptionFeatures network(folder / "text.pt");
            }).find("not a TorchScript file"),
            std::string::npos);
  EXPECT_NE(input_error([&] {
              InceptionFeatures network(folder / "none.pt");
            }).find("none.pt: cannot open"),
            std::string::npos);
}

}  // namespace
}  // namespace figurine::features::user_networks_test
