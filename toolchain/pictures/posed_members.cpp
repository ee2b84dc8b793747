#include "toolchain/pictures/posed_members.h"

#include <algorithm>

#include "toolchain/error.h"
#include "toolchain/random/counter.h"
#include "toolchain/train/opened_member.h"

namespace figurine::pictures {

using measure::Picture;
using train::fixed_poses;
using train::OpenedMember;

namespace {

constexpr size_t kFramedOn =
    24;  // training members; one who stands out of all of them may be cut at the margin
constexpr float kMargin = 0.06f;
constexpr float kLowest_deg = -5, kHighest_deg = 25;
enum Stream : uint64_t { kTurn = 101, kElevation = 102 };  // not those of the network

std::vector<Shot> scatter_shots(const PosedMembersOptions& options) {
  std::vector<Shot> shots;
  for (size_t pose = 0; pose < options.poses; ++pose) {
    const float turn = random::random_unit(options.seed, kTurn, options.first_pose + pose);
    for (size_t view = 0; view < options.views; ++view) {
      const float raised = random::random_unit(options.seed, kElevation,
                                               (options.first_pose + pose) * options.views + view);
      shots.push_back({.pose = pose,
                       .azimuth_deg = 360 * (static_cast<float>(view) + turn) /
                                      static_cast<float>(options.views),
                       .elevation_deg = kLowest_deg + raised * (kHighest_deg - kLowest_deg)});
    }
  }
  return shots;
}

std::vector<train::OwnedPose> choose_poses(const Population& population,
                                           const PosedMembersOptions& options) {
  std::vector<train::OwnedPose> poses =
      fixed_poses(population, options.motion, options.first_pose + options.poses);
  poses.erase(poses.begin(), poses.begin() + static_cast<std::ptrdiff_t>(options.first_pose));
  return poses;
}

// At most `most` of them, spread evenly.
std::vector<size_t> thin_out(const std::vector<size_t>& members, size_t most) {
  std::vector<size_t> some;
  const size_t count = std::min(members.size(), most);
  for (size_t i = 0; i < count; ++i) some.push_back(members[i * members.size() / count]);
  return some;
}

}  // namespace

std::vector<size_t> members_of(const Population& population, Split split) {
  std::vector<size_t> members;
  for (size_t m = 0; m < population.size(); ++m) {
    if (population.members[m].split == split) members.push_back(m);
  }
  return members;
}

PosedMembers::PosedMembers(const Package& population, const Package& body,
                           const PosedMembersOptions& options)
    : population_(&population.population()),
      options_(options),
      picture_px_(std::clamp(2 * population_->texels_a_side(), 128u, 256u)) {
  const std::vector<size_t> training = members_of(*population_, Split::kTrain);
  const std::string where = "population '" + population_->name + "'";
  if (training.size() < 2)
    throw InputError(where + ": has " + std::to_string(training.size()) +
                     " training members, at least 2 are needed");
  throw_if_error(check_avatar_fits_body(OpenedMember(*population_, training[0]).avatar, body),
                 where);
  renderer_.emplace(body, choose_poses(*population_, options), scatter_shots(options));
  const std::vector<size_t> framed_on = thin_out(training, kFramedOn);
  std::vector<std::vector<Extent>> extents(framed_on.size());
  Crew(options.threads, options.quiet).run("framing", framed_on.size(), [&](size_t i) {
    extents[i] = renderer_->look(OpenedMember(*population_, framed_on[i]).avatar);
  });
  for (size_t shot = 0; shot < shots(); ++shot) {
    Extent all;
    for (const std::vector<Extent>& own : extents) all.add(own[shot]);
    if (!(all.right > all.left && all.bottom > all.top))
      throw InputError(where + ": its members cannot be seen");
    renderer_->frame(shot, all, picture_px_, picture_px_, kMargin);
  }
}

void PosedMembers::draw(const std::string& what, std::span<const size_t> members,
                        const std::function<void(size_t, std::vector<Picture>)>& take) const {
  Crew(options_.threads, options_.quiet).run(what, members.size(), [&](size_t i) {
    take(i, renderer_->draw(OpenedMember(*population_, members[i]).avatar, 0, shots()));
  });
}

}  // namespace figurine::pictures
