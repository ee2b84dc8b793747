// The window of the emulator: a session's picture in the middle, panels about it, and the loop that
// keeps both going.
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "ports/sdl/window.h"
#include "samples/emulator/panels.h"
#include "samples/emulator/script.h"
#include "samples/emulator/session.h"

namespace figurine::emulator {

class App {
 public:
  struct Options {
    uint32_t width_px = 1280, height_px = 800;
    float letters_px = 15;  // height of text
  };
  // Errors: Window::open.
  static Result<std::unique_ptr<App>> open(const Options& options);
  ~App();
  App(const App&) = delete;
  App& operator=(const App&) = delete;

  // Until the window is closed, the script quits or a signal came (kInterrupted). A script that is
  // over leaves the window to hands.
  Status run(Session& session, std::optional<Script> script);

 private:
  explicit App(std::unique_ptr<ports::Window> window);
  void draw_widgets(Session& session);
  Status show(Session& session, const std::optional<std::string>& screenshot);
  void save_window(Session& session, const std::string& path);
  void take_keys(Session& session);

  std::unique_ptr<ports::Window> window_;
  Typing typing_;
  uint64_t shown_picture_ = 0;
  bool save_window_ = false;
};

}  // namespace figurine::emulator
