// What a program does that is the only one of a machine: the kernel's first process, in a file
// system of its own in memory.
#pragma once

namespace figurine::bench {

// As process 1, shows /proc and /sys, and turns the machine off at the end. As any other process,
// nothing.
class Guest {
 public:
  Guest();
  ~Guest();
  Guest(const Guest&) = delete;
  Guest& operator=(const Guest&) = delete;
};

}  // namespace figurine::bench
