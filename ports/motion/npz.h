// Reads arrays from NumPy's .npz (a zip of .npy) without Python and without ever unpickling: object
// arrays are refused. For untrusted input: an array is judged by the shape that it declares before
// it is unpacked.
//
// Based on: NumPy Enhancement Proposal 1, "A simple file format for NumPy arrays" (versions 1.0
// to 3.0).
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "figurine/status.h"

namespace figurine::ports {

struct NpyArray {
  std::vector<size_t> shape;
  std::vector<double> values;  // row-major, whatever the file's order and type; exact for every
                               // type but 64-bit integers beyond 2^53
};

// Parses one .npy. where appears in messages. kCorrupt for anything unsound: magic, header, shape
// times size, surplus bytes; kUnsupported for types that are no numbers; kLimitExceeded beyond 2^26
// values.
Result<NpyArray> parse_npy(std::span<const std::byte> bytes, const std::string& where);

class NpzFile {
 public:
  // Borrows the bytes. where: the file, for messages.
  static Result<NpzFile> open(std::span<const std::byte> bytes, const std::string& where);
  // Maps the file, and owns the map.
  static Result<NpzFile> open(const std::string& path);
  NpzFile(NpzFile&&) noexcept;
  NpzFile& operator=(NpzFile&&) noexcept;
  ~NpzFile();

  bool has(const std::string& name) const;  // without ".npy"
  // What the array declares, found without unpacking it. Errors as of read().
  Result<std::vector<size_t>> declared_shape(const std::string& name) const;
  // shape: expected extents; 0 accepts any. Errors name file, array and reason; kNotFound if there
  // is no such array.
  Result<NpyArray> read(const std::string& name, const std::vector<size_t>& shape) const;
  Result<NpyArray> read(const std::string& name) const;

 private:
  struct Archive;
  struct Opened;  // an array up to its header
  explicit NpzFile(std::unique_ptr<Archive> archive);
  Result<Opened> open_array(const std::string& name) const;
  Result<NpyArray> read(const std::string& name, const std::vector<size_t>* shape) const;
  std::unique_ptr<Archive> archive_;
};

}  // namespace figurine::ports
