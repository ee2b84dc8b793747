// The packing around .spz files: gzip and zstd into buffers whose sizes are known before. All that
// knows zlib and zstd.
#pragma once

#include <cstddef>
#include <memory>
#include <span>
#include <string>

namespace figurine::ports {

// A gzip stream, front to back.
class Gunzip {
 public:
  explicit Gunzip(std::span<const std::byte> packed);
  ~Gunzip();
  // Fills to. False if the stream ends before or is damaged; why() says which.
  bool fill(std::span<std::byte> to);
  // What is left, at most to.size() of it; its length in size. False on damage, the checksum at
  // the end included, and where there is more.
  bool fill_to_end(std::span<std::byte> to, size_t& size);
  const std::string& why() const { return why_; }

 private:
  bool run(std::span<std::byte> to, size_t& size);

  struct State;
  std::unique_ptr<State> state_;
  std::string why_;
};

// One zstd stream into exactly to.size() bytes. False if it is damaged or holds another number.
bool unpack_zstd(std::span<const std::byte> packed, std::span<std::byte> to);

}  // namespace figurine::ports
