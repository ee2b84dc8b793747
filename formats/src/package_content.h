// What a package's numbers mean: turns an opened container into a Body, an Avatar or a Motion whose spans point into the package's bytes,
// or says in one line which field cannot be true. Nothing here writes, repairs or guesses.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "formats/src/package_container.h"

namespace figurine {

Status read_conventions(const schema::Conventions& conventions);
Status read_provenance(const schema::Provenance& table, Provenance& out);
Status read_body(const schema::Index& index, BlobReader& blobs, Body& out);
Status read_avatar(const schema::Index& index, BlobReader& blobs, const Budget& budget, Avatar& out);
Status read_motion(const schema::Index& index, BlobReader& blobs, Motion& out);

// Shared checks.
Status read_text(const flatbuffers::String* text, const std::string& field, uint32_t max_bytes, std::string& out, bool allow_lines = false);
// 1 to kMaxJoints names, none empty, none twice.
Status read_joint_names(const flatbuffers::Vector<flatbuffers::Offset<flatbuffers::String>>& list, const std::string& field,
                        std::vector<std::string>& out);
// All finite and of magnitude at most max.
Status check_magnitude(std::span<const float> values, const std::string& field, float max);

}  // namespace figurine
