// figurine-train body, the way a user runs it: layouts by weight are stated, reported and drawn;
// what cannot be laid out leaves one line and no file.
#include <algorithm>
#include <nlohmann/json.hpp>

#include "figurine/package.h"
#include "gtest/gtest.h"
#include "ports/host/files.h"
#include "ports/media/png.h"
#include "samples/program.h"

namespace figurine::cli::body_test {
namespace {

using tests::ProgramRun;
using tests::TestFolder;

ProgramRun body(const TestFolder& folder, const std::string& arguments) {
  return tests::run_shell(FIGURINE_TRAIN " body --mannequin " + arguments, folder);
}

std::string setting(const Provenance& provenance, const std::string& key) {
  for (const KeyValue& entry : provenance.settings) {
    if (entry.key == key) return entry.value;
  }
  return "";
}

const std::string kWeighted =
    "--uv 64 --atlas weighted --weight hands=3 --weight head=2 --coarsest-grid 32";

TEST(BodyCommand, AWeightedLayoutIsStatedReportedAndDrawn) {
  const TestFolder folder;
  const ProgramRun run =
      body(folder, kWeighted + " --report report.json --sheet atlas.png -o body.fgn");
  ASSERT_EQ(run.exit_code, 0) << run.err;
  const auto file = ports::MappedFile::open(folder.path("body.fgn"));
  ASSERT_TRUE(file.ok());
  const auto package = Package::open(file->bytes(), "body.fgn");
  ASSERT_TRUE(package.ok()) << package.status().message();
  EXPECT_EQ(setting(package->provenance(), "command"), "body " + kWeighted);
  EXPECT_EQ(setting(package->provenance(), "atlas"), "weighted");
  EXPECT_EQ(setting(package->provenance(), "atlas_weights"), "body=1 hands=3 head=2");
  EXPECT_EQ(setting(package->provenance(), "atlas_coarsest_grid"), "32");
  EXPECT_EQ(package->body().texel_triangle.size(), package->body().texel.size());

  const nlohmann::json report = nlohmann::json::parse(folder.read("report.json"));
  EXPECT_EQ(report.at("package_bytes"), package->size_bytes());
  EXPECT_EQ(report.at("atlas"), "weighted");
  EXPECT_EQ(report.at("weights").at("hands"), 3.0);
  EXPECT_EQ(report.at("weights").at("legs"), 1.0);
  EXPECT_EQ(report.at("whole").at("texels"), package->body().texel_count());
  size_t texels = 0;
  for (const auto& [name, part] : report.at("parts").items())
    texels += part.at("texels").get<size_t>();
  EXPECT_EQ(texels, package->body().texel_count());
  EXPECT_NEAR(report.at("parts").at("head").at("density").get<double>(), 2, 0.2);
  EXPECT_NEAR(report.at("parts").at("hands").at("density").get<double>(), 3, 0.3);
  EXPECT_EQ(report.at("grids").at(1).at("size"), 32);
  EXPECT_GE(report.at("grids").at(1).at("gap_cells").get<int>(), 2);
  EXPECT_NE(run.out.find("hands"), std::string::npos) << run.out;

  const std::string png = folder.read("atlas.png");
  const auto picture = ports::decode_png(std::as_bytes(std::span(png)), "atlas.png");
  ASSERT_TRUE(picture.ok()) << picture.status().message();
  EXPECT_EQ(picture->width_px, 512u);

  ASSERT_EQ(body(folder, kWeighted + " -o again.fgn").exit_code, 0);
  EXPECT_EQ(folder.read("body.fgn"), folder.read("again.fgn"));
}

TEST(BodyCommand, TheSourceLayoutSaysNothingOfLayouts) {
  const TestFolder folder;
  ASSERT_EQ(body(folder, "--uv 32 -o body.fgn").exit_code, 0);
  ASSERT_EQ(body(folder, "--uv 32 --atlas source --report report.json -o same.fgn").exit_code, 0);
  EXPECT_EQ(folder.read("body.fgn"), folder.read("same.fgn"));
  const auto file = ports::MappedFile::open(folder.path("body.fgn"));
  const auto package = Package::open(file->bytes(), "body.fgn");
  ASSERT_TRUE(package.ok()) << package.status().message();
  EXPECT_EQ(setting(package->provenance(), "command"), "body --uv 32");
  EXPECT_EQ(setting(package->provenance(), "atlas"), "");
  EXPECT_TRUE(package->body().texel_triangle.empty());
  EXPECT_EQ(package->tensors().size(), 12u);
  const nlohmann::json report = nlohmann::json::parse(folder.read("report.json"));
  EXPECT_EQ(report.at("atlas"), "source");
  EXPECT_FALSE(report.contains("weights"));
}

TEST(BodyCommand, RefusesLayoutsInOneLineAndLeavesNothing) {
  const TestFolder folder;
  const std::vector<std::string> before = folder.names();
  struct Case {
    std::string arguments;
    int exit_code;
    std::string words;
  };
  for (const Case& wrong : {
           Case{"--weight tail=2", 1, "--weight: 'tail=2': is not PART=W"},
           Case{"--weight hands", 1, "--weight: 'hands': is not PART=W"},
           Case{"--weight hands=much", 1, "--weight: 'hands=much': 'much' is not a number"},
           Case{"--weight hands=", 1, "--weight: 'hands=': '' is not a number"},
           Case{"--weight body=2", 1, "--weight: body: is 1"},
           Case{"--weight hands=0", 1, "atlas: weight of hands: is not a positive number"},
           Case{"--weight hands=-1", 1, "atlas: weight of hands: is not a positive number"},
           Case{"--weight hands=nan", 1, "atlas: weight of hands: is not a positive number"},
           Case{"--weight hands=0.001", 1, "is too small to cover a texel of 32"},
           Case{"--coarsest-grid 4", 1, "do not fit with two cells of a grid of 4 between them"},
           Case{"--weight hands=5.5 --coarsest-grid 32 --sheet none/atlas.png", 1,
                "--sheet: none/atlas.png: cannot create"},
           Case{"--coarsest-grid 2", 2, "--coarsest-grid"},
           Case{"--atlas other", 2, "--atlas"},
           Case{"--atlas source --weight hands=2", 2, "need --atlas weighted"},
       }) {
    const bool says_atlas = wrong.arguments.find("--atlas") != std::string::npos;
    const ProgramRun run = body(folder, "--uv 32 " + wrong.arguments +
                                            (says_atlas ? "" : " --atlas weighted") + " -o x.fgn");
    EXPECT_EQ(run.exit_code, wrong.exit_code) << wrong.arguments << "\n" << run.err;
    EXPECT_NE(run.err.find(wrong.words), std::string::npos) << wrong.arguments << "\n" << run.err;
    if (wrong.exit_code == 1) {
      EXPECT_EQ(run.error_lines(), 1u) << run.err;
    }
    EXPECT_EQ(folder.names(), before);
  }
}

}  // namespace
}  // namespace figurine::cli::body_test
