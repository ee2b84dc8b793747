#include "ports/sdl/window.h"

#include <SDL.h>

#include <algorithm>

#include "figurine/check.h"

namespace figurine::ports {

namespace {

Status failed(StatusCode code, const std::string& what) {
  std::string reason = SDL_GetError();
  std::replace(reason.begin(), reason.end(), '\n', ' ');
  return Status(code, "window: " + what + ": " + reason);
}

// As large as asked for, or as fits on the desktop, in the same shape.
void fit_to_desktop(uint32_t& width, uint32_t& height) {
  SDL_Rect usable{};
  if (SDL_GetDisplayUsableBounds(0, &usable) != 0 || usable.w <= 0 || usable.h <= 0) return;
  const double scale = std::min(
      {1.0, static_cast<double>(usable.w) / width, static_cast<double>(usable.h) / height});
  width = std::max(1u, static_cast<uint32_t>(width * scale));
  height = std::max(1u, static_cast<uint32_t>(height * scale));
}

}  // namespace

struct Window::Impl {
  SDL_Window* window = nullptr;
  SDL_Renderer* renderer = nullptr;
  SDL_Texture* picture = nullptr;
  int picture_width = 0, picture_height = 0;
  bool closed = false;

  ~Impl() {
    if (picture != nullptr) SDL_DestroyTexture(picture);
    if (renderer != nullptr) SDL_DestroyRenderer(renderer);
    if (window != nullptr) SDL_DestroyWindow(window);
    SDL_QuitSubSystem(SDL_INIT_VIDEO);
    SDL_Quit();
  }
};

Window::Window(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Window::~Window() = default;

Status Window::available() { return {}; }

Result<std::unique_ptr<Window>> Window::open(const Options& options) {
  FIG_CHECK(options.width_px >= 1 && options.width_px <= 16384 && options.height_px >= 1 &&
                options.height_px <= 16384,
            "a window of 1 to 16384 pixels a side");
  SDL_SetHint(SDL_HINT_NO_SIGNAL_HANDLERS, "1");
  SDL_SetHint(SDL_HINT_RENDER_SCALE_QUALITY, "linear");
  SDL_SetHint(SDL_HINT_VIDEO_ALLOW_SCREENSAVER, "1");
  SDL_SetHint(SDL_HINT_VIDEO_X11_NET_WM_BYPASS_COMPOSITOR, "0");
  if (SDL_InitSubSystem(SDL_INIT_VIDEO) != 0) {
    const Status status = failed(StatusCode::kUnsupported, "there is no display to open it on");
    SDL_Quit();
    return status;
  }
  auto impl = std::make_unique<Impl>();
  uint32_t width = options.width_px, height = options.height_px;
  fit_to_desktop(width, height);
  impl->window =
      SDL_CreateWindow(options.title.c_str(), SDL_WINDOWPOS_UNDEFINED, SDL_WINDOWPOS_UNDEFINED,
                       static_cast<int>(width), static_cast<int>(height), SDL_WINDOW_RESIZABLE);
  if (impl->window == nullptr) return failed(StatusCode::kUnsupported, "cannot be opened");
  impl->renderer = SDL_CreateRenderer(impl->window, -1, 0);
  if (impl->renderer == nullptr) return failed(StatusCode::kUnsupported, "cannot be drawn into");
  SDL_EventState(SDL_DROPFILE, SDL_ENABLE);
  return std::unique_ptr<Window>(new Window(std::move(impl)));
}

bool Window::poll(const std::function<void(const SDL_Event&)>& each,
                  std::vector<std::string>* files) {
  for (SDL_Event event; SDL_PollEvent(&event) != 0;) {
    if (each) each(event);
    const bool close = event.type == SDL_WINDOWEVENT && event.window.event == SDL_WINDOWEVENT_CLOSE;
    if (event.type == SDL_QUIT || close) impl_->closed = true;
    if (event.type == SDL_DROPFILE && event.drop.file != nullptr) {
      if (files != nullptr) files->emplace_back(event.drop.file);
      SDL_free(event.drop.file);
    }
  }
  return !impl_->closed;
}

void Window::drop(const std::string& file) {
  SDL_Event event{};
  event.type = SDL_DROPFILE;
  event.drop.file = SDL_strdup(file.c_str());
  event.drop.windowID = SDL_GetWindowID(impl_->window);
  if (event.drop.file != nullptr && SDL_PushEvent(&event) != 1) SDL_free(event.drop.file);
}

Status Window::set_picture(std::span<const uint8_t> pixels, uint32_t width_px, uint32_t height_px) {
  FIG_CHECK(pixels.size() == size_t{4} * width_px * height_px, "a whole RGBA picture");
  const int width = static_cast<int>(width_px), height = static_cast<int>(height_px);
  if (impl_->picture == nullptr || width != impl_->picture_width ||
      height != impl_->picture_height) {
    if (impl_->picture != nullptr) SDL_DestroyTexture(impl_->picture);
    impl_->picture = SDL_CreateTexture(impl_->renderer, SDL_PIXELFORMAT_RGBA32,
                                       SDL_TEXTUREACCESS_STREAMING, width, height);
    if (impl_->picture == nullptr) return failed(StatusCode::kIo, "takes no picture");
    SDL_SetTextureBlendMode(impl_->picture, SDL_BLENDMODE_NONE);
    impl_->picture_width = width, impl_->picture_height = height;
  }
  if (SDL_UpdateTexture(impl_->picture, nullptr, pixels.data(), 4 * width) != 0)
    return failed(StatusCode::kIo, "takes no picture");
  return {};
}

Status Window::show_picture() {
  begin_frame(0, 0, 0);
  int width = 0, height = 0;
  SDL_GetRendererOutputSize(impl_->renderer, &width, &height);
  if (impl_->picture != nullptr && width > 0 && height > 0) {
    const float scale = std::min(static_cast<float>(width) / impl_->picture_width,
                                 static_cast<float>(height) / impl_->picture_height);
    const float shown_width = scale * impl_->picture_width,
                shown_height = scale * impl_->picture_height;
    const SDL_FRect place{(width - shown_width) / 2, (height - shown_height) / 2, shown_width,
                          shown_height};
    if (SDL_RenderCopyF(impl_->renderer, impl_->picture, nullptr, &place) != 0)
      return failed(StatusCode::kIo, "shows no picture");
  }
  end_frame();
  return {};
}

void Window::begin_frame(uint8_t red, uint8_t green, uint8_t blue) {
  SDL_SetRenderDrawColor(impl_->renderer, red, green, blue, 255);
  SDL_RenderClear(impl_->renderer);
}

void Window::end_frame() { SDL_RenderPresent(impl_->renderer); }

Result<ImageU8> Window::read_frame() {
  int width = 0, height = 0;
  if (SDL_GetRendererOutputSize(impl_->renderer, &width, &height) != 0 || width < 1 || height < 1)
    return failed(StatusCode::kIo, "cannot be read");
  ImageU8 image(static_cast<uint32_t>(width), static_cast<uint32_t>(height), 3);
  if (SDL_RenderReadPixels(impl_->renderer, nullptr, SDL_PIXELFORMAT_RGB24, image.pixels.data(),
                           3 * width) != 0)
    return failed(StatusCode::kIo, "cannot be read");
  return image;
}

SDL_Window* Window::window() const { return impl_->window; }
SDL_Renderer* Window::renderer() const { return impl_->renderer; }
SDL_Texture* Window::picture() const { return impl_->picture; }

std::string Window::description() const {
  SDL_RendererInfo info{};
  SDL_GetRendererInfo(impl_->renderer, &info);
  const char* const driver = SDL_GetCurrentVideoDriver();
  return std::string(driver != nullptr ? driver : "?") + ", " +
         (info.name != nullptr ? info.name : "?");
}

}  // namespace figurine::ports
