// Whether sampled people differ part by part: hair and face, what is worn above and below, skin,
// build. People that nobody is, put together of parts that somebody has, score; averages, whose
// parts are nearer to the mean than anybody's, do not (docs/numerics.md, "Generation").
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <vector>

#include "toolchain/measure/weight_space.h"

namespace figurine::generation {

// A part of people: its tokens together.
struct PartStretch {
  std::string name;  // "head", "upper_body", "lower_body", "hands", "other"; "build": the shape
  std::vector<measure::Token> tokens;
};
// Of a layout's tokens ("static.G.PART.P", "shape"); none of others. Parts in the order in which
// they come.
std::vector<PartStretch> parts_of(const std::vector<measure::Token>& tokens);

// {"parts": [{"part", "median_ratio", "copy_share", "members_met", "spread"}], "mixed_share",
// "combinations"}; empty where there are no parts. samples: [S,D], training: [N,D], standardised.
//
//   median_ratio, copy_share, members_met   as in novelty.h, over the part's values
//   spread         root mean square of the samples' part about their mean, over the members'
//   mixed_share    of samples: parts nearest to two members or more, and every part as far from the
//                  members' mean as all but 5 % of members are
//   combinations   how many different ones there are among those, over the samples
nlohmann::json describe_parts(const std::vector<PartStretch>& parts,
                              const measure::RowMatrix& samples,
                              const measure::RowMatrix& training);

}  // namespace figurine::generation
