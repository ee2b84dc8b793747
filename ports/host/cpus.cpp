#include "ports/host/cpus.h"

#include <sched.h>

#include <algorithm>
#include <fstream>
#include <iterator>
#include <sstream>

namespace figurine::ports {
namespace {

// 150000 of 100000 as 2; 0 for what is no quota ("max", -1).
uint32_t cpus_of(double quota, double period) {
  if (!(quota > 0 && period > 0)) return 0;
  return static_cast<uint32_t>(std::min((quota + period - 1) / period, 1e6));
}

// A group's own, of v2; 0 without: "max 100000", no file, or anything else.
uint32_t cpu_max(const std::string& folder) {
  std::ifstream file(folder + "/cpu.max");
  double quota = 0, period = 0;
  return file >> quota >> period ? cpus_of(quota, period) : 0;
}

// The same of v1, where both stand in files of their own.
uint32_t cfs_quota(const std::string& folder) {
  std::ifstream quota_file(folder + "/cpu.cfs_quota_us"),
      period_file(folder + "/cpu.cfs_period_us");
  double quota = 0, period = 0;
  return quota_file >> quota && period_file >> period ? cpus_of(quota, period) : 0;
}

// The smaller of two quotas, of which 0 is none.
uint32_t smaller(uint32_t a, uint32_t b) { return a == 0 || b == 0 ? a + b : std::min(a, b); }

// The smallest of a group and all above it. A container often sees its own group as the root, under
// a path that is its host's: what is not there counts as no quota.
template <class Quota>
uint32_t smallest_quota(const std::string& root, std::string group, Quota quota) {
  uint32_t least = 0;
  for (;;) {
    while (group.ends_with('/')) group.pop_back();
    least = smaller(least, quota(root + group));
    if (group.empty()) return least;
    group.resize(group.find_last_of('/') == std::string::npos ? 0 : group.find_last_of('/'));
  }
}

// Whether "cpuset,cpu,cpuacct" has "cpu" in it.
bool lists_cpu(const std::string& controllers) {
  std::istringstream names(controllers);
  for (std::string name; std::getline(names, name, ',');) {
    if (name == "cpu") return true;
  }
  return false;
}

}  // namespace

uint32_t quota_cpus(const std::string& membership, const std::string& root) {
  std::istringstream lines(membership);
  uint32_t least = 0;
  bool no_v2 = true;
  // "0::/group" of v2, "5:cpu,cpuacct:/group" of a v1 hierarchy and its controllers.
  for (std::string line; std::getline(lines, line);) {
    const size_t first = line.find(':');
    const size_t second = first == std::string::npos ? first : line.find(':', first + 1);
    if (second == std::string::npos) continue;
    const std::string controllers = line.substr(first + 1, second - first - 1),
                      group = line.substr(second + 1);
    if (line.starts_with("0::")) {
      no_v2 = false;
      for (const char* mount : {"", "/unified"})
        least = smaller(least, smallest_quota(root + mount, group, cpu_max));
    } else if (lists_cpu(controllers)) {
      // Its folder is called like its controllers, and by links like each of them.
      for (const std::string& mount : {"/" + controllers, std::string("/cpu")})
        least = smaller(least, smallest_quota(root + mount, group, cfs_quota));
    }
  }
  // A membership that cannot be read says nothing of the root group.
  return no_v2 ? smaller(least, smallest_quota(root, "", cpu_max)) : least;
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
