// Builds .fgn packages (formats/include/figurine/package.h). No LibTorch, no exceptions, no files:
// bytes out. Linked by the toolchain, samples and tests, never by the runtime library.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "figurine/package.h"

namespace figurine {

// A copy at the alignment that Package::open asks for, for opening bytes that do not come from a
// memory map.
class AlignedBytes {
 public:
  explicit AlignedBytes(std::span<const std::byte> source);
  std::span<const std::byte> bytes() const { return {storage_.data() + skip_, size_}; }
  std::span<std::byte> bytes() { return {storage_.data() + skip_, size_}; }
  AlignedBytes(AlignedBytes&&) noexcept = default;
  AlignedBytes& operator=(AlignedBytes&&) noexcept = default;

 private:
  std::vector<std::byte> storage_;
  size_t skip_ = 0;
  size_t size_ = 0;
};

// The views' arrays are copied. What is written is opened again before it is returned, so an
// unsound description is an error here, with the reader's reason. The same input gives the same
// bytes.
Result<std::vector<std::byte>> write_package(const Body& body, const Provenance& provenance);
Result<std::vector<std::byte>> write_package(const Avatar& avatar, const Budget& budget,
                                             const Provenance& provenance);
Result<std::vector<std::byte>> write_package(const Motion& motion, const Provenance& provenance);
// own: one for each member, what its provenance has beside the package's (population_writer.h makes
// all four).
Result<std::vector<std::byte>> write_package(const Population& population, const Budget& budget,
                                             const Provenance& provenance,
                                             std::span<const Provenance> own);
// Of a golden frame with a picture or a hash: refused (sampler_writer.h leaves both out).
Result<std::vector<std::byte>> write_package(const Sampler& sampler, const Budget& budget,
                                             const Provenance& provenance);

}  // namespace figurine
