// figurine-gradcheck [OUT.json]: the largest relative error of every gradient against finite
// differences in double, as JSON.
#include <cstdio>
#include <string>

#include "tests/toolchain/model/gradient_check.h"

int main(int argc, char** argv) {
  std::string json =
      "{\n  \"method\": \"central differences in float64; error relative to max(|analytic|, "
      "|numeric|, 1e-3 of the kind's largest)\"";
  const auto add = [&](const char* stage, uint32_t degree,
                       const figurine::testing::GradientErrors& errors) {
    for (const auto& [kind, error] : errors) {
      char line[256];
      std::snprintf(line, sizeof line,
                    ",\n  \"%s_sh%u_%s\": {\"largest_relative_error\": %.3e, \"values\": %llu, "
                    "\"smaller_step\": %llu}",
                    stage, degree, kind.c_str(), error.largest_relative,
                    static_cast<unsigned long long>(error.checked),
                    static_cast<unsigned long long>(error.refined));
      json += line;
    }
  };
  for (uint32_t degree = 0; degree <= figurine::kMaxShDegree; ++degree)
    add("splat", degree, figurine::testing::check_splat_gradients(degree, 120));
  for (uint32_t degree = 0; degree <= figurine::kMaxShDegree; ++degree)
    add("picture", degree, figurine::testing::check_head_gradients(degree));
  json += "\n}\n";
  std::FILE* out = argc > 1 ? std::fopen(argv[1], "w") : stdout;
  if (out == nullptr || std::fputs(json.c_str(), out) < 0 ||
      (out != stdout && std::fclose(out) != 0)) {
    std::fprintf(stderr, "figurine-gradcheck: %s: cannot be written\n",
                 argc > 1 ? argv[1] : "standard output");
    return 1;
  }
  return 0;
}
