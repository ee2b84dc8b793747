// Poses that come from outside while the program runs: one stream for all figures of a scene, read
// by a thread of its own so that the moment of arrival is known. The loop that draws asks once a
// frame for what is newest; what came between two frames is not shown.
//
// Here: a line of JSON a pose, or a record of bytes. From a performer over the network: vmc_feed.h.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "figurine/body.h"
#include "ports/host/process.h"
#include "samples/common/pose_json.h"
#include "samples/common/pose_source.h"

namespace figurine::samples {

class PoseFeed {
 public:
  virtual ~PoseFeed() = default;
  PoseFeed(const PoseFeed&) = delete;
  PoseFeed& operator=(const PoseFeed&) = delete;

  // The stream as a figure sees it, which must not outlive the feed. Before start(). Error: the
  // body's joints are not the stream's.
  virtual Result<std::unique_ptr<PoseSource>> source_for(const Body& body) = 0;
  // Begins to listen.
  virtual void start() = 0;
  // Makes what is newest now that which all sources give. Error: the stream broke. Once a frame.
  virtual Status advance(uint64_t now_ns) = 0;
  // When the pose that the sources give arrived; none: it is still the one of the beginning.
  virtual std::optional<uint64_t> arrived_ns() const = 0;
  // Nothing can come any more, and the sources gave the last one.
  virtual bool ended() const = 0;
  // What was counted, for --json, and for people in a line.
  virtual nlohmann::ordered_json counts() const = 0;
  virtual std::string summary() const = 0;

 protected:
  PoseFeed() = default;
};

// Lines of JSON (pose_json.h) and records (pose_record.h) from a descriptor, mixed as they come,
// each a whole pose for every figure. What is no pose is counted and said, the first ten of them,
// and the pose before it stays; a line of nothing but blanks is none. Behind what cannot be read on
// from (a line too long, a record that is none), the next end of a line or record begins anew.
class LineFeed final : public PoseFeed {
 public:
  static constexpr size_t kLongestLine = 1 << 20;  // bytes; longer ones are no poses
  struct Options {
    int descriptor = 0;  // the caller's to close
    std::string name = "standard input";
    void (*say)(const std::string& line) = ports::say;
    uint64_t (*now_ns)();  // of arrivals
  };
  explicit LineFeed(const Options& options) : options_(options) {}
  ~LineFeed() override;

  Result<std::unique_ptr<PoseSource>> source_for(const Body& body) override;
  void start() override;
  Status advance(uint64_t now_ns) override;
  std::optional<uint64_t> arrived_ns() const override { return shown_ns_; }
  bool ended() const override { return ended_; }
  nlohmann::ordered_json counts() const override;
  std::string summary() const override;

 private:
  class Source;
  // Figures whose bodies have the same joints share a pose.
  struct Skeleton {
    std::vector<std::string> joint_names;
    StoredPose newest, shown;
  };
  void run();
  bool read_some(std::string& rest);
  void take_all(std::string& rest, bool at_end);
  size_t take_first(std::string_view left, bool at_end);
  size_t skip(std::string_view left);
  size_t take_record(std::string_view left, bool at_end);
  void take_line(std::string_view line);
  using Parse = std::function<Result<StoredPose>(const Skeleton&, const std::string& where)>;
  void take_pose(uint64_t& count, const char* what, const Parse& parse);

  Options options_;
  std::vector<std::unique_ptr<Skeleton>> skeletons_;
  std::optional<uint64_t> shown_ns_;
  bool ended_ = false;
  bool skipping_ = false;  // inside what cannot be read

  mutable std::mutex mutex_;  // of all that follows, and of Skeleton::newest
  std::optional<uint64_t> newest_ns_;
  bool at_end_ = false;
  Status broken_;
  uint64_t lines_ = 0, records_ = 0, poses_ = 0, malformed_ = 0;

  std::atomic<bool> stop_{false};
  std::thread thread_;
};

}  // namespace figurine::samples
