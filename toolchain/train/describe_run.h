// What run.json says of a training before its first iteration.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "toolchain/dataset/dataset.h"
#include "toolchain/train/package_file.h"
#include "toolchain/train/settings.h"

namespace figurine::train {

inline constexpr int kRunFormat = 1;

struct RunSources {
  std::string command;    // as typed
  std::string body_path;  // of `body`
  const PackageFile* body = nullptr;
  const dataset::Dataset* data = nullptr;
};

nlohmann::json describe_run(const RunSources& sources, const TrainSettings& settings);

}  // namespace figurine::train
