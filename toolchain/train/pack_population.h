// Avatars as one population package: opened wherever they lie, told apart by the split, their
// weights as differences to the weights that their training started from.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "figurine/population.h"
#include "formats/writer/population_writer.h"

namespace figurine::train {

struct PackPopulationOptions {
  // Each an avatar package, a run (packed here: its data must still be there), or a folder: all
  // avatar packages below it in the order of their paths.
  std::vector<std::string> inputs;
  std::string name = "population";
  std::string
      init;  // weights or run that all members started from; empty: the common initial weights
  std::string shared;  // avatar package whose network all members have, and whose static part is
                       // the mean map; members may come without the network. Instead of init and
                       // coding
  std::string split;   // {"train": [NAME...], "validation": [...], "test": [...]}, a whole number
                       // standing for a name of six digits; empty: all train
  DifferenceCoding coding = DifferenceCoding::kInt8;
  uint32_t levels = kMostLevels;  // of int8 (population_writer.h)
  uint32_t threads = 1;
  bool say_how = true;  // command, commit and where things lay; without, the same members make the
                        // same bytes wherever they lie
  bool quiet = false;
};

// The split of every name in the file. Throws InputError "FILE: reason": not of this form, or a
// name in two parts.
std::map<std::string, Split> read_split(const std::string& path);

// Throws InputError naming the member that does not fit and why; Interrupted at Ctrl-C.
std::vector<std::byte> pack_population(const PackPopulationOptions& options);

}  // namespace figurine::train
