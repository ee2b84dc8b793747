// A population ready to be measured: who is in which part, everybody's standardised weights,
// everybody's pictures.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "toolchain/measure/weight_space.h"
#include "toolchain/pictures/member_pictures.h"

namespace figurine::members {

struct MemberSetOptions {
  const Motion* motion = nullptr;  // whose poses are drawn; without: golden poses
  uint32_t threads = 1;
  bool quiet = false;
};

// The pictures that everything is compared by come first; portraits are for people to look at, and
// those of busts are compared by themselves.
inline constexpr size_t kComparedShots = 6;  // two poses from three sides
// Grounded: from the front, slightly turned, and from behind; head and shoulders from the front, on
// bodies with a head.
inline constexpr size_t kFrontPortrait = kComparedShots, kBackPortrait = kComparedShots + 1,
                        kBustPortrait = kComparedShots + 2;

struct MemberSet {
  // Both are borrowed. Throws InputError if the population does not fit the body or has fewer than
  // three training members; Interrupted.
  MemberSet(const Package& population_package, const Package& body_package,
            const MemberSetOptions& options);

  const Population& population() const { return package->population(); }
  const std::string& name(size_t member) const { return population().members[member].name; }
  std::vector<measure::Picture> draw(const Avatar& avatar) const {
    return renderer.draw(avatar, 0, kComparedShots);
  }
  // Head and shoulders from the front, to be compared; has_busts must be true.
  std::vector<measure::Picture> draw_bust(const Avatar& avatar) const {
    return renderer.draw(avatar, kBustPortrait, kBustPortrait + 1);
  }
  bool has_busts() const { return renderer.shots().size() > kBustPortrait; }
  // One person to look at, a cell of `height_px`; all cells of a height and of whole people, or of
  // busts, are of one width and scale.
  measure::Picture portrait(const Avatar& avatar, size_t shot, uint32_t height_px) const;
  uint32_t portrait_width_px(size_t shot, uint32_t height_px) const;

  const Package* package;
  const Package* body;
  pictures::Crew crew;
  std::vector<size_t> training, held_out;  // members
  measure::WeightLayout layout;
  measure::RowMatrix training_z, held_out_z;  // [N,D] and [H,D], standardised
  measure::Standardisation standardisation;   // by the training members alone
  pictures::ShotRenderer renderer;
  uint32_t picture_px = 0;                              // side
  std::vector<std::vector<measure::Picture>> pictures;  // [M] of kComparedShots

 private:
  void frame_shots();
  pictures::Extent& portrait_extent(size_t shot) {
    return shot == kBustPortrait ? bust_extent_ : portrait_extent_;
  }
  const pictures::Extent& portrait_extent(size_t shot) const {
    return shot == kBustPortrait ? bust_extent_ : portrait_extent_;
  }
  pictures::Extent portrait_extent_, bust_extent_;
};

}  // namespace figurine::members
