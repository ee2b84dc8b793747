// What makes two avatars draw the same, as one hash: a renderer holds once what was added twice, a
// crowd of one person for example.
//
// By content and not by address: a caller may use the same storage for one person after another.
#pragma once

#include <array>
#include <cstdint>

#include "figurine/avatar.h"
#include "figurine/body.h"

namespace figurine {

using AvatarIdentity = std::array<uint64_t, 2>;  // XXH3-128 (low, high)

// Names, golden frames and pose statistics without a table of distances do not count: nothing of a
// frame depends on them.
AvatarIdentity identify(const Avatar& avatar, const Body& body, Precision precision);

}  // namespace figurine
