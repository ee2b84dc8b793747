// A population at a glance: everybody on one wall, whole or as busts, mixtures in strips, the worst
// large. Mid-grey throughout, one scale and one ground for all, so that heights compare; who is who
// follows from the order.
#pragma once

#include <cstddef>
#include <vector>

#include "ports/media/image.h"
#include "toolchain/measure/weight_space.h"
#include "toolchain/members/member_set.h"
#include "toolchain/members/mixtures.h"
#include "toolchain/members/part_mixtures.h"

namespace figurine::members {

// Everybody once, training, validation and test members apart, each part sorted by name; cells are
// smaller where there are many. Of the head and shoulders alone: set.has_busts().
ports::ImageU8 draw_wall(const MemberSet& set);
ports::ImageU8 draw_bust_wall(const MemberSet& set);
// A row for each pair, from the first member over the mixtures of kMixSteps to the second.
ports::ImageU8 draw_mixtures(const MemberSet& set, const std::vector<MixedPair>& pairs);
// A row for each pair: the two, a thin line, and the first with the second's head, upper body and
// lower body. The parts are the set's body's.
ports::ImageU8 draw_part_mixtures(const MemberSet& set, const measure::PartExchange& parts,
                                  const std::vector<MixedPair>& pairs);
// The given members in their order, each from the front and from behind.
ports::ImageU8 draw_close(const MemberSet& set, const std::vector<size_t>& members);

// A row for each set of standardised weights [S,W]: its first `people`, from the front; all else is
// the first training member's.
ports::ImageU8 draw_people(const MemberSet& set, const std::vector<measure::RowMatrix>& sets,
                           size_t people);

// Of the best quality (at most 92) that stays below max_bytes, down to 60.
std::vector<std::byte> encode_sheet(const ports::ImageU8& sheet, size_t max_bytes);

}  // namespace figurine::members
