// figurine-inspect: what a package is, what a device needs for it, where it came from; on the
// reader alone, but for the pictures of --html. Of a file of Gaussians, what is read of it.
//
// Exit 0 if every package named is sound, 1 if one is not; as all programs else
// (docs/command_line.md).
#include <CLI/CLI.hpp>
#include <cstdio>
#include <optional>
#include <span>
#include <string>

#include "ports/command_line/command_line.h"
#include "ports/gaussians/gaussian_file.h"
#include "ports/host/files.h"
#include "ports/host/process.h"
#include "samples/common/loading.h"
#include "samples/common/progress.h"
#include "samples/inspect/describe.h"
#include "samples/inspect/page.h"
#include "samples/inspect/pictures.h"
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
  std::string json;  // where it goes: empty, "-" or a file
  std::string html;  // a folder, or empty
  std::string body;  // for the pictures of --html
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

// To where --json says. Paths come from the command line and need not be UTF-8.
Status write_json(const Options& options, const Json& document) {
  const std::string text = document.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
  if (options.json != "-")
    return figurine::ports::write_file_atomically(options.json, std::as_bytes(std::span(text)));
  print(text);
  return {};
}

Status inspect_gaussians(const Options& options) {
  if (options.tensors || !options.other_path.empty() || !options.html.empty()) {
    return Status(figurine::StatusCode::kInvalidArgument,
                  options.path + ": --tensors, --diff and --html are for packages");
  }
  const Result<MappedFile> file = MappedFile::open(options.path);
  if (!file.ok()) return file.status();
  const Result<GaussianCloud> cloud = figurine::ports::read_gaussians(file->bytes(), options.path);
  if (!cloud.ok()) return cloud.status();
  if (!options.json.empty()) {
    FIG_RETURN_IF_ERROR(write_json(options, Json{{"file", options.path},
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
                                                 {"remarks", cloud->remarks}}));
  }
  if (options.json != "-") {
    print(options.path + ": " + figurine::ports::describe(*cloud) + "\n");
  }
  return {};
}

Status write_html(const Options& options, OpenedFile opened, const Json& document) {
  const figurine::samples::LoadedPackage package{options.path, std::move(opened.file),
                                                 std::move(opened.package)};
  const Result<std::vector<figurine::inspect::PictureSection>> sections =
      figurine::inspect::draw_pictures(package, options.body);
  if (!sections.ok()) return sections.status();
  const std::string html = figurine::inspect::page_html(document, *sections);
  FIG_RETURN_IF_ERROR(figurine::inspect::write_page(options.html, html));
  size_t pictures = 0;
  for (const auto& section : *sections) pictures += section.pictures.size();
  figurine::ports::say(options.html + "/index.html: " + std::to_string(pictures) + " pictures, " +
                       std::to_string(html.size()) + " bytes");
  return {};
}

Status inspect(const Options& options) {
  if (figurine::ports::is_gaussian_name(options.path)) return inspect_gaussians(options);
  Result<OpenedFile> opened = open_file(options.path);
  if (!opened.ok()) return opened.status();
  const std::span<const std::byte> bytes = opened->file.bytes();
  if (!options.other_path.empty()) {
    const Result<OpenedFile> other = open_file(options.other_path);
    if (!other.ok()) return other.status();
    const Json comparison =
        figurine::inspect::compare(opened->package, bytes, options.path, other->package,
                                   other->file.bytes(), options.other_path);
    if (options.json != "-") print(figurine::inspect::print_comparison(comparison));
    return options.json.empty() ? Status() : write_json(options, comparison);
  }
  Json document = figurine::inspect::describe(opened->package, options.path);
  if (options.tensors)
    document["tensors"] = figurine::inspect::describe_tensors(opened->package, bytes);
  if (!options.html.empty()) FIG_RETURN_IF_ERROR(write_html(options, std::move(*opened), document));
  if (!options.json.empty()) FIG_RETURN_IF_ERROR(write_json(options, document));
  if (options.json != "-" && options.html.empty()) {
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
      "file of Gaussians, what is read of it",
      "figurine-inspect"};
  app.set_version_flag("--version", "figurine-inspect " FIGURINE_VERSION);
  figurine::ports::prepare_help(app);
  Options options;
  app.add_option("package", options.path, "the package, or .ply, .splat, .spz")
      ->required()
      ->type_name("PKG");
  figurine::ports::add_json_option(app, options.json);
  CLI::Option* tensors = app.add_flag(
      "--tensors", options.tensors,
      "list every array: type, shape, bytes, range, checksum; and the quantisation of every layer");
  CLI::Option* diff =
      app.add_option("--diff", options.other_path,
                     "compare with this package: fields, and the largest difference of each array")
          ->type_name("OTHER")
          ->excludes(tensors);
  CLI::Option* html =
      app.add_option("--html", options.html,
                     "a page with pictures, DIR/index.html, in place of the text (docs/package.md)")
          ->type_name("DIR")
          ->excludes(tensors)
          ->excludes(diff);
  app.add_option("--body", options.body,
                 "for --html: the body that a motion is drawn on, or that the package stands on; "
                 "default: found by content hash")
      ->needs(html);
  if (const std::optional<int> code = figurine::ports::parse_command_line(app, argc, argv))
    return *code;
  if (!options.html.empty()) figurine::samples::catch_interrupts();
  const Status status = inspect(options);
  if (status.ok()) return figurine::ports::kDone;
  figurine::ports::say(status.message());
  if (status.code() == figurine::StatusCode::kInterrupted) figurine::samples::die_of_interrupt();
  return figurine::ports::kBadInput;
}

}  // namespace

int main(int argc, char** argv) {
  return figurine::ports::run_program("figurine-inspect", [&] { return run(argc, argv); });
}
