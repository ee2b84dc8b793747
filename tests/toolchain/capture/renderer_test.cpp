// The renderer against pictures that are known in closed form: flat squares in front of a camera.
#include "toolchain/capture/renderer.h"

#include <cmath>

#include "gtest/gtest.h"
#include "toolchain/capture/shading.h"

namespace figurine::capture::renderer_test {
namespace {

std::shared_ptr<const Texture> flat_texture(std::array<uint8_t, 4> rgba) {
  ports::ImageU8 image(4, 4, 4);
  for (size_t i = 0; i < image.pixels.size(); ++i) image.pixels[i] = rgba[i % 4];
  return std::make_shared<Texture>(image, TextureEncoding::kColour);
}

// A rectangle that faces +z, hanging on joint 0.
Mesh rectangle(float left, float bottom, float right, float top, float z,
               std::array<uint8_t, 4> rgba) {
  Mesh mesh;
  mesh.name = "rectangle";
  mesh.position_m = {left, bottom, z, right, bottom, z, right, top, z, left, top, z};
  mesh.triangles = {0, 1, 2, 0, 2, 3};
  mesh.uv = {0, 1, 1, 1, 1, 0, 0, 0};
  mesh.uv_triangles = mesh.triangles;
  mesh.skin_joints.assign(4 * kSkinInfluences, 0);
  mesh.skin_weights.assign(4 * kSkinInfluences, 0);
  for (size_t v = 0; v < 4; ++v) mesh.skin_weights[v * kSkinInfluences] = 1;
  mesh.material.colour = flat_texture(rgba);
  return mesh;
}

// 16x16 pixels, one centimetre each at z = 0, seen from +z; pixel (8, 8) starts at the origin, y
// down in the image.
Camera front_camera() {
  Camera camera{
      .width_px = 16, .height_px = 16, .fx_px = 400, .fy_px = 400, .cx_px = 8, .cy_px = 8};
  camera.view_from_world = {1, 0, 0, 0, 0, -1, 0, 0, 0, 0, -1, 4};
  return camera;
}

Rendering render(Person person) {
  Renderer renderer(person);
  const std::vector<Affine> pose(1);
  renderer.set_pose(pose);
  return renderer.render(front_camera());
}

TEST(Renderer, AlphaIsCoverage) {
  Person person;
  // Half a pixel is left free on the left, a quarter (two of eight samples) at the bottom.
  person.meshes.push_back(rectangle(-0.025f, -0.0475f, 0.04f, 0.04f, 0, {200, 200, 200, 255}));
  const Rendering image = render(person);
  EXPECT_EQ(*image.alpha.at(8, 8), 255);
  EXPECT_EQ(*image.alpha.at(5, 8), 128) << "half covered";
  EXPECT_EQ(*image.alpha.at(8, 12), 191) << "three quarters covered";
  EXPECT_EQ(*image.alpha.at(3, 8), 0);
  EXPECT_EQ(*image.alpha.at(8, 13), 0);
}

TEST(Renderer, ColourIsPremultipliedWithCoverage) {
  Person person;
  person.meshes.push_back(rectangle(-0.025f, -0.04f, 0.04f, 0.04f, 0, {200, 120, 60, 255}));
  const Rendering image = render(person);
  for (uint32_t c = 0; c < 3; ++c)
    EXPECT_NEAR(image.colour.at(5, 8)[c], image.colour.at(8, 8)[c] / 2.0, 1.0) << c;
}

// Nothing stands in any light's way: the pixel is the shading of one point, encoded.
TEST(Renderer, AnOpenSurfaceIsShadedInClosedForm) {
  Person person;
  person.meshes.push_back(rectangle(-0.05f, -0.05f, 0.05f, 0.05f, 0, {128, 128, 128, 255}));
  const Rendering image = render(person);
  const Lighting light;
  SurfacePoint point{.albedo = {1, 1, 1}, .normal = {0, 0, 1}, .to_view = {0, 0, 1}};
  const float albedo = linear_from_srgb(128 / 255.0f);
  point.albedo = {albedo, albedo, albedo};
  // The cosine-weighted mean of a sky that is linear in y over a hemisphere whose pole lies level:
  // its value at the horizon.
  point.ambient = mix(light.ground_colour, light.sky_colour, 0.5f);
  const Vec3 expected = shade(light, point, 1);
  EXPECT_NEAR(image.colour.at(8, 8)[0], 255 * srgb_from_linear(shoulder(expected.x)), 2.0);
  EXPECT_NEAR(image.colour.at(8, 8)[1], 255 * srgb_from_linear(shoulder(expected.y)), 2.0);
  EXPECT_NEAR(image.colour.at(8, 8)[2], 255 * srgb_from_linear(shoulder(expected.z)), 2.0);
}

// A small blocker on the way to the light, out of the camera's sight: the key light's share goes,
// the rest stays.
TEST(Renderer, ABlockerTakesTheKeyLightAway) {
  Person open, shadowed;
  open.meshes.push_back(rectangle(-0.05f, -0.05f, 0.05f, 0.05f, 0, {128, 128, 128, 255}));
  shadowed.meshes = open.meshes;
  const Vec3 at = Lighting{}.key_direction * 1.0f;
  shadowed.meshes.push_back(rectangle(at.x - 0.12f, at.y - 0.12f, at.x + 0.12f, at.y + 0.12f, at.z,
                                      {128, 128, 128, 255}));
  const Lighting light;
  const float albedo = linear_from_srgb(128 / 255.0f);
  const SurfacePoint point{.albedo = {albedo, albedo, albedo},
                           .normal = {0, 0, 1},
                           .to_view = {0, 0, 1},
                           .ambient = mix(light.ground_colour, light.sky_colour, 0.5f)};
  const Rendering dark = render(shadowed), bright = render(open);
  // The blocker also hides a little of the sky: at most its solid angle's share.
  const double expected = 255 * srgb_from_linear(shade(light, point, 0).y);
  EXPECT_LE(dark.colour.at(8, 8)[1], expected + 1.5);
  EXPECT_GE(dark.colour.at(8, 8)[1], expected * 0.93);
  EXPECT_GT(bright.colour.at(8, 8)[1], dark.colour.at(8, 8)[1] + 40);
}

TEST(Renderer, TransparentLayersCompositeInOrder) {
  Person person;
  person.meshes.push_back(rectangle(-0.05f, -0.05f, 0.05f, 0.05f, 0, {0, 0, 120, 255}));
  person.meshes.push_back(rectangle(-0.05f, -0.05f, 0.05f, 0.05f, 0.02f, {120, 0, 0, 128}));
  person.meshes.back().material.casts_shadow = false;
  const Rendering image = render(person);
  EXPECT_EQ(*image.alpha.at(8, 8), 255);
  Person alone;
  alone.meshes.push_back(rectangle(-0.05f, -0.05f, 0.05f, 0.05f, 0.02f, {120, 0, 0, 255}));
  const float red = linear_from_srgb(render(alone).colour.at(8, 8)[0] / 255.0f);
  EXPECT_NEAR(image.colour.at(8, 8)[0] / 255.0, srgb_from_linear(red * 128 / 255), 0.012)
      << "the front layer's share of its own red, in linear light";
  EXPECT_GT(image.colour.at(8, 8)[2], 40) << "the back shows through";
}

TEST(Renderer, FullyTransparentTexelsAreNotThere) {
  Person person;
  person.meshes.push_back(rectangle(-0.05f, -0.05f, 0.05f, 0.05f, 0, {255, 255, 255, 0}));
  const Rendering image = render(person);
  for (uint8_t alpha : image.alpha.pixels) ASSERT_EQ(alpha, 0);
  for (uint8_t value : image.colour.pixels) ASSERT_EQ(value, 0);
}

// A smooth ball's own triangles must not shadow it where the light faces it (no acne, no terminator
// steps inside the lit side).
TEST(Renderer, ASmoothBallIsLitWithoutAcne) {
  constexpr int kRings = 24, kSegments = 48;
  Mesh ball;
  for (int r = 0; r <= kRings; ++r) {
    for (int s = 0; s < kSegments; ++s) {
      const float theta = 3.14159265f * static_cast<float>(r) / kRings,
                  phi = 6.2831853f * static_cast<float>(s) / kSegments;
      ball.position_m.insert(ball.position_m.end(),
                             {0.07f * std::sin(theta) * std::cos(phi), 0.07f * std::cos(theta),
                              0.07f * std::sin(theta) * std::sin(phi)});
    }
  }
  for (uint32_t r = 0; r < kRings; ++r) {
    for (uint32_t s = 0; s < kSegments; ++s) {
      const uint32_t a = r * kSegments + s, b = r * kSegments + (s + 1) % kSegments,
                     c = a + kSegments, d = b + kSegments;
      ball.triangles.insert(ball.triangles.end(), {a, b, c, b, d, c});
    }
  }
  ball.uv = {0.5f, 0.5f};
  ball.uv_triangles.assign(ball.triangles.size(), 0);
  ball.skin_joints.assign(size_t{ball.vertex_count()} * kSkinInfluences, 0);
  ball.skin_weights.assign(size_t{ball.vertex_count()} * kSkinInfluences, 0);
  for (uint32_t v = 0; v < ball.vertex_count(); ++v)
    ball.skin_weights[size_t{v} * kSkinInfluences] = 1;
  ball.material.colour = flat_texture({128, 128, 128, 255});
  Person person;
  person.meshes.push_back(ball);
  Renderer renderer(person);
  renderer.set_pose(std::vector<Affine>(1));
  Camera camera = front_camera();
  camera.width_px = camera.height_px = 160;
  camera.fx_px = camera.fy_px = 4000;
  camera.cx_px = camera.cy_px = 80;
  const Rendering image = renderer.render(camera);
  const Lighting light;
  double worst = 0;
  int checked = 0;
  for (uint32_t y = 0; y < 160; ++y) {
    for (uint32_t x = 0; x < 160; ++x) {
      const float px = (static_cast<float>(x) - 79.5f) / 1000,
                  py = (79.5f - static_cast<float>(y)) / 1000;
      const float rr = px * px + py * py;
      if (rr > 0.06f * 0.06f) continue;
      const Vec3 normal = Vec3{px, py, std::sqrt(0.07f * 0.07f - rr)} * (1 / 0.07f);
      const float nl = dot(normal, light.key_direction);
      if (nl < 0.08f) continue;
      SurfacePoint point{.normal = normal, .to_view = {0, 0, 1}, .ambient = {}};
      const float albedo = linear_from_srgb(128 / 255.0f);
      point.albedo = {albedo, albedo, albedo};
      // On a ball nothing hides the sky: mean of a sky linear in y over the cosine lobe is its
      // value at 2/3 of the pole's height.
      point.ambient = mix(light.ground_colour, light.sky_colour, 0.5f + 0.5f * normal.y * 2 / 3);
      const double expected = 255 * srgb_from_linear(shoulder(shade(light, point, 1).y));
      worst = std::max(worst, std::fabs(expected - image.colour.at(x, y)[1]));
      ++checked;
    }
  }
  EXPECT_GT(checked, 4000);
  EXPECT_LT(worst, 6.0) << "of 255";
  RecordProperty("largest_error_of_255", std::to_string(worst));
}

}  // namespace
}  // namespace figurine::capture::renderer_test
