// Any bytes as an .spz; and packed by gzip behind a checksum that is right. Seeds:
// tests/fuzz/seeds/spz, of which those that are not packed are read as they are.
#include <zlib.h>

#include <vector>

#include "gaussians_fuzz.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace figurine::ports;
  tests::read_and_use(tests::bytes_of(data, size), "fuzz.spz");
  z_stream stream{};
  constexpr int kGzip = 16 + MAX_WBITS;
  if (deflateInit2(&stream, Z_NO_COMPRESSION, Z_DEFLATED, kGzip, 1, Z_DEFAULT_STRATEGY) != Z_OK)
    return 0;
  std::vector<uint8_t> packed(deflateBound(&stream, size));
  stream.next_in = const_cast<uint8_t*>(data);
  stream.avail_in = static_cast<uInt>(size);
  stream.next_out = packed.data();
  stream.avail_out = static_cast<uInt>(packed.size());
  const bool whole = deflate(&stream, Z_FINISH) == Z_STREAM_END;
  const size_t packed_bytes = stream.total_out;
  deflateEnd(&stream);
  if (whole) tests::read_and_use(tests::bytes_of(packed.data(), packed_bytes), "fuzz.spz");
  return 0;
}
