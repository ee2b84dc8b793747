// Packages, poses and cameras of figurine.h.
#include "runtime/src/c/c_package.h"

#include <algorithm>
#include <cstring>
#include <new>
#include <string>
#include <utility>

#include "figurine/camera.h"
#include "runtime/src/c/report.h"
#include "runtime/src/c/structs.h"

namespace figurine::c {
namespace {

static_assert(FIG_PACKAGE_BODY == static_cast<int>(PackageKind::kBody));
static_assert(FIG_PACKAGE_SAMPLER == static_cast<int>(PackageKind::kSampler));

uint32_t joints_of(const GoldenFrame& golden) {
  return static_cast<uint32_t>(golden.rotations.size() / 4);
}

void describe(const Body& body, fig_package_info& info) {
  info.name = body.name.c_str();
  info.joint_count = body.joint_count();
}

void describe(const Avatar& avatar, fig_package_info& info) {
  info.name = avatar.name.c_str();
  std::copy(avatar.body_hash.begin(), avatar.body_hash.end(), info.body_hash);
  info.joint_count = joints_of(avatar.golden);
  info.holds_f32 = avatar.holds(Precision::kFloat32) ? 1 : 0;
  info.holds_q8 = avatar.holds(Precision::kFixedPoint) ? 1 : 0;
}

void describe(const Motion& motion, fig_package_info& info) {
  info.name = motion.name.c_str();
  info.joint_count = static_cast<uint32_t>(motion.joint_names.size());
  info.frame_count = motion.frame_count;
  info.frames_per_second = motion.frames_per_second;
}

void describe(const Population& population, fig_package_info& info) {
  info.name = population.name.c_str();
  std::copy(population.body_hash.begin(), population.body_hash.end(), info.body_hash);
  info.member_count = static_cast<uint32_t>(population.size());
  info.joint_count = population.size() == 0 ? 0 : joints_of(population.members[0].golden);
  info.holds_f32 = 1;
}

void describe(const Sampler& sampler, fig_package_info& info) {
  info.name = sampler.name.c_str();
  std::copy(sampler.body_hash.begin(), sampler.body_hash.end(), info.body_hash);
  info.joint_count = joints_of(sampler.golden);
  info.holds_f32 = info.holds_q8 = 1;
}

void describe_content(const Package& package, fig_package_info& info) {
  switch (package.kind()) {
    case PackageKind::kBody:
      return describe(package.body(), info);
    case PackageKind::kAvatar:
      return describe(package.avatar(), info);
    case PackageKind::kMotion:
      return describe(package.motion(), info);
    case PackageKind::kPopulation:
      return describe(package.population(), info);
    case PackageKind::kSampler:
      return describe(package.sampler(), info);
  }
}

Status no_member(const Package& package, uint32_t member) {
  return Status(StatusCode::kNotFound, "member " + std::to_string(member) + ": there are " +
                                           std::to_string(package.population().size()) +
                                           ", from 0");
}

Result<const GoldenFrame*> golden_of(const Package& package, uint32_t member) {
  if (package.kind() == PackageKind::kPopulation) {
    if (member >= package.population().size()) return no_member(package, member);
    return &package.population().members[member].golden;
  }
  if (member != 0) return invalid("member: must be 0 of a package that is no population");
  if (package.kind() == PackageKind::kAvatar) return &package.avatar().golden;
  if (package.kind() == PackageKind::kSampler) return &package.sampler().golden;
  return Status(StatusCode::kMismatch,
                std::string("a ") + to_string(package.kind()) + " has no golden view");
}

fig_camera c_camera(const Camera& camera) {
  fig_camera out = fig_default_camera();
  out.width_px = camera.width_px, out.height_px = camera.height_px;
  out.fx_px = camera.fx_px, out.fy_px = camera.fy_px;
  out.cx_px = camera.cx_px, out.cy_px = camera.cy_px;
  std::copy(camera.view_from_world.begin(), camera.view_from_world.end(), out.view_from_world);
  out.near_m = camera.near_m;
  return out;
}

fig_pose c_pose(const PoseView& pose) {
  fig_pose out = fig_default_pose();
  std::copy(pose.root_translation_m.begin(), pose.root_translation_m.end(), out.root_translation_m);
  out.joint_count = static_cast<uint32_t>(pose.rotations.size() / 4);
  out.rotations = pose.rotations.data();
  return out;
}

// A package that a call looks at.
Result<Pin<PackageObject>> pin_package(fig_package package, PackageKind wanted) {
  Result<Pin<PackageObject>> pinned = handles().pin<PackageObject>(package.id);
  if (!pinned.ok()) return pinned;
  if (Status fits = check_kind((*pinned)->package, wanted); !fits.ok()) return fits;
  return pinned;
}

}  // namespace

Status check_kind(const Package& package, PackageKind wanted) {
  if (package.kind() == wanted) return {};
  const auto with_article = [](PackageKind kind) {
    return std::string(kind == PackageKind::kAvatar ? "an " : "a ") + to_string(kind);
  };
  return Status(StatusCode::kMismatch, "package: " + with_article(wanted) + " is wanted, not " +
                                           with_article(package.kind()));
}

Result<PoseView> pose_of(const fig_pose* given) {
  fig_pose pose = fig_default_pose();
  FIG_RETURN_IF_ERROR(read_struct(given, "pose", pose));
  if (pose.rotations == nullptr) return invalid("pose: rotations is NULL");
  const float* const t = pose.root_translation_m;
  return PoseView{{t[0], t[1], t[2]}, {pose.rotations, size_t{4} * pose.joint_count}};
}

Result<Camera> camera_of(const fig_camera* given) {
  fig_camera camera = fig_default_camera();
  FIG_RETURN_IF_ERROR(read_struct(given, "camera", camera));
  Camera out{.width_px = camera.width_px,
             .height_px = camera.height_px,
             .fx_px = camera.fx_px,
             .fy_px = camera.fy_px,
             .cx_px = camera.cx_px,
             .cy_px = camera.cy_px,
             .near_m = camera.near_m};
  std::copy_n(camera.view_from_world, out.view_from_world.size(), out.view_from_world.begin());
  return out;
}

}  // namespace figurine::c

