#include "toolchain/capture/renderer.h"

#include <embree4/rtcore.h>
#include <xmmintrin.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <utility>

#include "figurine/check.h"
#include "toolchain/body/surface.h"
#include "toolchain/capture/shading.h"

namespace figurine::capture {
namespace {

constexpr int kLanes = 8;            // samples of a pixel, traced as one packet
constexpr int kMaxLayers = 24;       // of transparent hair behind one sample
constexpr float kOpaque = 0.985f;    // alpha from which nothing behind is looked for
constexpr float kInvisible = 0.02f;  // alpha below which a hit is passed over
constexpr int kAmbientDirections = 64;
constexpr float kAmbientReach_m = 1.5f;
constexpr float kLeastCosine = 0.03f;  // of a direction to the normal, to be looked in
constexpr float kFoldShade =
    2.5f;  // share of the sky that a fold as high as its wavelength would win or lose
constexpr float kSurfaceGap_m = 0.0008f;  // ray origins are lifted by this
constexpr unsigned kAllMask = ~0u, kShadowMask = 2u, kVisibleMask = 1u;

// Eight samples with distinct sixteenths on both axes and in the light's disc: the standard
// 8-sample rotated pattern. The same for every pixel: a fixed pattern leaves no noise in reference
// images.
constexpr std::array<std::array<float, 2>, kLanes> kPixelPattern = {{{9.f / 16, 5.f / 16},
                                                                     {7.f / 16, 11.f / 16},
                                                                     {13.f / 16, 9.f / 16},
                                                                     {5.f / 16, 3.f / 16},
                                                                     {3.f / 16, 13.f / 16},
                                                                     {1.f / 16, 7.f / 16},
                                                                     {11.f / 16, 15.f / 16},
                                                                     {15.f / 16, 1.f / 16}}};

// In the middle of an opaque surface, where all eight hits are neighbours, four of them are shaded
// and stand for two each: a rotated grid of their own (the sample at the other end of the arrow is
// the nearest). Outlines, hair and steep surfaces keep all eight.
constexpr std::array<int, kLanes> kStandsFor = {2, 6, 2, 3, 5, 5, 6, 3};
constexpr float kNeighbours = 3;  // depths within a pixel, in pixel widths

// Points of a disc, one a lane, by the golden angle.
std::array<std::array<float, 2>, kLanes> light_pattern() {
  std::array<std::array<float, 2>, kLanes> out;
  for (int i = 0; i < kLanes; ++i) {
    const float r = std::sqrt((static_cast<float>(i) + 0.5f) / kLanes),
                angle = 2.3999632f * static_cast<float>(i);
    out[i] = {r * std::cos(angle), r * std::sin(angle)};
  }
  return out;
}

// Directions spread evenly over the sphere (Fibonacci spiral).
std::array<Vec3, kAmbientDirections> sphere_directions() {
  std::array<Vec3, kAmbientDirections> out;
  for (int i = 0; i < kAmbientDirections; ++i) {
    const float y = 1 - 2 * (static_cast<float>(i) + 0.5f) / kAmbientDirections,
                r = std::sqrt(1 - y * y);
    const float angle = 2.3999632f * static_cast<float>(i);
    out[i] = {r * std::cos(angle), y, r * std::sin(angle)};
  }
  return out;
}

// sRGB encoding by a table over the square root, where the curve is nearly straight: error below
// 1e-5 away from black.
class Encoder {
 public:
  Encoder() {
    for (int i = 0; i <= kSteps; ++i) {
      const float s = static_cast<float>(i) / kSteps;
      table_[i] = srgb_from_linear(s * s);
    }
  }
  float operator()(float linear) const {
    const float s = std::sqrt(std::clamp(linear, 0.0f, 1.0f)) * kSteps;
    const int i = std::min(static_cast<int>(s), kSteps - 1);
    return table_[i] + (table_[i + 1] - table_[i]) * (s - static_cast<float>(i));
  }

