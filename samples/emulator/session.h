// What is going on in the emulator, without a window: who stands there, where they are in their
// motion, where the camera is, as which device, what a frame leaves out, what was measured, and
// what there is to say. A window draws it and hands on what its user does; so does a test.
//
// Loading, sampling, measuring and recording are done by threads of their own; advance() takes what
// they have finished. Everything else is one thread's.
#pragma once

#include <deque>
#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "figurine/renderer.h"
#include "samples/common/framing.h"
#include "samples/common/rendered_frame.h"
#include "samples/common/scene.h"
#include "samples/emulator/device_profile.h"
#include "samples/emulator/error_study.h"
#include "samples/emulator/loading.h"
#include "samples/emulator/orbit_view.h"
#include "samples/emulator/package_facts.h"
#include "samples/emulator/people.h"
#include "samples/emulator/recorder.h"
#include "samples/emulator/switches.h"
#include "samples/emulator/timeline.h"

namespace figurine::emulator {

struct Message {
  std::string text;
  bool error = false;
  double age_s = 0;
};

class Session {
 public:
  static constexpr size_t kMostFigures = 16;
  struct Options {
    uint32_t threads = 1;
    std::optional<Isa> isa;  // of this machine; none: the largest
    std::optional<Precision> precision;
    std::array<float, 3> background{0.86f, 0.88f, 0.90f};
  };
  static Result<std::unique_ptr<Session>> create(const Options& options);
  ~Session();
  Session(const Session&) = delete;
  Session& operator=(const Session&) = delete;

  // Begins to load an avatar, a motion for all, a sampler, a body or a file of Gaussians; what it
  // was, or why it is nothing, is a message.
  void open(const std::string& path);
  bool loading() const { return loader_.busy() || !to_load_.empty(); }
  Status remove_figure(size_t figure);

  // Once a frame of the window: takes what was finished, and moves the timeline by that time. A
  // device that is paced shows no picture before it would have one.
  void advance(double elapsed_s);
  // Draws the picture if anything is new since the last one. An error is a message too.
  Status draw();
  const samples::RenderedFrame& picture() const { return picture_; }
  uint64_t pictures() const { return pictures_; }  // drawn so far; another number, another picture
  // Whether the picture shows what there is, or a moment before as a device would.
  bool up_to_date() const { return change_ == drawn_change_; }

  // What there is.
  Timeline& timeline() { return timeline_; }
  const OrbitView& view() const { return view_; }
  void seek(double time_s);
  void turn(float right_px, float down_px);
  void shift(float right_px, float down_px, float picture_height_px);
  void zoom(float steps);
  void set_orbit(float azimuth_deg, float elevation_deg, float distance_m);
  // Everybody, or the heads, in the picture. kUnsupported without a head joint.
  Status home(samples::Framing framing);

  size_t figure_count() const { return scene_.size(); }
  const samples::LoadedAvatar& figure(size_t i) const { return scene_.avatar(i); }
  const ports::GaussianCloud* cloud() const { return cloud_.get(); }
  const std::vector<PackageFacts>& facts() const { return facts_; }  // of each figure, or the scene
  const std::string& motion_name() const { return motion_name_; }

  const DeviceProfile& profile() const { return *profile_; }
  Status set_profile(const DeviceProfile& profile);
  bool paced() const { return paced_; }
  void set_paced(bool paced) { paced_ = paced; }
  // Of the last pictures, smoothed.
  double frame_ms() const { return frame_ms_; }
  const std::array<double, kStageCount>& stage_ms() const { return stage_ms_; }
  const FrameStatistics& statistics() const { return statistics_; }
  std::optional<FrameEstimate> estimate() const;
  double pictures_per_second() const { return shown_hz_; }
  uint64_t memory_bytes() const;  // of renderer, packages and scene
  Isa isa() const { return renderer_->isa(); }
  uint32_t threads() const { return renderer_->threads(); }

  const Settings& settings() const { return settings_; }
  void set_settings(const Settings& settings);
  bool measuring() const { return measuring_; }
  void set_measuring(bool measuring);
  const std::optional<Study>& study() const { return study_; }
  uint64_t change() const { return change_; }  // another number, another thing to see
  bool study_is_current() const { return study_ && study_->number == change_; }

