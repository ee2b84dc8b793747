#include "figurine/sampler.h"

#include "figurine/check.h"

namespace figurine {

const char* to_string(SolverMethod method) {
  return method == SolverMethod::kDdim ? "ddim" : "dpmpp2m";
}

std::vector<size_t> sampler_token_sizes(const Sampler& sampler) {
  const Result<std::vector<ValueShape>> shapes = infer_shapes(sampler.network, false);
  FIG_CHECK(shapes.ok(), "the network's shapes");
  std::vector<size_t> sizes;
  for (const Layer& layer : sampler.network.layers) {
    if (layer.op != LayerOp::kConv2d || sampler.shares_network) continue;
    const size_t inputs = size_t{layer.kernel} * layer.kernel * (*shapes)[layer.inputs[0]].channels;
    sizes.push_back(layer.out_channels * (inputs + 1));
  }
  if (sampler.shape_count > 0) sizes.push_back(sampler.shape_count);
  for (const SampledStaticGroup& group : sampler.static_groups) {
    for (const uint32_t rows : group.patch_rows) sizes.push_back(size_t{rows} * group.channels);
  }
  return sizes;
}

std::vector<MatrixShape> denoiser_matrices(const DenoiserShape& shape,
                                           std::span<const uint32_t> ranks) {
  const uint32_t d = shape.d_model, f = shape.feed_forward;
  std::vector<MatrixShape> matrices;
  for (const uint32_t rank : ranks) matrices.push_back({d, rank});
  matrices.insert(matrices.end(), 2, {d, d});
  for (uint32_t b = 0; b < shape.blocks; ++b) {
    for (const MatrixShape& matrix :
         {MatrixShape{3 * d, d}, MatrixShape{d, d}, MatrixShape{f, d}, MatrixShape{d, f}}) {
      matrices.push_back(matrix);
    }
  }
  for (const uint32_t rank : ranks) matrices.push_back({rank, d});
  return matrices;
}

}  // namespace figurine
