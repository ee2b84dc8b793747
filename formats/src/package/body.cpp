// The meaning of a body package: a skeleton whose parents come first, texels in order on the map,
// weights that are weights.
#include <cmath>

#include "figurine/detail/memory_reserve.h"
#include "formats/src/package/content.h"

namespace figurine {

namespace {

Status check_parents(const Body& body) {
  if (body.parents[0] != -1) return corrupt("body.parents", "joint 0 is not the root (parent -1)");
  for (size_t j = 1; j < body.parents.size(); ++j) {
    if (body.parents[j] < 0 || size_t(body.parents[j]) >= j) {
      return corrupt("body.parents", "joint ", j, ": parent ", body.parents[j],
                     " is not an earlier joint");
    }
  }
  return {};
}

Status check_texels(const Body& body) {
  const uint32_t joints = body.joint_count();
  for (size_t i = 0; i < body.texel.size(); ++i) {
    if (body.texel[i] >= body.uv_size * body.uv_size)
      return corrupt("body.texel", "texel ", i, ": lies outside the map");
    if (i > 0 && body.texel[i] <= body.texel[i - 1])
      return corrupt("body.texel", "texel ", i, ": is not after the one before");
    if (!(body.texel_spacing_m[i] > 0 && body.texel_spacing_m[i] <= layout::kMaxLengthM)) {
      return corrupt("body.texel_spacing", "texel ", i, ": is not a positive length");
    }
    double normal2 = 0, weights = 0;
    for (size_t k = 0; k < 3; ++k)
      normal2 += double(body.texel_normal[i * 3 + k]) * body.texel_normal[i * 3 + k];
    if (!(std::fabs(std::sqrt(normal2) - 1) <= 1e-3))
      return corrupt("body.texel_normal", "texel ", i, ": is not of unit length");
    for (size_t k = i * kSkinInfluences; k < (i + 1) * kSkinInfluences; ++k) {
      if (body.texel_joints[k] >= joints) {
        return corrupt("body.texel_joints", "texel ", i, ": joint ", body.texel_joints[k], " of ",
                       joints);
      }
      if (!(body.texel_weights[k] >= 0))
        return corrupt("body.texel_weights", "texel ", i, ": a weight is negative or not a number");
      weights += body.texel_weights[k];
    }
    if (!(std::fabs(weights - 1) <= 1e-4))
      return corrupt("body.texel_weights", "texel ", i, ": the weights sum to ", weights,
                     ", not 1");
  }
  return {};
}

Status check_mesh_places(const Body& body) {
  if (body.texel_triangle.empty() != body.texel_barycentric.empty()) {
    return corrupt("body.texel_triangle",
                   "and body.texel_barycentric: one is there without the other");
  }
  for (size_t i = 0; i < body.texel_triangle.size(); ++i) {
    double sum = 0;
    for (size_t k = 3 * i; k < 3 * i + 3; ++k) {
      if (!(body.texel_barycentric[k] >= -1e-4f && body.texel_barycentric[k] <= 1.0001f))
        return corrupt("body.texel_barycentric", "texel ", i, ": is not inside its triangle");
      sum += body.texel_barycentric[k];
    }
    if (!(std::fabs(sum - 1) <= 1e-4))
      return corrupt("body.texel_barycentric", "texel ", i, ": sums to ", sum, ", not 1");
  }
  return {};
}

Status check_border(const Body& body) {
  const size_t texels = size_t(body.uv_size) * body.uv_size;
  const MemoryReserve reserve(texels / 8);
  if (!reserve.held()) return no_memory();
  std::vector<bool> taken(texels, false);
  for (uint32_t texel : body.texel) taken[texel] = true;
  for (size_t i = 0; i < body.border_texel.size(); ++i) {
    if (body.border_texel[i] >= texels)
      return corrupt("body.border_texel", "entry ", i, ": lies outside the map");
    if (taken[body.border_texel[i]])
      return corrupt("body.border_texel", "entry ", i, ": is covered or there twice");
    taken[body.border_texel[i]] = true;
    if (body.border_source[i] >= body.texel_count())
      return corrupt("body.border_source", "entry ", i, ": is not a covered texel's row");
  }
  return {};
}

}  // namespace

Status read_body(const schema::Index& index, BlobReader& blobs, Body& out) {
  constexpr uint32_t kAny = BlobReader::kAny;
  constexpr BlobReader::Presence kMayBeAbsent = BlobReader::kMayBeAbsent;
  const schema::Body& table = *index.content_as_Body();
  FIG_RETURN_IF_ERROR(read_text(index.name(), "body.name", layout::kMaxNameBytes, out.name));
  FIG_RETURN_IF_ERROR(read_joint_names(*table.joint_names(), "body.joint_names", out.joint_names));
  out.uv_size = table.uv_size();
  if (out.uv_size < 1) return corrupt("body.uv_size", "is zero");
  if (out.uv_size > kMaxUvSize) return over_limit("body.uv_size", "is larger than ", kMaxUvSize);

  const uint32_t joints = static_cast<uint32_t>(out.joint_names.size());
  FIG_RETURN_IF_ERROR(blobs.read("body.parents", {joints}, out.parents));
  FIG_RETURN_IF_ERROR(blobs.read("body.joint_position", {joints, 3}, out.joint_position_m));
  FIG_RETURN_IF_ERROR(blobs.read("body.joint_shape_basis", {kAny, joints, 3},
                                 out.joint_shape_basis_m, kMayBeAbsent));
  FIG_RETURN_IF_ERROR(blobs.read("body.texel", {kAny}, out.texel));
  // Before the other arrays: T*T bounds what they may be.
  if (out.texel.size() > size_t(out.uv_size) * out.uv_size)
    return corrupt("body.texel", "covers more texels than the map has");
  const uint32_t texels = out.texel_count();
  FIG_RETURN_IF_ERROR(blobs.read("body.texel_position", {texels, 3}, out.texel_position_m));
  FIG_RETURN_IF_ERROR(blobs.read("body.texel_normal", {texels, 3}, out.texel_normal));
  FIG_RETURN_IF_ERROR(blobs.read("body.texel_joints", {texels, kSkinInfluences}, out.texel_joints));
  FIG_RETURN_IF_ERROR(
      blobs.read("body.texel_weights", {texels, kSkinInfluences}, out.texel_weights));
  FIG_RETURN_IF_ERROR(blobs.read("body.texel_spacing", {texels}, out.texel_spacing_m));
  FIG_RETURN_IF_ERROR(blobs.read("body.texel_shape_basis", {kAny, texels, 3},
                                 out.texel_shape_basis_m, kMayBeAbsent));
  FIG_RETURN_IF_ERROR(blobs.read("body.border_texel", {kAny}, out.border_texel, kMayBeAbsent));
  FIG_RETURN_IF_ERROR(blobs.read("body.border_source", {kAny}, out.border_source, kMayBeAbsent));
  FIG_RETURN_IF_ERROR(
      blobs.read("body.texel_triangle", {texels}, out.texel_triangle, kMayBeAbsent));
  FIG_RETURN_IF_ERROR(
      blobs.read("body.texel_barycentric", {texels, 3}, out.texel_barycentric, kMayBeAbsent));

  const uint32_t shapes = out.shape_count();
  if (shapes > kMaxShapeCoefficients) {
    return over_limit("body.joint_shape_basis", "has more than ", kMaxShapeCoefficients,
                      " coefficients");
  }
  if (out.texel_shape_basis_m.size() != size_t(shapes) * texels * 3) {
    return corrupt("body.texel_shape_basis",
                   "does not have as many coefficients as body.joint_shape_basis");
  }
  if (out.border_texel.size() != out.border_source.size())
    return corrupt("body.border_source", "is not as long as body.border_texel");

  FIG_RETURN_IF_ERROR(check_parents(out));
  FIG_RETURN_IF_ERROR(
      check_magnitude(out.joint_position_m, "body.joint_position", layout::kMaxLengthM));
  FIG_RETURN_IF_ERROR(
      check_magnitude(out.joint_shape_basis_m, "body.joint_shape_basis", layout::kMaxLengthM));
  FIG_RETURN_IF_ERROR(
      check_magnitude(out.texel_position_m, "body.texel_position", layout::kMaxLengthM));
  FIG_RETURN_IF_ERROR(
      check_magnitude(out.texel_shape_basis_m, "body.texel_shape_basis", layout::kMaxLengthM));
  FIG_RETURN_IF_ERROR(check_texels(out));
  FIG_RETURN_IF_ERROR(check_mesh_places(out));
  return check_border(out);
}

}  // namespace figurine
