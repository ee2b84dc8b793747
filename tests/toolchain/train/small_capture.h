// A small real capture for tests of the trainer: the mannequin, swinging, from 8 cameras at
// 128x128, its head and shoulders from 2 at 96x96, with a body package at T = 32. Made once per
// program, about two seconds, in a folder that is removed at the end.
#pragma once

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <stdexcept>
#include <string>

#include "formats/writer/package_writer.h"
#include "ports/host/files.h"
#include "toolchain/body/mannequin.h"
#include "toolchain/body/skeleton.h"
#include "toolchain/body/texel_body.h"
#include "toolchain/capture/capture.h"
#include "toolchain/error.h"
#include "toolchain/temporary_folder.h"
#include "toolchain/train/package_file.h"

namespace figurine::testing_tools {

struct SmallCapture {
  TemporaryFolder folder;
  std::string body = folder.path("mannequin.fgn");
  std::string data = folder.path("capture") + "/" + capture::identity_name(0);

  // On the mannequin in its own layout.
  SmallCapture() : SmallCapture(body::make_texel_body(body::make_mannequin(), 32)) {}

  explicit SmallCapture(const body::TexelBody& texels) {
    const auto bytes = value_or_throw(write_package(texels.view(), {.tool = "test"}), body);
    throw_if_error(ports::write_file_atomically(body, bytes), body);
    const train::PackageFile package = train::open_package(body, PackageKind::kBody);
    capture::capture_identities(
        {.output = folder.path("capture"),
         .seed = 5,
         .frames = 32,
         .cameras =
             {.views = 8, .bust_views = 2, .bust_scale = 0.75f, .width_px = 128, .height_px = 128},
         .threads = 2,
         .tool = "test",
         .sources = {"swinging: made by the test"}},
        package.package, {swinging_clip(120)}, nullptr);
  }

  // Legs and arms swing, the trunk sways, fingers curl.
  static ports::MotionClip swinging_clip(uint32_t frames) {
    ports::MotionClip clip;
    clip.name = "swinging";
    clip.frame_count = frames;
    for (uint32_t f = 0; f < frames; ++f) {
      clip.root_translation_m.insert(clip.root_translation_m.end(), {0, 0, 0});
      for (uint32_t j = 0; j < body::kJointCount; ++j) {
        const double angle = 0.25 * std::sin(0.2 * f + 1.7 * j);
        clip.rotations.insert(clip.rotations.end(),
                              {static_cast<float>(std::cos(angle / 2)),
                               static_cast<float>(std::sin(angle / 2)), 0, 0});
      }
    }
    return clip;
  }
};

inline const SmallCapture& small_capture() {
  static const SmallCapture capture;
  return capture;
}

}  // namespace figurine::testing_tools
