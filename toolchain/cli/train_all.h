// figurine-train avatar --all: one training per identity of a folder, several at a time, and a
// table of what became of each.
#pragma once

#include <functional>
#include <string>

#include "toolchain/train/trainer.h"

namespace figurine::cli {

struct TrainAllOptions {
  std::string data;  // folder of identities
  std::string runs;  // folder of runs, named like the identities; runs.csv in it is the table
  uint32_t slots = 1;
  bool quiet = false;
};

// Trains every identity by request_of(its name). Throws InputError when all have ended and some
// failed, Interrupted after Ctrl-C.
void train_all(const TrainAllOptions& options,
               const std::function<train::TrainRequest(const std::string&)>& request_of);

}  // namespace figurine::cli
