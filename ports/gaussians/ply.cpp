#include "ports/gaussians/ply.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>

#include "ports/gaussians/cloud_builder.h"
#include "ports/gaussians/compressed_ply.h"
#include "ports/gaussians/ply_comments.h"
#include "ports/gaussians/ply_format.h"

namespace figurine::ports {

namespace {

constexpr size_t kNone = std::numeric_limits<size_t>::max();
constexpr size_t kNamedProperties = 6;  // of those that are skipped

// Where each value of a Gaussian stands in a row of the vertices; kNone: nowhere.
struct Columns {
  std::array<size_t, 3> position{};
  std::array<size_t, 3> colour{};      // f_dc, or red green blue
  std::array<double, 3> colour_one{};  // of red green blue: what is 1; 0 for f_dc
  std::array<size_t, 3> scale{};
  uint32_t scales = 3;
  std::array<size_t, 4> rotation{};
  size_t opacity = kNone, filter = kNone;
  std::vector<size_t> rest;  // [3 * stored_per_channel] channel-major
  std::vector<bool> used;    // of the row: whether anything above is there
  ShLayout sh;
  std::vector<std::string> remarks;
};

// Finds the columns of a Gaussian's values, and remembers what nobody asked for.
class ColumnFinder {
 public:
  explicit ColumnFinder(const PlyElement& vertex)
      : vertex_(vertex), used_(vertex.properties.size(), false) {}

  bool has(const std::string& name) const { return vertex_.find(name).has_value(); }

  // Of a property that must be there, once, and be a number.
  size_t require(const std::string& name) {
    const size_t column = vertex_.find(name).value_or(kNone);
    if (column == kNone) {
      complain("the vertices have no property " + name);
      return 0;
    }
    used_[column] = true;
    if (vertex_.properties[column].list_count) complain("the property " + name + " is a list");
    const auto twice = [&](const PlyProperty& p) { return p.name == name; };
    if (std::count_if(vertex_.properties.begin(), vertex_.properties.end(), twice) > 1)
      complain("the vertices have the property " + name + " twice");
    return column;
  }

  template <size_t N>
  void require_numbered(const std::string& prefix, std::array<size_t, N>& columns, size_t count) {
    for (size_t k = 0; k < count; ++k) columns[k] = require(prefix + std::to_string(k));
  }

  void complain(const std::string& what) {
    if (error.empty()) error = what;
  }

  // What is skipped, in one remark; normals are zeros that every file has.
  std::string skipped() const {
    std::string text;
    size_t count = 0;
    for (size_t i = 0; i < used_.size(); ++i) {
      const PlyProperty& property = vertex_.properties[i];
      if (used_[i] || property.name == "nx" || property.name == "ny" || property.name == "nz")
        continue;
      if (++count > kNamedProperties) continue;
      text += (count == 1 ? "" : ", ") + quoted(property.name) +
              (property.list_count ? " (a list)" : "");
    }
    if (count > kNamedProperties)
      text += " and " + std::to_string(count - kNamedProperties) + " more";
    return text.empty() ? "" : "skipped " + text;
  }

  const std::vector<bool>& used() const { return used_; }

  std::string error;

