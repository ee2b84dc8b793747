// Hands for hostile packages: buffers that end where the bytes end, a seal that can be renewed
// after the bytes were bent, and a walk over everything an opened package gives out.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "figurine/package.h"
#include "formats/src/package/layout.h"

namespace figurine::samples {

// A 64-byte-aligned heap block of exactly the given size: the address sanitizer sees a read one
// byte behind it.
class ExactBytes {
 public:
  explicit ExactBytes(std::span<const std::byte> source);
  ~ExactBytes();
  ExactBytes(const ExactBytes&) = delete;
  std::span<std::byte> bytes() const { return bytes_; }

 private:
  std::span<std::byte> bytes_;
};

// Memory between two pages that may not be touched. bytes(n) ends at the second one; it is 64-byte
// aligned if n is a multiple of 64.
class GuardedBytes {
 public:
  explicit GuardedBytes(size_t capacity);
  ~GuardedBytes();
  GuardedBytes(const GuardedBytes&) = delete;
  std::span<std::byte> bytes(size_t size) const { return {end_ - size, size}; }

 private:
  std::byte* map_ = nullptr;
  size_t map_bytes_ = 0;
  std::byte* end_ = nullptr;
};

// Where a sound package keeps its checksums, so that they can be made true again after a change:
// what is left to refuse the package then is its meaning alone.
class Seal {
 public:
  explicit Seal(std::span<const std::byte> sound_package);

  // Position in the file of blob i's extent: offset u64, size u64, checksum u64.
  size_t extent_at(size_t blob) const { return extents_[blob]; }
  size_t blob_count() const { return extents_.size(); }
  // Recomputes the checksums of blobs, index and header; what reaches past the end is left alone.
  void renew(std::span<std::byte> bytes) const;

 private:
  std::vector<size_t> extents_;
};

// Makes any 64 bytes or more a package as far as header and checksums go: for fuzzing, where nobody
// knows what was sound before.
void renew_what_looks_like_a_package(std::span<std::byte> bytes);

layout::Header get_header(std::span<const std::byte> bytes);
void put_header(std::span<std::byte> bytes, layout::Header header);  // seals the header
void put_u64(std::span<std::byte> bytes, size_t at, uint64_t value);
uint64_t get_u64(std::span<const std::byte> bytes, size_t at);

// Reads every value, draws a body's maps, walks every pose, compares the network's shapes with its
// weights, and multiplies by a sampler's matrices. False, with the reason, if something is not what
// an opened package promises.
bool exercise(const Package& package, std::string& reason);

}  // namespace figurine::samples
