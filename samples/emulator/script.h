// What drives the emulator in place of hands: a text of one command a line, read whole and checked
// before anything begins, then carried out frame by frame. docs/emulator.md lists the commands.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "samples/emulator/session.h"

namespace figurine::emulator {

enum class Verb : uint8_t {
  kLoad,
  kDrop,
  kRemove,
  kPlay,
  kPause,
  kSeek,
  kSpeed,
  kOrbit,
  kDrag,
  kZoom,
  kHome,
  kProfile,
  kPace,
  kSet,
  kMeasure,
  kSeed,
  kKeep,
  kUndo,
  kRedo,
  kCancel,
  kWait,
  kWaitIdle,
  kWaitMeasured,
  kFrames,
  kPicture,
  kScreenshot,
  kRecord,
  kStop,
  kState,
  kQuit,
};

struct ScriptCommand {
  Verb verb{};
  std::vector<std::string> words;  // behind the verb; a path is one, with its blanks
  std::vector<double> numbers;     // of words that are numbers
  size_t line = 0;
};

// kInvalidArgument names the script, the line and what is wrong with it. '#' begins a comment.
Result<std::vector<ScriptCommand>> parse_script(const std::string& text, const std::string& name);

class Script {
 public:
  // What only the window can do, in this frame.
  struct Wanted {
    std::optional<std::string> screenshot;  // of what is drawn in this frame
    std::vector<std::string> drops;         // files, as if by a mouse
    bool quit = false;
  };
  Script(std::vector<ScriptCommand> commands, std::string name)
      : commands_(std::move(commands)), name_(std::move(name)) {}

  // Carries out what can be, up to the first command that takes time. Once a frame, behind
  // advance() and before draw(). What fails is a message of the session's, and no end.
  Wanted step(Session& session, double elapsed_s);
  bool over() const { return at_ == commands_.size(); }

 private:
  // Whether the command is done.
  bool carry_out(const ScriptCommand& command, Session& session, Wanted& wanted);
  bool is_over(const ScriptCommand& command, Session& session);
  Status apply(const ScriptCommand& command, Session& session);

  std::vector<ScriptCommand> commands_;
  std::string name_;
  size_t at_ = 0;
  bool begun_ = false;        // the command at_, which takes time
  double waited_s_ = 0;       // in it
  uint64_t frames_ = 0;       // in it
  uint64_t from_change_ = 0;  // when it began
};

}  // namespace figurine::emulator