  bool has_sampler() const { return sampler_ != nullptr; }
  const std::string& sampler_name() const { return sampler_name_; }
  Status sample(const Seed& seed);  // kNotFound without a sampler
  void cancel_sampling();
  bool sampling() const { return people_.busy(); }
  double sampling_progress() const { return people_.progress(); }
  double sampling_seconds() const { return sampling_s_; }  // the last one's
  const Seed& seed() const { return seed_; }               // asked for last
  bool can_undo() const { return history_.can_undo(); }
  bool can_redo() const { return history_.can_redo(); }
  void undo();
  void redo();
  void keep_person();  // the next one who is sampled stands beside this one
  bool has_person() const { return person_.has_value(); }

  // The picture alone. Errors: samples::write_picture.
  Status save_picture(const std::string& path);
  Status start_recording(const std::string& path);
  void stop_recording();
  const Recorder* recorder() const { return recorder_.get(); }

  // Nothing is being loaded, sampled, written.
  bool idle() const;
  const std::deque<Message>& messages() const { return messages_; }
  void say(const std::string& text, bool error = false);
  // Says it if it is an error; gives it back.
  Status report(const Status& status);
  // All of the above, for tests and scripts (docs/emulator.md).
  nlohmann::ordered_json json() const;

 private:
  explicit Session(const Options& options);
  void touch();  // the picture is another one now
  Status make_renderer();
  Status load_next();
  Status take(const Loaded& loaded);
  Status take_avatar(const Loaded& loaded);
  Status take_coarse(size_t figure, const Loaded& loaded);
  Status take_cloud(const Loaded& loaded);
  Status take_motion(const Loaded& loaded);
  Status take_person(const Person& person);
  Status put_person(const Person* person);
  Status add_figure(const std::shared_ptr<samples::LoadedAvatar>& avatar,
                    const std::shared_ptr<samples::LoadedPackage>& body,
                    const samples::Scene::Coarse& coarse = {});
  Status forget_figure(size_t figure);  // by renderer and scene
  void place_figures();
  void find_facts();
  Status follow_anew();
  samples::Point followed() const;
  Result<Camera> camera() const;
  void note_frame(double ms, double elapsed_s);
  void begin_study();
  StudyView study_view(const Camera& camera);

  Options options_;
  samples::Scene scene_;
  std::vector<std::shared_ptr<samples::LoadedAvatar>> avatars_;  // of the scene's figures
  std::vector<std::shared_ptr<samples::LoadedPackage>> bodies_;
  std::vector<std::shared_ptr<samples::LoadedPackage>> known_bodies_;
  std::shared_ptr<samples::LoadedPackage> motion_;
  std::shared_ptr<ports::GaussianCloud> cloud_;
  std::string cloud_path_, motion_name_, sampler_name_;
  std::vector<PackageFacts> facts_;
  Timeline timeline_;
  OrbitView view_;
  samples::Framing framing_ = samples::Framing::kBody;
  std::vector<samples::Point> path_;  // that the camera goes along, a place a frame
  bool by_hand_ = false;              // somebody has turned the camera: that direction stays

  const DeviceProfile* profile_;
  bool paced_ = true;
  std::unique_ptr<Renderer> renderer_;
  samples::RenderedFrame picture_;
  FrameStatistics statistics_;
  std::array<double, kStageCount> stage_ms_{};
  double frame_ms_ = 0, shown_hz_ = 0, since_picture_s_ = 1e9;
  uint64_t pictures_ = 0, change_ = 1, drawn_change_ = 0;

  Settings settings_;
  bool measuring_ = true;
  std::optional<Study> study_;
  uint64_t studied_change_ = 0;
  double since_study_s_ = 1e9;

  std::shared_ptr<LoadedSampler> sampler_;
  Seed seed_;
  double sampling_s_ = 0;
  PeopleHistory history_;
  std::optional<size_t> person_;  // which figure is the one that is sampled

  std::deque<std::string> to_load_;
  std::deque<Message> messages_;
  std::unique_ptr<Recorder> recorder_;

  ErrorStudy measure_;  // the study's thread's
  Worker<LoadWish, Loaded> loader_;
  PeopleSampler people_;
  Worker<std::shared_ptr<StudyView>, Study> studies_;
};

}  // namespace figurine::emulator
