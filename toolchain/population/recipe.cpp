#include "toolchain/population/recipe.h"

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <initializer_list>
#include <map>
#include <nlohmann/json.hpp>
#include <set>

#include "ports/motion/import.h"
#include "toolchain/dataset/json_fields.h"
#include "toolchain/error.h"
#include "toolchain/train/run_directory.h"

namespace figurine::population {

namespace {

namespace fs = std::filesystem;
using dataset::JsonField;

constexpr const char* kCmuFolder = "/usr/share/assimp/models/BVH";
constexpr uint32_t kMostPeople = kMaxMembers;

void allow_only(const JsonField& object, std::initializer_list<const char*> known) {
  if (!object.json().is_object()) object.fail("not an object");
  for (const auto& [key, value] : object.json().items()) {
    if (std::find(known.begin(), known.end(), key) == known.end())
      throw InputError(object.where() + ": " + key + ": unknown field");
  }
}

uint64_t whole(const JsonField& field, uint64_t least, uint64_t most) {
  const uint64_t value = field.whole();
  if (value < least || value > most)
    field.fail("must lie in " + std::to_string(least) + " to " + std::to_string(most));
  return value;
}

uint32_t count(const JsonField& field, uint32_t least, uint32_t most) {
  return static_cast<uint32_t>(whole(field, least, most));
}

double real(const JsonField& field, double least, double most) {
  const double value = field.number();
  if (!(value >= least && value <= most)) field.fail("out of range");
  return value;
}

std::vector<std::string> texts(const JsonField& field) {
  std::vector<std::string> out;
  for (const JsonField& item : field.items()) out.push_back(item.text());
  return out;
}

std::vector<uint32_t> numbers(const JsonField& field) {
  std::vector<uint32_t> out;
  for (const JsonField& item : field.items()) out.push_back(count(item, 0, UINT32_MAX));
  return out;
}

MotionPiece read_motion(const JsonField& json) {
  allow_only(json, {"name", "clip", "start", "frames", "neutral"});
  MotionPiece motion{.clip = json["clip"].text(), .start = {}, .frames = {}, .neutral = {}};
  motion.name = json.has("name") ? json["name"].text() : fs::path(motion.clip).stem().string();
  if (json.has("start")) motion.start = count(json["start"], 0, 1u << 20);
  if (json.has("frames")) motion.frames = count(json["frames"], 1, 1u << 20);
  if (json.has("neutral")) {
    const JsonField neutral = json["neutral"];
    motion.neutral =
        neutral.json().is_string() ? neutral.text() : std::to_string(count(neutral, 0, 1u << 20));
    ports::RetargetOptions any;
    if (const Status known = ports::set_neutral(motion.neutral, any); !known.ok())
      neutral.fail(known.message());
  }
  return motion;
}

Split read_split_name(const JsonField& field) {
  const std::string text = field.text();
  for (const Split split : {Split::kTrain, Split::kValidation, Split::kTest}) {
    if (text == to_string(split)) return split;
  }
  field.fail("'" + text + "' is none of train, validation, test");
}

IdentityGroup read_group(const JsonField& json) {
  allow_only(json,
             {"split", "first", "count", "outfits", "skins", "exclude_outfits", "exclude_skins"});
  IdentityGroup group{.split = read_split_name(json["split"]),
                      .first = count(json["first"], 0, 999999),
                      .count = count(json["count"], 1, kMostPeople),
                      .limits = {}};
  capture::WardrobeLimits& limits = group.limits;
  if (json.has("outfits")) limits.outfits = texts(json["outfits"]);
  if (json.has("skins")) limits.skins = texts(json["skins"]);
  if (json.has("exclude_outfits")) limits.excluded_outfits = texts(json["exclude_outfits"]);
  if (json.has("exclude_skins")) limits.excluded_skins = texts(json["exclude_skins"]);
  return group;
}

InitialWeightsRecipe read_initial(const JsonField& json) {
  allow_only(json, {"identities", "rounds", "per_round", "iterations", "first_step", "last_step",
                    "learning_rate", "standoff_weight"});
  InitialWeightsRecipe initial{.identities = count(json["identities"], 1, kMostPeople),
                               .rounds = count(json["rounds"], 0, 100000),
                               .iterations = whole(json["iterations"], 1, 1u << 24),
                               .first_step = real(json["first_step"], 0, 1),
                               .last_step = real(json["last_step"], 0, 1)};
  if (json.has("per_round")) initial.per_round = count(json["per_round"], 1, 64);
  if (json.has("learning_rate")) initial.learning_rate = real(json["learning_rate"], 1e-9, 1);
  if (json.has("standoff_weight"))
    initial.standoff_weight = static_cast<float>(real(json["standoff_weight"], 0, 1000));
  return initial;
}

SharedNetworkRecipe read_shared(const JsonField& json) {
  allow_only(json, {"identities", "iterations", "poses", "learning_rate"});
  SharedNetworkRecipe shared{.identities = count(json["identities"], 2, kMostPeople),
                             .iterations = whole(json["iterations"], 1, 1u << 30)};
  if (json.has("poses")) shared.poses = count(json["poses"], 1, 64);
  if (json.has("learning_rate")) shared.learning_rate = real(json["learning_rate"], 1e-9, 1);
  return shared;
}

std::array<double, body::kBodyPartCount> read_atlas(const JsonField& json) {
  std::array<double, body::kBodyPartCount> weight{};
  weight.fill(1);
  if (!json.json().is_object()) json.fail("not an object");
  for (const auto& [name, value] : json.json().items()) {
    const std::optional<body::BodyPart> part = body::find_body_part(name);
    if (!part) json.fail("'" + name + "' is no part of the body");
    weight[static_cast<size_t>(*part)] = real(json[name.c_str()], 1e-3, 1e3);
  }
  return weight;
}

// A network for every texel and nothing beside it, unless the recipe says what else.
void read_parts(const JsonField& json, train::TrainSettings& settings) {
  if (!json.has("static_grids")) {
    settings = train::network_alone(settings);
    if (json.has("network_size")) json["network_size"].fail("needs static_grids");
    return;
  }
  settings.static_grids =
      train::parse_static_grids(json["static_grids"].text(), json["static_grids"].where());
  if (json.has("network_size")) settings.network_size = count(json["network_size"], 8, 1024);
}

// What a recipe may say of training. All else is what `figurine-train avatar` does by default.
train::TrainSettings read_training(const JsonField& json, const std::string& preset) {
  allow_only(json,
             {"iterations", "views_per_pose", "poses", "learning_rate", "seed", "spacing_scale",
              "standoff_weight", "precision", "static_grids", "network_size"});
  train::TrainSettings settings = train::preset_settings(preset);
  read_parts(json, settings);
  settings.schedule.budget = {.iterations = whole(json["iterations"], 1, 1u << 30), .seconds = 0};
  if (json.has("views_per_pose")) settings.views_per_pose = count(json["views_per_pose"], 1, 64);
  if (json.has("poses")) settings.poses_per_iteration = count(json["poses"], 1, 64);
  if (json.has("learning_rate")) settings.schedule.peak = real(json["learning_rate"], 1e-9, 1);
  if (json.has("spacing_scale"))
    settings.decoding.spacing_scale = static_cast<float>(real(json["spacing_scale"], 0.05, 5));
  if (json.has("standoff_weight"))
    settings.standoff_weight = static_cast<float>(real(json["standoff_weight"], 0, 1000));
  if (json.has("seed")) settings.seed = json["seed"].whole();
  settings.bf16 = train::has_fast_bf16();
  if (json.has("precision")) {
    const std::string precision = json["precision"].text();
    if (precision != "f32" && precision != "bf16")
      json["precision"].fail("'" + precision + "' is neither f32 nor bf16");
    settings.bf16 = precision == "bf16";
  }
  settings.threads = 1;
  train::check_parts(settings, json.where());
  return settings;
}

void read_capture(const JsonField& json, Recipe& recipe) {
  allow_only(json, {"frames", "views", "bust_views", "size_px"});
  recipe.frames = count(json["frames"], 4, 100000);
  recipe.cameras.views = count(json["views"], 2, 256);
  if (json.has("bust_views")) recipe.cameras.bust_views = count(json["bust_views"], 0, 256);
  recipe.cameras.width_px = recipe.cameras.height_px = count(json["size_px"], 16, 8192);
}

// Names that only the test part may wear are never chosen elsewhere, and nobody is in two groups.
void check_groups(const Recipe& recipe, const std::string& path) {
  std::set<uint32_t> seen;
  bool has_train = false;
  for (const IdentityGroup& group : recipe.groups) {
    has_train = has_train || group.split == Split::kTrain;
    for (uint32_t i = 0; i < group.count; ++i) {
      if (!seen.insert(group.first + i).second) {
        throw InputError(path + ": groups: identity " + std::to_string(group.first + i) +
                         " is in two of them");
      }
    }
  }
  if (!has_train) throw InputError(path + ": groups: none is of the part train");
  if (seen.size() > kMostPeople)
    throw InputError(path + ": groups: more than " + std::to_string(kMostPeople) + " people");
  for (const auto& [field, list] :
       {std::pair{"frozen", &recipe.frozen}, std::pair{"scratch", &recipe.scratch},
        std::pair{"rounded", &recipe.rounded}}) {
    for (uint32_t number : *list) {
      if (!seen.contains(number))
        throw InputError(path + ": " + field + ": identity " + std::to_string(number) +
                         " is in no group");
    }
  }
  uint32_t training = 0;
  for (const IdentityGroup& group : recipe.groups)
    training += group.split == Split::kTrain ? group.count : 0;
  for (const auto& [field, asked] : {std::pair{"initial_weights", recipe.initial.identities},
                                     std::pair{"shared_network", recipe.shared.identities}}) {
    if (asked > training) {
      throw InputError(path + ": " + field + ".identities: " + std::to_string(asked) + " of " +
                       std::to_string(training) + " training identities");
    }
  }
}

std::vector<std::string> only_test(const Recipe& recipe,
                                   std::vector<std::string> capture::WardrobeLimits::* excluded) {
  std::optional<std::set<std::string>> common;  // of all groups that are not test
  for (const IdentityGroup& group : recipe.groups) {
    if (group.split == Split::kTest) continue;
    const std::vector<std::string>& names = group.limits.*excluded;
    std::set<std::string> both;
    for (const std::string& name : names) {
      if (!common || common->contains(name)) both.insert(name);
    }
    common = std::move(both);
  }
  return common ? std::vector<std::string>(common->begin(), common->end())
                : std::vector<std::string>{};
}

}  // namespace

std::string Identity::name() const {
  char digits[16];  // as captures name their folders
  std::snprintf(digits, sizeof(digits), "%06u", number);
  return digits;
}

Recipe read_recipe(const std::string& path) {
  const nlohmann::json text = train::read_json(path);
  const JsonField json(text, path);
  allow_only(json,
             {"about", "name", "body", "preset", "seed", "motions", "capture", "groups",
              "initial_weights", "shared_network", "atlas", "training", "package", "evaluation"});
  Recipe recipe;
  recipe.name = json["name"].text();
  if (json.has("body")) {
    const std::string body = json["body"].text();
    if (body != "makehuman" && body != "mannequin")
      json["body"].fail("'" + body + "' is neither makehuman nor mannequin");
    recipe.mannequin = body == "mannequin";
  }
  recipe.seed = json["seed"].whole();
  for (const JsonField& motion : json["motions"].items())
    recipe.motions.push_back(read_motion(motion));
  if (recipe.motions.empty()) json["motions"].fail("is empty");
  read_capture(json["capture"], recipe);
  for (const JsonField& group : json["groups"].items()) recipe.groups.push_back(read_group(group));
  if (json.has("atlas")) recipe.atlas_weight = read_atlas(json["atlas"]);
  if (recipe.mannequin && recipe.atlas_weight) json["atlas"].fail("is for the body makehuman");
  recipe.training = read_training(json["training"], json["preset"].text());
  if (!json.has("shared_network")) {
    recipe.initial = read_initial(json["initial_weights"]);
  } else {
    if (json.has("initial_weights"))
      json["shared_network"].fail("and initial_weights: one of the two");
    if (recipe.training.static_grids.empty())
      json["shared_network"].fail("needs training.static_grids: a member is its map");
    recipe.shared = read_shared(json["shared_network"]);
  }
  if (json.has("package")) {
    allow_only(json["package"], {"levels"});
    recipe.levels = count(json["package"]["levels"], 1, kMostLevels);
  }
  if (json.has("evaluation")) {
    const JsonField evaluation = json["evaluation"];
    allow_only(evaluation, {"frozen", "scratch", "rounded", "view_frame_step"});
    if (evaluation.has("frozen")) recipe.frozen = numbers(evaluation["frozen"]);
    if (evaluation.has("scratch")) recipe.scratch = numbers(evaluation["scratch"]);
    if (evaluation.has("rounded")) recipe.rounded = numbers(evaluation["rounded"]);
    if (evaluation.has("view_frame_step"))
      recipe.view_frame_step = count(evaluation["view_frame_step"], 1, 100000);
  }
  check_groups(recipe, path);
  return recipe;
}

std::vector<Identity> identities_of(const Recipe& recipe) {
  std::vector<Identity> all;
  for (const IdentityGroup& group : recipe.groups) {
    for (uint32_t i = 0; i < group.count; ++i)
      all.push_back({.number = group.first + i, .split = group.split, .group = &group});
  }
  return all;
}

nlohmann::json split_of(const Recipe& recipe) {
  nlohmann::json split{{"recipe", recipe.name}, {"seed", recipe.seed}};
  for (const Split part : {Split::kTrain, Split::kValidation, Split::kTest})
    split[to_string(part)] = nlohmann::json::array();
  for (const Identity& identity : identities_of(recipe))
    split[to_string(identity.split)].push_back(identity.name());
  split["only_test"] = {{"outfits", only_test(recipe, &capture::WardrobeLimits::excluded_outfits)},
                        {"skins", only_test(recipe, &capture::WardrobeLimits::excluded_skins)}};
  return split;
}

std::string find_clip(const std::string& clip, const std::string& recipe_path) {
  const char* emotes = std::getenv("FIGURINE_EMOTES");
  std::vector<fs::path> folders{fs::path(recipe_path).parent_path(), kCmuFolder};
  if (emotes != nullptr) folders.push_back(emotes);
  for (const fs::path& folder : folders) {
    if (fs::exists(folder / clip)) return (folder / clip).string();
  }
  throw InputError(recipe_path + ": motions: " + clip + " is neither beside the recipe, nor in " +
                   kCmuFolder + " (Debian package assimp-testmodels), nor in $FIGURINE_EMOTES" +
                   (emotes == nullptr ? ", which is not set" : ""));
}

}  // namespace figurine::population
