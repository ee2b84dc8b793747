#include "toolchain/capture/cover.h"

#include <embree4/rtcore.h>

#include <cstring>

#include "figurine/check.h"
#include "toolchain/body/surface.h"

namespace figurine::capture {

std::vector<uint8_t> covered_vertices(const Mesh& mesh, const Mesh& garment,
                                      const CoverReach& reach) {
  RTCDevice device = rtcNewDevice("threads=1,isa=avx2");
  FIG_CHECK(device != nullptr, "Embree gives a device");
  RTCScene scene = rtcNewScene(device);
  RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
  void* vertices = rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                                           12, garment.vertex_count());
  std::memcpy(vertices, garment.position_m.data(), garment.position_m.size() * sizeof(float));
  void* triangles = rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                                            12, garment.triangle_count());
  std::memcpy(triangles, garment.triangles.data(), garment.triangles.size() * sizeof(uint32_t));
  rtcCommitGeometry(geometry);
  rtcAttachGeometry(scene, geometry);
  rtcReleaseGeometry(geometry);
  rtcCommitScene(scene);

  const std::vector<float> normals = body::vertex_normals(mesh.position_m, mesh.triangles);
  std::vector<uint8_t> covered(mesh.vertex_count(), 0);
  for (size_t v = 0; v < covered.size(); ++v) {
    const Vec3 normal = load(&normals[v * 3]);
    const Vec3 from = load(&mesh.position_m[v * 3]) - normal * reach.inward_m;
    RTCRay ray;
    ray.org_x = from.x, ray.org_y = from.y, ray.org_z = from.z;
    ray.dir_x = normal.x, ray.dir_y = normal.y, ray.dir_z = normal.z;
    ray.tnear = 0, ray.tfar = reach.inward_m + reach.outward_m;
    ray.time = 0;
    ray.mask = ~0u;
    ray.id = 0;
    ray.flags = 0;
    rtcOccluded1(scene, &ray, nullptr);
    covered[v] = ray.tfar < 0;
  }
  rtcReleaseScene(scene);
  rtcReleaseDevice(device);
  return covered;
}

void remove_triangles(Mesh& mesh, const std::vector<uint8_t>& marked) {
  size_t kept = 0;
  for (size_t t = 0; t < mesh.triangles.size(); t += 3) {
    if (marked[mesh.triangles[t]] && marked[mesh.triangles[t + 1]] && marked[mesh.triangles[t + 2]])
      continue;
    for (size_t c = 0; c < 3; ++c) {
      mesh.triangles[kept + c] = mesh.triangles[t + c];
      mesh.uv_triangles[kept + c] = mesh.uv_triangles[t + c];
    }
    kept += 3;
  }
  mesh.triangles.resize(kept);
  mesh.uv_triangles.resize(kept);
}

}  // namespace figurine::capture
