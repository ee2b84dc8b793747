// make_swinging_motion FILE: the motion of small_recipe.h as a package, for tests of programs.
#include <cstdio>

#include "tests/toolchain/population/small_recipe.h"

int main(int argc, char** argv) {
  if (argc != 2) return std::fprintf(stderr, "usage: make_swinging_motion FILE\n"), 2;
  figurine::testing_tools::write_swinging_motion(argv[1]);
  return 0;
}
