#include "toolchain/capture/capture.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cstdio>
#include <exception>
#include <memory>
#include <mutex>
#include <optional>
#include <thread>

#include "toolchain/body/makehuman.h"
#include "toolchain/body/skeleton.h"
#include "toolchain/body/surface.h"
#include "toolchain/capture/layout.h"
#include "toolchain/capture/person.h"
#include "toolchain/capture/renderer.h"
#include "toolchain/capture/sequence.h"
#include "toolchain/dataset/dataset.h"
#include "toolchain/dataset/skeleton_hash.h"
#include "toolchain/error.h"
#include "toolchain/random/counter.h"

namespace figurine::capture {

using random::CounterRandom;

namespace {

constexpr uint64_t kIdentityStream = 4;
constexpr uint32_t kFramingStride = 7;  // every seventh vertex shows how far the figure reaches
constexpr std::array<uint8_t, 7> kBustJoints{body::kNeck,       body::kHead,    body::kLeftCollar,
                                             body::kJaw,        body::kLeftEye, body::kRightEye,
                                             body::kRightCollar};

// One identity, ready to be photographed.
struct Session {
  Person person;
  std::vector<float> joints_m;  // [J,3] of the person's own shape
  std::vector<CapturedPose> sequence;
  std::vector<RingCamera> cameras;
  IdentityRecord record;

  std::vector<Affine> transforms(size_t frame, const Body& body) const {
    std::vector<Affine> out(body.joint_count());
    skinning_transforms({body.parents, joints_m}, sequence[frame].pose.view(), out);
    return out;
  }
};

// Places that the figure reaches in any of its poses; of head and shoulders alone as well.
struct Reached {
  std::vector<Vec3> all, bust;
};

// What neck, head and collar bones move most: down to the collar bones and out to the shoulders.
bool is_bust(const Mesh& mesh, uint32_t vertex) {
  const float* weights = &mesh.skin_weights[size_t{vertex} * kSkinInfluences];
  const uint8_t joint =
      mesh.skin_joints[size_t{vertex} * kSkinInfluences +
                       static_cast<size_t>(std::max_element(weights, weights + kSkinInfluences) -
                                           weights)];
  return std::find(kBustJoints.begin(), kBustJoints.end(), joint) != kBustJoints.end();
}

// Moves every pose until its lowest point touches y = 0 and the middle of its outline stands over
// the origin, so that neither jumps nor leaning cost image size, and returns where the figure then
// reaches.
Reached place_poses(Session& session, const Body& body) {
  std::vector<float> position, weights;
  std::vector<uint8_t> joints;
  std::vector<bool> bust;
  for (const Mesh& mesh : session.person.meshes) {
    for (uint32_t v = 0; v < mesh.vertex_count(); v += kFramingStride) {
      position.insert(position.end(), &mesh.position_m[v * 3], &mesh.position_m[v * 3] + 3);
      joints.insert(joints.end(), &mesh.skin_joints[v * kSkinInfluences],
                    &mesh.skin_joints[v * kSkinInfluences] + kSkinInfluences);
      weights.insert(weights.end(), &mesh.skin_weights[v * kSkinInfluences],
                     &mesh.skin_weights[v * kSkinInfluences] + kSkinInfluences);
      bust.push_back(is_bust(mesh, v));
    }
  }
  Reached points;
  for (size_t f = 0; f < session.sequence.size(); ++f) {
    const std::vector<float> posed =
        body::skin_positions(position, joints, weights, session.transforms(f, body));
    Vec3 low = load(posed.data()), high = low;
    for (size_t i = 0; i < posed.size(); i += 3) {
      low = {std::min(low.x, posed[i]), std::min(low.y, posed[i + 1]),
             std::min(low.z, posed[i + 2])};
      high = {std::max(high.x, posed[i]), std::max(high.y, posed[i + 1]),
              std::max(high.z, posed[i + 2])};
    }
    const Vec3 shift{-(low.x + high.x) / 2, -low.y, -(low.z + high.z) / 2};
    std::array<float, 3>& translation = session.sequence[f].pose.root_translation_m;
    translation = {translation[0] + shift.x, translation[1] + shift.y, translation[2] + shift.z};
    for (size_t i = 0; i < posed.size(); i += 3) {
      points.all.push_back(load(&posed[i]) + shift);
      if (bust[i / 3]) points.bust.push_back(points.all.back());
    }
  }
  return points;
}

Session prepare(const CaptureRequest& request, uint32_t identity, const Package& package,
                const body::MakeHuman* makehuman, const std::vector<ports::MotionClip>& motions) {
  const Body& body = package.body();
  Session session;
  const PersonRequest person{.seed = person_seed(request.seed, identity), .limits = request.limits};
  session.person = makehuman != nullptr
                       ? make_makehuman_person(person, *makehuman, request.makehuman, body)
                       : make_mannequin_person(person, body);
  session.joints_m.resize(size_t{body.joint_count()} * 3);
  std::vector<float> texels(size_t{body.texel_count()} * 3);
  shape_body(body, session.person.shape, session.joints_m, texels);
  const std::array<float, 3> root{session.joints_m[0], session.joints_m[1], session.joints_m[2]};
  session.sequence =
      make_sequence(motions, {.frames = request.frames, .seed = person.seed, .root_rest_m = root});
  const Reached reached = place_poses(session, body);
  session.cameras = make_camera_rings(request.cameras, reached.all, reached.bust);
  session.record = {.identity = identity,
                    .seed = request.seed,
                    .tool = request.tool,
                    .body_name = body.name,
                    .body_hash = format_hash(package.content_hash()),
                    .skeleton_hash = dataset::skeleton_hash(body),
                    .sources = request.sources,
                    .folds = to_string(request.folds),
                    .limits = request.limits,
                    .root_rest_m = root};
  if (makehuman != nullptr)
    session.record.sources.insert(session.record.sources.begin(), body::MakeHuman::source_line());
  return session;
}

// Counts images and asks the callback whether to go on; stops all workers at its first no or the
// first error.
class Tally {
 public:
  Tally(const CaptureCallback& callback, uint64_t total) : callback_(callback) {
    progress_.images_total = total;
  }
  void count(uint64_t images) {
    const std::lock_guard lock(mutex_);
    progress_.images_done += images;
    if (!stopped_ && callback_ && !callback_(progress_)) stopped_ = true;
  }
  void fail(std::exception_ptr error) {
    const std::lock_guard lock(mutex_);
    if (!error_) error_ = std::move(error);
    stopped_ = true;
  }
  bool stopped() const { return stopped_; }
  void rethrow() const {
    if (error_) std::rethrow_exception(error_);
  }

