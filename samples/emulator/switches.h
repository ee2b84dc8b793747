// What a frame may leave out, as switches with names: those that change no bit of the picture
// (LeaveOut), and those that show (Approximation), or are there to show (keep_to_known). A table; a
// new field of any is a row here.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "figurine/frame.h"
#include "figurine/status.h"

namespace figurine::emulator {

// What a picture is drawn with.
struct Settings {
  LeaveOut leave_out;
  Approximation approximation;
  bool keep_to_known = false;  // FrameAvatar's, of every figure
  friend bool operator==(const Settings& a, const Settings& b);
};

// Everything computed: what the others are measured against.
Settings dense_settings();

struct Switch {
  const char* name;     // in scripts: "hidden-texels"
  const char* label;    // on the screen
  const char* meaning;  // a sentence
  bool exact;           // changes no bit of the picture
  // off: nothing is left out. tried: what is measured while it is off, and what "on" means. A
  // switch whose values are only those two has no scale.
  double off, tried;
  bool scale;
  double least, most;  // of a scale
  const char* format;  // of a scale's value, printf's
  double (*get)(const Settings&);
  void (*set)(Settings&, double);

  bool on(const Settings& settings) const { return get(settings) != off; }
};

std::span<const Switch> switches();
// Null if there is none of this name.
const Switch* find_switch(std::string_view name);

// "on", "off" or, of a scale, a number. kInvalidArgument names the switch and what it takes.
Status set_switch(Settings& settings, const std::string& name, const std::string& value);

}  // namespace figurine::emulator
