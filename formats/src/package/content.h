// What a package's numbers mean: turns an opened container into a Body, an Avatar, a Motion, a
// Population or a Sampler whose spans point into the package's bytes, or says in one line which
// field cannot be true. Nothing here writes, repairs or guesses.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "formats/src/package/container.h"

namespace figurine {

Status read_conventions(const schema::Conventions& conventions);
Status read_provenance(const schema::Provenance& table, Provenance& out);
Status read_body(const schema::Index& index, BlobReader& blobs, Body& out);
Status read_avatar(const schema::Index& index, BlobReader& blobs, const Budget& budget,
                   Avatar& out);
Status read_motion(const schema::Index& index, BlobReader& blobs, Motion& out);

struct PopulationContent {
  Population population;
  std::vector<Provenance>
      own;  // [M] what a member's provenance has beside the package's; quality is in the population
};
Status read_population(const schema::Index& index, BlobReader& blobs, const Budget& budget,
                       PopulationContent& out);
Status read_sampler(const schema::Index& index, BlobReader& blobs, const Budget& budget,
                    Sampler& out);

// Shared checks.
Status read_text(const flatbuffers::String* text, const std::string& field, uint32_t max_bytes,
                 std::string& out, bool allow_lines = false);
// 1 to kMaxJoints names, none empty, none twice.
Status read_joint_names(const flatbuffers::Vector<flatbuffers::Offset<flatbuffers::String>>& list,
                        const std::string& field, std::vector<std::string>& out);
// All finite and of magnitude at most max.
Status check_magnitude(std::span<const float> values, const std::string& field, float max);

// Parts of an avatar that a population's members and a sampler's avatars have too. owner: "avatar",
// "sampler"; what messages call it.
Status read_map_statistics(const schema::MapStatistics& table, std::string_view owner,
                           MapStatistics& out);
Status read_decoding(const schema::HeadDecoding& table, std::string_view owner, HeadDecoding& out);
// Layers and input, no weights; the shapes fit each other.
enum class NoNetwork : bool { kRefused, kAllowed };  // no layers, and no input
Status read_layers(const schema::Network& table, NoNetwork none, Network& out);
// Table: schema::Avatar, schema::Population or schema::Sampler, whose fields of one name are one
// thing. The network has no weights yet.
template <class Table>
Status read_kind(const Table& table, std::string_view owner, AvatarKind& out,
                 NoNetwork none = NoNetwork::kRefused) {
  FIG_RETURN_IF_ERROR(read_text(table.body_name(), concatenate({owner, ".body_name"}),
                                layout::kMaxNameBytes, out.body_name));
  FIG_RETURN_IF_ERROR(read_text(table.preset(), concatenate({owner, ".preset"}),
                                layout::kMaxNameBytes, out.preset));
  out.body_hash = {table.body_hash_low(), table.body_hash_high()};
  if (table.template_mode() > schema::TemplateMode::MAX)
    return unsupported(concatenate({owner, ".template_mode"}), "is unknown");
  out.template_mode = static_cast<TemplateMode>(table.template_mode());
  out.fourier_octaves = table.fourier_octaves();
  return read_layers(*table.network(), none, out.network);
}
// Table: schema::Avatar, schema::Member or schema::Sampler. The golden frame is the caller's.
template <class Table>
Status read_maps_and_head(const Table& table, std::string_view owner, AvatarTraits& out) {
  FIG_RETURN_IF_ERROR(read_map_statistics(*table.map_statistics(), owner, out.map_statistics));
  return read_decoding(*table.decoding(), owner, out.decoding);
}
// "prefix.i.weights" and "prefix.i.bias" of every convolution, finite.
Status read_convolutions(BlobReader& blobs, std::string_view prefix, BlobReader::Presence presence,
                         Network& out);
// "fixed.i.weights", ".scale" and ".bias" of every convolution; out has its values already, and is
// not validated.
Status read_fixed_convolutions(BlobReader& blobs, const Network& network, FixedPointNetwork& out);
// Texels a side, and the network's grid over them. The network has its layers already.
Status read_uv_size(uint32_t stated, const AvatarKind& kind, std::string_view owner, uint32_t& out);
// The listed groups, over texels of uv_size a side. None: no list.
using StaticGroupList = flatbuffers::Vector<flatbuffers::Offset<schema::StaticGroup>>;
Status read_static_part(const StaticGroupList* list, std::string_view owner, uint32_t uv_size,
                        BlobReader& blobs, StaticPart& out);
// The declared Gaussians against the map of uv_size texels a side.
Status check_gaussians(const Budget& budget, uint32_t uv_size);
// The network against maps, head and budget; the avatar's weights are not looked at.
Status check_network_fits(const AvatarKind& kind, const HeadDecoding& decoding,
                          std::string_view owner, const Budget& budget);
// The listed joints of pose statistics: 1 to 255, none twice.
Status read_statistics_joints(const flatbuffers::Vector<uint8_t>& list, const std::string& field,
                              std::vector<uint8_t>& out);
Status read_pose_statistics(const schema::PoseStatistics& table, std::string_view owner,
                            BlobReader& blobs, PoseStatistics& out);
// Symmetric, positive definite beyond rounding, at most 1e4.
Status check_covariance(std::span<const float> covariance, size_t n, const std::string& field);
// Camera, background and root translation of a golden frame, without its rotations.
Status read_golden_view(const schema::GoldenFrame& table, GoldenFrame& out);
// out.rotations with the translation: at most kMaxJoints finite rotations that are none of zero
// length.
Status check_golden_pose(const GoldenFrame& golden);
// All of a golden frame: view, pose, hash, and the picture if there is one.
Status read_golden(const schema::GoldenFrame& table, BlobReader& blobs, GoldenFrame& out);

}  // namespace figurine
