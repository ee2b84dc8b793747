#include "ports/motion/import.h"

#include <charconv>
#include <cstdio>
#include <filesystem>
#include <utility>

#include "ports/host/files.h"
#include "ports/motion/clip.h"
#include "ports/motion/gaze.h"
#include "ports/motion/motion_loop.h"

namespace figurine::ports {
namespace {

constexpr float kDegrees = 57.29578f;
constexpr size_t kMaxMapBytes = size_t{1} << 20;

Status wrong(const std::string& reason) { return Status(StatusCode::kInvalidArgument, reason); }

// A number within bounds, or why it is none.
template <class T>
Result<T> number(const std::string& text, T least, T most, const char* bounds) {
  T value{};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() ||
      !(value >= least && value <= most)) {
    return wrong("'" + text + "': not " + bounds);
  }
  return value;
}

template <class T, class Slot>
TextOption number_option(const char* name, const char* help, T least, T most, const char* bounds,
                         Slot& slot) {
  return {name, help, false, [=, &slot](const std::string& text) -> Status {
            const Result<T> value = number<T>(text, least, most, bounds);
            if (!value.ok()) return value.status();
            slot = *value;
            return {};
          }};
}

TextOption text_option(const char* name, const char* help, std::string& slot) {
  return {name, help, false, [&slot](const std::string& text) -> Status {
            if (text.empty()) return wrong("empty");
            slot = text;
            return {};
          }};
}

TextOption flag(const char* name, const char* help, bool& slot, bool value) {
  return {name, help, true, [&slot, value](const std::string&) -> Status {
            slot = value;
            return {};
          }};
}

std::string file_name(const std::string& path) {
  return std::filesystem::path(path).filename().string();
}

Provenance provenance_of(const ImportSettings& settings, const MotionClip& clip, ClipKind kind,
                         uint32_t animation, const std::array<uint64_t, 2>& body_hash) {
  const RetargetOptions& retarget = settings.retarget;
  const bool is_gltf = kind == ClipKind::kGltf;
  Provenance provenance;
  provenance.settings = {
      {"command", "motion " + file_name(settings.clip)},
      {"body", format_hash(body_hash)},
      {"start", retarget.start ? std::to_string(*retarget.start) : "first of the motion"},
      {"frames", std::to_string(clip.frame_count)},
      {"loop_cycles", std::to_string(settings.loop_cycles)},
      {"smooth_s", std::to_string(retarget.smooth_s.value_or(is_gltf ? 0 : kCaptureSmoothS))}};
  const auto add = [&](const char* name, const std::string& value) {
    provenance.settings.push_back({name, value});
  };
  if (settings.head_pitch_deg) add("head_pitch_deg", std::to_string(*settings.head_pitch_deg));
  if (is_gltf) add("animation", std::to_string(animation));
  if (retarget.source_fps) add("source_fps", std::to_string(*retarget.source_fps));
  if (retarget.up) add("up", to_string(*retarget.up));
  if (!settings.map.empty()) add("map", file_name(settings.map));
  if (!retarget.checked) add("checks", "none");
  return provenance;
}

std::string figures(const RetargetReport& report, const MotionClip& clip) {
  const HeadPitch pitch = measure_head_pitch(clip);
  char text[400];
  std::snprintf(text, sizeof text,
                "%u frames at %g a second, soles in contact %.1f mm from the ground on average "
                "(lowest %.1f), largest step of a joint %.1f degrees, head pitched by %.0f degrees "
                "(%.0f to %.0f)",
                clip.frame_count, double{clip.frames_per_second},
                1e3 * double{report.mean_contact_m}, 1e3 * double{report.lowest_sole_m},
                double{kDegrees * report.largest_step_rad}, double{kDegrees * pitch.mean_rad},
                double{kDegrees * pitch.lowest_rad}, double{kDegrees * pitch.highest_rad});
  return text;
}

}  // namespace

Status set_neutral(const std::string& text, RetargetOptions& options) {
  if (text == "first") {
    options.neutral = Neutral::kFirstFrame;
  } else if (text == "zero") {
    options.neutral = Neutral::kZeroPose;
  } else if (text == "axes") {
    options.neutral = Neutral::kBoneAxes;
  } else if (const auto frame = number<uint32_t>(text, 0, UINT32_MAX - 1, ""); frame.ok()) {
    options.neutral = Neutral::kFrame;
    options.neutral_frame = *frame;
  } else {
    return wrong("'" + text + "': neither first, zero, axes nor a frame's number");
  }
  return {};
}

std::string describe_motion(const RetargetReport& report, const MotionClip& clip) {
  return figures(report, clip) + "; read: " + report.summary;
}

