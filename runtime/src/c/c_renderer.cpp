// Renderers, their avatars and frames of figurine.h.
#include <array>
#include <memory>
#include <new>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "figurine/renderer.h"
#include "runtime/src/base/content_bytes.h"
#include "runtime/src/c/c_package.h"
#include "runtime/src/c/c_sampler.h"
#include "runtime/src/c/isa.h"
#include "runtime/src/c/report.h"
#include "runtime/src/c/structs.h"

namespace figurine::c {
namespace {

static_assert(FIG_PIXEL_RGBA8 == static_cast<int>(PixelFormat::kRgba8));
static_assert(FIG_PIXEL_RGBA_F32 == static_cast<int>(PixelFormat::kRgbaF32));
static_assert(FIG_PIXEL_BGRA8 == static_cast<int>(PixelFormat::kBgra8));
static_assert(FIG_PIXEL_RGB24 == static_cast<int>(PixelFormat::kRgb24));
static_assert(FIG_PIXEL_BGR24 == static_cast<int>(PixelFormat::kBgr24));
static_assert(FIG_PIXEL_YUYV == static_cast<int>(PixelFormat::kYuyv));
static_assert(FIG_PIXEL_NV12 == static_cast<int>(PixelFormat::kNv12));
static_assert(FIG_MATRIX_BT709 == static_cast<int>(YcbcrMatrix::kBt709));
static_assert(FIG_MATRIX_BT601 == static_cast<int>(YcbcrMatrix::kBt601));

struct ThreadsObject final : Object {
  static constexpr ObjectKind kKind = ObjectKind::kThreads;
  std::shared_ptr<ThreadPool> pool;
};

struct RendererObject final : Object {
  static constexpr ObjectKind kKind = ObjectKind::kRenderer;
  Pin<ThreadsObject> threads;
  std::unique_ptr<Renderer> renderer;
  std::vector<uint64_t> avatars;  // handles of its AvatarObjects
  // A frame's arrays in C++; they grow and stay, so that a frame allocates nothing.
  Buffer<FrameAvatar> seen;
  Buffer<GaussianView> gaussians;
};

// What an avatar borrows. It is touched by calls alone that have its renderer to themselves.
struct AvatarObject final : Object {
  static constexpr ObjectKind kKind = ObjectKind::kAvatar;
  uint64_t renderer = 0;
  AvatarId id{};
  Pin<PackageObject> body, package;
  Pin<SampledObject> sampled;
  Buffer<float> member;  // a population's, opened
};

Result<AvatarId> avatar_of(fig_renderer renderer, fig_avatar avatar) {
  bool own = false;
  AvatarId id{};
  FIG_RETURN_IF_ERROR(handles().look<AvatarObject>(avatar.id, [&](const AvatarObject& object) {
    own = object.renderer == renderer.id;
    id = object.id;
  }));
  if (!own) return invalid("avatar: the handle is one of another renderer's");
  return id;
}

Result<std::optional<Precision>> precision_of(const fig_avatar_options* given) {
  fig_avatar_options options = fig_default_avatar_options();
  FIG_RETURN_IF_ERROR(read_options(given, "avatar options", options));
  if (options.precision > FIG_PRECISION_Q8) {
    return invalid("precision: " + std::to_string(static_cast<int>(options.precision)) +
                   " is none");
  }
  if (options.precision == FIG_PRECISION_DEFAULT) return std::optional<Precision>();
  return std::optional<Precision>(options.precision == FIG_PRECISION_F32 ? Precision::kFloat32
                                                                         : Precision::kFixedPoint);
}

// Of a copy of what content_of() returns.
size_t copy_bytes(const Package& package) {
  if (package.kind() == PackageKind::kAvatar) return content_bytes(package.avatar());
  if (package.kind() != PackageKind::kPopulation) return kSmallReserveBytes;
  const Population& population = package.population();
  return content_bytes(population.network, population.static_part.groups.size());
}

// An avatar package's content, or a population's member, opened into the object's storage.
Result<Avatar> content_of(const Package& package, uint32_t member, AvatarObject& object) {
  if (package.kind() != PackageKind::kPopulation) {
    FIG_RETURN_IF_ERROR(check_kind(package, PackageKind::kAvatar));
    if (member != 0) return invalid("member: must be 0 of a package that is no population");
    return package.avatar();
  }
  const Population& population = package.population();
  if (member >= population.size()) {
    return Status(StatusCode::kNotFound, "member " + std::to_string(member) + ": there are " +
                                             std::to_string(population.size()) + ", from 0");
  }
  const size_t floats = member_floats(population);
  if (!object.member.ensure(floats)) return out_of_memory("a member's weights");
  return open_member(population, member, object.member.span(floats));
}

// The rest of adding, once the avatar and all that it borrows are in hand.
Status add(RendererObject& renderer, fig_renderer handle, const Avatar& avatar,
           std::unique_ptr<AvatarObject> object, const fig_avatar_options* options,
           fig_avatar* out) {
  const Result<std::optional<Precision>> precision = precision_of(options);
  if (!precision.ok()) return precision.status();
  const MemoryReserve list(2 * sizeof(uint64_t) * (renderer.avatars.size() + 1));
  if (!list.held()) return no_memory();
  const Result<AvatarId> id =
      renderer.renderer->add_avatar(avatar, object->body->package, *precision);
  if (!id.ok()) return id.status();
  object->renderer = handle.id;
  object->id = *id;
  const Result<uint64_t> added = handles().add(std::move(object));
  if (!added.ok()) {
    static_cast<void>(renderer.renderer->remove_avatar(*id));
    return added.status();
  }
  renderer.avatars.push_back(*added);
  out->id = *added;
  return {};
}

Result<GaussianView> gaussians_of(const fig_gaussians& given) {
  if (given.sh_degree > kMaxShDegree)
    return invalid("SH degree " + std::to_string(given.sh_degree) + " is above 3");
  const size_t n = given.count;
  if (n > 0 && (given.position_m == nullptr || given.covariance_factor == nullptr ||
                given.opacity == nullptr || given.sh == nullptr)) {
    return invalid("an array is NULL");
  }
  return GaussianView{.count = given.count,
                      .sh_degree = given.sh_degree,
                      .position_m = {given.position_m, 3 * n},
                      .covariance_factor = {given.covariance_factor, 9 * n},
                      .opacity = {given.opacity, n},
                      .sh = {given.sh, 3 * n * sh_coefficients(given.sh_degree)}};
}

// Element i of an array whose elements are structs of one size. Texts only where there is an error.
template <class T>
Status read_element(const T* array, size_t i, T& out) {
  const T* const given = i == 0 ? array : element(array, i);
  FIG_RETURN_IF_ERROR(read_struct(given, "element", out));
  return given->struct_bytes == array->struct_bytes
             ? Status()
             : invalid("element: struct_bytes differs from the first's");
}

Status read_avatar(const fig_frame& frame, size_t i, fig_renderer renderer, FrameAvatar& seen) {
  fig_frame_avatar given = fig_default_frame_avatar();
  FIG_RETURN_IF_ERROR(read_element(frame.avatars, i, given));
  const Result<AvatarId> id = avatar_of(renderer, given.avatar);
  if (!id.ok()) return id.status();
  const Result<PoseView> pose = pose_of(given.pose);
  if (!pose.ok()) return pose.status();
  if (given.keep_to_known > 1) return invalid("keep_to_known: neither 0 nor 1");
  seen = FrameAvatar{.avatar = *id, .pose = *pose, .keep_to_known = given.keep_to_known != 0};
  if (given.coarse.id == 0) return {};
  const Result<AvatarId> coarse = avatar_of(renderer, given.coarse);
  if (!coarse.ok()) return coarse.status().within("coarse");
  seen.coarse = *coarse;
  return {};
}

Status read_gaussians(const fig_frame& frame, size_t i, GaussianView& gaussians) {
  fig_gaussians given = fig_default_gaussians();
  FIG_RETURN_IF_ERROR(read_element(frame.gaussians, i, given));
  const Result<GaussianView> view = gaussians_of(given);
  if (!view.ok()) return view.status();
  gaussians = *view;
  return {};
}

// Fills the object's arrays.
Status read_arrays(const fig_frame& frame, fig_renderer renderer, RendererObject& object) {
  if (frame.avatar_count > 0) FIG_RETURN_IF_ERROR(check_out(frame.avatars, "avatars"));
  if (frame.gaussians_count > 0) FIG_RETURN_IF_ERROR(check_out(frame.gaussians, "gaussians"));
  if (!object.seen.ensure(frame.avatar_count) || !object.gaussians.ensure(frame.gaussians_count))
    return out_of_memory("a frame's avatars and Gaussians");
  for (size_t i = 0; i < frame.avatar_count; ++i) {
    const Status read = read_avatar(frame, i, renderer, object.seen[i]);
    if (!read.ok()) return read.within("avatars[" + std::to_string(i) + "]");
  }
  for (size_t i = 0; i < frame.gaussians_count; ++i) {
    const Status read = read_gaussians(frame, i, object.gaussians[i]);
    if (!read.ok()) return read.within("gaussians[" + std::to_string(i) + "]");
  }
  return {};
}

Result<LeaveOut> leave_out_of(uint32_t bits) {
  if ((bits & ~uint32_t{FIG_LEAVE_OUT_ALL}) != 0) return invalid("leave_out: an unknown bit");
  const auto has = [&](fig_leave_out bit) { return (bits & static_cast<uint32_t>(bit)) != 0; };
  return LeaveOut{.hidden_texels = has(FIG_LEAVE_OUT_HIDDEN_TEXELS),
                  .transparent = has(FIG_LEAVE_OUT_TRANSPARENT),
                  .outside = has(FIG_LEAVE_OUT_OUTSIDE),
                  .missed_tiles = has(FIG_LEAVE_OUT_MISSED_TILES),
                  .stopped = has(FIG_LEAVE_OUT_STOPPED),
                  .unchanged_networks = has(FIG_LEAVE_OUT_UNCHANGED_NETWORKS)};
}

Result<std::optional<bool>> antialiased_of(fig_antialiased given) {
  switch (given) {
    case FIG_ANTIALIASED_AS_TRAINED:
      return std::optional<bool>();
    case FIG_ANTIALIASED_OFF:
    case FIG_ANTIALIASED_ON:
      return std::optional<bool>(given == FIG_ANTIALIASED_ON);
    default:
      return invalid("frame: unknown antialiased " + std::to_string(static_cast<int>(given)));
  }
}

// Borrows the object's arrays.
Result<Frame> frame_of(const fig_frame* given, fig_renderer renderer, RendererObject& object) {
  fig_frame read = fig_default_frame();
  FIG_RETURN_IF_ERROR(read_struct(given, "frame", read));
  const Result<Camera> camera = camera_of(read.camera);
  if (!camera.ok()) return camera.status();
  const Result<LeaveOut> leave_out = leave_out_of(read.leave_out);
  if (!leave_out.ok()) return leave_out.status();
  const Result<std::optional<bool>> antialiased = antialiased_of(read.antialiased);
  if (!antialiased.ok()) return antialiased.status();
  if (read.fast_blend > 1) return invalid("frame: fast_blend: neither 0 nor 1");
  FIG_RETURN_IF_ERROR(read_arrays(read, renderer, object));
  Frame frame{.camera = *camera,
              .avatars = object.seen.span(read.avatar_count),
              .gaussians = object.gaussians.span(read.gaussians_count),
              .background = std::nullopt,
              .splat = {.alpha_cut = read.alpha_cut, .antialiased = *antialiased},
              .leave_out = *leave_out,
              .approximation = {.network_below_px = read.network_below_px,
                                .network_interval = read.network_interval,
                                .coarse_below_px = read.coarse_below_px,
                                .averted_above = read.averted_above,
                                .sh_degree = read.sh_degree,
                                .fast_blend = read.fast_blend != 0}};
  if (const float* const rgb = read.background; rgb != nullptr)
    frame.background = std::array<float, 3>{rgb[0], rgb[1], rgb[2]};
  return frame;
}

Result<ImageTarget> target_of(const fig_image* given) {
  fig_image image = fig_default_image();
  FIG_RETURN_IF_ERROR(read_struct(given, "image", image));
  if (image.format > FIG_PIXEL_NV12)
    return invalid("image: unknown pixel format " + std::to_string(static_cast<int>(image.format)));
  if (image.matrix > FIG_MATRIX_BT601)
    return invalid("image: unknown matrix " + std::to_string(static_cast<int>(image.matrix)));
  return ImageTarget{.pixels = image.pixels,
                     .stride_bytes = image.stride_bytes,
                     .format = static_cast<PixelFormat>(image.format),
                     .chroma = image.chroma,
                     .chroma_stride_bytes = image.chroma_stride_bytes,
                     .matrix = static_cast<YcbcrMatrix>(image.matrix)};
}

Result<Pin<RendererObject>> pin_renderer(fig_renderer renderer) {
  return handles().pin<RendererObject>(renderer.id, Use::kExclusive);
}

}  // namespace
}  // namespace figurine::c

