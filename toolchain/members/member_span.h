// How well the training members' principal directions reach members that they never saw, and how
// many directions there are.
#pragma once

#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "toolchain/members/member_set.h"

namespace figurine::members {

// Principal directions of the training part: of every token, of every kind of weight that the
// population has ("kernels": convolutions; "map": static values), and of everything at once.
struct MemberBases {
  struct Kind {
    std::string name;
    measure::WeightLayout::TokenRange tokens;
    measure::PrincipalBasis basis;
  };
  std::vector<measure::PrincipalBasis> tokens;  // [L]
  std::vector<Kind> kinds;
  measure::PrincipalBasis whole;
};
MemberBases make_bases(const MemberSet& set);

// The spectrum of the training part: {"whole": {...}, "by_kind": {"kernels": {...}, "map": {...}},
// "tokens": [{...}]}, each with "entries" (that vary), "shared" (that do not), "directions",
// "directions_for" {"50", "90", "99"}, "participation_ratio" and "variance_share" (of every
// direction, descending); of a kind also "share_of_whole", its share of the whole's variance.
nlohmann::json describe_spectrum(const MemberSet& set, const MemberBases& bases);

// Held-out members projected onto the first r directions of every token ("per_layer") and of
// everything at once ("whole"), and drawn beside themselves (docs/numerics.md, "Weight space");
// "by_kind": token by token in one kind alone, all else kept. null without held-out members. Ranks
// beyond N - 1 are left out, N - 1 is always there.
nlohmann::json measure_span(const MemberSet& set, const MemberBases& bases,
                            std::vector<uint32_t> ranks);

}  // namespace figurine::members
