// What a package's contents take in containers: an upper bound, by its index alone, so that the
// memory can be asked for before anything is read, and a forged index that says one text a million
// times is refused.
#pragma once

#include <cstdint>

#include "figurine/status.h"
#include "package_generated.h"

namespace figurine {

// Bytes that reading the index, which passed the Verifier, allocates at most at once.
// kLimitExceeded if they are more than layout::kMaxReadingBytes.
Result<uint64_t> find_reading_bytes(const schema::Index& index);

}  // namespace figurine