 private:
  const CaptureCallback& callback_;
  std::mutex mutex_;
  CaptureProgress progress_;
  std::atomic<bool> stopped_{false};
  std::exception_ptr error_;
};

// A frame is one piece of work: its pose is skinned and its ambient light gathered once for all
// cameras.
void photograph(const Session& session, const IdentityLayout& layout, const Body& body,
                FoldMode folds, uint32_t threads, Tally& tally) {
  std::atomic<size_t> next{0};
  const auto work = [&] {
    try {
      std::optional<Renderer> renderer;
      for (size_t frame; (frame = next++) < session.sequence.size() && !tally.stopped();) {
        bool posed = false;
        for (size_t camera = 0; camera < session.cameras.size() && !tally.stopped(); ++camera) {
          if (!layout.has_image(frame, camera)) {
            if (!renderer) renderer.emplace(session.person, folds);
            if (!posed) renderer->set_pose(session.transforms(frame, body));
            posed = true;
            layout.write_image(frame, camera, renderer->render(session.cameras[camera].camera));
          }
          tally.count(1);
        }
      }
    } catch (...) {
      tally.fail(std::current_exception());
    }
  };
  std::vector<std::thread> others;
  for (uint32_t i = 1; i < threads; ++i) others.emplace_back(work);
  work();
  for (std::thread& thread : others) thread.join();
}

}  // namespace

uint64_t person_seed(uint64_t seed, uint32_t identity) {
  return CounterRandom(seed, kIdentityStream).bits(identity);
}

std::string identity_name(uint32_t identity) {
  char name[16];
  std::snprintf(name, sizeof name, "%06u", identity);
  return name;
}

CaptureEnd capture_identities(const CaptureRequest& request, const Package& package,
                              const std::vector<ports::MotionClip>& motions,
                              const CaptureCallback& callback) {
  const Body& body = package.body();
  std::optional<body::MakeHuman> makehuman;
  if (body.name == "makehuman") {
    makehuman = body::MakeHuman::load(request.makehuman);
  } else if (body.name != "mannequin") {
    throw InputError("--body: captures are made of a makehuman or mannequin body, not of '" +
                     body.name + "'");
  }
  Tally tally(callback, uint64_t{request.identities} * request.frames *
                            (request.cameras.views + request.cameras.bust_views));
  for (uint32_t i = 0; i < request.identities && !tally.stopped(); ++i) {
    const uint32_t identity = request.first_identity + i;
    const Session session =
        prepare(request, identity, package, makehuman ? &*makehuman : nullptr, motions);
    IdentityLayout layout(request.output + "/" + identity_name(identity), session.record,
                          session.person, session.cameras, session.sequence);
    layout.begin(request.resume);
    photograph(session, layout, body, request.folds, request.threads, tally);
    tally.rethrow();
    if (tally.stopped()) break;
    layout.finish();
  }
  return tally.stopped() ? CaptureEnd::kStopped : CaptureEnd::kComplete;
}

namespace {

// Cells of a sheet: images over mid-grey, cut to their middle, because the sides of a square image
// of a standing figure are empty; smaller images lie in the middle of their cells.
class Sheet {
 public:
  Sheet(uint32_t columns, uint32_t rows, const Camera& size)
      : columns_(columns),
        width_(std::min(size.width_px, size.height_px * 5 / 8)),
        height_(size.height_px),
        image_(columns * width_, rows * height_, 3) {
    std::fill(image_.pixels.begin(), image_.pixels.end(), uint8_t{kGrey});
  }