 private:
  static constexpr int kSteps = 1024;
  std::array<float, kSteps + 1> table_;
};

struct PosedMesh {
  const Mesh* mesh = nullptr;
  std::vector<float> position, normal, ambient;  // [V,3]
  std::vector<uint8_t> used;                     // [V] whether a triangle has it
  std::vector<uint32_t> neighbours;              // those, near ones one after the other
  std::vector<float> texels_per_m;               // [F] of the colour texture
  std::vector<FoldSample> folds;  // of the mesh' fold pattern in this pose, world; empty: none
  std::array<float, 2> uv(uint32_t triangle, float b1, float b2) const {
    const uint32_t* t = &mesh->uv_triangles[size_t{triangle} * 3];
    const float b0 = 1 - b1 - b2;
    const float *p0 = &mesh->uv[size_t{t[0]} * 2], *p1 = &mesh->uv[size_t{t[1]} * 2],
                *p2 = &mesh->uv[size_t{t[2]} * 2];
    return {b0 * p0[0] + b1 * p1[0] + b2 * p2[0], b0 * p0[1] + b1 * p1[1] + b2 * p2[1]};
  }
};

// What a packet of shadow rays has left of the light. Must start with Embree's own context.
struct ShadowContext {
  RTCRayQueryContext base;
  float transmittance[kLanes];
};

float alpha_at(const PosedMesh& posed, uint32_t triangle, float b1, float b2) {
  const std::array<float, 2> uv = posed.uv(triangle, b1, b2);
  return posed.mesh->material.colour->sample(uv[0], uv[1], 0).alpha;
}

// Visible rays pass through what is fully transparent.
void skip_transparent(const RTCFilterFunctionNArguments* a) {
  const auto& posed = *static_cast<const PosedMesh*>(a->geometryUserPtr);
  for (unsigned i = 0; i < a->N; ++i) {
    if (a->valid[i] != -1) continue;
    if (alpha_at(posed, RTCHitN_primID(a->hit, a->N, i), RTCHitN_u(a->hit, a->N, i),
                 RTCHitN_v(a->hit, a->N, i)) < kInvisible)
      a->valid[i] = 0;
  }
}

// Shadow rays lose light at every layer, in any order, and stop where next to nothing is left.
void fade_shadow(const RTCFilterFunctionNArguments* a) {
  const auto& posed = *static_cast<const PosedMesh*>(a->geometryUserPtr);
  auto* context = reinterpret_cast<ShadowContext*>(a->context);
  for (unsigned i = 0; i < a->N; ++i) {
    if (a->valid[i] != -1) continue;
    float& left = context->transmittance[RTCRayN_id(a->ray, a->N, i)];
    left *= 1 - alpha_at(posed, RTCHitN_primID(a->hit, a->N, i), RTCHitN_u(a->hit, a->N, i),
                         RTCHitN_v(a->hit, a->N, i));
    if (left > 0.02f) a->valid[i] = 0;
  }
}

// The used vertices along a Z-order curve through the rest pose: a thousand cells a side.
std::vector<uint32_t> along_a_curve(const Mesh& mesh, std::span<const uint8_t> used) {
  constexpr uint32_t kBits = 10;
  Vec3 low, high;
  for (uint32_t v = 0; v < mesh.vertex_count(); ++v) {
    const Vec3 p = load(&mesh.position_m[size_t{v} * 3]);
    if (v == 0) low = high = p;
    low = {std::min(low.x, p.x), std::min(low.y, p.y), std::min(low.z, p.z)};
    high = {std::max(high.x, p.x), std::max(high.y, p.y), std::max(high.z, p.z)};
  }
  const Vec3 size = high - low;
  const float side = std::max({size.x, size.y, size.z, 1e-6f});
  const auto cell = [&](float x) { return static_cast<uint32_t>(x / side * ((1u << kBits) - 1)); };
  std::vector<std::pair<uint32_t, uint32_t>> order;  // place on the curve, vertex
  for (uint32_t v = 0; v < mesh.vertex_count(); ++v) {
    if (used[v] == 0) continue;
    const Vec3 p = load(&mesh.position_m[size_t{v} * 3]) - low;
    const uint32_t cells[3] = {cell(p.x), cell(p.y), cell(p.z)};
    uint32_t place = 0;
    for (uint32_t bit = kBits; bit-- > 0;) {
      for (const uint32_t c : cells) place = place << 1 | (c >> bit & 1);
    }
    order.emplace_back(place, v);
  }
  std::sort(order.begin(), order.end());
  std::vector<uint32_t> out;
  for (const auto& entry : order) out.push_back(entry.second);
  return out;
}

// Texels a metre of every triangle, for choosing the texture's level. Measured in the rest pose:
// skinning hardly stretches.
std::vector<float> texel_density(const Mesh& mesh) {
  std::vector<float> out(mesh.triangle_count());
  const Texture& texture = *mesh.material.colour;
  const auto w = static_cast<float>(texture.width_px()),
             h = static_cast<float>(texture.height_px());
  for (uint32_t f = 0; f < mesh.triangle_count(); ++f) {
    const uint32_t *t = &mesh.triangles[size_t{f} * 3], *s = &mesh.uv_triangles[size_t{f} * 3];
    const Vec3 p0 = load(&mesh.position_m[size_t{t[0]} * 3]),
               p1 = load(&mesh.position_m[size_t{t[1]} * 3]),
               p2 = load(&mesh.position_m[size_t{t[2]} * 3]);
    const float area = length(cross(p1 - p0, p2 - p0));
    const auto uv = [&](int c, int i) { return mesh.uv[size_t{s[c]} * 2 + i]; };
    const float texels = std::fabs((uv(1, 0) - uv(0, 0)) * (uv(2, 1) - uv(0, 1)) -
                                   (uv(1, 1) - uv(0, 1)) * (uv(2, 0) - uv(0, 0))) *
                         w * h;
    out[f] = area > 1e-12f ? std::sqrt(texels / area) : 1.0f;
  }
  return out;
}

// [V,9] linear parts of the blended transforms, row-major.
std::vector<float> linear_parts(const Mesh& mesh, std::span<const Affine> world_from_rest) {
  std::vector<float> out(size_t{mesh.vertex_count()} * 9);
  for (size_t v = 0; v < mesh.vertex_count(); ++v) {
    const Affine transform = blend(world_from_rest, &mesh.skin_joints[v * kSkinInfluences],
                                   &mesh.skin_weights[v * kSkinInfluences]);
    for (size_t row = 0; row < 3; ++row)
      std::copy_n(&transform.m[row * 4], 3, &out[v * 9 + row * 3]);
  }
  return out;
}

// Light gathered at the coarse vertices knows nothing of folds: hollows see less of the sky than
// ridges do.
float fold_openness(float height_m, float wavelength_m) {
  return std::clamp(1 + kFoldShade * height_m / wavelength_m, 0.6f, 1.1f);
}

}  // namespace

struct Renderer::Scene {
  RTCDevice device = nullptr;
  RTCScene scene = nullptr;
  std::vector<PosedMesh> meshes;
  Lighting lighting;
  FoldMode fold_mode = FoldMode::kPose;
  Encoder encode;
  std::array<std::array<float, 2>, kLanes> light_points = light_pattern();
  std::array<Vec3, kAmbientDirections> directions = sphere_directions();
  Vec3 key_u, key_v;  // span the key light's disc

