// What stands in the place of window.cpp in builds without SDL2.
#include "figurine/check.h"
#include "ports/sdl/window.h"

namespace figurine::ports {

struct Window::Impl {};
Window::Window(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Window::~Window() = default;

Status Window::available() {
  return Status(StatusCode::kUnsupported,
                "window: this build has none: it was made without SDL2 (FIGURINE_WINDOW)");
}
Result<std::unique_ptr<Window>> Window::open(const Options&) { return available(); }

// There is no window, so nobody comes here.
bool Window::poll(const std::function<void(const SDL_Event&)>&, std::vector<std::string>*) {
  return false;
}
void Window::drop(const std::string&) {}
Status Window::set_picture(std::span<const uint8_t>, uint32_t, uint32_t) { return available(); }
Status Window::show_picture() { return available(); }
void Window::begin_frame(uint8_t, uint8_t, uint8_t) {}
void Window::end_frame() {}
Result<ImageU8> Window::read_frame() { return available(); }
SDL_Window* Window::window() const { return nullptr; }
SDL_Renderer* Window::renderer() const { return nullptr; }
SDL_Texture* Window::picture() const { return nullptr; }
std::string Window::description() const { return ""; }

}  // namespace figurine::ports
