// The smallest program on the runtime: an avatar and its body from memory, one frame into memory,
// raw RGBA out.
//
//   minimal AVATAR.fgn BODY.fgn WIDTH HEIGHT > frame.rgba        (ffmpeg -f rawvideo -pix_fmt rgba
//   -s 512x512 -i frame.rgba frame.png)
//
// It needs the runtime library and nothing else of the project. minimal.c is the same in C.
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <vector>

#include "figurine/renderer.h"

namespace {

// Package bytes must start at a multiple of 64. On a device they may as well lie in flash or in a
// memory map.
struct Free {
  void operator()(std::byte* memory) const { std::free(memory); }
};
struct Bytes {
  std::unique_ptr<std::byte, Free> memory;
  size_t size = 0;
};

Bytes read_file(const char* path) {
  Bytes bytes;
  std::FILE* file = std::fopen(path, "rb");
  if (file == nullptr) return bytes;
  std::fseek(file, 0, SEEK_END);
  const long size = std::ftell(file);
  std::rewind(file);
  if (size > 0) {
    const size_t room = (static_cast<size_t>(size) + figurine::kBlobAlignment - 1) /
                        figurine::kBlobAlignment * figurine::kBlobAlignment;
    bytes.memory.reset(static_cast<std::byte*>(std::aligned_alloc(figurine::kBlobAlignment, room)));
    if (bytes.memory)
      bytes.size = std::fread(bytes.memory.get(), 1, static_cast<size_t>(size), file);
  }
  std::fclose(file);
  return bytes;
}

int fail(const figurine::Status& status) {
  std::fprintf(stderr, "minimal: %s\n", status.message().c_str());
  return 1;
}

}  // namespace

int main(int argc, char** argv) {
  using namespace figurine;
  if (argc != 5) {
    std::fprintf(stderr, "usage: minimal AVATAR.fgn BODY.fgn WIDTH HEIGHT > frame.rgba\n");
    return 2;
  }
  const Bytes avatar_bytes = read_file(argv[1]), body_bytes = read_file(argv[2]);
  Result<Package> avatar = Package::open({avatar_bytes.memory.get(), avatar_bytes.size}, argv[1]);
  if (!avatar.ok()) return fail(avatar.status());
  Result<Package> body = Package::open({body_bytes.memory.get(), body_bytes.size}, argv[2]);
  if (!body.ok()) return fail(body.status());
  if (avatar->kind() != PackageKind::kAvatar)
    return fail({StatusCode::kInvalidArgument, std::string(argv[1]) + ": is no avatar"});
  if (body->kind() != PackageKind::kBody)
    return fail({StatusCode::kInvalidArgument, std::string(argv[2]) + ": is no body"});

  Result<std::unique_ptr<Renderer>> renderer = Renderer::create({.threads = 1});
  if (!renderer.ok()) return fail(renderer.status());
  const Result<AvatarId> person = (*renderer)->add_avatar(*avatar, *body);
  if (!person.ok()) return fail(person.status());

  // Every avatar carries a pose and a camera that show it. Your own pose: joint_count() quaternions
  // (w, x, y, z) and a translation of the root.
  const GoldenFrame& golden = avatar->avatar().golden;
  const FrameAvatar posed{.avatar = *person, .pose = {golden.root_translation_m, golden.rotations}};
  const auto width = static_cast<uint32_t>(std::strtoul(argv[3], nullptr, 10)),
             height = static_cast<uint32_t>(std::strtoul(argv[4], nullptr, 10));
  Camera camera = golden.camera;
  const float zoom = static_cast<float>(height) / static_cast<float>(camera.height_px);
  camera.fx_px *= zoom, camera.fy_px *= zoom;
  camera.cx_px = 0.5f * static_cast<float>(width), camera.cy_px *= zoom;
  camera.width_px = width, camera.height_px = height;
  const Status sound = validate_camera(camera);
  if (!sound.ok()) return fail(sound);

  std::vector<uint8_t> rgba(size_t(width) * height * 4);
  const Status drawn =
      (*renderer)->render({.camera = camera, .avatars = {&posed, 1}},
                          {.pixels = rgba.data(), .stride_bytes = size_t(width) * 4});
  if (!drawn.ok()) return fail(drawn);
  return std::fwrite(rgba.data(), 1, rgba.size(), stdout) == rgba.size() && std::fflush(stdout) == 0
             ? 0
             : 1;
}
