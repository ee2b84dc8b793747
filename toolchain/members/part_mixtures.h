// People put together of two by part: the head of one on another, a jacket, trousers. A member's
// map says texel by texel what it looks like, so the cells of a part are taken from another
// member's map; shape, network and all else stay those of whom the part is put on.
#pragma once

#include <array>
#include <cstddef>
#include <nlohmann/json_fwd.hpp>
#include <vector>

#include "toolchain/measure/part_exchange.h"
#include "toolchain/members/mixtures.h"

namespace figurine::members {

// What is told and shown of a pair: the two themselves, and a with a part of b's.
enum class PartRow : uint8_t { kA, kB, kHead, kUpperBody, kLowerBody };
inline constexpr std::array kPartRows{PartRow::kA, PartRow::kB, PartRow::kHead, PartRow::kUpperBody,
                                      PartRow::kLowerBody};

// a, b, or a with b's part. a and b must be of the population whose layout and parts these are.
// Borrows from the storage.
Avatar part_row(const measure::WeightLayout& layout, const measure::PartExchange& parts,
                const Avatar& a, const Avatar& b, PartRow row, measure::WeightStorage& storage);

// {"seam_texels", "texels": {"head", "upper_body", "lower_body"}, "pairs": [{"a", "b", "why",
// "rows": [...]}]}: a mixture's description for every row, which is called "of": "a", "b", "head",
// "upper_body" or "lower_body".
nlohmann::json measure_part_mixtures(const MemberSet& set, const measure::PartExchange& parts,
                                     const std::vector<MixedPair>& pairs);

}  // namespace figurine::members