  void put(size_t cell, const dataset::CaptureImage& image) {
    const int left = (static_cast<int>(image.width_px) - static_cast<int>(width_)) / 2,
              top = (static_cast<int>(image.height_px) - static_cast<int>(height_)) / 2;
    for (uint32_t y = 0; y < height_; ++y) {
      for (uint32_t x = 0; x < width_; ++x) {
        const int from_x = static_cast<int>(x) + left, from_y = static_cast<int>(y) + top;
        if (from_x < 0 || from_y < 0 || from_x >= static_cast<int>(image.width_px) ||
            from_y >= static_cast<int>(image.height_px))
          continue;
        const size_t from =
            static_cast<size_t>(from_y) * image.width_px + static_cast<size_t>(from_x);
        uint8_t* to = image_.at(static_cast<uint32_t>(cell % columns_) * width_ + x,
                                static_cast<uint32_t>(cell / columns_) * height_ + y);
        for (int c = 0; c < 3; ++c) {
          const uint32_t over = image.rgb[from * 3 + c] + (255u - image.alpha[from]) * kGrey / 255;
          to[c] = static_cast<uint8_t>(std::min(255u, over));
        }
      }
    }
  }

  ports::ImageU8 take() { return std::move(image_); }

 private:
  static constexpr uint8_t kGrey = 118;
  uint32_t columns_, width_, height_;
  ports::ImageU8 image_;
};

// The camera of whole bodies that the figure's chest looks at most nearly.
size_t front_camera(const dataset::Dataset& data, size_t frame) {
  const std::array<float, 9> turn =
      rotation_from_quaternion(data.frames()[frame].pose().rotations.data());
  const Vec3 front{turn[2], turn[5], turn[8]};
  size_t best = 0;
  float most = -2;
  for (size_t c = 0; c < data.cameras().size(); ++c) {
    if (data.cameras()[c].framing != dataset::Framing::kBody) continue;
    const auto& m = data.cameras()[c].camera.view_from_world;
    const float facing =
        -dot(front, Vec3{m[8], m[9], m[10]});  // the third row is the camera's own direction
    if (facing > most) best = c, most = facing;
  }
  return best;
}

}  // namespace

ports::ImageU8 contact_sheet(const std::string& identity_directory, uint32_t columns,
                             uint32_t rows) {
  const dataset::Dataset data = dataset::Dataset::open(identity_directory);
  const size_t frames = data.frames().size(), cameras = data.cameras().size(),
               cells = size_t{columns} * rows;
  Sheet sheet(columns, rows, data.cameras()[0].camera);
  for (size_t i = 0; i < cells; ++i) {
    const size_t frame = i * frames / cells;
    sheet.put(
        i, data.load_image(frame, data.camera_with_image(frame, (i * 7 + i / columns) % cameras)));
  }
  return sheet.take();
}

ports::ImageU8 people_sheet(const std::vector<std::string>& identity_directories,
                            uint32_t columns) {
  std::optional<Sheet> sheet;
  for (size_t i = 0; i < identity_directories.size(); ++i) {
    const dataset::Dataset data = dataset::Dataset::open(identity_directories[i]);
    const Camera& size = data.cameras()[0].camera;
    if (!sheet)
      sheet.emplace(columns,
                    static_cast<uint32_t>((identity_directories.size() + columns - 1) / columns),
                    size);
    const size_t frame = i % data.frames().size();
    sheet->put(i, data.load_image(frame, data.camera_with_image(frame, front_camera(data, frame))));
  }
  return sheet->take();
}

}  // namespace figurine::capture
