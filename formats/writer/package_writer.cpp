#include "formats/writer/package_writer.h"

#include <cstring>

#include "formats/src/package/text.h"
#include "formats/writer/package_parts.h"

namespace figurine {

namespace {

// How messages call the thing being written: by its name, if that can be printed.
std::string describe(const char* kind, const std::string& name) {
  return is_clean_text(name, false) ? std::string(kind) + " '" + name + "'" : std::string(kind);
}

// Nothing leaves the writer that the reader would refuse.
Result<std::vector<std::byte>> assemble_and_verify(Result<PackageParts> parts,
                                                   const std::string& name) {
  if (!parts.ok()) return parts.status().within(name);
  std::vector<std::byte> bytes = assemble(*parts);
  const AlignedBytes copy(bytes);
  if (const Result<Package> opened = Package::open(copy.bytes(), name); !opened.ok())
    return opened.status();
  return bytes;
}

}  // namespace

AlignedBytes::AlignedBytes(std::span<const std::byte> source)
    : storage_(source.size() + kBlobAlignment), size_(source.size()) {
  skip_ = (kBlobAlignment - reinterpret_cast<uintptr_t>(storage_.data()) % kBlobAlignment) %
          kBlobAlignment;
  if (!source.empty()) std::memcpy(storage_.data() + skip_, source.data(), source.size());
}

Result<std::vector<std::byte>> write_package(const Body& body, const Provenance& provenance) {
  return assemble_and_verify(take_apart(body, provenance), describe("body", body.name));
}

Result<std::vector<std::byte>> write_package(const Avatar& avatar, const Budget& budget,
                                             const Provenance& provenance) {
  return assemble_and_verify(take_apart(avatar, budget, provenance),
                             describe("avatar", avatar.name));
}

Result<std::vector<std::byte>> write_package(const Motion& motion, const Provenance& provenance) {
  return assemble_and_verify(take_apart(motion, provenance), describe("motion", motion.name));
}

Result<std::vector<std::byte>> write_package(const Population& population, const Budget& budget,
                                             const Provenance& provenance,
                                             std::span<const Provenance> own) {
  return assemble_and_verify(take_apart(population, budget, provenance, own),
                             describe("population", population.name));
}

Result<std::vector<std::byte>> write_package(const Sampler& sampler, const Budget& budget,
                                             const Provenance& provenance) {
  return assemble_and_verify(take_apart(sampler, budget, provenance),
                             describe("sampler", sampler.name));
}

}  // namespace figurine
