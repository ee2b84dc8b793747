// People's poses as JSON files of fits of SMPL and SMPL-X have them, one file a frame, and which of
// several people a capture is of.
//
// A file is a list of people (or has one under "annots"). A person has, in EasyMocap's and
// MVHumanNet's words, Rh, Th (a rotation about the model's origin, not the pelvis, then a
// translation) and poses, shapes; or, in those of the model's authors, global_orient, transl (about
// the pelvis) and body_pose, betas. How many numbers `poses` has says whose they are:
//
//   63, 66         body joints, without and with the root's three (zeros)
//   69, 72         SMPL: 23 joints, the last two of them hands, which stay at rest
//   78             SMPL+H: 66 and hand components, which need a model's file and stay at rest
//   87             SMPL-X: the same, jaw and eyes
//   156, 165       SMPL+H and SMPL-X with all 30 finger joints
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "figurine/body.h"

namespace figurine::dataset {

struct CaptureFrame;

struct SmplxPerson {
  std::optional<int64_t> id;
  std::array<double, 4> rotation{1, 0, 0, 0};  // of the root
  std::array<double, 3> translation_m{0, 0, 0};
  bool about_origin = true;             // Rh, Th; else about the pelvis
  bool smpl = false;                    // of SMPL or SMPL+H, whose shapes are other ones
  std::array<double, 55 * 3> joints{};  // rotation vectors, SMPL-X's order; the root's is zero
  std::vector<float> shapes;            // at least 10
};

// Everybody in one file. Throws InputError naming file and field.
std::vector<SmplxPerson> read_smplx_people(const std::string& path);

// Whom a capture is of: id 0 where any file has it; or the only person, where no file has two. Of
// each file that person, nobody where it is not in. Throws InputError naming a file where it cannot
// be told.
std::map<uint32_t, SmplxPerson> choose_person(
    const std::map<uint32_t, std::vector<SmplxPerson>>& people, const std::string& folder);

// Where the model's own origin lies in the rest pose of `body`, of a body that was read from
// SMPL-X; else it has the origin itself.
struct ModelOrigin {
  std::array<double, 3> position_m{0, 0, 0};
  bool smplx = false;
};

// root_rest_m: of the body in the person's shape.
void set_pose(const SmplxPerson& person, const std::array<double, 3>& root_rest_m,
              const ModelOrigin& origin, CaptureFrame& frame);

std::array<double, 3> root_rest_position(const Body& body, const std::vector<float>& shape);

// Throws InputError "where: reason" if the shape makes no person of the body: its skeleton is less
// than a fifth or more than five times as large as the mean one.
void check_shape(const Body& body, const std::vector<float>& shape, const std::string& where);

}  // namespace figurine::dataset
