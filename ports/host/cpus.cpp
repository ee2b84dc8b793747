#include "ports/host/cpus.h"

#include <sched.h>

#include <algorithm>
#include <fstream>
#include <iterator>
#include <sstream>

namespace figurine::ports {
namespace {

// "150000 100000" as 2; 0 for "max 100000", no file, or anything else.
uint32_t cpus_of(const std::string& path) {
  std::ifstream file(path);
  double quota = 0, period = 0;
  if (!(file >> quota >> period) || !(quota > 0 && period > 0)) return 0;
  return static_cast<uint32_t>(std::min((quota + period - 1) / period, 1e6));
}

}  // namespace

uint32_t quota_cpus(const std::string& membership, const std::string& root) {
  std::istringstream lines(membership);
  std::string group;
  for (std::string line; std::getline(lines, line);) {
    if (line.starts_with("0::")) group = line.substr(3);
  }
  uint32_t least = 0;
  for (;;) {
    while (group.ends_with('/')) group.pop_back();
    const uint32_t cpus = cpus_of(root + group + "/cpu.max");
    if (cpus > 0) least = least == 0 ? cpus : std::min(least, cpus);
    if (group.empty()) return least;
    group.resize(group.find_last_of('/') == std::string::npos ? 0 : group.find_last_of('/'));
  }
}

uint32_t usable_cpus() {
  cpu_set_t set;
  CPU_ZERO(&set);
  const bool known = ::sched_getaffinity(0, sizeof(set), &set) == 0;
  const uint32_t allowed = known ? static_cast<uint32_t>(std::max(CPU_COUNT(&set), 1)) : 1;
  std::ifstream file("/proc/self/cgroup");
  const std::string membership{std::istreambuf_iterator<char>(file), {}};
  const uint32_t quota = quota_cpus(membership, "/sys/fs/cgroup");
  return quota > 0 ? std::min(allowed, quota) : allowed;
}

}  // namespace figurine::ports
