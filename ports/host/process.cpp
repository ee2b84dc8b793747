#include "ports/host/process.h"

#include <fcntl.h>
#include <signal.h>
#include <unistd.h>

#include <cerrno>
#include <cstdarg>
#include <cstdio>
#include <cstring>
#include <string>
#include <system_error>

namespace figurine::ports {

namespace {

const char* program_name = "figurine";

void write_from_handler(const char* text) {
  if (::write(STDERR_FILENO, text, std::strlen(text)) < 0) return;  // nobody is left to tell
}

// Only what a signal handler may do.
void end_of_cut_file(int signal, siginfo_t* info, void*) {
  if (info->si_code == BUS_ADRERR) {
    write_from_handler(program_name);
    write_from_handler(": an input file became shorter, or its disk failed, while it was read\n");
    ::_exit(1);
  }
  ::signal(signal, SIG_DFL);
  ::raise(signal);
}

}  // namespace

void prepare_process(const char* program) {
  program_name = program;
  for (int fd = 0; fd <= 2; ++fd) {
    if (::fcntl(fd, F_GETFD) >= 0 || errno != EBADF) continue;
    // Opened the wrong way round: to read what is nowhere, or to print there, stays an error.
    const int taken = ::open("/dev/null", fd == 0 ? O_WRONLY : O_RDONLY);
    if (taken > fd) ::close(taken);
  }
  ::signal(SIGXFSZ, SIG_IGN);
  struct sigaction action{};
  action.sa_sigaction = end_of_cut_file;
  action.sa_flags = SA_SIGINFO;
  ::sigaction(SIGBUS, &action, nullptr);
}

void say(const std::string& line) { std::fprintf(stderr, "%s: %s\n", program_name, line.c_str()); }

void sayf(const char* format, ...) {
  va_list arguments;
  va_start(arguments, format);
  char line[2048];
  std::vsnprintf(line, sizeof(line), format, arguments);
  va_end(arguments);
  say(line);
}

Status flush_standard_output() {
  errno = 0;
  if (std::fflush(stdout) == 0 && std::ferror(stdout) == 0) return {};
  const std::string reason = errno == 0 ? "" : ": " + std::generic_category().message(errno);
  return Status(StatusCode::kIo, "standard output: what was printed is lost" + reason);
}

}  // namespace figurine::ports
