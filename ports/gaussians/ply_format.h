// The PLY container, whatever it holds: its header, and a cursor over the values of its body, in
// ascii or binary of either byte order. Knows nothing of Gaussians. Based on: Turk, The PLY Polygon
// File Format, 1994.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "figurine/status.h"

namespace figurine::ports {

enum class PlyEncoding : uint8_t { kAscii, kLittleEndian, kBigEndian };
enum class PlyType : uint8_t { kI8, kU8, kI16, kU16, kI32, kU32, kF32, kF64 };
size_t size_of(PlyType type);

struct PlyProperty {
  std::string name;
  PlyType type = PlyType::kF32;
  std::optional<PlyType> list_count;  // of a list: the type of its length
};

struct PlyElement {
  std::string name;
  uint64_t count = 0;
  std::vector<PlyProperty> properties;

  bool has_list() const;
  // Of a row in a binary file; of a list its length alone, the least that there can be.
  size_t row_bytes() const;
  // Where the property is; none if there is none.
  std::optional<size_t> find(std::string_view name) const;
};

struct PlyHeader {
  PlyEncoding encoding = PlyEncoding::kLittleEndian;
  std::vector<PlyElement> elements;
  std::vector<std::string> comments;  // and obj_info lines, without that word and outer blanks
  size_t size_bytes = 0;              // the body begins here

  const PlyElement* find(std::string_view name) const;  // nullptr if there is none
};

// Lines end as in Unix, in DOS or on an old Macintosh; comments hold any bytes. At most 1 MiB and
// 4096 properties. kCorrupt names what is wrong, and the line where there is one.
Result<PlyHeader> parse_ply_header(std::span<const std::byte> bytes, const std::string& name);

// A word of the file as it may appear in a message: in quotes, printable and short.
std::string quoted(std::string_view word);

// One value of a binary file at data, which has size_of(type) bytes.
double load_ply_value(const std::byte* data, PlyType type, bool swap);

// Walks the values of a body in their order.
class PlyCursor {
 public:
  PlyCursor(std::span<const std::byte> body, PlyEncoding encoding)
      : body_(body), encoding_(encoding) {}

  enum class Read : uint8_t {
    kValue,
    kNoNumber,  // a word that is none; the cursor is behind it
    kRowEnd,    // the line ends although the row does not
    kDataEnd,
  };

  // Between rows of one element. In ascii a row is a line if the first one is: a row that is too
  // short or too long then ends with its line, instead of shifting all that follow. end_row() is
  // false if the line had more values.
  void begin_row();
  Read read(PlyType type, double& value);
  Read skip_list(PlyType count, PlyType item);
  bool end_row();

  // Past all rows of an element that nobody asked for; false if they end early.
  bool skip(const PlyElement& element);

  uint64_t left() const { return body_.size() - at_; }  // bytes
  bool only_blanks_left();

 private:
  Read read_word(double& value);
  bool skip_blanks(bool lines);  // true if a line ended; lines: goes on to the next ones
  void skip_line();

  std::span<const std::byte> body_;
  PlyEncoding encoding_;
  size_t at_ = 0;
  bool first_row_ = true, row_broken_ = false, rows_are_lines_ = false;
};

}  // namespace figurine::ports
