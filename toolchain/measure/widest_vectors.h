// For loops over many pairs of pictures: compiled once for each width of vectors, and chosen when
// the program starts. Integer results do not depend on it, and floating-point ones neither where
// lanes are summed by hand: no product is contracted.
#pragma once

#if defined(__x86_64__) && !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
#define FIG_WIDEST_VECTORS \
  __attribute__((target_clones("arch=x86-64-v4", "arch=x86-64-v3", "default")))
#else
#define FIG_WIDEST_VECTORS
#endif
