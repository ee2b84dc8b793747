#include "samples/emulator/theme.h"

#include <unistd.h>

namespace figurine::emulator {

namespace {

// Debian's fonts-dejavu-core, then where other systems have it.
constexpr const char* kFonts[] = {"/usr/share/fonts/truetype/dejavu/DejaVuSans.ttf",
                                  "/usr/share/fonts/dejavu/DejaVuSans.ttf",
                                  "/usr/share/fonts/TTF/DejaVuSans.ttf"};

ImVec4 mixed(const ImVec4& a, const ImVec4& b, float share) {
  return {a.x + share * (b.x - a.x), a.y + share * (b.y - a.y), a.z + share * (b.z - a.z), 1};
}

}  // namespace

void set_theme(float letters_px) {
  ImGuiIO& io = ImGui::GetIO();
  bool found = false;
  for (const char* font : kFonts) {
    if (found || ::access(font, R_OK) != 0) continue;
    found = io.Fonts->AddFontFromFileTTF(font, letters_px) != nullptr;
  }
  if (!found) {
    ImFontConfig own;
    own.SizePixels = letters_px;
    io.Fonts->AddFontDefault(&own);
  }
  ImGui::StyleColorsDark();
  ImGuiStyle& style = ImGui::GetStyle();
  const float unit = letters_px / 15;
  style.WindowPadding = {12 * unit, 10 * unit};
  style.FramePadding = {7 * unit, 4 * unit};
  style.ItemSpacing = {8 * unit, 6 * unit};
  style.ItemInnerSpacing = {6 * unit, 4 * unit};
  style.CellPadding = {4 * unit, 2.5f * unit};
  style.ScrollbarSize = 11 * unit;
  style.GrabMinSize = 11 * unit;
  style.WindowRounding = 0, style.WindowBorderSize = 0;
  style.FrameRounding = 4 * unit, style.GrabRounding = 4 * unit;
  style.PopupRounding = 4 * unit, style.ScrollbarRounding = 6 * unit;
  style.AntiAliasedLinesUseTex = false;  // of which a software renderer makes two shades
  style.SeparatorTextBorderSize = 1;
  style.SeparatorTextPadding = {0, 5 * unit};
  ImVec4* const colours = style.Colors;
  const ImVec4 field = colour::kField, accent = colour::kAccent;
  colours[ImGuiCol_Text] = colour::kText;
  colours[ImGuiCol_TextDisabled] = colour::kDim;
  colours[ImGuiCol_WindowBg] = colour::kPanel;
  colours[ImGuiCol_PopupBg] = mixed(colour::kPanel, field, 0.5f);
  colours[ImGuiCol_Border] = mixed(field, colour::kText, 0.08f);
  colours[ImGuiCol_Separator] = colours[ImGuiCol_Border];
  colours[ImGuiCol_FrameBg] = field;
  colours[ImGuiCol_FrameBgHovered] = mixed(field, accent, 0.2f);
  colours[ImGuiCol_FrameBgActive] = mixed(field, accent, 0.35f);
  colours[ImGuiCol_CheckMark] = accent;
  colours[ImGuiCol_SliderGrab] = mixed(accent, field, 0.15f);
  colours[ImGuiCol_SliderGrabActive] = accent;
  colours[ImGuiCol_Button] = mixed(field, colour::kText, 0.08f);
  colours[ImGuiCol_ButtonHovered] = mixed(field, accent, 0.45f);
  colours[ImGuiCol_ButtonActive] = mixed(field, accent, 0.7f);
  colours[ImGuiCol_Header] = mixed(field, accent, 0.3f);
  colours[ImGuiCol_HeaderHovered] = mixed(field, accent, 0.4f);
  colours[ImGuiCol_HeaderActive] = mixed(field, accent, 0.6f);
  colours[ImGuiCol_PlotHistogram] = mixed(accent, colour::kPanel, 0.25f);
  colours[ImGuiCol_TableRowBgAlt] = {1, 1, 1, 0.025f};
  colours[ImGuiCol_ScrollbarBg] = {0, 0, 0, 0};
}

}  // namespace figurine::emulator
