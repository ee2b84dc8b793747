// A window on the desktop that shows pictures: what stands behind `figurine live -o window`, and
// what the emulator draws its widgets into. SDL2 is seen nowhere else.
//
// A picture is scaled to the window with its shape kept. SDL's own renderers do the drawing: the
// graphics card's where there is one, else in software. One thread, the one that opened it.
//
// A build without SDL2 (FIGURINE_WINDOW off) has the same functions, and open() says so.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "figurine/status.h"
#include "ports/media/image.h"

struct SDL_Window;
struct SDL_Renderer;
struct SDL_Texture;
union SDL_Event;

namespace figurine::ports {

class Window {
 public:
  struct Options {
    std::string title = "figurine";
    // Of the inside. What is larger than the desktop begins as large as fits, in the same shape.
    uint32_t width_px = 0;
    uint32_t height_px = 0;
  };
  // Whether this build has windows: kUnsupported if not. Opens nothing.
  static Status available();
  // kUnsupported, one line: without SDL2, without a display, as SDL says it. SDL's handlers of
  // signals stay out: Ctrl-C is the program's.
  static Result<std::unique_ptr<Window>> open(const Options& options);
  ~Window();
  Window(const Window&) = delete;
  Window& operator=(const Window&) = delete;

  // Takes in what has happened. False from the moment on that its user has closed it, or asked the
  // program to quit. each: sees every event first, for who draws widgets; files: paths that were
  // dropped on the window are added to it.
  bool poll(const std::function<void(const SDL_Event&)>& each = {},
            std::vector<std::string>* files = nullptr);

  // As if a mouse had dropped the file: poll() gives it.
  void drop(const std::string& file);

  // Replaces the picture: RGBA, straight, rows of 4 * width_px bytes; alpha is not looked at.
  // pixels must hold exactly height_px rows (FIG_CHECK). kIo as SDL says.
  Status set_picture(std::span<const uint8_t> pixels, uint32_t width_px, uint32_t height_px);
  // The picture alone, in the middle, black around it; then what was drawn is seen.
  Status show_picture();

  // For who draws more than that: a cleared frame; what was drawn since is seen.
  void begin_frame(uint8_t red, uint8_t green, uint8_t blue);
  void end_frame();
  // What was drawn since begin_frame(), RGB. Before end_frame(). kIo as SDL says.
  Result<ImageU8> read_frame();
  SDL_Window* window() const;
  SDL_Renderer* renderer() const;
  SDL_Texture* picture() const;  // null before set_picture(); replaced where the size changes
  // "x11, opengl": the system's part and the renderer's, for messages.
  std::string description() const;

 private:
  struct Impl;
  explicit Window(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace figurine::ports
