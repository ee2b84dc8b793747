#include "samples/inspect/page.h"

#include <algorithm>
#include <filesystem>
#include <format>
#include <span>
#include <system_error>

#include "ports/host/files.h"
#include "samples/common/html_page.h"

namespace figurine::inspect {

namespace {

using samples::escape_html;
using samples::html_fact;

constexpr const char* kStyle = R"css(
.bar { width: 34%; min-width: 90px; }
.bar i { display: block; height: 10px; min-width: 1px; border-radius: 2px;
         background: var(--blue); }
.left td, .left th { text-align: left; }
td { overflow-wrap: anywhere; }
ul { padding-left: 20px; max-width: 78ch; }
li { overflow-wrap: anywhere; }
details { margin: 14px 0; }
summary { cursor: pointer; color: var(--blue); }
nav { margin: 14px 0; display: flex; flex-wrap: wrap; gap: 4px 18px; }
nav a { color: var(--blue); }
.pictures { grid-template-columns: repeat(auto-fill, minmax(150px, 1fr)); }
)css";

std::string text_of(const Json& value) {
  return value.is_string() ? value.get<std::string>()
                           : value.dump(-1, ' ', false, Json::error_handler_t::replace);
}

std::string in_bytes(uint64_t bytes) {
  if (bytes < 100'000) return std::format("{} bytes", bytes);
  const auto value = static_cast<double>(bytes);
  return bytes < 1'000'000'000 ? std::format("{} bytes ({:.2f} MB)", bytes, value / 1e6)
                               : std::format("{} bytes ({:.2f} GB)", bytes, value / 1e9);
}

std::string declared(const Json& value, const std::string& text) {
  return value == 0 ? "not declared" : text;
}

// A table: texts in, escaped here.
class Table {
 public:
  explicit Table(const std::vector<std::string>& heads, bool left = false) {
    html_ = std::string("<div class=\"wide\"><table") + (left ? " class=\"left\"" : "") + "><tr>";
    for (const std::string& head : heads) html_ += "<th>" + escape_html(head) + "</th>";
    html_ += "</tr>\n";
  }
  void row(const std::vector<std::string>& cells) {
    html_ += "<tr>";
    for (const std::string& cell : cells) html_ += "<td>" + escape_html(cell) + "</td>";
    html_ += "</tr>\n";
  }
  // With a bar of this share behind the cells.
  void row(const std::vector<std::string>& cells, double share) {
    html_ += "<tr>";
    for (const std::string& cell : cells) html_ += "<td>" + escape_html(cell) + "</td>";
    html_ += std::format("<td class=\"bar\"><i style=\"width:{:.1f}%\"></i></td></tr>\n",
                         100 * std::clamp(share, 0.0, 1.0));
  }
  std::string html() const { return html_ + "</table></div>\n"; }

 private:
  std::string html_;
};

// The page's sections, each with an entry in front.
class Page {
 public:
  void section(const std::string& title, const std::string& html) {
    if (html.empty()) return;
    const std::string id = std::format("s{}", ++count_);
    contents_ += "<a href=\"#" + id + "\">" + escape_html(title) + "</a>\n";
    body_ += "<h2 id=\"" + id + "\">" + escape_html(title) + "</h2>\n" + html;
  }
  std::string html(const std::string& head) const {
    return head + "<nav>\n" + contents_ + "</nav>\n" + body_;
  }

 private:
  int count_ = 0;
  std::string contents_, body_;
};

std::string folded(const std::string& summary, const std::string& html) {
  return "<details><summary>" + escape_html(summary) + "</summary>\n" + html + "</details>\n";
}

std::string paragraph(const std::string& text) { return "<p>" + escape_html(text) + "</p>\n"; }

std::string facts(const std::vector<std::pair<std::string, std::string>>& list) {
  std::string html = "<dl class=\"facts\">\n";
  for (const auto& [name, value] : list) html += html_fact(name, value);
  return html + "</dl>\n";
}

std::string head_of(const Json& document) {
  const Json& budget = document["budget"];
  const std::string name = text_of(document["name"]);
  return "<h1>" + escape_html(name.empty() ? text_of(document["file"]) : name) +
         "</h1>\n<p class=\"soft\">" +
         escape_html("A package of kind " + text_of(document["kind"]) + ", " +
                     text_of(document["file"])) +
         "</p>\n" +
         facts({{"Size", in_bytes(document["size_bytes"].get<uint64_t>())},
                {"Memory on the device",
                 declared(budget["peak_memory_bytes"],
                          in_bytes(budget["peak_memory_bytes"].get<uint64_t>()))},
                {"Multiply-accumulates a frame",
                 declared(budget["macs_per_frame"], text_of(budget["macs_per_frame"]))},
                {"Gaussians", declared(budget["gaussians"], text_of(budget["gaussians"]))},
                {"Made by", text_of(document["provenance"]["tool"])},
                {"Content hash", text_of(document["content_hash"])}});
}

std::string parts_of(const Json& document) {
  const auto whole = document["size_bytes"].get<double>();
  Table table({"part", "bytes", "share", ""});
  for (const auto& [name, bytes] : document["parts"].items()) {
    const double share = bytes.get<double>() / whole;
    table.row({name, text_of(bytes), std::format("{:.1f} %", 100 * share)}, share);
  }
  return table.html();
}

std::string quality_of(const Json& provenance) {
  if (provenance["quality"].empty()) return "";
  Table table({"figure", "value"});
  for (const auto& [name, value] : provenance["quality"].items()) table.row({name, text_of(value)});
  return table.html();
}

std::string list_of(const Json& list) {
  std::string html = "<ul>\n";
  for (const Json& entry : list) html += "<li>" + escape_html(text_of(entry)) + "</li>\n";
  return html + "</ul>\n";
}

std::string provenance_of(const Json& provenance) {
  std::string html;
  if (!text_of(provenance["created"]).empty())
    html += paragraph("Made " + text_of(provenance["created"]) + ".");
  if (!provenance["sources"].empty()) html += paragraph("From:") + list_of(provenance["sources"]);
  if (!provenance["settings"].empty()) {
    Table table({"setting", "value"}, true);
    for (const Json& setting : provenance["settings"])
      table.row({text_of(setting["key"]), text_of(setting["value"])});
    html += table.html();
  }
  return html.empty() ? paragraph("The package says nothing of where it came from.") : html;
}

// Addresses are shown, not linked: where they lead is a stranger's to say.
std::string licence_of(const Json& provenance) {
  std::vector<std::pair<std::string, std::string>> list;
  const auto add = [&](const char* name, const char* key) {
    const std::string value = text_of(provenance[key]);
    if (!value.empty()) list.emplace_back(name, value);
  };
  add("Licence", "licence_name");
  add("Its text", "licence_url");
  std::string authors;
  for (const Json& author : provenance["authors"])
    authors += (authors.empty() ? "" : ", ") + text_of(author);
  if (!authors.empty()) list.emplace_back("Authors", authors);
  add("Who may perform with it", "avatar_permission");
  add("Commercial use", "commercial_usage");
  add("Depicted person", "depicted_person");
  return list.empty() ? paragraph("The package states no licence.") : facts(list);
}

std::string network_of(const Json& network) {
  if (network.is_null()) return "";
  Table table({"layer", "from", "size", "channels"}, true);
  size_t number = 0;
  for (const Json& layer : network["layers"]) {
    const std::string size = text_of(layer["size"]);
    table.row({std::format("{} {}", ++number, text_of(layer["op"])), text_of(layer["inputs"]),
               size + " x " + size, text_of(layer["channels"])});
  }
  return facts({{"Input", std::format("{0} x {0} x {1}", text_of(network["input"]["size"]),
                                      text_of(network["input"]["channels"]))},
                {"Parameters", text_of(network["parameters"])},
                {"Multiply-accumulates", text_of(network["macs"])}}) +
         folded(std::format("{} layers", network["layers"].size()), table.html());
}

// Of an avatar's network in fixed point, or of what a sampler's networks will have.
std::string quantisation_of(const Json& fixed) {
  if (fixed.is_null()) return "";
  Table table({"layer", "bytes", "scale of weights", "scale of results", "zero point"}, true);
  size_t number = 0;
  for (const Json& layer : fixed["layers"]) {
    const auto field = [&](const char* key) {
      return layer.contains(key) && !layer[key].is_null() ? text_of(layer[key]) : std::string();
    };
    std::string weights;
    if (layer.contains("weight_scale"))
      weights =
          text_of(layer["weight_scale"]["min"]) + " to " + text_of(layer["weight_scale"]["max"]);
    table.row({std::format("{} {}", ++number, text_of(layer["op"])), field("bytes"), weights,
               field("scale"), field("zero_point")});
  }
  std::vector<std::pair<std::string, std::string>> list;
  if (fixed.contains("bytes"))
    list.emplace_back("Weights, scales, biases", in_bytes(fixed["bytes"].get<uint64_t>()));
  list.emplace_back("A step of the input", text_of(fixed["input_scale"]));
  return facts(list) + folded("Layer by layer", table.html());
}

std::string static_part_of(const Json& part) {
  if (part.is_null()) return "";
  Table table({"channels", "grid", "cells", "bytes"});
  for (const Json& group : part["groups"]) {
    const auto first = group["first_channel"].get<uint64_t>();
    table.row({std::format("{} to {}", first, first + group["channels"].get<uint64_t>() - 1),
               text_of(group["grid_size"]) + " x " + text_of(group["grid_size"]),
               text_of(group["cells"]), text_of(group["bytes"])});
  }
  return table.html();
}

std::vector<std::pair<std::string, std::string>> kind_facts(const Json& kind) {
  return {{"Body", text_of(kind["body"]["name"])},
          {"Body's hash", text_of(kind["body"]["hash"])},
          {"Preset", text_of(kind["preset"])},
          {"Template", text_of(kind["template"])},
          {"Map", text_of(kind["uv_size"]) + " texels a side"},
          {"Antialiased", kind["antialiased"].get<bool>() ? "yes" : "no"}};
}

void add_avatar(Page& page, const Json& avatar) {
  auto list = kind_facts(avatar);
  std::string precisions;
  for (const Json& precision : avatar["precisions"])
    precisions += (precisions.empty() ? "" : ", ") + text_of(precision);
  list.emplace_back("Arithmetic", precisions);
  list.emplace_back("Shape coefficients", std::to_string(avatar["shape"].size()));
  list.emplace_back("Spherical harmonics", "degree " + text_of(avatar["decoding"]["sh_degree"]));
  page.section("Avatar", facts(list));
  page.section("Network", network_of(avatar["network"]));
  page.section("Quantisation", quantisation_of(avatar["fixed_point"]));
  page.section("Static part", static_part_of(avatar["static_part"]));
}

void add_population(Page& page, const Json& population) {
  auto list = kind_facts(population);
  const Json& members = population["members"];
  list.emplace_back("Members", std::to_string(members.size()));
  for (const char* split : {"train", "validation", "test"}) {
    const auto count = std::count_if(members.begin(), members.end(),
                                     [&](const Json& member) { return member["split"] == split; });
    list.emplace_back(std::string("Of them ") + split, std::to_string(count));
  }
  list.emplace_back("Differences", population["coding"] == "q8"
                                       ? "int8, one scale an output channel, entropy-coded"
                                       : "16-bit floats");
  page.section("Population", facts(list));
  std::vector<std::string> heads = {"member", "split", "bytes"}, names;
  for (const Json& name : population["quality_names"]) names.push_back(text_of(name));
  heads.insert(heads.end(), names.begin(), names.end());
  Table table(heads);
  for (const Json& member : members) {
    std::vector<std::string> cells = {
        "#" + text_of(member["number"]) + " " + text_of(member["name"]), text_of(member["split"]),
        text_of(member["difference_bytes"])};
    const Json& quality = member["provenance"]["quality"];
    for (const std::string& name : names)
      cells.push_back(quality.contains(name) ? std::format("{:.2f}", quality[name].get<double>())
                                             : "");
    table.row(cells);
  }
  page.section("Quality of the members",
               folded(std::format("{} members", members.size()), table.html()));
  page.section("Network", network_of(population["network"]));
  page.section("Static part", static_part_of(population["static_part"]));
}

void add_sampler(Page& page, const Json& sampler) {
  auto list = kind_facts(sampler);
  const Json &space = sampler["space"], &denoiser = sampler["denoiser"];
  list.emplace_back("Sampled values", text_of(space["values"]) + " on " +
                                          text_of(space["directions"]) + " directions");
  list.emplace_back("Denoiser",
                    std::format("d_model {}, {} blocks, {} heads, feed-forward {}",
                                text_of(denoiser["d_model"]), text_of(denoiser["blocks"]),
                                text_of(denoiser["heads"]), text_of(denoiser["feed_forward"])));
  list.emplace_back("Its parameters", text_of(denoiser["parameters"]));
  list.emplace_back("Solver",
                    text_of(sampler["steps"]) + " steps of " + text_of(sampler["method"]));
  list.emplace_back("Learnt from", "population " + text_of(sampler["population_hash"]));
  page.section("Sampler", facts(list));
  if (!sampler["golden_seeds"].empty()) {
    Table table({"golden seed", "steps", "solver", "hash of the weights"}, true);
    for (const Json& golden : sampler["golden_seeds"])
      table.row({text_of(golden["seed"]), text_of(golden["steps"]), text_of(golden["method"]),
                 text_of(golden["hash"])});
    page.section("Golden seeds", table.html());
  }
  Table tokens({"token", "values", "rank"});
  for (const Json& token : space["tokens"])
    tokens.row({text_of(token["name"]), text_of(token["values"]), text_of(token["rank"])});
  page.section("What is sampled",
               folded(std::format("{} tokens", space["tokens"].size()), tokens.html()));
  page.section("Network", network_of(sampler["network"]));
  page.section("Quantisation", quantisation_of(sampler["quantisation"]));
}

// The evaluation that a sampler carries: novelty, coverage, near copies.
std::string audit_of(const Json& report) {
  constexpr size_t kMost = 400;
  if (report.is_null()) return paragraph("The package carries no evaluation.");
  if (!report.is_structured()) return paragraph(text_of(report));
  const Json leaves = report.flatten();
  Table table({"figure", "value"}, true);
  size_t shown = 0;
  for (const auto& [pointer, value] : leaves.items()) {
    if (shown++ < kMost) table.row({pointer, text_of(value)});
  }
  std::string html =
      folded(std::format("{} figures of the evaluation", leaves.size()), table.html());
  if (leaves.size() > kMost)
    html += paragraph(std::format("The first {}; all of them: --json.", kMost));
  return html;
}

void add_body(Page& page, const Json& body) {
  const Json &low = body["rest_extent_m"]["min"], &high = body["rest_extent_m"]["max"];
  std::vector<std::pair<std::string, std::string>> list = {
      {"Map", text_of(body["uv_size"]) + " texels a side"},
      {"Covered texels", text_of(body["covered_texels"])},
      {"Border texels", text_of(body["border_texels"])},
      {"Shape coefficients", text_of(body["shape_coefficients"])},
      {"Joints", std::to_string(body["joints"].size())}};
  for (const auto& [axis, k] :
       {std::pair("Width (x)", 0), std::pair("Height (y)", 1), std::pair("Depth (z)", 2)})
    list.emplace_back(axis, text_of(low[k]) + " to " + text_of(high[k]) + " m");
  page.section("Body", facts(list));
  Table table({"joint", "parent", "at rest, m"}, true);
  size_t number = 0;
  for (const Json& joint : body["joints"]) {
    const auto parent = joint["parent"].get<int64_t>();
    table.row({std::format("{} {}", number++, text_of(joint["name"])),
               parent < 0 ? "none" : text_of(body["joints"][static_cast<size_t>(parent)]["name"]),
               text_of(joint["rest_position_m"])});
  }
  page.section("Joints", folded(std::format("{} joints", body["joints"].size()), table.html()));
}

void add_motion(Page& page, const Json& motion) {
  std::string joints;
  for (const Json& joint : motion["joints"])
    joints += (joints.empty() ? "" : ", ") + text_of(joint);
  page.section("Motion", facts({{"Frames", text_of(motion["frames"])},
                                {"Frames a second", text_of(motion["frames_per_second"])},
                                {"Seconds", text_of(motion["seconds"])},
                                {"Joints", std::to_string(motion["joints"].size())}}) +
                             folded("Their names", paragraph(joints)));
}

// Every field by its place in the document.
std::string fields_of(const Json& document) {
  const Json leaves = document.flatten();
  Table table({"field", "value"}, true);
  size_t shown = 0;
  for (const auto& [pointer, value] : leaves.items()) {
    if (shown++ < kMostFields) table.row({pointer, text_of(value)});
  }
  std::string html = folded(std::format("{} fields", leaves.size()), table.html());
  if (leaves.size() > kMostFields)
    html += paragraph(std::format("The first {}; all of them: --json.", kMostFields));
  return html;
}

std::string pictures_of(const PictureSection& section) {
  std::string html = section.words.empty() ? "" : paragraph(section.words);
  if (section.pictures.empty()) return html;
  html += "<div class=\"pictures\">\n";
  for (const Picture& picture : section.pictures)
    html += samples::html_figure(picture.png, picture.caption);
  return html + "</div>\n";
}

}  // namespace

std::string page_html(const Json& document, const std::vector<PictureSection>& pictures) {
  Page page;
  for (const PictureSection& section : pictures) page.section(section.title, pictures_of(section));
  page.section("Size by part", parts_of(document));
  page.section("Quality", quality_of(document["provenance"]));
  if (document.contains("avatar")) add_avatar(page, document["avatar"]);
  if (document.contains("population")) add_population(page, document["population"]);
  if (document.contains("sampler")) {
    add_sampler(page, document["sampler"]);
    page.section("Audit", audit_of(document["sampler"]["report"]));
  }
  if (document.contains("body")) add_body(page, document["body"]);
  if (document.contains("motion")) add_motion(page, document["motion"]);
  page.section("Where it came from", provenance_of(document["provenance"]));
  page.section("Licence and consent", licence_of(document["provenance"]));
  page.section("Every field", fields_of(document));
  const std::string name = text_of(document["name"]);
  return samples::html_page(
      (name.empty() ? text_of(document["file"]) : name) + ": figurine package",
      page.html(head_of(document)), kStyle);
}

Status write_page(const std::string& folder, const std::string& html) {
  std::error_code error;
  const bool made = std::filesystem::create_directories(folder, error);
  if (error) return Status(StatusCode::kIo, folder + ": cannot be made: " + error.message());
  const Status status =
      ports::write_file_atomically(folder + "/index.html", std::as_bytes(std::span(html)));
  if (!status.ok() && made) std::filesystem::remove(folder, error);
  return status;
}

}  // namespace figurine::inspect
