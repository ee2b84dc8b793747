// An avatar in its golden pose, as its golden camera sees it: what a package's own picture shows.
#pragma once

#include <cstdint>
#include <optional>

#include "figurine/renderer.h"
#include "samples/common/rendered_frame.h"

namespace figurine::samples {

struct GoldenPicture {
  RenderedFrame frame;        // kRgba8, over the golden background
  uint64_t memory_bytes = 0;  // of the renderer
};

// Errors: of Renderer::create, add_avatar and render.
Result<GoldenPicture> draw_golden_picture(const Avatar& avatar, const Package& body,
                                          std::optional<Precision> precision,
                                          const RendererOptions& options);

}  // namespace figurine::samples