using namespace figurine;
using namespace figurine::c;

static fig_package_options default_package_options() {
  return {
      .struct_bytes = sizeof(fig_package_options), .name = "package", .copy = 0, .for_drawing = 0};
}
void fig_set_default_package_options(fig_package_options* value, size_t struct_bytes) {
  set_default(default_package_options(), value, struct_bytes);
}

static fig_package_info default_package_info() {
  fig_package_info info{};
  info.struct_bytes = sizeof info;
  info.name = "";
  return info;
}
void fig_set_default_package_info(fig_package_info* value, size_t struct_bytes) {
  set_default(default_package_info(), value, struct_bytes);
}

static fig_joint default_joint() {
  return {.struct_bytes = sizeof(fig_joint), .name = "", .parent = -1, .rest_position_m = {}};
}
void fig_set_default_joint(fig_joint* value, size_t struct_bytes) {
  set_default(default_joint(), value, struct_bytes);
}

static fig_pose default_pose() {
  return {.struct_bytes = sizeof(fig_pose),
          .root_translation_m = {},
          .joint_count = 0,
          .rotations = nullptr};
}
void fig_set_default_pose(fig_pose* value, size_t struct_bytes) {
  set_default(default_pose(), value, struct_bytes);
}

static fig_camera default_camera() {
  const Camera camera;
  fig_camera out{};
  out.struct_bytes = sizeof out;
  std::copy(camera.view_from_world.begin(), camera.view_from_world.end(), out.view_from_world);
  out.near_m = camera.near_m;
  return out;
}
void fig_set_default_camera(fig_camera* value, size_t struct_bytes) {
  set_default(default_camera(), value, struct_bytes);
}

