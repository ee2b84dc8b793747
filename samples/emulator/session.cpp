#include "samples/emulator/session.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <format>
#include <nlohmann/json.hpp>
#include <utility>

#include "ports/host/clock.h"
#include "samples/common/camera_path.h"
#include "samples/common/file_sink.h"
#include "samples/common/gaussian_scene.h"

namespace figurine::emulator {

namespace {

constexpr float kSpacing_m = 0.9f;
constexpr float kRoom = 1.06f;  // times the distance that fits a few frames: others reach further
constexpr size_t kMostMessages = 50;
constexpr double kStudyPause_s = 0.5;     // between measurements while a motion plays
constexpr double kSmoothing = 0.85;       // of times that are shown: of the value before
constexpr double kMomentsPerSecond = 30;  // that the study looks back over

std::string file_name(const std::string& path) {
  return std::filesystem::path(path).filename().string();
}

// The kernels that work as wide as the device's do: 128 bits.
std::optional<Isa> isa_of(const DeviceProfile& profile, std::optional<Isa> otherwise) {
  if (profile.core == Core::kHere) return otherwise;
  for (const Isa isa : {Isa::kNeon, Isa::kSse41}) {
    const std::span<const Isa> supported = supported_isas();
    if (std::find(supported.begin(), supported.end(), isa) != supported.end()) return isa;
  }
  return Isa::kBaseline;
}

double smoothed(double before, double now) {
  return before > 0 ? kSmoothing * before + (1 - kSmoothing) * now : now;
}

}  // namespace

Session::Session(const Options& options)
    : options_(options),
      profile_(&device_profiles().front()),
      picture_(device_profiles().front().screen, PixelFormat::kRgba8),
      loader_([](const LoadWish& wish, const std::atomic<bool>&) { return load_file(wish); }),
      studies_([this](const std::shared_ptr<StudyView>& view, const std::atomic<bool>& cancelled) {
        return measure_.measure(*view, cancelled);
      }) {}

Session::~Session() = default;

Result<std::unique_ptr<Session>> Session::create(const Options& options) {
  std::unique_ptr<Session> session(new Session(options));
  FIG_RETURN_IF_ERROR(session->make_renderer());
  return session;
}

// Anew, with everybody who is there: for another device.
Status Session::make_renderer() {
  const uint32_t threads =
      profile_->cores == 0 ? options_.threads : std::min(options_.threads, profile_->cores);
  Result<std::unique_ptr<Renderer>> renderer =
      Renderer::create({.threads = threads,
                        .now_ns = [](void*) { return ports::now_ns(); },
                        .isa = isa_of(*profile_, options_.isa)});
  if (!renderer.ok()) return renderer.status();
  FIG_RETURN_IF_ERROR(scene_.add_to(**renderer, options_.precision));
  renderer_ = std::move(*renderer);
  return {};
}

void Session::touch() { ++change_; }

void Session::say(const std::string& text, bool error) {
  messages_.push_back({text, error, 0});
  if (messages_.size() > kMostMessages) messages_.pop_front();
}

Status Session::report(const Status& status) {
  if (!status.ok()) say(status.message(), true);
  return status;
}

// ---- Files

void Session::open(const std::string& path) {
  to_load_.push_back(path);
  if (!loader_.busy()) (void)load_next();
}

Status Session::load_next() {
  if (to_load_.empty()) return {};
  loader_.ask({to_load_.front(), known_bodies_});
  to_load_.pop_front();
  return {};
}

Status Session::take(const Loaded& loaded) {
  if (loaded.avatar) return take_avatar(loaded);
  if (loaded.motion) return take_motion(loaded);
  if (loaded.cloud) return take_cloud(loaded);
  if (loaded.sampler) {
    sampler_ = loaded.sampler;
    sampler_name_ = file_name(loaded.path);
    say(sampler_name_ + ": a sampler; choose a seed");
    return {};
  }
  known_bodies_.push_back(loaded.body);
  say(file_name(loaded.path) + ": a body, kept for avatars that stand on it");
  return {};
}

Status Session::take_avatar(const Loaded& loaded) {
  for (size_t i = 0; i < avatars_.size(); ++i) {
    if (coarse_name(avatars_[i]->name) == loaded.avatar->name && !scene_.coarse(i).avatar)
      return take_coarse(i, loaded);
  }
  if (scene_.size() >= kMostFigures) {
    return Status(StatusCode::kLimitExceeded,
                  loaded.path + ": there are " + std::to_string(kMostFigures) + " figures already");
  }
  FIG_RETURN_IF_ERROR(add_figure(loaded.avatar, loaded.body, loaded.coarse));
  place_figures();
  FIG_RETURN_IF_ERROR(follow_anew());
  say(file_name(loaded.path) + ": an avatar" +
      (scene_.coarse(scene_.size() - 1).avatar
           ? ", " + file_name(loaded.coarse.avatar->name) + " for when it is small"
           : ""));
  return loaded.coarse_trouble;
}

// Whose coarse package comes when the figure is there already.
Status Session::take_coarse(size_t figure, const Loaded& loaded) {
  FIG_RETURN_IF_ERROR(scene_.set_coarse(figure, {loaded.avatar, loaded.body}));
  const Status made = make_renderer();
  if (!made.ok()) {
    (void)scene_.set_coarse(figure, {});
    (void)report(make_renderer());
    return made;
  }
  touch();
  studies_.cancel();
  find_facts();
  say(file_name(loaded.path) + ": for when " + file_name(avatars_[figure]->name) + " is small");
  return {};
}

// A scene has its own axes and its own ground, so it takes the place of figures.
Status Session::take_cloud(const Loaded& loaded) {
  const bool somebody = scene_.size() > 0;
  while (scene_.size() > 0) FIG_RETURN_IF_ERROR(remove_figure(scene_.size() - 1));
  cloud_ = loaded.cloud;
  cloud_path_ = loaded.path;
  find_facts();
  say(file_name(loaded.path) + ": " + describe(*cloud_) +
      (somebody ? "; in place of the figures" : ""));
  return home(framing_ = samples::Framing::kBody);
}

Status Session::take_motion(const Loaded& loaded) {
  size_t fitting = 0;
  Status misfit;
  for (size_t i = 0; i < scene_.size(); ++i) {
    const Status fits = scene_.set_motion(i, loaded.motion);
    if (fits.ok()) {
      ++fitting;
    } else {
      misfit = fits;
    }
  }
  if (scene_.size() > 0 && fitting == 0) return misfit;
  motion_ = loaded.motion;
  motion_name_ = file_name(loaded.path);
  timeline_.set_length(motion_->package.motion().frame_count,
                       motion_->package.motion().frames_per_second);
  say(motion_name_ + ": a motion of " + std::format("{:.1f} s", timeline_.duration_s()));
  FIG_RETURN_IF_ERROR(follow_anew());
  return misfit;
}

// In the motion that there is, if it fits; else in the golden pose, and that is said.
Status Session::add_figure(const std::shared_ptr<samples::LoadedAvatar>& avatar,
                           const std::shared_ptr<samples::LoadedPackage>& body,
                           const samples::Scene::Coarse& coarse) {
  samples::Scene::Newcomer newcomer{avatar, body, motion_, {}};
  Status misfit = scene_.add_figure(newcomer);
  if (!misfit.ok()) {
    newcomer.motion = nullptr;
    FIG_RETURN_IF_ERROR(scene_.add_figure(newcomer));
  }
  const size_t index = scene_.size() - 1;
  (void)report(scene_.set_coarse(index, coarse));  // without it, if it does not fit
  const Status added = scene_.add_figure_to(*renderer_, index, options_.precision);
  if (!added.ok()) {
    scene_.remove_figure(index);
    return added;
  }
  (void)report(misfit);
  if (cloud_) {
    say(file_name(cloud_path_) + ": taken away for " + file_name(avatar->name));
    cloud_.reset();
  }
  avatars_.push_back(avatar);
  bodies_.push_back(body);
  touch();
  studies_.cancel();
  find_facts();
  return {};
}

Status Session::remove_figure(size_t figure) {
  if (figure >= scene_.size()) {
    return Status(StatusCode::kNotFound,
                  std::format("figure {}: there are {}", figure + 1, scene_.size()));
  }
  FIG_RETURN_IF_ERROR(forget_figure(figure));
  avatars_.erase(avatars_.begin() + static_cast<std::ptrdiff_t>(figure));
  bodies_.erase(bodies_.begin() + static_cast<std::ptrdiff_t>(figure));
  if (person_ && *person_ == figure) {
    person_.reset();
    history_.clear();
  } else if (person_ && *person_ > figure) {
    --*person_;
  }
  place_figures();
  touch();
  studies_.cancel();
  study_.reset();
  find_facts();
  return scene_.size() > 0 ? follow_anew() : Status();
}

Status Session::forget_figure(size_t figure) {
  FIG_RETURN_IF_ERROR(renderer_->remove_avatar(scene_.id(figure)));
  if (const std::optional<AvatarId> coarse = scene_.coarse_id(figure))
    FIG_RETURN_IF_ERROR(renderer_->remove_avatar(*coarse));
  scene_.remove_figure(figure);
  return {};
}

void Session::place_figures() {
  for (size_t i = 0; i < scene_.size(); ++i) {
    const float from_middle = static_cast<float>(i) - 0.5f * static_cast<float>(scene_.size() - 1);
    scene_.set_place(i, {.x_m = kSpacing_m * from_middle});
  }
}

void Session::find_facts() {
  facts_.clear();
  for (size_t i = 0; i < avatars_.size(); ++i) {
    facts_.push_back(facts_of(*avatars_[i], *bodies_[i]));
    if (const samples::Scene::Coarse coarse = scene_.coarse(i); coarse.avatar)
      facts_.back().lines.push_back({"When small", file_name(coarse.avatar->name)});
  }
  if (cloud_) facts_.push_back(facts_of(cloud_path_, *cloud_));
}

// ---- Time and camera

void Session::seek(double time_s) {
  const uint32_t before = timeline_.frame();
  timeline_.seek(time_s);
  if (timeline_.frame() != before) touch();
}

void Session::turn(float right_px, float down_px) {
  by_hand_ = true;
  view_.turn(right_px, down_px);
  touch();
}

void Session::shift(float right_px, float down_px, float picture_height_px) {
  view_.shift(right_px, down_px, picture_height_px);
  touch();
}

void Session::zoom(float steps) {
  view_.zoom(steps);
  touch();
}

void Session::set_orbit(float azimuth_deg, float elevation_deg, float distance_m) {
  by_hand_ = true;
  OrbitCamera orbit = view_.orbit();
  orbit.azimuth_deg = azimuth_deg, orbit.elevation_deg = elevation_deg;
  orbit.distance_m = distance_m;
  view_.set(orbit);
  touch();
}

Status Session::home(samples::Framing framing) {
  by_hand_ = false;
  framing_ = framing;
  touch();
  if (cloud_) {
    path_.clear();
    view_.set(samples::orbit_scene(*cloud_, std::nullopt, to_string(cloud_->up_axis()),
                                   profile_->screen));
    return {};
  }
  return follow_anew();
}

// Where the figures go, and from how far they are seen; from where, unless a hand has chosen that.
Status Session::follow_anew() {
  touch();
  if (scene_.size() == 0) {
    path_.clear();
    return {};
  }
  std::vector<uint32_t> frames(timeline_.frames());
  for (uint32_t f = 0; f < frames.size(); ++f) frames[f] = f;
  const Result<samples::FramedOrbit> framed =
      samples::frame_figures({.size = profile_->screen,
                              .framing = framing_,
                              .frames_per_second = timeline_.frames_per_second()},
                             frames, scene_, *renderer_);
  if (!framed.ok()) {
    framing_ = samples::Framing::kBody;
    return framed.status();
  }
  path_ = framed->path;
  OrbitCamera orbit = framed->orbit;
  orbit.distance_m *= kRoom;
  if (by_hand_) {
    orbit.azimuth_deg = view_.orbit().azimuth_deg;
    orbit.elevation_deg = view_.orbit().elevation_deg;
  }
  view_.set(orbit);
  return {};
}

samples::Point Session::followed() const {
  const uint32_t frame = timeline_.frame();
  return frame < path_.size() ? path_[frame] : samples::Point{0, 0, 0};
}

Result<Camera> Session::camera() const {
  if (cloud_) {
    return samples::scene_camera(view_.orbit(), to_string(cloud_->up_axis()), profile_->screen);
  }
  return view_.camera(followed(), profile_->screen);
}

// ---- The device

Status Session::set_profile(const DeviceProfile& profile) {
  if (&profile == profile_) return {};
  if (recorder_) stop_recording();
  const DeviceProfile* const before = std::exchange(profile_, &profile);
  const Status made = make_renderer();
  if (!made.ok()) {
    profile_ = before;
    (void)report(make_renderer());  // the figures' identities are those of the last renderer
    return made;
  }
  picture_ = samples::RenderedFrame(profile.screen, PixelFormat::kRgba8);
  frame_ms_ = 0, stage_ms_.fill(0);
  studies_.cancel();
  const OrbitCamera before_orbit = view_.orbit();
  const bool by_hand = by_hand_;
  FIG_RETURN_IF_ERROR(home(framing_));
  if (by_hand)
    set_orbit(before_orbit.azimuth_deg, before_orbit.elevation_deg, view_.orbit().distance_m);
  return {};
}

std::optional<FrameEstimate> Session::estimate() const {
  if (frame_ms_ == 0) return std::nullopt;
  return estimate_frame(*profile_, statistics_,
                        uint64_t{profile_->screen.width_px} * profile_->screen.height_px,
                        settings_.approximation.fast_blend);
}

uint64_t Session::memory_bytes() const {
  uint64_t bytes = renderer_->memory_bytes();
  std::vector<const samples::LoadedPackage*> counted;
  const auto add = [&](const samples::LoadedPackage* package) {
    if (package == nullptr || std::find(counted.begin(), counted.end(), package) != counted.end())
      return;
    counted.push_back(package);
    bytes += package->file.bytes().size();
  };
  for (const auto& avatar : avatars_) add(avatar->package.get()), add(avatar->network.get());
  for (const auto& body : bodies_) add(body.get());
  for (size_t i = 0; i < scene_.size(); ++i) {
    const samples::Scene::Coarse coarse = scene_.coarse(i);
    if (coarse.avatar) add(coarse.avatar->package.get()), add(coarse.body.get());
  }
  add(motion_.get());
  if (sampler_) add(sampler_->package.get());
  if (cloud_) {
    bytes += sizeof(float) * (cloud_->position_m.size() + cloud_->covariance_factor.size() +
                              cloud_->opacity.size() + cloud_->sh.size());
  }
  return bytes;
}

// ---- What is left out, and what that is worth

void Session::set_settings(const Settings& settings) {
  if (settings == settings_) return;
  settings_ = settings;
  studies_.cancel();
  touch();
}

void Session::set_measuring(bool measuring) {
  measuring_ = measuring;
  if (!measuring) studies_.cancel();
  studied_change_ = 0;
}

StudyView Session::study_view(const Camera& camera) {
  StudyView view{.number = change_,
                 .cloud = cloud_,
                 .camera = camera,
                 .settings = settings_,
                 .isa = renderer_->isa()};
  for (size_t i = 0; i < avatars_.size(); ++i)
    view.figures.push_back({avatars_[i], bodies_[i], scene_.coarse(i)});
  if (view.figures.empty()) return view;
  const auto step = static_cast<uint32_t>(
      std::max(1.0, std::round(timeline_.frames_per_second() / kMomentsPerSecond)));
  const uint32_t frames = timeline_.frames(), now = timeline_.frame();
  for (size_t back = StudyView::kMoments; back-- > 0;) {
    const auto behind = static_cast<uint32_t>(uint64_t{step} * back % frames);
    std::vector<samples::StoredPose>& poses = view.moments.emplace_back();
    for (const FrameAvatar& posed : scene_.pose((now + frames - behind) % frames)) {
      poses.push_back({posed.pose.root_translation_m,
                       {posed.pose.rotations.begin(), posed.pose.rotations.end()}});
    }
  }
  return view;
}

void Session::begin_study() {
  const bool something = scene_.size() > 0 || cloud_;
  if (!measuring_ || !something || studies_.busy() || change_ == studied_change_) return;
  if (timeline_.playing() && timeline_.moves() && since_study_s_ < kStudyPause_s) return;
  const Result<Camera> seen = camera();
  if (!seen.ok()) return;  // the picture says why
  studied_change_ = change_;
  studies_.ask(std::make_shared<StudyView>(study_view(*seen)));
}

// ---- People

Status Session::sample(const Seed& seed) {
  if (!sampler_) return Status(StatusCode::kNotFound, "seed: there is no sampler; open one first");
  seed_ = seed;
  people_.ask(sampler_, seed);
  return {};
}

void Session::cancel_sampling() {
  if (!people_.busy()) return;
  people_.cancel();
  say("the sampling was cancelled");
}

Status Session::take_person(const Person& person) {
  sampling_s_ = person.seconds;
  FIG_RETURN_IF_ERROR(put_person(&person));
  history_.add(person);
  return {};
}

// In the place of the person before, or beside the others.
Status Session::put_person(const Person* person) {
  if (person == nullptr) {
    if (!person_) return {};
    const PeopleHistory kept = history_;  // that the figure goes is no reason to forget
    FIG_RETURN_IF_ERROR(remove_figure(*person_));
    history_ = kept;
    return {};
  }
  if (!person_ && scene_.size() >= kMostFigures)
    return Status(StatusCode::kLimitExceeded, "seed: there are too many figures already");
  FIG_RETURN_IF_ERROR(add_figure(person->avatar, person->body));
  const size_t last = scene_.size() - 1;
  if (!person_) {
    person_ = last;
    place_figures();
    find_facts();
    return follow_anew();
  }
  const size_t place = *person_;
  scene_.swap_figures(place, last);
  std::swap(avatars_[place], avatars_[last]);
  std::swap(bodies_[place], bodies_[last]);
  FIG_RETURN_IF_ERROR(forget_figure(last));
  avatars_.pop_back();
  bodies_.pop_back();
  place_figures();
  find_facts();
  return by_hand_ ? Status() : follow_anew();  // somebody taller may have come
}

void Session::undo() {
  if (!history_.can_undo()) return;
  const Person* const before = history_.undo();
  if (before != nullptr) seed_ = before->seed;
  people_.cancel();
  (void)report(put_person(before));
}

void Session::redo() {
  if (!history_.can_redo()) return;
  const Person* const after = history_.redo();
  seed_ = after->seed;
  people_.cancel();
  (void)report(put_person(after));
}

void Session::keep_person() {
  person_.reset();
  history_.clear();
}

// ---- The loop

void Session::advance(double elapsed_s) {
  for (Message& message : messages_) message.age_s += elapsed_s;
  since_picture_s_ += elapsed_s, since_study_s_ += elapsed_s;
  if (const auto loaded = loader_.done()) {
    (void)report(loaded->ok() ? take(**loaded) : loaded->status());
  }
  if (!loader_.busy()) (void)load_next();
  if (const auto person = people_.done())
    (void)report(person->ok() ? take_person(**person) : person->status());
  if (const auto study = studies_.done()) {
    since_study_s_ = 0;
    if (study->ok()) {
      study_ = **study;
    } else {
      (void)report(study->status());
    }
  }
  if (recorder_) {
    if (const std::optional<Status> ended = recorder_->done()) {
      if (ended->ok()) {
        say(std::format(
            "{}: {} frames{}", recorder_->path(), recorder_->frames(),
            recorder_->lost() > 0 ? std::format(", {} lost", recorder_->lost()) : std::string()));
      }
      (void)report(*ended);
      recorder_.reset();
    }
  }
  const uint32_t before = timeline_.frame();
  timeline_.advance(elapsed_s);
  if (timeline_.frame() != before) touch();
  begin_study();
}

Status Session::draw() {
  const bool due = [&] {
    if (change_ == drawn_change_) return false;
    const std::optional<FrameEstimate> device = paced_ ? estimate() : std::nullopt;
    return !device || since_picture_s_ * 1e3 >= device->total_ms;
  }();
  if (due) {
    drawn_change_ = change_;
    const double elapsed_s = std::exchange(since_picture_s_, 0);
    const Result<Camera> seen = camera();
    if (!seen.ok()) return report(seen.status());
    std::vector<GaussianView> gaussians;
    if (cloud_) gaussians.push_back(cloud_->view());
    scene_.keep_to_known(settings_.keep_to_known);
    const uint64_t start_ns = ports::now_ns();
    FIG_RETURN_IF_ERROR(report(renderer_->render(
        {.camera = *seen,
         .avatars = scene_.pose(timeline_.frame()),
         .gaussians = gaussians,
         .background = options_.background,
         .splat = {.antialiased = cloud_ ? std::optional(cloud_->antialiased) : std::nullopt},
         .leave_out = settings_.leave_out,
         .approximation = settings_.approximation},
        picture_.target())));
    note_frame(static_cast<double>(ports::now_ns() - start_ns) * 1e-6, elapsed_s);
  }
  if (recorder_) recorder_->offer(picture_, ports::now_ns());
  return {};
}

void Session::note_frame(double ms, double elapsed_s) {
  ++pictures_;
  statistics_ = renderer_->statistics();
  frame_ms_ = smoothed(frame_ms_, ms);
  for (size_t i = 0; i < kStageCount; ++i)
    stage_ms_[i] = smoothed(stage_ms_[i], static_cast<double>(statistics_.stage_ns[i]) * 1e-6);
  if (elapsed_s > 0 && elapsed_s < 2) shown_hz_ = smoothed(shown_hz_, 1 / elapsed_s);
}

// ---- Pictures into files

Status Session::save_picture(const std::string& path) {
  FIG_RETURN_IF_ERROR(report(samples::write_picture(path, picture_.u8, true)));
  say(path + ": written");
  return {};
}

Status Session::start_recording(const std::string& path) {
  if (recorder_) return report(Status(StatusCode::kInvalidArgument, "a recording is going on"));
  Result<std::unique_ptr<Recorder>> recorder =
      Recorder::start(path, profile_->screen, ports::now_ns());
  if (!recorder.ok()) return report(recorder.status());
  recorder_ = std::move(*recorder);
  return {};
}

void Session::stop_recording() {
  if (recorder_) recorder_->stop();
}

bool Session::idle() const { return !loading() && !people_.busy() && !recorder_; }

// ---- For tests and scripts

nlohmann::ordered_json Session::json() const {
  using Json = nlohmann::ordered_json;
  const auto row = [](const StudyRow& each) {
    return Json{
        {"same", each.same},
        {"error_db", each.same || !std::isfinite(each.error_db) ? Json() : Json(each.error_db)},
        {"gain_ms", each.gain_ms}};
  };
  Json figures = Json::array(), said = Json::array(), set = Json::object(), study;
  for (size_t i = 0; i < avatars_.size(); ++i) {
    const samples::Scene::Coarse coarse = scene_.coarse(i);
    figures.push_back({{"file", avatars_[i]->name},
                       {"name", avatars_[i]->avatar.name},
                       {"coarse", coarse.avatar ? Json(coarse.avatar->name) : Json()}});
  }
  for (const Message& message : messages_)
    said.push_back({{"text", message.text}, {"error", message.error}});
  for (const Switch& each : switches()) set[each.name] = each.get(settings_);
  if (study_) {
    study = {{"current", study_is_current()}, {"dense_ms", study_->dense_ms}};
    for (size_t i = 0; i < switches().size(); ++i)
      study["switches"][switches()[i].name] = row(study_->rows[i]);
    study["as_set"] = row(study_->as_set);
  }
  const std::optional<FrameEstimate> device = estimate();
  const OrbitCamera& orbit = view_.orbit();
  return {{"figures", figures},
          {"scene", cloud_ ? Json(cloud_path_) : Json()},
          {"motion", motion_ ? Json(motion_name_) : Json()},
          {"time_s", timeline_.time_s()},
          {"playing", timeline_.playing()},
          {"orbit",
           {{"azimuth_deg", orbit.azimuth_deg},
            {"elevation_deg", orbit.elevation_deg},
            {"distance_m", orbit.distance_m}}},
          {"profile", profile_->name},
          {"size", {picture_.size.width_px, picture_.size.height_px}},
          {"isa", to_string(renderer_->isa())},
          {"frame_ms", frame_ms_},
          {"estimated_ms", device ? Json(device->total_ms) : Json()},
          {"memory_bytes", memory_bytes()},
          {"switches", set},
          {"study", study},
          {"sampler", sampler_ ? Json(sampler_name_) : Json()},
          {"seed", to_string(seed_)},
          {"can_undo", history_.can_undo()},
          {"can_redo", history_.can_redo()},
          {"pictures", pictures_},
          {"messages", said}};
}

}  // namespace figurine::emulator