  void build();
  void gather_ambient();
  void gather_ambient(PosedMesh& posed, std::span<const uint32_t> vertices) const;
  struct Surface {
    SurfacePoint point;
    Vec3 shadow_origin;
    float alpha = 0;
  };
  Surface surface(const RTCRayHit8& hits, int lane, float pixel_angle) const;
  bool is_interior(const RTCRayHit8& hits, float pixel_angle) const;
  void trace_pixel(const Camera& camera, uint32_t px, uint32_t py, Vec3 eye, const float* rotation,
                   float pixel_angle, float* out) const;
};

Renderer::Renderer(const Person& person, FoldMode folds) : scene_(std::make_unique<Scene>()) {
  scene_->fold_mode = folds;
  // One thread: several renderers run side by side. One instruction set, so that the same bytes
  // come from CPUs with and without AVX-512.
  scene_->device = rtcNewDevice("threads=1,isa=avx2");
  FIG_CHECK(scene_->device != nullptr, "Embree gives a device");
  const Vec3 l = scene_->lighting.key_direction;
  scene_->key_u = normalized(cross(l, {0, 1, 0}));
  scene_->key_v = cross(scene_->key_u, l);
  for (const Mesh& mesh : person.meshes) {
    PosedMesh posed;
    posed.mesh = &mesh;
    posed.used.assign(mesh.vertex_count(), 0);
    for (uint32_t v : mesh.triangles) posed.used[v] = 1;
    posed.neighbours = along_a_curve(mesh, posed.used);
    posed.texels_per_m = texel_density(mesh);
    scene_->meshes.push_back(std::move(posed));
  }
}

Renderer::~Renderer() {
  if (scene_->scene != nullptr) rtcReleaseScene(scene_->scene);
  rtcReleaseDevice(scene_->device);
}

void Renderer::set_pose(std::span<const Affine> world_from_rest) {
  _mm_setcsr(_mm_getcsr() |
             0x8040);  // flush denormals, as Embree asks of every thread that renders
  for (PosedMesh& posed : scene_->meshes) {
    posed.position = body::skin_positions(posed.mesh->position_m, posed.mesh->skin_joints,
                                          posed.mesh->skin_weights, world_from_rest);
    posed.normal = body::vertex_normals(posed.position, posed.mesh->triangles);
    if (posed.mesh->folds != nullptr && scene_->fold_mode != FoldMode::kOff) {
      const bool rest = scene_->fold_mode == FoldMode::kRest;
      posed.folds = posed.mesh->folds->evaluate(rest ? posed.mesh->position_m : posed.position);
      posed.mesh->folds->turn(posed.folds, linear_parts(*posed.mesh, world_from_rest));
    }
  }
  scene_->build();
  scene_->gather_ambient();
}

void Renderer::Scene::build() {
  if (scene != nullptr) rtcReleaseScene(scene);
  scene = rtcNewScene(device);
  rtcSetSceneBuildQuality(
      scene, RTC_BUILD_QUALITY_MEDIUM);  // no spatial splits: a filter must see every triangle once
  for (size_t m = 0; m < meshes.size(); ++m) {
    PosedMesh& posed = meshes[m];
    RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
    void* vertices = rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                                             12, posed.position.size() / 3);
    std::memcpy(vertices, posed.position.data(), posed.position.size() * sizeof(float));
    void* triangles = rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                                              12, posed.mesh->triangle_count());
    std::memcpy(triangles, posed.mesh->triangles.data(),
                posed.mesh->triangles.size() * sizeof(uint32_t));
    rtcSetGeometryUserData(geometry, &posed);
    rtcSetGeometryMask(geometry,
                       kVisibleMask | (posed.mesh->material.casts_shadow ? kShadowMask : 0));
    if (posed.mesh->material.colour->has_alpha()) {
      rtcSetGeometryIntersectFilterFunction(geometry, skip_transparent);
      rtcSetGeometryOccludedFilterFunction(geometry, fade_shadow);
    }
    rtcCommitGeometry(geometry);
    rtcAttachGeometryByID(scene, geometry, static_cast<unsigned>(m));
    rtcReleaseGeometry(geometry);
  }
  rtcCommitScene(scene);
}

