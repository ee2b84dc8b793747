// A package just written, opened again, for tests that compare what went in with what comes out.
#pragma once

#include <cstring>
#include <span>
#include <utility>
#include <vector>

#include "figurine/check.h"
#include "figurine/package.h"
#include "formats/writer/package_writer.h"

namespace figurine::samples {

struct Opened {
  AlignedBytes bytes;
  Package package;
};

inline Opened open_or_die(const Result<std::vector<std::byte>>& written) {
  FIG_CHECK(written.ok(), written.status().message().c_str());
  AlignedBytes bytes(*written);
  Result<Package> package = Package::open(bytes.bytes(), "sample");
  FIG_CHECK(package.ok(), package.status().message().c_str());
  return {std::move(bytes), std::move(package).value()};
}

// To the bit.
template <class T>
bool same(std::span<const T> a, std::span<const T> b) {
  return a.size() == b.size() &&
         (a.empty() || std::memcmp(a.data(), b.data(), a.size_bytes()) == 0);
}

}  // namespace figurine::samples
