// How many CPUs this process can really use: no more than it may run on (affinity), and no more
// than its control groups pay for (cpu.max of cgroup v2, cpu.cfs_quota_us of v1; a container with
// "--cpus 2" sees all CPUs of its host, and is stopped for the rest of every period once it used up
// two).
#pragma once

#include <cstdint>
#include <string>

namespace figurine::ports {

// At least 1. A quota of one and a half counts as two.
uint32_t usable_cpus();

// The smallest quota of a group and all above it, rounded up; 0 without any. membership: the text
// of /proc/self/cgroup; root: where control groups are mounted ("/sys/fs/cgroup"): v2 itself, or,
// beside each other in folders, v2 ("unified") and v1's controllers ("cpu,cpuacct", "cpu").
uint32_t quota_cpus(const std::string& membership, const std::string& root);

}  // namespace figurine::ports
