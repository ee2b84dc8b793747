// Avatars as one population package: what they share is stated once, their weights become
// differences to common initial weights.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "figurine/package.h"

namespace figurine {

inline constexpr uint32_t kMostLevels = 127;  // of either sign, beside zero

struct NewMember {
  const Avatar* avatar =
      nullptr;  // float weights; no picture and no hash of its golden frame is taken over. Of kNone
                // it may lack a network, which is the shared one's with its pose statistics
  const Provenance* provenance = nullptr;  // quality included
  Split split = Split::kTrain;
};

struct NewPopulation {
  std::string name;
  Network initial;  // with weights
  // Of kNone: whose kind, maps and mean map all members share; `initial` is its network. Null
  // otherwise: then the mean map is that of the members.
  const Avatar* shared = nullptr;
  DifferenceCoding coding = DifferenceCoding::kInt8;
  uint32_t levels =
      kMostLevels;  // of kInt8: fewer are coarser and take less, log2(127 / levels) bits a weight
  std::vector<NewMember> members;
  Budget budget;
  std::vector<KeyValue> settings;  // of the population itself, behind those that all members share
  // Told after every member; false ends the work with kInterrupted.
  std::function<bool(size_t done)> progress;
};

// kMismatch "member 'NAME': ..." if a member has another network shape, body, template, number of
// shape coefficients or of joints, or other static groups than the first, or is nothing but fixed
// point; kLimitExceeded if a difference does not fit. The bytes are opened again before they are
// returned.
//
//   kInt8: scale = max |w - w0| / levels over an output channel's kernel, q = round((w - w0) /
//   scale), to nearest, ties to even
Result<std::vector<std::byte>> write_population(const NewPopulation& population);

}  // namespace figurine
