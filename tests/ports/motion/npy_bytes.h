// A NumPy array as the bytes of a file, for tests of every reader of .npy and .npz.
#pragma once

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <iterator>
#include <string>
#include <vector>

namespace figurine::ports::tests {

// One .npy, version 1.0. type: "<f8", "<f4", "<f2" (zeros and ones alone), ">f4", "<u4", "<i8";
// values: row-major.
inline std::string npy_bytes(const std::string& type, const std::vector<size_t>& shape,
                             const std::vector<double>& values) {
  std::string tuple = "(";
  for (size_t extent : shape) tuple += std::to_string(extent) + ",";
  std::string header =
      "{'descr': '" + type + "', 'fortran_order': False, 'shape': " + tuple + "), }";
  header.resize((header.size() + 1 + 10 + 63) / 64 * 64 - 10, ' ');
  header.back() = '\n';
  std::string out("\x93NUMPY\x01\x00", 8);
  out += static_cast<char>(header.size() & 255);
  out += static_cast<char>(header.size() >> 8);
  out += header;
  const auto append = [&](auto value) {
    char bytes[sizeof value];
    std::memcpy(bytes, &value, sizeof value);
    if (type[0] == '>') std::reverse(std::begin(bytes), std::end(bytes));
    out.append(bytes, sizeof value);
  };
  for (double value : values) {
    const std::string kind = type.substr(1);
    if (kind == "f8") append(value);
    if (kind == "f4") append(static_cast<float>(value));
    if (kind == "f2") append(static_cast<uint16_t>(value == 0 ? 0 : value < 0 ? 0xBC00 : 0x3C00));
    if (kind == "u4") append(static_cast<uint32_t>(static_cast<int64_t>(value)));
    if (kind == "i8") append(static_cast<int64_t>(value));
  }
  return out;
}

}  // namespace figurine::ports::tests
