#include "samples/emulator/script.h"

#include <algorithm>
#include <cmath>
#include <format>
#include <nlohmann/json.hpp>
#include <span>
#include <sstream>
#include <string_view>

#include "ports/host/files.h"
#include "samples/common/parse.h"

namespace figurine::emulator {

namespace {

constexpr double kLongestWait_s = 120;  // for what threads do: then the script goes on, and says so
constexpr uint64_t kSettling = 3;       // frames until widgets have their sizes

// What stands behind a verb: words (w), numbers (n), a rest of the line that is a path (p); in
// brackets what may be missing.
struct Form {
  const char* text;
  Verb verb;
  const char* takes;
  const char* usage;
};
constexpr Form kForms[] = {
    {"load", Verb::kLoad, "p", "load FILE"},
    {"drop", Verb::kDrop, "p", "drop FILE"},
    {"remove", Verb::kRemove, "n", "remove NUMBER"},
    {"play", Verb::kPlay, "", "play"},
    {"pause", Verb::kPause, "", "pause"},
    {"seek", Verb::kSeek, "n", "seek SECONDS"},
    {"speed", Verb::kSpeed, "n", "speed FACTOR"},
    {"orbit", Verb::kOrbit, "nnn", "orbit AZIMUTH ELEVATION DISTANCE"},
    {"drag", Verb::kDrag, "nn", "drag RIGHT DOWN"},
    {"zoom", Verb::kZoom, "n", "zoom STEPS"},
    {"home", Verb::kHome, "[w]", "home [body|bust|head]"},
    {"profile", Verb::kProfile, "w", "profile NAME"},
    {"pace", Verb::kPace, "w", "pace on|off"},
    {"set", Verb::kSet, "ww", "set SWITCH on|off|VALUE"},
    {"measure", Verb::kMeasure, "w", "measure on|off"},
    {"seed", Verb::kSeed, "n[nn]", "seed NUMBER [TO MIX]"},
    {"keep", Verb::kKeep, "", "keep"},
    {"undo", Verb::kUndo, "", "undo"},
    {"redo", Verb::kRedo, "", "redo"},
    {"cancel", Verb::kCancel, "", "cancel"},
    {"wait", Verb::kWait, "w", "wait SECONDS|idle|measured"},
    {"frames", Verb::kFrames, "n", "frames COUNT"},
    {"picture", Verb::kPicture, "p", "picture FILE"},
    {"screenshot", Verb::kScreenshot, "p", "screenshot FILE"},
    {"record", Verb::kRecord, "p", "record FILE"},
    {"stop", Verb::kStop, "", "stop"},
    {"state", Verb::kState, "p", "state FILE"},
    {"quit", Verb::kQuit, "", "quit"},
};

std::string trimmed(std::string_view text) {
  const size_t first = text.find_first_not_of(" \t\r");
  if (first == std::string_view::npos) return "";
  return std::string(text.substr(first, text.find_last_not_of(" \t\r") - first + 1));
}

// The words behind the verb, as the form wants them.
bool read_words(const Form& form, const std::string& rest, ScriptCommand& command) {
  const std::string takes = form.takes;
  if (takes == "p") {
    if (rest.empty()) return false;
    command.words = {rest};
    return true;
  }
  std::istringstream stream(rest);
  for (std::string word; stream >> word;) command.words.push_back(word);
  const size_t bracket = takes.find('[');
  std::string all;
  for (const char each : takes) {
    if (each != '[' && each != ']') all += each;
  }
  const size_t least = bracket == std::string::npos ? all.size() : bracket;
  if (command.words.size() != all.size() && command.words.size() != least) return false;
  for (size_t i = 0; i < command.words.size(); ++i) {
    if (all[i] != 'n') continue;
    const std::optional<std::vector<double>> number = samples::parse_numbers(command.words[i], 1);
    if (!number || number->size() != 1) return false;
    command.numbers.push_back(number->front());
  }
  return true;
}

bool is_switch_word(const std::string& word) { return word == "on" || word == "off"; }

// What a form alone does not say.
bool means_something(ScriptCommand& command) {
  switch (command.verb) {
    case Verb::kPace:
    case Verb::kMeasure:
      return is_switch_word(command.words[0]);
    case Verb::kProfile:
      return find_profile(command.words[0]) != nullptr;
    case Verb::kHome:
      return command.words.empty() || samples::parse_framing(command.words[0]).ok();
    case Verb::kSet: {
      Settings any;
      return set_switch(any, command.words[0], command.words[1]).ok();
    }
    case Verb::kSeed:
      return command.numbers[0] >= 0 && command.numbers[0] <= 9e15 &&
             (command.numbers.size() < 3 ||
              (command.numbers[1] >= 0 && command.numbers[1] <= 9e15 && command.numbers[2] >= 0 &&
               command.numbers[2] <= 1));
    case Verb::kRemove:
    case Verb::kFrames:
      return command.numbers[0] >= 1 && command.numbers[0] <= 1e6 &&
             command.numbers[0] == std::floor(command.numbers[0]);
    case Verb::kWait: {
      if (command.words[0] == "idle") command.verb = Verb::kWaitIdle;
      if (command.words[0] == "measured") command.verb = Verb::kWaitMeasured;
      if (command.verb != Verb::kWait) return true;
      const std::optional<std::vector<double>> number = samples::parse_numbers(command.words[0], 1);
      if (!number || number->size() != 1 || number->front() < 0) return false;
      command.numbers = *number;
      return true;
    }
    default:
      return true;
  }
}

}  // namespace

Result<std::vector<ScriptCommand>> parse_script(const std::string& text, const std::string& name) {
  std::vector<ScriptCommand> commands;
  std::istringstream lines(text);
  size_t number = 0;
  for (std::string line; std::getline(lines, line);) {
    ++number;
    const std::string trimmed_line = trimmed(line);
    if (trimmed_line.empty() || trimmed_line[0] == '#') continue;
    const auto invalid = [&](const std::string& what) {
      return Status(StatusCode::kInvalidArgument,
                    std::format("{}: line {}: {}", name, number, what));
    };
    const size_t end = std::min(trimmed_line.find_first_of(" \t"), trimmed_line.size());
    const std::string verb = trimmed_line.substr(0, end);
    const auto form = std::find_if(std::begin(kForms), std::end(kForms),
                                   [&](const Form& each) { return verb == each.text; });
    if (form == std::end(kForms)) return invalid("'" + verb + "' is no command");
    ScriptCommand command{.verb = form->verb, .line = number};
    if (!read_words(*form, trimmed(trimmed_line.substr(end)), command) ||
        !means_something(command)) {
      return invalid("'" + trimmed_line + "': wanted is " + form->usage);
    }
    commands.push_back(std::move(command));
  }
  return commands;
}

Script::Wanted Script::step(Session& session, double elapsed_s) {
  Wanted wanted;
  waited_s_ += elapsed_s;
  ++frames_;
  while (!over() && !wanted.quit && !wanted.screenshot) {
    if (!begun_) waited_s_ = 0, frames_ = 0, from_change_ = session.change();
    begun_ = true;
    if (!carry_out(commands_[at_], session, wanted)) break;
    begun_ = false;
    ++at_;
  }
  return wanted;
}

bool Script::carry_out(const ScriptCommand& command, Session& session, Wanted& wanted) {
  switch (command.verb) {
    case Verb::kDrop:
      wanted.drops.push_back(command.words[0]);
      return true;
    case Verb::kScreenshot:
      // A device that is slow has not shown yet what was asked for.
      if (frames_ < kSettling ||
          (!session.up_to_date() && !session.timeline().playing() && waited_s_ < kLongestWait_s))
        return false;
      wanted.screenshot = command.words[0];
      return true;
    case Verb::kQuit:
      wanted.quit = true;
      return true;
    case Verb::kWait:
    case Verb::kWaitIdle:
    case Verb::kWaitMeasured:
    case Verb::kFrames:
      return is_over(command, session);
    case Verb::kPicture:
      if (!session.up_to_date() && !session.timeline().playing() && waited_s_ < kLongestWait_s)
        return false;
      [[fallthrough]];
    default: {
      const Status done = apply(command, session);
      if (!done.ok())
        session.say(std::format("{}: line {}: {}", name_, command.line, done.message()), true);
      return true;
    }
  }
}

bool Script::is_over(const ScriptCommand& command, Session& session) {
  if (command.verb == Verb::kFrames) return static_cast<double>(frames_) >= command.numbers[0];
  if (command.verb == Verb::kWait) return waited_s_ >= command.numbers[0];
  const bool idle = frames_ >= 1 && session.idle();  // what was dropped is on its way
  const bool there = command.verb == Verb::kWaitIdle
                         ? idle
                         : idle && session.study() && session.study()->number >= from_change_;
  if (there) return true;
  const bool never = command.verb == Verb::kWaitMeasured && !session.measuring();
  if (!never && waited_s_ < kLongestWait_s) return false;
  session.say(std::format("{}: line {}: waited {:.0f} s in vain", name_, command.line, waited_s_),
              true);
  return true;
}

Status Script::apply(const ScriptCommand& command, Session& session) {
  const std::vector<std::string>& words = command.words;
  const std::vector<double>& numbers = command.numbers;
  const auto number = [&](size_t i) { return static_cast<float>(numbers[i]); };
  switch (command.verb) {
    case Verb::kLoad:
      session.open(words[0]);
      return {};
    case Verb::kRemove:
      return session.remove_figure(static_cast<size_t>(numbers[0]) - 1);
    case Verb::kPlay:
    case Verb::kPause:
      session.timeline().set_playing(command.verb == Verb::kPlay);
      return {};
    case Verb::kSeek:
      session.seek(numbers[0]);
      return {};
    case Verb::kSpeed:
      session.timeline().set_speed(numbers[0]);
      return {};
    case Verb::kOrbit:
      session.set_orbit(number(0), number(1), number(2));
      return {};
    case Verb::kDrag:
      session.turn(number(0), number(1));
      return {};
    case Verb::kZoom:
      session.zoom(number(0));
      return {};
    case Verb::kHome:
      return session.home(words.empty() ? samples::Framing::kBody
                                        : *samples::parse_framing(words[0]));
    case Verb::kProfile:
      return session.set_profile(*find_profile(words[0]));
    case Verb::kPace:
      session.set_paced(words[0] == "on");
      return {};
    case Verb::kSet: {
      Settings settings = session.settings();
      FIG_RETURN_IF_ERROR(set_switch(settings, words[0], words[1]));
      session.set_settings(settings);
      return {};
    }
    case Verb::kMeasure:
      session.set_measuring(words[0] == "on");
      return {};
    case Verb::kSeed: {
      Seed seed{.seed = static_cast<uint64_t>(numbers[0])};
      if (numbers.size() == 3) seed.to = static_cast<uint64_t>(numbers[1]), seed.mix = numbers[2];
      return session.sample(seed);
    }
    case Verb::kKeep:
      session.keep_person();
      return {};
    case Verb::kUndo:
      session.undo();
      return {};
    case Verb::kRedo:
      session.redo();
      return {};
    case Verb::kCancel:
      session.cancel_sampling();
      return {};
    case Verb::kPicture:
      (void)session.draw();
      (void)session.save_picture(words[0]);  // says itself what was wrong
      return {};
    case Verb::kRecord:
      (void)session.start_recording(words[0]);
      return {};
    case Verb::kStop:
      session.stop_recording();
      return {};
    case Verb::kState: {
      const std::string text =
          session.json().dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace) +
          "\n";
      return ports::write_file_atomically(words[0], std::as_bytes(std::span(text)));
    }
    default:
      return {};
  }
}

}  // namespace figurine::emulator
