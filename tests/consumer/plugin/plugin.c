/* The minimal program as a library that another program loads when it runs, on several threads. */
#define main minimal_main
#include "minimal.c"
#undef main

/* The golden frame, size x size; how many threads drew it, or 0. */
unsigned draw_on_threads(unsigned threads, const char* avatar_path, const char* body_path,
                         unsigned size, unsigned char* rgba) {
  fig_package avatar, body;
  fig_renderer renderer;
  fig_renderer_options options = fig_default_renderer_options();
  options.threads = threads;
  fig_renderer_info info = fig_default_renderer_info();
  if (open_package(avatar_path, &avatar) != FIG_OK || open_package(body_path, &body) != FIG_OK ||
      fig_renderer_create(&options, &renderer) != FIG_OK ||
      draw(renderer, avatar, body, size, size, rgba) != FIG_OK ||
      fig_renderer_get_info(renderer, &info) != FIG_OK) {
    fail(fig_last_message());
    return 0;
  }
  fig_renderer_destroy(renderer);
  fig_package_close(avatar);
  fig_package_close(body);
  return info.threads;
}
