// Numbers as Python and NumPy pickle them, byte for byte, and what must never be run.
#include "toolchain/dataset/pickle.h"

#include <gtest/gtest.h>

#include "toolchain/dataset/mvhumannet_folder.h"

namespace figurine::dataset::pickle_test {
namespace {

std::string bytes_of(const std::string& hex) {
  std::string bytes;
  for (size_t i = 0; i + 1 < hex.size(); i += 2)
    bytes += static_cast<char>(std::stoi(hex.substr(i, 2), nullptr, 16));
  return bytes;
}

double read(const std::string& bytes) {
  return read_pickled_number(std::as_bytes(std::span(bytes)), "scale.pkl");
}

// Written by pickle.dumps(...).hex() of Python 3.13 and NumPy 2.2; "as NumPy 1 names it": with the
// module called as there.
struct Written {
  const char* name;
  const char* hex;
  double value;
};
const Written kWritten[] = {
#include "pickled_numbers.inc"
};

TEST(Pickle, ReadsNumbersOfPythonAndNumpyInEveryProtocol) {
  for (const Written& written : kWritten)
    EXPECT_EQ(read(bytes_of(written.hex)), written.value) << written.name;
}

TEST(Pickle, RejectsEveryPrefix) {
  for (const Written& written : kWritten) {
    const std::string whole = bytes_of(written.hex);
    for (size_t length = 0; length < whole.size(); ++length)
      EXPECT_THROW(read(whole.substr(0, length)), InputError) << written.name << " " << length;
  }
}

// What a few bytes could make of a reader's memory and stack, and texts that are no type's.
TEST(Pickle, RefusesWhatNoNumberNeeds) {
  std::string doubled = "\x80\x04)\x94";  // an empty tuple, remembered
  for (char place = 0; place < 60; ++place)
    doubled += std::string("h") + place + "h" + place + "\x86\x94";  // twice the last, remembered
  const std::string nested = "\x80\x04)" + std::string(1'000'000, '\x85') + ".",
                    type =
                        "\x80\x04\x8c\x05numpy\x8c\x05"
                        "dtype\x93";
  const auto text = [](const std::string& of) {
    return "\x8c" + std::string(1, static_cast<char>(of.size())) + of;
  };
  // A type of order marks alone, told its order again; a type with a line break in its name.
  const std::string marks = type + text("<") + "\x85R(K\x03" + text("<") + "tb.",
                    lines = "\x80\x04\x8c\x15numpy.core.multiarray\x8c\x06scalar\x93" +
                            type.substr(2) + text("f\n\n9") + "\x85R" + text("12345678") + "\x86R.";
  for (const std::string& bytes : {doubled + ".", nested, marks, lines}) {
    try {
      read(bytes);
      ADD_FAILURE() << "is read";
    } catch (const InputError& error) {
      EXPECT_TRUE(std::string(error.what()).starts_with("scale.pkl: pickle ")) << error.what();
      EXPECT_EQ(std::string(error.what()).find('\n'), std::string::npos) << error.what();
    }
  }
}

// Whatever byte changes: a number or one line, no crash.
TEST(Pickle, SurvivesEveryChangedByte) {
  for (const Written& written : kWritten) {
    const std::string whole = bytes_of(written.hex);
    for (size_t at = 0; at < whole.size(); ++at) {
      for (const int change : {1, 0x20, 0x80, 0xff}) {
        std::string damaged = whole;
        damaged[at] = static_cast<char>(damaged[at] ^ change);
        try {
          read(damaged);
        } catch (const InputError& error) {
          EXPECT_EQ(std::string(error.what()).find('\n'), std::string::npos);
        }
      }
    }
  }
}

TEST(Pickle, NamesWhatItWouldHaveToRun) {
  const std::string asks = test::input_error([] { read("cos\nsystem\n(S'true'\ntR."); });
  EXPECT_NE(asks.find("os.system"), std::string::npos) << asks;
  EXPECT_NE(test::input_error([] { read("]."); }).find("scale.pkl"), std::string::npos);
  EXPECT_NE(test::input_error([] { read("Fnan\n."); }).find("finite"), std::string::npos);
}

}  // namespace
}  // namespace figurine::dataset::pickle_test
