// Named float arrays and string metadata in one file, in the safetensors layout: readable by its
// own library in any language, and by forty lines here.
//
//   8 bytes little-endian: length of the header;   header: JSON {"__metadata__": {key: string},
//       name: {"dtype": "F32", "shape": [...],
//   "data_offsets": [begin, end]}};   data.   Only F32 is read and written. Files appear whole or
//       not at all.
//
// Among the metadata of what is written here, "checksum": 64 hex digits, XXH3-128 of length and
// header (with zeros for these digits) and of the data. A file that has it is believed only if it
// holds; a byte that changed anywhere in it is found.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <vector>

namespace figurine::train {

struct NamedTensor {
  std::vector<int64_t> shape;
  std::vector<float> values;
};

struct TensorFile {
  std::map<std::string, std::string> metadata;
  std::map<std::string, NamedTensor> tensors;
  bool checked = false;  // read: had a checksum, which held
};

// Throws InputError naming the path: missing, cut off, not this layout, sizes that contradict each
// other, values that are not finite, a checksum that does not hold.
TensorFile read_tensor_file(const std::string& path);
// The same of its bytes; where stands for the path.
TensorFile parse_tensor_file(std::span<const std::byte> bytes, const std::string& where);

// As read_tensor_file, but a file without a checksum is refused: nothing else tells a sound
// checkpoint from a damaged one.
TensorFile read_checkpoint_file(const std::string& path);

// metadata: without "checksum". Throws InputError if the disk refuses.
void write_tensor_file(const std::string& path, const TensorFile& file);

}  // namespace figurine::train
