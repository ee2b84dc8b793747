#include "samples/common/pose_feed.h"

#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <nlohmann/json.hpp>

namespace figurine::samples {

namespace {

constexpr uint64_t kMostSaid = 10;  // malformed lines
constexpr int kLook_ms = 100;       // how soon the thread sees that it shall end

}  // namespace

class LineFeed::Source final : public PoseSource {
 public:
  explicit Source(const Skeleton& skeleton) : skeleton_(skeleton) {}
  Result<PoseView> next(double) override { return skeleton_.shown.view(); }

 private:
  const Skeleton& skeleton_;
};

LineFeed::~LineFeed() {
  stop_ = true;
  if (thread_.joinable()) thread_.join();
}

Result<std::unique_ptr<PoseSource>> LineFeed::source_for(const Body& body) {
  FIG_CHECK(!thread_.joinable(), "sources before start");
  auto at = std::find_if(skeletons_.begin(), skeletons_.end(), [&](const auto& skeleton) {
    return skeleton->joint_names == body.joint_names;
  });
  if (at == skeletons_.end()) {
    const StoredPose rest = rest_pose(body.joint_count());
    skeletons_.push_back(std::make_unique<Skeleton>(Skeleton{body.joint_names, rest, rest}));
    at = skeletons_.end() - 1;
  }
  return std::unique_ptr<PoseSource>(std::make_unique<Source>(**at));
}

void LineFeed::start() {
  thread_ = std::thread([this] { run(); });
}

void LineFeed::run() {
  std::string rest;
  while (!stop_ && read_some(rest)) {
  }
  const std::lock_guard lock(mutex_);
  at_end_ = true;
}

// Waits a little for bytes and takes the lines that are whole; false at the end.
bool LineFeed::read_some(std::string& rest) {
  const auto broke = [&] {
    const std::lock_guard lock(mutex_);
    broken_ = Status(StatusCode::kIo, options_.name + ": " + std::strerror(errno));
    return false;
  };
  pollfd waiting{.fd = options_.descriptor, .events = POLLIN, .revents = 0};
  const int ready = ::poll(&waiting, 1, kLook_ms);
  if (ready < 0 && errno != EINTR) return broke();
  if (ready <= 0) return true;
  char bytes[65536];
  const ssize_t count = ::read(options_.descriptor, bytes, sizeof(bytes));
  if (count < 0) return errno == EINTR || errno == EAGAIN ? true : broke();
  rest.append(bytes, static_cast<size_t>(count));
  take_lines(rest, count == 0);
  return count > 0;
}

// The line that the end cuts off is a line too.
void LineFeed::take_lines(std::string& rest, bool at_end) {
  size_t begin = 0;
  for (size_t end = 0; (end = rest.find('\n', begin)) != std::string::npos; begin = end + 1) {
    if (!skipping_) take_line(std::string_view(rest).substr(begin, end - begin));
    skipping_ = false;
  }
  rest.erase(0, begin);
  if (at_end && !skipping_) take_line(rest);
  if (rest.size() > kLongestLine) {
    if (!skipping_) take_line(rest);
    skipping_ = true;
    rest.clear();
  }
}

void LineFeed::take_line(std::string_view line) {
  if (line.find_first_not_of(" \t\r") == std::string_view::npos) return;
  const uint64_t now_ns = options_.now_ns();
  // Counted with its pose, below, so that who sees a line counted can see what it said.
  const std::string where = options_.name + ": line " + std::to_string(lines_ + 1);
  Status wrong;
  std::vector<StoredPose> poses;
  if (line.size() > kLongestLine)
    wrong = Status(StatusCode::kLimitExceeded, where + ": longer than a mebibyte");
  for (size_t s = 0; s < skeletons_.size() && wrong.ok(); ++s) {
    Result<StoredPose> pose = parse_pose_json(line, skeletons_[s]->joint_names, where);
    if (pose.ok()) {
      poses.push_back(std::move(*pose));
    } else {
      wrong = pose.status();
    }
  }
  uint64_t malformed = 0;
  {
    const std::lock_guard lock(mutex_);
    ++lines_;
    if (wrong.ok()) {
      for (size_t s = 0; s < poses.size(); ++s) skeletons_[s]->newest = std::move(poses[s]);
      newest_ns_ = now_ns;
      ++poses_;
    } else {
      malformed = ++malformed_;
    }
  }
  if (malformed == 0 || malformed > kMostSaid) return;
  options_.say(wrong.message() + (malformed == kMostSaid ? " (others are counted only)" : ""));
}

Status LineFeed::advance(uint64_t) {
  const std::lock_guard lock(mutex_);
  if (newest_ns_ && newest_ns_ != shown_ns_) {
    for (const auto& skeleton : skeletons_) {
      skeleton->shown.root_translation_m = skeleton->newest.root_translation_m;
      std::copy(skeleton->newest.rotations.begin(), skeleton->newest.rotations.end(),
                skeleton->shown.rotations.begin());
    }
    shown_ns_ = newest_ns_;
    return {};
  }
  ended_ = at_end_;
  return broken_;
}

nlohmann::ordered_json LineFeed::counts() const {
  const std::lock_guard lock(mutex_);
  return {{"lines", lines_}, {"poses", poses_}, {"malformed", malformed_}};
}

std::string LineFeed::summary() const {
  const std::lock_guard lock(mutex_);
  return std::to_string(poses_) + " poses in " + std::to_string(lines_) + " lines, " +
         std::to_string(malformed_) + " malformed";
}

}  // namespace figurine::samples
