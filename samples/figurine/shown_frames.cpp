#include "samples/figurine/shown_frames.h"

#include <algorithm>
#include <cmath>
#include <format>

namespace figurine::samples {

namespace {

// A moment that rounding puts just before a frame is that frame's.
constexpr double kSlack = 1e-6;

std::string note_of(double rate_hz, double fps) {
  const double step = rate_hz / fps;
  if (std::abs(step - 1) < kSlack) return {};
  const std::string rates =
      std::format("a motion of {:g} frames a second, shown at {:g}: ", rate_hz, fps);
  if (step > 1) {
    const double whole = std::round(step);
    if (std::abs(step - whole) > kSlack * step)
      return rates + std::format("one frame of {:.3g}", step);
    return rates + (whole == 2 ? "every other frame" : std::format("one frame of {:g}", whole));
  }
  return rates + std::format("frames are shown {:.3g} times", 1 / step);
}

}  // namespace

ShownFrames frames_in_time(const std::vector<uint32_t>& chosen, double rate_hz,
                           std::optional<double> fps) {
  ShownFrames shown{chosen, fps.value_or(rate_hz), {}};
  if (!fps || chosen.size() == 1) return shown;
  const double step = rate_hz / *fps;
  const double count = std::round(static_cast<double>(chosen.size()) / step);
  shown.frames.clear();
  for (double i = 0; i < std::max(count, 1.0); ++i) {
    const auto at = static_cast<size_t>(i * step + kSlack);
    shown.frames.push_back(chosen[std::min(at, chosen.size() - 1)]);
  }
  if (chosen.size() > 1) shown.note = note_of(rate_hz, *fps);
  return shown;
}

ShownFrames turntable_frames(const std::vector<uint32_t>& chosen, double rate_hz,
                             std::optional<double> fps, uint32_t count) {
  ShownFrames shown{{}, fps.value_or(rate_hz), {}};
  const double step = rate_hz / shown.frames_per_second;
  for (uint32_t i = 0; i < count; ++i)
    shown.frames.push_back(chosen[static_cast<size_t>(i * step + kSlack) % chosen.size()]);
  if (chosen.size() > 1) shown.note = note_of(rate_hz, shown.frames_per_second);
  return shown;
}

}  // namespace figurine::samples
