// The static parts of a population's members against their mean (figurine/population.h), entropy
// coded: a member's integers come back as they are.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "figurine/avatar.h"
#include "figurine/detail/rans.h"

namespace figurine {

// The mean of parts of the same groups, each channel rounded to 127 levels of either sign.
class MeanStaticPart {
 public:
  explicit MeanStaticPart(std::span<const StaticPart* const> parts);
  const StaticPart& view() const { return part_; }  // borrows from this object

 private:
  std::vector<std::vector<int8_t>> values_;  // [groups]
  std::vector<std::vector<float>> scale_;
  StaticPart part_;
};

// The arrays behind a Population's static spans. K channels of all groups together.
struct StaticCodes {
  std::vector<float> scale;        // [M,K]
  std::vector<int16_t> frequency;  // [K,255]
  std::vector<uint8_t> code;
  std::vector<uint32_t> code_end;  // [M]
};

// mean and parts: of the same groups and sizes. kLimitExceeded if the streams are longer than 4
// GiB.
Result<StaticCodes> encode_static_parts(const StaticPart& mean,
                                        std::span<const StaticPart* const> parts);

// Same channels, grids and numbers of values.
bool same_groups(const StaticPart& a, const StaticPart& b);

}  // namespace figurine
