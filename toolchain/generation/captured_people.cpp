#include "toolchain/generation/captured_people.h"

#include <algorithm>
#include <cmath>
#include <future>

#include "toolchain/capture/capture.h"
#include "toolchain/capture/person.h"
#include "toolchain/capture/renderer.h"
#include "toolchain/error.h"

namespace figurine::generation {

using measure::Picture;
using members::kComparedShots;
using members::MemberSet;

namespace {

// A capture writes shape coefficients as short decimals. Two people differ by tenths.
constexpr float kShapeRounding = 1e-3f;

bool same_shape(std::span<const float> a, std::span<const float> b) {
  return std::ranges::equal(a, b,
                            [](float x, float y) { return std::abs(x - y) <= kShapeRounding; });
}

std::span<const float> shape_of(const Population& population, size_t member) {
  const size_t count = population.shape.size() / population.size();
  return population.shape.subspan(member * count, count);
}

Picture join(const capture::Rendering& rendering) {
  Picture picture{rendering.colour.width_px, rendering.colour.height_px, {}};
  for (size_t pixel = 0; pixel < rendering.alpha.pixels.size(); ++pixel) {
    const uint8_t* colour = &rendering.colour.pixels[3 * pixel];
    picture.rgba.insert(picture.rgba.end(),
                        {colour[0], colour[1], colour[2], rendering.alpha.pixels[pixel]});
  }
  return picture;
}

}  // namespace

CapturedPeople::CapturedPeople(const std::string& recipe, const std::string& makehuman,
                               const Population& population)
    : path_(recipe), recipe_(population::read_recipe(recipe)) {
  const std::string whose = "population '" + population.name + "'";
  if (recipe_.name != population.name)
    throw InputError(path_ + ": name: '" + recipe_.name + "' is not the recipe of " + whose);
  const std::string body = recipe_.mannequin ? "mannequin" : "makehuman";
  if (body != population.body_name) {
    throw InputError(path_ + ": body: '" + body + "', but " + whose + " stands on '" +
                     population.body_name + "'");
  }
  const std::vector<population::Identity> all = population::identities_of(recipe_);
  for (const PopulationMember& member : population.members) {
    const auto found = std::ranges::find(all, member.name, &population::Identity::name);
    if (found == all.end())
      throw InputError(path_ + ": groups: no identity '" + member.name +
                       "', which is a member of " + whose);
    if (found->split != member.split) {
      throw InputError(path_ + ": groups: identity '" + member.name + "' is of part " +
                       to_string(found->split) + ", in " + whose + " of part " +
                       to_string(member.split));
    }
    identities_.push_back(*found);
  }
  if (recipe_.mannequin) return;
  if (makehuman.empty())
    throw InputError("--makehuman: no directory given and FIGURINE_MAKEHUMAN is not set");
  makehuman_ = body::MakeHuman::load(makehuman);
  makehuman_directory_ = makehuman;
}

// shape: what the person must have; empty: whatever it has.
std::vector<Picture> CapturedPeople::photograph(const MemberSet& set,
                                                const population::Identity& identity,
                                                std::span<const float> shape) const {
  const Body& body = set.body->body();
  const capture::PersonRequest request{.seed = capture::person_seed(recipe_.seed, identity.number),
                                       .limits = identity.group->limits};
  const capture::Person person =
      makehuman_ ? capture::make_makehuman_person(request, *makehuman_, makehuman_directory_, body)
                 : capture::make_mannequin_person(request, body);
  if (!shape.empty() && !same_shape(person.shape, shape)) {
    throw InputError(path_ + ": seed: its identity '" + identity.name() +
                     "' has another shape than the member of population '" + set.population().name +
                     "'");
  }
  std::vector<float> joints_m(size_t{body.joint_count()} * 3),
      texels_m(size_t{body.texel_count()} * 3);
  shape_body(body, person.shape, joints_m, texels_m);
  std::vector<Affine> world_from_rest(body.joint_count());
  capture::Renderer renderer(person);
  std::vector<Picture> pictures;
  for (size_t shot = 0; shot < kComparedShots; ++shot) {
    if (shot == 0 || set.renderer.shots()[shot].pose != set.renderer.shots()[shot - 1].pose) {
      skinning_transforms({body.parents, joints_m}, set.renderer.pose(shot), world_from_rest);
      renderer.set_pose(world_from_rest);
    }
    pictures.push_back(join(renderer.render(set.renderer.camera(shot))));
  }
  return pictures;
}

People CapturedPeople::draw(const MemberSet& set, std::span<const size_t> members) const {
  People people(members.size());
  set.crew.run("capturing people", members.size(), [&](size_t i) {
    // In a thread of its own: the renderer's way with denormals stays with the thread, and must not
    // change what is measured afterwards.
    people[i] = std::async(std::launch::async, [&] {
                  const size_t member = members[i];
                  return photograph(set, identities_[member], shape_of(set.population(), member));
                }).get();
  });
  return people;
}

People CapturedPeople::draw_unseen(const MemberSet& set, size_t count) const {
  const auto group =
      std::ranges::find(recipe_.groups, Split::kTest, &population::IdentityGroup::split);
  if (group == recipe_.groups.end())
    throw InputError(path_ + ": groups: no test people, so nobody knows what others may wear");
  for (const population::IdentityGroup& named : recipe_.groups) {
    if (named.first + named.count > kFirstUnseen)
      throw InputError(path_ + ": groups: identities from " + std::to_string(kFirstUnseen) +
                       " are those whom the recipe does not name");
  }
  People people(count);
  set.crew.run("capturing unseen people", count, [&](size_t i) {
    const population::Identity identity{
        .number = kFirstUnseen + static_cast<uint32_t>(i), .split = Split::kTest, .group = &*group};
    people[i] = std::async(std::launch::async, [&] { return photograph(set, identity, {}); }).get();
  });
  return people;
}

}  // namespace figurine::generation
