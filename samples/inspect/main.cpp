// figurine-inspect: what a package is, what a device needs for it, where it came from; on the
// reader alone. Of a file of Gaussians, what is read of it.
//
// Exit 0 if every package named is sound, 1 if one is not or what was printed is lost (the reason
// on stderr, one line), 2 on wrong usage.
#include <CLI/CLI.hpp>
#include <cstdio>
#include <exception>
#include <string>

#include "ports/gaussians/gaussian_file.h"
#include "ports/host/files.h"
#include "ports/host/process.h"
#include "samples/inspect/describe.h"
#include "samples/inspect/print.h"

namespace {

using figurine::Package;
using figurine::Result;
using figurine::Status;
using figurine::inspect::Json;
using figurine::ports::GaussianCloud;
using figurine::ports::MappedFile;

struct Options {
  std::string path;
  std::string other_path;
  bool json = false;
  bool tensors = false;
};

struct OpenedFile {
  MappedFile file;
  Package package;
};

Result<OpenedFile> open_file(const std::string& path) {
  Result<MappedFile> file = MappedFile::open(path);
  if (!file.ok()) return file.status();
  Result<Package> package = Package::open(file->bytes(), path);
  if (!package.ok()) return package.status();
  return OpenedFile{std::move(file).value(), std::move(package).value()};
}

void print(const std::string& text) { std::fwrite(text.data(), 1, text.size(), stdout); }

// Paths come from the command line and need not be UTF-8.
void print(const Json& document) {
  print(document.dump(2, ' ', false, Json::error_handler_t::replace) + "\n");
}

Status inspect_gaussians(const Options& options) {
  if (options.tensors || !options.other_path.empty()) {
    return Status(figurine::StatusCode::kInvalidArgument,
                  options.path + ": --tensors and --diff are for packages");
  }
  const Result<MappedFile> file = MappedFile::open(options.path);
  if (!file.ok()) return file.status();
  const Result<GaussianCloud> cloud = figurine::ports::read_gaussians(file->bytes(), options.path);
  if (!cloud.ok()) return cloud.status();
  if (options.json) {
    print(Json{{"file", options.path},
               {"kind", "gaussians"},
               {"container", cloud->container},
               {"size_bytes", file->bytes().size()},
               {"gaussians", cloud->count()},
               {"sh_degree", cloud->sh_degree},
               {"left_out", cloud->left_out},
               {"left_out_why", cloud->left_out_why},
               {"origin", cloud->origin_m},
               {"up", to_string(cloud->up_axis())},
               {"up_stated", cloud->up.has_value()},
               {"antialiased", cloud->antialiased},
               {"remarks", cloud->remarks}});
  } else {
    print(options.path + ": " + figurine::ports::describe(*cloud) + "\n");
  }
  return {};
}

Status inspect(const Options& options) {
  if (figurine::ports::is_gaussian_name(options.path)) return inspect_gaussians(options);
  const Result<OpenedFile> opened = open_file(options.path);
  if (!opened.ok()) return opened.status();
  const std::span<const std::byte> bytes = opened->file.bytes();
  if (!options.other_path.empty()) {
    const Result<OpenedFile> other = open_file(options.other_path);
    if (!other.ok()) return other.status();
    const Json comparison =
        figurine::inspect::compare(opened->package, bytes, options.path, other->package,
                                   other->file.bytes(), options.other_path);
    options.json ? print(comparison) : print(figurine::inspect::print_comparison(comparison));
    return {};
  }
  Json document = figurine::inspect::describe(opened->package, options.path);
  if (options.tensors)
    document["tensors"] = figurine::inspect::describe_tensors(opened->package, bytes);
  if (options.json) {
    print(document);
  } else {
    print(figurine::inspect::print_package(document));
    if (options.tensors) {
      print("\n" + figurine::inspect::print_tensors(document["tensors"]));
      if (document.contains("avatar"))
        print(figurine::inspect::print_quantisation(document["avatar"]["fixed_point"]));
      if (document.contains("sampler"))
        print(figurine::inspect::print_quantisation(document["sampler"]["quantisation"]));
    }
  }
  return {};
}

int run(int argc, char** argv) {
  CLI::App app{
      "figurine-inspect: prints what a .fgn package is, what it needs and where it came from; of a "
      "file of Gaussians, what is read of it"};
  app.set_version_flag("--version", "figurine-inspect " FIGURINE_VERSION);
  Options options;
  app.add_option("package", options.path, "the package, or .ply, .splat, .spz")
      ->required()
      ->type_name("PKG");
  app.add_flag("--json", options.json, "print JSON (documented in docs/package.md)");
  CLI::Option* tensors = app.add_flag(
      "--tensors", options.tensors,
      "list every array: type, shape, bytes, range, checksum; and the quantisation of every layer");
  app.add_option("--diff", options.other_path,
                 "compare with this package: fields, and the largest difference of each array")
      ->type_name("OTHER")
      ->excludes(tensors);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }
  try {
    const Status status = inspect(options);
    if (status.ok()) return 0;
    std::fprintf(stderr, "figurine-inspect: %s\n", status.message().c_str());
    return 1;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "figurine-inspect: internal error: %s\n", error.what());
    return 3;
  }
}

}  // namespace

int main(int argc, char** argv) {
  figurine::ports::prepare_process("figurine-inspect");
  const int code = run(argc, argv);
  const Status printed = figurine::ports::flush_standard_output();
  if (code != 0 || printed.ok()) return code;
  std::fprintf(stderr, "figurine-inspect: %s\n", printed.message().c_str());
  return 1;
}
