#include "samples/inspect/pictures.h"

#include <algorithm>
#include <cmath>
#include <format>
#include <memory>

#include "figurine/avatar_sampler.h"
#include "figurine/renderer.h"
#include "ports/media/png.h"
#include "samples/common/camera_path.h"
#include "samples/common/golden_picture.h"
#include "samples/common/progress.h"
#include "samples/common/scene.h"

namespace figurine::inspect {

namespace {

using samples::LoadedAvatar;
using samples::LoadedPackage;

constexpr samples::ImageSize kFaceSize{192, 192}, kFigureSize{240, 320};
constexpr std::array<float, 3> kBackground{0.86f, 0.88f, 0.90f};
constexpr uint32_t kLeastFaceTexels = 64;  // a side; on fewer a face is a few large Gaussians
constexpr uint32_t kSampledPeople = 12;
constexpr size_t kMembers = 24;
constexpr uint32_t kMotionFrames = 11;  // no divisor of the cycles that a loop repeats

Result<Picture> as_picture(const ports::ImageU8& rgba, std::string caption) {
  Result<std::vector<std::byte>> png = ports::encode_png(samples::drop_alpha(rgba));
  if (!png.ok()) return png.status();
  return Picture{std::move(caption), std::move(*png)};
}

// Somebody in the golden pose: the head, or all of a body that is coarse or has no such joint.
Result<Picture> draw_face(std::shared_ptr<LoadedAvatar> avatar, std::shared_ptr<LoadedPackage> body,
                          const std::string& caption) {
  samples::Scene scene;
  FIG_RETURN_IF_ERROR(scene.add_figure({std::move(avatar), std::move(body), nullptr, {}}));
  Result<std::unique_ptr<Renderer>> renderer = Renderer::create({.threads = 1});
  if (!renderer.ok()) return renderer.status();
  FIG_RETURN_IF_ERROR(scene.add_to(**renderer, std::nullopt));
  const uint32_t frames[] = {0};
  const bool coarse = scene.avatar(0).avatar.texels_a_side() < kLeastFaceTexels;
  samples::CameraPathOptions options{
      .size = kFaceSize, .framing = coarse ? samples::Framing::kBody : samples::Framing::kHead};
  Result<std::vector<Camera>> cameras =
      samples::make_camera_path(options, frames, scene, **renderer);
  if (cameras.status().code() == StatusCode::kUnsupported) {
    options.framing = samples::Framing::kBody;
    cameras = samples::make_camera_path(options, frames, scene, **renderer);
  }
  if (!cameras.ok()) return cameras.status();
  samples::RenderedFrame frame(kFaceSize, PixelFormat::kRgba8);
  FIG_RETURN_IF_ERROR((*renderer)->render(
      {.camera = cameras->front(), .avatars = scene.pose(0), .background = kBackground},
      frame.target()));
  return as_picture(frame.u8, caption);
}

// The trainer's picture, as it lies in the package, and this device's in every precision.
Result<PictureSection> draw_golden(const LoadedPackage& package, const std::string& body_option) {
  const Avatar& avatar = package.package.avatar();
  const GoldenFrame& golden = avatar.golden;
  PictureSection section{"Golden picture",
                         "A pose and a camera that the package carries, to see that a device draws "
                         "what the trainer drew.",
                         {}};
  if (golden.rotations.empty()) {
    section.words = "The package carries no golden frame.";
    return section;
  }
  if (!golden.png.empty()) {
    // Encoded anew: what a page shows is never a stranger's bytes.
    const Result<ports::ImageU8> image =
        ports::decode_png(std::as_bytes(golden.png), "the package's picture");
    const Result<std::vector<std::byte>> png =
        image.ok() ? ports::encode_png(*image) : image.status();
    if (png.ok()) {
      section.pictures.push_back({"the trainer's, in the package", *png});
    } else {
      section.words += " Not shown: " + png.status().message() + ".";
    }
  }
  const Result<std::unique_ptr<LoadedPackage>> body =
      samples::find_body(avatar, avatar.name, package.path, body_option);
  if (!body.ok()) {
    section.words += " This device did not draw it: " + body.status().message() + ".";
    return section;
  }
  for (const Precision precision : {Precision::kFixedPoint, Precision::kFloat32}) {
    if (!avatar.holds(precision)) continue;
    const Result<samples::GoldenPicture> drawn =
        samples::draw_golden_picture(avatar, (*body)->package, precision, {.threads = 1});
    if (!drawn.ok()) return drawn.status();
    std::string caption = std::format("{}, by this device", to_string(precision));
    const std::array<uint64_t, 2> hash = golden.fixed_point_hash;
    if (precision == Precision::kFixedPoint && hash != std::array<uint64_t, 2>{0, 0}) {
      caption += hash_picture(drawn->frame.u8.pixels) == hash
                     ? ": its hash is the package's, to the bit"
                     : ": its hash is NOT the package's";
    }
    Result<Picture> picture = as_picture(drawn->frame.u8, caption);
    if (!picture.ok()) return picture.status();
    section.pictures.push_back(std::move(*picture));
  }
  return section;
}

// What a sampled avatar borrows from.
struct Weights {
  SampledAvatar avatar;
};

Result<PictureSection> draw_people(const LoadedPackage& package, const std::string& body_option) {
  const Sampler& sampler = package.package.sampler();
  if (sampler.golden.rotations.empty())
    return PictureSection{"Sampled people", "The package carries no pose to draw them in.", {}};
  const Result<std::unique_ptr<AvatarSampler>> device = AvatarSampler::create(sampler);
  if (!device.ok()) return device.status();
  PictureSection section{
      "Sampled people",
      std::format("The first {} seeds, in {} steps of {}, as every device samples them.",
                  kSampledPeople, sampler.steps, to_string(sampler.method)),
      {}};
  std::shared_ptr<LoadedPackage> body;
  samples::Progress progress("inspect", kSampledPeople);
  for (uint32_t seed = 0; seed < kSampledPeople; ++seed) {
    FIG_RETURN_IF_ERROR(samples::check_interrupt());
    const auto weights = std::make_shared<Weights>();
    FIG_RETURN_IF_ERROR((*device)->sample({.seed = seed}, weights->avatar));
    auto person = std::make_shared<LoadedAvatar>();
    person->name = std::format("seed {}", seed);
    person->avatar = weights->avatar.avatar();
    person->made_of = weights;
    if (!body) {
      Result<std::unique_ptr<LoadedPackage>> found =
          samples::find_body(person->avatar, person->name, package.path, body_option);
      if (!found.ok()) return found.status();
      body = std::move(*found);
    }
    Result<Picture> picture = draw_face(person, body, person->name);
    if (!picture.ok()) return picture.status();
    section.pictures.push_back(std::move(*picture));
    progress.update(seed + 1);
  }
  return section;
}

Result<PictureSection> draw_members(const LoadedPackage& package, const std::string& body_option) {
  const Population& population = package.package.population();
  const size_t count = std::min(kMembers, population.size());
  PictureSection section{
      "Members",
      count == population.size()
          ? "All of them."
          : std::format("{} of {}, evenly chosen, in their order.", count, population.size()),
      {}};
  std::shared_ptr<LoadedPackage> body;
  samples::Progress progress("inspect", count);
  for (size_t i = 0; i < count; ++i) {
    FIG_RETURN_IF_ERROR(samples::check_interrupt());
    const size_t number = count < 2 ? 0 : i * (population.size() - 1) / (count - 1);
    auto member = std::make_shared<LoadedAvatar>();
    member->name = std::format("#{} {}, {}", number, population.members[number].name,
                               to_string(population.members[number].split));
    member->storage.resize(member_floats(population));
    member->avatar = open_member(population, number, member->storage);
    if (member->avatar.golden.rotations.empty()) {
      section.words = "The package carries no pose to draw them in.";
      return section;
    }
    if (!body) {
      Result<std::unique_ptr<LoadedPackage>> found =
          samples::find_body(member->avatar, member->name, package.path, body_option);
      if (!found.ok()) return found.status();
      body = std::move(*found);
    }
    Result<Picture> picture = draw_face(member, body, member->name);
    if (!picture.ok()) return picture.status();
    section.pictures.push_back(std::move(*picture));
    progress.update(i + 1);
  }
  return section;
}

// A body as Gaussians: every texel a disc on the skin, lit from the front and above.
class BodyGaussians {
 public:
  explicit BodyGaussians(const Body& body) : body_(body), transforms_(body.joint_count()) {
    const size_t n = body.texel_count();
    position_.resize(3 * n), factor_.resize(9 * n), sh_.resize(3 * n);
    opacity_.assign(n, 0.99f);
  }

