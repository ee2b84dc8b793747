// A tensor's values as doubles, whatever its element type.
#pragma once

#include <cstddef>
#include <cstring>
#include <span>

#include "figurine/package.h"

namespace figurine::inspect {

template <class T>
double value_at(const std::byte* data, size_t index) {
  T value;
  std::memcpy(&value, data + index * sizeof(T), sizeof(T));
  return static_cast<double>(value);
}

class TensorValues {
 public:
  TensorValues(const TensorInfo& tensor, std::span<const std::byte> package)
      : data_(package.data() + tensor.offset_bytes),
        type_(tensor.type),
        count_(tensor.size_bytes / size_bytes(tensor.type)) {}

  size_t count() const { return count_; }
  double operator[](size_t index) const {
    switch (type_) {
      case DataType::kF32:
        return value_at<float>(data_, index);
      case DataType::kU8:
        return value_at<uint8_t>(data_, index);
      case DataType::kI16:
        return value_at<int16_t>(data_, index);
      case DataType::kU32:
        return value_at<uint32_t>(data_, index);
      case DataType::kI8:
        return value_at<int8_t>(data_, index);
      case DataType::kI32:
        return value_at<int32_t>(data_, index);
      case DataType::kF16: {
        Half half;
        std::memcpy(&half, data_ + index * sizeof(half), sizeof(half));
        return to_float(half);
      }
    }
    return 0;
  }

 private:
  const std::byte* data_;
  DataType type_;
  size_t count_;
};

}  // namespace figurine::inspect
