// Files that tests make: texts and .npz archives.
#pragma once

#include <zip.h>

#include <fstream>
#include <map>
#include <string>

#include "gtest/gtest.h"
#include "ports/motion/npy_bytes.h"
#include "toolchain/error.h"
#include "toolchain/temporary_folder.h"

namespace figurine::body::test {

using ports::tests::npy_bytes;
using testing_tools::TemporaryFolder;

inline void write_text(const std::string& path, const std::string& text) {
  std::ofstream(path, std::ios::binary) << text;
}

// name (without .npy) -> bytes of the .npy.
inline void write_npz(const std::string& path, const std::map<std::string, std::string>& arrays) {
  int error = 0;
  zip_t* zip = zip_open(path.c_str(), ZIP_CREATE | ZIP_TRUNCATE, &error);
  ASSERT_NE(zip, nullptr) << error;
  for (const auto& [name, bytes] : arrays) {
    zip_source_t* source = zip_source_buffer(zip, bytes.data(), bytes.size(), 0);
    const zip_int64_t index = zip_file_add(zip, (name + ".npy").c_str(), source, ZIP_FL_ENC_UTF_8);
    ASSERT_GE(index, 0);
    zip_set_file_compression(zip, static_cast<zip_uint64_t>(index),
                             name.size() % 2 ? ZIP_CM_STORE : ZIP_CM_DEFLATE, 1);
  }
  ASSERT_EQ(zip_close(zip), 0);
}

// The message of the InputError that f throws; a failure if it throws none.
template <class F>
std::string input_error(F f) {
  try {
    f();
  } catch (const InputError& error) {
    return error.what();
  }
  ADD_FAILURE() << "no InputError";
  return "";
}

}  // namespace figurine::body::test
