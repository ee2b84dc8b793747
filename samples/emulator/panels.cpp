#include "samples/emulator/panels.h"

#include <algorithm>
#include <cfloat>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <format>

#include "samples/emulator/theme.h"

namespace figurine::emulator {

namespace {

constexpr int kMostSeed = 9999;
constexpr double kMessage_s = 8, kError_s = 20;  // that they are seen

void text(const std::string& line) { ImGui::TextUnformatted(line.c_str()); }
void text(const ImVec4& tint, const std::string& line) {
  ImGui::PushStyleColor(ImGuiCol_Text, tint);
  text(line);
  ImGui::PopStyleColor();
}
void wrapped(const ImVec4& tint, const std::string& line) {
  ImGui::PushStyleColor(ImGuiCol_Text, tint);
  ImGui::PushTextWrapPos(0);
  text(line);
  ImGui::PopTextWrapPos();
  ImGui::PopStyleColor();
}

// Text at the right end of a table's cell.
void right_text(const ImVec4& tint, const std::string& line) {
  const float room = ImGui::GetContentRegionAvail().x - ImGui::CalcTextSize(line.c_str()).x;
  if (room > 0) ImGui::SetCursorPosX(ImGui::GetCursorPosX() + room);
  text(tint, line);
}

void hint(const char* meaning) {
  if (ImGui::IsItemHovered(ImGuiHoveredFlags_DelayShort)) ImGui::SetTooltip("%s", meaning);
}

// The text, or as much of its beginning as there is room for.
std::string fitted(const std::string& line, float room) {
  if (ImGui::CalcTextSize(line.c_str()).x <= room) return line;
  std::string cut = line;
  while (!cut.empty() && ImGui::CalcTextSize((cut + "...").c_str()).x > room) cut.pop_back();
  return cut + "...";
}

// Two columns of label and value.
bool begin_facts(const char* id) {
  if (!ImGui::BeginTable(id, 2, ImGuiTableFlags_SizingFixedFit)) return false;
  ImGui::TableSetupColumn("label", ImGuiTableColumnFlags_WidthFixed, em(6.4f));
  ImGui::TableSetupColumn("value", ImGuiTableColumnFlags_WidthStretch);
  return true;
}
void fact(const std::string& label, const std::string& value, const ImVec4& tint = colour::kText) {
  ImGui::TableNextRow();
  ImGui::TableNextColumn();
  text(colour::kDim, label);
  ImGui::TableNextColumn();
  const std::string shown = fitted(value, ImGui::GetContentRegionAvail().x);
  text(tint, shown);
  if (shown != value) hint(value.c_str());
}

std::string cores_text(const DeviceProfile& profile, uint32_t threads) {
  if (profile.core == Core::kHere)
    return std::format("{} thread{}", threads, threads == 1 ? "" : "s");
  return std::format("{} x Cortex-{}, {:.1f} GHz", profile.cores,
                     profile.core == Core::kA76 ? "A76" : "A53", profile.ghz);
}

// The first name of its kind that is free in the working folder.
std::string free_name(const char* stem, const char* ending) {
  std::error_code error;
  for (int i = 1; i < 10000; ++i) {
    const std::string name = std::format("{}_{:03}{}", stem, i, ending);
    if (!std::filesystem::exists(name, error)) return name;
  }
  return std::format("{}{}", stem, ending);
}

ImVec4 error_tint(const StudyRow& row) {
  if (row.same || row.error_db >= 50) return colour::kGood;
  return row.error_db >= 38 ? colour::kText : row.error_db >= 30 ? colour::kDevice : colour::kBad;
}

std::string error_text(const StudyRow& row) {
  if (row.same) return "same";
  return std::isfinite(row.error_db) ? std::format("{:.1f} dB", row.error_db) : "same";
}

void measured_cells(const std::optional<Study>& study, const StudyRow* row) {
  ImGui::TableNextColumn();
  if (study) {
    right_text(error_tint(*row), error_text(*row));
  } else {
    right_text(colour::kDim, "-");
  }
  ImGui::TableNextColumn();
  if (study) {
    const double gain = std::abs(row->gain_ms) < 0.005 ? 0 : row->gain_ms;
    right_text(gain < 0 ? colour::kDim : colour::kText, std::format("{:+.2f}", gain));
  } else {
    right_text(colour::kDim, "-");
  }
}

// One switch: its row, and the scale below while it is on.
void draw_switch(const Switch& each, const StudyRow* row, Session& session) {
  Settings settings = session.settings();
  bool on = each.on(settings);
  ImGui::PushID(each.name);
  ImGui::TableNextRow();
  ImGui::TableNextColumn();
  if (ImGui::Checkbox(each.label, &on)) {
    each.set(settings, on ? each.tried : each.off);
    session.set_settings(settings);
  }
  hint(each.meaning);
  measured_cells(session.study(), row);
  if (on && each.scale) {
    ImGui::TableNextRow();
    ImGui::TableNextColumn();
    ImGui::Indent(em(1.9f));
    ImGui::SetNextItemWidth(-FLT_MIN);
    auto value = static_cast<float>(each.get(settings));
    if (ImGui::SliderFloat("##scale", &value, static_cast<float>(each.least),
                           static_cast<float>(each.most), each.format,
                           ImGuiSliderFlags_AlwaysClamp)) {
      each.set(settings, value);
      session.set_settings(settings);
    }
    ImGui::Unindent(em(1.9f));
  }
  ImGui::PopID();
}

// A bar for what is measured here and a thin one for what is estimated there, each on its own
// scale.
void draw_bar(double here, double most_here, double there, double most_there) {
  ImDrawList& list = *ImGui::GetWindowDrawList();
  const ImVec2 at = ImGui::GetCursorScreenPos();
  const float width = ImGui::GetContentRegionAvail().x, height = ImGui::GetTextLineHeight();
  const auto bar = [&](double share, float top, float bottom, const ImVec4& tint) {
    const float end = at.x + width * static_cast<float>(std::clamp(share, 0.0, 1.0));
    list.AddRectFilled({at.x, at.y + top * height}, {at.x + width, at.y + bottom * height},
                       ImGui::GetColorU32(ImGuiCol_FrameBg), 2);
    if (end > at.x + 1)
      list.AddRectFilled({at.x, at.y + top * height}, {end, at.y + bottom * height},
                         ImGui::GetColorU32(tint), 2);
  };
  const bool device = most_there > 0;
  bar(most_here > 0 ? here / most_here : 0, 0.14f, device ? 0.54f : 0.86f, colour::kAccent);
  if (device) bar(there / most_there, 0.62f, 0.92f, colour::kDevice);
  ImGui::Dummy({width, height});
}

void draw_messages(const Session& session, const ImVec2& low, const ImVec2& high) {
  ImDrawList& list = *ImGui::GetWindowDrawList();
  float bottom = high.y - em(0.6f);
  const float width = std::min(high.x - low.x - em(1.2f), em(46));
  const std::deque<Message>& messages = session.messages();
  int shown = 0;
  for (size_t i = messages.size(); i-- > 0 && shown < 4;) {
    const Message& message = messages[i];
    if (message.age_s > (message.error ? kError_s : kMessage_s) || width < em(4)) continue;
    const float pad = em(0.5f);
    const ImVec2 size = ImGui::CalcTextSize(message.text.c_str(), nullptr, false, width - 2 * pad);
    const float top = bottom - size.y - 2 * pad;
    if (top < low.y) break;
    const ImVec2 at{low.x + em(0.6f), top};
    list.AddRectFilled(at, {at.x + size.x + 2 * pad, bottom}, IM_COL32(18, 20, 25, 225), 4);
    list.AddRectFilled(at, {at.x + 3, bottom},
                       ImGui::GetColorU32(message.error ? colour::kBad : colour::kAccent), 2);
    list.AddText(ImGui::GetFont(), ImGui::GetFontSize(), {at.x + pad, top + pad},
                 ImGui::GetColorU32(message.error ? colour::kBad : colour::kText),
                 message.text.c_str(), nullptr, width - 2 * pad);
    bottom = top - em(0.35f);
    ++shown;
  }
}

void draw_framings(Session& session) {
  constexpr std::pair<const char*, samples::Framing> kFramings[] = {
      {"Body", samples::Framing::kBody},
      {"Bust", samples::Framing::kBust},
      {"Head", samples::Framing::kHead}};
  for (const auto& [label, framing] : kFramings) {
    if (ImGui::Button(label)) (void)session.report(session.home(framing));
    ImGui::SameLine();
  }
}

}  // namespace

void draw_device_panel(Session& session) {
  ImGui::SeparatorText("Device");
  ImGui::SetNextItemWidth(-FLT_MIN);
  if (ImGui::BeginCombo("##profile", session.profile().label)) {
    for (const DeviceProfile& each : device_profiles()) {
      if (ImGui::Selectable(each.label, &each == &session.profile()))
        (void)session.report(session.set_profile(each));
    }
    ImGui::EndCombo();
  }
  const DeviceProfile& profile = session.profile();
  const std::optional<FrameEstimate> estimate = session.estimate();
  if (begin_facts("device")) {
    fact("Cores", cores_text(profile, session.threads()));
    fact("Kernels",
         profile.core == Core::kHere
             ? std::string(to_string(session.isa()))
             : std::format("{} ({} here)", profile.instruction_set, to_string(session.isa())));
    fact("Memory", bytes_text(session.memory_bytes()) +
                       (profile.memory_bytes > 0 ? " of " + bytes_text(profile.memory_bytes)
                                                 : std::string()));
    fact("Screen", std::format("{} x {}", profile.screen.width_px, profile.screen.height_px));
    fact("Frame here", session.frame_ms() > 0 ? std::format("{:.2f} ms", session.frame_ms()) : "-",
         colour::kAccent);
    if (estimate) {
      fact("Frame there",
           std::format("about {:.0f} ms, {:.1f} / s", estimate->total_ms,
                       1000 / std::max(estimate->total_ms, 1e-3)),
           colour::kDevice);
      fact("Against here",
           std::format("about x {:.1f}", estimate->total_ms / std::max(session.frame_ms(), 1e-3)),
           colour::kDevice);
    }
    ImGui::EndTable();
  }
  if (!estimate) return;
  bool paced = session.paced();
  if (ImGui::Checkbox("Pace as estimated", &paced)) session.set_paced(paced);
  hint("Shows no picture before the device would have one");
  wrapped(colour::kDim,
          "An estimate for one core, from counted instructions: no caches, no heat, nobody else.");
}

void draw_figures_panel(Session& session, Typing& typing) {
  ImGui::SeparatorText("Figures");
  std::optional<size_t> gone;
  for (size_t i = 0; i < session.figure_count(); ++i) {
    ImGui::PushID(static_cast<int>(i));
    if (ImGui::SmallButton("x")) gone = i;
    hint("Takes the figure away");
    ImGui::SameLine();
    const std::string name = std::filesystem::path(session.figure(i).name).filename().string();
    text(fitted(name, ImGui::GetContentRegionAvail().x));
    ImGui::PopID();
  }
  if (gone) (void)session.report(session.remove_figure(*gone));
  if (session.cloud() != nullptr) {
    text(fitted(session.facts().empty() ? "" : session.facts().front().title,
                ImGui::GetContentRegionAvail().x));
  }
  if (session.figure_count() == 0 && session.cloud() == nullptr) text(colour::kDim, "Nobody yet");
  ImGui::SetNextItemWidth(-em(4));
  const bool entered =
      ImGui::InputTextWithHint("##path", "file to open, or drop it here", typing.path.data(),
                               typing.path.size(), ImGuiInputTextFlags_EnterReturnsTrue);
  ImGui::SameLine();
  if ((ImGui::Button("Open", {-FLT_MIN, 0}) || entered) && typing.path[0] != 0) {
    session.open(typing.path.data());
    typing.path[0] = 0;
  }
  if (session.loading()) text(colour::kAccent, "loading ...");
}

void draw_people_panel(Session& session, Typing& typing) {
  ImGui::SeparatorText("New people");
  if (!session.has_sampler()) {
    wrapped(colour::kDim, "Open a sampler, such as samples/samplers/edge.fgn, to sample people.");
    return;
  }
  // Undo, redo and scripts move the sliders too.
  if (!session.sampling()) {
    typing.seed = static_cast<int>(std::min<uint64_t>(session.seed().seed, kMostSeed));
    if (session.seed().mix > 0)
      typing.to = static_cast<int>(std::min<uint64_t>(session.seed().to, kMostSeed));
    typing.mix = static_cast<float>(session.seed().mix);
  }
  bool asked = false;
  const auto slider = [&](const char* label, int& value) {
    ImGui::PushID(label);
    ImGui::AlignTextToFramePadding();
    text(colour::kDim, label);
    ImGui::SameLine(em(5.2f));
    ImGui::SetNextItemWidth(ImGui::GetContentRegionAvail().x - 2 * ImGui::GetFrameHeight() -
                            em(0.8f));
    asked |= ImGui::SliderInt("##slider", &value, 0, kMostSeed, "%d", ImGuiSliderFlags_AlwaysClamp);
    ImGui::SameLine(0, em(0.4f));
    if (ImGui::Button("-", {ImGui::GetFrameHeight(), 0}) && value > 0) --value, asked = true;
    ImGui::SameLine(0, em(0.4f));
    if (ImGui::Button("+", {ImGui::GetFrameHeight(), 0}) && value < kMostSeed)
      ++value, asked = true;
    ImGui::PopID();
  };
  slider("Seed", typing.seed);
  slider("Towards", typing.to);
  ImGui::AlignTextToFramePadding();
  text(colour::kDim, "Mix");
  ImGui::SameLine(em(5.2f));
  ImGui::SetNextItemWidth(-FLT_MIN);
  asked |= ImGui::SliderFloat("##mix", &typing.mix, 0, 1, "%.2f", ImGuiSliderFlags_AlwaysClamp);
  if (asked) {
    (void)session.report(session.sample({.seed = static_cast<uint64_t>(typing.seed),
                                         .to = static_cast<uint64_t>(typing.to),
                                         .mix = typing.mix}));
  }
  ImGui::BeginDisabled(!session.can_undo());
  if (ImGui::Button("Undo")) session.undo();
  ImGui::EndDisabled();
  ImGui::SameLine();
  ImGui::BeginDisabled(!session.can_redo());
  if (ImGui::Button("Redo")) session.redo();
  ImGui::EndDisabled();
  ImGui::SameLine();
  ImGui::BeginDisabled(!session.has_person());
  if (ImGui::Button("Keep")) session.keep_person();
  hint("The next one stands beside this one");
  ImGui::EndDisabled();
  ImGui::SameLine();
  if (session.sampling()) {
    if (ImGui::Button("Cancel")) session.cancel_sampling();
    ImGui::SameLine();
    ImGui::ProgressBar(static_cast<float>(session.sampling_progress()), {-FLT_MIN, 0});
  } else if (session.sampling_seconds() > 0) {
    ImGui::AlignTextToFramePadding();
    text(colour::kDim, std::format("in {:.2f} s", session.sampling_seconds()));
  } else {
    ImGui::NewLine();
  }
}

void draw_package_panel(const Session& session) {
  ImGui::SeparatorText("Package");
  if (session.facts().empty()) {
    text(colour::kDim, "-");
    return;
  }
  const PackageFacts& facts = session.facts().back();
  if (begin_facts("package")) {
    fact("File", facts.title);
    for (const auto& [label, value] : facts.lines) fact(label, value);
    ImGui::EndTable();
  }
  if (facts.quality.empty()) return;
  text(colour::kDim, "Quality, as its maker measured it");
  if (ImGui::BeginTable("quality", 2, ImGuiTableFlags_SizingStretchProp | ImGuiTableFlags_RowBg)) {
    ImGui::TableSetupColumn("name", ImGuiTableColumnFlags_WidthStretch);
    ImGui::TableSetupColumn("value", ImGuiTableColumnFlags_WidthFixed, em(4));
    for (const auto& [name, value] : facts.quality) {
      ImGui::TableNextRow();
      ImGui::TableNextColumn();
      text(fitted(name, ImGui::GetContentRegionAvail().x));
      ImGui::TableNextColumn();
      right_text(colour::kText, value);
    }
    ImGui::EndTable();
  }
}

void draw_switches_panel(Session& session) {
  ImGui::SeparatorText("What a frame leaves out");
  const std::optional<Study>& study = session.study();
  if (ImGui::BeginTable("switches", 3, ImGuiTableFlags_RowBg | ImGuiTableFlags_SizingFixedFit)) {
    ImGui::TableSetupColumn("switch", ImGuiTableColumnFlags_WidthStretch);
    ImGui::TableSetupColumn("error", ImGuiTableColumnFlags_WidthFixed, em(4.6f));
    ImGui::TableSetupColumn("gain, ms", ImGuiTableColumnFlags_WidthFixed, em(4.2f));
    ImGui::TableNextRow();
    ImGui::TableNextColumn();
    text(colour::kDim, "each alone");
    ImGui::TableNextColumn();
    right_text(colour::kDim, "error");
    ImGui::TableNextColumn();
    right_text(colour::kDim, "gain, ms");
    for (size_t i = 0; i < switches().size(); ++i)
      draw_switch(switches()[i], study ? &study->rows[i] : nullptr, session);
    ImGui::TableNextRow();
    ImGui::TableNextColumn();
    text(colour::kAccent, "All as set");
    hint("With a fresh pose in every frame");
    measured_cells(study, study ? &study->as_set : nullptr);
    ImGui::EndTable();
  }
  bool measuring = session.measuring();
  if (ImGui::Checkbox("Measure", &measuring)) session.set_measuring(measuring);
  hint("In the background, on one core, as the picture changes");
  ImGui::SameLine();
  ImGui::AlignTextToFramePadding();
  text(colour::kDim, study ? std::format("dense frame: {:.2f} ms on one core", study->dense_ms)
                           : "not measured yet");
}

void draw_stages_panel(const Session& session) {
  ImGui::SeparatorText("Stages of a frame");
  const std::array<double, kStageCount>& here = session.stage_ms();
  const std::optional<FrameEstimate> device = session.estimate();
  const double most_here = *std::max_element(here.begin(), here.end());
  const double most_there =
      device ? *std::max_element(device->stage_ms.begin(), device->stage_ms.end()) : 0;
  if (!ImGui::BeginTable("stages", device ? 4 : 3, ImGuiTableFlags_SizingFixedFit)) return;
  ImGui::TableSetupColumn("stage", ImGuiTableColumnFlags_WidthFixed, em(4.6f));
  ImGui::TableSetupColumn("bar", ImGuiTableColumnFlags_WidthStretch);
  ImGui::TableSetupColumn("here", ImGuiTableColumnFlags_WidthFixed, em(4.2f));
  if (device) ImGui::TableSetupColumn("there", ImGuiTableColumnFlags_WidthFixed, em(4.4f));
  for (size_t i = 0; i < kStageCount; ++i) {
    ImGui::TableNextRow();
    ImGui::TableNextColumn();
    text(to_string(static_cast<Stage>(i)));
    ImGui::TableNextColumn();
    draw_bar(here[i], most_here, device ? device->stage_ms[i] : 0, most_there);
    ImGui::TableNextColumn();
    right_text(colour::kText, std::format("{:.2f} ms", here[i]));
    if (!device) continue;
    ImGui::TableNextColumn();
    right_text(colour::kDevice, std::format("{:.1f} ms", device->stage_ms[i]));
  }
  ImGui::EndTable();
  const FrameStatistics& work = session.statistics();
  std::string done = std::format(
      "{} Gaussians, {} visible, {:.2f} M blends, {:.0f} M products", work.gaussians, work.visible,
      static_cast<double>(work.blends) * 1e-6, static_cast<double>(work.macs) * 1e-6);
  if (work.left_out.unchanged_networks > 0) done += "; the pose stayed: no run of its network";
  wrapped(colour::kDim, done);
}

Asked draw_timeline_panel(Session& session) {
  Asked asked;
  Timeline& timeline = session.timeline();
  ImGui::BeginDisabled(!timeline.moves());
  if (ImGui::Button(timeline.playing() ? "Pause" : "Play", {em(4.6f), 0}))
    timeline.set_playing(!timeline.playing());
  ImGui::SameLine();
  ImGui::SetNextItemWidth(-em(5.2f));
  auto time_s = static_cast<float>(timeline.time_s());
  const auto end_s =
      static_cast<float>(std::max(1u, timeline.frames() - 1) / timeline.frames_per_second());
  const std::string shown =
      timeline.moves() ? std::format("{:.2f} s of {:.1f} s   (frame {} of {})", timeline.time_s(),
                                     timeline.duration_s(), timeline.frame() + 1, timeline.frames())
                       : "no motion";
  // The slider formats its value; a text of its own must hold no '%'.
  if (ImGui::SliderFloat("##time", &time_s, 0, end_s, shown.c_str(),
                         ImGuiSliderFlags_AlwaysClamp | ImGuiSliderFlags_NoRoundToFormat |
                             ImGuiSliderFlags_NoInput)) {
    timeline.set_playing(false);
    session.seek(time_s);
  }
  ImGui::SameLine();
  ImGui::SetNextItemWidth(-FLT_MIN);
  auto speed = static_cast<float>(timeline.speed());
  if (ImGui::DragFloat("##speed", &speed, 0.01f, static_cast<float>(Timeline::kSlowest),
                       static_cast<float>(Timeline::kFastest), "x %.2f",
                       ImGuiSliderFlags_AlwaysClamp))
    timeline.set_speed(speed);
  hint("Speed of the motion: drag");
  ImGui::EndDisabled();

  draw_framings(session);
  ImGui::SameLine(0, em(1.6f));
  if (ImGui::Button("Save picture")) (void)session.save_picture(free_name("picture", ".png"));
  ImGui::SameLine();
  if (ImGui::Button("Save window")) asked.save_window = true;
  ImGui::SameLine();
  const Recorder* const recorder = session.recorder();
  if (recorder == nullptr) {
    if (ImGui::Button("Record")) (void)session.start_recording(free_name("recording", ".webp"));
  } else {
    ImGui::BeginDisabled(recorder->stopping());
    if (ImGui::Button("Stop")) session.stop_recording();
    ImGui::EndDisabled();
    ImGui::SameLine();
    text(colour::kBad, recorder->stopping()
                           ? "writing ..."
                           : std::format("{:.1f} s", static_cast<double>(recorder->frames()) /
                                                         Recorder::kFramesPerSecond));
  }
  ImGui::SameLine();
  const std::string keys = "drag: turn    right drag: shift    wheel: nearer    space: play";
  right_text(colour::kDim, fitted(keys, ImGui::GetContentRegionAvail().x));
  return asked;
}

void draw_picture_panel(Session& session, ImTextureID picture) {
  const ImVec2 low = ImGui::GetCursorScreenPos(), room = ImGui::GetContentRegionAvail();
  const samples::ImageSize size = session.picture().size;
  const float caption = ImGui::GetTextLineHeightWithSpacing();
  const float scale = std::min(room.x / static_cast<float>(size.width_px),
                               (room.y - caption) / static_cast<float>(size.height_px));
  if (scale <= 0) return;
  const ImVec2 shown{scale * static_cast<float>(size.width_px),
                     scale * static_cast<float>(size.height_px)};
  const ImVec2 at{low.x + (room.x - shown.x) / 2, low.y + (room.y - caption - shown.y) / 2};
  ImGui::SetCursorScreenPos(at);
  ImGui::InvisibleButton("picture", shown,
                         ImGuiButtonFlags_MouseButtonLeft | ImGuiButtonFlags_MouseButtonRight |
                             ImGuiButtonFlags_MouseButtonMiddle);
  const ImGuiIO& io = ImGui::GetIO();
  if (ImGui::IsItemActive()) {
    const ImVec2 moved = io.MouseDelta;
    if (moved.x != 0 || moved.y != 0) {
      if (ImGui::IsMouseDown(ImGuiMouseButton_Left) && !io.KeyShift) {
        session.turn(moved.x, moved.y);
      } else {
        session.shift(moved.x, moved.y, shown.y);
      }
    }
  }
  if (ImGui::IsItemHovered() && io.MouseWheel != 0) session.zoom(io.MouseWheel);
  ImDrawList& list = *ImGui::GetWindowDrawList();
  const float edge = em(0.35f);
  list.AddRectFilled({at.x - edge, at.y - edge}, {at.x + shown.x + edge, at.y + shown.y + edge},
                     ImGui::GetColorU32(colour::kField), 6);
  if (picture != nullptr) list.AddImage(picture, at, {at.x + shown.x, at.y + shown.y});
  std::string line = std::format("{} x {}", size.width_px, size.height_px);
  if (session.timeline().playing() && session.timeline().moves())
    line += std::format("   {:.0f} pictures a second", session.pictures_per_second());
  const float width = ImGui::CalcTextSize(line.c_str()).x;
  list.AddText({low.x + (room.x - width) / 2, at.y + shown.y + edge + em(0.3f)},
               ImGui::GetColorU32(colour::kDim), line.c_str());
  draw_messages(session, {at.x, at.y}, {at.x + shown.x, at.y + shown.y});
}

}  // namespace figurine::emulator
