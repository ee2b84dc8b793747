#include <algorithm>
#include <cmath>

#include "samples/inspect/describe.h"
#include "samples/inspect/tensor_values.h"

namespace figurine::inspect {

namespace {

// Leaves of a document by JSON pointer, without what names the file rather than its content.
Json flatten_fields(const Package& package, const std::string& path) {
  Json document = describe(package, path);
  document.erase("file");
  document.erase("content_hash");
  document.erase("size_bytes");
  document.erase("parts");
  return document.flatten();
}

Json compare_fields(const Json& a, const Json& b) {
  Json differences = Json::array();
  for (const auto& [field, value] : a.items()) {
    const auto other = b.find(field);
    if (other == b.end()) {
      differences.push_back({{"field", field}, {"a", value}, {"b", nullptr}});
    } else if (*other != value) {
      differences.push_back({{"field", field}, {"a", value}, {"b", *other}});
    }
  }
  for (const auto& [field, value] : b.items()) {
    if (!a.contains(field)) differences.push_back({{"field", field}, {"a", nullptr}, {"b", value}});
  }
  return differences;
}

// Null if the two are the same to the bit.
Json compare_tensor(const TensorInfo& a, std::span<const std::byte> a_bytes, const TensorInfo& b,
                    std::span<const std::byte> b_bytes) {
  if (a.type != b.type || a.shape != b.shape) {
    return {{"name", a.name},
            {"difference", "shape or type"},
            {"a", {{"type", to_string(a.type)}, {"shape", a.shape}}},
            {"b", {{"type", to_string(b.type)}, {"shape", b.shape}}}};
  }
  const auto bytes_of = [](const TensorInfo& t, std::span<const std::byte> bytes) {
    return bytes.subspan(t.offset_bytes, t.size_bytes);
  };
  if (std::ranges::equal(bytes_of(a, a_bytes), bytes_of(b, b_bytes))) return nullptr;
  const TensorValues left(a, a_bytes), right(b, b_bytes);
  double largest = 0, squares = 0;
  size_t different = 0;
  for (size_t i = 0; i < left.count(); ++i) {
    const double difference = std::fabs(left[i] - right[i]);
    largest = std::max(largest, difference);
    squares += difference * difference;
    different += difference != 0;
  }
  return {{"name", a.name},
          {"difference", "values"},
          {"max_abs_difference", largest},
          {"rms_difference", std::sqrt(squares / static_cast<double>(left.count()))},
          {"different_values", different},
          {"values", left.count()}};
}

}  // namespace

Json compare(const Package& a, std::span<const std::byte> a_bytes, const std::string& a_path,
             const Package& b, std::span<const std::byte> b_bytes, const std::string& b_path) {
  Json tensors = Json::array();
  const auto find = [](const Package& package, const std::string& name) {
    return std::ranges::find(package.tensors(), name, &TensorInfo::name);
  };
  for (const TensorInfo& tensor : a.tensors()) {
    const auto other = find(b, tensor.name);
    if (other == b.tensors().end()) {
      tensors.push_back({{"name", tensor.name}, {"difference", "only in a"}});
    } else if (Json difference = compare_tensor(tensor, a_bytes, *other, b_bytes);
               !difference.is_null()) {
      tensors.push_back(std::move(difference));
    }
  }
  for (const TensorInfo& tensor : b.tensors()) {
    if (find(a, tensor.name) == a.tensors().end())
      tensors.push_back({{"name", tensor.name}, {"difference", "only in b"}});
  }
  Json fields = compare_fields(flatten_fields(a, a_path), flatten_fields(b, b_path));
  const bool same = a.content_hash() == b.content_hash() && fields.empty() && tensors.empty();
  return {{"a", {{"file", a_path}, {"content_hash", format_hash(a.content_hash())}}},
          {"b", {{"file", b_path}, {"content_hash", format_hash(b.content_hash())}}},
          {"same", same},
          {"fields", std::move(fields)},
          {"tensors", std::move(tensors)}};
}

}  // namespace figurine::inspect
