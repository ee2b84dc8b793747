// OSC packets: every type comes back as it was written, and no wrong packet gives a message or
// reads past its end. Packets lie at the end of a page behind which nothing may be read.
#include "ports/vmc/osc.h"

#include <gtest/gtest.h>
#include <sys/mman.h>
#include <unistd.h>

#include <cmath>
#include <cstring>
#include <limits>
#include <string>
#include <vector>

#include "ports/vmc/osc_writer.h"

namespace figurine::ports::osc_test {
namespace {

using tests::OscWriter;

struct Noted {
  std::string address, tags;
  std::vector<OscArgument> arguments;
  std::vector<std::string> texts;
};

struct Notes final : OscVisitor {
  std::vector<Noted> messages;
  void message(OscMessage message) override {
    Noted noted{std::string(message.address()), std::string(message.tags()), {}, {}};
    OscArgument argument;
    while (message.next(argument)) {
      noted.texts.emplace_back(argument.text);
      argument.text = {};
      noted.arguments.push_back(argument);
    }
    messages.push_back(std::move(noted));
  }
};

// Two pages, the second of which kills who touches it; a packet ends where the first one does.
class GuardedBytes {
 public:
  explicit GuardedBytes(size_t capacity)
      : page_(static_cast<size_t>(::sysconf(_SC_PAGESIZE))),
        usable_((capacity + page_ - 1) / page_ * page_) {
    base_ = static_cast<char*>(::mmap(nullptr, usable_ + page_, PROT_READ | PROT_WRITE,
                                      MAP_PRIVATE | MAP_ANONYMOUS, -1, 0));
    EXPECT_EQ(::mprotect(base_ + usable_, page_, PROT_NONE), 0);
  }
  ~GuardedBytes() { ::munmap(base_, usable_ + page_); }
  std::span<const std::byte> put(std::string_view bytes) {
    char* begin = base_ + usable_ - bytes.size();
    std::memcpy(begin, bytes.data(), bytes.size());
    return std::as_bytes(std::span(begin, bytes.size()));
  }

