// What figurine.h says of the library itself: its version, its codes, its instruction sets.
#include <algorithm>

#include "figurine.h"
#include "figurine/check.h"
#include "figurine/renderer.h"
#include "runtime/src/c/isa.h"
#include "runtime/src/c/report.h"

namespace figurine::c {

static_assert(FIG_ISA_BASELINE == 1 + static_cast<int>(Isa::kBaseline));
static_assert(FIG_ISA_AVX512 == 1 + static_cast<int>(Isa::kAvx512));

Result<std::optional<Isa>> isa_of(fig_isa isa) {
  if (isa == FIG_ISA_BEST) return std::optional<Isa>();
  if (isa > FIG_ISA_AVX512)
    return invalid("isa: " + std::to_string(static_cast<int>(isa)) + " is no instruction set");
  return std::optional<Isa>(static_cast<Isa>(isa - 1));
}

fig_isa c_isa(Isa isa) { return static_cast<fig_isa>(1 + static_cast<int>(isa)); }

}  // namespace figurine::c

using namespace figurine;

const char* fig_version(void) { return FIGURINE_VERSION; }
const char* fig_network_library(void) { return network_library(); }

const char* fig_status_name(fig_status status) {
  return status > FIG_INTERRUPTED ? "unknown status" : to_string(static_cast<StatusCode>(status));
}

void fig_set_check_handler(fig_check_handler handler, void* user) {
  set_check_handler(handler, user);
}

const char* fig_isa_name(fig_isa isa) {
  if (isa > FIG_ISA_AVX512) return "unknown instruction set";
  return isa == FIG_ISA_BEST ? "best" : to_string(static_cast<Isa>(isa - 1));
}

int fig_isa_supported(fig_isa isa) {
  if (isa > FIG_ISA_AVX512) return 0;
  const std::span<const Isa> all = supported_isas();
  return isa == FIG_ISA_BEST ||
                 std::find(all.begin(), all.end(), static_cast<Isa>(isa - 1)) != all.end()
             ? 1
             : 0;
}
