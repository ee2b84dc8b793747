// A package in parts, before it becomes bytes: what the writer lays out, and what tests bend before
// it does. Not for other callers: nothing is verified here (package_writer.h is the door).
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <variant>
#include <vector>

#include "figurine/package.h"

namespace figurine {

struct BlobPart {
  std::string name;
  DataType type = DataType::kF32;
  std::vector<uint32_t> shape;
  std::span<const std::byte> bytes;  // borrowed
  bool optional = false;
};

struct PackageParts {
  PackageKind kind = PackageKind::kBody;
  uint64_t required_features = 0;
  uint64_t optional_features = 0;
  // Borrowed; their arrays are taken from the blobs alone. In the order of the schema's Content.
  std::variant<const Body*, const Avatar*, const Motion*, const Population*, const Sampler*>
      content;
  Budget budget;
  Provenance provenance;
  std::span<const Provenance> member_provenance;  // of a population; borrowed
  std::vector<BlobPart> blobs;
};

// kInvalidArgument, naming the field, if an array's length is not a multiple of what its shape
// needs.
Result<PackageParts> take_apart(const Body& body, const Provenance& provenance);
Result<PackageParts> take_apart(const Avatar& avatar, const Budget& budget,
                                const Provenance& provenance);
Result<PackageParts> take_apart(const Motion& motion, const Provenance& provenance);
Result<PackageParts> take_apart(const Population& population, const Budget& budget,
                                const Provenance& provenance, std::span<const Provenance> own);
Result<PackageParts> take_apart(const Sampler& sampler, const Budget& budget,
                                const Provenance& provenance);

// Header, index and blobs, sealed. The same parts give the same bytes.
std::vector<std::byte> assemble(const PackageParts& parts);

}  // namespace figurine
