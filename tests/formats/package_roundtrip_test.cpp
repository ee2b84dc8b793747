// What goes in comes out: every field of every kind, the same bytes each time, views into the
// caller's bytes.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>

#include "formats/opened.h"
#include "formats/package_samples.h"

namespace figurine::package_roundtrip_test {
namespace {

using samples::AvatarSample;
using samples::BodySample;
using samples::MotionSample;
using samples::open_or_die;
using samples::Opened;
using samples::same;

template <class T>
void expect_view(const Opened& opened, std::span<const T> array) {
  const auto* begin = reinterpret_cast<const std::byte*>(array.data());
  EXPECT_GE(begin, opened.bytes.bytes().data());
  EXPECT_LE(begin + array.size_bytes(), opened.bytes.bytes().data() + opened.bytes.bytes().size());
  EXPECT_EQ((begin - opened.bytes.bytes().data()) % ptrdiff_t(kBlobAlignment), 0);
}

void expect_same(const Provenance& a, const Provenance& b) {
  EXPECT_EQ(a.tool, b.tool);
  EXPECT_EQ(a.created, b.created);
  EXPECT_TRUE(std::ranges::equal(a.settings, b.settings, [](const auto& x, const auto& y) {
    return x.key == y.key && x.value == y.value;
  }));
  EXPECT_EQ(a.sources, b.sources);
  EXPECT_TRUE(std::ranges::equal(a.quality, b.quality, [](const auto& x, const auto& y) {
    return x.name == y.name && x.value == y.value;
  }));
  EXPECT_EQ(a.licence_name, b.licence_name);
  EXPECT_EQ(a.licence_url, b.licence_url);
  EXPECT_EQ(a.authors, b.authors);
  EXPECT_EQ(a.avatar_permission, b.avatar_permission);
  EXPECT_EQ(a.commercial_usage, b.commercial_usage);
  EXPECT_EQ(a.depicted_person, b.depicted_person);
}

TEST(PackageRoundTrip, BodyKeepsEveryField) {
  const BodySample sample;
  const Opened opened = open_or_die(sample.write());
  ASSERT_EQ(opened.package.kind(), PackageKind::kBody);
  const Body &in = sample.body, &out = opened.package.body();
  EXPECT_EQ(in.name, out.name);
  EXPECT_EQ(in.uv_size, out.uv_size);
  EXPECT_EQ(in.joint_names, out.joint_names);
  EXPECT_TRUE(same(in.parents, out.parents));
  EXPECT_TRUE(same(in.joint_position_m, out.joint_position_m));
  EXPECT_TRUE(same(in.joint_shape_basis_m, out.joint_shape_basis_m));
  EXPECT_TRUE(same(in.texel, out.texel));
  EXPECT_TRUE(same(in.texel_position_m, out.texel_position_m));
  EXPECT_TRUE(same(in.texel_normal, out.texel_normal));
  EXPECT_TRUE(same(in.texel_joints, out.texel_joints));
  EXPECT_TRUE(same(in.texel_weights, out.texel_weights));
  EXPECT_TRUE(same(in.texel_spacing_m, out.texel_spacing_m));
  EXPECT_TRUE(same(in.texel_shape_basis_m, out.texel_shape_basis_m));
  EXPECT_TRUE(same(in.border_texel, out.border_texel));
  EXPECT_TRUE(same(in.border_source, out.border_source));
  EXPECT_EQ(out.shape_count(), 2u);
  EXPECT_EQ(opened.package.budget().gaussians, in.texel_count());
  expect_same(samples::make_provenance(), opened.package.provenance());
}

TEST(PackageRoundTrip, BodyKeepsPlacesOnTheMeshWhereItStatesThem) {
  BodySample sample;
  EXPECT_TRUE(open_or_die(sample.write()).package.body().texel_triangle.empty());
  const std::vector<uint32_t> triangle = {3, 0, 2, 2, 9};
  const std::vector<float> weights = {1, 0, 0, 0.5f, 0.5f, 0, 0.25f, 0.25f, 0.5f, 0, 1, 0, 0, 0, 1};
  sample.body.texel_triangle = triangle;
  sample.body.texel_barycentric = weights;
  const Opened opened = open_or_die(sample.write());
  EXPECT_TRUE(same(opened.package.body().texel_triangle, sample.body.texel_triangle));
  EXPECT_TRUE(same(opened.package.body().texel_barycentric, sample.body.texel_barycentric));
  EXPECT_EQ(opened.package.required_features(), 0u);  // a reader of before skips them
  EXPECT_EQ(format_hash(opened.package.content_hash()), "a82e0edf03015c1198e15b6bb99488a2");
}

TEST(PackageRoundTrip, AvatarKeepsEveryField) {
  const AvatarSample sample;
  const Opened opened = open_or_die(sample.write());
  ASSERT_EQ(opened.package.kind(), PackageKind::kAvatar);
  const Avatar &in = sample.avatar, &out = opened.package.avatar();
  EXPECT_EQ(in.name, out.name);
  EXPECT_EQ(in.body_name, out.body_name);
  EXPECT_EQ(in.body_hash, out.body_hash);
  EXPECT_EQ(in.preset, out.preset);
  EXPECT_EQ(in.template_mode, out.template_mode);
  EXPECT_TRUE(same(in.shape, out.shape));
  EXPECT_EQ(in.map_statistics.mean, out.map_statistics.mean);
  EXPECT_EQ(in.map_statistics.scale, out.map_statistics.scale);
  EXPECT_EQ(in.fourier_octaves, out.fourier_octaves);
  EXPECT_EQ(in.decoding.offset_scale_m, out.decoding.offset_scale_m);
  EXPECT_EQ(in.decoding.spacing_scale, out.decoding.spacing_scale);
  EXPECT_EQ(in.decoding.max_log_scale, out.decoding.max_log_scale);
  EXPECT_EQ(in.decoding.opacity_bias, out.decoding.opacity_bias);
  EXPECT_EQ(in.decoding.sh_degree, out.decoding.sh_degree);
  EXPECT_EQ(in.decoding.max_offset, out.decoding.max_offset);
  EXPECT_EQ(in.network.input_size, out.network.input_size);
  EXPECT_EQ(in.network.input_channels, out.network.input_channels);
  ASSERT_EQ(in.network.layers.size(), out.network.layers.size());
  for (size_t i = 0; i < in.network.layers.size(); ++i) {
    const Layer &a = in.network.layers[i], &b = out.network.layers[i];
    EXPECT_EQ(a.op, b.op);
    EXPECT_EQ(a.inputs[0], b.inputs[0]);
    EXPECT_EQ(a.inputs[1], b.inputs[1]);
    EXPECT_EQ(a.out_channels, b.out_channels);
    EXPECT_EQ(a.kernel, b.kernel);
    EXPECT_EQ(a.relu, b.relu);
    EXPECT_TRUE(same(a.weights, b.weights));
    EXPECT_TRUE(same(a.bias, b.bias));
    if (!b.weights.empty()) expect_view(opened, b.weights);
  }
  EXPECT_EQ(in.pose_statistics.joints, out.pose_statistics.joints);
  EXPECT_TRUE(same(in.pose_statistics.mean, out.pose_statistics.mean));
  EXPECT_TRUE(same(in.pose_statistics.covariance, out.pose_statistics.covariance));
  EXPECT_EQ(in.golden.root_translation_m, out.golden.root_translation_m);
  EXPECT_EQ(in.golden.background, out.golden.background);
  EXPECT_TRUE(same(in.golden.rotations, out.golden.rotations));
  EXPECT_TRUE(same(in.golden.png, out.golden.png));
  const Camera &c = in.golden.camera, &d = out.golden.camera;
  EXPECT_EQ(c.width_px, d.width_px);
  EXPECT_EQ(c.height_px, d.height_px);
  EXPECT_EQ(c.fx_px, d.fx_px);
  EXPECT_EQ(c.fy_px, d.fy_px);
  EXPECT_EQ(c.cx_px, d.cx_px);
  EXPECT_EQ(c.cy_px, d.cy_px);
  EXPECT_EQ(c.near_m, d.near_m);
  EXPECT_EQ(c.view_from_world, d.view_from_world);
  EXPECT_EQ(opened.package.budget().peak_memory_bytes, sample.budget.peak_memory_bytes);
  EXPECT_EQ(opened.package.budget().macs_per_frame, sample.budget.macs_per_frame);
  EXPECT_EQ(opened.package.budget().gaussians, sample.budget.gaussians);
  expect_same(samples::make_provenance(), opened.package.provenance());
}

void expect_same_fixed_point(const Opened& opened, const Avatar& in) {
  const Avatar& out = opened.package.avatar();
  EXPECT_EQ(in.fixed_point.values, out.fixed_point.values);
  ASSERT_EQ(in.fixed_point.convolutions.size(), out.fixed_point.convolutions.size());
  for (size_t i = 0; i < in.fixed_point.convolutions.size(); ++i) {
    const FixedPointConvolution &a = in.fixed_point.convolutions[i],
                                &b = out.fixed_point.convolutions[i];
    EXPECT_TRUE(same(a.weights, b.weights));
    EXPECT_TRUE(same(a.weight_scale, b.weight_scale));
    EXPECT_TRUE(same(a.bias, b.bias));
    if (!b.weights.empty()) expect_view(opened, b.weights);
  }
  EXPECT_EQ(in.golden.fixed_point_hash, out.golden.fixed_point_hash);
  EXPECT_EQ(in.golden.fixed_point_library, out.golden.fixed_point_library);
  EXPECT_EQ(opened.package.required_features(), kFeatureFixedPoint);
}

TEST(PackageRoundTrip, AnAvatarHoldsFloatsFixedPointOrBoth) {
  const Opened floats = open_or_die(AvatarSample().write());
  EXPECT_TRUE(floats.package.avatar().holds(Precision::kFloat32));
  EXPECT_FALSE(floats.package.avatar().holds(Precision::kFixedPoint));
  EXPECT_EQ(floats.package.required_features(), 0u);

  const samples::FixedPointAvatarSample fixed;
  const Opened alone = open_or_die(fixed.write());
  EXPECT_FALSE(alone.package.avatar().holds(Precision::kFloat32));
  EXPECT_TRUE(alone.package.avatar().holds(Precision::kFixedPoint));
  expect_same_fixed_point(alone, fixed.avatar);

  samples::FixedPointAvatarSample both;
  const Opened two = open_or_die(both.with_floats().write());
  EXPECT_TRUE(two.package.avatar().holds(Precision::kFloat32));
  EXPECT_TRUE(two.package.avatar().holds(Precision::kFixedPoint));
  expect_same_fixed_point(two, both.avatar);
  EXPECT_TRUE(
      same(both.avatar.network.layers[0].weights, two.package.avatar().network.layers[0].weights));
}

TEST(PackageRoundTrip, MotionKeepsEveryField) {
  const MotionSample sample;
  const Opened opened = open_or_die(sample.write());
  ASSERT_EQ(opened.package.kind(), PackageKind::kMotion);
  const Motion &in = sample.motion, &out = opened.package.motion();
  EXPECT_EQ(in.name, out.name);
  EXPECT_EQ(in.frames_per_second, out.frames_per_second);
  EXPECT_EQ(in.joint_names, out.joint_names);
  EXPECT_EQ(in.frame_count, out.frame_count);
  EXPECT_TRUE(same(in.root_translation_m, out.root_translation_m));
  EXPECT_TRUE(same(in.rotations, out.rotations));
  expect_view(opened, out.rotations);
  EXPECT_EQ(out.pose(1).rotations[5], -0.5f);
  expect_same(samples::make_provenance(), opened.package.provenance());
}

TEST(PackageRoundTrip, OptionalPartsMayBeAbsent) {
  AvatarSample avatar;
  avatar.avatar.shape = {};
  avatar.avatar.pose_statistics = {};
  avatar.avatar.golden = {};
  const Opened opened = open_or_die(avatar.write());
  EXPECT_TRUE(opened.package.avatar().shape.empty());
  EXPECT_TRUE(opened.package.avatar().pose_statistics.joints.empty());
  EXPECT_TRUE(opened.package.avatar().golden.rotations.empty());

  BodySample body;
  body.body.joint_shape_basis_m = body.body.texel_shape_basis_m = {};
  body.body.border_texel = body.body.border_source = {};
  const Opened plain = open_or_die(body.write());
  EXPECT_EQ(plain.package.body().shape_count(), 0u);
  EXPECT_TRUE(plain.package.body().border_texel.empty());
}

TEST(PackageRoundTrip, SameInputGivesSameBytes) {
  EXPECT_EQ(*BodySample().write(), *BodySample().write());
  EXPECT_EQ(*AvatarSample().write(), *AvatarSample().write());
  EXPECT_EQ(*MotionSample().write(), *MotionSample().write());
}

TEST(PackageRoundTrip, TensorsDescribeTheWholeFile) {
  const AvatarSample sample;
  const Opened opened = open_or_die(sample.write());
  uint64_t end = 0;
  for (const TensorInfo& tensor : opened.package.tensors()) {
    EXPECT_EQ(tensor.offset_bytes % kBlobAlignment, 0u) << tensor.name;
    EXPECT_GE(tensor.offset_bytes, end) << tensor.name;
    uint64_t bytes = size_bytes(tensor.type);
    for (uint32_t length : tensor.shape) bytes *= length;
    EXPECT_EQ(bytes, tensor.size_bytes) << tensor.name;
    end = tensor.offset_bytes + tensor.size_bytes;
  }
  EXPECT_EQ(opened.package.tensors().size(), 15u * 2 + 5);
  EXPECT_EQ((end + 63) / 64 * 64, opened.package.size_bytes());
}

TEST(PackageHash, NamesTheContentAndNothingElse) {
  BodySample changed;
  changed.texel_position[4] += 0.5f;
  const auto hash = [](const BodySample& sample) {
    return open_or_die(sample.write()).package.content_hash();
  };
  EXPECT_EQ(hash(BodySample()), hash(BodySample()));
  EXPECT_NE(hash(BodySample()), hash(changed));
  EXPECT_EQ(format_hash({0x0123456789abcdefu, 0xfedcba9876543210u}),
            "fedcba98765432100123456789abcdef");
}

}  // namespace
}  // namespace figurine::package_roundtrip_test
