#include "toolchain/train/tensor_file.h"

#include <bit>
#include <cmath>
#include <cstring>
#include <nlohmann/json.hpp>

#include "ports/host/files.h"
#include "toolchain/error.h"

namespace figurine::train {

static_assert(std::endian::native == std::endian::little,
              "arrays are copied as they lie in memory");

namespace {

constexpr size_t kMaxHeaderBytes = 16 << 20;

[[noreturn]] void fail(const std::string& path, const std::string& reason) {
  throw InputError(path + ": " + reason);
}

NamedTensor read_tensor(const std::string& path, const std::string& name,
                        const nlohmann::json& entry, std::span<const std::byte> data) {
  const std::string field = "tensor " + name;
  if (entry.at("dtype").get<std::string>() != "F32") fail(path, field + ": dtype is not F32");
  NamedTensor tensor{.shape = entry.at("shape").get<std::vector<int64_t>>(), .values = {}};
  const auto offsets = entry.at("data_offsets").get<std::vector<uint64_t>>();
  if (offsets.size() != 2 || offsets[0] > offsets[1] || offsets[1] > data.size())
    fail(path, field + ": data_offsets are outside the file");
  uint64_t count = 1;
  for (int64_t side : tensor.shape) {
    if (side < 0 || (side > 0 && count > data.size() / static_cast<uint64_t>(side)))
      fail(path, field + ": shape is larger than the file");
    count *= static_cast<uint64_t>(side);
  }
  if (count * sizeof(float) != offsets[1] - offsets[0])
    fail(path, field + ": shape and data_offsets contradict each other");
  tensor.values.resize(count);
  if (count > 0) std::memcpy(tensor.values.data(), data.data() + offsets[0], count * sizeof(float));
  for (float value : tensor.values) {
    if (!std::isfinite(value)) fail(path, field + ": holds a value that is not finite");
  }
  return tensor;
}

}  // namespace

TensorFile read_tensor_file(const std::string& path) {
  const ports::MappedFile map = value_or_throw(ports::MappedFile::open(path), path);
  const std::span<const std::byte> bytes = map.bytes();
  uint64_t header_bytes = 0;
  if (bytes.size() < sizeof(header_bytes)) fail(path, "too short for a tensor file");
  std::memcpy(&header_bytes, bytes.data(), sizeof(header_bytes));
  if (header_bytes > kMaxHeaderBytes || header_bytes > bytes.size() - sizeof(header_bytes))
    fail(path, "header length is outside the file");
  const char* text = reinterpret_cast<const char*>(bytes.data()) + sizeof(header_bytes);
  TensorFile file;
  try {
    const nlohmann::json header = nlohmann::json::parse(text, text + header_bytes);
    for (const auto& [name, entry] : header.items()) {
      if (name == "__metadata__") {
        file.metadata = entry.get<std::map<std::string, std::string>>();
      } else {
        file.tensors[name] =
            read_tensor(path, name, entry, bytes.subspan(sizeof(header_bytes) + header_bytes));
      }
    }
  } catch (const nlohmann::json::exception&) {
    fail(path, "header is not a tensor file's JSON");
  }
  return file;
}

void write_tensor_file(const std::string& path, const TensorFile& file) {
  nlohmann::json header = nlohmann::json::object();
  if (!file.metadata.empty()) header["__metadata__"] = file.metadata;
  uint64_t offset = 0;
  for (const auto& [name, tensor] : file.tensors) {
    const uint64_t end = offset + tensor.values.size() * sizeof(float);
    header[name] = {{"dtype", "F32"}, {"shape", tensor.shape}, {"data_offsets", {offset, end}}};
    offset = end;
  }
  std::string text = header.dump();
  text.resize((text.size() + 7) / 8 * 8, ' ');  // the format's own padding: data start aligned
  const uint64_t header_bytes = text.size();
  std::vector<std::byte> bytes(sizeof(header_bytes) + text.size() + offset);
  std::memcpy(bytes.data(), &header_bytes, sizeof(header_bytes));
  std::memcpy(bytes.data() + sizeof(header_bytes), text.data(), text.size());
  std::byte* out = bytes.data() + sizeof(header_bytes) + text.size();
  for (const auto& [name, tensor] : file.tensors) {
    const size_t size = tensor.values.size() * sizeof(float);
    if (size > 0) std::memcpy(out, tensor.values.data(), size);
    out += size;
  }
  throw_if_error(ports::write_file_atomically(path, bytes), "cannot save");
}

}  // namespace figurine::train
