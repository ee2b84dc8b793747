// The emulator's widgets: they show a session and change it, and know nothing that it does not,
// besides what is being typed. Each call draws one panel, whole, into the current frame of Dear
// ImGui.
#pragma once

#include <imgui.h>

#include <array>
#include <string>

#include "samples/emulator/session.h"

namespace figurine::emulator {

// What hands are about to say.
struct Typing {
  std::array<char, 512> path{};
  int seed = 0, to = 1;
  float mix = 0;
  uint64_t seen_seed_of = 0;  // the last change of the session's seed that the sliders took over
};

// What a panel asks of the window.
struct Asked {
  bool save_window = false;
};

void draw_device_panel(Session& session);
void draw_figures_panel(Session& session, Typing& typing);
void draw_people_panel(Session& session, Typing& typing);
void draw_package_panel(const Session& session);
void draw_switches_panel(Session& session);
void draw_stages_panel(const Session& session);
Asked draw_timeline_panel(Session& session);
// The picture in the middle of the room that there is, what a mouse does to it, and messages.
// picture: null before the first one.
void draw_picture_panel(Session& session, ImTextureID picture);

}  // namespace figurine::emulator
