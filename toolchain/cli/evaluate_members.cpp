// figurine-train evaluate members: what a population is like, from its package alone.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#include "ports/command_line/values.h"
#include "ports/host/files.h"
#include "toolchain/cli/commands.h"
#include "toolchain/cli/threads.h"
#include "toolchain/error.h"
#include "toolchain/json_number.h"
#include "toolchain/measure/body_parts.h"
#include "toolchain/members/member_sheets.h"
#include "toolchain/members/members.h"
#include "toolchain/model/threads.h"
#include "toolchain/train/package_file.h"
#include "toolchain/train/population_file.h"
#include "toolchain/train/run_directory.h"

namespace figurine::cli {

namespace {

constexpr size_t kMaxSheetBytes = 1'500'000;

struct MembersArguments {
  std::string population, body, motion, output;
  std::string wall, bust_wall, interpolation, part_mixtures, worst_sheet;
  size_t worst = 10;
  members::MembersOptions options;
  uint32_t threads = 1;
  bool quiet = false;
};

void check_name(const char* option, const std::string& path) {
  const std::string extension = std::filesystem::path(path).extension().string();
  if (!path.empty() && extension != ".jpg" && extension != ".jpeg")
    throw InputError(std::string(option) + ": '" + path + "' must end in .jpg");
}

void save_sheet(const std::string& path, const ports::ImageU8& sheet) {
  throw_if_error(ports::write_file_atomically(path, members::encode_sheet(sheet, kMaxSheetBytes)),
                 "cannot save");
}

void print_distances(const nlohmann::json& distances) {
  for (const auto& [title, key] :
       {std::pair{"weights", "weights"}, std::pair{"pictures", "pictures"}}) {
    std::printf("nearest training member in %-9s", title);
    for (const char* split : {"train", "validation", "test"}) {
      const nlohmann::json& quantiles =
          distances.at(key).at(std::string(split) + "_nearest_quantiles");
      if (!quantiles.is_null()) std::printf("  %s %.2f", split, number(quantiles.at("50")));
    }
    std::printf("  (%s, medians)\n", distances.at(key).at("unit").get<std::string>().c_str());
  }
  std::printf("weights against pictures: correlation %.2f, of ranks %.2f\n",
              number(distances.at("correlation").at("pearson")),
              number(distances.at("correlation").at("spearman")));
}

void print_spectrum(const nlohmann::json& spectrum) {
  const auto print = [](const std::string& name, const nlohmann::json& row) {
    const nlohmann::json& needed = row.at("directions_for");
    std::printf(
        "  %-10s %8d values  %4d directions: 50 %% in %d, 90 %% in %d, 99 %% in %d; participation "
        "ratio %.1f\n",
        name.c_str(), row.at("entries").get<int>(), row.at("directions").get<int>(),
        needed.at("50").get<int>(), needed.at("90").get<int>(), needed.at("99").get<int>(),
        number(row.at("participation_ratio")));
  };
  std::printf("spectrum of the training members\n");
  print("whole", spectrum.at("whole"));
  for (const auto& [kind, row] : spectrum.at("by_kind").items()) print(kind, row);
  for (const nlohmann::json& token : spectrum.at("tokens"))
    print(token.at("name").get<std::string>(), token);
}

void print_span(const nlohmann::json& span) {
  if (span.is_null()) {
    std::printf("no held-out members: the span is not measured\n");
    return;
  }
  const auto print = [](const std::string& name, const nlohmann::json& row) {
    std::printf("  %-22s %6.2f dB (worst %6.2f)  variance kept %5.1f %%\n", name.c_str(),
                number(row.at("span_db")), number(row.at("worst_db")),
                100 * number(row.at("variance_kept")));
  };
  std::printf("held-out members replaced, against themselves\n");
  for (const auto& [key, row] : span.at("baselines").items()) print(key, row);
  const auto print_ranks = [&](const std::string& name, const nlohmann::json& rows) {
    for (const nlohmann::json& row : rows)
      print(name + ", rank " + std::to_string(row.at("rank").get<int>()), row);
  };
  for (const char* basis : {"per_layer", "whole"}) print_ranks(basis, span.at(basis));
  for (const auto& [kind, rows] : span.at("by_kind").items()) print_ranks(kind + " alone", rows);
}

void print_part_mixtures(const nlohmann::json& mixtures) {
  if (mixtures.is_null()) return;
  for (const nlohmann::json& pair : mixtures.at("pairs")) {
    std::printf("%s with parts of %s (%s): high-pass energy over the mean of the two's\n",
                pair.at("a").get<std::string>().c_str(), pair.at("b").get<std::string>().c_str(),
                pair.at("why").get<std::string>().c_str());
    for (const nlohmann::json& row : pair.at("rows")) {
      const nlohmann::json& nearest = row.at("nearest").at("pictures");
      std::printf("  %-10s %5.2f  foreground %5.2f  nearest in pictures %s\n",
                  row.at("of").get<std::string>().c_str(), number(row.at("highpass_ratio")),
                  number(row.at("foreground_ratio")),
                  nearest.at("member").get<std::string>().c_str());
    }
  }
}

void print_members(const nlohmann::json& report) {
  for (const auto& [name, summary] : report.at("quality").at("all").items()) {
    std::printf("%-16s mean %7.3f  worst %7.3f  best %7.3f  deviation %.3f\n", name.c_str(),
                number(summary.at("mean")), number(summary.at("worst")), number(summary.at("best")),
                number(summary.at("standard_deviation")));
  }
  print_distances(report.at("distances"));
  print_spectrum(report.at("spectrum"));
  print_span(report.at("span"));
  for (const nlohmann::json& pair : report.at("interpolation").at("pairs")) {
    std::printf("between %s and %s (%s): high-pass energy of the middle %.2f of the ends'\n",
                pair.at("a").get<std::string>().c_str(), pair.at("b").get<std::string>().c_str(),
                pair.at("why").get<std::string>().c_str(),
                number(pair.at("middle_highpass_ratio")));
  }
  print_part_mixtures(report.at("part_mixtures"));
}

void run_members(const MembersArguments& arguments) {
  check_name("--wall", arguments.wall);
  check_name("--bust-wall", arguments.bust_wall);
  check_name("--interpolation", arguments.interpolation);
  check_name("--part-mixtures", arguments.part_mixtures);
  check_name("--worst-sheet", arguments.worst_sheet);
  const train::PackageFile population = train::open_population(arguments.population);
  const train::PackageFile body = train::open_package(arguments.body, PackageKind::kBody);
  std::optional<train::PackageFile> motion;
  if (!arguments.motion.empty()) {
    motion.emplace(train::open_package(arguments.motion, PackageKind::kMotion));
    throw_if_error(check_motion_fits_body(motion->package.motion(), body.package.body()),
                   arguments.motion);
  }
  // What cannot be drawn is said before everybody is.
  const std::string obstacle =
      measure::part_mixture_obstacle(population.package.population(), body.package.body());
  if (!arguments.part_mixtures.empty() && !obstacle.empty())
    throw InputError("--part-mixtures: " + obstacle);
  if (!arguments.bust_wall.empty() && measure::bust_texels(body.package.body()).empty())
    throw InputError("--bust-wall: body '" + body.package.body().name +
                     "': has no texel that a joint called head, neck or collar moves most");
  const members::MemberSet set(population.package, body.package,
                               {.motion = motion ? &motion->package.motion() : nullptr,
                                .threads = arguments.threads,
                                .quiet = arguments.quiet});
  const members::MemberDistances distances(set);
  const std::vector<members::MixedPair> pairs = members::choose_pairs(distances);
  nlohmann::json report{{"command", train::current_command()},
                        {"commit", train::current_commit()},
                        {"machine", train::describe_machine()},
                        {"date", train::utc_now()},
                        {"package", arguments.population},
                        {"package_hash", format_hash(population.package.content_hash())}};
  std::optional<measure::PartExchange> parts;
  if (obstacle.empty()) parts.emplace(population.package.population(), body.package.body());
  report.update(members::evaluate_members(set, distances, pairs, parts ? &*parts : nullptr,
                                          arguments.options));
  // Pictures are drawn before anything is written: what is interrupted leaves nothing.
  std::optional<ports::ImageU8> wall, busts, strip, exchanged, worst;
  const std::vector<size_t> worst_members =
      members::worst_members(population.package.population(), arguments.worst);
  if (!arguments.wall.empty()) wall = members::draw_wall(set);
  if (!arguments.bust_wall.empty()) busts = members::draw_bust_wall(set);
  if (!arguments.interpolation.empty()) strip = members::draw_mixtures(set, pairs);
  if (!arguments.part_mixtures.empty()) exchanged = members::draw_part_mixtures(set, *parts, pairs);
  if (!arguments.worst_sheet.empty()) {
    if (worst_members.empty())
      throw InputError(arguments.population +
                       ": --worst-sheet: no member has the quality psnr_pose_db");
    worst = members::draw_close(set, worst_members);
  }
  if (wall) save_sheet(arguments.wall, *wall);
  if (busts) save_sheet(arguments.bust_wall, *busts);
  if (strip) save_sheet(arguments.interpolation, *strip);
  if (exchanged) save_sheet(arguments.part_mixtures, *exchanged);
  if (worst) save_sheet(arguments.worst_sheet, *worst);
  train::write_json(arguments.output, report);
  print_members(report);
}

}  // namespace

void add_evaluate_members_command(CLI::App& evaluate) {
  auto arguments = std::make_shared<MembersArguments>();
  arguments->threads = model::default_threads();
  CLI::App* command = evaluate.add_subcommand(
      "members", "What a population is like: quality, distances, spectrum, span, mixtures");
  command->add_option("POPULATION", arguments->population, "Population package")->required();
  command->add_option("--body", arguments->body, "Body package of its members")->required();
  command->add_option("--motion", arguments->motion,
                      "Motion package whose poses are drawn (default: golden poses of members)");
  command->add_option("-o,--output", arguments->output, "Report to write, JSON")->required();
  command->add_option("--wall", arguments->wall, "Picture of all members to write, JPEG");
  command->add_option("--bust-wall", arguments->bust_wall,
                      "Picture of all members' heads and shoulders to write, JPEG");
  command->add_option("--interpolation", arguments->interpolation,
                      "Picture of mixtures of two members to write, JPEG");
  command->add_option("--part-mixtures", arguments->part_mixtures,
                      "Picture of members with a part of another to write (static values), JPEG");
  command
      ->add_option("--worst", arguments->worst,
                   "Members of --worst-sheet, by PSNR on held-out poses (default 10)")
      ->check(ports::between(1, 100));
  command->add_option("--worst-sheet", arguments->worst_sheet,
                      "Picture of the worst members to write, JPEG");
  command
      ->add_option(
          "--ranks", arguments->options.ranks,
          "Of the bases that held-out members are projected onto, A,B (default: powers of two)")
      ->delimiter(',')
      ->check(ports::positive());
  add_threads_option(*command, arguments->threads, "Default: all cores");
  command->add_flag("--quiet", arguments->quiet, "No progress");
  command->callback([arguments] { run_members(*arguments); });
}

}  // namespace figurine::cli
