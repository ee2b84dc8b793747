#include "toolchain/train/lanes.h"

namespace figurine::train {

Lanes::Lanes(unsigned count, const std::function<void()>& begin) {
  for (unsigned lane = 1; lane < count; ++lane) workers_.push_back(std::make_unique<Worker>());
  for (unsigned lane = 1; lane < count; ++lane)
    workers_[lane - 1]->thread = std::thread([this, lane, begin] { work(lane, begin); });
}

Lanes::~Lanes() {
  step_ = nullptr;
  for (const auto& worker : workers_) worker->start.release();
  for (const auto& worker : workers_) worker->thread.join();
}

void Lanes::work(unsigned lane, const std::function<void()>& begin) {
  Worker& self = *workers_[lane - 1];
  begin();
  for (;;) {
    self.start.acquire();
    if (step_ == nullptr) return;
    try {
      (*step_)(lane);
    } catch (...) {
      self.error = std::current_exception();
    }
    self.done.release();
  }
}

void Lanes::run(const std::function<void(unsigned)>& step) {
  step_ = &step;
  for (const auto& worker : workers_) worker->start.release();
  std::exception_ptr error;
  try {
    step(0);
  } catch (...) {
    error = std::current_exception();
  }
  for (const auto& worker : workers_) {
    worker->done.acquire();
    if (!error) error = worker->error;
    worker->error = nullptr;
  }
  if (error) std::rethrow_exception(error);
}

}  // namespace figurine::train