 private:
  const PlyElement& vertex_;
  std::vector<bool> used_;
};

void find_colour(const PlyElement& vertex, ColumnFinder& finder, Columns& columns) {
  constexpr const char* kNames[] = {"red", "green", "blue"};
  if (finder.has("f_dc_0") || !finder.has("red")) {
    finder.require_numbered("f_dc_", columns.colour, 3);
    return;
  }
  for (size_t k = 0; k < 3; ++k) {
    columns.colour[k] = finder.require(kNames[k]);
    switch (vertex.properties[columns.colour[k]].type) {
      case PlyType::kU8:
        columns.colour_one[k] = 255;
        break;
      case PlyType::kU16:
        columns.colour_one[k] = 65535;
        break;
      case PlyType::kF32:
      case PlyType::kF64:
        columns.colour_one[k] = 1;
        break;
      default:
        finder.complain(std::string(kNames[k]) + " is neither uchar, ushort nor a float");
    }
  }
  columns.remarks.emplace_back("colours of red green blue");
}

void find_shape(ColumnFinder& finder, Columns& columns) {
  columns.scales = finder.has("scale_2") ? 3 : finder.has("scale_1") ? 2 : 1;
  finder.require_numbered("scale_", columns.scale, columns.scales);
  if (columns.scales == 2) columns.remarks.emplace_back("2D Gaussians, drawn as discs");
  if (columns.scales == 1) columns.remarks.emplace_back("one scale, the same along all axes");
  if (columns.scales == 1 && !finder.has("rot_0")) {  // nothing to rotate
    columns.rotation.fill(kNone);
  } else {
    finder.require_numbered("rot_", columns.rotation, 4);
  }
  if (finder.has("filter_3D")) {
    columns.filter = finder.require("filter_3D");
    columns.remarks.emplace_back("filter_3D fused");
  }
}

Result<Columns> find_columns(const PlyElement& vertex, const std::string& name) {
  ColumnFinder finder(vertex);
  Columns columns;
  for (size_t k = 0; k < 3; ++k)
    columns.position[k] = finder.require(std::string(1, static_cast<char>('x' + k)));
  find_colour(vertex, finder, columns);
  columns.opacity = finder.require("opacity");
  find_shape(finder, columns);
  const auto rest = static_cast<size_t>(
      std::count_if(vertex.properties.begin(), vertex.properties.end(),
                    [](const PlyProperty& p) { return p.name.starts_with("f_rest_"); }));
  if (!find_sh_layout(rest, columns.sh))
    finder.complain(std::to_string(rest) + " f_rest properties, no multiple of three channels");
  for (size_t k = 0; k < rest; ++k)
    columns.rest.push_back(finder.require("f_rest_" + std::to_string(k)));
  if (!finder.error.empty()) return Status(StatusCode::kCorrupt, name + ": ply: " + finder.error);
  if (!columns.sh.remark.empty()) columns.remarks.push_back(columns.sh.remark);
  if (std::string skipped = finder.skipped(); !skipped.empty())
    columns.remarks.push_back(std::move(skipped));
  columns.used = finder.used();
  return columns;
}

// One row of stored values in the splatter's units.
StoredGaussian gaussian_of(const std::vector<double>& row, const Columns& columns, bool flat) {
  StoredGaussian gaussian;
  for (size_t k = 0; k < 3; ++k) {
    gaussian.position_m[k] = row[columns.position[k]];
    const double colour = row[columns.colour[k]];
    gaussian.sh[k] = columns.colour_one[k] == 0
                         ? colour
                         : (colour / columns.colour_one[k] - double(kShOffset)) / double(kSh0);
  }
  const size_t bands = sh_coefficients(columns.sh.degree) - 1;
  for (size_t channel = 0; channel < 3; ++channel) {
    for (size_t k = 0; k < bands; ++k) {
      gaussian.sh[3 * (1 + k) + channel] =
          row[columns.rest[channel * columns.sh.stored_per_channel + k]];
    }
  }
  gaussian.opacity = 1 / (1 + std::exp(-row[columns.opacity]));  // exact 0 and 1 for infinite ones
  const uint32_t axes = flat ? 2 : columns.scales == 1 ? 3 : columns.scales;
  for (size_t k = 0; k < axes; ++k) {
    double& scale = gaussian.scale_m[k];
    scale = std::exp(row[columns.scale[columns.scales == 1 ? 0 : k]]);
    if (columns.filter == kNone) continue;
    // A Gaussian of this width convolved with the filter's, and as much light as before.
    const double filtered = std::hypot(scale, row[columns.filter]);
    if (filtered > 0) gaussian.opacity *= scale / filtered;
    scale = filtered;
  }
  gaussian.rotation = {1, 0, 0, 0};
  for (size_t k = 0; k < 4 && columns.rotation[k] != kNone; ++k)
    gaussian.rotation[k] = row[columns.rotation[k]];
  return gaussian;
}

enum class RowState : uint8_t { kWhole, kBroken, kDataEnd };

// Reads the values of one row; kBroken says why in broken. What nobody uses need not be a number.
RowState read_row(PlyCursor& cursor, const PlyElement& vertex, const std::vector<bool>& used,
                  std::vector<double>& row, std::string& broken) {
  broken.clear();
  cursor.begin_row();
  for (size_t p = 0; p < row.size(); ++p) {
    const PlyProperty& property = vertex.properties[p];
    const PlyCursor::Read read = property.list_count
                                     ? cursor.skip_list(*property.list_count, property.type)
                                     : cursor.read(property.type, row[p]);
    if (read == PlyCursor::Read::kDataEnd) return RowState::kDataEnd;
    if (read == PlyCursor::Read::kNoNumber && used[p] && broken.empty())
      broken = property.name + " is no number";
    if (read == PlyCursor::Read::kRowEnd) {
      broken = "its line has only " + std::to_string(p) + " values";
      break;
    }
  }
  if (!cursor.end_row() && broken.empty()) broken = "its line has too many values";
  return broken.empty() ? RowState::kWhole : RowState::kBroken;
}

// How many rows of the vertices can lie in what is left of the file. An ascii value takes at least
// a digit and a blank.
uint64_t possible_rows(const PlyHeader& header, const PlyElement& vertex, uint64_t left) {
  if (header.encoding != PlyEncoding::kAscii) return left / vertex.row_bytes();
  return (left + 1) / (2 * vertex.properties.size());
}

Status skip_elements(PlyCursor& cursor, std::span<const PlyElement> elements,
                     const std::string& name) {
  for (const PlyElement& element : elements) {
    if (!cursor.skip(element)) {
      return Status(StatusCode::kCorrupt,
                    name + ": ply: the data of element " + quoted(element.name) + " ends early");
    }
  }
  return {};
}

}  // namespace

Result<GaussianCloud> read_gaussian_ply(std::span<const std::byte> bytes, const std::string& name) {
  const auto corrupt = [&](const std::string& what) {
    return Status(StatusCode::kCorrupt, name + ": ply: " + what);
  };
  const Result<PlyHeader> header = parse_ply_header(bytes, name);
  if (!header.ok()) return header.status();
  const PlyElement* vertex = header->find("vertex");
  if (vertex == nullptr) return corrupt("there is no element vertex");
  if (vertex->find("packed_position")) return read_compressed_ply(bytes, *header, name);
  const Result<Columns> columns = find_columns(*vertex, name);
  if (!columns.ok()) return columns.status();

  PlyCursor cursor(bytes.subspan(header->size_bytes), header->encoding);
  const std::span<const PlyElement> elements = header->elements;
  const auto place = static_cast<size_t>(vertex - elements.data());
  FIG_RETURN_IF_ERROR(skip_elements(cursor, elements.first(place), name));
  // Before anything is reserved: the rows must be able to lie in what is left of the file.
  const uint64_t possible = possible_rows(*header, *vertex, cursor.left());
  if (vertex->count > possible || vertex->count > std::numeric_limits<uint32_t>::max()) {
    return corrupt("declares " + std::to_string(vertex->count) +
                   " vertices, the data holds at most " + std::to_string(possible));
  }

  const PlyDrawing drawing = read_drawing_comments(header->comments);
  CloudBuilder builder("ply", columns->sh.degree, vertex->count);
  std::vector<double> row(vertex->properties.size());
  std::string broken;
  for (uint64_t i = 0; i < vertex->count; ++i) {
    switch (read_row(cursor, *vertex, columns->used, row, broken)) {
      case RowState::kDataEnd:
        return corrupt("declares " + std::to_string(vertex->count) +
                       " vertices, the data ends in number " + std::to_string(i));
      case RowState::kBroken:
        builder.leave_out(i, broken);
        break;
      case RowState::kWhole:
        builder.add(i, gaussian_of(row, *columns, drawing.flat));
    }
  }
  FIG_RETURN_IF_ERROR(skip_elements(cursor, elements.subspan(place + 1), name));
  if (!cursor.only_blanks_left()) {
    // In ascii without lines a row of another length has shifted all that follow.
    if (header->encoding == PlyEncoding::kAscii) return corrupt("has more values than it declares");
    builder.remark(std::to_string(cursor.left()) + " bytes behind the last element not read");
  }

  for (const std::string& remark : columns->remarks) builder.remark(remark);
  if (drawing.flat && columns->scales == 3) builder.remark("2D Gaussians, drawn as discs");
  // A file with an unfused 3D filter comes straight from its trainer, which has the 2D one too.
  if (drawing.antialiased.value_or(columns->filter != kNone)) builder.set_antialiased();
  if (drawing.up) builder.set_up(*drawing.up);
  return std::move(builder).finish();
}

}  // namespace figurine::ports
