#include "samples/emulator/app.h"

#include <backends/imgui_impl_sdl2.h>
#include <backends/imgui_impl_sdlrenderer2.h>
#include <imgui.h>

#include <algorithm>
#include <filesystem>
#include <format>

#include "ports/host/clock.h"
#include "samples/common/file_sink.h"
#include "samples/common/progress.h"
#include "samples/emulator/theme.h"

namespace figurine::emulator {

namespace {

constexpr uint64_t kFrame_ns = 1'000'000'000 / 60;
constexpr uint64_t kIdleFrame_ns = 100'000'000;
constexpr double kIdle_s = 1;  // without an event, before frames come seldom

constexpr ImGuiWindowFlags kPanelFlags =
    ImGuiWindowFlags_NoTitleBar | ImGuiWindowFlags_NoResize | ImGuiWindowFlags_NoMove |
    ImGuiWindowFlags_NoCollapse | ImGuiWindowFlags_NoBringToFrontOnFocus |
    ImGuiWindowFlags_NoSavedSettings | ImGuiWindowFlags_NoNavFocus;

bool begin_panel(const char* name, float x, float y, float width, float height,
                 const ImVec4& ground) {
  ImGui::SetNextWindowPos({x, y});
  ImGui::SetNextWindowSize({std::max(width, 32.0f), std::max(height, 32.0f)});
  ImGui::PushStyleColor(ImGuiCol_WindowBg, ground);
  const bool open = ImGui::Begin(name, nullptr, kPanelFlags);
  ImGui::PopStyleColor();
  return open;
}

uint8_t byte_of(float value) { return static_cast<uint8_t>(value * 255 + 0.5f); }

// Whether nothing moves by itself.
bool rests(Session& session) {
  return session.up_to_date() && !(session.timeline().playing() && session.timeline().moves());
}

}  // namespace

Result<std::unique_ptr<App>> App::open(const Options& options) {
  Result<std::unique_ptr<ports::Window>> window = ports::Window::open(
      {.title = "figurine emulator", .width_px = options.width_px, .height_px = options.height_px});
  if (!window.ok()) return window.status();
  std::unique_ptr<App> app(new App(std::move(*window)));
  IMGUI_CHECKVERSION();
  ImGui::CreateContext();
  ImGui::GetIO().IniFilename = nullptr;  // nothing is left behind in the working folder
  set_theme(options.letters_px);
  ImGui_ImplSDL2_InitForSDLRenderer(app->window_->window(), app->window_->renderer());
  ImGui_ImplSDLRenderer2_Init(app->window_->renderer());
  return app;
}

App::App(std::unique_ptr<ports::Window> window) : window_(std::move(window)) {}

App::~App() {
  if (ImGui::GetCurrentContext() == nullptr) return;
  ImGui_ImplSDLRenderer2_Shutdown();
  ImGui_ImplSDL2_Shutdown();
  ImGui::DestroyContext();
}

Status App::run(Session& session, std::optional<Script> script) {
  uint64_t last_ns = ports::now_ns();
  double since_event_s = 0;
  bool quit = false;
  while (!quit) {
    FIG_RETURN_IF_ERROR(samples::check_interrupt());
    const uint64_t now_ns = ports::now_ns();
    const double elapsed_s = static_cast<double>(now_ns - std::exchange(last_ns, now_ns)) * 1e-9;
    since_event_s += elapsed_s;
    std::vector<std::string> files;
    const bool there = window_->poll(
        [&](const SDL_Event& event) {
          ImGui_ImplSDL2_ProcessEvent(&event);
          since_event_s = 0;
        },
        &files);
    if (!there) return {};
    for (const std::string& file : files) session.open(file);
    session.advance(elapsed_s);
    std::optional<std::string> screenshot;
    if (script) {
      Script::Wanted wanted = script->step(session, elapsed_s);
      for (const std::string& file : wanted.drops) window_->drop(file);
      screenshot = std::move(wanted.screenshot);
      quit = wanted.quit;
    }
    (void)session.draw();  // an error is a message in the window
    FIG_RETURN_IF_ERROR(show(session, screenshot));
    // Whoever works meanwhile, a measurement or a sampler, has the CPU.
    const bool seldom = since_event_s > kIdle_s && rests(session);
    ports::sleep_until(now_ns + (seldom ? kIdleFrame_ns : kFrame_ns));
  }
  return {};
}

Status App::show(Session& session, const std::optional<std::string>& screenshot) {
  if (shown_picture_ != session.pictures()) {
    shown_picture_ = session.pictures();
    const samples::RenderedFrame& picture = session.picture();
    FIG_RETURN_IF_ERROR(
        window_->set_picture(picture.u8.pixels, picture.size.width_px, picture.size.height_px));
  }
  ImGui_ImplSDLRenderer2_NewFrame();
  ImGui_ImplSDL2_NewFrame();
  ImGui::NewFrame();
  take_keys(session);
  draw_widgets(session);
  ImGui::Render();
  window_->begin_frame(byte_of(colour::kGround.x), byte_of(colour::kGround.y),
                       byte_of(colour::kGround.z));
  ImGui_ImplSDLRenderer2_RenderDrawData(ImGui::GetDrawData());
  if (screenshot) save_window(session, *screenshot);
  if (std::exchange(save_window_, false)) {
    std::error_code error;
    int number = 1;
    while (std::filesystem::exists(std::format("window_{:03}.png", number), error)) ++number;
    save_window(session, std::format("window_{:03}.png", number));
  }
  window_->end_frame();
  return {};
}

void App::save_window(Session& session, const std::string& path) {
  const Result<ports::ImageU8> seen = window_->read_frame();
  if (!seen.ok()) {
    (void)session.report(seen.status());
    return;
  }
  ports::ImageU8 rgba(seen->width_px, seen->height_px, 4);
  for (size_t i = 0; i < rgba.pixels.size() / 4; ++i) {
    std::copy_n(&seen->pixels[3 * i], 3, &rgba.pixels[4 * i]);
    rgba.pixels[4 * i + 3] = 255;
  }
  if (session.report(samples::write_picture(path, rgba, true)).ok())
    session.say(path + ": written");
}

void App::take_keys(Session& session) {
  const ImGuiIO& io = ImGui::GetIO();
  if (io.WantTextInput) return;
  Timeline& timeline = session.timeline();
  if (ImGui::IsKeyPressed(ImGuiKey_Space, false)) timeline.set_playing(!timeline.playing());
  const double step_s = 1 / timeline.frames_per_second();
  for (const auto& [key, step] :
       {std::pair(ImGuiKey_LeftArrow, -step_s), std::pair(ImGuiKey_RightArrow, step_s)}) {
    if (!ImGui::IsKeyPressed(key)) continue;
    timeline.set_playing(false);
    session.seek(timeline.time_s() + step);
  }
  if (io.KeyCtrl && ImGui::IsKeyPressed(ImGuiKey_Z, false)) {
    io.KeyShift ? session.redo() : session.undo();
  }
}

void App::draw_widgets(Session& session) {
  const ImVec2 size = ImGui::GetIO().DisplaySize;
  const float left = em(20.5f), right = em(25), bottom = em(5.2f);
  const float height = size.y - bottom;
  if (begin_panel("left", 0, 0, left, height, colour::kPanel)) {
    draw_device_panel(session);
    draw_figures_panel(session, typing_);
    draw_people_panel(session, typing_);
    draw_package_panel(session);
  }
  ImGui::End();
  if (begin_panel("right", size.x - right, 0, right, height, colour::kPanel)) {
    draw_switches_panel(session);
    draw_stages_panel(session);
  }
  ImGui::End();
  if (begin_panel("bottom", 0, height, size.x, bottom, colour::kPanel))
    save_window_ = draw_timeline_panel(session).save_window;
  ImGui::End();
  if (begin_panel("picture", left, 0, size.x - left - right, height, colour::kGround))
    draw_picture_panel(session, window_->picture());
  ImGui::End();
}

}  // namespace figurine::emulator
