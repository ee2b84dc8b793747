#include "toolchain/train/pack_avatar.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>

#include "formats/writer/package_writer.h"
#include "ports/media/png.h"
#include "toolchain/error.h"
#include "toolchain/tensor_operations.h"
#include "toolchain/train/avatar_model.h"
#include "toolchain/train/facing.h"
#include "toolchain/train/known_poses.h"

namespace figurine::train {

namespace {

constexpr uint32_t kGoldenSize_px = 256;
constexpr std::array<float, 3> kGoldenBackground{0.5f, 0.5f, 0.5f};

// While it lives, the static values are those of a package.
class WithStaticPart {
 public:
  WithStaticPart(StaticMap& map, const StaticPart& part, const model::HeadLayout& layout)
      : map_(map), kept_(map.values) {
    map_.values = map_.values.clone();
    take_static_part(part, layout, map_);
  }
  ~WithStaticPart() { map_.values = kept_; }
  WithStaticPart(const WithStaticPart&) = delete;
  WithStaticPart& operator=(const WithStaticPart&) = delete;

 private:
  StaticMap& map_;
  torch::Tensor kept_;
};

std::vector<std::byte> golden_png(TrainedAvatar& avatar, const StaticPart& part,
                                  const GoldenView& view) {
  const WithStaticPart rounded(avatar.model().statics(), part,
                               head_layout(avatar.description().settings));
  const PosedBody posed = avatar.model().pose(view.pose.view());
  const std::vector<float> rgba =
      avatar.model().render_rgba(avatar.model().evaluate(posed), posed, view.camera);
  ports::ImageU8 image(view.camera.width_px, view.camera.height_px, 3);
  for (size_t pixel = 0; pixel < rgba.size() / 4; ++pixel) {
    for (size_t c = 0; c < 3; ++c) {
      const float value = rgba[4 * pixel + c] + (1 - rgba[4 * pixel + 3]) * kGoldenBackground[c];
      image.pixels[3 * pixel + c] =
          static_cast<uint8_t>(std::clamp(value, 0.0f, 1.0f) * 255.0f + 0.5f);
    }
  }
  return value_or_throw(ports::encode_png(image), "golden frame");
}

// A JSON object as dotted keys and values: {"budget": {"seconds": 60}} -> budget.seconds = 60.
void flatten(const nlohmann::json& json, const std::string& prefix, std::vector<KeyValue>& out) {
  for (const auto& [key, value] : json.items()) {
    const std::string name = prefix.empty() ? key : prefix + "." + key;
    if (value.is_object()) {
      flatten(value, name, out);
    } else {
      out.push_back({name, value.is_string() ? value.get<std::string>() : value.dump()});
    }
  }
}

std::string text_of(const nlohmann::json& json, const char* key) {
  const auto found = json.find(key);
  return found != json.end() && found->is_string() ? found->get<std::string>() : std::string{};
}

// The figures of evaluation.json that a person asks a package for.
std::vector<QualityMetric> read_quality(const RunDirectory& run) {
  std::vector<QualityMetric> quality;
  if (!std::filesystem::exists(run.evaluation())) return quality;
  const nlohmann::json report = read_json(run.evaluation());
  const auto add = [&](const std::string& name, const char* group, const char* metric) {
    const auto found = report.find(group);
    if (found == report.end() || !found->is_object()) return;
    const auto value = found->find(metric);
    if (value != found->end() && value->is_number())
      quality.push_back({name, value->get<double>()});
  };
  add("psnr_view_db", "held_out_views", "psnr_db");
  add("psnr_pose_db", "held_out_poses", "psnr_db");
  add("flat_psnr_db", "held_out_poses", "flat_psnr_db");
  add("head_psnr_db", "held_out_poses", "head_psnr_db");
  add("highpass_ratio", "held_out_poses", "highpass_ratio");
  add("highpass_correlation", "held_out_poses", "highpass_correlation");
  add("filled_share", "held_out_poses", "filled_share");
  constexpr std::array kBust{"bust_psnr_db", "bust_head_psnr_db", "bust_highpass_ratio",
                             "bust_highpass_correlation"};
  for (const char* metric : kBust) add(metric, "held_out_poses", metric);
  for (const char* metric : {"highpass_ratio", "highpass_correlation"})
    add("view_" + std::string(metric), "held_out_views", metric);
  for (const char* metric : kBust) add("view_" + std::string(metric), "held_out_views", metric);
  return quality;
}

Provenance make_provenance(const TrainedAvatar& avatar, const RunDirectory& run,
                           const PackOptions& options) {
  const nlohmann::json& json = avatar.description().json;
  const bool synthetic =
      !avatar.data().sources().empty();  // only figurine's own captures state their sources
  if (!synthetic && (options.licence_name.empty() || options.depicted_person.empty())) {
    throw InputError(
        run.path +
        ": shows a real person: say --licence and --depicted-person (how consent was given)");
  }
  const auto or_default = [](const std::string& given, const char* fallback) {
    return given.empty() ? std::string(fallback) : given;
  };
  Provenance provenance{.tool = "figurine-train " FIGURINE_VERSION,
                        .created = utc_now().substr(0, 10)};
  provenance.sources = avatar.data().sources();
  provenance.licence_name = or_default(options.licence_name, "CC0-1.0");
  provenance.licence_url = options.licence_name.empty()
                               ? "https://creativecommons.org/publicdomain/zero/1.0/"
                               : options.licence_url;
  provenance.authors = options.authors;
  provenance.avatar_permission =
      or_default(options.avatar_permission, synthetic ? "everyone" : "onlyAuthor");
  provenance.commercial_usage =
      or_default(options.commercial_usage, synthetic ? "corporation" : "personalNonProfit");
  provenance.depicted_person = or_default(options.depicted_person, "synthetic");
  for (const char* key : {"command", "commit"})
    provenance.settings.push_back({key, text_of(json, key)});
  nlohmann::json said = to_json(avatar.description().settings);
  said["init"] = std::filesystem::path(avatar.description().settings.init)
                     .filename()
                     .string();  // folders mean nothing elsewhere
  flatten(said, "", provenance.settings);
  for (const char* key : {"iterations", "train_seconds"}) {
    if (json.contains(key)) provenance.settings.push_back({key, json.at(key).dump()});
  }
  if (json.contains("data") && json.at("data").contains("seed"))
    provenance.settings.push_back({"data.seed", json.at("data").at("seed").dump()});
  provenance.settings.insert(provenance.settings.end(), options.settings.begin(),
                             options.settings.end());
  provenance.quality = read_quality(run);
  return provenance;
}

}  // namespace

GoldenView choose_golden_view(const TrainedAvatar& avatar) {
  const dataset::Dataset& data = avatar.data();
  std::vector<size_t> block;
  for (size_t frame = 0; frame < data.frames().size(); ++frame) {
    if (data.frames()[frame].split == dataset::FrameSplit::kBlock) block.push_back(frame);
  }
  if (block.empty()) block.push_back(data.frames().size() / 2);
  size_t best_frame = block.front(), best_camera = 0;
  float most = -2;
  for (const size_t frame : block) {
    for (size_t c = 0; c < data.cameras().size(); ++c) {
      if (data.cameras()[c].framing != dataset::Framing::kBody) continue;
      const float faced = facing(avatar.body(), data.frames()[frame], data.cameras()[c].camera);
      if (faced > most) most = faced, best_frame = frame, best_camera = c;
    }
  }
  GoldenView view{avatar.model().from_capture(data.frames()[best_frame]),
                  data.cameras()[best_camera].camera};
  Camera& camera = view.camera;
  const float shrink =
      std::min(1.0f, float(kGoldenSize_px) / float(std::max(camera.width_px, camera.height_px)));
  camera.width_px = std::max(1u, static_cast<uint32_t>(float(camera.width_px) * shrink));
  camera.height_px = std::max(1u, static_cast<uint32_t>(float(camera.height_px) * shrink));
  for (float* value : {&camera.fx_px, &camera.fy_px, &camera.cx_px, &camera.cy_px})
    *value *= shrink;
  return view;
}

std::vector<std::byte> pack_avatar(TrainedAvatar& avatar, const RunDirectory& run,
                                   const PackOptions& options) {
  const TrainSettings& settings = avatar.description().settings;
  if (settings.freeze_pose)
    throw InputError(
        run.path +
        ": was trained with a frozen body pose, an experiment that no device can repeat");
  if (!options.network && (!settings.freeze_network || settings.adapter.rank > 0)) {
    throw InputError(run.path +
                     ": its network is its own and cannot be left out (avatar "
                     "--freeze-network)");
  }
  const RoundedMap statics(avatar.model().statics(), head_layout(settings));
  const bool has_network = settings.network && options.network;
  std::vector<float> storage;
  Network network = has_network ? make_network(settings) : Network{};
  uint64_t macs = 0;
  if (has_network) {
    network = avatar.model().unet().export_network(storage);
    macs = count_macs(network, value_or_throw(infer_shapes(network, true), run.path));
  }
  if (!options.float_weights) {
    for (Layer& layer : network.layers) layer.weights = layer.bias = {};
  }

  std::vector<std::vector<float>> rotations;
  for (const dataset::CaptureFrame& frame : avatar.data().frames()) {
    if (frame.split == dataset::FrameSplit::kTrain) rotations.push_back(frame.rotations);
  }
  const KnownPoseStatistics known = known_poses(rotations, avatar.body().joint_count());
  const GoldenView view = choose_golden_view(avatar);
  const bool has_picture = options.golden && options.float_weights && options.network;
  const std::vector<std::byte> png =
      has_picture ? golden_png(avatar, statics.view(), view) : std::vector<std::byte>{};

  Avatar content;
  content.kind() = {.body_name = avatar.body().name,
                    .body_hash = avatar.body_file().package.content_hash(),
                    .preset = settings.preset,
                    .template_mode = settings.template_mode,
                    .fourier_octaves = has_network ? settings.fourier_octaves : 0,
                    .network = network};
  content.traits() = {.map_statistics = {},
                      .decoding = settings.decoding,
                      .golden = {.root_translation_m = view.pose.root_translation_m,
                                 .rotations = view.pose.rotations,
                                 .camera = view.camera,
                                 .background = kGoldenBackground,
                                 .png = {reinterpret_cast<const uint8_t*>(png.data()), png.size()},
                                 .fixed_point_hash = options.fixed_point_hash,
                                 .fixed_point_library = options.fixed_point_library}};
  content.name = options.name.empty()
                     ? std::filesystem::path(avatar.data().directory()).filename().string()
                     : options.name;
  content.uv_size = texel_side(settings);
  content.shape = avatar.model().shape();
  content.fixed_point = options.fixed_point;
  content.static_part = statics.view();
  if (const SmallestExtentMap* extents = avatar.model().smallest_extents())
    content.smallest_extents = extents->view();
  content.antialiased = settings.antialiased;
  // What is learnt from poses is the network.
  if (has_network) content.pose_statistics = known.view();
  const figurine::Budget budget{.peak_memory_bytes = options.peak_memory_bytes,
                                .macs_per_frame = macs,
                                .gaussians = avatar.body().texel_count()};
  return value_or_throw(write_package(content, budget, make_provenance(avatar, run, options)),
                        run.path);
}

}  // namespace figurine::train
