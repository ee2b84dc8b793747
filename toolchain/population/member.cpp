#include "toolchain/population/member.h"

#include <sys/resource.h>

#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>

#include "formats/writer/package_writer.h"
#include "formats/writer/population_writer.h"
#include "ports/host/files.h"
#include "ports/media/jpeg.h"
#include "toolchain/capture/capture.h"
#include "toolchain/error.h"
#include "toolchain/model/unet.h"
#include "toolchain/pictures/contact_sheet.h"
#include "toolchain/reconstruction/reconstruction.h"
#include "toolchain/reconstruction/requantization.h"
#include "toolchain/train/avatar_model.h"
#include "toolchain/train/interrupt.h"
#include "toolchain/train/pack_avatar.h"
#include "toolchain/train/package_file.h"
#include "toolchain/train/trainer.h"

namespace figurine::population {

namespace {

namespace fs = std::filesystem;

constexpr int kSheetQuality = 85;

double cpu_s() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  const auto seconds = [](const timeval& time) {
    return static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_usec);
  };
  return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}

enum class Variant : uint8_t { kMember, kFrozenPose, kFromScratch };

// Trains `run`, or finishes it, and opens what came of it.
train::TrainedAvatar train(const Workshop& workshop, const std::string& data,
                           const std::string& run, Variant variant) {
  train::TrainRequest request{.data = data,
                              .body = workshop.state.body(),
                              .run = run,
                              .settings = workshop.recipe.training,
                              .command = "figurine-train population " + workshop.recipe.name,
                              .resume = fs::exists(train::RunDirectory{run}.run_json()),
                              .quiet = true};
  request.settings.freeze_pose = variant == Variant::kFrozenPose;
  if (variant == Variant::kFromScratch)
    request.settings.init.clear(), request.settings.freeze_network = false;
  request.settings.threads = 1;
  train::train_avatar(request);
  return train::TrainedAvatar::open({.run = run, .data = {}, .body = {}, .threads = 1});
}

void save(const std::string& path, std::span<const std::byte> bytes) {
  throw_if_error(ports::write_file_atomically(path, bytes), "cannot save");
}

bool shares_network(const Workshop& workshop) { return workshop.recipe.shared.identities > 0; }

// What the package's rounding costs this member: it is packed as a population of its own and looked
// at again.
nlohmann::json rounding_loss(const Workshop& workshop, train::TrainedAvatar& avatar,
                             std::span<const std::byte> package_bytes) {
  const AlignedBytes own(package_bytes);
  const Package package = value_or_throw(Package::open(own.bytes(), "member"), "member");
  std::optional<train::PackageFile> shared;
  std::vector<float> storage;
  NewPopulation alone{.name = "alone", .levels = workshop.recipe.levels};
  if (shares_network(workshop)) {
    shared.emplace(train::open_package(workshop.state.shared(), PackageKind::kAvatar));
    alone.shared = &shared->package.avatar();
    alone.initial = alone.shared->network;
    alone.coding = DifferenceCoding::kNone;
  } else {
    model::PoseUNet unet(package.avatar().network, {.precision = model::Precision::kFloat32,
                                                    .seed = train::kInitialWeightsSeed});
    if (!workshop.recipe.training.init.empty())
      train::load_weights(workshop.recipe.training.init, unet);
    alone.initial = unet.export_network(storage);
  }
  alone.members.push_back({.avatar = &package.avatar(), .provenance = &package.provenance()});
  const AlignedBytes rounded(value_or_throw(write_population(alone), "member"));
  const Package opened = value_or_throw(Package::open(rounded.bytes(), "member"), "member");
  std::vector<float> weights(member_floats(opened.population()));
  const Avatar member = open_member(opened.population(), 0, weights);
  return reconstruction::evaluate_requantization(
      avatar, member, {.view_frame_step = workshop.recipe.view_frame_step, .quiet = true});
}

bool contains(const std::vector<uint32_t>& list, uint32_t number) {
  return std::find(list.begin(), list.end(), number) != list.end();
}

// [iteration, seconds, training PSNR] over the run.
nlohmann::json training_log(const std::string& run) {
  nlohmann::json rows = nlohmann::json::array();
  for (const train::LogRow& row : train::load_log({run}, UINT64_MAX))
    rows.push_back({row.iteration, row.seconds, row.psnr_db});
  return rows;
}

