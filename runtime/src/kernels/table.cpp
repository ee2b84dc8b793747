#include "runtime/src/kernels/table.h"

#include <algorithm>
#include <array>
#include <string>

#include "figurine/avatar.h"
#include "figurine/gaussian.h"

namespace figurine {

// The words of kernels stand alone (kernel.h). What they must agree with:
static_assert(kernels::kInfluences == kSkinInfluences && kernels::kMapPlanes == kMapChannels);
static_assert(kernels::kMaxShValues == 3 * sh_coefficients(kMaxShDegree));
static_assert(kernels::kDilationPx2 == kDilationPx2 &&
              kernels::kAntialiasedDilationPx2 == kAntialiasedDilationPx2 &&
              kernels::kAlphaMax == kAlphaMax &&
              kernels::kTransmittanceStop == kTransmittanceStop && kernels::kShOffset == kShOffset);
static_assert(kernels::kShapeValues == kStaticColour &&
              kernels::kShapeValues + 3 == kStaticChannels && kernels::kHalfColour == kHalfColour);

namespace kernels {
#define FIG_KERNEL(Type, operation, isa) Type operation##_##isa;
#include "runtime/src/kernels/kernels.inc"
#undef FIG_KERNEL
}  // namespace kernels

namespace {

constexpr std::array kIsas{Isa::kBaseline, Isa::kNeon, Isa::kSse41, Isa::kAvx2, Isa::kAvx512};

// What the rows' last words mean.
[[maybe_unused]] constexpr Isa baseline = Isa::kBaseline, neon = Isa::kNeon, sse41 = Isa::kSse41,
                               avx2 = Isa::kAvx2, avx512 = Isa::kAvx512;

// Later rows are for larger instruction sets and take the place of earlier ones.
constexpr KernelTable make_table(Isa isa) {
  KernelTable table{};
  table.isa = isa;
#define FIG_KERNEL(Type, operation, row) \
  if (row <= isa) table.operation = kernels::operation##_##row;
#include "runtime/src/kernels/kernels.inc"
#undef FIG_KERNEL
  return table;
}

constexpr std::array<KernelTable, kIsas.size()> kTables{
    make_table(Isa::kBaseline), make_table(Isa::kNeon), make_table(Isa::kSse41),
    make_table(Isa::kAvx2), make_table(Isa::kAvx512)};

constexpr bool has_rows(Isa isa) {
  bool found = false;
#define FIG_KERNEL(Type, operation, row) found = found || row == isa;
#include "runtime/src/kernels/kernels.inc"
#undef FIG_KERNEL
  return found;
}

bool cpu_runs(Isa isa) {
  switch (isa) {
    case Isa::kBaseline:
      return true;
    case Isa::kNeon:
#if defined(__aarch64__)
      return true;
#else
      return false;
#endif
#if defined(__x86_64__)
    case Isa::kSse41:
      return __builtin_cpu_supports("sse4.1") && __builtin_cpu_supports("popcnt");
    case Isa::kAvx2:
      return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
    case Isa::kAvx512:
      return __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512vl") &&
             __builtin_cpu_supports("avx512bw") && __builtin_cpu_supports("avx512dq");
#endif
    default:
      return false;
  }
}

struct SupportedIsas {
  SupportedIsas() {
    for (const Isa isa : kIsas) {
      if (has_rows(isa) && cpu_runs(isa)) isas[count++] = isa;
    }
  }
  std::array<Isa, kIsas.size()> isas{};
  size_t count = 0;
};

}  // namespace

const char* to_string(Isa isa) {
  switch (isa) {
    case Isa::kBaseline:
      return "baseline";
    case Isa::kNeon:
      return "neon";
    case Isa::kSse41:
      return "sse41";
    case Isa::kAvx2:
      return "avx2";
    case Isa::kAvx512:
      return "avx512";
  }
  return "unknown instruction set";
}

std::optional<Isa> isa_from_string(std::string_view name) {
  for (const Isa isa : kIsas) {
    if (name == to_string(isa)) return isa;
  }
  return std::nullopt;
}

std::span<const Isa> supported_isas() {
  static const SupportedIsas supported;
  return {supported.isas.data(), supported.count};
}

Result<const KernelTable*> kernels_for(Isa isa) {
  const std::span<const Isa> supported = supported_isas();
  if (std::find(supported.begin(), supported.end(), isa) != supported.end()) {
    return &kTables[static_cast<size_t>(isa)];
  }
  const bool in_build = std::find(kIsas.begin(), kIsas.end(), isa) != kIsas.end() && has_rows(isa);
  return Status(StatusCode::kUnsupported,
                std::string("isa '") + to_string(isa) + "': " +
                    (in_build ? "this CPU does not run it" : "this build has no kernels for it"));
}

const KernelTable& best_kernels() { return kTables[static_cast<size_t>(supported_isas().back())]; }

}  // namespace figurine
