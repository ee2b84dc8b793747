// figurine-train basis: what directions many people's networks differ by from a shared one.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <memory>

#include "ports/command_line/values.h"
#include "ports/host/process.h"
#include "toolchain/cli/commands.h"
#include "toolchain/train/kernel_basis_file.h"

namespace figurine::cli {

namespace {

struct BasisArguments {
  std::string shared, path;
  std::vector<std::string> runs;
  uint32_t rank = 8;
};

}  // namespace

void add_basis_command(CLI::App& app) {
  auto arguments = std::make_shared<BasisArguments>();
  CLI::App* command = app.add_subcommand(
      "basis",
      "Find the directions that people's kernels differ by from a shared network, for "
      "avatar --network-adapter basis");
  command
      ->add_option("--shared", arguments->shared,
                   "Run whose network all of the others began with (avatar --init)")
      ->required();
  command->add_option("RUN", arguments->runs, "Runs of people, or weights files")->required();
  command->add_option("--rank", arguments->rank, "Directions of a kernel, at most (default 8)")
      ->check(ports::between(1, 256));
  command->add_option("-o,--output", arguments->path, "File (.safetensors)")->required();
  command->callback([arguments] {
    const train::KernelBasisReport report = train::make_kernel_basis(
        arguments->shared, arguments->runs, arguments->rank, arguments->path);
    double sum = 0, least = 1;
    for (const double share : report.energy) sum += share, least = std::min(least, share);
    ports::sayf(
        "%s: %zu people; %u directions a kernel hold %.1f %% of the differences in the "
        "mean, %.1f %% in the worst layer",
        arguments->path.c_str(), report.people, arguments->rank,
        100 * sum / static_cast<double>(report.energy.size()), 100 * least);
  });
}

}  // namespace figurine::cli
