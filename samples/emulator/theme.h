// How the emulator's widgets look: colours, spaces, letters.
#pragma once

#include <imgui.h>

namespace figurine::emulator {

// A share of the height of letters, so that everything grows with them.
inline float em(float times) { return times * ImGui::GetFontSize(); }

namespace colour {
inline constexpr ImVec4 kText{0.91f, 0.92f, 0.94f, 1};
inline constexpr ImVec4 kDim{0.60f, 0.63f, 0.69f, 1};
inline constexpr ImVec4 kAccent{0.36f, 0.66f, 0.96f, 1};
inline constexpr ImVec4 kDevice{0.95f, 0.70f, 0.32f, 1};  // what is estimated
inline constexpr ImVec4 kGood{0.45f, 0.80f, 0.55f, 1};
inline constexpr ImVec4 kBad{0.96f, 0.48f, 0.44f, 1};
inline constexpr ImVec4 kGround{0.085f, 0.095f, 0.115f, 1};  // behind everything
inline constexpr ImVec4 kPanel{0.125f, 0.138f, 0.163f, 1};
inline constexpr ImVec4 kField{0.19f, 0.21f, 0.25f, 1};
}  // namespace colour

// letters_px: the height of text. A font of the system where there is a known one, else Dear
// ImGui's own. After the context was made, before the first frame.
void set_theme(float letters_px);

}  // namespace figurine::emulator