namespace {

// How much of each ray's way is free: 1 nothing there, 0 blocked.
void trace_shadows(RTCScene scene, const Vec3* origin, const Vec3* direction, const int* valid,
                   float reach, bool coherent, float* visible) {
  alignas(32) RTCRay8 rays;
  alignas(32) int active[kLanes];
  ShadowContext context;
  rtcInitRayQueryContext(&context.base);
  for (int i = 0; i < kLanes; ++i) {
    active[i] = valid[i];
    context.transmittance[i] = 1;
    rays.org_x[i] = origin[i].x, rays.org_y[i] = origin[i].y, rays.org_z[i] = origin[i].z;
    rays.dir_x[i] = direction[i].x, rays.dir_y[i] = direction[i].y, rays.dir_z[i] = direction[i].z;
    rays.tnear[i] = 0;
    rays.tfar[i] = reach;
    rays.time[i] = 0;
    rays.mask[i] = kShadowMask;
    rays.id[i] = static_cast<unsigned>(i);
    rays.flags[i] = 0;
  }
  RTCOccludedArguments arguments;
  rtcInitOccludedArguments(&arguments);
  arguments.context = &context.base;
  arguments.flags = coherent ? RTC_RAY_QUERY_FLAG_COHERENT : RTC_RAY_QUERY_FLAG_INCOHERENT;
  rtcOccluded8(active, scene, &rays, &arguments);
  for (int i = 0; i < kLanes; ++i) visible[i] = rays.tfar[i] < 0 ? 0 : context.transmittance[i];
}

}  // namespace

