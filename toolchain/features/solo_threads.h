// Threads that each run LibTorch alone: pieces of work are handed out one by one, and inside a
// piece no operation splits its sums over threads. So what a piece computes does not depend on how
// many threads there are.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>

#include "toolchain/train/lanes.h"

namespace figurine::features {

class SoloThreads {
 public:
  // While it lives the caller's thread is one of them; LibTorch's own number of threads comes back
  // afterwards.
  explicit SoloThreads(uint32_t threads);
  ~SoloThreads();
  SoloThreads(const SoloThreads&) = delete;
  SoloThreads& operator=(const SoloThreads&) = delete;

  // piece(i) for i in [0, count), several at a time. An exception of a piece is thrown again when
  // all threads have stopped.
  void each(size_t count, const std::function<void(size_t)>& piece);

 private:
  int before_;
  train::Lanes lanes_;
};

}  // namespace figurine::features
