#include "samples/common/machine.h"

#include <sched.h>

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

uint32_t usable_cpus() {
  cpu_set_t set;
  CPU_ZERO(&set);
  return ::sched_getaffinity(0, sizeof(set), &set) == 0 ? static_cast<uint32_t>(CPU_COUNT(&set))
                                                        : 1;
}

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