  GaussianView posed(const PoseView& pose) {
    skinning_transforms(body_.mean_skeleton(), pose, transforms_);
    for (size_t i = 0; i < body_.texel_count(); ++i) place(i);
    return {body_.texel_count(), 0, position_, factor_, opacity_, sh_};
  }

 private:
  void place(size_t i) {
    const Affine affine = blend(transforms_, &body_.texel_joints[kSkinInfluences * i],
                                &body_.texel_weights[kSkinInfluences * i]);
    const std::array<float, 3> at = transform_point(affine, &body_.texel_position_m[3 * i]),
                               n = transform_normal(affine, &body_.texel_normal[3 * i]);
    std::copy(at.begin(), at.end(), &position_[3 * i]);
    // Two directions along the skin, and a thin one through it.
    const std::array<float, 3> other =
        std::abs(n[1]) < 0.9f ? std::array<float, 3>{0, 1, 0} : std::array<float, 3>{1, 0, 0};
    std::array<float, 3> u = cross(n, other);
    const float length = std::sqrt(u[0] * u[0] + u[1] * u[1] + u[2] * u[2]);
    for (float& value : u) value /= std::max(length, 1e-6f);
    const std::array<float, 3> v = cross(n, u);
    const float radius_m = 0.7f * body_.texel_spacing_m[i];
    for (size_t k = 0; k < 3; ++k) {
      factor_[9 * i + 3 * k] = radius_m * u[k];
      factor_[9 * i + 3 * k + 1] = radius_m * v[k];
      factor_[9 * i + 3 * k + 2] = 0.1f * radius_m * n[k];
    }
    constexpr std::array<float, 3> kLight{0.3f, 0.55f, 0.78f}, kSkin{0.72f, 0.75f, 0.80f};
    const float light = n[0] * kLight[0] + n[1] * kLight[1] + n[2] * kLight[2];
    const float shade = 0.35f + 0.65f * std::max(0.0f, 0.5f + 0.5f * light);
    for (size_t k = 0; k < 3; ++k) sh_[3 * i + k] = (shade * kSkin[k] - kShOffset) / kSh0;
  }

