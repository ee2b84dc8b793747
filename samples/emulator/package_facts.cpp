#include "samples/emulator/package_facts.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <format>

namespace figurine::emulator {

namespace {

using Line = PackageFacts::Line;

std::string precisions_of(const Avatar& avatar) {
  std::string text;
  for (const Precision each : {Precision::kFixedPoint, Precision::kFloat32}) {
    if (avatar.holds(each)) text += (text.empty() ? "" : ", ") + std::string(to_string(each));
  }
  return text;
}

std::string network_text(const Avatar& avatar) {
  if (!avatar.has_network()) return "none";
  const Result<std::vector<ValueShape>> shapes = infer_shapes(avatar.network, false);
  if (!shapes.ok()) return "unsound";
  return std::format("{:.0f} M products",
                     static_cast<double>(count_macs(avatar.network, *shapes)) * 1e-6);
}

// The member's, of a population.
Provenance provenance_of(const samples::LoadedAvatar& avatar) {
  const Package& package = avatar.package->package;
  if (package.kind() != PackageKind::kPopulation) return package.provenance();
  const std::vector<PopulationMember>& members = package.population().members;
  for (size_t m = 0; m < members.size(); ++m) {
    if (members[m].name == avatar.avatar.name) return package.member_provenance(m);
  }
  return package.provenance();
}

void add(std::vector<Line>& lines, const char* label, const std::string& value) {
  if (!value.empty()) lines.emplace_back(label, value);
}

}  // namespace

std::string bytes_text(uint64_t bytes) {
  const auto value = static_cast<double>(bytes);
  if (bytes < 1000) return std::format("{} B", bytes);
  if (bytes < 1000 * 1000) return std::format("{:.0f} kB", value * 1e-3);
  if (bytes < 1000 * 1000 * 1000) return std::format("{:.1f} MB", value * 1e-6);
  return std::format("{:.1f} GB", value * 1e-9);
}

PackageFacts facts_of(const samples::LoadedAvatar& loaded, const samples::LoadedPackage& body) {
  const Avatar& avatar = loaded.avatar;
  PackageFacts facts{.title = std::filesystem::path(loaded.name).filename().string()};
  if (loaded.package) facts.title += ", " + bytes_text(loaded.package->file.bytes().size());
  add(facts.lines, "Gaussians", std::to_string(body.package.body().texel_count()));
  add(facts.lines, "Network", network_text(avatar));
  add(facts.lines, "Arithmetic", precisions_of(avatar));
  add(facts.lines, "Made as", avatar.preset + " on " + avatar.body_name);
  if (!loaded.package) {
    add(facts.lines, "From", "sampled on this device");
    return facts;
  }
  const Provenance provenance = provenance_of(loaded);
  add(facts.lines, "Person", provenance.depicted_person);
  add(facts.lines, "Licence", provenance.licence_name);
  for (const QualityMetric& metric : provenance.quality) {
    std::string name = metric.name;
    std::replace(name.begin(), name.end(), '_', ' ');
    facts.quality.emplace_back(name, std::format("{:.4g}", metric.value));
  }
  return facts;
}

PackageFacts facts_of(const std::string& path, const ports::GaussianCloud& cloud) {
  PackageFacts facts{.title = std::filesystem::path(path).filename().string()};
  add(facts.lines, "Gaussians", std::to_string(cloud.count()));
  add(facts.lines, "Kind", cloud.container);
  add(facts.lines, "Bands", std::format("degree {}", cloud.sh_degree));
  add(facts.lines, "Up",
      std::string(to_string(cloud.up_axis())) + (cloud.up ? "" : " (taken for granted)"));
  if (cloud.left_out > 0) add(facts.lines, "Left out", std::to_string(cloud.left_out));
  return facts;
}

}  // namespace figurine::emulator
