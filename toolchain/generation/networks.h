// What networks say of sampled people, beside PSNR: MMD, COV, 1-NNA and novelty in a perceptual
// distance; Frechet distance and KID's estimate of features. Everything is keyed by the network's
// own name, because only the originals' numbers are LPIPS, FID and KID.
//
// Letters: N training and H held-out members, V pictures of each.
#pragma once

#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <vector>

#include "toolchain/generation/people_distances.h"
#include "toolchain/measure/bootstrap.h"

namespace figurine::generation {

// Below so many pictures a feature a Frechet distance is mostly the bias of its covariances, and
// left out.
inline constexpr size_t kPicturesPerFeature = 4;

// References once, then one row after the other.
class GenerationNetworks {
 public:
  // All is borrowed but the pictures. Throws InputError if a network cannot take the pictures, or
  // Interrupted.
  GenerationNetworks(const features::ComparingNetworks& networks, const People& training,
                     const People& held_out, uint32_t threads,
                     const measure::BootstrapOptions& bootstrap);

  // Adds to a row's "held_out" and "train" the objects "perceptual", "frechet" and "kid", and to
  // its "novelty" the object "perceptual"; nothing without networks. samples: at least max(N, H).
  // learnt: the first so many training members, whom the novelty audit looks for.
  void add_samples(const People& samples, Eigen::Index learnt, nlohmann::json& row) const;
  void add_training_as_samples(
      nlohmann::json& row) const;  // to "held_out", in draws of H; needs N >= H
  void add_held_out_novelty(nlohmann::json& row) const;

 private:
  // Of as many samples as references. Distances: [n,n]; features: [n V, F].
  nlohmann::json compare_distances(measure::RowMatrix to_references, measure::RowMatrix samples,
                                   measure::RowMatrix references) const;
  void compare_features(const features::FeatureNetwork& network, const measure::RowMatrix& samples,
                        const measure::RowMatrix& references, nlohmann::json& part) const;

  const features::ComparingNetworks& networks_;
  uint32_t threads_;
  measure::BootstrapOptions bootstrap_;
  Eigen::Index training_, held_out_, pictures_;  // N, H, V
  People references_;                            // training, then held out
  std::vector<measure::RowMatrix> distances_;    // of each perceptual network, [N+H,N+H]
  std::vector<measure::RowMatrix> features_;     // of each feature network, [(N+H) V, F]
};

}  // namespace figurine::generation
