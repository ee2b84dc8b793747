// Makes a whole population by its recipe: body, split, initial weights, members, package. Whatever
// is in the state folder is not made again, so a build that was interrupted, killed or ran out of
// disk goes on when it is called once more, and gives the same weights to the bit.
#pragma once

#include <cstdint>
#include <string>

namespace figurine::population {

struct BuildOptions {
  std::string recipe;  // file
  std::string state;   // folder
  std::string makehuman;
  unsigned slots = 1;         // processes of one thread
  uint32_t pack_period = 30;  // members between two writings of the package; 0: at the end alone
  double stop_after_s = 0;    // starts no further member then; what runs is finished. 0: never
  // Of many processes on a folder that all of them see: this one makes every parts-th member,
  // beginning with `part`, and neither table nor package. What all members share must be there.
  uint32_t part = 0, parts = 1;
  bool initial_weights_only = false;
  bool keep_captures = false;  // for another population of the same people
  bool quiet = false;
};

// Throws InputError: a bad recipe, another recipe than the folder's, or, when all others have
// ended, members that failed. Interrupted after Ctrl-C.
void build(const BuildOptions& options);

}  // namespace figurine::population
