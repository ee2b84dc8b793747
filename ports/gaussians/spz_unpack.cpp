#include "ports/gaussians/spz_unpack.h"

#include <zlib.h>
#include <zstd.h>

#include <algorithm>
#include <limits>

namespace figurine::ports {

struct Gunzip::State {
  z_stream stream{};
  std::span<const std::byte> packed;
  bool ended = false;
};

Gunzip::Gunzip(std::span<const std::byte> packed) : state_(std::make_unique<State>()) {
  state_->packed = packed;
  constexpr int kGzipOnly = 16 + MAX_WBITS;
  if (inflateInit2(&state_->stream, kGzipOnly) != Z_OK) why_ = "there is no memory to unpack it";
}

Gunzip::~Gunzip() { inflateEnd(&state_->stream); }

// As much as fits into to; less only at the stream's end.
bool Gunzip::run(std::span<std::byte> to, size_t& size) {
  constexpr size_t kMost = std::numeric_limits<uInt>::max();
  size = 0;
  z_stream& stream = state_->stream;
  while (why_.empty() && !state_->ended && size < to.size()) {
    const auto in = static_cast<uInt>(std::min(state_->packed.size(), kMost));
    const auto out = static_cast<uInt>(std::min(to.size() - size, kMost));
    stream.next_in = reinterpret_cast<Bytef*>(const_cast<std::byte*>(state_->packed.data()));
    stream.avail_in = in;
    stream.next_out = reinterpret_cast<Bytef*>(to.data() + size);
    stream.avail_out = out;
    const int result = inflate(&stream, Z_NO_FLUSH);
    state_->packed = state_->packed.subspan(in - stream.avail_in);
    size += out - stream.avail_out;
    if (result == Z_STREAM_END) {
      state_->ended = true;
    } else if (result == Z_BUF_ERROR || (result == Z_OK && state_->packed.empty() &&
                                         size < to.size() && stream.avail_out == out)) {
      why_ = "the gzip stream is cut off";
    } else if (result != Z_OK) {
      why_ =
          result == Z_MEM_ERROR ? "there is no memory to unpack it" : "the gzip stream is damaged";
    }
  }
  return why_.empty();
}

bool Gunzip::fill(std::span<std::byte> to) {
  size_t size = 0;
  if (!run(to, size)) return false;
  if (size == to.size()) return true;
  why_ = "the gzip stream ends early";
  return false;
}

bool Gunzip::fill_to_end(std::span<std::byte> to, size_t& size) {
  if (!run(to, size)) return false;
  if (state_->ended) return true;
  std::byte more[1];
  size_t beyond = 0;  // the end of a full buffer shows only when asked for more
  if (!run(more, beyond)) return false;
  if (beyond > 0) why_ = "it goes on behind what it declares";
  return beyond == 0;
}

bool unpack_zstd(std::span<const std::byte> packed, std::span<std::byte> to) {
  return ZSTD_decompress(to.data(), to.size(), packed.data(), packed.size()) == to.size();
}

}  // namespace figurine::ports
