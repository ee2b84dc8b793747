// What every program does first and last, so that a full disk, a closed terminal or a lost output
// is an error with a line, and not silence.
#pragma once

#include <string>

#include "figurine/status.h"

namespace figurine::ports {

// Call first. program: for a message, must stay. Afterwards
// - the descriptors 0, 1 and 2 are taken (a file that the program opens cannot become its standard
//   output; what was closed fails when it is used);
// - a file that grows beyond the limit of its size is an error of write() (EFBIG), not a signal;
// - a mapped file that somebody else cuts short ends the process with one line and exit code 1.
void prepare_process(const char* program);

// A line on standard error, behind the program's name: what a program says of its work.
// What was asked for goes to standard output (docs/command_line.md).
void say(const std::string& line);
// The same as printf has it, without the end of the line.
void sayf(const char* format, ...) __attribute__((format(printf, 1, 2)));

// Call last: whether all that was printed on the standard output has arrived where it goes. kIo if
// not (a full disk, /dev/full, a closed descriptor).
Status flush_standard_output();

}  // namespace figurine::ports
