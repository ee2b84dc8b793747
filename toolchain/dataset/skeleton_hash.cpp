#include "toolchain/dataset/skeleton_hash.h"

#include <cstdint>
#include <span>
#include <vector>

#include "figurine/package.h"

namespace figurine::dataset {

std::string skeleton_hash(const Body& body) {
  std::vector<uint8_t> bytes;
  const auto add = [&](const void* data, size_t size) {
    const auto* begin = static_cast<const uint8_t*>(data);
    bytes.insert(bytes.end(), begin, begin + size);
  };
  for (const std::string& name : body.joint_names) add(name.c_str(), name.size() + 1);
  add(body.parents.data(), body.parents.size_bytes());
  add(body.joint_position_m.data(), body.joint_position_m.size_bytes());
  add(body.joint_shape_basis_m.data(), body.joint_shape_basis_m.size_bytes());
  return format_hash(hash_picture(bytes));
}

}  // namespace figurine::dataset
