/* The smallest program on the runtime, in C: an avatar and its body from memory, one frame into
 * memory, raw RGBA out. minimal.cpp is the same in C++.
 *
 *   minimal_c AVATAR.fgn BODY.fgn WIDTH HEIGHT > frame.rgba */
#include <stdio.h>
#include <stdlib.h>

#include "figurine.h"

static int fail(const char* message) {
  fprintf(stderr, "minimal_c: %s\n", message);
  return 1;
}

/* The whole of a file, or NULL. On a device the bytes may as well lie in flash or in a map. */
static void* read_file(const char* path, size_t* size_bytes) {
  FILE* file = fopen(path, "rb");
  if (file == NULL) return NULL;
  fseek(file, 0, SEEK_END);
  const long end = ftell(file);
  rewind(file);
  void* bytes = end > 0 ? malloc((size_t)end) : NULL;
  *size_bytes = bytes == NULL ? 0 : fread(bytes, 1, (size_t)end, file);
  fclose(file);
  return bytes;
}

static fig_status open_package(const char* path, fig_package* package) {
  fig_package_options options = fig_default_package_options();
  options.name = path;
  options.copy = 1; /* borrowed bytes would have to start at a multiple of 64, and to stay */
  size_t size_bytes = 0;
  void* bytes = read_file(path, &size_bytes);
  const fig_status status = fig_package_open(bytes, size_bytes, &options, package);
  free(bytes);
  return status;
}

/* Every avatar carries a pose and a camera that show it. Your own pose: joint_count quaternions
 * (w, x, y, z) and a translation of the root; your own camera: fig_make_orbit_camera. */
static fig_status draw(fig_renderer renderer, fig_package avatar, fig_package body, uint32_t width,
                       uint32_t height, unsigned char* rgba) {
  fig_avatar person;
  fig_camera camera = fig_default_camera();
  fig_pose pose = fig_default_pose();
  fig_status status = fig_renderer_add_avatar(renderer, avatar, 0, body, NULL, &person);
  if (status == FIG_OK) status = fig_package_golden_view(avatar, 0, &camera, &pose);
  if (status != FIG_OK) return status;

  const float zoom = (float)height / (float)camera.height_px;
  camera.fx_px *= zoom, camera.fy_px *= zoom;
  camera.cx_px = 0.5f * (float)width, camera.cy_px *= zoom;
  camera.width_px = width, camera.height_px = height;
  fig_frame_avatar seen = fig_default_frame_avatar();
  seen.avatar = person, seen.pose = &pose;
  fig_frame frame = fig_default_frame();
  frame.camera = &camera, frame.avatars = &seen, frame.avatar_count = 1;
  fig_image image = fig_default_image();
  image.pixels = rgba, image.stride_bytes = (size_t)width * 4;
  return fig_renderer_render(renderer, &frame, &image);
}

int main(int argc, char** argv) {
  if (argc != 5) {
    fprintf(stderr, "usage: minimal_c AVATAR.fgn BODY.fgn WIDTH HEIGHT > frame.rgba\n");
    return 2;
  }
  fig_package avatar, body;
  if (open_package(argv[1], &avatar) != FIG_OK || open_package(argv[2], &body) != FIG_OK)
    return fail(fig_last_message());
  const unsigned long width = strtoul(argv[3], NULL, 10), height = strtoul(argv[4], NULL, 10);
  if (width < 1 || width > 16384 || height < 1 || height > 16384)
    return fail("the size must be within 1x1 and 16384x16384");
  unsigned char* rgba = calloc(width * height, 4);
  if (rgba == NULL) return fail("no memory for the image");
  fig_renderer renderer; /* one for many frames: NULL stands for its options' defaults */
  if (fig_renderer_create(NULL, &renderer) != FIG_OK ||
      draw(renderer, avatar, body, (uint32_t)width, (uint32_t)height, rgba) != FIG_OK)
    return fail(fig_last_message());
  const size_t written = fwrite(rgba, 4, width * height, stdout);
  free(rgba);
  fig_renderer_destroy(renderer); /* in front of the packages, which its avatars use */
  fig_package_close(avatar);
  fig_package_close(body);
  return written == width * height && fflush(stdout) == 0 ? 0 : 1;
}
