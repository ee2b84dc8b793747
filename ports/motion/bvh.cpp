#include "ports/motion/bvh.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <optional>

namespace figurine::ports {
namespace {

constexpr size_t kMaxJoints = 1024;
constexpr size_t kMaxDepth = 64;
constexpr size_t kMaxValues = size_t{1} << 26;
constexpr double kMaxMagnitude = 1e6;
constexpr size_t kLongestName = 128;

char lower(char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c + 32) : c; }

bool same_word(std::string_view a, std::string_view b) {
  if (a.size() != b.size()) return false;
  for (size_t i = 0; i < a.size(); ++i) {
    if (lower(a[i]) != lower(b[i])) return false;
  }
  return true;
}

// Text of the file for a message: short and printable.
std::string excerpt(std::string_view text) {
  std::string out(text.substr(0, 40));
  for (char& c : out) {
    if (c < ' ' || c > '~') c = '?';
  }
  return out;
}

// Words of the file with their line. After the first error every call is harmless and says nothing
// new, so that parsers look at ok() where they loop and where they end.
class Scanner {
 public:
  Scanner(std::string_view text, const std::string& where) : text_(text), where_(where) {
    if (text_.starts_with("\xEF\xBB\xBF")) at_ = 3;
  }

  bool ok() const { return status_.ok(); }
  const Status& status() const { return status_; }
  std::string reason() const {  // without the file
    return ok() ? "" : status_.message().substr(where_.size() + 2);
  }
  void fail(const std::string& reason) {
    if (ok()) {
      status_ =
          Status(StatusCode::kCorrupt, where_ + ": line " + std::to_string(line_) + ": " + reason);
    }
  }

  // The next word; '{' and '}' are words of their own.
  std::string_view word() {
    skip_space();
    const size_t start = at_;
    while (at_ < text_.size() && !is_space(text_[at_]) && (at_ == start || !is_brace(text_[at_]))) {
      ++at_;
      if (is_brace(text_[start])) break;
    }
    if (start == at_) fail("the file ends early");
    return ok() ? text_.substr(start, at_ - start) : std::string_view();
  }
  // What is left of the line, or of it before a brace, without blanks around it.
  std::string name() {
    while (at_ < text_.size() && is_space(text_[at_]) && !is_line_end(text_[at_])) ++at_;
    const size_t start = at_;
    while (at_ < text_.size() && !is_line_end(text_[at_]) && !is_brace(text_[at_])) ++at_;
    size_t end = at_;
    while (end > start && is_space(text_[end - 1])) --end;
    return std::string(text_.substr(start, std::min(end - start, kLongestName)));
  }
  bool done() {
    skip_space();
    return at_ == text_.size();
  }
  void expect(std::string_view wanted) {
    const std::string_view got = word();
    if (ok() && !same_word(got, wanted))
      fail("\"" + excerpt(got) + "\" where " + std::string(wanted) + " was expected");
  }
  // "Frames:" with or without blanks around the colon.
  void expect_label(std::string_view wanted) {
    skip_space();
    if (!same_word(text_.substr(at_, wanted.size()), wanted)) {
      const std::string_view got = word();
      if (ok()) fail("\"" + excerpt(got) + "\" where " + std::string(wanted) + " was expected");
      return;
    }
    at_ += wanted.size();
    skip_blanks();
  }
  void expect_colon() {
    skip_blanks();
    if (ok() && (at_ == text_.size() || text_[at_] != ':')) return fail("a colon was expected");
    ++at_;
  }
  double number() { return number_of(word()); }
  double number_of(std::string_view text) {
    if (!ok()) return 0;
    double value = 0;
    const char* first = text.data() + (text.front() == '+' ? 1 : 0);
    const auto [end, error] = std::from_chars(first, text.data() + text.size(), value);
    if (end != text.data() + text.size() || error == std::errc::invalid_argument) {
      fail("\"" + excerpt(text) + "\" is no number");
    } else if (error != std::errc() || !(std::abs(value) <= kMaxMagnitude)) {
      fail("\"" + excerpt(text) + "\" is out of range");
    }
    return ok() ? value : 0;
  }
  uint64_t count() {
    const std::string_view text = word();
    uint64_t value = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (ok() && (error != std::errc() || end != text.data() + text.size()))
      fail("\"" + excerpt(text) + "\" is no count");
    return value;
  }

  // The numbers of one line of the text, to its end. Lines of blanks alone are passed over; an
  // empty view: the text has ended.
  std::string_view line() {
    skip_space();
    const size_t start = at_;
    while (at_ < text_.size() && !is_line_end(text_[at_])) ++at_;
    return text_.substr(start, at_ - start);
  }