using namespace figurine;
using namespace figurine::c;

static fig_renderer_options default_renderer_options() {
  return {.struct_bytes = sizeof(fig_renderer_options),
          .threads = 1,
          .pool = {0},
          .isa = FIG_ISA_BEST,
          .now_ns = nullptr,
          .now_user = nullptr};
}
void fig_set_default_renderer_options(fig_renderer_options* value, size_t struct_bytes) {
  set_default(default_renderer_options(), value, struct_bytes);
}

static fig_avatar_options default_avatar_options() {
  return {.struct_bytes = sizeof(fig_avatar_options), .precision = FIG_PRECISION_DEFAULT};
}
void fig_set_default_avatar_options(fig_avatar_options* value, size_t struct_bytes) {
  set_default(default_avatar_options(), value, struct_bytes);
}

static fig_renderer_info default_renderer_info() {
  fig_renderer_info info{};
  info.struct_bytes = sizeof info;
  return info;
}
void fig_set_default_renderer_info(fig_renderer_info* value, size_t struct_bytes) {
  set_default(default_renderer_info(), value, struct_bytes);
}

static fig_image default_image() {
  fig_image image{};
  image.struct_bytes = sizeof image;
  return image;
}
void fig_set_default_image(fig_image* value, size_t struct_bytes) {
  set_default(default_image(), value, struct_bytes);
}

