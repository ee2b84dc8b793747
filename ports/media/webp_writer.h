// Animated WebP through libwebp: browsers and most viewers play it, alpha included, and the demo's
// takes a fortieth of the room of .y4m. The only includer of libwebp.
#pragma once

#include <memory>

#include "ports/host/atomic_file.h"
#include "ports/media/video.h"

namespace figurine::ports {

// Lossy, repeated without end; frames are compressed as they come and held until finish(). Times
// are whole milliseconds, each frame's the nearest to its own. kLimitExceeded beyond 16383 pixels a
// side.
Result<std::unique_ptr<VideoWriter>> make_webp_writer(AtomicFile file,
                                                      const VideoWriter::Options& options);

}  // namespace figurine::ports
