#include "ports/media/yuv.h"

#include "figurine/check.h"

namespace figurine::ports {

namespace {

// Calls body with the matrix as a constant, so that its coefficients and divisors are constants.
template <class Body>
void with_matrix(YcbcrMatrix matrix, const Body& body) {
  if (matrix == YcbcrMatrix::kBt601) {
    body.template operator()<YcbcrMatrix::kBt601>();
  } else {
    body.template operator()<YcbcrMatrix::kBt709>();
  }
}

// store(x, chroma) for each 2x2 block of two rows.
template <YcbcrMatrix matrix, class Store>
void each_block(std::span<const uint8_t> top, std::span<const uint8_t> bottom, const Store& store) {
  const size_t width = top.size() / 3;
  for (size_t x = 0; x < width; x += 2) {
    const uint8_t* rows[2] = {&top[3 * x], &bottom[3 * x]};
    const size_t next = x + 1 < width ? 3 : 0;
    uint32_t sum[3];
    for (size_t c = 0; c < 3; ++c)
      sum[c] = uint32_t(rows[0][c]) + rows[0][next + c] + rows[1][c] + rows[1][next + c];
    store(x / 2, chroma_codes<matrix, 4>(sum[0], sum[1], sum[2]));
  }
}

}  // namespace

void luma_row(std::span<const uint8_t> rgb, YcbcrMatrix matrix, std::span<uint8_t> luma) {
  FIG_CHECK(rgb.size() == 3 * luma.size(), "a code of luma for each pixel");
  with_matrix(matrix, [&]<YcbcrMatrix m>() {
    for (size_t x = 0; x < luma.size(); ++x)
      luma[x] = luma_code<m>(rgb[3 * x], rgb[3 * x + 1], rgb[3 * x + 2]);
  });
}

void chroma_row(std::span<const uint8_t> top, std::span<const uint8_t> bottom, YcbcrMatrix matrix,
                std::span<uint8_t> cb, std::span<uint8_t> cr) {
  FIG_CHECK(top.size() % 3 == 0 && top.size() == bottom.size(), "two rows of RGB of one width");
  FIG_CHECK(cb.size() == (top.size() / 3 + 1) / 2 && cr.size() == cb.size(),
            "a code for two pixels");
  with_matrix(matrix, [&]<YcbcrMatrix m>() {
    each_block<m>(top, bottom,
                  [&](size_t x, ChromaCodes codes) { cb[x] = codes.cb, cr[x] = codes.cr; });
  });
}

void interleaved_chroma_row(std::span<const uint8_t> top, std::span<const uint8_t> bottom,
                            YcbcrMatrix matrix, std::span<uint8_t> cbcr) {
  FIG_CHECK(top.size() % 3 == 0 && top.size() == bottom.size(), "two rows of RGB of one width");
  FIG_CHECK(cbcr.size() == (top.size() / 3 + 1) / 2 * 2, "two codes for two pixels");
  with_matrix(matrix, [&]<YcbcrMatrix m>() {
    each_block<m>(top, bottom, [&](size_t x, ChromaCodes codes) {
      cbcr[2 * x] = codes.cb, cbcr[2 * x + 1] = codes.cr;
    });
  });
}

void yuyv_row(std::span<const uint8_t> rgb, YcbcrMatrix matrix, std::span<uint8_t> yuyv) {
  FIG_CHECK(rgb.size() % 6 == 0, "pairs of pixels");
  FIG_CHECK(yuyv.size() == rgb.size() / 3 * 2, "two codes for each pixel");
  with_matrix(matrix, [&]<YcbcrMatrix m>() {
    for (size_t pair = 0; pair < rgb.size() / 6; ++pair) {
      const uint8_t* p = &rgb[6 * pair];
      const ChromaCodes chroma =
          chroma_codes<m, 2>(uint32_t(p[0]) + p[3], uint32_t(p[1]) + p[4], uint32_t(p[2]) + p[5]);
      uint8_t* out = &yuyv[4 * pair];
      out[0] = luma_code<m>(p[0], p[1], p[2]);
      out[1] = chroma.cb;
      out[2] = luma_code<m>(p[3], p[4], p[5]);
      out[3] = chroma.cr;
    }
  });
}

}  // namespace figurine::ports