  bool ends_with(std::string_view line) const {
    return line.data() + line.size() == text_.data() + text_.size();
  }

  static bool is_space(char c) { return c == ' ' || c == '\t' || is_line_end(c); }

 private:
  static bool is_line_end(char c) { return c == '\n' || c == '\r'; }
  static bool is_brace(char c) { return c == '{' || c == '}'; }
  void skip_blanks() {
    while (at_ < text_.size() && (text_[at_] == ' ' || text_[at_] == '\t')) ++at_;
  }
  void skip_space() {
    for (; at_ < text_.size() && is_space(text_[at_]); ++at_) {
      // An old Macintosh ends lines with '\r' alone.
      line_ += text_[at_] == '\n' ||
               (text_[at_] == '\r' && (at_ + 1 == text_.size() || text_[at_ + 1] != '\n'));
    }
  }

  std::string_view text_;
  std::string where_;
  Status status_;
  size_t at_ = 0;
  size_t line_ = 1;
};

std::optional<BvhChannel> channel_of(std::string_view name) {
  constexpr std::array<std::string_view, 6> kNames = {"Xposition", "Yposition", "Zposition",
                                                      "Xrotation", "Yrotation", "Zrotation"};
  for (size_t i = 0; i < kNames.size(); ++i) {
    if (same_word(name, kNames[i])) return static_cast<BvhChannel>(i);
  }
  return std::nullopt;
}

std::array<double, 3> vector_of(Scanner& in) {
  std::array<double, 3> out{};
  for (double& value : out) value = in.number();
  return out;
}

void parse_channels(Scanner& in, Bvh& bvh, BvhJoint& joint) {
  if (!joint.channels.empty()) return in.fail("two CHANNELS of " + excerpt(joint.name));
  const uint64_t count = in.count();
  if (count > 6) return in.fail("more than 6 channels");
  joint.first_channel = bvh.channel_count;
  for (uint64_t i = 0; i < count && in.ok(); ++i) {
    const std::string_view name = in.word();
    const std::optional<BvhChannel> channel = channel_of(name);
    if (!channel) return in.fail("\"" + excerpt(name) + "\" is no channel");
    joint.channels.push_back(*channel);
  }
  bvh.channel_count += count;
}

// Opens a joint: its name, brace and offset.
void begin_joint(Scanner& in, Bvh& bvh, std::vector<int>& open) {
  if (bvh.joints.size() == kMaxJoints) return in.fail("more than 1024 joints");
  if (open.size() == kMaxDepth) return in.fail("joints nested deeper than 64");
  BvhJoint joint;
  joint.name = in.name();
  joint.parent = open.empty() ? -1 : open.back();
  in.expect("{");
  open.push_back(static_cast<int>(bvh.joints.size()));
  bvh.joints.push_back(std::move(joint));
}

void parse_root(Scanner& in, Bvh& bvh) {
  std::vector<int> open;  // an explicit stack: nesting costs no recursion
  begin_joint(in, bvh, open);
  while (!open.empty() && in.ok()) {
    const std::string_view word = in.word();
    BvhJoint& joint = bvh.joints[static_cast<size_t>(open.back())];
    if (same_word(word, "OFFSET")) {
      joint.offset = vector_of(in);
    } else if (same_word(word, "CHANNELS")) {
      parse_channels(in, bvh, joint);
    } else if (same_word(word, "JOINT")) {
      begin_joint(in, bvh, open);
    } else if (same_word(word, "End")) {
      (void)in.name();  // "Site", and whatever an exporter calls it
      in.expect("{");
      in.expect("OFFSET");
      joint.end_offset = vector_of(in);
      joint.has_end = true;
      in.expect("}");
    } else if (word == "}") {
      open.pop_back();
    } else {
      in.fail("\"" + excerpt(word) + "\" in a joint");
    }
  }
}

// Roots up to MOTION.
void parse_hierarchy(Scanner& in, Bvh& bvh) {
  in.expect("HIERARCHY");
  in.expect("ROOT");
  parse_root(in, bvh);
  while (in.ok()) {
    const std::string_view word = in.word();
    if (same_word(word, "MOTION")) return;
    if (!same_word(word, "ROOT")) {
      if (in.ok()) in.fail("\"" + excerpt(word) + "\" where MOTION was expected");
      return;
    }
    parse_root(in, bvh);
  }
}

// Values of one line, appended: as many as there are channels.
void parse_line(Scanner& in, std::string_view line, Bvh& bvh) {
  size_t at = 0, count = 0;
  while (true) {
    while (at < line.size() && Scanner::is_space(line[at])) ++at;
    if (at == line.size()) break;
    const size_t start = at;
    while (at < line.size() && !Scanner::is_space(line[at])) ++at;
    bvh.values.push_back(static_cast<float>(in.number_of(line.substr(start, at - start))));
    if (!in.ok()) return;
    ++count;
  }
  if (count != bvh.channel_count) {
    in.fail(std::to_string(count) + " values, the hierarchy has " +
            std::to_string(bvh.channel_count) + " channels");
  }
}

// Values however they are spread over lines, as some tools wrap them.
void parse_wrapped(Scanner& in, std::string_view first, Bvh& bvh, uint64_t frames) {
  Scanner line(first, "");
  while (in.ok() && !line.done())
    bvh.values.push_back(static_cast<float>(in.number_of(line.word())));
  while (in.ok() && bvh.values.size() < frames * bvh.channel_count)
    bvh.values.push_back(static_cast<float>(in.number()));
  if (in.ok() && !in.done()) in.fail("more values than " + std::to_string(frames) + " frames hold");
}

size_t words_of(std::string_view line) {
  size_t words = 0;
  for (size_t i = 0; i < line.size(); ++i)
    words += !Scanner::is_space(line[i]) && (i == 0 || Scanner::is_space(line[i - 1]));
  return words;
}

void parse_values(Scanner& in, Bvh& bvh, uint64_t frames) {
  const std::string_view first = in.line();
  if (words_of(first) < bvh.channel_count && words_of(first) > 0) {
    // Fewer values than channels: wrapped lines, unless a value is missing, which the end tells.
    Scanner ahead = in;
    const size_t second = words_of(ahead.line());
    if (second != bvh.channel_count) {
      Scanner before = in;
      parse_wrapped(in, first, bvh, frames);
      if (in.ok()) return;
      before.fail(std::to_string(words_of(first)) + " values, the hierarchy has " +
                  std::to_string(bvh.channel_count) +
                  " channels (read on over lines: " + in.reason() + ")");
      in = before;
      return;
    }
  }
  // Grown as values arrive: the count in the file allocates nothing by itself.
  uint64_t read = 0;
  std::string_view line = first;
  for (; read < frames && !line.empty(); ++read, line = in.line()) {
    // A line without an end, before the last frame or short: a recorder was killed in it, and its
    // last number may be half of one.
    const bool is_cut =
        read > 0 && in.ends_with(line) && (read + 1 < frames || words_of(line) < bvh.channel_count);
    if (is_cut) {
      line = {};
      break;
    }
    parse_line(in, line, bvh);
    if (!in.ok()) return;
  }
  if (!in.ok()) return;
  if (!line.empty() && read == frames)
    return in.fail("more values than the " + std::to_string(frames) +
                   " frames that the header says");
  if (read == 0) return in.fail("the file ends early");
  if (read < frames) {
    bvh.note = "the header says " + std::to_string(frames) + " frames, the file holds " +
               std::to_string(read);
  }
  bvh.frame_count = static_cast<uint32_t>(read);
}

void parse_motion(Scanner& in, Bvh& bvh) {
  in.expect_label("Frames");
  in.expect_colon();
  const uint64_t frames = in.count();
  if (!in.ok()) return;
  if (frames == 0) return in.fail("no frames");
  if (bvh.channel_count == 0) return in.fail("no channels");
  if (frames > kMaxValues / bvh.channel_count) return in.fail("more than 2^26 values");
  in.expect_label("Frame");
  in.expect_label("Time");
  in.expect_colon();
  const std::string_view time = in.word();
  if (!in.ok()) return;
  double seconds = 0;
  const auto [end, error] = std::from_chars(time.data(), time.data() + time.size(), seconds);
  if (error == std::errc() && end == time.data() + time.size() && seconds >= 1e-3 && seconds <= 1)
    bvh.frame_time_s = seconds;
  bvh.frame_count = static_cast<uint32_t>(frames);
  parse_values(in, bvh, frames);
}

}  // namespace

int Bvh::find(const std::string& joint_name) const {
  for (size_t j = 0; j < joints.size(); ++j) {
    if (joints[j].name == joint_name) return static_cast<int>(j);
  }
  return -1;
}

Result<Bvh> parse_bvh(std::string_view text, const std::string& where) {
  if (text.starts_with("\xFF\xFE") || text.starts_with("\xFE\xFF")) {
    return Status(StatusCode::kUnsupported,
                  where + ": line 1: UTF-16 text: save it as UTF-8 or ASCII");
  }
  Scanner in(text, where);
  Bvh bvh;
  bvh.where = where;
  parse_hierarchy(in, bvh);
  if (in.ok()) parse_motion(in, bvh);
  if (!in.ok()) return in.status();
  return bvh;
}

}  // namespace figurine::ports