nlohmann::json about_person(const std::string& data) {
  const nlohmann::json capture = train::read_json(data + "/figurine.json");
  return capture.value("person", nlohmann::json::object());
}

}  // namespace

void capture_identity(const Workshop& workshop, const Identity& identity,
                      const std::string& folder) {
  const train::InterruptGuard interrupt;
  capture::CaptureRequest request{.output = folder,
                                  .makehuman = workshop.makehuman,
                                  .seed = workshop.recipe.seed,
                                  .first_identity = identity.number,
                                  .identities = 1,
                                  .frames = workshop.recipe.frames,
                                  .cameras = workshop.recipe.cameras,
                                  .resume = true,
                                  .threads = 1,
                                  .limits = identity.group->limits,
                                  .tool = "figurine-train " FIGURINE_VERSION,
                                  .sources = workshop.sources};
  const capture::CaptureEnd end = capture::capture_identities(
      request, workshop.body.package, workshop.motions,
      [&](const capture::CaptureProgress&) { return !interrupt.requested(); });
  if (end == capture::CaptureEnd::kStopped)
    throw train::Interrupted(identity.name() + ": stopped while it was captured");
}

nlohmann::json make_member(const Workshop& workshop, const Identity& identity) {
  const State& state = workshop.state;
  const std::string name = identity.name(), run = state.run(name);
  const std::string data = state.captures() + "/" + name;
  const auto clean_up = [&] {
    for (const std::string& folder : {run, state.frozen_run(name), state.scratch_run(name)})
      fs::remove_all(folder);
    if (!workshop.keep_captures) fs::remove_all(data);
  };
  if (fs::exists(state.row(name)) && fs::exists(state.member(name))) {
    clean_up();  // it may have been killed just before
    return train::read_json(state.row(name));
  }
  const double capture_start = cpu_s();
  capture_identity(workshop, identity, state.captures());
  const double capture_seconds = cpu_s() - capture_start;

  const double train_start = cpu_s();
  train::TrainedAvatar avatar = train(workshop, data, run, Variant::kMember);
  const double train_cpu =
      cpu_s() - train_start;  // of this attempt: less than all of it after an interruption
  const reconstruction::ReconstructionOptions looking{
      .quiet = true, .view_frame_step = workshop.recipe.view_frame_step};
  const nlohmann::json quality = reconstruction::evaluate_reconstruction(avatar, looking);
  train::write_json(train::RunDirectory{run}.evaluation(), quality);
  const std::vector<std::byte> package =
      train::pack_avatar(avatar, {run}, {.golden = false, .network = !shares_network(workshop)});
  const nlohmann::json description = train::read_json(train::RunDirectory{run}.run_json());
  nlohmann::json row{{"identity", name},
                     {"split", to_string(identity.split)},
                     {"person", about_person(data)},
                     {"iterations", description.at("iterations")},
                     {"train_seconds", description.at("train_seconds")},
                     {"train_cpu_seconds", train_cpu},
                     {"capture_cpu_seconds", capture_seconds},
                     {"training_psnr_db", description.at("running").at("psnr_db")},
                     {"quality", quality}};
  if (contains(workshop.recipe.rounded, identity.number))
    row["rounding"] = rounding_loss(workshop, avatar, package);
  if (contains(workshop.recipe.frozen, identity.number)) {
    train::TrainedAvatar frozen =
        train(workshop, data, state.frozen_run(name), Variant::kFrozenPose);
    row["frozen_pose"] = reconstruction::evaluate_reconstruction(frozen, looking);
  }
  if (contains(workshop.recipe.scratch, identity.number)) {
    train::TrainedAvatar scratch =
        train(workshop, data, state.scratch_run(name), Variant::kFromScratch);
    row["from_scratch"] = {{"quality", reconstruction::evaluate_reconstruction(scratch, looking)},
                           {"log", training_log(state.scratch_run(name))}};
    row["log"] = training_log(run);
  }
  save(state.sheet(name),
       value_or_throw(ports::encode_jpeg(pictures::make_contact_sheet(
                                             {&avatar}, {.poses = 3, .person_height_px = 320}),
                                         kSheetQuality),
                      state.sheet(name)));
  save(state.member(name), package);
  train::write_json(state.row(name), row);
  clean_up();
  return row;
}

}  // namespace figurine::population
