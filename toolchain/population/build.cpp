#include "toolchain/population/build.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "formats/writer/package_writer.h"
#include "ports/host/files.h"
#include "ports/host/folder_lock.h"
#include "ports/host/process.h"
#include "ports/motion/clip.h"
#include "ports/motion/import.h"
#include "toolchain/body/atlas.h"
#include "toolchain/body/makehuman_model.h"
#include "toolchain/body/mannequin.h"
#include "toolchain/body/texel_body.h"
#include "toolchain/error.h"
#include "toolchain/population/initial_weights.h"
#include "toolchain/population/member.h"
#include "toolchain/population/shared_network.h"
#include "toolchain/train/csv.h"
#include "toolchain/train/interrupt.h"
#include "toolchain/train/pack_population.h"
#include "toolchain/train/progress.h"
#include "toolchain/train/run_directory.h"
#include "toolchain/train/slots.h"

namespace figurine::population {

namespace {

namespace fs = std::filesystem;

constexpr double kPatience_s = 20;

// The recipe in the folder stays what it was: members of two recipes are no population.
void keep_recipe(const BuildOptions& options, const State& state) {
  const nlohmann::json now = train::read_json(options.recipe);
  if (!fs::exists(state.recipe())) return train::write_json(state.recipe(), now);
  const nlohmann::json before = train::read_json(state.recipe());
  for (const auto& [key, value] : now.items()) {
    // How they are packed and what is measured beside does not change the members.
    if (key != "about" && key != "package" && key != "evaluation" &&
        before.value(key, nlohmann::json()) != value) {
      throw InputError(options.recipe + ": " + key + ": differs from " + state.recipe() +
                       "; another recipe needs another folder");
    }
  }
}

body::BodyModel body_model(const Recipe& recipe, const BuildOptions& options) {
  if (recipe.mannequin) return body::make_mannequin();
  if (options.makehuman.empty())
    throw InputError("--makehuman: no directory given and FIGURINE_MAKEHUMAN is not set");
  return body::make_makehuman_model(body::MakeHuman::load(options.makehuman), {});
}

// As options of `figurine-train body`.
std::string describe_atlas(const std::array<double, body::kBodyPartCount>& weight) {
  std::string text = " --atlas weighted";
  for (size_t part = 0; part < weight.size(); ++part) {
    char option[64];
    std::snprintf(option, sizeof(option), " --weight %s=%g",
                  to_string(static_cast<body::BodyPart>(part)), weight[part]);
    if (weight[part] != 1) text += option;
  }
  return text;
}

void make_body(const Recipe& recipe, const BuildOptions& options, const State& state) {
  if (fs::exists(state.body())) return;
  const uint32_t uv_size = train::find_preset(recipe.training.preset).uv_size;
  body::BodyModel model = body_model(recipe, options);
  std::string command = "body --uv " + std::to_string(uv_size);
  if (recipe.atlas_weight) {
    const uint32_t grid = std::max(1u, train::network_side(recipe.training));
    model.surface = body::pack_atlas(
        model.surface, {.weight = *recipe.atlas_weight, .uv_size = uv_size, .coarsest_grid = grid});
    command += describe_atlas(*recipe.atlas_weight);
  }
  body::TexelBody texels = body::make_texel_body(model, uv_size);
  texels.states_mesh_places = recipe.atlas_weight.has_value();  // captures look for them there
  Provenance provenance = model.provenance;
  provenance.tool = "figurine-train " FIGURINE_VERSION;
  provenance.settings.insert(provenance.settings.begin(), {"command", command});
  throw_if_error(
      ports::write_file_atomically(
          state.body(), value_or_throw(write_package(texels.view(), provenance), state.body())),
      "cannot save");
}

struct Motions {
  std::vector<ports::MotionClip> clips;
  std::vector<std::string> sources;
};

// Every clip with the line that the motion commands print of it: a wrong axis or rate is seen
// before anybody is photographed. What cannot be a person is an error.
Motions read_motions(const Recipe& recipe, const std::string& recipe_path, const Body& body) {
  Motions motions;
  for (const MotionPiece& piece : recipe.motions) {
    const std::string path = find_clip(piece.clip, recipe_path);
    if (fs::path(path).extension() == ".fgn" &&
        (piece.start || piece.frames || !piece.neutral.empty())) {
      throw InputError(recipe_path + ": motions: " + piece.clip +
                       ": start, frames and neutral are for clips, this is a motion package");
    }
    ports::RetargetOptions retarget;
    retarget.name = piece.name, retarget.start = piece.start, retarget.frames = piece.frames;
    if (!piece.neutral.empty())
      throw_if_error(ports::set_neutral(piece.neutral, retarget), recipe_path + ": motions");
    ports::RetargetReport report;
    motions.clips.push_back(value_or_throw(ports::read_clip(path, body, retarget, &report)));
    if (!report.summary.empty()) {
      ports::sayf("motion %s: %s", piece.name.c_str(),
                  ports::describe_motion(report, motions.clips.back()).c_str());
    }
    const std::string source = value_or_throw(ports::clip_source(path));
    if (std::find(motions.sources.begin(), motions.sources.end(), source) == motions.sources.end())
      motions.sources.push_back(source);
  }
  return motions;
}

struct TableRow {
  Identity identity;
  std::string status = "waiting", reason;
  nlohmann::json row;  // members/ID.json
};

// Empty where nothing was held out.
std::string figure(const nlohmann::json& value, const char* format) {
  char digits[32] = "";
  if (value.is_number()) std::snprintf(digits, sizeof(digits), format, value.get<double>());
  return digits;
}

std::string figures(const nlohmann::json& row) {
  if (!row.is_object()) return ",,,,,,";
  const nlohmann::json& quality = row.at("quality");
  std::string text = "," + figure(row.at("train_seconds"), "%.1f") + "," +
                     figure(row.at("capture_cpu_seconds"), "%.1f");
  text += "," + figure(quality.at("held_out_views").at("psnr_db"), "%.2f");
  for (const char* metric : {"psnr_db", "flat_psnr_db", "head_psnr_db"})
    text += "," + figure(quality.at("held_out_poses").at(metric), "%.2f");
  return text;
}

void save_table(const State& state, const std::vector<TableRow>& table) {
  std::string text =
      "identity,split,status,train_seconds,capture_cpu_seconds,psnr_view_db,psnr_pose_db,flat_psnr_"
      "db,head_psnr_db,reason\n";
  for (const TableRow& row : table) {
    text += row.identity.name() + "," + to_string(row.identity.split) + "," + row.status +
            figures(row.row) + ",";
    text += (row.reason.empty() ? "" : train::csv_quoted(row.reason)) + "\n";
  }
  throw_if_error(ports::write_file_atomically(state.table(), std::as_bytes(std::span(text))),
                 "cannot save");
}

void pack(const Recipe& recipe, const State& state) {
  train::PackPopulationOptions options{
      .inputs = {state.members()},
      .name = recipe.name,
      .init = recipe.training.init,
      .shared = recipe.shared.identities > 0 ? state.shared() : std::string(),
      .split = state.split(),
      .levels = recipe.levels,
      .quiet = true};
  throw_if_error(ports::write_file_atomically(state.package(), train::pack_population(options)),
                 "cannot save");
}

// LibTorch starts threads, and a process that has some must not be forked: whatever calls it runs
// in a process of its own.
std::string pack_apart(const Recipe& recipe, const State& state) {
  std::string failure;
  const auto ended = [&](size_t, const train::JobResult& result) {
    if (!result.done) failure = result.text;
  };
  train::run_in_slots(
      1, {}, [&](size_t) { return pack(recipe, state), std::string(); }, ended, [] {});
  return failure;
}

// All members that are not there yet, several at a time.
void make_members(const BuildOptions& options, const Workshop& workshop,
                  std::vector<TableRow>& table, train::Progress& progress) {
  const auto start = std::chrono::steady_clock::now();
  const auto late = [&] {
    return options.stop_after_s > 0 &&
           std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count() >
               options.stop_after_s;
  };
  const bool whole = options.parts == 1;
  std::vector<size_t> missing;
  size_t done = 0, failed = 0, since_packed = 0;
  for (size_t i = 0; i < table.size(); ++i) {
    const std::string name = table[i].identity.name();
    if (fs::exists(workshop.state.row(name)) && fs::exists(workshop.state.member(name))) {
      table[i].row = train::read_json(workshop.state.row(name)), table[i].status = "finished",
      ++done;
    } else {
      missing.push_back(i);
    }
  }
  if (whole) save_table(workshop.state, table);
  const auto job = [&](size_t m) {
    if (late()) throw train::Interrupted("not begun: the time given is over");
    return make_member(workshop, table[missing[m]].identity).dump();
  };
  const auto ended = [&](size_t m, const train::JobResult& result) {
    TableRow& row = table[missing[m]];
    row.status = result.done ? "finished" : result.interrupted ? "waiting" : "failed";
    if (result.done) {
      row.row = nlohmann::json::parse(result.text), ++done, ++since_packed;
    } else if (!result.interrupted) {
      row.reason = result.text, ++failed;
      std::fprintf(stderr, "figurine-train: %s: %s\n", row.identity.name().c_str(),
                   row.reason.c_str());
    }
    try {
      if (whole) save_table(workshop.state, table);
    } catch (const InputError&) {
      // The disk is full just now. Others may still finish and leave room; the last writing below
      // says so if not.
    }
  };
  const auto waiting = [&] {
    progress.show(static_cast<double>(done + failed) / static_cast<double>(table.size()),
                  std::to_string(done) + " of " + std::to_string(table.size()) + " members, " +
                      std::to_string(failed) + " failed");
  };
  // In pieces, so that the package can be written between: it needs LibTorch, so a process, so a
  // moment without others' results.
  const size_t piece =
      whole && options.pack_period > 0 ? options.pack_period : std::max<size_t>(1, missing.size());
  for (size_t first = 0; first < missing.size() && !late(); first += piece) {
    const size_t count = std::min(piece, missing.size() - first);
    train::run_in_slots(
        count, {.slots = options.slots}, [&](size_t m) { return job(first + m); },
        [&](size_t m, const train::JobResult& result) { ended(first + m, result); }, waiting);
    if (first + count < missing.size() && since_packed > 0) {
      if (const std::string failure = pack_apart(workshop.recipe, workshop.state); !failure.empty())
        progress.say("not packed yet: " + failure);
      since_packed = 0;
    }
  }
  if (whole) save_table(workshop.state, table);
}

bool is_shared_ready(const Recipe& recipe, const State& state) {
  const bool wanted = recipe.initial.rounds > 0 || recipe.shared.identities > 0;
  return fs::exists(state.body()) && fs::exists(state.split()) &&
         (!wanted || fs::exists(state.initial_weights()));
}

// Members of a build that was killed may still be at work: they hold the folder and are ending.
// Parts hold it together, each its own folder below for itself.
std::vector<ports::FolderLock> lock_folders(const BuildOptions& options, const State& state) {
  std::vector<ports::FolderLock> locks;
  const auto take = [&](Result<ports::FolderLock> lock) {
    locks.push_back(value_or_throw(std::move(lock), "cannot build"));
  };
  if (options.parts == 1) {
    take(ports::FolderLock::acquire(state.folder, kPatience_s));
    fs::remove_all(state.parts());
  } else {
    take(ports::FolderLock::share(state.folder, kPatience_s));
    const std::string own = state.part(options.part, options.parts);
    train::make_folder(own);
    take(ports::FolderLock::acquire(own, kPatience_s));
  }
  return locks;
}

// The members of a part, all identities' without one.
std::vector<TableRow> rows_of(const Recipe& recipe, const BuildOptions& options) {
  std::vector<TableRow> table;
  uint32_t number = 0;
  for (const Identity& identity : identities_of(recipe)) {
    if (number++ % options.parts == options.part)
      table.push_back({.identity = identity, .reason = {}, .row = {}});
  }
  return table;
}

}  // namespace

void build(const BuildOptions& options) {
  Recipe recipe = read_recipe(options.recipe);
  const State state{options.state};
  const bool whole = options.parts == 1;
  train::make_folder(state.members());
  const std::vector<ports::FolderLock> locks = lock_folders(options, state);
  if (!whole && !is_shared_ready(recipe, state)) {
    throw InputError(state.folder +
                     ": what all members share is not there yet: population "
                     "--initial-weights-only makes it, before any part");
  }
  keep_recipe(options, state);
  if (whole) train::write_json(state.split(), split_of(recipe));
  make_body(recipe, options, state);
  const train::PackageFile body = train::open_package(state.body(), PackageKind::kBody);
  const Motions motions = read_motions(recipe, options.recipe, body.package.body());
  const Workshop workshop{recipe,
                          state,
                          body,
                          motions.clips,
                          motions.sources,
                          options.makehuman,
                          options.keep_captures};

  train::Progress progress(recipe.name, options.quiet);
  make_initial_weights(workshop, options.slots, [&](const InitialWeightsProgress& at) {
    char line[128];
    if (at.captured < at.people) {
      std::snprintf(line, sizeof(line), "initial weights, %zu of %zu people captured", at.captured,
                    at.people);
      return progress.show(0, line);
    }
    const int length = std::snprintf(line, sizeof(line), "initial weights, round %u of %u",
                                     at.round + 1, at.rounds);
    if (at.psnr_db > 0) {
      std::snprintf(line + length, sizeof(line) - static_cast<size_t>(length),
                    ", training PSNR of the last %.2f dB", at.psnr_db);
    }
    progress.show((at.round + at.share) / at.rounds, line);
  });
  make_shared_network(workshop, options.slots, [&](const SharedNetworkProgress& at) {
    char line[128];
    if (at.captured < at.people) {
      std::snprintf(line, sizeof(line), "shared network, %zu of %zu people captured", at.captured,
                    at.people);
    } else {
      std::snprintf(line, sizeof(line), "shared network, %zu people", at.people);
    }
    progress.show(at.share, line);
  });
  const bool alike = recipe.shared.identities > 0;
  if (recipe.initial.rounds > 0 || alike) recipe.training.init = state.initial_weights();
  recipe.training.freeze_network = alike;
  if (options.initial_weights_only) return;

  std::vector<TableRow> table = rows_of(recipe, options);
  make_members(options, workshop, table, progress);
  size_t finished = 0, failed = 0;
  for (const TableRow& row : table)
    finished += row.status == "finished", failed += row.status == "failed";
  if (whole) {
    if (const std::string failure = pack_apart(recipe, state); !failure.empty())
      throw InputError(failure);
  } else if (!options.quiet) {
    ports::sayf("%s: %zu of %zu members of part %u of %u", options.state.c_str(), finished,
                table.size(), options.part, options.parts);
  }
  if (whole && !options.quiet) {
    ports::sayf("%s: %zu of %zu members, package %s, table %s", options.state.c_str(), finished,
                table.size(), state.package().c_str(), state.table().c_str());
  }
  if (failed > 0)
    throw InputError(options.state + ": " + std::to_string(failed) + " of " +
                     std::to_string(table.size()) + " members failed" +
                     (whole ? ", see " + state.table() : ""));
}

}  // namespace figurine::population
