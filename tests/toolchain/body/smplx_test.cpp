// The SMPL-X importer on files that the test makes: the keys and shapes of v1.1 and v1.0, none of
// its data.
#include "toolchain/body/smplx.h"

#include <cmath>

#include "gtest/gtest.h"
#include "toolchain/body/test_files.h"
#include "toolchain/body/texel_body.h"

namespace figurine::body::smplx_test {
namespace {

constexpr size_t kVertices = 10475, kFaces = 20908, kUvs = 11313;
constexpr size_t kColumns = 25,
                 kRows =
                     kVertices / kColumns;  // a sheet of 25 x 419 vertices stands in for the body

using Arrays = std::map<std::string, std::string>;

// A sheet in the plane z = 0, x in [-0.5, 0.5], y in [-1.2, 0.6]; v_template in metres. Joint j
// sits at vertex 100 j; vertex v hangs on joint v % 55, half of it on joint 3. Shape direction s
// moves every vertex along y by 0.01 (s + 1).
Arrays arrays(size_t directions, const std::string& real) {
  std::vector<double> position, uv, faces, shapes, regressor(kJointCount * kVertices, 0.0),
      weights(kVertices * kJointCount, 0.0);
  for (size_t v = 0; v < kVertices; ++v) {
    const double x = static_cast<double>(v % kColumns) / (kColumns - 1),
                 y = static_cast<double>(v / kColumns) / (kRows - 1);
    position.insert(position.end(), {x - 0.5, 1.8 * y - 1.2, 0});
    uv.insert(uv.end(), {x, y});
    weights[v * kJointCount + v % kJointCount] += 0.5;
    weights[v * kJointCount + 3] += 0.5;
    for (size_t i = 0; i < 3; ++i) {
      for (size_t s = 0; s < directions; ++s)
        shapes.push_back(i == 1 ? 0.01 * static_cast<double>(s + 1) : 0);
    }
  }
  uv.resize(kUvs * 2, 0.0);
  for (size_t row = 0; row + 1 < kRows; ++row) {
    for (size_t column = 0; column + 1 < kColumns; ++column) {
      const double a = static_cast<double>(row * kColumns + column), b = a + 1, c = a + kColumns,
                   d = c + 1;
      faces.insert(faces.end(), {a, b, d, a, d, c});
    }
  }
  faces.resize(kFaces * 3, 0.0);
  for (size_t j = 0; j < kJointCount; ++j) regressor[j * kVertices + 100 * j] = 1;
  std::vector<double> tree(2 * kJointCount);
  for (size_t j = 0; j < kJointCount; ++j) {
    tree[j] = j == 0 ? 4294967295.0 : joint_parents()[j];  // the root's parent is bogus
    tree[kJointCount + j] = static_cast<double>(j);
  }
  return {{"v_template", test::npy_bytes(real, {kVertices, 3}, position)},
          {"f", test::npy_bytes("<u4", {kFaces, 3}, faces)},
          {"ft", test::npy_bytes("<i8", {kFaces, 3}, faces)},
          {"vt", test::npy_bytes(real, {kUvs, 2}, uv)},
          {"shapedirs", test::npy_bytes(real, {kVertices, 3, directions}, shapes)},
          {"posedirs", test::npy_bytes("<f4", {1}, {0})},  // never read
          {"joint2num", "\x80\x04 a pickle, never read"},
          {"J_regressor", test::npy_bytes(real, {kJointCount, kVertices}, regressor)},
          {"weights", test::npy_bytes(real, {kVertices, kJointCount}, weights)},
          {"kintree_table", test::npy_bytes("<u4", {2, kJointCount}, tree)}};
}

TEST(Smplx, ReadsVersion11) {
  const test::TemporaryFolder folder;
  test::write_npz(folder / "smplx.npz", arrays(400, "<f8"));
  const BodyModel model = read_smplx(folder / "smplx.npz");
  EXPECT_EQ(model.surface.vertex_count(), kVertices);
  EXPECT_EQ(model.surface.triangle_count(), kFaces);
  EXPECT_EQ(model.shape_count, 20u);
  // Lifted by 1.2 m onto the ground, joints with it.
  EXPECT_NEAR(model.surface.position_m[1], 0, 1e-6);
  EXPECT_NEAR(model.joint_m[3 * 7 + 1], model.surface.position_m[3 * 700 + 1], 1e-6);
  // v downward: the lowest vertices are at the bottom of the atlas.
  EXPECT_FLOAT_EQ(model.surface.uv[1], 1);
  // Every joint moves with the shape like its vertex.
  for (size_t s = 0; s < 20; ++s)
    EXPECT_NEAR(model.joint_shape_basis_m[(s * kJointCount + 9) * 3 + 1],
                0.01 * static_cast<double>(s + 1), 1e-6);
  // Vertex 8 hangs on joints 3 and 8 alike.
  EXPECT_EQ(model.surface.skin_joints[8 * kSkinInfluences], 3);
  EXPECT_EQ(model.surface.skin_joints[8 * kSkinInfluences + 1], 8);
  EXPECT_FLOAT_EQ(model.surface.skin_weights[8 * kSkinInfluences], 0.5);
  const TexelBody texels = make_texel_body(model, 32);
  EXPECT_EQ(texels.texel.size(), 32u * 32);
}

TEST(Smplx, ReadsTheTenShapesOfVersion10InFloat32) {
  const test::TemporaryFolder folder;
  test::write_npz(folder / "smplx.npz", arrays(20, "<f4"));
  EXPECT_EQ(read_smplx(folder / "smplx.npz").shape_count, 10u);
}

TEST(Smplx, BadFilesAreOneClearLine) {
  const test::TemporaryFolder folder;
  const std::string path = folder / "bad.npz";
  const Arrays sound = arrays(20, "<f4");
  const auto error = [&](const Arrays& changed) {
    test::write_npz(path, changed);
    const std::string message = test::input_error([&] { read_smplx(path); });
    EXPECT_EQ(message.find('\n'), std::string::npos);
    EXPECT_EQ(message.rfind(path, 0), 0u) << message;
    return message;
  };
  const auto with = [&](const std::string& name, const std::string& bytes) {
    Arrays changed = sound;
    changed[name] = bytes;
    return error(changed);
  };
  Arrays missing = sound;
  missing.erase("vt");
  EXPECT_NE(error(missing).find("vt: no such array"), std::string::npos);
  EXPECT_NE(with("weights", test::npy_bytes("<f4", {3, 55}, std::vector<double>(165)))
                .find("weights: shape (3,55), expected (10475,55)"),
            std::string::npos);
  EXPECT_NE(with("v_template", "\x93NUMPY").find("v_template: not a .npy array"),
            std::string::npos);
  EXPECT_NE(with("f", test::npy_bytes("<u4", {2, 3}, {0, 1, 2, 0, 1, 99999})).find("ft: shape"),
            std::string::npos);
  std::vector<double> tree(110, 0);
  EXPECT_NE(with("kintree_table", test::npy_bytes("<i8", {2, 55}, tree))
                .find("kintree_table: joint 1: not the SMPL-X tree"),
            std::string::npos);
  std::vector<double> nan(kUvs * 2, std::nan(""));
  EXPECT_NE(with("vt", test::npy_bytes("<f4", {kUvs, 2}, nan)).find("vt: value 0"),
            std::string::npos);
  // A pickled object array.
  std::string pickled = test::npy_bytes("<f4", {1}, {0});
  pickled.replace(pickled.find("'<f4'"), 5, "'|O' ");
  EXPECT_NE(with("vt", pickled).find("pickled Python objects, which are never read"),
            std::string::npos);
  test::write_text(path, "not a zip");
  EXPECT_NE(test::input_error([&] { read_smplx(path); }).find("not a readable .npz"),
            std::string::npos);
  EXPECT_NE(test::input_error([&] { read_smplx(folder / "none.npz"); }).find("none.npz: "),
            std::string::npos);
}

}  // namespace
}  // namespace figurine::body::smplx_test
