#include "runtime/src/pose/avatar_identity.h"

#include <bit>
#include <span>
#include <vector>

#include "figurine/package.h"

namespace figurine {
namespace {

class Words {
 public:
  void add(uint64_t word) { words_.push_back(word); }
  void add(float value) { words_.push_back(std::bit_cast<uint32_t>(value)); }
  template <class T>
  void add(std::span<const T> values) {
    words_.push_back(values.size());
    for (const uint64_t word : hash(values)) words_.push_back(word);
  }
  AvatarIdentity hash() const { return hash(std::span<const uint64_t>(words_)); }

 private:
  template <class T>
  static AvatarIdentity hash(std::span<const T> values) {
    return hash_picture({reinterpret_cast<const uint8_t*>(values.data()), values.size_bytes()});
  }

  std::vector<uint64_t> words_;
};

void add_layers(const Network& network, bool weights, Words& words) {
  words.add(uint64_t{network.input_size});
  words.add(uint64_t{network.input_channels});
  for (const Layer& layer : network.layers) {
    words.add(uint64_t{static_cast<uint8_t>(layer.op)});
    for (const uint32_t input : layer.inputs) words.add(uint64_t{input});
    words.add(uint64_t{layer.out_channels});
    words.add(uint64_t{layer.kernel});
    words.add(uint64_t{layer.relu});
    if (!weights) continue;
    words.add(layer.weights);
    words.add(layer.bias);
  }
}

void add_fixed_point(const FixedPointNetwork& fixed, Words& words) {
  for (const FixedPointConvolution& convolution : fixed.convolutions) {
    words.add(convolution.weights);
    words.add(convolution.weight_scale);
    words.add(convolution.bias);
  }
  for (const Quantisation& value : fixed.values) {
    words.add(value.scale);
    words.add(uint64_t{static_cast<uint32_t>(value.zero_point)});
  }
}

void add_static_part(const StaticPart& part, Words& words) {
  words.add(uint64_t{part.groups.size()});
  for (const StaticGroup& group : part.groups) {
    for (const uint32_t word : {group.first_channel, group.channels, group.grid_size})
      words.add(uint64_t{word});
    words.add(group.values);
    words.add(group.scale);
  }
}

}  // namespace

AvatarIdentity identify(const Avatar& avatar, const Body& body, Precision precision) {
  Words words;
  words.add(uint64_t{reinterpret_cast<uintptr_t>(body.texel.data())});  // borrowed: it stays
  words.add(uint64_t{static_cast<uint8_t>(precision)});
  words.add(uint64_t{static_cast<uint8_t>(avatar.template_mode)});
  words.add(avatar.shape);
  for (const float value : avatar.map_statistics.mean) words.add(value);
  for (const float value : avatar.map_statistics.scale) words.add(value);
  words.add(uint64_t{avatar.fourier_octaves});
  const HeadDecoding& decoding = avatar.decoding;
  for (const float value : {decoding.offset_scale_m, decoding.spacing_scale, decoding.max_log_scale,
                            decoding.opacity_bias, decoding.max_offset})
    words.add(value);
  words.add(uint64_t{decoding.sh_degree});
  add_layers(avatar.network, precision == Precision::kFloat32, words);
  if (precision == Precision::kFixedPoint) add_fixed_point(avatar.fixed_point, words);
  add_static_part(avatar.static_part, words);
  words.add(avatar.smallest_extents.codes);
  words.add(avatar.smallest_extents.scale_m);
  words.add(uint64_t{avatar.antialiased});
  if (const PoseStatistics& poses = avatar.pose_statistics; !poses.distances.empty()) {
    words.add(std::span<const uint8_t>(poses.joints));
    for (const std::span<const float> values : {poses.mean, poses.covariance, poses.distances})
      words.add(values);
  }
  return words.hash();
}

}  // namespace figurine