static fig_frame_avatar default_frame_avatar() {
  fig_frame_avatar avatar{};
  avatar.struct_bytes = sizeof avatar;
  return avatar;
}
void fig_set_default_frame_avatar(fig_frame_avatar* value, size_t struct_bytes) {
  set_default(default_frame_avatar(), value, struct_bytes);
}

static fig_gaussians default_gaussians() {
  fig_gaussians gaussians{};
  gaussians.struct_bytes = sizeof gaussians;
  return gaussians;
}
void fig_set_default_gaussians(fig_gaussians* value, size_t struct_bytes) {
  set_default(default_gaussians(), value, struct_bytes);
}

static fig_frame default_frame() {
  fig_frame frame{};
  frame.struct_bytes = sizeof frame;
  frame.alpha_cut = kAlphaCut;
  frame.leave_out = FIG_LEAVE_OUT_ALL;
  frame.network_interval = 1;
  frame.averted_above = 1;
  frame.sh_degree = kMaxShDegree;
  return frame;
}
void fig_set_default_frame(fig_frame* value, size_t struct_bytes) {
  set_default(default_frame(), value, struct_bytes);
}

static fig_pose_rarity default_pose_rarity() {
  fig_pose_rarity rarity{};
  rarity.struct_bytes = sizeof rarity;
  return rarity;
}
void fig_set_default_pose_rarity(fig_pose_rarity* value, size_t struct_bytes) {
  set_default(default_pose_rarity(), value, struct_bytes);
}

