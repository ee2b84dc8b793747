// Videos through an ffmpeg found on PATH: .mp4, .webm and .gif of VideoWriter.
#pragma once

#include <memory>

#include "ports/host/atomic_file.h"
#include "ports/media/video.h"

namespace figurine::ports {

// Starts ffmpeg, which writes the file's temporary. kUnsupported where there is none.
Result<std::unique_ptr<VideoWriter>> make_ffmpeg_writer(AtomicFile file, VideoKind kind,
                                                        const VideoWriter::Options& options);

}  // namespace figurine::ports
