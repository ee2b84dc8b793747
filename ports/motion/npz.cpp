#include "ports/motion/npz.h"

#include <zip.h>

#include <algorithm>
#include <bit>
#include <cstring>
#include <optional>

#include "figurine/detail/half.h"
#include "ports/host/files.h"

static_assert(std::endian::native == std::endian::little, "arrays are read as little-endian");

namespace figurine::ports {
namespace {

constexpr uint64_t kMaxValues = uint64_t{1} << 26;  // SMPL-X's largest array has 12.6 million
constexpr size_t kMaxHeaderBytes = 65536;
constexpr size_t kMaxDimensions = 8;

Status corrupt(const std::string& message) { return Status(StatusCode::kCorrupt, message); }
Status unsupported(const std::string& message) { return Status(StatusCode::kUnsupported, message); }

std::string shape_text(const std::vector<size_t>& shape) {
  std::string text = "(";
  for (size_t i = 0; i < shape.size(); ++i)
    text += (i ? "," : "") + (shape[i] ? std::to_string(shape[i]) : std::string("any"));
  return text + ")";
}

template <class T>
double stored(const std::byte* bytes) {
  T value;
  std::memcpy(&value, bytes, sizeof value);
  return static_cast<double>(value);
}

double stored_half(const std::byte* bytes) {
  uint16_t bits;
  std::memcpy(&bits, bytes, sizeof bits);
  return double{to_float(Half{bits})};
}

struct Type {
  const char* name;  // without the byte order
  size_t size;
  double (*value)(const std::byte*);
};
constexpr Type kTypes[] = {
    {"f2", 2, stored_half},      {"f4", 4, stored<float>},    {"f8", 8, stored<double>},
    {"u1", 1, stored<uint8_t>},  {"i1", 1, stored<int8_t>},   {"b1", 1, stored<uint8_t>},
    {"u2", 2, stored<uint16_t>}, {"i2", 2, stored<int16_t>},  {"u4", 4, stored<uint32_t>},
    {"i4", 4, stored<int32_t>},  {"u8", 8, stored<uint64_t>}, {"i8", 8, stored<int64_t>}};

// The header is a Python dict literal of three known keys. Only what NumPy itself writes is
// understood.
struct Header {
  const Type* type = nullptr;
  bool swapped = false;  // big-endian
  bool fortran_order = false;
  std::vector<size_t> shape;
  uint64_t count = 1;  // of values
  size_t data = 0;     // where they begin
};

Result<std::string> value_of(const std::string& header, const std::string& key,
                             const std::string& where) {
  const size_t at = header.find("'" + key + "':");
  if (at == std::string::npos) return corrupt(where + ": header: no " + key);
  const size_t start = header.find_first_not_of(' ', at + key.size() + 3);
  if (start == std::string::npos) return corrupt(where + ": header: " + key + " is empty");
  const char open = header[start];
  const size_t end = open == '('    ? header.find(')', start)
                     : open == '\'' ? header.find('\'', start + 1)
                                    : header.find_first_of(",}", start) - 1;
  if (end >= header.size()) return corrupt(where + ": header: " + key + " does not end");
  if (end < start) return corrupt(where + ": header: " + key + " is empty");
  return header.substr(start, end - start + 1);
}

Status parse_shape(const std::string& text, const std::string& where, Header& header) {
  if (text.front() != '(') return corrupt(where + ": header: shape is no tuple");
  size_t value = 0;
  bool digits = false;
  for (char c : text.substr(1)) {
    if (c >= '0' && c <= '9') {
      if (value > (uint64_t{1} << 40)) return corrupt(where + ": header: shape overflows");
      value = value * 10 + static_cast<size_t>(c - '0');
      digits = true;
    } else if (c == ',' || c == ')') {
      if (digits) header.shape.push_back(value);
      value = 0;
      digits = false;
    } else if (c != ' ') {
      return corrupt(where + ": header: shape has a character that is none of a shape's");
    }
  }
  if (header.shape.size() > kMaxDimensions)
    return corrupt(where + ": header: more than 8 dimensions");
  return {};
}

Status parse_type(const std::string& text, const std::string& where, Header& header) {
  if (text.size() < 4 || text.front() != '\'')
    return unsupported(where + ": type: not a plain array of numbers");
  const std::string type = text.substr(1, text.size() - 2);
  if (type.find('O') != std::string::npos)
    return unsupported(where + ": holds pickled Python objects, which are never read");
  header.swapped = type[0] == '>';
  for (const Type& known : kTypes) {
    if (type.substr(1) == known.name) header.type = &known;
  }
  if (header.type == nullptr || (type[0] != '<' && type[0] != '>' && type[0] != '|')) {
    std::string shown = type.substr(0, 16);
    for (char& c : shown) c = c < ' ' || c > '~' ? '?' : c;
    return unsupported(where + ": type " + shown + ": not supported");
  }
  return {};
}

// What an array of these first bytes declares. size_bytes: of the whole .npy.
Result<Header> parse_header(std::span<const std::byte> bytes, uint64_t size_bytes,
                            const std::string& where) {
  if (bytes.size() < 10 || std::memcmp(bytes.data(), "\x93NUMPY", 6) != 0)
    return corrupt(where + ": not a .npy array");
  const int version = static_cast<int>(bytes[6]);
  if (version < 1 || version > 3)
    return unsupported(where + ": .npy version " + std::to_string(version));
  const size_t length_bytes = version == 1 ? 2 : 4;
  if (bytes.size() < 8 + length_bytes) return corrupt(where + ": header: ends early");
  size_t header_bytes = 0;
  for (size_t i = 0; i < length_bytes; ++i)
    header_bytes |= static_cast<size_t>(bytes[8 + i]) << (8 * i);
  Header header;
  header.data = 8 + length_bytes + header_bytes;
  if (header_bytes > kMaxHeaderBytes || header.data > bytes.size())
    return corrupt(where + ": header: length out of range");
  const std::string text(reinterpret_cast<const char*>(bytes.data()) + 8 + length_bytes,
                         header_bytes);
  const Result<std::string> type = value_of(text, "descr", where);
  if (!type.ok()) return type.status();
  FIG_RETURN_IF_ERROR(parse_type(*type, where, header));
  const Result<std::string> order = value_of(text, "fortran_order", where);
  if (!order.ok()) return order.status();
  header.fortran_order = order->starts_with("True");
  if (!header.fortran_order && !order->starts_with("False"))
    return corrupt(where + ": header: fortran_order is neither True nor False");
  const Result<std::string> shape = value_of(text, "shape", where);
  if (!shape.ok()) return shape.status();
  FIG_RETURN_IF_ERROR(parse_shape(*shape, where, header));
  for (size_t extent : header.shape) {
    if (extent != 0 && header.count > kMaxValues / extent) {
      return Status(StatusCode::kLimitExceeded, where + ": shape " + shape_text(header.shape) +
                                                    " declares more than 2^26 values");
    }
    header.count *= extent;
  }
  const uint64_t needed = header.data + header.count * header.type->size;
  if (needed != size_bytes) {
    return corrupt(where + ": shape " + shape_text(header.shape) + " needs " +
                   std::to_string(needed) + " bytes, the array has " + std::to_string(size_bytes));
  }
  return header;
}

// Column-major to row-major.
std::vector<double> transposed(const std::vector<double>& values,
                               const std::vector<size_t>& shape) {
  std::vector<double> out(values.size());
  std::vector<size_t> index(shape.size(), 0);
  for (double& slot : out) {
    size_t source = 0, stride = 1;
    for (size_t d = 0; d < shape.size(); ++d) {
      source += index[d] * stride;
      stride *= shape[d];
    }
    slot = values[source];
    for (size_t d = shape.size(); d-- > 0;) {
      if (++index[d] < shape[d]) break;
      index[d] = 0;
    }
  }
  return out;
}

NpyArray values_of(std::span<const std::byte> bytes, const Header& header) {
  NpyArray array{header.shape, std::vector<double>(header.count)};
  const std::byte* at = bytes.data() + header.data;
  for (double& value : array.values) {
    std::byte element[8];
    std::copy_n(at, header.type->size, element);
    if (header.swapped) std::reverse(element, element + header.type->size);
    value = header.type->value(element);
    at += header.type->size;
  }
  if (header.fortran_order && header.shape.size() > 1)
    array.values = transposed(array.values, header.shape);
  return array;
}

}  // namespace

Result<NpyArray> parse_npy(std::span<const std::byte> bytes, const std::string& where) {
  const Result<Header> header = parse_header(bytes, bytes.size(), where);
  if (!header.ok()) return header.status();
  return values_of(bytes, *header);
}

struct NpzFile::Archive {
  std::string where;
  std::optional<MappedFile> file;
  zip_t* zip = nullptr;
  ~Archive() {
    if (zip != nullptr) zip_discard(zip);
  }
};

NpzFile::NpzFile(std::unique_ptr<Archive> archive) : archive_(std::move(archive)) {}
NpzFile::NpzFile(NpzFile&&) noexcept = default;
NpzFile& NpzFile::operator=(NpzFile&&) noexcept = default;
NpzFile::~NpzFile() = default;

Result<NpzFile> NpzFile::open(std::span<const std::byte> bytes, const std::string& where) {
  if (bytes.empty()) return corrupt(where + ": not a readable .npz: empty");
  auto archive = std::make_unique<Archive>();
  archive->where = where;
  zip_error_t error;
  zip_error_init(&error);
  zip_source_t* source = zip_source_buffer_create(bytes.data(), bytes.size(), 0, &error);
  if (source != nullptr) archive->zip = zip_open_from_source(source, ZIP_RDONLY, &error);
  if (archive->zip == nullptr) {
    const Status status = corrupt(where + ": not a readable .npz: " + zip_error_strerror(&error));
    if (source != nullptr) zip_source_free(source);
    zip_error_fini(&error);
    return status;
  }
  return NpzFile(std::move(archive));
}

Result<NpzFile> NpzFile::open(const std::string& path) {
  Result<MappedFile> file = MappedFile::open(path);
  if (!file.ok()) return file.status();
  Result<NpzFile> npz = open(file->bytes(), path);
  if (npz.ok()) npz->archive_->file = std::move(file).value();
  return npz;
}

bool NpzFile::has(const std::string& name) const {
  return zip_name_locate(archive_->zip, (name + ".npy").c_str(), 0) >= 0;
}

struct NpzFile::Opened {
  std::string where;
  uint64_t size = 0;  // of the whole .npy
  std::unique_ptr<zip_file_t, int (*)(zip_file_t*)> file{nullptr, zip_fclose};
  std::vector<std::byte> bytes;  // read so far
  Header header;
};

Result<NpzFile::Opened> NpzFile::open_array(const std::string& name) const {
  Opened array;
  array.where = archive_->where + ": " + name;
  const zip_int64_t index = zip_name_locate(archive_->zip, (name + ".npy").c_str(), 0);
  if (index < 0) return Status(StatusCode::kNotFound, array.where + ": no such array");
  zip_stat_t stat;
  if (zip_stat_index(archive_->zip, static_cast<zip_uint64_t>(index), 0, &stat) != 0 ||
      (stat.valid & ZIP_STAT_SIZE) == 0) {
    return corrupt(array.where + ": its size is not known");
  }
  array.size = stat.size;
  array.file.reset(zip_fopen_index(archive_->zip, static_cast<zip_uint64_t>(index), 0));
  if (array.file == nullptr) return corrupt(array.where + ": " + zip_strerror(archive_->zip));
  array.bytes.resize(std::min<uint64_t>(stat.size, 12 + kMaxHeaderBytes));
  const zip_int64_t got = zip_fread(array.file.get(), array.bytes.data(), array.bytes.size());
  if (got != static_cast<zip_int64_t>(array.bytes.size()))
    return corrupt(array.where + ": damaged: wrong length or checksum");
  Result<Header> header = parse_header(array.bytes, stat.size, array.where);
  if (!header.ok()) return header.status();
  array.header = std::move(header).value();
  return array;
}

Result<std::vector<size_t>> NpzFile::declared_shape(const std::string& name) const {
  const Result<Opened> array = open_array(name);
  if (!array.ok()) return array.status();
  return array->header.shape;
}

Result<NpyArray> NpzFile::read(const std::string& name, const std::vector<size_t>* shape) const {
  Result<Opened> opened = open_array(name);
  if (!opened.ok()) return opened.status();
  Opened& array = *opened;
  if (shape != nullptr) {
    bool equal = array.header.shape.size() == shape->size();
    for (size_t i = 0; equal && i < shape->size(); ++i)
      equal = (*shape)[i] == 0 || (*shape)[i] == array.header.shape[i];
    if (!equal) {
      return corrupt(array.where + ": shape " + shape_text(array.header.shape) + ", expected " +
                     shape_text(*shape));
    }
  }
  const size_t first = array.bytes.size();
  array.bytes.resize(array.size);
  const zip_int64_t got =
      zip_fread(array.file.get(), array.bytes.data() + first, array.bytes.size() - first);
  std::byte beyond;
  if (got != static_cast<zip_int64_t>(array.bytes.size() - first) ||
      zip_fread(array.file.get(), &beyond, 1) != 0) {  // reading on checks the CRC
    return corrupt(array.where + ": damaged: wrong length or checksum");
  }
  return values_of(array.bytes, array.header);
}

Result<NpyArray> NpzFile::read(const std::string& name) const { return read(name, nullptr); }

Result<NpyArray> NpzFile::read(const std::string& name, const std::vector<size_t>& shape) const {
  return read(name, &shape);
}

}  // namespace figurine::ports