// Rays of neighbours in one direction go through the same boxes, so a packet is eight vertices and
// not eight directions of one.
void Renderer::Scene::gather_ambient() {
  for (PosedMesh& posed : meshes) {
    posed.ambient.assign(posed.position.size(), 0);
    for (size_t first = 0; first < posed.neighbours.size(); first += kLanes) {
      const size_t count = std::min<size_t>(kLanes, posed.neighbours.size() - first);
      gather_ambient(posed, std::span(posed.neighbours).subspan(first, count));
    }
  }
}

void Renderer::Scene::gather_ambient(PosedMesh& posed, std::span<const uint32_t> vertices) const {
  Vec3 normal[kLanes], origin[kLanes], to[kLanes], sum[kLanes];
  float weight[kLanes], weight_sum[kLanes] = {0}, visible[kLanes];
  int valid[kLanes] = {0};
  for (size_t i = 0; i < kLanes; ++i) {
    const size_t v = vertices[std::min(i, vertices.size() - 1)];
    normal[i] = load(&posed.normal[v * 3]);
    origin[i] = load(&posed.position[v * 3]) + normal[i] * 0.002f;
  }
  for (const Vec3& direction : directions) {
    bool any = false;
    for (size_t i = 0; i < kLanes; ++i) {
      to[i] = direction;
      weight[i] = dot(direction, normal[i]);
      valid[i] = i < vertices.size() && weight[i] >= kLeastCosine ? -1 : 0;
      any = any || valid[i] != 0;
    }
    if (!any) continue;
    trace_shadows(scene, origin, to, valid, kAmbientReach_m, true, visible);
    const Vec3 sky = sky_radiance(lighting, direction);
    for (size_t i = 0; i < vertices.size(); ++i) {
      if (valid[i] == 0) continue;
      const float open = lighting.bounce + (1 - lighting.bounce) * visible[i];
      sum[i] += sky * (weight[i] * open);
      weight_sum[i] += weight[i];
    }
  }
  for (size_t i = 0; i < vertices.size(); ++i) {
    const Vec3 mean = weight_sum[i] > 0 ? sum[i] * (1 / weight_sum[i]) : sum[i];
    float* const ambient = &posed.ambient[size_t{vertices[i]} * 3];
    ambient[0] = mean.x, ambient[1] = mean.y, ambient[2] = mean.z;
  }
}

