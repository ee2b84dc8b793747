// Entropy coding of int8 values in [-127, 127]: one stream of bytes, the values' frequencies known
// to both sides.
//
// Based on: Duda, Asymmetric numeral systems, 2013; byte-wise renormalisation as in Giesen's
// rans_byte. The state is 32 bits in [2^23, 2^31), frequencies are multiples of 2^-14. A stream is
// the state, u32, and the bytes that the decoder takes in, in that order.
//
// The decoder is total: it makes a value in [-127, 127] of whatever bytes it is given, zeros where
// they end. Damage is the checksum's to find; a forged stream decodes to other weights, never to a
// failure.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

namespace figurine {

inline constexpr uint32_t kRansBits = 14;
inline constexpr uint32_t kRansTotal = 1u << kRansBits;
inline constexpr uint32_t kRansLow = 1u << 23;
inline constexpr size_t kRansValues =
    255;  // entry k of a list of frequencies is that of the value k - 127

struct RansTable {
  std::array<uint32_t, kRansValues> frequency{}, start{};
  std::array<uint8_t, kRansTotal> entry{};  // of every slot

  // frequencies: [255], none negative, sum kRansTotal.
  explicit RansTable(std::span<const int16_t> frequencies) {
    uint32_t slot = 0;
    for (size_t k = 0; k < kRansValues; ++k) {
      frequency[k] = static_cast<uint32_t>(frequencies[k]);
      start[k] = slot;
      for (const uint32_t end = slot + frequency[k]; slot < end; ++slot)
        entry[slot] = static_cast<uint8_t>(k);
    }
  }
};

class RansDecoder {
 public:
  explicit RansDecoder(std::span<const uint8_t> bytes) : bytes_(bytes) {
    for (int shift = 0; shift < 32; shift += 8) state_ |= next_byte() << shift;
  }

  int32_t next(const RansTable& table) {
    const uint32_t slot = state_ & (kRansTotal - 1), k = table.entry[slot];
    state_ = table.frequency[k] * (state_ >> kRansBits) + slot - table.start[k];
    for (int taken = 0; taken < 2 && state_ < kRansLow; ++taken)
      state_ = state_ << 8 | next_byte();  // a sound stream never needs a third
    return static_cast<int32_t>(k) - 127;
  }

 private:
  uint32_t next_byte() { return at_ < bytes_.size() ? bytes_[at_++] : 0u; }

  std::span<const uint8_t> bytes_;
  size_t at_ = 0;
  uint32_t state_ = 0;
};

}  // namespace figurine
