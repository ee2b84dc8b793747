#include "samples/inspect/print.h"

#include <algorithm>
#include <format>
#include <vector>

namespace figurine::inspect {

namespace {

// Collects "label  value" lines under headings; a value of several lines is indented under its
// label.
class Page {
 public:
  void heading(const std::string& text) { text_ += (text_.empty() ? "" : "\n") + text + "\n"; }
  void line(const std::string& label, const std::string& value) {
    if (value.empty()) return;
    std::string indented;
    for (char c : value) {
      indented += c;
      if (c == '\n') indented += std::string(kIndent, ' ');
    }
    text_ += std::format("  {:<{}}{}\n", label, kIndent - 2, indented);
  }
  const std::string& text() const { return text_; }

 private:
  static constexpr size_t kIndent = 20;
  std::string text_;
};

std::string text_of(const Json& value) {
  return value.is_string() ? value.get<std::string>() : value.dump();
}

std::string in_bytes(const Json& value) {
  const double bytes = value.get<double>();
  if (bytes == 0) return "not declared";
  if (bytes < 1e5) return std::format("{:.0f} bytes", bytes);
  return bytes < 1e9 ? std::format("{:.2f} MB", bytes / 1e6)
                     : std::format("{:.2f} GB", bytes / 1e9);
}

std::string in_millions(const Json& value) {
  const double count = value.get<double>();
  if (count == 0) return "not declared";
  if (count < 1e5) return std::format("{:.0f}", count);
  return count < 1e9 ? std::format("{:.2f} million", count / 1e6)
                     : std::format("{:.3f} thousand million", count / 1e9);
}

std::string joined(const Json& list, const char* separator) {
  std::string text;
  for (const Json& entry : list) text += (text.empty() ? "" : separator) + text_of(entry);
  return text;
}

// Names in lines of at most 100 characters.
std::string wrapped(const std::vector<std::string>& words) {
  std::string text;
  size_t width = 0;
  for (const std::string& word : words) {
    if (width + word.size() + 2 > 100) {
      text += "\n";
      width = 0;
    } else if (!text.empty()) {
      text += "  ";
    }
    text += word;
    width += word.size() + 2;
  }
  return text;
}

void print_body(Page& page, const Json& body) {
  page.heading("body");
  page.line("map", std::format("{0}x{0} texels, {1} covered, {2} border", text_of(body["uv_size"]),
                               text_of(body["covered_texels"]), text_of(body["border_texels"])));
  if (body.contains("mesh_places"))
    page.line("layout", "not the mesh's own: every texel states its place on the mesh");
  page.line("shape", text_of(body["shape_coefficients"]) + " coefficients");
  const Json &low = body["rest_extent_m"]["min"], &high = body["rest_extent_m"]["max"];
  std::string rest =
      std::format("x {:.3f} to {:.3f} m, y {:.3f} to {:.3f} m, z {:.3f} to {:.3f} m",
                  low[0].get<double>(), high[0].get<double>(), low[1].get<double>(),
                  high[1].get<double>(), low[2].get<double>(), high[2].get<double>());
  if (const Json& arm = body["left_arm_below_horizontal_deg"]; !arm.is_null())
    rest += "\nleft arm " + text_of(arm) + " degrees below the horizontal";
  page.line("rest pose", rest);
  std::vector<std::string> names;
  for (const Json& joint : body["joints"])
    names.push_back(std::format("{} {}", names.size(), text_of(joint["name"])));
  page.line("joint order", wrapped(names));
}

void print_motion(Page& page, const Json& motion) {
  page.heading("motion");
  page.line("frames",
            std::format("{} at {} a second, {} s", text_of(motion["frames"]),
                        text_of(motion["frames_per_second"]), text_of(motion["seconds"])));
  std::vector<std::string> names;
  for (const Json& joint : motion["joints"])
    names.push_back(std::format("{} {}", names.size(), text_of(joint)));
  page.line("joint order", wrapped(names));
}

void print_network(Page& page, const Json& network) {
  if (network.is_null()) return page.line("network", "none");
  page.line("network", std::format("input {0}x{0}x{1}, {2} layers, {3} parameters, {4} MACs",
                                   text_of(network["input"]["size"]),
                                   text_of(network["input"]["channels"]), network["layers"].size(),
                                   text_of(network["parameters"]), in_millions(network["macs"])));
}

void print_decoding(Page& page, const Json& decoding) {
  page.line("decoding",
            std::format("offset x {} m, scale x {} texel spacings, log-scale at most {}, opacity "
                        "bias {}, SH degree {}",
                        text_of(decoding["offset_scale_m"]), text_of(decoding["spacing_scale"]),
                        text_of(decoding["max_log_scale"]), text_of(decoding["opacity_bias"]),
                        text_of(decoding["sh_degree"])));
}

void print_pose_statistics(Page& page, const Json& joints, const Json& distances = nullptr) {
  if (joints.empty()) return page.line("pose statistics", "none");
  std::string text = std::to_string(joints.size()) + " joints";
  if (!distances.is_null()) {
    text += std::format("; training poses at {:.2f} to {:.2f}, half of them within {:.2f}",
                        distances["min"].get<double>(), distances["max"].get<double>(),
                        distances["median"].get<double>());
  }
  page.line("pose statistics", text);
}

void print_static_part(Page& page, const Json& part) {
  if (part.is_null()) return page.line("static part", "none");
  std::string text = in_bytes(part["bytes"]);
  for (const Json& group : part["groups"]) {
    const auto first = group["first_channel"].get<uint32_t>();
    text += std::format("\nchannels {} to {}: {} cells of {}x{}, {}", first,
                        first + group["channels"].get<uint32_t>() - 1, text_of(group["cells"]),
                        text_of(group["grid_size"]), text_of(group["grid_size"]),
                        in_bytes(group["bytes"]));
  }
  page.line("static part", text);
}

void print_filters(Page& page, const Json& avatar) {
  const Json& extents = avatar["smallest_extents"];
  page.line("smallest extents",
            extents.is_null()
                ? "none"
                : std::format("{:.2f} to {:.2f} mm, {}", 1e3 * extents["min_m"].get<double>(),
                              1e3 * extents["max_m"].get<double>(), in_bytes(extents["bytes"])));
  page.line("antialiased", avatar["antialiased"].get<bool>() ? "yes" : "no");
}

// What takes how much of the file.
std::string by_part(const Json& document) {
  const std::pair<const char*, const char*> words[] = {
      {"network", "network in float"}, {"fixed", "network in fixed point"},
      {"static", "static part"},       {"filter", "smallest extents"},
      {"pose", "pose statistics"},     {"golden", "golden frame"},
      {"avatar", "shape coefficients"}};
  std::string text = in_bytes(document["size_bytes"]);
  for (const auto& [name, bytes] : document["parts"].items()) {
    std::string label = name;
    for (const auto& [part, meaning] : words) {
      if (name == part) label = meaning;
    }
    text += std::format("\n{:<24}{:>9}", label, text_of(bytes));
  }
  return text;
}

void print_avatar(Page& page, const Json& avatar) {
  page.heading("avatar");
  page.line("body", text_of(avatar["body"]["name"]) + "  " + text_of(avatar["body"]["hash"]));
  page.line("joint order", "the body's");
  page.line("preset", text_of(avatar["preset"]));
  page.line("template", text_of(avatar["template"]) + ", " +
                            std::to_string(avatar["shape"].size()) + " shape coefficients");
  page.line("map", std::format("{0}x{0} texels", text_of(avatar["uv_size"])));
  print_network(page, avatar["network"]);
  print_static_part(page, avatar["static_part"]);
  print_filters(page, avatar);
  page.line("precision", joined(avatar["precisions"], ", "));
  if (const Json& fixed = avatar["fixed_point"]; !fixed.is_null()) {
    page.line("fixed point",
              std::format("{} of weights, scales and biases; one step of the input is {:.4g}",
                          in_bytes(fixed["bytes"]), fixed["input_scale"].get<double>()));
  }
  page.line("Fourier octaves", text_of(avatar["fourier_octaves"]));
  print_decoding(page, avatar["decoding"]);
  print_pose_statistics(page, avatar["pose_statistics_joints"], avatar["pose_distances"]);
  const Json& golden = avatar["golden"];
  if (golden.is_null()) {
    page.line("golden frame", "none");
    return;
  }
  std::string frame = std::format("{}x{} pixels, {} joints, image of {} bytes",
                                  text_of(golden["width_px"]), text_of(golden["height_px"]),
                                  text_of(golden["joints"]), text_of(golden["png_bytes"]));
  if (const Json& hash = golden["fixed_point_hash"]; !hash.is_null()) {
    frame += std::format("\nin fixed point {} by {}", text_of(hash),
                         text_of(golden["fixed_point_library"]));
  }
  page.line("golden frame", frame);
}

void print_population(Page& page, const Json& population) {
  page.heading("population");
  page.line("body",
            text_of(population["body"]["name"]) + "  " + text_of(population["body"]["hash"]));
  page.line("joint order", "the body's");
  page.line("preset", text_of(population["preset"]));
  page.line("template", text_of(population["template"]));
  print_network(page, population["network"]);
  page.line("Fourier octaves", text_of(population["fourier_octaves"]));
  const Json& members = population["members"];
  std::string splits;
  for (const char* split : {"train", "validation", "test"}) {
    const auto count = std::ranges::count_if(
        members, [&](const Json& member) { return member["split"] == split; });
    splits += std::format("{}{} {}", splits.empty() ? "" : ", ", count, split);
  }
  page.line("members", std::format("{}: {}", members.size(), splits));
  page.line("differences", population["coding"] == "q8"
                               ? "int8, one scale an output channel, entropy-coded"
                               : "16-bit floats");
}

void print_sampler(Page& page, const Json& sampler) {
  page.heading("sampler");
  page.line("body", text_of(sampler["body"]["name"]) + "  " + text_of(sampler["body"]["hash"]));
  page.line("joint order", "the body's");
  page.line("preset", text_of(sampler["preset"]));
  page.line("template", std::format("{}, {} shape coefficients", text_of(sampler["template"]),
                                    text_of(sampler["shape_coefficients"])));
  print_network(page, sampler["network"]);
  page.line("Fourier octaves", text_of(sampler["fourier_octaves"]));
  print_decoding(page, sampler["decoding"]);
  print_pose_statistics(page, sampler["pose_statistics_joints"]);
  const Json& golden = sampler["golden"];
  page.line("golden frame",
            golden.is_null()
                ? "none"
                : std::format("{}x{} pixels, {} joints", text_of(golden["width_px"]),
                              text_of(golden["height_px"]), text_of(golden["joints"])));

  page.heading("sampling");
  const Json &space = sampler["space"], &denoiser = sampler["denoiser"], &noise = sampler["noise"];
  page.line("weights", std::format("{} values on {} directions, {} tokens, {}",
                                   text_of(space["values"]), text_of(space["directions"]),
                                   space["tokens"].size(), in_bytes(space["bytes"])));
  page.line("denoiser",
            std::format("d_model {}, {} blocks, {} heads, feed-forward {}, {} parameters, {}",
                        text_of(denoiser["d_model"]), text_of(denoiser["blocks"]),
                        text_of(denoiser["heads"]), text_of(denoiser["feed_forward"]),
                        text_of(denoiser["parameters"]), in_bytes(denoiser["bytes"])));
  page.line("noise", std::format("dimension {0}: {0} x SNR {1} at the noisy end, {2} where the "
                                 "band ends, SNR {3} at the clean end\n"
                                 "{4} of the levels in the band, at least",
                                 text_of(noise["dimension"]), text_of(noise["noisy_dimension_snr"]),
                                 text_of(noise["decided_dimension_snr"]),
                                 text_of(noise["clean_snr"]), text_of(noise["band_share"])));
  page.line("solver",
            std::format("{} steps of {}", text_of(sampler["steps"]), text_of(sampler["method"])));
  std::string seeds;
  for (const Json& seed : sampler["golden_seeds"]) {
    seeds +=
        std::format("{}{}, {} steps of {}: {}", seeds.empty() ? "" : "\n", text_of(seed["seed"]),
                    text_of(seed["steps"]), text_of(seed["method"]), text_of(seed["hash"]));
  }
  page.line("golden seeds", seeds.empty() ? "none" : seeds);
  page.line("learnt from", "population " + text_of(sampler["population_hash"]));
}

std::string print_tokens(const Json& space) {
  std::string text = std::format("\n{:>6}  {:<12}{:>9}{:>9}\n", "token", "of", "values", "rank");
  size_t number = 0;
  for (const Json& token : space["tokens"]) {
    text += std::format("{:>6}  {:<12}{:>9}{:>9}\n", number++, text_of(token["name"]),
                        text_of(token["values"]), text_of(token["rank"]));
  }
  return text;
}

// The first figures of the evaluation. Its names and texts were checked for control characters as
// they lie in the file, not behind JSON's escapes: printed escaped.
std::string print_report(const Json& report) {
  constexpr size_t kMostLines = 40, kMostBytes = 100;
  if (report.is_null()) return "";
  const auto shortened = [](const std::string& text) {
    return text.size() <= kMostBytes ? text : text.substr(0, kMostBytes) + "...";
  };
  std::vector<std::pair<std::string, std::string>> lines;
  const Json leaves = report.flatten();
  for (const auto& [pointer, value] : leaves.items()) {
    const std::string name = Json(pointer).dump(-1, ' ', true);
    lines.emplace_back(shortened(name.substr(1, name.size() - 2)),
                       shortened(value.dump(-1, ' ', true)));
  }
  const size_t shown = std::min(lines.size(), kMostLines);
  size_t width = 0;
  for (size_t i = 0; i < shown; ++i) width = std::max(width, lines[i].first.size() + 2);
  std::string text = "\nevaluation\n";
  for (size_t i = 0; i < shown; ++i)
    text += std::format("  {:<{}}{}\n", lines[i].first, width, lines[i].second);
  if (lines.size() > shown) text += std::format("  and {} more (--json)\n", lines.size() - shown);
  return text;
}

// The table's columns of quality: the first few figures, whatever they are called.
constexpr size_t kQualityColumns = 4;

std::string print_members(const Json& population) {
  size_t width = 6;
  for (const Json& member : population["members"])
    width = std::max(width, text_of(member["name"]).size() + 2);
  std::vector<std::string> names;
  for (const Json& name : population["quality_names"]) {
    if (names.size() < kQualityColumns) names.push_back(text_of(name));
  }
  std::string text =
      std::format("\n{:>6}  {:<{}}{:<12}{:>9}", "number", "name", width, "split", "bytes");
  for (const std::string& name : names) text += std::format("{:>{}}", name, name.size() + 2);
  text += "\n";
  for (const Json& member : population["members"]) {
    text +=
        std::format("{:>6}  {:<{}}{:<12}{:>9}", text_of(member["number"]), text_of(member["name"]),
                    width, text_of(member["split"]), text_of(member["difference_bytes"]));
    const Json& quality = member["provenance"]["quality"];
    for (const std::string& name : names) {
      const std::string figure =
          quality.contains(name) ? std::format("{:.2f}", quality[name].get<double>()) : "-";
      text += std::format("{:>{}}", figure, name.size() + 2);
    }
    text += "\n";
  }
  return text;
}

void print_provenance(Page& page, const Json& provenance, bool has_members) {
  page.heading("provenance");
  page.line("tool", text_of(provenance["tool"]));
  page.line("created", text_of(provenance["created"]));
  page.line("sources", joined(provenance["sources"], "\n"));
  std::string settings;
  for (const Json& setting : provenance["settings"]) {
    settings += (settings.empty() ? "" : "\n") + text_of(setting["key"]) + " = " +
                text_of(setting["value"]);
  }
  page.line("settings", settings);
  std::string quality;
  for (const auto& [name, value] : provenance["quality"].items())
    quality += (quality.empty() ? "" : "\n") + name + " = " + value.dump();
  page.line("quality", quality);
  page.line("authors", joined(provenance["authors"], ", "));
  page.heading("licence");
  page.line("name", provenance["licence_name"] == ""
                        ? has_members ? "not stated here; each member has its own" : "not stated"
                        : text_of(provenance["licence_name"]));
  page.line("url", text_of(provenance["licence_url"]));
  page.line("who may perform", text_of(provenance["avatar_permission"]));
  page.line("commercial usage", text_of(provenance["commercial_usage"]));
  page.line("depicted person", text_of(provenance["depicted_person"]));
}

}  // namespace

std::string print_package(const Json& document) {
  Page page;
  page.heading(text_of(document["file"]));
  page.line("kind", std::format("{}, format version {}", text_of(document["kind"]),
                                text_of(document["version"])));
  page.line("name", text_of(document["name"]));
  page.line("content hash", text_of(document["content_hash"]));
  page.line("size", by_part(document));
  page.line("features", std::format("required {:#x}, optional {:#x}",
                                    document["required_features"].get<uint64_t>(),
                                    document["optional_features"].get<uint64_t>()));

  page.heading("what it needs");
  const Json& budget = document["budget"];
  if (document["kind"] == "avatar" || document["kind"] == "population" ||
      document["kind"] == "sampler") {
    page.line("peak memory", in_bytes(budget["peak_memory_bytes"]));
    page.line("MACs a frame", in_millions(budget["macs_per_frame"]));
  }
  if (document["kind"] != "motion")
    page.line("Gaussians",
              budget["gaussians"] == 0 ? "not declared" : text_of(budget["gaussians"]));
  for (const auto& [name, value] : document["conventions"].items()) {
    std::string label = name;
    for (char& c : label) c = c == '_' ? ' ' : c;
    page.line(label, text_of(value));
  }
  if (document.contains("body")) print_body(page, document["body"]);
  if (document.contains("avatar")) print_avatar(page, document["avatar"]);
  if (document.contains("motion")) print_motion(page, document["motion"]);
  if (document.contains("population")) print_population(page, document["population"]);
  if (document.contains("sampler")) print_sampler(page, document["sampler"]);
  print_provenance(page, document["provenance"], document.contains("population"));
  if (document.contains("population")) return page.text() + print_members(document["population"]);
  if (document.contains("sampler"))
    return page.text() + print_tokens(document["sampler"]["space"]) +
           print_report(document["sampler"]["report"]);
  return page.text();
}

std::string print_tensors(const Json& tensors) {
  const auto row = [](const auto& name, const auto& type, const auto& shape, const auto& bytes,
                      const auto& low, const auto& high, const auto& mean, const auto& checksum) {
    return std::format("{:<26}{:<5}{:<18}{:>11}{:>13}{:>13}{:>13}  {}\n", name, type, shape, bytes,
                       low, high, mean, checksum);
  };
  const auto six = [](const Json& value) { return std::format("{:.6g}", value.get<double>()); };
  std::string text = row("tensor", "type", "shape", "bytes", "min", "max", "mean", "XXH3-64");
  for (const Json& tensor : tensors) {
    text += row(text_of(tensor["name"]), text_of(tensor["type"]),
                "[" + joined(tensor["shape"], ",") + "]", text_of(tensor["size_bytes"]),
                six(tensor["min"]), six(tensor["max"]), six(tensor["mean"]),
                text_of(tensor["checksum"]));
  }
  return text;
}

std::string print_quantisation(const Json& fixed_point) {
  if (fixed_point.is_null()) return "";
  const auto row = [](const auto& layer, const auto& op, const auto& scale, const auto& zero,
                      const auto& low, const auto& high, const auto& bytes) {
    return std::format("{:<6}{:<16}{:>13}{:>6}{:>18}{:>13}{:>11}\n", layer, op, scale, zero, low,
                       high, bytes);
  };
  const auto six = [](const Json& value) {
    return value.is_null() ? std::string() : std::format("{:.6g}", value.get<double>());
  };
  std::string text =
      "\n" + row("layer", "operator", "scale", "zero", "weight scale min", "max", "bytes");
  text += row("input", "int16", six(fixed_point["input_scale"]), 0, "", "", "");
  size_t i = 0;
  for (const Json& layer : fixed_point["layers"]) {
    const Json weights = layer.value("weight_scale", Json{{"min", nullptr}, {"max", nullptr}});
    const bool is_head = layer["scale"].is_null();
    text += row(i++, text_of(layer["op"]), is_head ? "float" : six(layer["scale"]),
                is_head ? "" : text_of(layer["zero_point"]), six(weights["min"]),
                six(weights["max"]), layer.contains("bytes") ? text_of(layer["bytes"]) : "");
  }
  return text;
}

std::string print_comparison(const Json& comparison) {
  std::string text;
  for (const char* side : {"a", "b"}) {
    text += std::format("{}: {}  {}\n", side, text_of(comparison[side]["file"]),
                        text_of(comparison[side]["content_hash"]));
  }
  for (const Json& field : comparison["fields"]) {
    text += std::format("  {}: {} -> {}\n", text_of(field["field"]), field["a"].dump(),
                        field["b"].dump());
  }
  for (const Json& tensor : comparison["tensors"]) {
    const std::string name = text_of(tensor["name"]), difference = text_of(tensor["difference"]);
    if (difference == "values") {
      text += std::format("  {}: {} of {} values differ, largest difference {:.6g}, rms {:.6g}\n",
                          name, text_of(tensor["different_values"]), text_of(tensor["values"]),
                          tensor["max_abs_difference"].get<double>(),
                          tensor["rms_difference"].get<double>());
    } else if (difference == "shape or type") {
      text += std::format("  {}: {} [{}] -> {} [{}]\n", name, text_of(tensor["a"]["type"]),
                          joined(tensor["a"]["shape"], ","), text_of(tensor["b"]["type"]),
                          joined(tensor["b"]["shape"], ","));
    } else {
      text += std::format("  {}: {}\n", name, difference);
    }
  }
  if (comparison["same"].get<bool>()) return text + "the same content\n";
  return text + std::format("{} fields and {} tensors differ\n", comparison["fields"].size(),
                            comparison["tensors"].size());
}

}  // namespace figurine::inspect
