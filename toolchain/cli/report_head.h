// Where a report on a run comes from: the first fields of all that `evaluate` writes of one.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "toolchain/train/trained_avatar.h"

namespace figurine::cli {

// run: its folder, as it was typed.
nlohmann::json report_head(const std::string& run, const train::TrainedAvatar& avatar);

}  // namespace figurine::cli
