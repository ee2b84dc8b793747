// Reads the YAML that OpenCV's FileStorage writes: at the top level, matrices of numbers, lists of
// texts or numbers, and single ones. Nothing else of YAML.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

namespace figurine::dataset {

class OpencvYaml {
 public:
  // Throws InputError "FILE: line N: reason" on what it does not understand.
  static OpencvYaml read(const std::string& path);

  bool has(const std::string& key) const { return nodes_.contains(key); }
  // All finite numbers of a matrix (row by row), a list or a single one; count 0 means any. Throws
  // InputError "FILE: KEY: reason".
  std::vector<double> numbers(const std::string& key, size_t count = 0) const;
  // The entries of a list, quotes taken off.
  std::vector<std::string> texts(const std::string& key) const;

 private:
  struct Node {
    bool matrix = false;
    uint64_t rows = 0, columns = 0;
    std::vector<std::string> items;  // as written
  };
  class Parser;

  const Node& find(const std::string& key) const;

  std::string path_;
  std::map<std::string, Node> nodes_;
};

}  // namespace figurine::dataset
