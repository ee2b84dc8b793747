// make_people FILE: the small population of small_people.h as a package, for tests of programs.
#include <cstdio>

#include "tests/toolchain/generate/small_people.h"

int main(int argc, char** argv) {
  if (argc != 2) return std::fprintf(stderr, "usage: make_people FILE\n"), 2;
  figurine::tests::write_people(argv[1]);
  return 0;
}
