// Held-out pictures beside the truth, for people to look at: the truth left of what one or several
// avatars of the same capture look like.
//
//   row 1  held-out poses from held-out cameras, whole person
//   row 2  the same poses' head and shoulders, from the camera near by that sees most of the face;
//          left out where the capture has no such cameras
//   row 3  the pictures of row 1: faces
//   row 4  the same pictures' left hands
// Tiles are cut from the picture over mid-grey and scaled to one height (bilinear), never
// sharpened.
#pragma once

#include <vector>

#include "ports/media/image.h"
#include "toolchain/train/trained_avatar.h"

namespace figurine::pictures {

struct ContactSheetOptions {
  uint32_t poses = 4;
  uint32_t person_height_px = 480;
  uint32_t detail_height_px = 160;
};

using Avatars = std::vector<train::TrainedAvatar*>;

// RGB. Poses and cameras are spread over what is held out; if nothing is held out in both ways,
// over any held-out picture. Deterministic. Throws InputError if the avatars are of several
// captures.
ports::ImageU8 make_contact_sheet(const Avatars& avatars, const ContactSheetOptions& options);

}  // namespace figurine::pictures
