// Parts of a package that a use does not want: absent from the views, never read, and their damage
// unseen until somebody opens the package whole; damage in all else is found. And what a package
// is, by its header and index alone.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <set>
#include <string>
#include <vector>

#include "formats/package_bytes.h"
#include "formats/package_samples.h"

namespace figurine::package_parts_test {
namespace {

using samples::BodySample;
using samples::ExactBytes;
using samples::FixedPointAvatarSample;
using samples::SampleKind;

using Bytes = std::vector<std::byte>;

// An avatar with everything that may be left out: both precisions, a picture, statistics.
Bytes whole_avatar() {
  FixedPointAvatarSample sample;
  sample.with_floats();
  const Result<Bytes> written = sample.write();
  EXPECT_TRUE(written.ok()) << written.status().message();
  return *written;
}

// A body that says where its texels lie on a mesh.
Bytes whole_body() {
  BodySample sample;
  const std::vector<uint32_t> triangle(sample.body.texel_count(), 7);
  std::vector<float> barycentric;
  for (uint32_t i = 0; i < sample.body.texel_count(); ++i)
    barycentric.insert(barycentric.end(), {0.5f, 0.25f, 0.25f});
  sample.body.texel_triangle = triangle;
  sample.body.texel_barycentric = barycentric;
  const Result<Bytes> written = sample.write();
  EXPECT_TRUE(written.ok()) << written.status().message();
  return *written;
}

std::set<std::string> names_left_out(const Package& package) {
  std::set<std::string> names;
  for (const TensorInfo& tensor : package.tensors()) {
    if (!tensor.wanted) names.insert(tensor.name);
  }
  return names;
}

struct Use {
  const char* name;
  OpenOptions options;
};
const Use kAvatarUses[] = {{"all", {}},
                           {"drawing in fixed point", OpenOptions::for_drawing()},
                           {"drawing in float", OpenOptions::for_drawing(Precision::kFloat32)},
                           {"without a picture", {.golden_picture = false}},
                           {"without statistics", {.pose_statistics = false}}};

TEST(PackageParts, WhatIsNotWantedIsAbsentAndTheRestIsThere) {
  const Bytes bytes = whole_avatar();
  const ExactBytes exact(bytes);
  const auto open = [&](const OpenOptions& options) {
    return std::move(Package::open(exact.bytes(), "person.fgn", options)).value();
  };
  const Package all = open({});
  EXPECT_TRUE(names_left_out(all).empty());
  EXPECT_TRUE(all.avatar().holds(Precision::kFloat32));
  EXPECT_TRUE(all.avatar().holds(Precision::kFixedPoint));
  ASSERT_FALSE(all.avatar().golden.png.empty());
  ASSERT_FALSE(all.avatar().pose_statistics.joints.empty());

  const Package fixed = open(OpenOptions::for_drawing());
  EXPECT_FALSE(fixed.avatar().holds(Precision::kFloat32));
  EXPECT_TRUE(fixed.avatar().holds(Precision::kFixedPoint));
  EXPECT_TRUE(fixed.avatar().golden.png.empty());
  EXPECT_FALSE(fixed.avatar().golden.rotations.empty());
  EXPECT_TRUE(fixed.avatar().pose_statistics.joints.empty());
  for (const std::string& name : names_left_out(fixed)) {
    EXPECT_TRUE(name.starts_with("network.") || name == "golden.png" || name == "pose.mean" ||
                name == "pose.covariance")
        << name;
  }
  EXPECT_EQ(names_left_out(fixed).count("network.0.weights"), 1u);
  EXPECT_EQ(names_left_out(fixed).size(),
            static_cast<size_t>(std::count_if(
                all.tensors().begin(), all.tensors().end(), [](const TensorInfo& tensor) {
                  return tensor.name.starts_with("network.") || tensor.name == "golden.png" ||
                         tensor.name.starts_with("pose.");
                })));

  const Package floats = open(OpenOptions::for_drawing(Precision::kFloat32));
  EXPECT_TRUE(floats.avatar().holds(Precision::kFloat32));
  EXPECT_FALSE(floats.avatar().holds(Precision::kFixedPoint));
  EXPECT_EQ(names_left_out(floats).count("fixed.0.weights"), 1u);

  for (const Use& use : kAvatarUses) {
    const Package package = open(use.options);
    EXPECT_EQ(package.content_hash(), all.content_hash()) << use.name;
    EXPECT_EQ(package.required_features(), all.required_features()) << use.name;
    EXPECT_EQ(package.tensors().size(), all.tensors().size()) << use.name;
    EXPECT_EQ(package.avatar().golden.fixed_point_hash, all.avatar().golden.fixed_point_hash);
  }
}

TEST(PackageParts, AnAvatarKeepsItsOnlyWeights) {
  for (const auto& [kind, held] :
       {std::pair(SampleKind::kAvatar, Precision::kFloat32),
        std::pair(SampleKind::kFixedPointAvatar, Precision::kFixedPoint)}) {
    const Bytes bytes = *samples::write_sample(kind);
    const ExactBytes exact(bytes);
    for (const Precision asked : {Precision::kFloat32, Precision::kFixedPoint}) {
      const auto package =
          Package::open(exact.bytes(), "person.fgn", OpenOptions::for_drawing(asked));
      ASSERT_TRUE(package.ok()) << package.status().message();
      EXPECT_TRUE(package->avatar().holds(held));
    }
  }
}

TEST(PackageParts, PlacesOnTheMeshAreLeftOut) {
  const Bytes bytes = whole_body();
  const ExactBytes exact(bytes);
  const auto all = Package::open(exact.bytes(), "body.fgn");
  const auto drawn = Package::open(exact.bytes(), "body.fgn", OpenOptions::for_drawing());
  ASSERT_TRUE(all.ok() && drawn.ok());
  EXPECT_FALSE(all->body().texel_triangle.empty());
  EXPECT_TRUE(drawn->body().texel_triangle.empty());
  EXPECT_TRUE(drawn->body().texel_barycentric.empty());
  EXPECT_EQ(names_left_out(*drawn),
            (std::set<std::string>{"body.texel_triangle", "body.texel_barycentric"}));
}

// Every kind in every use: sound packages open.
TEST(PackageParts, EveryKindOpensForEveryUse) {
  for (const SampleKind kind : samples::kSampleKinds) {
    const Bytes bytes = *samples::write_sample(kind);
    const ExactBytes exact(bytes);
    for (const Use& use : kAvatarUses) {
      const auto package = Package::open(exact.bytes(), "x.fgn", use.options);
      ASSERT_TRUE(package.ok()) << samples::to_string(kind) << ", " << use.name << ": "
                                << package.status().message();
      const bool has_parts =
          package->kind() == PackageKind::kAvatar || package->kind() == PackageKind::kBody;
      EXPECT_TRUE(has_parts || names_left_out(*package).empty()) << samples::to_string(kind);
    }
  }
}

// A byte of every blob bent, in every use: it is found exactly where the blob is wanted, in one
// line that names it, and always by who opens all.
TEST(PackageParts, DamageIsFoundInWhatIsWantedAndByWhoeverOpensAll) {
  for (const bool of_body : {false, true}) {
    const Bytes sound = of_body ? whole_body() : whole_avatar();
    for (const Use& use : kAvatarUses) {
      std::vector<TensorInfo> tensors;
      {
        const ExactBytes exact(sound);
        tensors = Package::open(exact.bytes(), "x.fgn", use.options)->tensors();
      }
      for (const TensorInfo& tensor : tensors) {
        for (const uint64_t at : {uint64_t{0}, tensor.size_bytes - 1}) {
          Bytes bent = sound;
          bent[tensor.offset_bytes + at] ^= std::byte{0x10};
          const ExactBytes exact(bent);
          const Status status = Package::open(exact.bytes(), "x.fgn", use.options).status();
          EXPECT_EQ(status.ok(), !tensor.wanted) << use.name << ", " << tensor.name;
          if (!status.ok()) {
            EXPECT_EQ(status.code(), StatusCode::kCorrupt);
            EXPECT_EQ(status.message(),
                      "x.fgn: " + tensor.name + ": checksum does not match, the blob is damaged");
          }
          EXPECT_EQ(Package::open(exact.bytes(), "x.fgn").status().code(), StatusCode::kCorrupt)
              << tensor.name;
        }
      }
    }
  }
}

TEST(PackageIdentity, IsHeaderAndIndexAlone) {
  for (const SampleKind kind : samples::kSampleKinds) {
    Bytes bytes = *samples::write_sample(kind);
    uint64_t index_end = 0;
    std::array<uint64_t, 2> hash{};
    {
      const ExactBytes exact(bytes);
      const Package package = std::move(Package::open(exact.bytes(), "x.fgn")).value();
      hash = package.content_hash();
      index_end = kPackageHeaderBytes + package.index_bytes();
    }
    // Blobs bent from end to end.
    for (size_t i = index_end; i < bytes.size(); ++i) bytes[i] ^= std::byte{0xFF};
    {
      const ExactBytes exact(bytes);
      const Result<PackageIdentity> identity = Package::identify(exact.bytes(), "x.fgn");
      ASSERT_TRUE(identity.ok()) << identity.status().message();
      EXPECT_EQ(identity->kind, samples::package_kind(kind));
      EXPECT_EQ(identity->version, kPackageVersion);
      EXPECT_EQ(identity->content_hash, hash);
    }
    // Header and index bent byte by byte.
    for (size_t i = 0; i < index_end; i += 7) {
      bytes[i] ^= std::byte{0x04};
      const ExactBytes exact(bytes);
      const Status status = Package::identify(exact.bytes(), "x.fgn").status();
      EXPECT_FALSE(status.ok()) << "byte " << i;
      EXPECT_EQ(status.message().rfind("x.fgn: ", 0), 0u) << status.message();
      bytes[i] ^= std::byte{0x04};
    }
    for (const size_t length : {size_t{0}, size_t{63}, size_t{64}, bytes.size() - 64}) {
      const ExactBytes exact(std::span<const std::byte>(bytes).first(length));
      EXPECT_EQ(Package::identify(exact.bytes(), "x.fgn").status().code(), StatusCode::kCorrupt);
    }
  }
}

}  // namespace
}  // namespace figurine::package_parts_test
