// The five texels as packages: written, opened and kept alive.
#pragma once

#include <memory>
#include <vector>

#include "figurine/package.h"
#include "formats/writer/package_writer.h"
#include "tests/golden/posing/five_texels.h"
#include "tests/runtime/test_packages.h"

namespace figurine::golden {

inline Provenance five_texels_provenance() {
  return {.tool = "figurine-tests 1", .licence_name = "Apache-2.0", .depicted_person = "synthetic"};
}

// Describes the example's avatar: a network of one 1x1 convolution. Spans point into example.
inline Avatar five_texels_avatar(const FiveTexels& example,
                                 const std::array<uint64_t, 2>& body_hash) {
  Avatar avatar;
  avatar.name = "five texels";
  avatar.body_name = example.body.name;
  avatar.body_hash = body_hash;
  avatar.preset = "test";
  avatar.template_mode = TemplateMode::kShaped;
  avatar.shape = example.shape;
  avatar.map_statistics = example.statistics;
  avatar.fourier_octaves = example.fourier_octaves;
  avatar.decoding = example.decoding;
  const uint32_t inputs = kMapChannels + 4 * example.fourier_octaves;
  avatar.network = {.input_size = example.body.uv_size,
                    .input_channels = inputs,
                    .layers = {{.op = LayerOp::kConv2d,
                                .inputs = {0, 0},
                                .out_channels = head_channels(0),
                                .kernel = 1,
                                .relu = false,
                                .weights = example.network_weights,
                                .bias = example.network_bias}}};
  avatar.golden.rotations = example.rotations;
  avatar.golden.root_translation_m = example.pose.root_translation_m;
  avatar.golden.camera = example.camera;
  return avatar;
}

class FiveTexelsPackages {
 public:
  explicit FiveTexelsPackages(const FiveTexels& example) {
    const Result<std::vector<std::byte>> body =
        write_package(example.body, five_texels_provenance());
    body_bytes_ = tests::AlignedBytes(body.value());
    body_ =
        std::make_unique<Package>(Package::open(body_bytes_.bytes(), "five texels' body").value());
    const Avatar avatar = five_texels_avatar(example, body_->content_hash());
    const Budget budget{.peak_memory_bytes = 1 << 20,
                        .macs_per_frame = 16 * 10 * head_channels(0),
                        .gaussians = example.body.texel_count()};
    const Result<std::vector<std::byte>> written =
        write_package(avatar, budget, five_texels_provenance());
    avatar_bytes_ = tests::AlignedBytes(written.value());
    avatar_ = std::make_unique<Package>(
        Package::open(avatar_bytes_.bytes(), "five texels' avatar").value());
  }
  const Package& body() const { return *body_; }
  const Package& avatar() const { return *avatar_; }

 private:
  tests::AlignedBytes body_bytes_, avatar_bytes_;
  std::unique_ptr<Package> body_, avatar_;
};

}  // namespace figurine::golden
