#include "samples/common/machine.h"

#include <cstdlib>
#include <fstream>

namespace figurine::samples {

namespace {

// What follows "key ... :" on the first such line of a /proc file.
std::string proc_value(const char* path, const std::string& key) {
  std::ifstream file(path);
  for (std::string line; std::getline(file, line);) {
    if (!line.starts_with(key)) continue;
    const size_t colon = line.find(':');
    const size_t value =
        colon == std::string::npos ? colon : line.find_first_not_of(" \t", colon + 1);
    if (value != std::string::npos) return line.substr(value);
  }
  return {};
}

}  // namespace

std::string cpu_name() {
  for (const char* key : {"model name", "Model", "Hardware"}) {
    const std::string name = proc_value("/proc/cpuinfo", key);
    if (!name.empty()) return name;
  }
  return "unknown";
}

uint64_t peak_memory_bytes() {
  return std::strtoull(proc_value("/proc/self/status", "VmHWM").c_str(), nullptr, 10) * 1024;
}

}  // namespace figurine::samples
