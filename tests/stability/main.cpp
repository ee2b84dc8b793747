// figurine-stability: measures every case and writes the table with what it was measured on.
// stability_test asserts the same rows.
//
//   figurine-stability [-o docs/results/stability.json]         exit code 0 if every bound holds, 1
//   if not, 2 on wrong usage
#include <cstdio>
#include <cstring>
#include <ctime>
#include <fstream>
#include <iostream>
#include <nlohmann/json.hpp>
#include <string>

#include "ports/host/files.h"
#include "tests/stability/rows.h"

namespace figurine::stability {
namespace {

using Json = nlohmann::ordered_json;

std::string first_line_of(const char* command) {
  std::string line;
  if (FILE* pipe = popen(command, "r")) {
    for (int c = std::fgetc(pipe); c != EOF && c != '\n'; c = std::fgetc(pipe))
      line += static_cast<char>(c);
    pclose(pipe);
  }
  return line;
}

std::string cpu_name() {
  std::ifstream file("/proc/cpuinfo");
  for (std::string line; std::getline(file, line);) {
    if (line.rfind("model name", 0) == 0) return line.substr(line.find(':') + 2);
  }
  return "unknown";
}

std::string date() {
  char text[32];
  const std::time_t now = std::time(nullptr);
  std::strftime(text, sizeof(text), "%Y-%m-%d", std::gmtime(&now));
  return text;
}

Json number(double value) {
  return std::isfinite(value) ? Json(value) : Json(std::to_string(value));
}

// One line a row: a table to read and to compare.
std::string layout(const Json& report) {
  std::string text = "{\n";
  for (const auto& [key, value] : report.items()) {
    if (key != "rows") text += " " + Json(key).dump() + ": " + value.dump() + ",\n";
  }
  text += " \"rows\": [";
  const char* separator = "\n  ";
  for (const Json& row : report["rows"]) {
    text += separator + row.dump();
    separator = ",\n  ";
  }
  return text + "\n ]\n}\n";
}

int run(const std::string& output) {
  Json report{{"command", "figurine-stability -o docs/results/stability.json"},
              {"commit", first_line_of("git -c safe.directory='*' -C '" FIGURINE_SOURCE_DIR
                                       "' rev-parse --short=12 HEAD 2> /dev/null")},
              {"machine", cpu_name()},
              {"date", date()},
              {"rows", Json::array()}};
  size_t broken = 0;
  for (std::span<const Case> cases :
       {splat_cases(), file_cases(), pose_cases(), live_cases(), package_cases(),
        fixed_point_cases(), sampling_cases(), sampler_cases(),
#if FIGURINE_HAS_TRAINER
        training_cases()
#endif
       }) {
    for (const Case& one : cases) {
      for (const Row& row : one.run()) {
        report["rows"].push_back(
            {{"group", one.name},
             {"case", row.name},
             {"measure", row.measure},
             {"bound", {{row.bound == Bound::kAtLeast ? "at_least" : "at_most", row.limit}}},
             {"value", number(row.value)},
             {"ok", row.ok()}});
        if (row.ok()) continue;
        ++broken;
        std::cerr << "figurine-stability: " << row.name << ": " << row.measure << ": " << row.value
                  << " breaks its bound of " << row.limit << '\n';
      }
    }
  }
  std::string text = layout(report);
  if (output.empty()) {
    std::cout << text;
  } else if (const Status status =
                 ports::write_file_atomically(output, std::as_bytes(std::span(text)));
             !status.ok()) {
    std::cerr << "figurine-stability: " << status.message() << '\n';
    return 1;
  }
  std::cerr << "figurine-stability: " << report["rows"].size() << " rows, " << broken
            << " broken\n";
  return broken == 0 ? 0 : 1;
}

}  // namespace
}  // namespace figurine::stability

int main(int argc, char** argv) {
  const bool to_file = argc == 3 && std::strcmp(argv[1], "-o") == 0;
  if (argc != 1 && !to_file) {
    std::cerr << "usage: figurine-stability [-o REPORT.json]\n";
    return 2;
  }
  return figurine::stability::run(to_file ? argv[2] : "");
}
