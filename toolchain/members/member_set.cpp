#include "toolchain/members/member_set.h"

#include <algorithm>
#include <cmath>

#include "toolchain/error.h"
#include "toolchain/measure/body_parts.h"
#include "toolchain/train/opened_member.h"

namespace figurine::members {

using measure::Picture;
using measure::RowMatrix;
using measure::Standardisation;
using pictures::Extent;
using pictures::Shot;
using pictures::ShotRenderer;
using pictures::Subject;
using train::fixed_poses;
using train::OpenedMember;

namespace {

constexpr size_t kFewestTraining =
    3;  // two have one direction and one distance: nothing to say of a population
constexpr float kPictureMargin = 0.04f, kPortraitMargin = 0.045f;
constexpr float kNarrowest = 0.35f, kWidest = 0.9f;  // of a portrait, by its height
constexpr float kNarrowestBust = 0.7f, kWidestBust = 1.1f;
// Of all members, whose busts a cell holds: one with hair of a metre may not make everybody small.
constexpr double kFramedBusts = 0.98;

std::vector<Shot> make_shots(const Body& body) {
  std::vector<Shot> shots;
  for (size_t pose = 0; pose < 2; ++pose) {
    for (const float azimuth_deg : {0.0f, 120.0f, 240.0f})
      shots.push_back({pose, azimuth_deg, 5, Subject::kPlaced});
  }
  shots.push_back({0, 20, 5, Subject::kGrounded});
  shots.push_back({0, 200, 5, Subject::kGrounded});
  if (!measure::bust_texels(body).empty()) shots.push_back({0, 20, 5, Subject::kBust});
  return shots;
}

std::vector<size_t> members_of(const Population& population, bool training) {
  std::vector<size_t> members;
  for (size_t m = 0; m < population.size(); ++m) {
    if ((population.members[m].split == Split::kTrain) == training) members.push_back(m);
  }
  return members;
}

// Everything that can be wrong with the two packages, before any work.
const Population& check(const Package& package, const Package& body) {
  const Population& population = package.population();
  const OpenedMember first(population, 0);
  const Status fits = check_avatar_fits_body(first.avatar, body);
  if (!fits.ok()) throw InputError("population '" + population.name + "': " + fits.message());
  const size_t training = members_of(population, true).size();
  if (training < kFewestTraining) {
    throw InputError("population '" + population.name + "': has " + std::to_string(training) +
                     " training members, at least " + std::to_string(kFewestTraining) +
                     " are needed");
  }
  return population;
}

// What holds all of them, or on each side the given share.
Extent hold(const std::vector<Extent>& extents, double share) {
  const auto reach = [&](auto&& side, double part) {
    std::vector<float> values;
    for (const Extent& extent : extents) values.push_back(side(extent));
    const auto rank = static_cast<ptrdiff_t>(std::lround(part * double(values.size() - 1)));
    std::nth_element(values.begin(), values.begin() + rank, values.end());
    return values[static_cast<size_t>(rank)];
  };
  return {reach([](const Extent& e) { return e.left; }, 1 - share),
          reach([](const Extent& e) { return e.right; }, share),
          reach([](const Extent& e) { return e.top; }, 1 - share),
          reach([](const Extent& e) { return e.bottom; }, share)};
}

bool has_quality(const Population& population, const char* name) {
  return std::ranges::find(population.quality_names, name) != population.quality_names.end();
}

// Means of blocks; premultiplied, so that nothing has to be weighted.
Picture shrink(const Picture& picture, uint32_t by) {
  Picture small{picture.width_px / by, picture.height_px / by, {}};
  small.rgba.resize(size_t(small.width_px) * small.height_px * 4);
  for (uint32_t y = 0; y < small.height_px; ++y) {
    for (uint32_t x = 0; x < small.width_px; ++x) {
      for (uint32_t c = 0; c < 4; ++c) {
        uint32_t sum = by * by / 2;
        for (uint32_t j = 0; j < by; ++j) {
          for (uint32_t i = 0; i < by; ++i)
            sum += picture.rgba[(size_t(y * by + j) * picture.width_px + x * by + i) * 4 + c];
        }
        small.rgba[(size_t(y) * small.width_px + x) * 4 + c] =
            static_cast<uint8_t>(sum / (by * by));
      }
    }
  }
  return small;
}

}  // namespace

MemberSet::MemberSet(const Package& population_package, const Package& body_package,
                     const MemberSetOptions& options)
    : package(&population_package),
      body(&body_package),
      crew(options.threads, options.quiet),
      training(members_of(check(population_package, body_package), true)),
      held_out(members_of(population_package.population(), false)),
      layout(population_package.population(), body_package.body()),
      standardisation([&] {
        training_z = layout.read(population(), training);
        Standardisation made(training_z, layout.tokens());
        training_z = made.standardise(std::move(training_z));
        held_out_z = made.standardise(layout.read(population(), held_out));
        return made;
      }()),
      renderer(body_package, fixed_poses(population(), options.motion, 2),
               make_shots(body_package.body())),
      picture_px(std::clamp(2 * population().texels_a_side(), 128u, 256u)),
      pictures(population().size()) {
  frame_shots();
  crew.run("drawing members", population().size(),
           [&](size_t m) { pictures[m] = draw(OpenedMember(population(), m).avatar); });
}

void MemberSet::frame_shots() {
  std::vector<std::vector<Extent>> extents(population().size());
  crew.run("framing", population().size(),
           [&](size_t m) { extents[m] = renderer.look(OpenedMember(population(), m).avatar); });
  for (size_t shot = 0; shot < renderer.shots().size(); ++shot) {
    std::vector<Extent> seen;
    for (const std::vector<Extent>& own : extents) seen.push_back(own[shot]);
    const Extent all = hold(seen, shot == kBustPortrait ? kFramedBusts : 1);
    if (!(all.right > all.left && all.bottom > all.top))
      throw InputError("population '" + population().name + "': its members cannot be seen");
    if (shot < kComparedShots || shot == kBustPortrait)
      renderer.frame(shot, all, picture_px, picture_px, kPictureMargin);
    if (shot >= kComparedShots) portrait_extent(shot).add(all);
  }
}

uint32_t MemberSet::portrait_width_px(size_t shot, uint32_t height_px) const {
  const bool bust = shot == kBustPortrait;
  const float aspect = std::clamp(portrait_extent(shot).aspect(),
                                  bust ? kNarrowestBust : kNarrowest, bust ? kWidestBust : kWidest);
  return static_cast<uint32_t>(std::lround(aspect * static_cast<float>(height_px)));
}

Picture MemberSet::portrait(const Avatar& avatar, size_t shot, uint32_t height_px) const {
  // Drawn at about the scale of the pictures that trained the presets, then shrunk: the splatter's
  // blur of 0.3 px^2 belongs to that scale. Of busts only where cameras of busts trained them.
  const bool trained = shot != kBustPortrait || has_quality(population(), "bust_psnr_db");
  const auto finer = std::max(
      1u, trained
              ? static_cast<uint32_t>(std::lround(3.2 * population().texels_a_side() / height_px))
              : 1u);
  const uint32_t width_px = portrait_width_px(shot, height_px);
  ShotRenderer framed = renderer;
  framed.frame(shot, portrait_extent(shot), finer * width_px, finer * height_px, kPortraitMargin);
  return shrink(framed.draw(avatar, shot, shot + 1).front(), finer);
}

}  // namespace figurine::members
