// NumPy's arrays, sound and hostile, alone and in their archive.
#include "ports/motion/npz.h"

#include <gtest/gtest.h>

#include "ports/motion/motion_files.h"

namespace figurine::ports::npz_test {
namespace {

using tests::bytes_of;
using tests::npy_bytes;

std::vector<double> values(const std::string& npy) {
  const Result<NpyArray> array = parse_npy(bytes_of(npy), "a");
  EXPECT_TRUE(array.ok()) << array.status().message();
  return array.ok() ? array->values : std::vector<double>();
}

TEST(Npy, ReadsTypesAndColumnMajorOrder) {
  EXPECT_EQ(values(npy_bytes("<i8", {2, 2}, {1, -2, 3, 4})), (std::vector<double>{1, -2, 3, 4}));
  std::string fortran = npy_bytes("<f4", {2, 3}, {1, 4, 2, 5, 3, 6});
  fortran.replace(fortran.find("False"), 5, "True ");
  EXPECT_EQ(values(fortran), (std::vector<double>{1, 2, 3, 4, 5, 6}));
  EXPECT_EQ(values(npy_bytes("<f8", {}, {7})), (std::vector<double>{7}));
  EXPECT_EQ(values(npy_bytes(">f8", {2}, {7, -0.5})), (std::vector<double>{7, -0.5}));
  EXPECT_EQ(values(npy_bytes("<f2", {3}, {0, 1, -1})), (std::vector<double>{0, 1, -1}));
}

TEST(Npy, EveryPrefixAndSurplusIsRefused) {
  const std::string sound = npy_bytes("<f4", {3, 2}, {1, 2, 3, 4, 5, 6});
  for (size_t length = 0; length < sound.size(); ++length) {
    EXPECT_FALSE(parse_npy(bytes_of(sound.substr(0, length)), "a").ok()) << length;
  }
  EXPECT_FALSE(parse_npy(bytes_of(sound + "x"), "a").ok());
  for (const char* shape : {"(99999999999999999999,)", "(4294967296,4294967296,)", "(-1,)", "3",
                            "(", "(2,2,2,2,2,2,2,2,2,)"}) {
    std::string changed = sound;
    changed.replace(changed.find("(3,2,)"), 6, shape);
    EXPECT_FALSE(parse_npy(bytes_of(changed), "a").ok()) << shape;
  }
  // Found by fuzzing: a value that ends before it begins.
  std::string without = sound;
  without.replace(without.find("(3,2,)"), 6, ",");
  EXPECT_EQ(parse_npy(bytes_of(without), "a").status().message(), "a: header: shape is empty");
  // Any single changed byte of the header either still describes the same array or is refused;
  // nothing else happens.
  for (size_t i = 0; i < 128; ++i) {
    for (int flip : {1, 0x20, 0x80}) {
      std::string changed = sound;
      changed[i] = static_cast<char>(changed[i] ^ flip);
      const Result<NpyArray> array = parse_npy(bytes_of(changed), "a");
      if (array.ok()) {
        EXPECT_LE(array->values.size(), 24u);
      }
    }
  }
}

TEST(Npz, IsJudgedByWhatItDeclares) {
  const std::string sound = npy_bytes("<f4", {3, 2}, {1, 2, 3, 4, 5, 6});
  const std::string file = tests::stored_npz({{"x", sound}, {"y", npy_bytes("<f8", {}, {7})}});
  const Result<NpzFile> npz = NpzFile::open(bytes_of(file), "a.npz");
  ASSERT_TRUE(npz.ok()) << npz.status().message();
  EXPECT_TRUE(npz->has("x"));
  EXPECT_FALSE(npz->has("z"));
  EXPECT_EQ(npz->read("x", {0, 2})->values, (std::vector<double>{1, 2, 3, 4, 5, 6}));
  EXPECT_EQ(npz->read("x", {2, 3}).status().message(), "a.npz: x: shape (3,2), expected (2,3)");
  EXPECT_EQ(npz->read("z").status().message(), "a.npz: z: no such array");
  // A byte of the values flipped: the archive's checksum says so.
  std::string flipped = file;
  flipped[flipped.find(sound) + sound.size() - 1] ^= 1;
  const Result<NpzFile> damaged = NpzFile::open(bytes_of(flipped), "a.npz");
  ASSERT_TRUE(damaged.ok());
  EXPECT_FALSE(damaged->read("x").ok());
  for (size_t length = 0; length < file.size(); length += 7)
    EXPECT_FALSE(NpzFile::open(bytes_of(file.substr(0, length)), "a.npz").ok()) << length;
}

}  // namespace
}  // namespace figurine::ports::npz_test