static fig_statistics default_statistics() {
  fig_statistics statistics{};
  statistics.struct_bytes = sizeof statistics;
  return statistics;
}
void fig_set_default_statistics(fig_statistics* value, size_t struct_bytes) {
  set_default(default_statistics(), value, struct_bytes);
}

fig_status fig_threads_create(uint32_t threads, fig_threads* created) {
  FIG_RESERVE_OR_REPORT();
  FIG_REPORT_IF_ERROR(check_out(created, "threads"));
  *created = {0};
  Result<std::shared_ptr<ThreadPool>> pool = make_thread_pool({.threads = threads});
  if (!pool.ok()) return report(pool.status());
  std::unique_ptr<ThreadsObject> object(new (std::nothrow) ThreadsObject);
  if (object == nullptr) return report(out_of_memory("threads"));
  object->pool = std::move(*pool);
  const Result<uint64_t> handle = handles().add(std::move(object));
  if (!handle.ok()) return report(handle.status());
  created->id = *handle;
  return FIG_OK;
}

fig_status fig_threads_destroy(fig_threads threads) {
  const MemoryReserve messages;
  return report(handles().remove<ThreadsObject>(threads.id).status());
}

fig_status fig_renderer_create(const fig_renderer_options* options, fig_renderer* renderer) {
  FIG_RESERVE_OR_REPORT();
  FIG_REPORT_IF_ERROR(check_out(renderer, "renderer"));
  *renderer = {0};
  fig_renderer_options read = fig_default_renderer_options();
  FIG_REPORT_IF_ERROR(read_options(options, "renderer options", read));
  const Result<std::optional<Isa>> isa = isa_of(read.isa);
  if (!isa.ok()) return report(isa.status());
  std::unique_ptr<RendererObject> object(new (std::nothrow) RendererObject);
  if (object == nullptr) return report(out_of_memory("a renderer"));
  RendererOptions wanted{
      .threads = read.threads, .now_ns = read.now_ns, .now_user = read.now_user, .isa = *isa};
  if (read.pool.id != 0) {
    Result<Pin<ThreadsObject>> pool = handles().pin<ThreadsObject>(read.pool.id);
    if (!pool.ok()) return report(pool.status());
    object->threads = std::move(*pool);
    wanted.pool = object->threads->pool;
  }
  Result<std::unique_ptr<Renderer>> created = Renderer::create(wanted);
  if (!created.ok()) return report(created.status());
  object->renderer = std::move(*created);
  const Result<uint64_t> handle = handles().add(std::move(object));
  if (!handle.ok()) return report(handle.status());
  renderer->id = *handle;
  return FIG_OK;
}

