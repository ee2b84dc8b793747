// The glTF reader on small files, sound and hostile: every interpolation and number format against
// values computed by hand.
#include "ports/motion/gltf.h"

#include <cmath>
#include <functional>
#include <limits>
#include <numbers>

#include "gtest/gtest.h"
#include "ports/motion/glb_builder.h"
#include "ports/motion/motion_files.h"

namespace figurine::ports::gltf_test {
namespace {

using tests::GlbBuilder;

constexpr float kHalf = 0.70710678f;  // sine and cosine of 45 degrees: half of a right angle

Gltf parse(const std::string& file, uint32_t animation = 0) {
  Result<Gltf> gltf = parse_gltf(tests::bytes_of(file), "a.glb", animation);
  EXPECT_TRUE(gltf.ok()) << gltf.status().message();
  return gltf.ok() ? std::move(gltf).value() : Gltf{};
}

// Of the file, or of the first node that has one; empty: none.
std::string error(const std::string& file, uint32_t animation = 0) {
  const Result<Gltf> gltf = parse_gltf(tests::bytes_of(file), "a.glb", animation);
  if (!gltf.ok()) return gltf.status().message();
  for (const GltfNode& node : gltf->nodes) {
    if (!node.defect.empty()) return "a.glb: " + node.defect;
  }
  return "";
}

Quat about_z(double degrees) { return about(Vec3(0, 0, 1), degrees * std::numbers::pi / 180); }

// A node that turns from 0 to 90 degrees about z within times 1 and 3, and a second one for its
// places.
GlbBuilder sound() {
  GlbBuilder glb;
  const int root = glb.node("root", -1, {{"translation", {1, 2, 3}}});
  const int child = glb.node("child", root, {{"scale", {2, 2, 2}}});
  glb.track(root, "rotation", "LINEAR", {1, 3}, {0, 0, 0, 1, 0, 0, kHalf, kHalf});
  glb.track(child, "translation", "LINEAR", {0, 1, 2}, {0, 0, 0, 4, 0, 0, 4, 8, 0});
  return glb;
}

TEST(Gltf, ReadsNodesAndInterpolatesLinearly) {
  const Gltf gltf = parse(sound().file());
  ASSERT_EQ(gltf.nodes.size(), 2u);
  EXPECT_EQ(gltf.nodes[1].name, "child");
  EXPECT_EQ(gltf.nodes[1].parent, 0);
  EXPECT_EQ(gltf.tracks.size(), 2u);
  for (const auto& [time, degrees, place] : {std::tuple{-5.0, 0.0, Vec3(0, 0, 0)},
                                             {0.5, 0.0, Vec3(2, 0, 0)},
                                             {1.5, 22.5, Vec3(4, 4, 0)},
                                             {2.0, 45.0, Vec3(4, 8, 0)},
                                             {99.0, 90.0, Vec3(4, 8, 0)}}) {
    const auto pose = gltf.at(time);
    EXPECT_LT(angle_between(pose[0].rotation, about_z(degrees)), 1e-6) << time;
    EXPECT_LT(length(pose[1].translation - place), 1e-6) << time;
    EXPECT_EQ(pose[0].translation, Vec3(1, 2, 3));  // not animated: as the node says
    EXPECT_EQ(pose[1].scale, Vec3(2, 2, 2));
  }
}

TEST(Gltf, RotatesTheShorterWay) {
  GlbBuilder glb;
  glb.node("root", -1);
  glb.track(0, "rotation", "LINEAR", {0, 1},
            {0, 0, 0, 1, 0, 0, -kHalf, -kHalf});  // the same 90 degrees, other sign
  EXPECT_LT(angle_between(parse(glb.file()).at(0.5)[0].rotation, about_z(45)), 1e-6);
}

TEST(Gltf, StepsHoldTheirValue) {
  GlbBuilder glb;
  glb.node("root", -1);
  glb.track(0, "rotation", "STEP", {0, 1, 2}, {0, 0, 0, 1, 0, 0, kHalf, kHalf, 0, 0, 1, 0});
  glb.track(0, "scale", "STEP", {0, 1}, {1, 1, 1, 3, 4, 5});
  const Gltf gltf = parse(glb.file());
  EXPECT_LT(angle_between(gltf.at(0.999)[0].rotation, about_z(0)), 1e-6);
  EXPECT_LT(angle_between(gltf.at(1)[0].rotation, about_z(90)), 1e-6);
  EXPECT_LT(angle_between(gltf.at(1.999)[0].rotation, about_z(90)), 1e-6);
  EXPECT_LT(angle_between(gltf.at(2)[0].rotation, about_z(180)), 1e-6);
  EXPECT_EQ(gltf.at(0.5)[0].scale, Vec3(1, 1, 1));
  EXPECT_EQ(gltf.at(1.5)[0].scale, Vec3(3, 4, 5));
}

TEST(Gltf, CubicSplinesAreHermite) {
  GlbBuilder glb;
  glb.node("root", -1);
  // x(t) = (t - 1)^3 on [1, 3]: slopes 0 and 12, values 0 and 8. A Hermite cubic is that cubic.
  glb.track(0, "translation", "CUBICSPLINE", {1, 3},
            {9, 9, 9, 0, 0, 0, 0, 0, 0, 12, 0, 0, 8, 0, 0, 9, 9, 9});
  // Without tangents: smooth steps between the quaternions, then normalised. Half way: the mean of
  // 0 and 90 degrees.
  glb.track(0, "rotation", "CUBICSPLINE", {1, 3},
            {0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, kHalf, kHalf, 0, 0, 0, 0});
  const Gltf gltf = parse(glb.file());
  for (double t : {0.0, 1.0, 1.25, 2.0, 2.9, 3.0, 7.0}) {
    const double x = std::pow(std::clamp(t, 1.0, 3.0) - 1, 3);
    EXPECT_NEAR(gltf.at(t)[0].translation.x, x, 1e-6) << t;
  }
  EXPECT_LT(angle_between(gltf.at(2)[0].rotation, about_z(45)), 1e-6);
  const double u = 0.25, s = 3 * u * u - 2 * u * u * u;  // a quarter of the way
  const Quat quarter(1 - s + s * double{kHalf}, 0, 0, s * double{kHalf});
  EXPECT_LT(angle_between(gltf.at(1.5)[0].rotation, unit(quarter)), 1e-6);
}

template <class T>
void expect_normalised(int component_type, std::vector<T> stored, const Quat& wanted) {
  GlbBuilder glb;
  glb.node("root", -1);
  const int input = glb.accessor<float>({0}, 5126, "SCALAR", 1);
  glb.channel(0, "rotation", "LINEAR", input, glb.accessor<T>(stored, component_type, "VEC4", 4));
  EXPECT_LT(angle_between(parse(glb.file()).at(0)[0].rotation, unit(wanted)), 1e-6)
      << component_type;
}

TEST(Gltf, NormalisedIntegersOfEveryWidth) {
  expect_normalised<int8_t>(5120, {-127, 0, 0, 64}, Quat(64.0 / 127, -1, 0, 0));
  expect_normalised<int8_t>(5120, {-128, 0, 0, 127}, Quat(1, -1, 0, 0));  // -128 is -1 as well
  expect_normalised<uint8_t>(5121, {0, 0, 255, 51}, Quat(0.2, 0, 0, 1));
  expect_normalised<int16_t>(5122, {0, -32768, 0, 32767}, Quat(1, 0, -1, 0));
  expect_normalised<uint16_t>(5123, {65535, 0, 0, 13107}, Quat(0.2, 1, 0, 0));
}

TEST(Gltf, StridesAndOffsetsAreFollowed) {
  GlbBuilder glb;
  glb.node("root", -1);
  // Two vectors 16 bytes apart, behind four bytes of something else.
  const int output = glb.accessor<float>({77, 1, 2, 3, 77, 4, 5, 6}, 5126, "VEC3", 3);
  glb.json["bufferViews"][0]["byteStride"] = 16;
  glb.json["accessors"][0]["byteOffset"] = 4;
  glb.json["accessors"][0]["count"] = 2;
  glb.channel(0, "translation", "STEP", glb.accessor<float>({0, 1}, 5126, "SCALAR", 1), output);
  EXPECT_EQ(parse(glb.file()).at(0)[0].translation, Vec3(1, 2, 3));
  EXPECT_EQ(parse(glb.file()).at(1)[0].translation, Vec3(4, 5, 6));
}

TEST(Gltf, AMatrixIsTakenApart) {
  GlbBuilder glb = sound();
  // Scale 2, 3, 4, then 90 degrees about z, then (5, 6, 7): columns.
  glb.node("matrix", -1, {{"matrix", {0, 2, 0, 0, -3, 0, 0, 0, 0, 0, 4, 0, 5, 6, 7, 1}}});
  const GltfTransform transform = parse(glb.file()).at(0)[2];
  EXPECT_LT(angle_between(transform.rotation, about_z(90)), 1e-9);
  EXPECT_LT(length(transform.scale - Vec3(2, 3, 4)), 1e-9);
  EXPECT_EQ(transform.translation, Vec3(5, 6, 7));
}

TEST(Gltf, ParentsComeFirstWhateverTheOrderOfTheFile) {
  GlbBuilder glb = sound();
  glb.json["nodes"] = {
      {{"name", "a"}}, {{"name", "b"}, {"children", {0}}}, {{"name", "c"}, {"children", {1}}}};
  const Gltf gltf = parse(glb.file());
  EXPECT_EQ(gltf.order, (std::vector<uint32_t>{2, 1, 0}));
  EXPECT_EQ(gltf.nodes[0].parent, 1);
}

TEST(Gltf, OneOfSeveralAnimations) {
  GlbBuilder glb = sound();
  nlohmann::json second = glb.json["animations"][0];
  second["channels"].erase(0);
  glb.json["animations"].push_back(second);
  EXPECT_EQ(parse(glb.file(), 1).tracks.size(), 1u);
  EXPECT_EQ(error(glb.file(), 2), "a.glb: animations: no number 2: there are 2");
}

TEST(Gltf, EveryPrefixAndEveryLongerFileIsRefused) {
  const std::string file = sound().file();
  for (size_t length = 0; length < file.size(); ++length)
    EXPECT_NE(error(file.substr(0, length)), "") << length;
  EXPECT_NE(error(file + std::string(4, '\0')), "");
}

TEST(Gltf, EveryFlippedByteIsRefusedOrRead) {
  const std::string file = sound().file();
  size_t refused = 0;
  for (size_t i = 0; i < file.size(); ++i) {
    for (int bit = 0; bit < 8; ++bit) {
      std::string flipped = file;
      flipped[i] = static_cast<char>(flipped[i] ^ (1 << bit));
      const Result<Gltf> gltf = parse_gltf(tests::bytes_of(flipped), "a.glb");
      if (!gltf.ok()) {
        ++refused;
        EXPECT_EQ(gltf.status().message().find('\n'), std::string::npos);
        EXPECT_EQ(gltf.status().message().rfind("a.glb: ", 0), 0u) << gltf.status().message();
        continue;
      }
      EXPECT_GE(i, 12u) << "a changed header is read";
      for (const GltfTransform& transform : gltf->at(1.5)) {
        EXPECT_TRUE(std::isfinite(length(transform.translation)) &&
                    std::isfinite(dot(transform.rotation, transform.rotation)));
      }
    }
  }
  std::printf("%zu of %zu flips refused\n", refused, 8 * file.size());
  EXPECT_GT(refused, 8 * 20u);
}

std::string error_of(const std::function<void(GlbBuilder&)>& change) {
  GlbBuilder glb = sound();
  change(glb);
  return error(glb.file());
}

TEST(Gltf, NamesFieldAndReason) {
  const std::string file = sound().file();
  const auto header = [&](size_t at, uint32_t value) {
    std::string changed = file;
    return error(changed.replace(at, 4, GlbBuilder::word(value)));
  };
  EXPECT_EQ(header(0, 0), "a.glb: header: magic: not a glTF file");
  EXPECT_EQ(header(4, 1), "a.glb: header: version 1: only 2 is read");
  EXPECT_NE(header(8, 4000).find("a.glb: header: length: 4000 bytes, the file has "),
            std::string::npos);
  EXPECT_NE(header(12, 0xfffffffc).find("a.glb: chunk 0: length: 4294967292 bytes, "),
            std::string::npos);
  EXPECT_NE(header(16, 0).find("a.glb: chunk 0: type: "), std::string::npos);
  EXPECT_NE(error(GlbBuilder::file("{\"a\":", "")).find("a.glb: JSON: not valid at byte "),
            std::string::npos);
  EXPECT_EQ(error(GlbBuilder::file("{\"a\":1e999}", "")), "a.glb: JSON: a number is out of range");
  EXPECT_EQ(error(GlbBuilder::file("[]", "")), "a.glb: JSON: not an object");
  EXPECT_EQ(error(GlbBuilder::file("{}", "")), "a.glb: asset: missing");

  const auto sampler = [](GlbBuilder& glb) -> nlohmann::json& {
    return glb.json["animations"][0]["samplers"][0];
  };
  const auto target = [](GlbBuilder& glb) -> nlohmann::json& {
    return glb.json["animations"][0]["channels"][0]["target"];
  };
  const std::vector<std::pair<std::function<void(GlbBuilder&)>, std::string>> cases = {
      {[](auto& g) { g.json["asset"]["version"] = "1.0"; },
       "asset.version: \"1.0\": only 2.0 is read"},
      {[](auto& g) { g.json.erase("nodes"); }, "nodes: missing"},
      {[](auto& g) { g.json["nodes"] = 5; }, "nodes: not an array"},
      {[](auto& g) { g.json["nodes"][0] = 5; }, "nodes[0]: not an object"},
      {[](auto& g) { g.json["nodes"][0]["name"] = 5; }, "nodes[0].name: not a string"},
      {[](auto& g) { g.json["nodes"][0]["children"][0] = 7; },
       "nodes[0].children[0]: 7: there are only 2 nodes"},
      {[](auto& g) { g.json["nodes"][0]["children"][0] = -1; },
       "nodes[0].children[0]: not a count"},
      {[](auto& g) { g.json["nodes"][0]["children"] = {1, 1}; },
       "nodes[0].children[1]: node 1 has two parents"},
      {[](auto& g) { g.json["nodes"][1]["children"] = {0}; }, "nodes: children go in a circle"},
      {[](auto& g) {  // and a circle besides
         g.json["nodes"][0]["children"] = {1, 1};
         g.json["nodes"][1]["children"] = {1};
       },
       "nodes[0].children[1]: node 1 has two parents"},
      {[](auto& g) { g.json["nodes"][0]["translation"] = {1, 2}; },
       "nodes[0].translation: 2 numbers, expected 3"},
      {[](auto& g) { g.json["nodes"][0]["translation"] = {1, "x", 2}; },
       "nodes[0].translation[1]: not a number"},
      {[](auto& g) { g.json["nodes"][0]["translation"] = {1, 1e30, 2}; },
       "nodes[0].translation[1]: not finite or out of range"},
      {[](auto& g) { g.json["nodes"][0]["rotation"] = {0, 0, 0, 0}; },
       "nodes[0].rotation: a quaternion of no length"},
      {[](auto& g) { g.json["nodes"][0]["scale"] = {1, -1, 1}; }, "nodes[0].scale: mirrored"},
      {[](auto& g) {
         g.json["nodes"][1]["matrix"] = {1, 0, 0, 0, 1, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
       },
       "nodes[1].matrix: sheared"},
      {[](auto& g) {
         g.json["nodes"][1]["matrix"] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, -1, 0, 0, 0, 0, 1};
       },
       "nodes[1].matrix: mirrored"},
      {[](auto& g) {
         g.json["nodes"][1]["matrix"] = {0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
       },
       "nodes[1].matrix: an axis of no length"},
      {[](auto& g) { g.json.erase("animations"); }, "animations: there are none"},
      {[](auto& g) { g.json["animations"] = nlohmann::json::array(); },
       "animations: there are none"},
      {[](auto& g) { g.json["animations"] = "all"; }, "animations: not an array"},
      {[&](auto& g) { target(g)["node"] = 9; },
       "animations[0].channels[0].target.node: 9: there are only 2 nodes"},
      {[&](auto& g) { target(g)["path"] = "spin"; },
       "animations[0].channels[0].target.path: \"spin\" is none of translation, rotation, scale "
       "and weights"},
      {[&](auto& g) {
         g.json["animations"][0]["channels"].push_back(g.json["animations"][0]["channels"][0]);
       },
       "animations[0].channels[2].target: a second channel for the same node and path"},
      {[&](auto& g) { g.json["animations"][0]["channels"][0]["sampler"] = 9; },
       "animations[0].channels[0].sampler: 9: there are only 2 animations[0].samplers"},
      {[&](auto& g) { sampler(g)["interpolation"] = "FAST"; },
       "animations[0].samplers[0].interpolation: \"FAST\" is none of STEP, LINEAR and CUBICSPLINE"},
      {[&](auto& g) { sampler(g).erase("input"); }, "animations[0].samplers[0].input: missing"},
      {[&](auto& g) { sampler(g)["input"] = 44; },
       "animations[0].samplers[0].input: 44: there are only 4 accessors"},
      {[&](auto& g) { sampler(g)["output"] = 0; }, "accessors[0].type: \"SCALAR\", expected VEC4"},
      {[&](auto& g) { sampler(g)["interpolation"] = "CUBICSPLINE"; },
       "animations[0].samplers[0].output: 2 values for 2 keys"},
      {[](auto& g) { g.json["accessors"][1]["componentType"] = 5125; },
       "accessors[1].componentType: 5125: not one that these keys may have"},
      {[](auto& g) { g.json["accessors"][0]["componentType"] = 5123; },
       "accessors[0].componentType: 5123: not one that these keys may have"},
      {[](auto& g) { g.json["accessors"][1]["componentType"] = 5122; },
       "accessors[1]: integers that are not normalized"},
      {[](auto& g) { g.json["accessors"][1]["sparse"] = 1; },
       "accessors[1].sparse: unsupported: sparse keys are not read"},
      {[](auto& g) { g.json["accessors"][1].erase("bufferView"); },
       "accessors[1].bufferView: missing"},
      {[](auto& g) { g.json["accessors"][1]["count"] = 0; }, "accessors[1].count: no elements"},
      {[](auto& g) { g.json["accessors"][1]["count"] = 3; },
       "accessors[1]: reaches past the end of its buffer view of 32 bytes"},
      {[](auto& g) { g.json["accessors"][1]["count"] = std::numeric_limits<uint64_t>::max(); },
       "accessors[1]: reaches past the end of its buffer view of 32 bytes"},
      {[](auto& g) { g.json["accessors"][1]["count"] = 2.5; }, "accessors[1].count: not a count"},
      {[](auto& g) { g.json["accessors"][1]["byteOffset"] = std::numeric_limits<uint64_t>::max(); },
       "accessors[1]: reaches past the end of its buffer view of 32 bytes"},
      {[](auto& g) { g.json["bufferViews"][1]["byteStride"] = 8; },
       "bufferViews[1].byteStride: 8: not within the element's size and 252"},
      {[](auto& g) { g.json["bufferViews"][1]["byteLength"] = 4000; },
       "bufferViews[1]: reaches past the end of its buffer of "},
      {[](auto& g) {
         g.json["bufferViews"][1]["byteOffset"] = std::numeric_limits<uint64_t>::max();
       },
       "bufferViews[1]: reaches past the end of its buffer of "},
      {[](auto& g) { g.json["bufferViews"][1]["extensions"]["EXT_meshopt_compression"] = {}; },
       "bufferViews[1].extensions: unsupported: EXT_meshopt_compression"},
      {[](auto& g) { g.json["buffers"] = {{{"byteLength", 4000}}}; },
       "buffers[0].byteLength: 4000 bytes, there are "},
      {[](auto& g) { g.json["buffers"] = {{{"byteLength", 4}, {"uri", "/etc/passwd"}}}; },
       "buffers[0].uri: unsupported: \"/etc/passwd\": no other file is opened"},
  };
  for (const auto& [change, wanted] : cases)
    EXPECT_EQ(error_of(change).rfind("a.glb: " + wanted, 0), 0u)
        << error_of(change) << "\nwanted " << wanted;
}

TEST(Gltf, BadKeysAreNamed) {
  const auto error_with = [](const std::vector<float>& times, const std::vector<float>& values,
                             const std::string& path) {
    GlbBuilder glb;
    glb.node("root", -1);
    glb.track(0, path, "LINEAR", times, values);
    return error(glb.file());
  };
  const float nan = std::numeric_limits<float>::quiet_NaN(),
              infinity = std::numeric_limits<float>::infinity();
  const std::vector<float> two(6, 1.0f);
  EXPECT_EQ(error_with({0, nan}, two, "translation"),
            "a.glb: accessors[0]: element 1: not finite or out of range");
  EXPECT_EQ(error_with({0, infinity}, two, "translation"),
            "a.glb: accessors[0]: element 1: not finite or out of range");
  EXPECT_EQ(error_with({-1, 0}, two, "translation"),
            "a.glb: animations[0].samplers[0].input: key 0: not within 0 and 1e5 s");
  EXPECT_EQ(error_with({1, 1}, two, "translation"),
            "a.glb: animations[0].samplers[0].input: key 1: not later than the one before");
  EXPECT_EQ(error_with({1, 0.5f}, two, "translation"),
            "a.glb: animations[0].samplers[0].input: key 1: not later than the one before");
  EXPECT_EQ(error_with({0, 1}, {1, 2, 3, 4, nan, 6}, "translation"),
            "a.glb: accessors[1]: element 1: not finite or out of range");
  EXPECT_EQ(error_with({0, 1, 2}, two, "translation"),
            "a.glb: animations[0].samplers[0].output: 2 values for 3 keys");
  EXPECT_EQ(error_with({0}, {0, 0, 0, 0}, "rotation"),
            "a.glb: animations[0].samplers[0].output: key 0: a quaternion of no length");
  EXPECT_EQ(error_with({0}, {1, 1, -1}, "scale"),
            "a.glb: animations[0].samplers[0].output: key 0: mirrored");
}

TEST(Gltf, DepthAndCountsAreLimited) {
  const std::string deep =
      "{\"asset\":{\"version\":\"2.0\"},\"extras\":" + std::string(1000000, '[') +
      std::string(1000000, ']') + "}";
  EXPECT_EQ(error(GlbBuilder::file(deep, "")), "a.glb: JSON: nested deeper than 64");
  EXPECT_EQ(error_of([](GlbBuilder& glb) {
              for (int i = 0; i < 5000; ++i) glb.node("n", -1);
            }),
            "a.glb: nodes: more than 4096");
  // One accessor named by many samplers costs memory once for each: 700 tracks of 100,000 values.
  GlbBuilder many;
  const int output = many.accessor(std::vector<float>(300000, 1.0f), 5126, "VEC3", 3);
  std::vector<float> times(100000);
  for (size_t i = 0; i < times.size(); ++i) times[i] = static_cast<float>(i);
  const int input = many.accessor(times, 5126, "SCALAR", 1);
  for (int i = 0; i < 700; ++i)
    many.channel(many.node("n", -1), "translation", "LINEAR", input, output);
  EXPECT_NE(error(many.file()).find("more than 2^26 key values in the animation"),
            std::string::npos);
  // Text of the file does not break the line of a message, nor make it long.
  const std::string message = error_of([](GlbBuilder& glb) {
    glb.json["animations"][0]["channels"][0]["target"]["path"] = "a\nb" + std::string(9999, 'x');
  });
  EXPECT_EQ(message.find('\n'), std::string::npos);
  EXPECT_LT(message.size(), 250u);
}

}  // namespace
}  // namespace figurine::ports::gltf_test
