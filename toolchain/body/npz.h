// Reads arrays from NumPy's .npz (a zip of .npy) without Python and without ever unpickling: object
// arrays are refused.
//
// Based on: NumPy Enhancement Proposal 1, "A simple file format for NumPy arrays" (versions 1.0
// to 3.0).
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

namespace figurine::body {

struct NpyArray {
  std::vector<size_t> shape;
  std::vector<double> values;  // row-major, whatever the file's order and type; exact for every
                               // type but 64-bit integers beyond 2^53
};

// Parses one .npy. where appears in messages. InputError on anything unsound: magic, header, type,
// shape times size, surplus bytes.
NpyArray parse_npy(const std::vector<std::byte>& bytes, const std::string& where);

class NpzFile {
 public:
  static NpzFile open(const std::string& path);
  NpzFile(NpzFile&&) noexcept;
  NpzFile& operator=(NpzFile&&) noexcept;
  ~NpzFile();

  bool has(const std::string& name) const;  // without ".npy"
  // shape: expected extents; 0 accepts any. InputError naming file, array and reason.
  NpyArray read(const std::string& name, const std::vector<size_t>& shape) const;
  NpyArray read(const std::string& name) const;

 private:
  struct Archive;
  explicit NpzFile(std::unique_ptr<Archive> archive);
  std::unique_ptr<Archive> archive_;
};

}  // namespace figurine::body
