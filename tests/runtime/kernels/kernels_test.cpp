// Every row of kernels.inc against the baseline's kernel of the same operation, to the bit; and
// that no instruction set of this CPU went untested.
#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "runtime/kernels/random_jobs.h"
#include "runtime/src/kernels/table.h"

namespace figurine::kernels {
#define FIG_KERNEL(Type, operation, isa) Type operation##_##isa;
#include "runtime/src/kernels/kernels.inc"
#undef FIG_KERNEL
}  // namespace figurine::kernels

namespace figurine::kernels_test {
namespace {

std::set<Isa>& ran() {
  static std::set<Isa> isas;
  return isas;
}

bool is_supported(Isa isa) {
  const std::span<const Isa> supported = supported_isas();
  return std::find(supported.begin(), supported.end(), isa) != supported.end();
}

template <class Type>
void run_row(const char* isa_name, Type* kernel, Type* baseline) {
  const std::optional<Isa> isa = isa_from_string(isa_name);
  ASSERT_TRUE(isa) << isa_name << ": no instruction set of figurine/isa.h";
  if (!is_supported(*isa)) {
    std::printf("%s: not on this CPU\n", isa_name);
    return;
  }
  ran().insert(*isa);
  kernels::tests::compare(kernel, baseline);
}

#define FIG_KERNEL(Type, operation, isa)                                                     \
  TEST(KernelRows, operation##_##isa##_EqualsTheBaseline) {                                  \
    run_row<kernels::Type>(#isa, kernels::operation##_##isa, kernels::operation##_baseline); \
  }
#include "runtime/src/kernels/kernels.inc"
#undef FIG_KERNEL

// Behind the rows, which have run by now unless a filter left them out.
TEST(KernelRows, ZEveryInstructionSetOfThisCpuRan) {
  if (::testing::GTEST_FLAG(filter) != "*") return;
  for (const Isa isa : supported_isas()) EXPECT_TRUE(ran().count(isa)) << to_string(isa);
}

TEST(KernelTables, EveryOperationHasAKernel) {
  for (const Isa isa : supported_isas()) {
    const Result<const KernelTable*> table = kernels_for(isa);
    ASSERT_TRUE(table.ok()) << table.status().message();
    EXPECT_EQ((*table)->isa, isa);
#define FIG_KERNEL(Type, operation, row) EXPECT_NE((*table)->operation, nullptr);
#include "runtime/src/kernels/kernels.inc"
#undef FIG_KERNEL
  }
}

TEST(KernelTables, TheBaselineIsTheBaseline) {
  const Result<const KernelTable*> table = kernels_for(Isa::kBaseline);
  ASSERT_TRUE(table.ok());
  EXPECT_EQ(supported_isas().front(), Isa::kBaseline);
  EXPECT_EQ((*table)->blend_tile, kernels::blend_tile_baseline);
  EXPECT_EQ(best_kernels().isa, supported_isas().back());
}

TEST(KernelTables, AnInstructionSetThatIsNotThereIsRefusedByName) {
  for (const Isa isa : {Isa::kNeon, Isa::kSse41, Isa::kAvx2, Isa::kAvx512}) {
    if (is_supported(isa)) continue;
    const Result<const KernelTable*> table = kernels_for(isa);
    ASSERT_FALSE(table.ok());
    EXPECT_EQ(table.status().code(), StatusCode::kUnsupported);
    EXPECT_NE(table.status().message().find(to_string(isa)), std::string::npos)
        << table.status().message();
  }
}

TEST(KernelTables, NamesAndInstructionSetsCorrespond) {
  for (const Isa isa : {Isa::kBaseline, Isa::kNeon, Isa::kSse41, Isa::kAvx2, Isa::kAvx512}) {
    EXPECT_EQ(isa_from_string(to_string(isa)), isa);
  }
  EXPECT_FALSE(isa_from_string("scalar"));
  EXPECT_FALSE(isa_from_string(""));
}

}  // namespace
}  // namespace figurine::kernels_test
