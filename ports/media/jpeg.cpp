#include "ports/media/jpeg.h"

#include <csetjmp>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <utility>

// jpeglib.h needs stdio.h before it.
#include <jpeglib.h>

namespace figurine::ports {
namespace {

constexpr uint32_t kMaxSide = 16384;

// libjpeg reports errors by a callback that must not return; longjmp is its documented way out. No
// C++ object may live across the jump, so the functions that call setjmp touch plain data alone.
struct JpegError {
  jpeg_error_mgr manager;
  jmp_buf jump;
  char message[JMSG_LENGTH_MAX];
};

void leave_on_error(j_common_ptr info) {
  auto* error = reinterpret_cast<JpegError*>(info->err);
  error->manager.format_message(info, error->message);
  longjmp(error->jump, 1);
}

// Keeps the first warning's text; the count is in num_warnings.
void keep_warning(j_common_ptr info, int level) {
  if (level >= 0) return;
  auto* error = reinterpret_cast<JpegError*>(info->err);
  if (error->manager.num_warnings++ == 0) error->manager.format_message(info, error->message);
}

// EXIF's orientation, 1 to 8, of the first APP1 segment that says one; 1 if none does. An EXIF
// segment is "Exif\0\0" and a TIFF header, whose first directory has the tag.
int orientation_of(jpeg_saved_marker_ptr marker) {
  for (; marker != nullptr; marker = marker->next) {
    const JOCTET* d = marker->data;
    const size_t size = marker->data_length;
    if (marker->marker != JPEG_APP0 + 1 || size < 14 || std::memcmp(d, "Exif\0\0", 6) != 0)
      continue;
    const bool big = d[6] == 'M';
    const auto number = [&](size_t at, int bytes) -> size_t {  // the caller knows it is inside
      size_t value = 0;
      for (int i = 0; i < bytes; ++i)
        value |= static_cast<size_t>(d[at + static_cast<size_t>(big ? bytes - 1 - i : i)])
                 << (8 * i);
      return value;
    };
    const size_t directory = 6 + number(10, 4);
    if (directory + 2 > size) continue;
    const size_t entries = number(directory, 2);
    for (size_t e = 0; e < entries; ++e) {
      const size_t entry = directory + 2 + 12 * e;
      if (entry + 12 > size) break;
      if (number(entry, 2) != 0x0112) continue;
      const size_t value = number(entry + 8, 2);
      return value >= 1 && value <= 8 ? static_cast<int>(value) : 1;
    }
  }
  return 1;
}

// Upright, of an image that is stored as EXIF's orientation says.
ImageU8 turned(ImageU8 image, int orientation) {
  if (orientation == 1) return image;
  const bool swapped = orientation >= 5;
  ImageU8 out(swapped ? image.height_px : image.width_px,
              swapped ? image.width_px : image.height_px, image.channels);
  // Whether the stored columns (rows) run against the upright image's.
  const bool flip_x = orientation == 2 || orientation == 3 || orientation == 7 || orientation == 8;
  const bool flip_y = orientation == 3 || orientation == 4 || orientation == 6 || orientation == 7;
  for (uint32_t y = 0; y < out.height_px; ++y) {
    for (uint32_t x = 0; x < out.width_px; ++x) {
      const uint32_t along_x = swapped ? y : x, along_y = swapped ? x : y;
      const uint32_t from_x = flip_x ? image.width_px - 1 - along_x : along_x,
                     from_y = flip_y ? image.height_px - 1 - along_y : along_y;
      std::memcpy(out.at(x, y), image.at(from_x, from_y), image.channels);
    }
  }
  return out;
}

// Reads the header, then calls prepare(header) for a buffer of width * height * 3 bytes; a null
// buffer stops there.
bool run_decoder(std::span<const std::byte> bytes, JpegSize* header, int* orientation,
                 bool* readable, uint8_t* (*prepare)(void*, const JpegSize&), void* context,
                 JpegError* error) {
  jpeg_decompress_struct info;
  std::memset(&info, 0, sizeof info);
  info.err = jpeg_std_error(&error->manager);
  error->manager.error_exit = leave_on_error;
  error->manager.emit_message = keep_warning;
  error->message[0] = '\0';
  if (setjmp(error->jump) != 0) {
    jpeg_destroy_decompress(&info);
    return false;
  }
  jpeg_create_decompress(&info);
  jpeg_mem_src(&info, reinterpret_cast<const unsigned char*>(bytes.data()),
               static_cast<unsigned long>(bytes.size()));
  jpeg_save_markers(&info, JPEG_APP0 + 1, 0xffff);
  jpeg_read_header(&info, TRUE);
  header->width_px = info.image_width;
  header->height_px = info.image_height;
  *orientation = orientation_of(info.marker_list);
  if (info.jpeg_color_space == JCS_CMYK || info.jpeg_color_space == JCS_YCCK) {
    std::strcpy(error->message, "has CMYK colours, which are not read; save it as RGB");
    *readable = false;
    jpeg_destroy_decompress(&info);
    return true;
  }
  uint8_t* buffer = prepare(context, *header);
  if (buffer != nullptr) {
    info.out_color_space = JCS_RGB;
    info.dct_method = JDCT_ISLOW;
    jpeg_start_decompress(&info);
    while (info.output_scanline < info.output_height) {
      JSAMPROW row = buffer + size_t{info.output_scanline} * info.output_width * 3;
      jpeg_read_scanlines(&info, &row, 1);
    }
    jpeg_finish_decompress(&info);
  }
  const bool sound = error->manager.num_warnings == 0;
  jpeg_destroy_decompress(&info);
  return sound;
}

Result<ImageU8> decode(std::span<const std::byte> bytes, bool header_only,
                       const std::string& name) {
  if (bytes.empty()) return Status(StatusCode::kCorrupt, name + ": empty file, not a JPEG");
  struct Target {
    ImageU8 image;
    bool header_only;
    bool too_large = false;
  } target{{}, header_only};
  target.image.channels = 3;
  JpegSize header;
  JpegError error;
  const auto prepare = [](void* context, const JpegSize& h) -> uint8_t* {
    auto* t = static_cast<Target*>(context);
    t->image.width_px = h.width_px;
    t->image.height_px = h.height_px;
    t->too_large = h.width_px > kMaxSide || h.height_px > kMaxSide;
    if (t->header_only || t->too_large) return nullptr;
    t->image.pixels.resize(size_t{h.width_px} * h.height_px * 3);
    return t->image.pixels.data();
  };
  int orientation = 1;
  bool readable = true;
  if (!run_decoder(bytes, &header, &orientation, &readable, prepare, &target, &error))
    return Status(StatusCode::kCorrupt, name + ": damaged JPEG: " + error.message);
  if (target.too_large) {
    return Status(StatusCode::kLimitExceeded,
                  name + ": image larger than " + std::to_string(kMaxSide) + " pixels a side");
  }
  if (!readable) return Status(StatusCode::kUnsupported, name + ": " + error.message);
  if (header_only) {
    if (orientation >= 5) std::swap(target.image.width_px, target.image.height_px);
    return std::move(target.image);
  }
  return turned(std::move(target.image), orientation);
}

// The bytes in *buffer, from malloc.
bool run_encoder(const ImageU8& image, int quality, unsigned char** buffer, unsigned long* size,
                 JpegError* error) {
  jpeg_compress_struct info;
  std::memset(&info, 0, sizeof info);
  info.err = jpeg_std_error(&error->manager);
  error->manager.error_exit = leave_on_error;
  error->message[0] = '\0';
  if (setjmp(error->jump) != 0) {
    jpeg_destroy_compress(&info);
    return false;
  }
  jpeg_create_compress(&info);
  jpeg_mem_dest(&info, buffer, size);
  info.image_width = image.width_px;
  info.image_height = image.height_px;
  info.input_components = 3;
  info.in_color_space = JCS_RGB;
  jpeg_set_defaults(&info);
  jpeg_set_quality(&info, quality, TRUE);
  info.dct_method = JDCT_ISLOW;
  info.optimize_coding = TRUE;
  for (int c = 0; c < info.num_components; ++c)
    info.comp_info[c].h_samp_factor = info.comp_info[c].v_samp_factor = 1;
  jpeg_start_compress(&info, TRUE);
  while (info.next_scanline < info.image_height) {
    JSAMPROW row = const_cast<uint8_t*>(image.at(0, info.next_scanline));
    jpeg_write_scanlines(&info, &row, 1);
  }
  jpeg_finish_compress(&info);
  jpeg_destroy_compress(&info);
  return true;
}

}  // namespace

Result<ImageU8> decode_jpeg(std::span<const std::byte> bytes, const std::string& name) {
  return decode(bytes, false, name);
}

Result<JpegSize> decode_jpeg_size(std::span<const std::byte> bytes, const std::string& name) {
  const Result<ImageU8> header = decode(bytes, true, name);
  if (!header.ok()) return header.status();
  return JpegSize{header->width_px, header->height_px};
}

Result<std::vector<std::byte>> encode_jpeg(const ImageU8& image, int quality) {
  if (!image.sound() || image.channels != 3 || quality < 1 || quality > 100) {
    return Status(StatusCode::kInvalidArgument,
                  "jpeg: written from sound RGB images at qualities 1 to 100");
  }
  unsigned char* buffer = nullptr;
  unsigned long size = 0;
  JpegError error;
  if (!run_encoder(image, quality, &buffer, &size, &error)) {
    std::free(buffer);
    return Status(StatusCode::kOutOfMemory, std::string("jpeg: ") + error.message);
  }
  const auto* begin = reinterpret_cast<const std::byte*>(buffer);
  std::vector<std::byte> bytes(begin, begin + size);
  std::free(buffer);
  return bytes;
}

}  // namespace figurine::ports
