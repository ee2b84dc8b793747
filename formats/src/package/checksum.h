// XXH3 over bytes: what packages are sealed with. Guards against damage, not against forgery.
// Based on: Yann Collet, xxHash specification, version 0.8.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

namespace figurine {

uint64_t xxh3_64(std::span<const std::byte> bytes);
std::array<uint64_t, 2> xxh3_128(std::span<const std::byte> bytes);  // low, high
std::array<uint64_t, 2> xxh3_128(
    std::span<const std::span<const std::byte>> parts);  // of all of them, one after the other

}  // namespace figurine
