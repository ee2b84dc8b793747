// Whole files of a capture; every error is an InputError that names the file.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "ports/host/files.h"
#include "toolchain/error.h"

namespace figurine::dataset {

inline ports::MappedFile map_file(const std::string& path) {
  Result<ports::MappedFile> file = ports::MappedFile::open(path);
  if (!file.ok()) throw InputError(file.status().message());
  return std::move(file).value();
}

inline std::string read_text_file(const std::string& path) {
  const ports::MappedFile file = map_file(path);
  return {reinterpret_cast<const char*>(file.bytes().data()), file.bytes().size()};
}

inline nlohmann::json read_json_file(const std::string& path) {
  const ports::MappedFile file = map_file(path);
  const auto* text = reinterpret_cast<const char*>(file.bytes().data());
  nlohmann::json value = nlohmann::json::parse(text, text + file.bytes().size(), nullptr, false);
  if (value.is_discarded()) throw InputError(path + ": not valid JSON");
  return value;
}

}  // namespace figurine::dataset
