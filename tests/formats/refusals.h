// What a refusal is: a status of the expected code that says the words, in one line.
#pragma once

#include <gtest/gtest.h>

#include <string>

#include "figurine/status.h"

namespace figurine::samples {

inline void expect_refused(const Status& status, const std::string& words,
                           StatusCode code = StatusCode::kCorrupt) {
  EXPECT_STREQ(to_string(status.code()), to_string(code)) << status.message();
  EXPECT_NE(status.message().find(words), std::string::npos)
      << status.message() << " should mention: " << words;
  EXPECT_EQ(status.message().find('\n'), std::string::npos) << status.message();
}

}  // namespace figurine::samples
