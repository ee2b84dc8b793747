// What a package says of itself, as one JSON document: the tool prints it, as JSON or as text, and
// compares two of them.
#pragma once

#include <cstddef>
#include <nlohmann/json.hpp>
#include <span>
#include <string>

#include "figurine/package.h"

namespace figurine::inspect {

// Keys in reading order.
using Json = nlohmann::ordered_json;

// The document of docs/package.md, "figurine-inspect --json", without tensors.
Json describe(const Package& package, const std::string& path);

// [{name, type, shape, offset_bytes, size_bytes, min, max, mean, checksum}], in the order of the
// file. bytes: of the whole package.
Json describe_tensors(const Package& package, std::span<const std::byte> bytes);

// {a, b, same, fields: [{field, a, b}], tensors: [{name, ...}]}: what differs, and nothing else.
Json compare(const Package& a, std::span<const std::byte> a_bytes, const std::string& a_path,
             const Package& b, std::span<const std::byte> b_bytes, const std::string& b_path);

}  // namespace figurine::inspect
