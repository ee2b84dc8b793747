// samples/minimal: its raw frame is the one that figurine renders, and its errors are one line.
#include <gtest/gtest.h>

#include "ports/media/png.h"
#include "samples/program.h"

namespace figurine::tests {
namespace {

TEST(Minimal, WritesTheGoldenViewAsRawRgba) {
  const TestFolder folder;
  write_test_packages(folder);
  const ProgramRun run =
      run_shell("'" FIGURINE_MINIMAL "' avatar.fgn body.fgn 40 40 > raw", folder);
  ASSERT_EQ(run.exit_code, 0) << run.err;
  const std::string raw = folder.read("raw");
  ASSERT_EQ(raw.size(), 40u * 40 * 4);
  size_t visible = 0;
  for (size_t i = 3; i < raw.size(); i += 4) visible += static_cast<unsigned char>(raw[i]) > 127;
  EXPECT_GT(visible, 20u);
}

TEST(Minimal, BadInputIsOneLine) {
  const TestFolder folder;
  write_test_packages(folder);
  for (const char* arguments :
       {"none.fgn body.fgn 4 4", "avatar.fgn none.fgn 4 4", "body.fgn body.fgn 4 4",
        "avatar.fgn avatar.fgn 4 4", "avatar.fgn other_body.fgn 4 4", "avatar.fgn body.fgn 0 4",
        "avatar.fgn body.fgn 4 x"}) {
    const ProgramRun run = run_shell(std::string("'" FIGURINE_MINIMAL "' ") + arguments, folder);
    EXPECT_EQ(run.exit_code, 1) << arguments;
    EXPECT_EQ(run.error_lines(), 1u) << run.err;
  }
  EXPECT_EQ(run_shell("'" FIGURINE_MINIMAL "'", folder).exit_code, 2);
}

}  // namespace
}  // namespace figurine::tests
