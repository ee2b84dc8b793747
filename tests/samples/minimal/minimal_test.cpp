// samples/minimal in C++ and in C: the same raw frame, the avatar's golden view; errors are one
// line.
#include <gtest/gtest.h>

#include "samples/program.h"

namespace figurine::tests::minimal_test {
namespace {

class Minimal : public testing::TestWithParam<const char*> {
 protected:
  Minimal() { write_test_packages(folder_); }
  ProgramRun run(const std::string& arguments) const {
    return run_shell("'" + std::string(GetParam()) + "' " + arguments, folder_);
  }
  const TestFolder folder_;
};

TEST_P(Minimal, WritesTheGoldenViewAsRawRgba) {
  const ProgramRun drawn = run("avatar.fgn body.fgn 40 40 > raw");
  ASSERT_EQ(drawn.exit_code, 0) << drawn.err;
  const std::string raw = folder_.read("raw");
  ASSERT_EQ(raw.size(), 40u * 40 * 4);
  size_t visible = 0;
  for (size_t i = 3; i < raw.size(); i += 4) visible += static_cast<unsigned char>(raw[i]) > 127;
  EXPECT_GT(visible, 20u);

  const ProgramRun other =
      run_shell("'" FIGURINE_MINIMAL "' avatar.fgn body.fgn 40 40 > other", folder_);
  ASSERT_EQ(other.exit_code, 0) << other.err;
  EXPECT_TRUE(folder_.read("other") == raw) << "the same in both languages";
}

TEST_P(Minimal, BadInputIsOneLine) {
  for (const char* arguments :
       {"none.fgn body.fgn 4 4", "avatar.fgn none.fgn 4 4", "body.fgn body.fgn 4 4",
        "avatar.fgn avatar.fgn 4 4", "avatar.fgn other_body.fgn 4 4", "avatar.fgn body.fgn 0 4",
        "avatar.fgn body.fgn 4 x"}) {
    const ProgramRun refused = run(arguments);
    EXPECT_EQ(refused.exit_code, 1) << arguments;
    EXPECT_EQ(refused.error_lines(), 1u) << refused.err;
  }
  EXPECT_EQ(run("").exit_code, 2);
}

INSTANTIATE_TEST_SUITE_P(Languages, Minimal, testing::Values(FIGURINE_MINIMAL, FIGURINE_MINIMAL_C),
                         [](const testing::TestParamInfo<const char*>& language) {
                           return language.index == 0 ? "Cpp" : "C";
                         });

}  // namespace
}  // namespace figurine::tests::minimal_test
