#include "samples/figurine/report_dials.h"

#include <format>
#include <iterator>

#include "figurine/gaussian.h"

namespace figurine::samples {

namespace {

Dial alpha_cut_dial() {
  Dial dial{.name = "alpha cut",
            .meaning =
                "contributions to a pixel with an alpha below this are skipped; it decides how far "
                "around its centre a Gaussian is drawn",
            .theoretical_order = 1,
            .theory =
                "The part of a 2D Gaussian below a cut a has mass 2 pi sqrt(det) a: what is "
                "missing from the picture falls in proportion to the "
                "cut.",
            .reference = {.splat = {.alpha_cut = kReferenceCut}},
            .stages = {Stage::kProject, Stage::kBin, Stage::kSort, Stage::kBlend, Stage::kResolve}};
  for (const int inverse : {16, 32, 64, 128, 255, 512, 1024, 4096, 16384}) {
    const double cut = 1.0 / inverse;
    dial.settings.push_back({.label = "1/" + std::to_string(inverse),
                             .value = cut,
                             .is_default = static_cast<float>(cut) == kAlphaCut,
                             .knobs = {.splat = {.alpha_cut = static_cast<float>(cut)}}});
  }
  return dial;
}

// Both settings at the reference's alpha cut, which costs the network nothing: what is left of the
// difference is the precision's own.
Dial precision_dial() {
  constexpr SplatOptions kSplat{.alpha_cut = kReferenceCut};
  return {.name = "precision",
          .meaning =
              "arithmetic of the network: q8 (int8 weights and activations) or f32, this dial's "
              "reference; the value is the step of a "
              "number that fills its range",
          .theory =
              "Rounding a range to 255 steps leaves 59 dB of a value that fills it evenly; the "
              "layers add their errors up.",
          .reference = {.splat = kSplat, .precision = Precision::kFloat32},
          .stages = {Stage::kNetwork},
          .settings = {{.label = to_string(Precision::kFixedPoint),
                        .value = 0x1p-8,
                        .is_default = true,
                        .knobs = {.splat = kSplat, .precision = Precision::kFixedPoint}},
                       {.label = to_string(Precision::kFloat32),
                        .value = 0x1p-24,
                        .is_default = false,
                        .knobs = {.splat = kSplat, .precision = Precision::kFloat32}}}};
}

// At the default's alpha cut: what is left of the difference is the tier's.
Dial blend_dial() {
  constexpr Approximation kFast{.fast_blend = true};
  return {.name = "blend",
          .meaning =
              "arithmetic of the blend: exact, this dial's reference, or the fast tier; the value "
              "is the light at which a pixel stops",
          .theory =
              "A pixel that stops at 1/255 of its light is at most that far from the truth; the "
              "cubic in place of 2^x is 7.5e-5 off, relative.",
          .stages = {Stage::kBlend},
          .settings = {
              {.label = "fast",
               .value = 1.0 / 255,
               .is_default = false,
               .knobs = {.approximation = kFast}},
              {.label = "exact", .value = kTransmittanceStop, .is_default = true, .knobs = {}}}};
}

// The value is the part of the averted half sphere of directions that is left out.
Dial averted_dial() {
  Dial dial{.name = "averted texels",
            .meaning =
                "texels are left out, sixteen at a time, whose surface faces away from the camera: "
                "where the cosine between line of sight and normal is above a bound; the value is "
                "1 less it",
            .theory =
                "A closed surface hides what faces away. What the bound has to allow for is that a "
                "Gaussian is a disc of some size, seen around the silhouette, and that hair and "
                "hems are no closed surface.",
            .stages = {Stage::kSkin, Stage::kDecode, Stage::kProject, Stage::kSort, Stage::kBin,
                       Stage::kBlend}};
  for (const float above : {0.0f, 0.1f, 0.25f, 0.5f, 0.75f, 1.0f}) {
    dial.settings.push_back({.label = above < 1 ? std::format("{}", above) : "none",
                             .value = 1.0 - double{above},
                             .is_default = above == 1,
                             .knobs = {.approximation = {.averted_above = above}}});
  }
  return dial;
}

// Of avatars that have bands above the constant one.
Dial sh_degree_dial(uint32_t degree) {
  Dial dial{.name = "SH degree",
            .meaning =
                "bands of spherical harmonics above this degree are left out; the value is the "
                "number of coefficients that stay",
            .theory = "A band of degree d holds what changes d times around the figure.",
            .stages = {Stage::kDecode, Stage::kProject}};
  for (uint32_t d = 0; d <= degree; ++d) {
    dial.settings.push_back({.label = std::to_string(d),
                             .value = static_cast<double>(sh_coefficients(d)),
                             .is_default = d == degree,
                             .knobs = {.approximation = {.sh_degree = d}}});
  }
  return dial;
}

// The switches of LeaveOut, one at a time: none may change a bit, so this dial has times alone.
Dial omissions_dial() {
  Dial dial{.name = "exact omissions",
            .meaning =
                "what nobody would see is not computed; each setting computes one such thing after "
                "all, the first all of them; the value is the number of things left out",
            .theory = "Every picture is equal to the bit, and what differs is time.",
            .stages = {Stage::kDecode, Stage::kSkin, Stage::kProject, Stage::kBin, Stage::kSort,
                       Stage::kBlend}};
  struct Switch {
    const char* label;
    bool LeaveOut::* member;
  };
  constexpr Switch kSwitches[] = {{"with hidden texels", &LeaveOut::hidden_texels},
                                  {"with transparent Gaussians", &LeaveOut::transparent},
                                  {"with Gaussians outside", &LeaveOut::outside},
                                  {"with missed tiles", &LeaveOut::missed_tiles},
                                  {"with stopped tiles", &LeaveOut::stopped}};
  LeaveOut none;
  for (const Switch& each : kSwitches) none.*each.member = false;
  dial.settings.push_back(
      {.label = "everything computed", .value = 0, .knobs = {.leave_out = none}});
  for (const Switch& each : kSwitches) {
    LeaveOut but_one;
    but_one.*each.member = false;
    dial.settings.push_back({.label = each.label,
                             .value = std::size(kSwitches) - 1.0,
                             .knobs = {.leave_out = but_one}});
  }
  dial.settings.push_back({.label = "all left out",
                           .value = std::size(kSwitches) * 1.0,
                           .is_default = true,
                           .knobs = {}});
  return dial;
}

// The value is the time between runs, in poses.
Dial network_interval_dial() {
  constexpr uint32_t kLongest = 8;
  Dial dial{.name = "network interval",
            .meaning =
                "the network runs for one pose of so many, and between runs its outputs go on in "
                "the line of the last two; skeleton and skinning follow every pose. Frames of the "
                "motion one after another, times as means over eight of them",
            .theoretical_order = 2,
            .theory =
                "A line through two values a time h apart misses a smooth third by a term in h "
                "squared; motion with corners within h, feet that touch the ground, by one in h.",
            .stages = {Stage::kMaps, Stage::kNetwork},
            .sequence = kLongest};
  for (uint32_t interval = kLongest; interval > 0; interval /= 2) {
    dial.settings.push_back(
        {.label = interval > 1 ? std::format("one of {}", interval) : "every pose",
         .value = 1.0 * interval,
         .is_default = interval == 1,
         .knobs = {.approximation = {.network_interval = interval}}});
  }
  return dial;
}

}  // namespace

std::vector<Dial> dials(bool both_precisions, uint32_t sh_degree) {
  std::vector<Dial> table = {alpha_cut_dial(), blend_dial(), averted_dial(), omissions_dial(),
                             network_interval_dial()};
  if (sh_degree > 0) table.push_back(sh_degree_dial(sh_degree));
  if (both_precisions) table.push_back(precision_dial());
  return table;
}

}  // namespace figurine::samples