 private:
  size_t page_, usable_;
  char* base_ = nullptr;
};

const char* read(const std::string& bytes, Notes& notes) {
  static GuardedBytes guarded(1 << 17);
  return read_osc(guarded.put(bytes), notes);
}

std::string wrong(const std::string& bytes) {
  Notes notes;
  const char* reason = read(bytes, notes);
  EXPECT_NE(reason, nullptr);
  EXPECT_TRUE(notes.messages.empty()) << "a wrong packet is not taken in part";
  return reason == nullptr ? "" : reason;
}

OscWriter bone(std::string_view name, float w) {
  OscWriter writer;
  writer.message("/VMC/Ext/Bone/Pos", "sfffffff").text(name);
  for (const float value : {0.1f, 0.2f, 0.3f, 0.0f, 0.0f, 0.0f, w}) writer.real(value);
  return writer;
}

TEST(Osc, EveryTypeComesBack) {
  OscWriter writer;
  writer.message("/a", "ifsbTFNIhdt").word(0xFFFFFFFE).real(-0.25f).text("four");
  writer.blob(std::string("\x00\x01\x02", 3));
  writer.long_word(0xFFFFFFFFFFFFFFFD).long_word(0x4000000000000000).long_word(5);
  Notes notes;
  ASSERT_EQ(read(writer.bytes(), notes), nullptr);
  ASSERT_EQ(notes.messages.size(), 1u);
  const Noted& got = notes.messages[0];
  EXPECT_EQ(got.address, "/a");
  ASSERT_EQ(got.arguments.size(), 11u);
  EXPECT_EQ(got.arguments[0].number, -2);
  EXPECT_EQ(got.arguments[1].number, -0.25);
  EXPECT_EQ(got.texts[2], "four");
  EXPECT_EQ(got.texts[3], std::string("\x00\x01\x02", 3));
  for (size_t i = 0; i < 4; ++i) EXPECT_EQ(got.arguments[4 + i].tag, "TFNI"[i]);
  EXPECT_EQ(got.arguments[8].number, -3);
  EXPECT_EQ(got.arguments[9].number, 2.0);
  EXPECT_EQ(got.arguments[10].number, 5);
}

TEST(Osc, NumbersThatAreNoneComeAsTheyAre) {
  OscWriter writer;
  writer.message("/a", "ffd").real(std::numeric_limits<float>::quiet_NaN());
  writer.real(std::numeric_limits<float>::infinity()).long_word(0x7FF8000000000000);
  Notes notes;
  ASSERT_EQ(read(writer.bytes(), notes), nullptr);
  EXPECT_TRUE(std::isnan(notes.messages[0].arguments[0].number));
  EXPECT_TRUE(std::isinf(notes.messages[0].arguments[1].number));
  EXPECT_TRUE(std::isnan(notes.messages[0].arguments[2].number));
}

TEST(Osc, BundlesAreReadInOrderAndInBundles) {
  OscWriter inner, outer;
  inner.bundle().element(bone("Spine", 2)).element(bone("Chest", 3));
  outer.bundle().element(bone("Hips", 1)).element(inner).element(bone("Neck", 4));
  Notes notes;
  ASSERT_EQ(read(outer.bytes(), notes), nullptr);
  ASSERT_EQ(notes.messages.size(), 4u);
  for (size_t i = 0; i < 4; ++i) EXPECT_EQ(notes.messages[i].arguments[7].number, 1.0 + double(i));
  Notes none;
  EXPECT_EQ(read(OscWriter().bundle().bytes(), none), nullptr) << "an empty bundle is one";
  EXPECT_TRUE(none.messages.empty());
}

TEST(Osc, BundlesEndAtADepth) {
  for (int depth = 1; depth < 40; ++depth) {
    OscWriter packet = bone("Hips", 1);
    for (int i = 0; i < depth; ++i) {
      OscWriter around;
      around.bundle().element(packet);
      packet = around;
    }
    Notes notes;
    const char* reason = read(packet.bytes(), notes);
    EXPECT_EQ(reason == nullptr, depth <= kOscDepth) << depth;
    EXPECT_EQ(notes.messages.size(), depth <= kOscDepth ? 1u : 0u);
  }
}

TEST(Osc, AMessageWithoutTagsHasNoArguments) {
  Notes notes;
  ASSERT_EQ(read(OscWriter().text("/VMC/Ext/Blend/Apply").bytes(), notes), nullptr);
  ASSERT_EQ(notes.messages.size(), 1u);
  EXPECT_TRUE(notes.messages[0].arguments.empty());
  EXPECT_EQ(wrong(OscWriter().text("/a").word(7).bytes()), "no type tags");
}

TEST(Osc, WrongPacketsGiveNothing) {
  EXPECT_EQ(wrong(""), "a size that is no multiple of four");
  EXPECT_EQ(wrong("/ab"), "a size that is no multiple of four");
  EXPECT_EQ(wrong("/abc"), "an address without end");
  EXPECT_EQ(wrong("abcdefgh"), "neither a message nor a bundle");
  EXPECT_EQ(wrong(std::string("#bundle\0\0\0\0\0", 12)), "neither a message nor a bundle");
  EXPECT_EQ(wrong(OscWriter().text("/a").bytes() + ",fff"), "type tags without end");
  EXPECT_EQ(wrong(OscWriter().message("/a", "f").bytes()), "an argument without its bytes");
  EXPECT_EQ(wrong(OscWriter().message("/a", "d").word(0).bytes()), "an argument without its bytes");
  EXPECT_EQ(wrong(OscWriter().message("/a", "q").word(0).bytes()), "an argument without its bytes");
  EXPECT_EQ(wrong(OscWriter().message("/a", "").word(0).bytes()), "bytes behind the last argument");
  for (const uint32_t size : {5u, 0x7FFFFFFFu, 0x80000000u, 0xFFFFFFFCu, 0xFFFFFFFFu})
    EXPECT_EQ(wrong(OscWriter().message("/a", "b").word(size).word(0).bytes()),
              "an argument without its bytes");
  for (const uint32_t size : {4u, 0x7FFFFFFCu, 0xFFFFFFFCu, 0xFFFFFFFFu})
    EXPECT_EQ(wrong(OscWriter().bundle().word(size).bytes()), "an element beyond its bundle");
  EXPECT_EQ(wrong(OscWriter().bundle().word(0).bytes()), "a size that is no multiple of four");
  EXPECT_EQ(wrong(OscWriter().bundle().element(bone("Hips", 1)).word(3).word(0).bytes()),
            "a size that is no multiple of four")
      << "and the message before it is not taken";
}

TEST(Osc, NoPrefixAndNoFlippedByteReadsPastTheEnd) {
  OscWriter inner, packet;
  inner.bundle().element(bone("Spine", 2));
  packet.bundle().element(bone("Hips", 1)).element(inner);
  const std::string whole = packet.bytes();
  for (size_t length = 0; length < whole.size(); ++length) {
    Notes notes;
    const char* reason = read(whole.substr(0, length), notes);
    // Where an element ends a shorter bundle does.
    EXPECT_TRUE(reason != nullptr || length == 16 || length == 16 + 4 + bone("Hips", 1).size())
        << length;
  }
  size_t sound = 0;
  for (size_t at = 0; at < whole.size(); ++at) {
    for (int value = 0; value < 256; ++value) {
      std::string bent = whole;
      bent[at] = static_cast<char>(value);
      Notes notes;
      sound += read(bent, notes) == nullptr;
    }
  }
  EXPECT_GT(sound, whole.size());  // itself, and what only has another number in it
}

TEST(Osc, ManyArgumentsWithoutBytesAreNoWork) {
  Notes notes;
  ASSERT_EQ(read(OscWriter().message("/a", std::string(60000, 'T')).bytes(), notes), nullptr);
  EXPECT_EQ(notes.messages[0].arguments.size(), 60000u);
}

}  // namespace
}  // namespace figurine::ports::osc_test