static fig_orbit default_orbit() {
  const OrbitCamera orbit;
  return {.struct_bytes = sizeof(fig_orbit),
          .azimuth_deg = orbit.azimuth_deg,
          .elevation_deg = orbit.elevation_deg,
          .distance_m = orbit.distance_m,
          .vertical_fov_deg = orbit.vertical_fov_deg,
          .target_m = {}};
}
void fig_set_default_orbit(fig_orbit* value, size_t struct_bytes) {
  set_default(default_orbit(), value, struct_bytes);
}

fig_status fig_package_open(const void* bytes, size_t size_bytes,
                            const fig_package_options* options, fig_package* package) {
  FIG_RESERVE_OR_REPORT();
  FIG_REPORT_IF_ERROR(check_out(package, "package"));
  *package = {0};
  fig_package_options read = fig_default_package_options();
  FIG_REPORT_IF_ERROR(read_options(options, "package options", read));
  const std::string name = read.name == nullptr ? "package" : read.name;
  if (bytes == nullptr) return report(invalid(name + ": bytes is NULL"));
  std::span<const std::byte> content(static_cast<const std::byte*>(bytes), size_bytes);
  Buffer<std::byte> copy;
  if (read.copy != 0) {
    if (!copy.ensure(size_bytes)) return report(out_of_memory("a copy of a package"));
    if (size_bytes > 0) std::memcpy(copy.data(), bytes, size_bytes);
    content = {copy.data(), size_bytes};
  }
  Result<Package> opened =
      Package::open(content, name,
                    read.for_drawing != 0 ? OpenOptions::for_drawing(Precision::kFixedPoint, true)
                                          : OpenOptions{});
  if (!opened.ok()) return report(opened.status());
  std::unique_ptr<PackageObject> object(
      new (std::nothrow) PackageObject(std::move(copy), std::move(opened).value()));
  if (object == nullptr) return report(out_of_memory("a package"));
  const Result<uint64_t> handle = handles().add(std::move(object));
  if (!handle.ok()) return report(handle.status());
  package->id = *handle;
  return FIG_OK;
}

fig_status fig_package_close(fig_package package) {
  const MemoryReserve messages;
  return report(handles().remove<PackageObject>(package.id).status());
}

fig_status fig_package_get_info(fig_package package, fig_package_info* info) {
  FIG_RESERVE_OR_REPORT();
  FIG_REPORT_IF_ERROR(check_struct(info, "package info"));
  const Result<Pin<PackageObject>> pinned = handles().pin<PackageObject>(package.id);
  if (!pinned.ok()) return report(pinned.status());
  const Package& opened = (*pinned)->package;
  fig_package_info whole = fig_default_package_info();
  whole.kind = static_cast<fig_package_kind>(opened.kind());
  const std::array<uint64_t, 2> hash = opened.content_hash();
  std::copy(hash.begin(), hash.end(), whole.content_hash);
  whole.peak_memory_bytes = opened.budget().peak_memory_bytes;
  whole.macs_per_frame = opened.budget().macs_per_frame;
  whole.gaussians = opened.budget().gaussians;
  describe_content(opened, whole);
  fill_struct(whole, info);
  return FIG_OK;
}

fig_status fig_package_joint(fig_package body, uint32_t joint, fig_joint* info) {
  FIG_RESERVE_OR_REPORT();
  FIG_REPORT_IF_ERROR(check_struct(info, "joint"));
  const Result<Pin<PackageObject>> pinned = pin_package(body, PackageKind::kBody);
  if (!pinned.ok()) return report(pinned.status());
  const Body& opened = (*pinned)->package.body();
  if (joint >= opened.joint_count()) {
    return report(invalid("joint " + std::to_string(joint) + ": there are " +
                          std::to_string(opened.joint_count()) + ", from 0"));
  }
  fig_joint whole = fig_default_joint();
  whole.name = opened.joint_names[joint].c_str();
  whole.parent = opened.parents[joint];
  std::copy_n(opened.joint_position_m.data() + size_t{3} * joint, 3, whole.rest_position_m);
  fill_struct(whole, info);
  return FIG_OK;
}

