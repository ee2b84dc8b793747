// Instruction sets between figurine.h and figurine/isa.h.
#pragma once

#include <optional>

#include "figurine.h"
#include "figurine/isa.h"
#include "figurine/status.h"

namespace figurine::c {

// None for the best. kInvalidArgument for a number that is none.
Result<std::optional<Isa>> isa_of(fig_isa isa);
fig_isa c_isa(Isa isa);

}  // namespace figurine::c
