// What evaluations share that photograph the captured person again: pictures of what the renderer
// of captures gives, and cameras to look from.
#pragma once

#include <cstdint>
#include <vector>

#include "toolchain/capture/renderer.h"
#include "toolchain/dataset/dataset.h"
#include "toolchain/measure/metrics.h"

namespace figurine::reconstruction {

measure::Picture picture_of(const capture::Rendering& rendering);

// At most `count` of the framing, held-out ones first, spread evenly over each.
std::vector<size_t> choose_cameras(const dataset::Dataset& data, dataset::Framing framing,
                                   uint32_t count);

// Throws InputError if the capture is not figurine's own, whose people alone can be photographed
// again.
void check_retakable(const dataset::Dataset& data);

}  // namespace figurine::reconstruction
