// figurine-train evaluate: how good a trained avatar is (reconstruction), what fixed point
// (quantization) and a population's rounding (population) cost it, and whether the device draws the
// same (parity). What a population is like (members) is in evaluate_members.cpp, what an avatar is
// like from elsewhere (distance) in evaluate_distance.cpp.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <limits>
#include <memory>
#include <nlohmann/json.hpp>

#include "ports/command_line/values.h"
#include "ports/host/files.h"
#include "toolchain/cli/commands.h"
#include "toolchain/cli/report_head.h"
#include "toolchain/cli/threads.h"
#include "toolchain/dataset/picture_file.h"
#include "toolchain/error.h"
#include "toolchain/json_number.h"
#include "toolchain/model/threads.h"
#include "toolchain/pictures/contact_sheet.h"
#include "toolchain/reconstruction/quantization.h"
#include "toolchain/reconstruction/reconstruction.h"
#include "toolchain/reconstruction/requantization.h"
#include "toolchain/train/avatar_file.h"
#include "toolchain/verify/parity.h"

namespace figurine::cli {

namespace {

struct EvaluateArguments {
  train::OpenRunOptions open;
  reconstruction::ReconstructionOptions reconstruction;
  verify::ParityOptions parity;
  reconstruction::QuantizationOptions quantization;
  reconstruction::RequantizationOptions requantization;
  quantize::FineTuneOptions fine_tune;
  bool no_qat = false;
  std::vector<std::string> runs, packages;  // of quantization and population
  std::vector<std::string> beside;          // of the contact sheet
  std::string precision = "f32", sheet, output, package;
};

void print_group(const char* title, const nlohmann::json& group) {
  const auto number = [&](const std::string& key) {
    return group.at(key).is_number() ? group.at(key).get<double>() : NAN;
  };
  for (const std::string prefix : {"", "bust_"}) {
    if (!group.contains(prefix + "images")) continue;
    std::printf(
        "%-22s %6.2f dB  flat %6.2f  head %6.2f  high-pass %.2f, correlation %.2f  filled %.4f  "
        "(%d images)\n",
        prefix.empty() ? title : "    close-ups", number(prefix + "psnr_db"),
        number(prefix + "flat_psnr_db"), number(prefix + "head_psnr_db"),
        number(prefix + "highpass_ratio"), number(prefix + "highpass_correlation"),
        number(prefix + "filled_share"), group.at(prefix + "images").get<int>());
  }
}

void print_parts(const nlohmann::json& parts) {
  if (const nlohmann::json& network = parts.at("network"); !network.is_null()) {
    std::printf("network at %ux%u, %u channels: %u weights (%u bytes in q8)\n",
                network.at("size").get<unsigned>(), network.at("size").get<unsigned>(),
                network.at("channels").get<unsigned>(), network.at("parameters").get<unsigned>(),
                network.at("bytes_q8").get<unsigned>());
  }
  if (const nlohmann::json& statics = parts.at("static"); !statics.is_null()) {
    std::printf("static %s: %u values (%u bytes)\n", statics.at("grids").get<std::string>().c_str(),
                statics.at("values").get<unsigned>(), statics.at("bytes").get<unsigned>());
  }
}

void run_reconstruction(const EvaluateArguments& arguments) {
  if (!arguments.sheet.empty()) dataset::check_picture_name(arguments.sheet);
  train::TrainedAvatar avatar = train::TrainedAvatar::open(arguments.open);
  std::vector<train::TrainedAvatar> beside;
  for (const std::string& run : arguments.beside) {
    beside.push_back(train::TrainedAvatar::open(
        {.run = run, .data = arguments.open.data, .threads = arguments.open.threads}));
  }
  nlohmann::json report = report_head(arguments.open.run, avatar);
  report.update(reconstruction::evaluate_reconstruction(avatar, arguments.reconstruction));
  if (!arguments.sheet.empty()) {
    pictures::Avatars shown;
    for (train::TrainedAvatar& other : beside) shown.push_back(&other);
    shown.push_back(&avatar);
    dataset::write_picture(arguments.sheet, pictures::make_contact_sheet(shown, {}));
    report["contact_sheet"] = arguments.sheet;
  }
  train::write_json(train::RunDirectory{arguments.open.run}.evaluation(), report);
  if (!arguments.output.empty()) train::write_json(arguments.output, report);
  print_parts(report.at("parts"));
  if (report.contains("idle_channels")) {
    std::printf("%u of %u rectified channels off in every pose\n",
                report.at("idle_channels").get<unsigned>(),
                report.at("rectified_channels").get<unsigned>());
  }
  print_group("held-out views", report.at("held_out_views"));
  print_group("held-out poses", report.at("held_out_poses"));
  print_group("  interleaved", report.at("held_out_poses_interleaved"));
  print_group("  block", report.at("held_out_poses_block"));
  print_group("views and poses", report.at("held_out_views_and_poses"));
}

void run_parity(const EvaluateArguments& arguments) {
  train::TrainedAvatar avatar = train::TrainedAvatar::open(arguments.open);
  const train::AvatarFile device = train::open_avatar(arguments.package);
  const verify::ParityReport parity =
      verify::compare_with_runtime(avatar, device.avatar, arguments.parity);
  nlohmann::json report = report_head(arguments.open.run, avatar);
  report["package"] = arguments.package;
  report["precision"] = arguments.precision;
  report["package_hash"] = format_hash(device.file.package.content_hash());
  report["parity_db"] = finite(parity.psnr_db);
  report["worst_parity_db"] = finite(parity.worst_psnr_db);
  report["largest_error"] = finite(parity.largest_error);
  for (const verify::ParityView& view : parity.views) {
    report["views"].push_back({{"frame", view.frame},
                               {"camera", view.camera},
                               {"psnr_db", finite(view.psnr_db)},
                               {"largest_error", finite(view.largest_error)},
                               {"foreground_pixels", view.foreground}});
  }
  if (!arguments.output.empty()) train::write_json(arguments.output, report);
  std::printf(
      "parity with the runtime: %.2f dB over %zu pictures (worst %.2f dB), largest error %.2g\n",
      parity.psnr_db, parity.views.size(), parity.worst_psnr_db, parity.largest_error);
}

void print_row(const nlohmann::json& row) {
  const auto number = [&](const char* key) {
    return row.contains(key) && row.at(key).is_number() ? row.at(key).get<double>() : NAN;
  };
  std::printf("%-24s drop %6.3f dB  to f32 %6.2f  slow motion %6.2f  trembling %6.2f dB\n",
              row.at("name").get<std::string>().c_str(), number("psnr_drop_db"),
              number("psnr_to_f32_db"), number("slow_motion_db"), number("trembling_pose_db"));
}

void run_quantization(const EvaluateArguments& arguments) {
  if (!arguments.packages.empty() && arguments.packages.size() != arguments.runs.size()) {
    throw InputError("--package: one for every --run, in the same order");
  }
  reconstruction::QuantizationOptions options = arguments.quantization;
  if (!arguments.no_qat) {
    options.fine_tune = arguments.fine_tune;
    options.fine_tune->calibration = options.calibration;
    options.fine_tune->threads = arguments.open.threads;
    options.fine_tune->quiet = options.quiet;
  }
  std::vector<nlohmann::json> reports;
  for (size_t i = 0; i < arguments.runs.size(); ++i) {
    train::OpenRunOptions open = arguments.open;
    open.run = arguments.runs[i];
    train::TrainedAvatar avatar = train::TrainedAvatar::open(open);
    reports.push_back(reconstruction::evaluate_quantization(avatar, {open.run}, options));
    if (!arguments.packages.empty())
      reports.back()["package_bytes"] = std::filesystem::file_size(arguments.packages[i]);
  }
  nlohmann::json report = reconstruction::summarise_quantization(reports);
  if (!arguments.packages.empty()) report["package_bytes"] = reports.front().at("package_bytes");
  report["command"] = train::current_command();
  report["commit"] = train::current_commit();
  report["machine"] = train::describe_machine();
  report["date"] = train::utc_now();
  if (!arguments.output.empty()) train::write_json(arguments.output, report);
  for (const nlohmann::json& row : report.at("rows")) print_row(row);
}

void run_population(const EvaluateArguments& arguments) {
  constexpr double kMostLoss_db =
      0.2;  // beyond it, a population is to be packed with --precision f16
  nlohmann::json report{{"command", train::current_command()},
                        {"commit", train::current_commit()},
                        {"machine", train::describe_machine()},
                        {"date", train::utc_now()},
                        {"package", arguments.package}};
  double worst = -std::numeric_limits<double>::infinity();
  for (const std::string& run : arguments.runs) {
    train::OpenRunOptions open = arguments.open;
    open.run = run;
    train::TrainedAvatar avatar = train::TrainedAvatar::open(open);
    const std::string name = std::filesystem::path(avatar.data().directory()).filename().string();
    const train::AvatarFile member = train::open_avatar(arguments.package + "#" + name);
    nlohmann::json row{{"member", name}, {"run", run}};
    row.update(
        reconstruction::evaluate_requantization(avatar, member.avatar, arguments.requantization));
    report["coding"] = to_string(member.file.package.population().coding);
    report["package_bytes"] = member.file.package.size_bytes();
    report["package_hash"] = format_hash(member.file.package.content_hash());
    for (const char* group : {"views", "poses"}) {
      const auto number = [&](const char* key) {
        return row.at(group).at(key).is_number() ? row.at(group).at(key).get<double>() : NAN;
      };
      if (std::isfinite(number("loss_db"))) worst = std::max(worst, number("loss_db"));
      std::printf("%-12s %-6s %6.2f dB, as a member %6.2f dB, loss %6.3f dB\n", name.c_str(), group,
                  number("psnr_db"), number("member_psnr_db"), number("loss_db"));
    }
    report["members"].push_back(std::move(row));
  }
  report["worst_loss_db"] = finite(worst);
  report["most_loss_db"] = kMostLoss_db;
  report["passed"] = worst <= kMostLoss_db && std::isfinite(worst);
  if (!arguments.output.empty()) train::write_json(arguments.output, report);
  std::printf("worst loss %.3f dB: %s %.1f dB\n", worst, worst <= kMostLoss_db ? "within" : "ABOVE",
              kMostLoss_db);
}

void add_run_options(CLI::App* command, const std::shared_ptr<EvaluateArguments>& arguments) {
  command->add_option("--run", arguments->open.run, "Folder of a run")->required();
  command->add_option("--data", arguments->open.data,
                      "Where the data is now (default: where the run found it)");
  command->add_option("--body", arguments->open.body,
                      "Where the body is now (default: where the run found it)");
  add_threads_option(*command, arguments->open.threads, "Default: all cores");
  command->add_option("-o,--output", arguments->output, "Report to write, JSON");
}

}  // namespace

void add_evaluate_command(CLI::App& app) {
  CLI::App* command = app.add_subcommand("evaluate", "Measure trained avatars");
  command->require_subcommand(1);
  auto arguments = std::make_shared<EvaluateArguments>();
  arguments->open.threads = model::default_threads();

  CLI::App* reconstruction =
      command->add_subcommand("reconstruction", "Held-out cameras and poses against the truth");
  add_run_options(reconstruction, arguments);
  reconstruction->add_option("--sheet", arguments->sheet,
                             "Contact sheet to write, .png or .jpg: truth left, prediction right");
  reconstruction->add_option(
      "--beside", arguments->beside,
      "Runs of the same capture whose pictures the sheet shows between truth and prediction");
  reconstruction
      ->add_option("--view-frame-step", arguments->reconstruction.view_frame_step,
                   "Look at every n-th training pose only (default 1: all)")
      ->check(ports::positive());
  reconstruction->callback([arguments] { run_reconstruction(*arguments); });

  CLI::App* quantization = command->add_subcommand(
      "quantization", "Fixed point against float and against the truth, layer by layer");
  quantization->add_option("--run", arguments->runs, "Folder of a run; may be given several times")
      ->required();
  quantization->add_option("--package", arguments->packages,
                           "Its package, for the size; one for every run");
  quantization->add_option(
      "--motion", arguments->quantization.motion,
      "Package whose beginning is slowed down (default: the capture's frames)");
  quantization->add_flag("--no-qat", arguments->no_qat, "Leave the fine-tuned rows out");
  quantization
      ->add_option("--qat-iterations", arguments->fine_tune.iterations,
                   "Of the fine-tune in RUN/qat (default 400)")
      ->check(ports::positive());
  quantization
      ->add_option("--views-per-pose", arguments->quantization.views_per_pose,
                   "Cameras of a held-out pose (default 4)")
      ->check(ports::positive());
  add_threads_option(*quantization, arguments->open.threads, "Default: all cores");
  quantization->add_flag("--quiet", arguments->quantization.quiet, "No progress");
  quantization->add_option("-o,--output", arguments->output, "Report to write, JSON");
  quantization->callback([arguments] { run_quantization(*arguments); });

  CLI::App* population = command->add_subcommand(
      "population", "What a population's rounding costs its members, against the truth");
  population->add_option("--package", arguments->package, "Population package")->required();
  population
      ->add_option(
          "--run", arguments->runs,
          "Run of a member, which is called as its data's folder is; may be given several times")
      ->required();
  population
      ->add_option("--view-frame-step", arguments->requantization.view_frame_step,
                   "Look at every n-th training pose only (default 8)")
      ->check(ports::positive());
  population->add_flag("--quiet", arguments->requantization.quiet, "No progress");
  add_threads_option(*population, arguments->open.threads, "Default: all cores");
  population->add_option("-o,--output", arguments->output, "Report to write, JSON");
  population->callback([arguments] { run_population(*arguments); });

  add_evaluate_distance_command(*command);
  add_evaluate_poses_command(*command);
  add_evaluate_members_command(*command);
  add_evaluate_generation_command(*command);
  add_evaluate_sampling_command(*command);
  add_evaluate_features_command(*command);

  CLI::App* parity = command->add_subcommand(
      "parity", "The runtime's picture against the trainer's, before rounding to 8 bits");
  add_run_options(parity, arguments);
  parity
      ->add_option("--package", arguments->package,
                   "Avatar package made from the run, or PACKAGE#MEMBER of a population")
      ->required();
  parity
      ->add_option("--views", arguments->parity.views, "Held-out pictures to compare (default 12)")
      ->check(ports::positive());
  parity->add_option("--precision", arguments->precision, "Of both (default f32)")
      ->check(ports::one_of({"f32", "q8"}));
  parity->callback([arguments] {
    arguments->parity.precision =
        arguments->precision == "q8" ? Precision::kFixedPoint : Precision::kFloat32;
    arguments->parity.threads = arguments->open.threads;
    run_parity(*arguments);
  });
}

}  // namespace figurine::cli