Renderer::Scene::Surface Renderer::Scene::surface(const RTCRayHit8& hits, int lane,
                                                  float pixel_angle) const {
  const PosedMesh& posed = meshes[hits.hit.geomID[lane]];
  const Mesh& mesh = *posed.mesh;
  const uint32_t triangle = hits.hit.primID[lane];
  const float b1 = hits.hit.u[lane], b2 = hits.hit.v[lane], b0 = 1 - b1 - b2;
  const uint32_t* t = &mesh.triangles[size_t{triangle} * 3];
  const Vec3 p[3] = {load(&posed.position[size_t{t[0]} * 3]),
                     load(&posed.position[size_t{t[1]} * 3]),
                     load(&posed.position[size_t{t[2]} * 3])};
  const Vec3 n[3] = {load(&posed.normal[size_t{t[0]} * 3]), load(&posed.normal[size_t{t[1]} * 3]),
                     load(&posed.normal[size_t{t[2]} * 3])};
  const Vec3 a[3] = {load(&posed.ambient[size_t{t[0]} * 3]), load(&posed.ambient[size_t{t[1]} * 3]),
                     load(&posed.ambient[size_t{t[2]} * 3])};
  const Vec3 to_view =
      normalized(-Vec3{hits.ray.dir_x[lane], hits.ray.dir_y[lane], hits.ray.dir_z[lane]});

  const std::array<float, 2> uv = posed.uv(triangle, b1, b2);
  const float footprint_m = hits.ray.tfar[lane] * pixel_angle;
  const float level = std::log2(std::max(posed.texels_per_m[triangle] * footprint_m, 1e-6f)) -
                      1;  // at least four samples share the pixel
  const Rgba texel = mesh.material.colour->sample(uv[0], uv[1], level);

  Surface out;
  out.alpha = texel.alpha;
  out.point.albedo =
      (texel.alpha > 0 ? texel.colour * (1 / texel.alpha) : texel.colour) * mesh.material.tint;
  out.point.to_view = to_view;
  out.point.surfacing = mesh.material.surfacing;
  out.point.ambient = a[0] * b0 + a[1] * b1 + a[2] * b2;

  Vec3 geometric = normalized(cross(p[1] - p[0], p[2] - p[0]));
  Vec3 normal = normalized(n[0] * b0 + n[1] * b1 + n[2] * b2);
  if (!posed.folds.empty()) {
    const FoldSample fold = mesh.folds->at(posed.folds, triangle, b1, b2);
    out.point.ambient =
        out.point.ambient * fold_openness(fold.height_m, mesh.folds->wavelength_m());
    normal = normalized(normal - (fold.gradient - normal * dot(fold.gradient, normal)));
  }
  if (mesh.material.normal) {
    // Tangents from the texture coordinates; v is down, normal maps have green up.
    const uint32_t* s = &mesh.uv_triangles[size_t{triangle} * 3];
    const auto c = [&](int corner, int i) { return mesh.uv[size_t{s[corner]} * 2 + i]; };
    const float du1 = c(1, 0) - c(0, 0), dv1 = c(1, 1) - c(0, 1), du2 = c(2, 0) - c(0, 0),
                dv2 = c(2, 1) - c(0, 1);
    const float determinant = du1 * dv2 - du2 * dv1;
    if (std::fabs(determinant) > 1e-12f) {
      const Vec3 e1 = p[1] - p[0], e2 = p[2] - p[0];
      Vec3 tangent = (e1 * dv2 - e2 * dv1) * (1 / determinant);
      Vec3 up = (e1 * du2 - e2 * du1) * (1 / determinant);  // minus the derivative along v
      tangent = normalized(tangent - normal * dot(tangent, normal));
      up = normalized(up - normal * dot(up, normal));
      const Vec3 bump = mesh.material.normal->sample(uv[0], uv[1], level).colour;
      normal = normalized(tangent * bump.x + up * bump.y + normal * std::max(bump.z, 0.2f));
    }
  }
  float side = 1;
  if (dot(geometric, to_view) < 0) {  // the inside of a sleeve, the back of a strand
    side = -1;
    geometric = -geometric;
    normal = -normal;
    if (mesh.material.surfacing != Surfacing::kHair) out.point.ambient = out.point.ambient * 0.5f;
  }
  out.point.normal = normal;

  // Hanika's lift: the shadow ray starts above the smooth surface that the vertex normals pretend,
  // not on the flat triangle.
  const Vec3 position = p[0] * b0 + p[1] * b1 + p[2] * b2;
  const float b[3] = {b0, b1, b2};
  Vec3 lifted = position;
  for (int k = 0; k < 3; ++k) {
    const Vec3 nk = n[k] * side;
    lifted += nk * (-b[k] * std::min(0.0f, dot(position - p[k], nk)));
  }
  out.shadow_origin = lifted + geometric * kSurfaceGap_m;
  return out;
}

bool Renderer::Scene::is_interior(const RTCRayHit8& hits, float pixel_angle) const {
  const unsigned mesh = hits.hit.geomID[0];
  if (mesh == RTC_INVALID_GEOMETRY_ID || meshes[mesh].mesh->material.surfacing == Surfacing::kHair)
    return false;
  float near = hits.ray.tfar[0], far = near;
  for (int i = 1; i < kLanes; ++i) {
    if (hits.hit.geomID[i] != mesh) return false;
    near = std::min(near, hits.ray.tfar[i]);
    far = std::max(far, hits.ray.tfar[i]);
  }
  return far - near < kNeighbours * near * pixel_angle;
}

