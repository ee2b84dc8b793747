// Some frames of a sequence side by side in one image.
#pragma once

#include <cstdint>
#include <string>

#include "figurine/status.h"
#include "ports/media/image.h"
#include "samples/common/parse.h"

namespace figurine::samples {

class ContactSheet {
 public:
  struct Options {
    ImageSize frame_size;
    uint32_t frame_count = 1;
    uint32_t columns = 6;
    uint32_t tiles =
        12;  // evenly chosen frames, first and last among them; fewer where there are fewer frames
    uint32_t shrink = 1;  // tiles are 1 / shrink of a frame, averaged over shrink x shrink pixels
  };
  // kInvalidArgument if the sheet would be larger than 16384 pixels a side, or a frame smaller than
  // one tile pixel.
  static Result<ContactSheet> create(const Options& options);

  // Frame number index of the sequence, RGBA with straight alpha; taken if it is one of the chosen.
  void offer(uint32_t index, const ports::ImageU8& frame);
  // .png, without alpha if opaque, or .jpg, by the name (write_picture).
  Status write(const std::string& path, bool opaque) const;

 private:
  explicit ContactSheet(const Options& options, ImageSize tile);
  Options options_;
  ImageSize tile_;
  ports::ImageU8 sheet_;
};

}  // namespace figurine::samples
