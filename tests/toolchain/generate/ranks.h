// Ranks as processes on this machine. They are forked before anything of LibTorch has run in the
// test's own process, which must stay so: a pool of threads does not survive a fork.
#pragma once

#include <gtest/gtest.h>
#include <netinet/in.h>
#include <poll.h>
#include <signal.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <functional>
#include <string>
#include <vector>

#include "toolchain/generate/process_group.h"
#include "toolchain/train/interrupt.h"

namespace figurine::tests {

inline double now_s() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

// A TCP port that nobody listens on now.
inline uint16_t free_port() {
  const int fd = socket(AF_INET, SOCK_STREAM, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET, address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t length = sizeof(address);
  EXPECT_EQ(bind(fd, reinterpret_cast<sockaddr*>(&address), length), 0);
  EXPECT_EQ(getsockname(fd, reinterpret_cast<sockaddr*>(&address), &length), 0);
  close(fd);
  return ntohs(address.sin_port);
}

class Ranks {
 public:
  // What a rank does; returns what it has to tell. Exceptions are told as "PeerLost: ...",
  // "Interrupted: ...", "InputError: ...".
  using Body = std::function<std::string(const generate::RankPlace&)>;

  Ranks(int size, const Body& body) : Ranks(size, size, body) {}
  // present < size: the last ranks never come.
  Ranks(int size, int present, const Body& body) : start_s_(now_s()) {
    const uint16_t port = free_port();
    for (int rank = 0; rank < present; ++rank) {
      int ends[2];
      if (pipe(ends) != 0) ADD_FAILURE() << "no pipe";
      const pid_t pid = fork();
      if (pid == 0) {
        dup2(ends[1], STDERR_FILENO);  // what it says counts as told, too
        const std::string text = told_by(body, {rank, size, "127.0.0.1", port});
        _exit(write(ends[1], text.data(), text.size()) == static_cast<ssize_t>(text.size()) ? 0
                                                                                            : 1);
      }
      close(ends[1]);
      children_.push_back({pid, ends[0]});
    }
  }
  ~Ranks() {
    for (const Child& child : children_) {
      if (child.pipe < 0) continue;
      kill(child.pid, SIGKILL), waitpid(child.pid, nullptr, 0), close(child.pipe);
    }
  }

  void send(int rank, int signal) const { kill(children_[static_cast<size_t>(rank)].pid, signal); }

  // What a rank had to tell; empty if it was killed. Fails, and kills it, if that takes longer.
  std::string wait(int rank, double limit_s = 60) {
    Child& child = children_[static_cast<size_t>(rank)];
    std::string text;
    const double end_s = now_s() + limit_s;
    char part[4096];
    for (;;) {
      pollfd waiting{child.pipe, POLLIN, 0};
      if (poll(&waiting, 1, static_cast<int>(1000 * std::max(0.0, end_s - now_s()))) == 0) {
        ADD_FAILURE() << "rank " << rank << " is not done after " << limit_s << " s";
        kill(child.pid, SIGKILL);
        break;
      }
      const ssize_t count = read(child.pipe, part, sizeof(part));
      if (count <= 0) break;
      text.append(part, static_cast<size_t>(count));
    }
    int status = 0;
    waitpid(child.pid, &status, 0);
    close(child.pipe);
    child.pipe = -1;
    if (WIFSIGNALED(status) && WTERMSIG(status) != SIGKILL)
      text += " [signal " + std::to_string(WTERMSIG(status)) + "]";
    return text;
  }

  std::vector<std::string> wait_for_all(double limit_s = 60) {
    std::vector<std::string> all;
    for (size_t rank = 0; rank < children_.size(); ++rank)
      all.push_back(wait(static_cast<int>(rank), limit_s));
    return all;
  }

  double seconds() const { return now_s() - start_s_; }

 private:
  struct Child {
    pid_t pid;
    int pipe;
  };

  static std::string told_by(const Body& body, const generate::RankPlace& place) {
    try {
      return body(place);
    } catch (const train::Interrupted& stopped) {
      return std::string("Interrupted: ") + stopped.what();
    } catch (const generate::PeerLost& lost) {
      return std::string("PeerLost: ") + lost.what();
    } catch (const InputError& error) {
      return std::string("InputError: ") + error.what();
    } catch (const std::exception& error) {
      return std::string("bug: ") + error.what();
    }
  }

  double start_s_;
  std::vector<Child> children_;
};

}  // namespace figurine::tests