fig_status fig_renderer_destroy(fig_renderer renderer) {
  const MemoryReserve messages;
  Result<std::unique_ptr<RendererObject>> removed = handles().remove<RendererObject>(renderer.id);
  if (!removed.ok()) return report(removed.status());
  (*removed)->renderer.reset();  // before what its avatars borrow
  for (const uint64_t avatar : (*removed)->avatars)
    static_cast<void>(handles().remove<AvatarObject>(avatar));
  return FIG_OK;
}

fig_status fig_renderer_add_avatar(fig_renderer renderer, fig_package package, uint32_t member,
                                   fig_package body, const fig_avatar_options* options,
                                   fig_avatar* avatar) {
  FIG_RESERVE_OR_REPORT();
  FIG_REPORT_IF_ERROR(check_out(avatar, "avatar"));
  *avatar = {0};
  const Result<Pin<RendererObject>> pinned = pin_renderer(renderer);
  if (!pinned.ok()) return report(pinned.status());
  Result<Pin<PackageObject>> from = handles().pin<PackageObject>(package.id);
  if (!from.ok()) return report(from.status().within("avatar"));
  Result<Pin<PackageObject>> on = handles().pin<PackageObject>(body.id);
  if (!on.ok()) return report(on.status().within("body"));
  std::unique_ptr<AvatarObject> object(new (std::nothrow) AvatarObject);
  if (object == nullptr) return report(out_of_memory("an avatar"));
  const MemoryReserve reserve(copy_bytes((*from)->package));
  if (!reserve.held()) return report_no_memory();
  const Result<Avatar> content = content_of((*from)->package, member, *object);
  if (!content.ok()) return report(content.status());
  object->package = std::move(*from);
  object->body = std::move(*on);
  return report(add(**pinned, renderer, *content, std::move(object), options, avatar));
}