fig_status fig_package_member_name(fig_package population, uint32_t member, const char** name) {
  FIG_RESERVE_OR_REPORT();
  FIG_REPORT_IF_ERROR(check_out(name, "name"));
  const Result<Pin<PackageObject>> pinned = pin_package(population, PackageKind::kPopulation);
  if (!pinned.ok()) return report(pinned.status());
  const Package& opened = (*pinned)->package;
  if (member >= opened.population().size()) return report(no_member(opened, member));
  *name = opened.population().members[member].name.c_str();
  return FIG_OK;
}

fig_status fig_package_find_member(fig_package population, const char* name_or_number,
                                   uint32_t* member) {
  FIG_RESERVE_OR_REPORT();
  FIG_REPORT_IF_ERROR(check_out(name_or_number, "name"));
  FIG_REPORT_IF_ERROR(check_out(member, "member"));
  const Result<Pin<PackageObject>> pinned = pin_package(population, PackageKind::kPopulation);
  if (!pinned.ok()) return report(pinned.status());
  const std::optional<size_t> found = find_member((*pinned)->package.population(), name_or_number);
  if (!found) {
    return report(Status(StatusCode::kNotFound,
                         std::string("member '") + name_or_number + "': there is none"));
  }
  *member = static_cast<uint32_t>(*found);
  return FIG_OK;
}

fig_status fig_make_orbit_camera(const fig_orbit* orbit, uint32_t width_px, uint32_t height_px,
                                 fig_camera* camera) {
  FIG_RESERVE_OR_REPORT();
  FIG_REPORT_IF_ERROR(check_struct(camera, "camera"));
  fig_orbit read = fig_default_orbit();
  FIG_REPORT_IF_ERROR(read_options(orbit, "orbit", read));
  const Result<Camera> made =
      make_orbit_camera({.azimuth_deg = read.azimuth_deg,
                         .elevation_deg = read.elevation_deg,
                         .distance_m = read.distance_m,
                         .vertical_fov_deg = read.vertical_fov_deg,
                         .target_m = {read.target_m[0], read.target_m[1], read.target_m[2]}},
                        width_px, height_px);
  if (!made.ok()) return report(made.status());
  fill_struct(c_camera(*made), camera);
  return FIG_OK;
}

fig_status fig_package_golden_view(fig_package package, uint32_t member, fig_camera* camera,
                                   fig_pose* pose) {
  FIG_RESERVE_OR_REPORT();
  if (camera != nullptr) FIG_REPORT_IF_ERROR(check_struct(camera, "camera"));
  if (pose != nullptr) FIG_REPORT_IF_ERROR(check_struct(pose, "pose"));
  const Result<Pin<PackageObject>> pinned = handles().pin<PackageObject>(package.id);
  if (!pinned.ok()) return report(pinned.status());
  const Result<const GoldenFrame*> golden = golden_of((*pinned)->package, member);
  if (!golden.ok()) return report(golden.status());
  if (camera != nullptr) fill_struct(c_camera((*golden)->camera), camera);
  if (pose != nullptr)
    fill_struct(c_pose({(*golden)->root_translation_m, (*golden)->rotations}), pose);
  return FIG_OK;
}

fig_status fig_package_motion_pose(fig_package motion, uint32_t frame, fig_pose* pose) {
  FIG_RESERVE_OR_REPORT();
  FIG_REPORT_IF_ERROR(check_struct(pose, "pose"));
  const Result<Pin<PackageObject>> pinned = pin_package(motion, PackageKind::kMotion);
  if (!pinned.ok()) return report(pinned.status());
  const Motion& opened = (*pinned)->package.motion();
  if (frame >= opened.frame_count) {
    return report(invalid("frame " + std::to_string(frame) + ": there are " +
                          std::to_string(opened.frame_count) + ", from 0"));
  }
  fill_struct(c_pose(opened.pose(frame)), pose);
  return FIG_OK;
}
