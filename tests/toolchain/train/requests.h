// Trainings of the small capture, the least that shows anything.
#pragma once

#include <gtest/gtest.h>

#include <fstream>
#include <iterator>
#include <string>

#include "tests/toolchain/train/small_capture.h"
#include "toolchain/train/interrupt.h"
#include "toolchain/train/run_directory.h"
#include "toolchain/train/trainer.h"

namespace figurine::testing_tools {

inline train::TrainRequest request(const std::string& run, uint64_t iterations) {
  train::TrainRequest request{.data = small_capture().data,
                              .body = small_capture().body,
                              .run = run,
                              .settings = train::preset_settings("nano"),
                              .quiet = true};
  request.settings.schedule.budget = {.iterations = iterations, .seconds = 0};
  request.settings.threads = 1;
  return request;
}

inline std::string bytes_of(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

inline std::string error_of(const train::TrainRequest& request) {
  try {
    train::train_avatar(request);
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

// All static values at T beside a network at half the side.
inline train::TrainRequest both_parts(const std::string& run, uint64_t iterations) {
  train::TrainRequest both = request(run, iterations);
  both.settings.network_size = 16;
  both.settings.static_grids = train::parse_static_grids("all:T", "test");
  return both;
}

// The same training again in RUN, stopped after `iterations`, and to its end on two threads: the
// bits of its weights.
inline std::string bytes_of_resumed(train::TrainRequest request, const std::string& run,
                                    uint64_t iterations) {
  request.run = run;
  request.settings.threads = 2;
  request.stop_after = iterations;
  EXPECT_THROW(train::train_avatar(request), train::Interrupted);
  request.stop_after = 0;
  request.resume = true;
  train::train_avatar(request);
  return bytes_of(train::RunDirectory{run}.weights());
}

}  // namespace figurine::testing_tools
