// A sampler as a package: what package_writer.h does for a description that is already as a package
// has it, for one that comes from training.
#pragma once

#include <cstddef>
#include <vector>

#include "figurine/package.h"

namespace figurine {

struct NewSampler {
  const Sampler* sampler =
      nullptr;    // its arrays are copied; no picture and no hash of its golden frame is taken over
  Budget budget;  // of one avatar that it samples
  Provenance provenance;  // of the members that it learnt from, and of its own training
};

// kInvalidArgument "sampler 'NAME': field: ..." if an array's length does not fit the shapes; the
// reader's reason if a number cannot be: the bytes are opened again before they are returned.
Result<std::vector<std::byte>> write_sampler(const NewSampler& sampler);

}  // namespace figurine
