#include "toolchain/body/bvh.h"

#include <charconv>
#include <cmath>
#include <fstream>
#include <optional>

#include "toolchain/error.h"

namespace figurine::body {
namespace {

constexpr size_t kMaxJoints = 1024;
constexpr size_t kMaxDepth = 64;
constexpr size_t kMaxValues = size_t{1} << 26;
constexpr double kMaxMagnitude = 1e6;
constexpr std::streamoff kMaxFileBytes = std::streamoff{1} << 29;

// Words of the file with their line, for messages.
class Scanner {
 public:
  Scanner(std::string_view text, const std::string& where) : text_(text), where_(where) {}

  [[noreturn]] void fail(const std::string& reason) const {
    throw InputError(where_ + ": line " + std::to_string(line_) + ": " + reason);
  }

  std::string_view word() {
    while (at_ < text_.size() && is_space(text_[at_])) line_ += text_[at_++] == '\n';
    const size_t start = at_;
    while (at_ < text_.size() && !is_space(text_[at_])) ++at_;
    if (start == at_) fail("the file ends early");
    return text_.substr(start, at_ - start);
  }
  bool done() {
    while (at_ < text_.size() && is_space(text_[at_])) line_ += text_[at_++] == '\n';
    return at_ == text_.size();
  }
  void expect(std::string_view wanted) {
    const std::string_view got = word();
    if (got != wanted)
      fail("\"" + excerpt(got) + "\" where " + std::string(wanted) + " was expected");
  }
  double number() {
    const std::string_view text = word();
    double value = 0;
    const char* first = text.data() + (text.front() == '+' ? 1 : 0);
    const auto [end, error] = std::from_chars(first, text.data() + text.size(), value);
    if (error != std::errc() || end != text.data() + text.size())
      fail("\"" + excerpt(text) + "\" is no number");
    if (!(std::abs(value) <= kMaxMagnitude)) fail("\"" + excerpt(text) + "\" is out of range");
    return value;
  }
  uint64_t count() {
    const std::string_view text = word();
    uint64_t value = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (error != std::errc() || end != text.data() + text.size())
      fail("\"" + excerpt(text) + "\" is no count");
    return value;
  }
  static std::string excerpt(std::string_view text) { return std::string(text.substr(0, 40)); }

 private:
  static bool is_space(char c) { return c == ' ' || c == '\n' || c == '\r' || c == '\t'; }
  std::string_view text_;
  std::string where_;
  size_t at_ = 0;
  size_t line_ = 1;
};

std::optional<BvhChannel> channel_of(std::string_view name) {
  constexpr std::array<std::string_view, 6> kNames = {"Xposition", "Yposition", "Zposition",
                                                      "Xrotation", "Yrotation", "Zrotation"};
  for (size_t i = 0; i < kNames.size(); ++i) {
    if (name == kNames[i]) return static_cast<BvhChannel>(i);
  }
  return std::nullopt;
}

std::array<double, 3> vector_of(Scanner& in) {
  std::array<double, 3> out{};
  for (double& value : out) value = in.number();
  return out;
}

void parse_channels(Scanner& in, Bvh& bvh, BvhJoint& joint) {
  if (!joint.channels.empty()) in.fail("two CHANNELS of " + joint.name);
  const uint64_t count = in.count();
  if (count > 6) in.fail("more than 6 channels");
  joint.first_channel = bvh.channel_count;
  for (uint64_t i = 0; i < count; ++i) {
    const std::string_view name = in.word();
    const std::optional<BvhChannel> channel = channel_of(name);
    if (!channel) in.fail("\"" + Scanner::excerpt(name) + "\" is no channel");
    joint.channels.push_back(*channel);
  }
  bvh.channel_count += count;
}

// Opens a joint: its name, brace and offset.
void begin_joint(Scanner& in, Bvh& bvh, std::vector<int>& open) {
  if (bvh.joints.size() == kMaxJoints) in.fail("more than 1024 joints");
  if (open.size() == kMaxDepth) in.fail("joints nested deeper than 64");
  BvhJoint joint;
  joint.name = Scanner::excerpt(in.word());
  joint.parent = open.empty() ? -1 : open.back();
  in.expect("{");
  open.push_back(static_cast<int>(bvh.joints.size()));
  bvh.joints.push_back(std::move(joint));
}

void parse_hierarchy(Scanner& in, Bvh& bvh) {
  in.expect("HIERARCHY");
  in.expect("ROOT");
  std::vector<int> open;  // an explicit stack: nesting costs no recursion
  begin_joint(in, bvh, open);
  while (!open.empty()) {
    const std::string_view word = in.word();
    BvhJoint& joint = bvh.joints[static_cast<size_t>(open.back())];
    if (word == "OFFSET") {
      joint.offset = vector_of(in);
    } else if (word == "CHANNELS") {
      parse_channels(in, bvh, joint);
    } else if (word == "JOINT") {
      begin_joint(in, bvh, open);
    } else if (word == "End") {
      in.expect("Site");
      in.expect("{");
      in.expect("OFFSET");
      joint.end_offset = vector_of(in);
      joint.has_end = true;
      in.expect("}");
    } else if (word == "}") {
      open.pop_back();
    } else {
      in.fail("\"" + Scanner::excerpt(word) + "\" in a joint");
    }
  }
}

void parse_motion(Scanner& in, Bvh& bvh) {
  in.expect("MOTION");
  in.expect("Frames:");
  const uint64_t frames = in.count();
  if (frames == 0) in.fail("no frames");
  if (bvh.channel_count == 0) in.fail("no channels");
  if (frames > kMaxValues / bvh.channel_count) in.fail("more than 2^26 values");
  in.expect("Frame");
  in.expect("Time:");
  bvh.frame_time_s = in.number();
  if (!(bvh.frame_time_s >= 1e-3 && bvh.frame_time_s <= 1))
    in.fail("frame time: not within 1 ms and 1 s");
  bvh.frame_count = static_cast<uint32_t>(frames);
  // Grown as values arrive: the count in the file allocates nothing by itself.
  for (uint64_t i = 0; i < frames * bvh.channel_count; ++i)
    bvh.values.push_back(static_cast<float>(in.number()));
  if (!in.done()) in.fail("more values than " + std::to_string(frames) + " frames hold");
}

}  // namespace

int Bvh::find(const std::string& joint_name) const {
  for (size_t j = 0; j < joints.size(); ++j) {
    if (joints[j].name == joint_name) return static_cast<int>(j);
  }
  return -1;
}

Bvh parse_bvh(std::string_view text, const std::string& where) {
  Scanner in(text, where);
  Bvh bvh;
  bvh.where = where;
  parse_hierarchy(in, bvh);
  parse_motion(in, bvh);
  return bvh;
}

Bvh read_bvh(const std::string& path) {
  std::ifstream file(path, std::ios::binary | std::ios::ate);
  if (!file) throw InputError(path + ": cannot be read");
  const std::streamoff size = file.tellg();
  if (size < 0 || size > kMaxFileBytes) throw InputError(path + ": larger than 512 MiB");
  std::string text(static_cast<size_t>(size), '\0');
  file.seekg(0);
  file.read(text.data(), size);
  if (!file) throw InputError(path + ": cannot be read to its end");
  return parse_bvh(text, path);
}

}  // namespace figurine::body
