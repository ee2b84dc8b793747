#include "toolchain/body/npz.h"

#include <zip.h>

#include <bit>
#include <cstring>

#include "toolchain/error.h"

static_assert(std::endian::native == std::endian::little, "arrays are read as little-endian");

namespace figurine::body {
namespace {

constexpr uint64_t kMaxArrayBytes = uint64_t{1} << 30;  // SMPL-X's largest array is 122 MB
constexpr size_t kMaxHeaderBytes = 65536;
constexpr size_t kMaxDimensions = 8;

std::string shape_text(const std::vector<size_t>& shape) {
  std::string text = "(";
  for (size_t i = 0; i < shape.size(); ++i)
    text += (i ? "," : "") + (shape[i] ? std::to_string(shape[i]) : std::string("any"));
  return text + ")";
}

// The header is a Python dict literal of three known keys. Only what NumPy itself writes is
// understood.
struct Header {
  std::string type;
  bool fortran_order = false;
  std::vector<size_t> shape;
};

std::string value_of(const std::string& header, const std::string& key, const std::string& where) {
  const size_t at = header.find("'" + key + "':");
  if (at == std::string::npos) throw InputError(where + ": header: no " + key);
  const size_t start = header.find_first_not_of(' ', at + key.size() + 3);
  if (start == std::string::npos) throw InputError(where + ": header: " + key + " is empty");
  const char open = header[start];
  const size_t end = open == '('    ? header.find(')', start)
                     : open == '\'' ? header.find('\'', start + 1)
                                    : header.find_first_of(",}", start) - 1;
  if (end >= header.size()) throw InputError(where + ": header: " + key + " does not end");
  return header.substr(start, end - start + 1);
}

Header parse_header(const std::string& text, const std::string& where) {
  Header header;
  const std::string type = value_of(text, "descr", where);
  if (type.size() < 4 || type.front() != '\'' || type[1] == '>')
    throw InputError(where + ": type " + type + ": not a plain little-endian array");
  header.type = type.substr(1, type.size() - 2);
  if (header.type.find('O') != std::string::npos)
    throw InputError(where + ": holds pickled Python objects, which are never read");
  const std::string order = value_of(text, "fortran_order", where);
  header.fortran_order = order.starts_with("True");
  if (!header.fortran_order && !order.starts_with("False"))
    throw InputError(where + ": header: fortran_order is " + order);
  const std::string shape = value_of(text, "shape", where);
  if (shape.front() != '(') throw InputError(where + ": header: shape is no tuple");
  size_t value = 0;
  bool digits = false;
  for (char c : shape.substr(1)) {
    if (c >= '0' && c <= '9') {
      if (value > kMaxArrayBytes) throw InputError(where + ": header: shape overflows");
      value = value * 10 + static_cast<size_t>(c - '0');
      digits = true;
    } else if (c == ',' || c == ')') {
      if (digits) header.shape.push_back(value);
      value = 0;
      digits = false;
    } else if (c != ' ') {
      throw InputError(where + ": header: shape has a '" + std::string(1, c) + "'");
    }
  }
  if (header.shape.size() > kMaxDimensions)
    throw InputError(where + ": header: more than 8 dimensions");
  return header;
}

template <class T>
void convert(const std::byte* bytes, std::vector<double>& values) {
  for (size_t i = 0; i < values.size(); ++i) {
    T value;
    std::memcpy(&value, bytes + i * sizeof(T), sizeof(T));
    values[i] = static_cast<double>(value);
  }
}

struct Type {
  const char* name;
  size_t size;
  void (*convert)(const std::byte*, std::vector<double>&);
};
constexpr Type kTypes[] = {
    {"<f4", 4, convert<float>},    {"<f8", 8, convert<double>},   {"|u1", 1, convert<uint8_t>},
    {"|i1", 1, convert<int8_t>},   {"|b1", 1, convert<uint8_t>},  {"<u2", 2, convert<uint16_t>},
    {"<i2", 2, convert<int16_t>},  {"<u4", 4, convert<uint32_t>}, {"<i4", 4, convert<int32_t>},
    {"<u8", 8, convert<uint64_t>}, {"<i8", 8, convert<int64_t>}};

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

}  // namespace

NpyArray parse_npy(const std::vector<std::byte>& bytes, const std::string& where) {
  if (bytes.size() < 10 || std::memcmp(bytes.data(), "\x93NUMPY", 6) != 0)
    throw InputError(where + ": not a .npy array");
  const int version = static_cast<int>(bytes[6]);
  if (version < 1 || version > 3)
    throw InputError(where + ": .npy version " + std::to_string(version));
  const size_t length_bytes = version == 1 ? 2 : 4;
  if (bytes.size() < 8 + length_bytes) throw InputError(where + ": header: ends early");
  size_t header_bytes = 0;
  for (size_t i = 0; i < length_bytes; ++i)
    header_bytes |= static_cast<size_t>(bytes[8 + i]) << (8 * i);
  const size_t data = 8 + length_bytes + header_bytes;
  if (header_bytes > kMaxHeaderBytes || data > bytes.size())
    throw InputError(where + ": header: length out of range");
  const std::string text(reinterpret_cast<const char*>(bytes.data()) + 8 + length_bytes,
                         header_bytes);
  const Header header = parse_header(text, where);

  const Type* type = nullptr;
  for (const Type& known : kTypes) {
    if (header.type == known.name) type = &known;
  }
  if (type == nullptr) throw InputError(where + ": type " + header.type + ": not supported");
  uint64_t count = 1;
  for (size_t extent : header.shape) {
    if (extent != 0 && count > kMaxArrayBytes / extent)
      throw InputError(where + ": shape: overflows");
    count *= extent;
  }
  if (bytes.size() - data != count * type->size) {
    throw InputError(where + ": shape " + shape_text(header.shape) + " needs " +
                     std::to_string(count * type->size) + " bytes, has " +
                     std::to_string(bytes.size() - data));
  }
  NpyArray array{header.shape, std::vector<double>(count)};
  type->convert(bytes.data() + data, array.values);
  if (header.fortran_order && header.shape.size() > 1)
    array.values = transposed(array.values, header.shape);
  return array;
}

struct NpzFile::Archive {
  std::string path;
  zip_t* zip = nullptr;
  ~Archive() {
    if (zip != nullptr) zip_discard(zip);
  }
};

NpzFile::NpzFile(std::unique_ptr<Archive> archive) : archive_(std::move(archive)) {}
NpzFile::NpzFile(NpzFile&&) noexcept = default;
NpzFile& NpzFile::operator=(NpzFile&&) noexcept = default;
NpzFile::~NpzFile() = default;

NpzFile NpzFile::open(const std::string& path) {
  auto archive = std::make_unique<Archive>();
  archive->path = path;
  int code = 0;
  archive->zip = zip_open(path.c_str(), ZIP_RDONLY, &code);
  if (archive->zip == nullptr) {
    zip_error_t error;
    zip_error_init_with_code(&error, code);
    const std::string reason = zip_error_strerror(&error);
    zip_error_fini(&error);
    throw InputError(path + ": not a readable .npz: " + reason);
  }
  return NpzFile(std::move(archive));
}

bool NpzFile::has(const std::string& name) const {
  return zip_name_locate(archive_->zip, (name + ".npy").c_str(), 0) >= 0;
}

NpyArray NpzFile::read(const std::string& name) const {
  const std::string where = archive_->path + ": " + name;
  const zip_int64_t index = zip_name_locate(archive_->zip, (name + ".npy").c_str(), 0);
  if (index < 0) throw InputError(where + ": no such array");
  zip_stat_t stat;
  if (zip_stat_index(archive_->zip, static_cast<zip_uint64_t>(index), 0, &stat) != 0 ||
      (stat.valid & ZIP_STAT_SIZE) == 0) {
    throw InputError(where + ": its size is not known");
  }
  if (stat.size > kMaxArrayBytes) throw InputError(where + ": larger than 1 GiB");
  zip_file_t* file = zip_fopen_index(archive_->zip, static_cast<zip_uint64_t>(index), 0);
  if (file == nullptr) throw InputError(where + ": " + zip_strerror(archive_->zip));
  std::vector<std::byte> bytes(stat.size);
  const zip_int64_t got = zip_fread(file, bytes.data(), bytes.size());
  std::byte beyond;
  const bool complete = got == static_cast<zip_int64_t>(bytes.size()) &&
                        zip_fread(file, &beyond, 1) == 0;  // reading on checks the CRC
  if (zip_fclose(file) != 0 || !complete)
    throw InputError(where + ": damaged: wrong length or checksum");
  return parse_npy(bytes, where);
}

NpyArray NpzFile::read(const std::string& name, const std::vector<size_t>& shape) const {
  NpyArray array = read(name);
  bool equal = array.shape.size() == shape.size();
  for (size_t i = 0; equal && i < shape.size(); ++i)
    equal = shape[i] == 0 || shape[i] == array.shape[i];
  if (!equal) {
    throw InputError(archive_->path + ": " + name + ": shape " + shape_text(array.shape) +
                     ", expected " + shape_text(shape));
  }
  return array;
}

}  // namespace figurine::body
