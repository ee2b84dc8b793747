#include "toolchain/cli/report_head.h"

#include <nlohmann/json.hpp>

#include "toolchain/train/run_directory.h"

namespace figurine::cli {

nlohmann::json report_head(const std::string& run, const train::TrainedAvatar& avatar) {
  nlohmann::json report{{"command", train::current_command()},
                        {"commit", train::current_commit()},
                        {"machine", train::describe_machine()},
                        {"date", train::utc_now()},
                        {"run", run},
                        {"identity", avatar.data().directory()},
                        {"settings", train::to_json(avatar.description().settings)}};
  for (const char* key : {"iterations", "train_seconds", "iterations_per_second", "breakdown_ms"}) {
    if (avatar.description().json.contains(key)) report[key] = avatar.description().json.at(key);
  }
  return report;
}

}  // namespace figurine::cli
