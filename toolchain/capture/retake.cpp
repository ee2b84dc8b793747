#include "toolchain/capture/retake.h"

#include <nlohmann/json.hpp>
#include <vector>

#include "ports/host/files.h"
#include "toolchain/body/makehuman.h"
#include "toolchain/capture/capture.h"
#include "toolchain/capture/person.h"
#include "toolchain/error.h"

namespace figurine::capture {

namespace {

// What figurine.json says of how the person came about.
struct Record {
  uint64_t seed = 0;
  uint32_t identity = 0;
  std::string body_name;
  std::vector<float> shape;
  WardrobeLimits limits;
  FoldMode folds = FoldMode::kPose;
};

FoldMode folds_of(const std::string& text) {
  for (const FoldMode mode : {FoldMode::kPose, FoldMode::kRest, FoldMode::kOff}) {
    if (text == to_string(mode)) return mode;
  }
  throw InputError("folds: '" + text + "' is unknown");
}

Record read_record(const std::string& path) {
  const ports::MappedFile file = value_or_throw(ports::MappedFile::open(path), path);
  const auto* text = reinterpret_cast<const char*>(file.bytes().data());
  try {
    const nlohmann::json json = nlohmann::json::parse(text, text + file.bytes().size());
    const nlohmann::json& limits = json.at("limits");
    return {
        .seed = json.at("seed").get<uint64_t>(),
        .identity = json.at("identity").get<uint32_t>(),
        .body_name = json.at("body").at("name").get<std::string>(),
        .shape = json.at("shape").get<std::vector<float>>(),
        .limits = {.outfits = limits.at("outfits").get<std::vector<std::string>>(),
                   .skins = limits.at("skins").get<std::vector<std::string>>(),
                   .excluded_outfits =
                       limits.at("excluded_outfits").get<std::vector<std::string>>(),
                   .excluded_skins = limits.at("excluded_skins").get<std::vector<std::string>>(),
                   .hair = limits.at("hair").get<std::string>()},
        .folds = folds_of(json.at("folds").get<std::string>())};
  } catch (const nlohmann::json::exception& error) {
    throw InputError(path + ": " + error.what());
  } catch (const InputError& error) {
    throw InputError(path + ": " + error.what());
  }
}

Person make_person(const Record& record, const Body& body, const std::string& makehuman) {
  const PersonRequest request{.seed = person_seed(record.seed, record.identity),
                              .limits = record.limits};
  if (body.name == "mannequin") return make_mannequin_person(request, body);
  if (makehuman.empty())
    throw InputError("--makehuman: no directory given and FIGURINE_MAKEHUMAN is not set");
  return make_makehuman_person(request, body::MakeHuman::load(makehuman), makehuman, body);
}

}  // namespace

struct Retake::Sitting {
  Sitting(const Record& record, const Body& of, const std::string& makehuman)
      : body(of), person(make_person(record, of, makehuman)), renderer(person, record.folds) {
    joints_m.resize(body.joint_position_m.size());
    std::vector<float> texels(body.texel_position_m.size());
    shape_body(body, record.shape, joints_m, texels);
  }

  const Body& body;
  const Person person;
  std::vector<float> joints_m;  // [J,3] of the person's own shape
  Renderer renderer;
};

Retake::Retake(const std::string& identity, const Package& body, const std::string& makehuman) {
  const std::string path = identity + "/figurine.json";
  const Record record = read_record(path);
  if (record.body_name != body.body().name)
    throw InputError(path + ": body: is '" + record.body_name + "', not '" + body.body().name +
                     "'");
  if (record.shape.size() > body.body().shape_count())
    throw InputError(path + ": shape: has more coefficients than the body");
  sitting_ = std::make_unique<Sitting>(record, body.body(), makehuman);
}
Retake::~Retake() = default;

void Retake::set_pose(const PoseView& pose) {
  const Body& body = sitting_->body;
  throw_if_error(validate_pose(pose, body.joint_count()), body.name);
  std::vector<Affine> transforms(body.joint_count());
  skinning_transforms({body.parents, sitting_->joints_m}, pose, transforms);
  sitting_->renderer.set_pose(transforms);
}

Rendering Retake::render(const Camera& camera) const { return sitting_->renderer.render(camera); }

}  // namespace figurine::capture
