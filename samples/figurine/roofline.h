// A frame's stages held against what the machine can do at most (tests/bench/roofline, whose JSON
// this reads): how much of the peak each one reaches. Of a stage that only moves data, the least
// that it has to read and write, once, over the memory's rate: caches can make that more than 1.
#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>

#include "figurine/frame.h"
#include "figurine/status.h"
#include "samples/common/scene.h"

namespace figurine::samples {

// Operations of a lane on a contribution in the blend's exact tier, as
// runtime/src/kernels/blend_blocks.inc writes them: place and exponent 5, 2^x 18, light 13, three
// colours 6, the block's most light 1. Lanes that are below the cut take them too and do not count.
inline constexpr double kBlendOperations = 43;

// What a frame asks of memory, of a scene's packages or a file of Gaussians.
struct SceneSize {
  uint64_t texels = 0;          // of all figures
  uint64_t cells = 0;           // of their networks' grids, as far as the body covers them
  uint64_t head_values = 0;     // a head's channels, summed over texels
  uint64_t gaussian_bytes = 0;  // of a file
  uint64_t pixels = 0;
};
SceneSize size_of(const Scene& scene, uint64_t pixels);

// Least bytes that a stage reads and writes in a frame; 0 of network and blend, which compute.
uint64_t stage_bytes(Stage stage, const SceneSize& size, uint64_t visible, uint64_t pairs);

class Roofline {
 public:
  // One line names file, field and reason.
  static Result<Roofline> load(const std::string& path);
  static Result<Roofline> parse(const std::string& text, const std::string& name);

  // Of a run of `bench` (docs/json.md, "runs"): {"network": share, ...} of every stage that took
  // time, on the machine's peak for its number of threads. kNotFound if there is none for that.
  Result<nlohmann::ordered_json> shares(const nlohmann::ordered_json& run, const std::string& isa,
                                        const SceneSize& size) const;
  const std::string& cpu() const { return cpu_; }

 private:
  std::string name_, cpu_;
  nlohmann::json rows_;
};

}  // namespace figurine::samples
