// Pictures for people to look at, in the format that the file's name asks for.
#pragma once

#include <string>

#include "ports/media/image.h"

namespace figurine::dataset {

// Throws InputError where a name ends in neither .png nor .jpg: asked before long work, so that
// its result is not lost to a slip of the keyboard.
void check_picture_name(const std::string& path);

// RGB or grey; JPEG in a quality that shows no blocks. Whole or not at all. Throws InputError:
// the name, or the file cannot be written.
void write_picture(const std::string& path, const ports::ImageU8& image);

}  // namespace figurine::dataset
