// A fixed crew of threads that do the same step side by side, again and again: lane 0 is the
// caller.
//
// Several poses of one iteration run this way, each on a thread of its own from forward to
// backward: the UNet's convolutions are too small for LibTorch to gain from a second thread inside
// of them.
#pragma once

#include <exception>
#include <functional>
#include <memory>
#include <semaphore>
#include <thread>
#include <vector>

namespace figurine::train {

class Lanes {
 public:
  // begin: called once in every new thread, for its thread-local settings.
  Lanes(unsigned count, const std::function<void()>& begin);
  ~Lanes();
  Lanes(const Lanes&) = delete;
  Lanes& operator=(const Lanes&) = delete;

  // step(lane) for every lane at the same time; returns when all are done. The exception of the
  // lowest lane that threw is thrown again.
  void run(const std::function<void(unsigned)>& step);

 private:
  struct Worker {
    std::binary_semaphore start{0}, done{0};
    std::exception_ptr error;
    std::thread thread;
  };
  void work(unsigned lane, const std::function<void()>& begin);

  std::vector<std::unique_ptr<Worker>> workers_;         // lanes 1..count-1
  const std::function<void(unsigned)>* step_ = nullptr;  // null: end
};

}  // namespace figurine::train
