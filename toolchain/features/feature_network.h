// Networks through which pictures of people are compared, as two interfaces: global features for
// distances between sets of pictures (Frechet distance, KID), and a perceptual distance between two
// pictures as LPIPS defines it. docs/features.md says which there are; docs/numerics.md,
// "Features", what they compute.
//
// Every picture goes through a network alone, on one thread: the numbers are the same for any
// number of threads and any grouping of pictures, to the bit on one CPU.
//
// Letters: n pictures of width W and height H, F features, E values of an embedding.
//
// Based on: Zhang et al., The Unreasonable Effectiveness of Deep Features as a Perceptual Metric,
// 2018, eq. 1; Heusel et al., GANs Trained by a Two Time-Scale Update Rule, 2017 (features of a
// set); Binkowski et al., Demystifying MMD GANs, 2018 (KID).
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <span>
#include <string>
#include <vector>

#include "toolchain/measure/metrics.h"
#include "toolchain/measure/weight_space.h"

namespace figurine::model {
class PictureDistance;
}

namespace figurine::features {

// One picture of RgbPictures, borrowed.
struct RgbView {
  uint32_t width_px = 0, height_px = 0;
  std::span<const float> values;  // [3,H,W]
};

// Pictures of one size, sRGB-encoded in [0,1], all over the same background.
struct RgbPictures {
  uint32_t width_px = 0, height_px = 0;
  std::vector<float> values;  // [n,3,H,W]

  size_t size() const {
    return values.empty() ? 0 : values.size() / (size_t{3} * width_px * height_px);
  }
  RgbView operator[](size_t i) const;
};

// Over mid-grey, as everything is compared.
RgbPictures over_grey(std::span<const measure::Picture> pictures);

class FeatureNetwork {
 public:
  virtual ~FeatureNetwork() = default;
  virtual const std::string& name()
      const = 0;  // as every report must call what was measured through it
  virtual nlohmann::json describe()
      const = 0;  // "name", "file", "hash" and what else is known of where it came from
  virtual size_t dimension() const = 0;  // F
  // [n,F]. Throws InputError if the network cannot take pictures of this size.
  measure::RowMatrix features(const RgbPictures& pictures, uint32_t threads = 1) const;

 private:
  // features: [F]. Called from several threads at once, each of which runs LibTorch on itself
  // alone.
  virtual void features_of(const RgbView& picture, std::span<double> features) const = 0;
};

// The distance is the squared Euclidean one between embeddings: unit-normalised activations of
// every layer, each times sqrt(channel's weight / positions of the layer). So a picture goes
// through the network once, however many it is compared with.
class PerceptualNetwork {
 public:
  virtual ~PerceptualNetwork() = default;
  virtual const std::string& name() const = 0;
  virtual nlohmann::json describe() const = 0;
  // [n] of [E]. E is large: 0.2 million values for figurine-features, 0.6 for LPIPS at 256 x 256.
  std::vector<std::vector<float>> embed(const RgbPictures& pictures, uint32_t threads = 1) const;
  // Of two pictures: 0 if they are equal, symmetric.
  double distance(const RgbView& a, const RgbView& b) const;
  // Of all pairs: [n of a, n of b]. Both sets' embeddings are in memory at once.
  measure::RowMatrix distances(const RgbPictures& a, const RgbPictures& b,
                               uint32_t threads = 1) const;

 private:
  virtual std::vector<float> embedding_of(const RgbView& picture) const = 0;
};

// Of two embeddings, summed in double in their order.
double embedding_distance(std::span<const float> a, std::span<const float> b);

// Files of networks as a command line names them; empty: not given.
struct NetworkFiles {
  std::string features;   // figurine-features (figurine-train features)
  std::string lpips;      // AlexNet and LPIPS' weights, .npz or TorchScript
  std::string inception;  // TorchScript
};

struct ComparingNetworks {
  std::vector<std::shared_ptr<const FeatureNetwork>> features;
  std::vector<std::shared_ptr<const PerceptualNetwork>> perceptual;
};

// XXH3-128 of a file's bytes, as hexadecimal digits. Throws InputError.
std::string hash_of_file(const std::string& path);

// What a perceptual loss looks through (toolchain/model/perceptual.h).
struct LossNetwork {
  std::shared_ptr<const model::PictureDistance> distance;
  std::string name, hash;  // of the network, of its file
};

// .safetensors: figurine-features; else AlexNet and LPIPS' weights, .npz or TorchScript. Throws
// InputError naming file, layer and reason.
LossNetwork open_loss_network(const std::string& path);

// Throws InputError naming file, layer and reason.
ComparingNetworks open_networks(const NetworkFiles& files);

}  // namespace figurine::features
