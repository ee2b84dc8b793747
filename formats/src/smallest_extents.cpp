// Whether an avatar's smallest extents mean something at every texel of a body.
#include <string>

#include "figurine/avatar.h"

namespace figurine {
namespace {

Status fault(const std::string& what) {
  return Status(StatusCode::kCorrupt, "smallest extents: " + what);
}

}  // namespace

Status validate_smallest_extents(const SmallestExtents& extents, uint32_t uv_size) {
  if (extents.empty()) return extents.scale_m == 0 ? Status() : fault("a scale without codes");
  // Written so that NaN is refused.
  if (!(extents.scale_m >= kLeastExtentScale_m && extents.scale_m <= kMostExtentScale_m))
    return fault("the scale is not within 1e-9 and 0.1 m");
  if (extents.codes.size() > uint64_t{uv_size} * uv_size)
    return fault("more codes than the map has texels");
  return {};
}

Status validate_smallest_extents(const SmallestExtents& extents, const Body& body) {
  FIG_RETURN_IF_ERROR(validate_smallest_extents(extents, body.uv_size));
  if (extents.empty() || extents.codes.size() == body.texel_count()) return {};
  return fault(std::to_string(extents.codes.size()) + " codes, the body has " +
               std::to_string(body.texel_count()) + " texels");
}

}  // namespace figurine
