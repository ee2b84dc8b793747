#include "toolchain/train/tensor_file.h"

#include <bit>
#include <cmath>
#include <cstring>
#include <nlohmann/json.hpp>

#include "figurine/package.h"
#include "ports/host/files.h"
#include "toolchain/error.h"

namespace figurine::train {

static_assert(std::endian::native == std::endian::little,
              "arrays are copied as they lie in memory");

namespace {

constexpr size_t kMaxHeaderBytes = 16 << 20;
constexpr char kChecksum[] = "checksum";
constexpr size_t kHashDigits = 32;

std::string hash_of(std::span<const std::byte> bytes) {
  return format_hash(hash_picture({reinterpret_cast<const uint8_t*>(bytes.data()), bytes.size()}));
}

[[noreturn]] void fail(const std::string& path, const std::string& reason) {
  throw InputError(path + ": " + reason);
}

// A list of numbers from 0 on; the library would convert others.
std::vector<uint64_t> read_counts(const nlohmann::json& list) {
  std::vector<uint64_t> counts;
  for (const nlohmann::json& entry : list.get<std::vector<nlohmann::json>>())
    counts.push_back(entry.get_ref<const nlohmann::json::number_unsigned_t&>());
  return counts;
}

NamedTensor read_tensor(const std::string& path, const std::string& name,
                        const nlohmann::json& entry, std::span<const std::byte> data) {
  std::string field = "tensor " + name;
  for (char& c : field) c = c >= ' ' && c <= '~' ? c : '?';  // one line, whatever it is called
  if (entry.at("dtype").get<std::string>() != "F32") fail(path, field + ": dtype is not F32");
  NamedTensor tensor;
  const std::vector<uint64_t> offsets = read_counts(entry.at("data_offsets"));
  if (offsets.size() != 2 || offsets[0] > offsets[1] || offsets[1] > data.size())
    fail(path, field + ": data_offsets are outside the file");
  uint64_t count = 1;
  for (const uint64_t side : read_counts(entry.at("shape"))) {
    if (side > data.size() || (side > 0 && count > data.size() / side))
      fail(path, field + ": shape is larger than the file");
    count *= side;
    tensor.shape.push_back(static_cast<int64_t>(side));
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

namespace {

// start: length and header. Whether it has a checksum; fails where that does not hold.
bool check(const std::string& path, std::span<const std::byte> start,
           std::span<const std::byte> data, const std::map<std::string, std::string>& metadata) {
  const auto found = metadata.find(kChecksum);
  if (found == metadata.end()) return false;
  std::string text(reinterpret_cast<const char*>(start.data()), start.size());
  const size_t at = text.find('"' + found->second + '"');
  if (found->second.size() != 2 * kHashDigits || at == std::string::npos)
    fail(path, "checksum: is none");
  text.replace(at + 1, 2 * kHashDigits, 2 * kHashDigits, '0');
  if (hash_of(std::as_bytes(std::span(text))) + hash_of(data) != found->second)
    fail(path, "checksum: does not hold, the file is damaged");
  return true;
}

}  // namespace

TensorFile read_tensor_file(const std::string& path) {
  const ports::MappedFile map = value_or_throw(ports::MappedFile::open(path), path);
  return parse_tensor_file(map.bytes(), path);
}

TensorFile parse_tensor_file(std::span<const std::byte> bytes, const std::string& path) {
  uint64_t header_bytes = 0;
  if (bytes.size() < sizeof(header_bytes)) fail(path, "too short for a tensor file");
  std::memcpy(&header_bytes, bytes.data(), sizeof(header_bytes));
  if (header_bytes > kMaxHeaderBytes || header_bytes > bytes.size() - sizeof(header_bytes))
    fail(path, "header length is outside the file");
  const char* text = reinterpret_cast<const char*>(bytes.data()) + sizeof(header_bytes);
  TensorFile file;
  const std::span<const std::byte> data = bytes.subspan(sizeof(header_bytes) + header_bytes);
  uint64_t taken = 0;  // tensors that lie on each other could be larger than any memory
  try {
    const nlohmann::json header = nlohmann::json::parse(text, text + header_bytes);
    for (const auto& [name, entry] : header.items()) {
      if (name == "__metadata__") {
        file.metadata = entry.get<std::map<std::string, std::string>>();
      } else {
        const NamedTensor& tensor = file.tensors[name] = read_tensor(path, name, entry, data);
        taken += tensor.values.size() * sizeof(float);
        if (taken > data.size()) fail(path, "tensors are larger together than the file");
      }
    }
  } catch (const nlohmann::json::exception&) {
    fail(path, "header is not a tensor file's JSON");
  }
  file.checked = check(path, bytes.first(sizeof(header_bytes) + header_bytes), data, file.metadata);
  file.metadata.erase(kChecksum);
  return file;
}

TensorFile read_checkpoint_file(const std::string& path) {
  TensorFile file = read_tensor_file(path);
  if (!file.checked) {
    fail(path,
         "checksum: missing; damaged, or written by a version before 0.2, which cannot be told "
         "apart");
  }
  return file;
}

void write_tensor_file(const std::string& path, const TensorFile& file) {
  nlohmann::json header = nlohmann::json::object();
  header["__metadata__"] = file.metadata;
  header["__metadata__"][kChecksum] = std::string(2 * kHashDigits, '0');
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
  const size_t start_bytes = sizeof(header_bytes) + text.size();
  const std::span<const std::byte> whole(bytes);
  const std::string checksum =
      hash_of(whole.first(start_bytes)) + hash_of(whole.subspan(start_bytes));
  // By its key: another value may be made of zeros, too.
  const size_t at = text.find('"' + std::string(kChecksum) + "\":\"") + sizeof(kChecksum) + 3;
  std::memcpy(bytes.data() + sizeof(header_bytes) + at, checksum.data(), checksum.size());
  throw_if_error(ports::write_file_atomically(path, bytes), "cannot save");
}

}  // namespace figurine::train
