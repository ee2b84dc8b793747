#include "samples/emulator/switches.h"

#include <algorithm>
#include <cmath>
#include <format>
#include <tuple>

#include "samples/common/parse.h"

namespace figurine::emulator {

namespace {

template <bool LeaveOut::* member>
double get_flag(const Settings& settings) {
  return settings.leave_out.*member ? 1 : 0;
}
template <bool LeaveOut::* member>
void set_flag(Settings& settings, double value) {
  settings.leave_out.*member = value != 0;
}

template <bool LeaveOut::* member>
constexpr Switch exact(const char* name, const char* label, const char* meaning) {
  return {.name = name,
          .label = label,
          .meaning = meaning,
          .exact = true,
          .off = 0,
          .tried = 1,
          .scale = false,
          .least = 0,
          .most = 1,
          .format = "",
          .get = get_flag<member>,
          .set = set_flag<member>};
}

constexpr Switch kSwitches[] = {
    exact<&LeaveOut::hidden_texels>("hidden-texels", "Hidden texels",
                                    "Texels that the camera cannot see, before they are decoded"),
    exact<&LeaveOut::transparent>("transparent", "Transparent Gaussians",
                                  "Gaussians whose opacity is below the alpha cut"),
    exact<&LeaveOut::outside>("outside", "Gaussians outside",
                              "Gaussians that touch no pixel of the picture"),
    exact<&LeaveOut::missed_tiles>("missed-tiles", "Missed tiles",
                                   "Tiles of a Gaussian's box that its ellipse does not reach"),
    exact<&LeaveOut::stopped>("stopped", "Behind opaque",
                              "The rest of a tile's Gaussians once all of its pixels have stopped"),
    exact<&LeaveOut::unchanged_networks>(
        "unchanged-networks", "Unchanged networks",
        "Runs of a network whose last run was for the same pose; measured on a pose that stays"),
    {.name = "fast-blend",
     .label = "Fast blend",
     .meaning = "The fast tier of the blend: over 50 dB from the exact picture",
     .exact = false,
     .off = 0,
     .tried = 1,
     .scale = false,
     .least = 0,
     .most = 1,
     .format = "",
     .get = [](const Settings& s) { return s.approximation.fast_blend ? 1.0 : 0.0; },
     .set = [](Settings& s, double value) { s.approximation.fast_blend = value != 0; }},
    {.name = "averted-above",
     .label = "Averted texels",
     .meaning = "Texels that face away: where the cosine between the line of sight and the normal "
                "is above this",
     .exact = false,
     .off = 1,
     .tried = 0.5,
     .scale = true,
     .least = 0,
     .most = 1,
     .format = "above %.2f",
     .get = [](const Settings& s) { return double{s.approximation.averted_above}; },
     .set = [](Settings& s,
               double value) { s.approximation.averted_above = static_cast<float>(value); }},
    {.name = "network-interval",
     .label = "Runs of the network",
     .meaning = "The network runs for one pose of so many; in between its outputs go on in a line",
     .exact = false,
     .off = 1,
     .tried = 2,
     .scale = true,
     .least = 1,
     .most = 8,
     .format = "one of %.0f",
     .get = [](const Settings& s) { return 1.0 * s.approximation.network_interval; },
     .set =
         [](Settings& s, double value) {
           s.approximation.network_interval = static_cast<uint32_t>(std::lround(value));
         }},
    {.name = "network-below-px",
     .label = "Networks of small figures",
     .meaning = "Figures smaller than this many pixels keep what their network said of the pose "
                "that it ran for last",
     .exact = false,
     .off = 0,
     .tried = 4096,
     .scale = true,
     .least = 0,
     .most = 4096,
     .format = "below %.0f px",
     .get = [](const Settings& s) { return double{s.approximation.network_below_px}; },
     .set = [](Settings& s,
               double value) { s.approximation.network_below_px = static_cast<float>(value); }},
    {.name = "coarse-below-px",
     .label = "Coarse small figures",
     .meaning = "Figures smaller than this many pixels are drawn by their coarse package, "
                "person-coarse.fgn of person.fgn, where they have one",
     .exact = false,
     .off = 0,
     .tried = 4096,
     .scale = true,
     .least = 0,
     .most = 4096,
     .format = "below %.0f px",
     .get = [](const Settings& s) { return double{s.approximation.coarse_below_px}; },
     .set = [](Settings& s,
               double value) { s.approximation.coarse_below_px = static_cast<float>(value); }},
    {.name = "sh-degree",
     .label = "Bands of colour",
     .meaning = "Spherical harmonics above this degree; the shipped person has none",
     .exact = false,
     .off = kMaxShDegree,
     .tried = 0,
     .scale = true,
     .least = 0,
     .most = kMaxShDegree,
     .format = "degree %.0f",
     .get = [](const Settings& s) { return 1.0 * s.approximation.sh_degree; },
     .set =
         [](Settings& s, double value) {
           s.approximation.sh_degree = static_cast<uint32_t>(std::lround(value));
         }},
    {.name = "keep-to-known",
     .label = "Keep to known poses",
     .meaning = "Far outside of what an avatar was trained on, its network is shown a nearer pose; "
                "no time is won",
     .exact = false,
     .off = 0,
     .tried = 1,
     .scale = false,
     .least = 0,
     .most = 1,
     .format = "",
     .get = [](const Settings& s) { return s.keep_to_known ? 1.0 : 0.0; },
     .set = [](Settings& s, double value) { s.keep_to_known = value != 0; }},
};

}  // namespace

bool operator==(const Settings& a, const Settings& b) {
  return std::all_of(std::begin(kSwitches), std::end(kSwitches),
                     [&](const Switch& each) { return each.get(a) == each.get(b); });
}

Settings dense_settings() {
  Settings settings;
  for (const Switch& each : kSwitches) each.set(settings, each.off);
  return settings;
}

std::span<const Switch> switches() { return kSwitches; }

const Switch* find_switch(std::string_view name) {
  const auto at = std::find_if(std::begin(kSwitches), std::end(kSwitches),
                               [&](const Switch& each) { return each.name == name; });
  return at == std::end(kSwitches) ? nullptr : at;
}

Status set_switch(Settings& settings, const std::string& name, const std::string& value) {
  const auto invalid = [&](const std::string& what) {
    return Status(StatusCode::kInvalidArgument, what);
  };
  const Switch* const found = find_switch(name);
  if (found == nullptr) {
    std::string names;
    for (const Switch& each : kSwitches)
      names += (names.empty() ? "" : ", ") + std::string(each.name);
    return invalid("switch '" + name + "': is none of " + names);
  }
  if (value == "on" || value == "off") {
    found->set(settings, value == "on" ? found->tried : found->off);
    return {};
  }
  const std::optional<std::vector<double>> number =
      found->scale ? samples::parse_numbers(value, 1) : std::nullopt;
  if (!number || number->size() != 1 || number->front() < found->least ||
      number->front() > found->most) {
    return invalid("switch '" + name + "': '" + value + "' is neither on nor off" +
                   (found->scale
                        ? std::format(" nor a number from {} to {}", found->least, found->most)
                        : std::string()));
  }
  found->set(settings, number->front());
  return {};
}

}  // namespace figurine::emulator
