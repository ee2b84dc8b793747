#include "toolchain/features/solo_threads.h"

#include <atomic>

#include "toolchain/model/threads.h"
#include "toolchain/tensor_operations.h"

namespace figurine::features {

SoloThreads::SoloThreads(uint32_t threads)
    : before_(at::get_num_threads()), lanes_(threads, [] { at::set_num_threads(1); }) {
  model::use_threads(1);
}

SoloThreads::~SoloThreads() { model::use_threads(static_cast<uint32_t>(before_)); }

void SoloThreads::each(size_t count, const std::function<void(size_t)>& piece) {
  std::atomic<size_t> next{0};
  lanes_.run([&](unsigned) {
    for (size_t i = next++; i < count; i = next++) piece(i);
  });
}

}  // namespace figurine::features