fig_status fig_renderer_add_sampled(fig_renderer renderer, fig_sampled sampled, fig_package body,
                                    const fig_avatar_options* options, fig_avatar* avatar) {
  FIG_RESERVE_OR_REPORT();
  FIG_REPORT_IF_ERROR(check_out(avatar, "avatar"));
  *avatar = {0};
  const Result<Pin<RendererObject>> pinned = pin_renderer(renderer);
  if (!pinned.ok()) return report(pinned.status());
  Result<Pin<SampledObject>> from = handles().pin<SampledObject>(sampled.id);
  if (!from.ok()) return report(from.status());
  Result<Pin<PackageObject>> on = handles().pin<PackageObject>(body.id);
  if (!on.ok()) return report(on.status().within("body"));
  std::unique_ptr<AvatarObject> object(new (std::nothrow) AvatarObject);
  if (object == nullptr) return report(out_of_memory("an avatar"));
  const Avatar& content = (*from)->sampled.avatar();
  object->sampled = std::move(*from);
  object->body = std::move(*on);
  return report(add(**pinned, renderer, content, std::move(object), options, avatar));
}

fig_status fig_renderer_remove_avatar(fig_renderer renderer, fig_avatar avatar) {
  const MemoryReserve messages;
  const Result<Pin<RendererObject>> pinned = pin_renderer(renderer);
  if (!pinned.ok()) return report(pinned.status());
  const Result<AvatarId> id = avatar_of(renderer, avatar);
  if (!id.ok()) return report(id.status());
  FIG_REPORT_IF_ERROR((*pinned)->renderer->remove_avatar(*id));
  std::erase((*pinned)->avatars, avatar.id);
  return report(handles().remove<AvatarObject>(avatar.id).status());
}

fig_status fig_renderer_get_info(fig_renderer renderer, fig_renderer_info* info) {
  FIG_RESERVE_OR_REPORT();
  FIG_REPORT_IF_ERROR(check_struct(info, "renderer info"));
  const Result<Pin<RendererObject>> pinned = pin_renderer(renderer);
  if (!pinned.ok()) return report(pinned.status());
  fig_renderer_info whole = fig_default_renderer_info();
  whole.threads = (*pinned)->renderer->threads();
  whole.isa = c_isa((*pinned)->renderer->isa());
  whole.avatar_count = static_cast<uint32_t>((*pinned)->avatars.size());
  whole.memory_bytes = (*pinned)->renderer->memory_bytes();
  fill_struct(whole, info);
  return FIG_OK;
}

fig_status fig_renderer_avatar_precision(fig_renderer renderer, fig_avatar avatar,
                                         fig_precision* precision) {
  FIG_RESERVE_OR_REPORT();
  FIG_REPORT_IF_ERROR(check_out(precision, "precision"));
  const Result<Pin<RendererObject>> pinned = pin_renderer(renderer);
  if (!pinned.ok()) return report(pinned.status());
  const Result<AvatarId> id = avatar_of(renderer, avatar);
  if (!id.ok()) return report(id.status());
  *precision = (*pinned)->renderer->precision(*id) == Precision::kFixedPoint ? FIG_PRECISION_Q8
                                                                             : FIG_PRECISION_F32;
  return FIG_OK;
}

fig_status fig_renderer_render(fig_renderer renderer, const fig_frame* frame,
                               const fig_image* image) {
  FIG_RESERVE_OR_REPORT();
  const Result<Pin<RendererObject>> pinned = pin_renderer(renderer);
  if (!pinned.ok()) return report(pinned.status());
  const Result<Frame> wanted = frame_of(frame, renderer, **pinned);
  if (!wanted.ok()) return report(wanted.status());
  const Result<ImageTarget> target = target_of(image);
  if (!target.ok()) return report(target.status());
  return report((*pinned)->renderer->render(*wanted, *target));
}