std::vector<TextOption> import_options(ImportSettings& settings) {
  RetargetOptions& retarget = settings.retarget;
  std::vector<TextOption> options;
  options.push_back(number_option<float>("--fps", "Frames a second of the result; default: 30", 1,
                                         240, "a number from 1 to 240",
                                         retarget.frames_per_second));
  options.push_back(number_option<float>(
      "--source-fps", "Frames a second of the clip, in place of what the file says", 1, 1000,
      "a number from 1 to 1000", retarget.source_fps));
  options.push_back(number_option<uint32_t>("--start",
                                            "First frame of the clip, counted as in the file "
                                            "(glTF: at --fps); default: after the neutral "
                                            "frame",
                                            0, UINT32_MAX - 1, "a frame's number", retarget.start));
  options.push_back(number_option<uint32_t>("--frames", "Frames of the result; default: to the end",
                                            1, UINT32_MAX - 1, "a number of frames from 1 on",
                                            retarget.frames));
  options.push_back(
      text_option("--name", "Name of the motion; default: the file's", retarget.name));
  options.push_back(number_option<float>(
      "--smooth", "Standard deviation of the smoothing over time, seconds; default: 0.03, glTF: 0",
      0, 0.5f, "seconds from 0 to 0.5", retarget.smooth_s));
  options.push_back(
      {"--neutral",
       "The T-pose is the first frame, the zero pose (glTF: of the nodes), a frame by its number, "
       "or "
       "told by the bones' axes (glTF: axes); default: the one that is a T-pose",
       false, [&retarget](const std::string& text) { return set_neutral(text, retarget); }});
  options.push_back(number_option<uint32_t>(
      "--animation",
      "glTF: which of the file's animations, counted from 0; default: the first that moves the "
      "skeleton",
      0, UINT32_MAX - 1, "an animation's number", retarget.animation));
  options.push_back({"--up",
                     "Which axis of the clip's world points up: y, z, x, -y, -z or -x; default: y, "
                     "NPZ: z, or the one along which the person stands",
                     false, [&retarget](const std::string& text) -> Status {
                       retarget.up = parse_up(text);
                       return retarget.up ? Status()
                                          : wrong("'" + text + "': none of y, z, x, -y, -z and -x");
                     }});
  options.push_back(text_option(
      "--map", "Which joint is which: a JSON file of joints and names, {\"left_knee\": \"Shin_L\"}",
      settings.map));
  options.push_back(
      number_option<uint32_t>("--loop", "Repeat the best gait cycle this often, straight ahead", 1,
                              1000, "a number from 1 to 1000", settings.loop_cycles));
  options.push_back(flag("--in-place", "With --loop: walk on the spot", settings.in_place, true));
  options.push_back(number_option<float>(
      "--head-pitch",
      "Turn neck and head, by one angle for the whole clip, until the face looks up by this many "
      "degrees on average; 0: ahead; default: as captured",
      -80, 80, "degrees from -80 to 80", settings.head_pitch_deg));
  options.push_back(text_option("--source",
                                "Provenance line: where the clip is from and under which terms",
                                settings.source));
  options.push_back(
      flag("--no-checks", "Write what cannot be a person all the same", retarget.checked, false));
  return options;
}

Result<ImportedMotion> import_motion(const ImportSettings& settings, const figurine::Body& body,
                                     const std::array<uint64_t, 2>& body_hash) {
  const Result<ClipKind> kind = clip_kind(settings.clip);
  if (!kind.ok()) return kind.status();
  if (*kind == ClipKind::kPackage) return wrong(settings.clip + ": is a motion package already");
  if (settings.in_place && settings.loop_cycles == 0)
    return wrong("--in-place: walks on the spot with --loop alone");
  RetargetOptions retarget = settings.retarget;
  if (retarget.name.empty()) retarget.name = std::filesystem::path(settings.clip).stem().string();
  if (!settings.map.empty()) {
    const Result<MappedFile> file = MappedFile::open(settings.map);
    if (!file.ok()) return file.status().within("--map");
    if (file->bytes().size() > kMaxMapBytes) return wrong(settings.map + ": larger than 1 MiB");
    Result<JointMap> map = parse_joint_map(
        {reinterpret_cast<const char*>(file->bytes().data()), file->bytes().size()}, settings.map);
    if (!map.ok()) return map.status();
    retarget.map = std::move(map).value();
  }
  RetargetReport report;
  Result<MotionClip> clip = read_clip(settings.clip, body, retarget, &report);
  if (!clip.ok()) return clip.status();
  ImportedMotion out;
  std::string cycle;
  if (settings.loop_cycles > 0) {
    LoopReport loop;
    clip = make_loop(*clip, {.cycles = settings.loop_cycles, .in_place = settings.in_place}, &loop);
    if (!clip.ok()) return clip.status();
    char text[96];
    std::snprintf(text, sizeof text, "; a cycle of %u frames from frame %u on, gap %.1f degrees",
                  loop.length, loop.first_frame, double{kDegrees * loop.gap_rad});
    cycle = text;
  }
  if (settings.head_pitch_deg) {
    clip = with_head_pitch(std::move(clip).value(), *settings.head_pitch_deg / kDegrees);
    if (!clip.ok()) return clip.status();
  }
  out.provenance = provenance_of(settings, *clip, *kind, report.animation, body_hash);
  Result<std::string> source = settings.source;
  if (settings.source.empty()) source = clip_source(settings.clip);
  if (!source.ok()) return source.status();
  out.provenance.sources = {*source};
  out.clip = std::move(clip).value();
  out.summary = figures(report, out.clip) + cycle + "; read: " + report.summary;
  return out;
}

}  // namespace figurine::ports
