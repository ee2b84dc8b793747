// figurine splat against the float64 oracle with the same cuts and the same order: through a .ply
// in and a PFM out, as a user would compare renderers. The line that starts with splat_oracle_db is
// the figure of docs/results/line.json.
#include <gtest/gtest.h>

#include <cstdio>
#include <nlohmann/json.hpp>

#include "figurine/camera.h"
#include "oracle/splat_oracle.h"
#include "ports/gaussians/ply.h"
#include "ports/gaussians/ply_text.h"
#include "ports/media/pfm.h"
#include "runtime/test_packages.h"
#include "samples/program.h"

namespace figurine::tests::splat_parity_test {
namespace {

// 20,000 Gaussians with SH 3 before the camera: balls, discs and needles of 2 mm to 60 mm,
// opacities over the whole range, some outside the picture.
std::string random_scene() {
  Random random(20);
  const std::vector<PlyColumn> columns = standard_columns(3);
  return make_ply(columns, 20000, PlyEncoding::kLittle,
                  [&](size_t, const std::string& name) -> double {
                    if (name == "x" || name == "y") return random.uniform(-1.6f, 1.6f);
                    if (name == "z") return random.uniform(-1, 1);
                    if (name.starts_with("f_dc_")) return random.uniform(-1.5f, 1.5f);
                    if (name.starts_with("f_rest_")) return 0.15f * random.normal();
                    if (name == "opacity") return 2 * random.normal();
                    if (name.starts_with("scale_")) return random.uniform(-6.2f, -2.8f);
                    if (name.starts_with("rot_")) return random.normal();
                    return 0;
                  });
}

// Returns the foreground PSNR.
double compare_through_files(bool antialiased) {
  const TestFolder folder;
  const std::string ply = random_scene();
  folder.write("scene.ply", ply);
  const ProgramRun run =
      run_figurine("splat scene.ply --size 256x256 --camera orbit:20,10,3.2,45 --json -o x.pfm" +
                       std::string(antialiased ? " --antialiased" : ""),
                   {.folder = folder.path()});
  FIG_CHECK(run.exit_code == 0, run.err.c_str());
  const std::string pfm = folder.read("x.pfm");
  const Result<ports::ImageF32> picture = ports::decode_pfm(std::as_bytes(std::span(pfm)), "x.pfm");
  FIG_CHECK(picture.ok() && picture->channels == 4, "a picture with alpha");

  // The oracle sees what the file says and the camera that the program says it used.
  const Result<ports::GaussianCloud> cloud =
      ports::read_gaussian_ply(std::as_bytes(std::span(ply)), "scene.ply");
  FIG_CHECK(cloud.ok() && cloud->count() == 20000, "the scene as it was written");
  const nlohmann::json said = nlohmann::json::parse(run.out), json = said["camera"];
  EXPECT_EQ(said["antialiased"], antialiased);
  Camera camera{.width_px = 256, .height_px = 256, .near_m = json["near"]};
  camera.fx_px = json["intrinsics"][0][0], camera.cx_px = json["intrinsics"][0][2];
  camera.fy_px = json["intrinsics"][1][1], camera.cy_px = json["intrinsics"][1][2];
  for (int k = 0; k < 12; ++k) camera.view_from_world[k] = json["world_to_camera"][k / 4][k % 4];
  const oracle::Image truth =
      oracle::render(oracle::from_view(cloud->view()), camera, {.antialiased = antialiased});

  std::vector<float> premultiplied = picture->pixels;
  double largest = 0;
  size_t foreground = 0;
  for (size_t p = 0; p < truth.transmittance.size(); ++p) {
    for (int c = 0; c < 3; ++c) {
      premultiplied[4 * p + c] *= premultiplied[4 * p + 3];
      largest = std::max(largest, std::abs(premultiplied[4 * p + c] - truth.rgb[3 * p + c]));
    }
    foreground += truth.alpha(p) > 0.5;
  }
  const double psnr_db = oracle::foreground_psnr_db<float>(truth, premultiplied);
  std::printf("%s %.2f\n%zu foreground pixels of %zu, largest difference %.3g\n",
              antialiased ? "antialiased, dB" : "splat_oracle_db", psnr_db, foreground,
              truth.transmittance.size(), largest);
  EXPECT_GT(foreground, truth.transmittance.size() / 4);
  return psnr_db;
}

TEST(SplatParity, TwentyThousandGaussiansThroughFiles) {
  EXPECT_GE(compare_through_files(false), 75);
}

TEST(SplatParity, TheSameAntialiased) { EXPECT_GE(compare_through_files(true), 75); }

}  // namespace
}  // namespace figurine::tests::splat_parity_test
