#include "samples/common/pose_feed.h"

#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <nlohmann/json.hpp>

#include "samples/common/pose_record.h"

namespace figurine::samples {

namespace {

constexpr uint64_t kMostSaid = 10;  // malformed poses
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

// Waits a little for bytes and takes the poses that are whole; false at the end.
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
  take_all(rest, count == 0);
  return count > 0;
}

void LineFeed::take_all(std::string& rest, bool at_end) {
  size_t begin = 0;
  while (begin < rest.size()) {
    const size_t taken = take_first(std::string_view(rest).substr(begin), at_end);
    if (taken == 0) break;
    begin += taken;
  }
  rest.erase(0, begin);
}

// Of what is left: how many bytes were taken; 0: more have to come.
size_t LineFeed::take_first(std::string_view left, bool at_end) {
  if (skipping_) return skip(left);
  if (left[0] == kPoseRecordMagic[0]) return take_record(left, at_end);
  const size_t end = left.find('\n');
  if (end != std::string_view::npos) {
    take_line(left.substr(0, end));
    return end + 1;
  }
  if (!at_end && left.size() <= kLongestLine) return 0;
  take_line(left);  // what the end cuts off is a line too
  skipping_ = !at_end;
  return left.size();
}

size_t LineFeed::skip(std::string_view left) {
  const size_t line = left.find('\n'), record = left.find(kPoseRecordMagic);
  if (line == std::string_view::npos && record == std::string_view::npos) {
    // But for what may be the beginning of the next record.
    const size_t kept = std::min(left.size(), kPoseRecordMagic.size() - 1);
    return left.size() - kept;
  }
  skipping_ = false;
  return line < record ? line + 1 : record;
}

size_t LineFeed::take_record(std::string_view left, bool at_end) {
  const std::optional<size_t> size = pose_record_bytes(left);
  if (size && left.size() < *size && !at_end) return 0;
  const bool whole = size && left.size() >= *size;
  const std::string_view record = left.substr(0, whole ? *size : left.size());
  take_pose(records_, "record", [&](const Skeleton& skeleton, const std::string& where) {
    if (size && !whole)
      return Result<StoredPose>(
          Status(StatusCode::kInvalidArgument, where + ": the stream ends inside it"));
    return parse_pose_record(record, skeleton.joint_names.size(), where);
  });
  if (size) return record.size();
  skipping_ = true;
  return 1;  // past its beginning
}

void LineFeed::take_line(std::string_view line) {
  if (line.find_first_not_of(" \t\r") == std::string_view::npos) return;
  take_pose(lines_, "line", [&](const Skeleton& skeleton, const std::string& where) {
    if (line.size() > kLongestLine)
      return Result<StoredPose>(
          Status(StatusCode::kLimitExceeded, where + ": longer than a mebibyte"));
    return parse_pose_json(line, skeleton.joint_names, where);
  });
}

// count: of what it is one of. Counted with its pose, so that who sees it counted can see what it
// said.
void LineFeed::take_pose(uint64_t& count, const char* what, const Parse& parse) {
  const uint64_t now_ns = options_.now_ns();
  const std::string where = options_.name + ": " + what + " " + std::to_string(count + 1);
  Status wrong;
  std::vector<StoredPose> poses;
  for (size_t s = 0; s < skeletons_.size() && wrong.ok(); ++s) {
    Result<StoredPose> pose = parse(*skeletons_[s], where);
    if (pose.ok()) {
      poses.push_back(std::move(*pose));
    } else {
      wrong = pose.status();
    }
  }
  // Said before it is counted: who sees it counted can read what was said. No other thread writes
  // the number.
  if (!wrong.ok() && malformed_ < kMostSaid) {
    const bool last = malformed_ + 1 == kMostSaid;
    options_.say(wrong.message() + (last ? " (others are counted only)" : ""));
  }
  const std::lock_guard lock(mutex_);
  ++count;
  if (!wrong.ok()) {
    ++malformed_;
    return;
  }
  for (size_t s = 0; s < poses.size(); ++s) skeletons_[s]->newest = std::move(poses[s]);
  newest_ns_ = now_ns;
  ++poses_;
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
  return {{"lines", lines_}, {"records", records_}, {"poses", poses_}, {"malformed", malformed_}};
}

std::string LineFeed::summary() const {
  const std::lock_guard lock(mutex_);
  std::string in = std::to_string(lines_) + " lines";
  if (records_ > 0) in = (lines_ > 0 ? in + " and " : "") + std::to_string(records_) + " records";
  return std::to_string(poses_) + " poses in " + in + ", " + std::to_string(malformed_) +
         " malformed";
}

}  // namespace figurine::samples
