#include "toolchain/members/member_set.h"

#include <algorithm>
#include <cmath>

#include "toolchain/error.h"
#include "toolchain/train/opened_member.h"

namespace figurine::members {

using measure::Picture;
using measure::RowMatrix;
using measure::Standardisation;
using pictures::Extent;
using pictures::Shot;
using pictures::ShotRenderer;
using train::fixed_poses;
using train::OpenedMember;

namespace {

constexpr size_t kFewestTraining =
    3;  // two have one direction and one distance: nothing to say of a population
constexpr float kPictureMargin = 0.04f, kPortraitMargin = 0.045f;
constexpr uint32_t kSupersampling =
    2;  // the splatter's 0.3 px^2 of blur are a quarter of that in a portrait
constexpr float kNarrowest = 0.35f, kWidest = 0.9f;  // of a portrait, by its height

std::vector<Shot> make_shots() {
  std::vector<Shot> shots;
  for (size_t pose = 0; pose < 2; ++pose) {
    for (const float azimuth_deg : {0.0f, 120.0f, 240.0f})
      shots.push_back({pose, azimuth_deg, 5, false});
  }
  shots.push_back({0, 20, 5, true});
  shots.push_back({0, 200, 5, true});
  return shots;
}

std::vector<size_t> members_of(const Population& population, bool training) {
  std::vector<size_t> members;
  for (size_t m = 0; m < population.size(); ++m) {
    if ((population.members[m].split == Split::kTrain) == training) members.push_back(m);
  }
  return members;
}

RowMatrix rows_of(const RowMatrix& all, const std::vector<size_t>& rows) {
  RowMatrix chosen(static_cast<Eigen::Index>(rows.size()), all.cols());
  for (size_t i = 0; i < rows.size(); ++i)
    chosen.row(static_cast<Eigen::Index>(i)) = all.row(static_cast<Eigen::Index>(rows[i]));
  return chosen;
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
        const RowMatrix weights = layout.read(population());
        Standardisation made(rows_of(weights, training), layout.tokens());
        training_z = made.standardise(rows_of(weights, training));
        held_out_z = made.standardise(rows_of(weights, held_out));
        return made;
      }()),
      renderer(body_package, fixed_poses(population(), options.motion, 2), make_shots()),
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
    Extent all;
    for (const std::vector<Extent>& own : extents) all.add(own[shot]);
    if (!(all.right > all.left && all.bottom > all.top))
      throw InputError("population '" + population().name + "': its members cannot be seen");
    if (shot < kComparedShots) {
      renderer.frame(shot, all, picture_px, picture_px, kPictureMargin);
    } else {
      portrait_extent_.add(all);
    }
  }
}

Picture MemberSet::portrait(const Avatar& avatar, size_t shot, uint32_t height_px) const {
  const float aspect = std::clamp(portrait_extent_.aspect(), kNarrowest, kWidest);
  // Drawn at about the scale of the pictures that trained the presets, then shrunk: the splatter's
  // blur of 0.3 px^2 belongs to that scale.
  const auto finer = std::max(
      1u, static_cast<uint32_t>(std::lround(3.2 * population().texels_a_side() / height_px)));
  const auto width_px = static_cast<uint32_t>(std::lround(aspect * static_cast<float>(height_px)));
  ShotRenderer framed = renderer;
  framed.frame(shot, portrait_extent_, finer * width_px, finer * height_px, kPortraitMargin);
  return shrink(framed.draw(avatar, shot, shot + 1).front(), finer);
}

}  // namespace figurine::members
