// Time, from the system: what it is, and waiting for it.
#pragma once

#include <cstdint>
#include <string>

namespace figurine::ports {

uint64_t now_ns();         // monotonic, from an unnamed start
uint64_t thread_cpu_ns();  // that the calling thread has had of a CPU, whoever else wanted one
// Returns at that time of now_ns() or a little later, at once if it is past. A signal whose handler
// returns does not end it.
void sleep_until(uint64_t time_ns);
std::string date_utc();  // "2026-01-31T12:00:00Z"

}  // namespace figurine::ports
