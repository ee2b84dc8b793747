// Files that tests of motions make and read: .npy and .npz without NumPy, cases from tests/data,
// and what a clip does to a body's joints.
#pragma once

#include <algorithm>
#include <cstdint>
#include <fstream>
#include <iterator>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "figurine/package.h"
#include "formats/writer/package_writer.h"
#include "ports/host/files.h"
#include "ports/motion/clip.h"
#include "ports/motion/npy_bytes.h"
#include "ports/motion/rotation.h"

namespace figurine::ports::tests {

inline uint32_t crc32_of(const std::string& bytes) {
  uint32_t crc = ~0u;
  for (const char c : bytes) {
    crc ^= static_cast<uint8_t>(c);
    for (int bit = 0; bit < 8; ++bit) crc = crc >> 1 ^ (crc & 1 ? 0xEDB88320u : 0);
  }
  return ~crc;
}

// A zip whose members are stored as they are; names without ".npy".
inline std::string stored_npz(const std::map<std::string, std::string>& arrays) {
  std::string body, directory;
  const auto word = [](std::string& out, uint32_t value, int bytes) {
    for (int i = 0; i < bytes; ++i) out += static_cast<char>(value >> (8 * i) & 255);
  };
  for (const auto& [name, bytes] : arrays) {
    const std::string file = name + ".npy";
    const auto header = [&](std::string& out) {
      for (const uint32_t value : {20u, 0u, 0u, 0u, 0x21u}) word(out, value, 2);
      for (const size_t value : {size_t{crc32_of(bytes)}, bytes.size(), bytes.size()})
        word(out, static_cast<uint32_t>(value), 4);
      word(out, static_cast<uint32_t>(file.size()), 2);
      word(out, 0, 2);
    };
    const size_t offset = body.size();
    body += "PK\x03\x04";
    header(body);
    body += file + bytes;
    directory += "PK\x01\x02";
    word(directory, 20, 2);
    header(directory);
    for (int i = 0; i < 3; ++i) word(directory, 0, 2);
    word(directory, 0, 4);
    word(directory, static_cast<uint32_t>(offset), 4);
    directory += file;
  }
  std::string out = body + directory + "PK\x05\x06";
  word(out, 0, 4);
  word(out, static_cast<uint32_t>(arrays.size()), 2);
  word(out, static_cast<uint32_t>(arrays.size()), 2);
  word(out, static_cast<uint32_t>(directory.size()), 4);
  word(out, static_cast<uint32_t>(body.size()), 4);
  word(out, 0, 2);
  return out;
}

inline std::span<const std::byte> bytes_of(const std::string& text) {
  return std::as_bytes(std::span(text));
}

inline std::string contents_of(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

// tests/data/cases/NAME.
inline std::string case_path(const std::string& name) {
  return std::string(FIGURINE_SOURCE_DIR "/tests/data/cases/") + name;
}

// The shipped body, whose arms hang at rest.
inline const figurine::Body& shipped_body() {
  static const std::string path = FIGURINE_SOURCE_DIR "/samples/packages/body-64.fgn";
  static const auto* file = new Result<MappedFile>(MappedFile::open(path));
  static const auto* package = new Result<Package>(Package::open((*file)->bytes(), path));
  return (*package)->body();
}

// Of the package that a clip becomes.
inline std::string content_hash(const MotionClip& clip) {
  const Result<std::vector<std::byte>> bytes = write_package(clip.view(), Provenance{});
  if (!bytes.ok()) return bytes.status().message();
  // Packages are read where a memory map has them: at 64 bytes.
  std::vector<std::byte> storage(bytes->size() + 64);
  std::byte* at = storage.data();
  while (reinterpret_cast<uintptr_t>(at) % 64 != 0) ++at;
  std::copy(bytes->begin(), bytes->end(), at);
  const Result<Package> package = Package::open({at, bytes->size()}, "clip");
  return package.ok() ? format_hash(package->content_hash()) : package.status().message();
}

// World places of the joints of a frame.
inline std::vector<Vec3> joints_of(const figurine::Body& body, const MotionClip& clip,
                                   uint32_t frame) {
  std::vector<Affine> transforms(kJointCount);
  skinning_transforms(body.mean_skeleton(), clip.pose(frame).view(), transforms);
  std::vector<Vec3> out;
  for (size_t j = 0; j < kJointCount; ++j) {
    const auto p = transform_point(transforms[j], &body.joint_position_m[3 * j]);
    out.emplace_back(p[0], p[1], p[2]);
  }
  return out;
}

inline Vec3 bone(const std::vector<Vec3>& joints, int from, int to) {
  return unit(joints[static_cast<size_t>(to)] - joints[static_cast<size_t>(from)]);
}

}  // namespace figurine::ports::tests
