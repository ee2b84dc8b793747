// Against instructions as the assembler encodes them.
#include "bench/arm/instruction_kind.h"

#include <gtest/gtest.h>

#include <cstdint>
#include <span>

// words_NAME up to words_NAME_end: the instructions, as data.
#define FIG_WORDS(name, instructions)                                                             \
  asm(".pushsection .rodata\n.balign 4\n.arch armv8.2-a+dotprod\nwords_" #name ":\n" instructions \
      "\nwords_" #name "_end:\n.popsection");                                                     \
  extern "C" const uint32_t words_##name[], words_##name##_end[]

FIG_WORDS(dot_product,
          "sdot v0.4s, v1.16b, v2.16b\n udot v0.2s, v1.8b, v2.8b\n"
          "sdot v31.4s, v30.16b, v29.4b[3]\n udot v0.4s, v1.16b, v2.4b[0]\n");
FIG_WORDS(multiply_integer,
          "smull v0.8h, v1.8b, v2.8b\n smlal2 v3.4s, v4.8h, v5.8h\n umlsl v0.2d, v1.2s, v2.2s\n"
          "smlal v0.4s, v1.4h, v2.h[7]\n mla v0.4s, v1.4s, v2.4s\n mls v0.8h, v1.8h, v2.h[1]\n"
          "mul v0.4s, v1.4s, v2.s[1]\n mul v7.16b, v8.16b, v9.16b\n"
          "sqrdmulh v0.4s, v1.4s, v2.4s\n sqdmulh v0.4s, v1.4s, v2.4s\n");
FIG_WORDS(fused,
          "fmla v0.4s, v1.4s, v2.4s\n fmls v0.2d, v1.2d, v2.2d\n fmla v0.4s, v1.4s, v2.s[3]\n"
          "fmadd s0, s1, s2, s3\n fnmsub d0, d1, d2, d3\n");
FIG_WORDS(other_vector,
          "fmul v0.4s, v1.4s, v2.4s\n fmul v0.4s, v1.4s, v2.s[2]\n fadd v0.4s, v1.4s, v2.4s\n"
          "fadd s0, s1, s2\n fdiv v0.4s, v1.4s, v2.4s\n add v0.4s, v1.4s, v2.4s\n"
          "sqxtn v0.8b, v1.8h\n zip1 v0.4s, v1.4s, v2.4s\n dup v0.4s, w1\n fmov w0, s1\n"
          "sshll v0.8h, v1.8b, #0\n saddw v0.4s, v1.4s, v2.4h\n fcmp s0, s1\n scvtf s0, w1\n"
          "and v0.16b, v1.16b, v2.16b\n addp v0.4s, v1.4s, v2.4s\n movi v0.4s, #0\n");
FIG_WORDS(load,
          "ldr x0, [x1]\n ldr w0, [x1, x2, lsl #2]\n ldrsb w0, [x1], #1\n ldp x0, x1, [sp]\n"
          "ldr q0, [x1]\n ldr s0, [x1, #4]!\n ldp q0, q1, [x2], #32\n ld1 {v0.16b}, [x1], #16\n"
          "ld1r {v0.4s}, [x1]\n ld2 {v0.4s, v1.4s}, [x1]\n ldxr w0, [x1]\n ldar w0, [x1]\n"
          "ldr x0, words_load\n ldrsw x0, [x1, #8]\n ldur q3, [x1, #-16]\n");
FIG_WORDS(store,
          "str x0, [x1]\n strb w0, [x1, x2]\n stp x0, x1, [sp, #-16]!\n str q0, [x1]\n"
          "str h0, [x1]\n stp q0, q1, [x2]\n st1 {v0.16b}, [x1]\n stlr w0, [x1]\n"
          "stur q3, [x1, #-16]\n st1 {v0.s}[1], [x1]\n");
FIG_WORDS(branch,
          "b words_branch\n bl words_branch\n b.eq words_branch\n cbz x0, words_branch\n"
          "tbnz w0, #3, words_branch\n ret\n blr x1\n br x2\n svc #0\n");
FIG_WORDS(integer,
          "add x0, x1, x2\n sub w0, w1, #4\n mov x0, x1\n madd x0, x1, x2, x3\n adrp x0, .\n"
          "ubfx w0, w1, #3, #4\n csel x0, x1, x2, eq\n lsl x0, x1, x2\n cmp x0, #1\n"
          "movk x0, #7, lsl #16\n clz w0, w1\n eor x0, x1, x2, ror #3\n");
FIG_WORDS(other, "nop\n hint #42\n dmb ish\n mrs x0, tpidr_el0\n");

namespace figurine::bench {
namespace {

void expect_kind(Counter kind, std::span<const uint32_t> words) {
  for (const uint32_t& word : words) {
    EXPECT_EQ(kCounterNames[static_cast<size_t>(kind_of(word))],
              kCounterNames[static_cast<size_t>(kind)])
        << "instruction " << &word - words.data();
  }
}

TEST(InstructionKind, IsWhatTheAssemblerWasTold) {
  expect_kind(Counter::kDotProduct, {words_dot_product, words_dot_product_end});
  expect_kind(Counter::kVectorMultiplyInteger,
              {words_multiply_integer, words_multiply_integer_end});
  expect_kind(Counter::kFusedMultiplyAdd, {words_fused, words_fused_end});
  expect_kind(Counter::kOtherVector, {words_other_vector, words_other_vector_end});
  expect_kind(Counter::kLoad, {words_load, words_load_end});
  expect_kind(Counter::kStore, {words_store, words_store_end});
  expect_kind(Counter::kBranch, {words_branch, words_branch_end});
  expect_kind(Counter::kInteger, {words_integer, words_integer_end});
  expect_kind(Counter::kOther, {words_other, words_other_end});
}

}  // namespace
}  // namespace figurine::bench
