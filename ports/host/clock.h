// Time, from the system.
#pragma once

#include <cstdint>
#include <string>

namespace figurine::ports {

uint64_t now_ns();       // monotonic, from an unnamed start
std::string date_utc();  // "2026-01-31T12:00:00Z"

}  // namespace figurine::ports