void Renderer::Scene::trace_pixel(const Camera& camera, uint32_t px, uint32_t py, Vec3 eye,
                                  const float* rotation, float pixel_angle, float* out) const {
  alignas(32) RTCRayHit8 hits;
  alignas(32) int active[kLanes];
  for (int i = 0; i < kLanes; ++i) {
    const float x = (static_cast<float>(px) + kPixelPattern[i][0] - camera.cx_px) / camera.fx_px;
    const float y = (static_cast<float>(py) + kPixelPattern[i][1] - camera.cy_px) / camera.fy_px;
    hits.ray.org_x[i] = eye.x, hits.ray.org_y[i] = eye.y, hits.ray.org_z[i] = eye.z;
    // world = R^T view; the direction keeps view z = 1, so tfar is depth.
    hits.ray.dir_x[i] = rotation[0] * x + rotation[4] * y + rotation[8];
    hits.ray.dir_y[i] = rotation[1] * x + rotation[5] * y + rotation[9];
    hits.ray.dir_z[i] = rotation[2] * x + rotation[6] * y + rotation[10];
    hits.ray.tnear[i] = 0;
    hits.ray.tfar[i] = std::numeric_limits<float>::infinity();
    hits.ray.time[i] = 0;
    hits.ray.mask[i] = kAllMask;
    hits.ray.id[i] = static_cast<unsigned>(i);
    hits.ray.flags[i] = 0;
    hits.hit.geomID[i] = RTC_INVALID_GEOMETRY_ID;
    active[i] = -1;
  }
  Vec3 colour[kLanes];
  float through[kLanes];
  std::fill(through, through + kLanes, 1.0f);
  RTCIntersectArguments arguments;
  rtcInitIntersectArguments(&arguments);
  arguments.flags = RTC_RAY_QUERY_FLAG_COHERENT;
  bool interior = false;
  for (int layer = 0; layer < kMaxLayers; ++layer) {
    rtcIntersect8(active, scene, &hits, &arguments);
    if (layer == 0 && is_interior(hits, pixel_angle)) {
      interior = true;
      for (int i = 0; i < kLanes; ++i) active[i] = kStandsFor[i] == i ? -1 : 0;
    }
    Surface surfaces[kLanes];
    Vec3 origin[kLanes], direction[kLanes];
    int wants_light[kLanes];
    bool any_hit = false, any_light = false;
    for (int i = 0; i < kLanes; ++i) {
      wants_light[i] = 0;
      direction[i] = lighting.key_direction;
      if (active[i] != 0 && hits.hit.geomID[i] == RTC_INVALID_GEOMETRY_ID) active[i] = 0;
      if (active[i] == 0) continue;
      any_hit = true;
      surfaces[i] = surface(hits, i, pixel_angle);
      origin[i] = surfaces[i].shadow_origin;
      // Wrapped light reaches past the terminator, where a ray towards the light would start
      // inside: it goes along the horizon instead.
      const Vec3 normal = surfaces[i].point.normal;
      const float nl = dot(normal, lighting.key_direction),
                  wrap = wrap_of(surfaces[i].point.surfacing).x;
      if (nl <= -wrap) continue;
      const Vec3 towards =
          lighting.key_direction +
          (key_u * light_points[i][0] + key_v * light_points[i][1]) * lighting.key_radius;
      direction[i] = normalized(nl < 0.05f ? towards + normal * (0.05f - nl) : towards);
      wants_light[i] = -1;
      any_light = true;
    }
    if (!any_hit) break;
    float visible[kLanes] = {0};
    if (any_light)
      trace_shadows(scene, origin, direction, wants_light, std::numeric_limits<float>::infinity(),
                    true, visible);
    bool any_left = false;
    for (int i = 0; i < kLanes; ++i) {
      if (active[i] == 0) continue;
      const float alpha = surfaces[i].alpha >= kOpaque ? 1.0f : surfaces[i].alpha;
      colour[i] += shade(lighting, surfaces[i].point, wants_light[i] != 0 ? visible[i] : 0) *
                   (through[i] * alpha);
      through[i] *= 1 - alpha;
      if (through[i] < kInvisible) {
        through[i] = 0;
        active[i] = 0;
        continue;
      }
      any_left = true;
      hits.ray.tnear[i] = hits.ray.tfar[i] * 1.000002f + 1e-6f;
      hits.ray.tfar[i] = std::numeric_limits<float>::infinity();
      hits.hit.geomID[i] = RTC_INVALID_GEOMETRY_ID;
    }
    if (!any_left) break;
  }
  if (interior) {
    for (int i = 0; i < kLanes; ++i)
      colour[i] = colour[kStandsFor[i]], through[i] = through[kStandsFor[i]];
  }
  // Encoded first, averaged after: images are blended as stored (docs/numerics.md).
  Vec3 sum;
  float alpha_sum = 0;
  for (int i = 0; i < kLanes; ++i) {
    const float alpha = 1 - through[i];
    if (alpha <= 0) continue;
    const Vec3 straight = colour[i] * (1 / alpha);
    sum += Vec3{encode(shoulder(straight.x)), encode(shoulder(straight.y)),
                encode(shoulder(straight.z))} *
           alpha;
    alpha_sum += alpha;
  }
  out[0] = sum.x / kLanes, out[1] = sum.y / kLanes, out[2] = sum.z / kLanes,
  out[3] = alpha_sum / kLanes;
}

