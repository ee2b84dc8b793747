// Numbers in reports: JSON has no NaN and no infinity, null stands for both.
#pragma once

#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

namespace figurine {

inline nlohmann::json finite(double value) {
  return std::isfinite(value) ? nlohmann::json(value) : nlohmann::json(nullptr);
}

// NaN where there is none.
inline double number(const nlohmann::json& value) {
  return value.is_number() ? value.get<double>() : std::numeric_limits<double>::quiet_NaN();
}

}  // namespace figurine