  static std::array<float, 3> cross(const std::array<float, 3>& a, const std::array<float, 3>& b) {
    return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
  }

  const Body& body_;
  std::vector<Affine> transforms_;
  std::vector<float> position_, factor_, opacity_, sh_;
};

// From where all of it fits.
Result<Picture> draw_gaussians(Renderer& renderer, const GaussianView& gaussians, float azimuth_deg,
                               const std::string& caption) {
  std::vector<samples::Point> points;
  for (size_t i = 0; i < gaussians.count; ++i)
    points.push_back({gaussians.position_m[3 * i], gaussians.position_m[3 * i + 1],
                      gaussians.position_m[3 * i + 2]});
  const samples::FramingOptions framing;
  OrbitCamera orbit{.azimuth_deg = azimuth_deg,
                    .elevation_deg = 4,
                    .vertical_fov_deg = 30,
                    .target_m = samples::robust_centre(points, framing.share)};
  orbit.distance_m = samples::fit_distance_m(
      points, orbit, static_cast<double>(kFigureSize.width_px) / kFigureSize.height_px, framing);
  const Result<Camera> camera =
      make_orbit_camera(orbit, kFigureSize.width_px, kFigureSize.height_px);
  if (!camera.ok()) return camera.status();
  samples::RenderedFrame frame(kFigureSize, PixelFormat::kRgba8);
  const GaussianView views[] = {gaussians};
  FIG_RETURN_IF_ERROR(renderer.render(
      {.camera = *camera, .gaussians = views, .background = kBackground}, frame.target()));
  return as_picture(frame.u8, caption);
}

// Which texels there are, coloured by where the skin looks.
Result<Picture> draw_atlas(const Body& body) {
  ports::ImageU8 image(body.uv_size, body.uv_size, 3);
  std::fill(image.pixels.begin(), image.pixels.end(), uint8_t{238});
  for (size_t i = 0; i < body.texel_count(); ++i) {
    for (size_t k = 0; k < 3; ++k) {
      image.pixels[3 * size_t{body.texel[i]} + k] = static_cast<uint8_t>(
          std::lround(127.5f + 127.5f * std::clamp(body.texel_normal[3 * i + k], -1.0f, 1.0f)));
    }
  }
  Result<std::vector<std::byte>> png = ports::encode_png(image);
  if (!png.ok()) return png.status();
  return Picture{"the map: covered texels, coloured by their normals", std::move(*png)};
}

Result<PictureSection> draw_body(const Body& body) {
  PictureSection section{"The body", "At rest, in its mean shape: a disc for every texel.", {}};
  const Result<std::unique_ptr<Renderer>> renderer = Renderer::create({.threads = 1});
  if (!renderer.ok()) return renderer.status();
  std::vector<float> rest;
  for (uint32_t j = 0; j < body.joint_count(); ++j) rest.insert(rest.end(), {1, 0, 0, 0});
  BodyGaussians gaussians(body);
  for (const auto& [azimuth_deg, caption] :
       {std::pair(20.0f, "from the front"), std::pair(200.0f, "from behind")}) {
    Result<Picture> picture =
        draw_gaussians(**renderer, gaussians.posed({{0, 0, 0}, rest}), azimuth_deg, caption);
    if (!picture.ok()) return picture.status();
    section.pictures.push_back(std::move(*picture));
  }
  Result<Picture> atlas = draw_atlas(body);
  if (!atlas.ok()) return atlas.status();
  section.pictures.push_back(std::move(*atlas));
  return section;
}

Result<PictureSection> draw_motion(const LoadedPackage& package, const std::string& body_option) {
  if (body_option.empty())
    return PictureSection{"Frames", "Drawn on a body that is named with --body.", {}};
  const Motion& motion = package.package.motion();
  const Result<std::unique_ptr<LoadedPackage>> loaded =
      samples::load_package(body_option, PackageKind::kBody);
  if (!loaded.ok()) return loaded.status();
  const Body& body = (*loaded)->package.body();
  FIG_RETURN_IF_ERROR(check_motion_fits_body(motion, body));
  const Result<std::unique_ptr<Renderer>> renderer = Renderer::create({.threads = 1});
  if (!renderer.ok()) return renderer.status();
  PictureSection section{"Frames", "Evenly over the motion, each from where the figure fits.", {}};
  BodyGaussians gaussians(body);
  const uint32_t count = std::min(kMotionFrames, motion.frame_count);
  for (uint32_t i = 0; i < count; ++i) {
    const auto frame = static_cast<uint32_t>(uint64_t{i} * motion.frame_count / count);
    const std::string caption =
        std::format("frame {}, {:.2f} s", frame, frame / double(motion.frames_per_second));
    Result<Picture> picture =
        draw_gaussians(**renderer, gaussians.posed(motion.pose(frame)), 20, caption);
    if (!picture.ok()) return picture.status();
    section.pictures.push_back(std::move(*picture));
  }
  return section;
}

Result<PictureSection> draw(const LoadedPackage& package, const std::string& body) {
  switch (package.package.kind()) {
    case PackageKind::kBody:
      return draw_body(package.package.body());
    case PackageKind::kAvatar:
      return draw_golden(package, body);
    case PackageKind::kMotion:
      return draw_motion(package, body);
    case PackageKind::kPopulation:
      return draw_members(package, body);
    case PackageKind::kSampler:
      return draw_people(package, body);
  }
  return PictureSection{};
}

}  // namespace

Result<std::vector<PictureSection>> draw_pictures(const LoadedPackage& package,
                                                  const std::string& body) {
  Result<PictureSection> section = draw(package, body);
  if (section.ok()) return std::vector<PictureSection>{std::move(*section)};
  if (section.status().code() == StatusCode::kInterrupted) return section.status();
  return std::vector<PictureSection>{{"Pictures", "Not drawn: " + section.status().message(), {}}};
}

}  // namespace figurine::inspect
