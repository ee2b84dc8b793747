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
  std::span<const std::byte> bytes;  // not to be read unless info.wanted
  bool optional = false;
};

// Which blobs OpenOptions leave of a package, by their names. An avatar keeps its only weights.
struct WantedParts {
  bool float_weights = true, fixed_point = true, golden_picture = true, pose_statistics = true,
       mesh_places = true;
  static WantedParts of(const OpenOptions& options, const schema::Index& index);
  bool holds(std::string_view name) const;
};

struct Container {
  layout::Header header;
  const schema::Index* index = nullptr;  // in the caller's bytes, passed the flatbuffers Verifier
  std::vector<BlobView> blobs;
  std::array<uint64_t, 2> content_hash{0, 0};
  WantedParts wanted;
};

// Size, magic, header checksum, version, features, kind, exact length; index checksum; Verifier.
// Without blobs, of which nothing is read.
Result<Container> open_index(std::span<const std::byte> bytes);
// Then, of what open_index() returned for the same bytes, blobs in order, in range, without gaps or
// overlaps; of those that are wanted, zero padding behind them and checksums.
Result<Container> open_blobs(const Container& indexed, std::span<const std::byte> bytes,
                             const OpenOptions& options);

// Hands out blobs as typed arrays and remembers which were asked for.
class BlobReader {
 public:
  explicit BlobReader(const Container& container);

  const WantedParts& wanted() const { return wanted_; }

  enum Presence { kRequired, kMayBeAbsent };
  static constexpr uint32_t kAny = UINT32_MAX;  // a length that the blob decides

  // kCorrupt, naming the blob, if it is missing, of another type, or of another shape. An absent
  // blob gives an empty span, and so does one that is not wanted.
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
  WantedParts wanted_;
};

}  // namespace figurine
