// What a capture's poses and shape are said in.
#pragma once

#include <string>

#include "figurine/body.h"

namespace figurine::dataset {

// XXH3-128, 32 hex digits, of the joints (names, parents, rest positions and their shape basis)
// and of nothing else. Bodies of one mesh that differ in where their texels lie have one skeleton:
// what was captured with one of them trains on the others, too.
std::string skeleton_hash(const Body& body);

}  // namespace figurine::dataset
