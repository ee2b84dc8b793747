// Builds .ply files of Gaussians in every variety, for the reader's tests.
#pragma once

#include <algorithm>
#include <cstring>
#include <functional>
#include <sstream>
#include <string>
#include <vector>

namespace figurine::tests {

enum class PlyEncoding { kAscii, kLittle, kBig };

struct PlyColumn {
  std::string name;
  std::string type = "float";  // float, double, uchar or int
};

// Property names in the usual order for an SH degree; -1 leaves f_rest out altogether, as does 0.
inline std::vector<PlyColumn> standard_columns(int sh_degree, bool normals = true) {
  std::vector<PlyColumn> columns = {{"x"}, {"y"}, {"z"}};
  if (normals) columns.insert(columns.end(), {{"nx"}, {"ny"}, {"nz"}});
  for (int k = 0; k < 3; ++k) columns.push_back({"f_dc_" + std::to_string(k)});
  for (int k = 0; k < 3 * ((sh_degree + 1) * (sh_degree + 1) - 1); ++k)
    columns.push_back({"f_rest_" + std::to_string(k)});
  columns.push_back({"opacity"});
  for (int k = 0; k < 3; ++k) columns.push_back({"scale_" + std::to_string(k)});
  for (int k = 0; k < 4; ++k) columns.push_back({"rot_" + std::to_string(k)});
  return columns;
}

// value(row, name) is asked for every property.
inline std::string make_ply(const std::vector<PlyColumn>& columns, size_t rows,
                            PlyEncoding encoding,
                            const std::function<double(size_t, const std::string&)>& value,
                            const std::string& before_vertex = "",
                            const std::string& data_before = "") {
  const char* names[] = {"ascii", "binary_little_endian", "binary_big_endian"};
  std::ostringstream out;
  out << "ply\nformat " << names[static_cast<int>(encoding)] << " 1.0\ncomment made by a test\n"
      << before_vertex << "element vertex " << rows << "\n";
  for (const PlyColumn& column : columns)
    out << "property " << column.type << " " << column.name << "\n";
  out << "end_header\n" << data_before;
  out.precision(17);
  const auto put = [&](auto number) {
    char bytes[sizeof(number)];
    std::memcpy(bytes, &number, sizeof(number));
    if (encoding == PlyEncoding::kBig) std::reverse(bytes, bytes + sizeof(number));
    out.write(bytes, sizeof(number));
  };
  for (size_t row = 0; row < rows; ++row) {
    for (const PlyColumn& column : columns) {
      const double number = value(row, column.name);
      if (encoding == PlyEncoding::kAscii) {
        out << number << (&column == &columns.back() ? "\n" : " ");
      } else if (column.type == "double") {
        put(number);
      } else if (column.type == "uchar") {
        put(static_cast<uint8_t>(number));
      } else if (column.type == "int") {
        put(static_cast<int32_t>(number));
      } else {
        put(static_cast<float>(number));
      }
    }
  }
  return out.str();
}

// A repeatable value for any row and property, a whole multiple of 1/64 so that every encoding
// holds it exactly. Scales are negative, rotations not zero.
inline double sample_value(size_t row, const std::string& name) {
  size_t hash = row * 31 + 7;
  for (const char c : name) hash = (hash * 131 + static_cast<unsigned char>(c)) % 100003;
  const double value = static_cast<double>(hash % 128) / 64 - 1;
  if (name.starts_with("scale_")) return value - 4;
  if (name == "rot_0") return value + 2;
  return value;
}

inline std::string sample_ply(int sh_degree, size_t rows = 5,
                              PlyEncoding encoding = PlyEncoding::kLittle) {
  return make_ply(standard_columns(sh_degree), rows, encoding, sample_value);
}

}  // namespace figurine::tests
