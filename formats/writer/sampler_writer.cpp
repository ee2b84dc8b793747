#include "formats/writer/sampler_writer.h"

#include "formats/writer/package_writer.h"

namespace figurine {

Result<std::vector<std::byte>> write_sampler(const NewSampler& from) {
  FIG_CHECK(from.sampler != nullptr, "a sampler to write");
  Sampler sampler = *from.sampler;
  // A member's golden frame, where pose and camera are taken from, may have both.
  sampler.golden = sampler.golden.without_picture();
  return write_package(sampler, from.budget, from.provenance);
}

}  // namespace figurine