Renderer::Bounds Renderer::bounds() const {
  constexpr float kFar = std::numeric_limits<float>::max();
  Bounds b{{kFar, kFar, kFar}, {-kFar, -kFar, -kFar}};
  for (const PosedMesh& posed : scene_->meshes) {
    for (size_t v = 0; v < posed.used.size(); ++v) {
      if (posed.used[v] == 0) continue;
      const Vec3 p = load(&posed.position[v * 3]);
      b.low = {std::min(b.low.x, p.x), std::min(b.low.y, p.y), std::min(b.low.z, p.z)};
      b.high = {std::max(b.high.x, p.x), std::max(b.high.y, p.y), std::max(b.high.z, p.z)};
    }
  }
  return b;
}

Rendering Renderer::render(const Camera& camera) const {
  FIG_CHECK(scene_->scene != nullptr, "set_pose comes before render");
  FIG_CHECK(validate_camera(camera).ok(), "a valid camera");
  _mm_setcsr(_mm_getcsr() | 0x8040);
  const float* m = camera.view_from_world.data();
  const float width = static_cast<float>(camera.width_px),
              height = static_cast<float>(camera.height_px);
  // Only pixels inside the figure's projected box are traced. A vertex behind the camera widens it
  // to the whole image.
  float left = width, top = height, right = 0, bottom = 0;
  for (const PosedMesh& posed : scene_->meshes) {
    for (size_t v = 0; v < posed.used.size(); ++v) {
      if (posed.used[v] == 0) continue;
      const float* p = &posed.position[v * 3];
      const float z = m[8] * p[0] + m[9] * p[1] + m[10] * p[2] + m[11];
      if (!(z > 0.01f)) {
        left = top = 0, right = width, bottom = height;
        continue;
      }
      const float x =
          camera.fx_px * (m[0] * p[0] + m[1] * p[1] + m[2] * p[2] + m[3]) / z + camera.cx_px;
      const float y =
          camera.fy_px * (m[4] * p[0] + m[5] * p[1] + m[6] * p[2] + m[7]) / z + camera.cy_px;
      left = std::min(left, x), right = std::max(right, x), top = std::min(top, y),
      bottom = std::max(bottom, y);
    }
  }
  const auto clip = [](float x, float size) {
    return static_cast<uint32_t>(std::clamp(x, 0.0f, size));
  };
  const uint32_t x0 = clip(std::floor(left), width), x1 = clip(std::ceil(right) + 1, width);
  const uint32_t y0 = clip(std::floor(top), height), y1 = clip(std::ceil(bottom) + 1, height);

  // The eye is where the view vector is zero: -R^T t.
  const Vec3 eye{-(m[0] * m[3] + m[4] * m[7] + m[8] * m[11]),
                 -(m[1] * m[3] + m[5] * m[7] + m[9] * m[11]),
                 -(m[2] * m[3] + m[6] * m[7] + m[10] * m[11])};
  Rendering out{ports::ImageU8(camera.width_px, camera.height_px, 3),
                ports::ImageU8(camera.width_px, camera.height_px, 1)};
  const auto byte = [](float x) { return static_cast<uint8_t>(std::min(255.0f, x * 255 + 0.5f)); };
  for (uint32_t y = y0; y < y1; ++y) {
    for (uint32_t x = x0; x < x1; ++x) {
      float pixel[4];
      scene_->trace_pixel(camera, x, y, eye, m, 1 / camera.fx_px, pixel);
      uint8_t* rgb = out.colour.at(x, y);
      for (int c = 0; c < 3; ++c) rgb[c] = byte(pixel[c]);
      *out.alpha.at(x, y) = byte(pixel[3]);
    }
  }
  return out;
}

}  // namespace figurine::capture
