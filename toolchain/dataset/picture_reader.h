// A capture's pictures as people have them: JPEG and PNG of every kind, as the one kind that
// training wants.
//
//   colour   JPEG (grey too; turned upright as its EXIF says; CMYK is refused) or PNG (palette, 16
//            bits, grey, alpha over black); what the file says decides, not its name
//   mask     one channel, 255 inside: grey, soft or hard; of a picture with alpha that varies, its
//            alpha; labels 0 and 1; a single colour on black (a palette's second entry). Several
//            colours are several things and refused, and so is a mask that is dark all over
#pragma once

#include <string>

#include "ports/media/image.h"

namespace figurine::dataset {

struct PictureSize {
  uint32_t width_px = 0, height_px = 0;
};

// All throw InputError naming the file.
PictureSize read_picture_size(const std::string& path);
ports::ImageU8 read_colour(const std::string& path);  // 3 channels
ports::ImageU8 read_mask(const std::string& path);    // 1 channel

// Whether a folder's file may be a picture, by its name: .jpg, .jpeg, .png, capitals or not.
bool is_picture_name(const std::string& name);

}  // namespace figurine::dataset