fig_status fig_renderer_pose_avatar(fig_renderer renderer, fig_avatar avatar, const fig_pose* pose,
                                    fig_gaussians* gaussians) {
  FIG_RESERVE_OR_REPORT();
  FIG_REPORT_IF_ERROR(check_struct(gaussians, "gaussians"));
  const Result<Pin<RendererObject>> pinned = pin_renderer(renderer);
  if (!pinned.ok()) return report(pinned.status());
  const Result<AvatarId> id = avatar_of(renderer, avatar);
  if (!id.ok()) return report(id.status());
  const Result<PoseView> wanted = pose_of(pose);
  if (!wanted.ok()) return report(wanted.status());
  const Result<GaussianView> posed = (*pinned)->renderer->pose_avatar(*id, *wanted);
  if (!posed.ok()) return report(posed.status());
  fig_gaussians whole = fig_default_gaussians();
  whole.count = posed->count;
  whole.sh_degree = posed->sh_degree;
  whole.position_m = posed->position_m.data();
  whole.covariance_factor = posed->covariance_factor.data();
  whole.opacity = posed->opacity.data();
  whole.sh = posed->sh.data();
  fill_struct(whole, gaussians);
  return FIG_OK;
}

fig_status fig_renderer_pose_rarity(fig_renderer renderer, fig_avatar avatar, const fig_pose* pose,
                                    fig_pose_rarity* rarity) {
  FIG_RESERVE_OR_REPORT();
  FIG_REPORT_IF_ERROR(check_struct(rarity, "pose rarity"));
  const Result<Pin<RendererObject>> pinned = pin_renderer(renderer);
  if (!pinned.ok()) return report(pinned.status());
  const Result<AvatarId> id = avatar_of(renderer, avatar);
  if (!id.ok()) return report(id.status());
  const Result<PoseView> wanted = pose_of(pose);
  if (!wanted.ok()) return report(wanted.status());
  const Result<std::optional<PoseRarity>> found = (*pinned)->renderer->pose_rarity(*id, *wanted);
  if (!found.ok()) return report(found.status());
  fig_pose_rarity whole = fig_default_pose_rarity();
  if (found->has_value()) {
    whole.known = 1;
    whole.distance = (*found)->distance;
    whole.share_beyond = (*found)->share_beyond;
  }
  fill_struct(whole, rarity);
  return FIG_OK;
}

fig_status fig_renderer_statistics(fig_renderer renderer, fig_statistics* statistics) {
  FIG_RESERVE_OR_REPORT();
  FIG_REPORT_IF_ERROR(check_struct(statistics, "statistics"));
  const Result<Pin<RendererObject>> pinned = pin_renderer(renderer);
  if (!pinned.ok()) return report(pinned.status());
  const FrameStatistics& of_frame = (*pinned)->renderer->statistics();
  const auto stage = [&](Stage which) { return of_frame.stage_ns[static_cast<size_t>(which)]; };
  fig_statistics whole = fig_default_statistics();
  whole.maps_ns = stage(Stage::kMaps);
  whole.network_ns = stage(Stage::kNetwork);
  whole.decode_ns = stage(Stage::kDecode);
  whole.skin_ns = stage(Stage::kSkin);
  whole.project_ns = stage(Stage::kProject);
  whole.bin_ns = stage(Stage::kBin);
  whole.sort_ns = stage(Stage::kSort);
  whole.blend_ns = stage(Stage::kBlend);
  whole.resolve_ns = stage(Stage::kResolve);
  whole.gaussians = of_frame.gaussians;
  whole.visible = of_frame.visible;
  whole.pairs = of_frame.pairs;
  whole.blends = of_frame.blends;
  whole.macs = of_frame.macs;
  whole.hidden_texels = of_frame.left_out.hidden_texels;
  whole.transparent = of_frame.left_out.transparent;
  whole.outside = of_frame.left_out.outside;
  whole.missed_tiles = of_frame.left_out.missed_tiles;
  whole.stopped = of_frame.left_out.stopped;
  whole.pulled_poses = of_frame.pulled_poses;
  fill_struct(whole, statistics);
  return FIG_OK;
}
