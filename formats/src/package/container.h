// The container of a package: header, index and blobs, verified up to the point where the bytes are
// known to be whole and in place, and the blobs can be asked for by name. What the numbers mean is
// checked by package_content.h.
#pragma once

#include <initializer_list>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "figurine/package.h"
#include "formats/src/package/layout.h"
#include "formats/src/package/refusal.h"
#include "package_generated.h"

namespace figurine {

struct BlobView {
  TensorInfo info;
  std::span<const std::byte> bytes;
  bool optional = false;
};

struct Container {
  layout::Header header;
  const schema::Index* index = nullptr;  // in the caller's bytes, passed the flatbuffers Verifier
  std::vector<BlobView> blobs;
  std::array<uint64_t, 2> content_hash{0, 0};
};

// Stages one to four: size, magic, header checksum, version, features, kind, exact length; index
// checksum; Verifier; blobs in order, in range, without gaps or overlaps, zero padding, checksums.
Result<Container> open_container(std::span<const std::byte> bytes);

// Hands out blobs as typed arrays and remembers which were asked for.
class BlobReader {
 public:
  explicit BlobReader(const std::vector<BlobView>& blobs);

  enum Presence { kRequired, kMayBeAbsent };
  static constexpr uint32_t kAny = UINT32_MAX;  // a length that the blob decides

  // kCorrupt, naming the blob, if it is missing, of another type, or of another shape. An absent
  // blob gives an empty span.
  template <class T>
  Status read(std::string_view name, std::initializer_list<uint32_t> shape, std::span<const T>& out,
              Presence presence = kRequired);

  // kUnsupported if a blob was never asked for and is not optional.
  Status check_all_known() const;

 private:
  Status find(std::string_view name, DataType type, std::initializer_list<uint32_t> shape,
              Presence presence, const BlobView*& out);

  struct Entry {
    const BlobView* blob = nullptr;
    bool asked = false;
  };
  std::map<std::string_view, Entry> entries_;
};

}  // namespace figurine
