// Avatar packages on disk into a population: which files are taken, where the split comes from, and
// whose fault it is if it does not work.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "formats/writer/package_writer.h"
#include "runtime/test_packages.h"
#include "tests/toolchain/train/small_capture.h"
#include "toolchain/error.h"
#include "toolchain/model/unet.h"
#include "toolchain/train/avatar_file.h"
#include "toolchain/train/pack_population.h"
#include "toolchain/train/tensor_file.h"

namespace figurine::train::pack_population_test {
namespace {

using testing_tools::TemporaryFolder;
using tests::make_test_avatar;
using tests::make_test_body;

struct People {
  TemporaryFolder folder;
  tests::SyntheticBody body = make_test_body();

  People() {
    write("body.fgn", body.bytes.bytes());
    std::filesystem::create_directories(folder.path("runs/000001"));
    std::filesystem::create_directories(folder.path("runs/000000"));
    for (uint64_t m = 0; m < 3; ++m) {
      const std::string name = "00000" + std::to_string(m);
      write(m < 2 ? "runs/" + name + "/avatar.fgn" : name + ".fgn",
            make_test_avatar(body, {.seed = m, .name = name}).bytes.bytes());
    }
    write("runs/body.fgn", body.bytes.bytes());
  }

  void write(const std::string& name, std::span<const std::byte> bytes) const {
    throw_if_error(ports::write_file_atomically(folder.path(name), bytes), name);
  }
  void write(const std::string& name, const std::string& text) const {
    write(name, std::as_bytes(std::span(text)));
  }
  PackPopulationOptions options() const {
    return {.inputs = {folder.path("runs"), folder.path("000002.fgn")}, .quiet = true};
  }
};

Package open(const AlignedBytes& bytes) {
  return value_or_throw(Package::open(bytes.bytes(), "population"), "test");
}

void expect_refused(const PackPopulationOptions& options, const std::string& words) {
  try {
    pack_population(options);
    FAIL() << "packed, and should say: " << words;
  } catch (const InputError& error) {
    const std::string what = error.what();
    EXPECT_NE(what.find(words), std::string::npos) << what;
    EXPECT_EQ(what.find('\n'), std::string::npos) << what;
  }
}

TEST(PackPopulation, TakesFilesAndFoldersInTheirOrder) {
  const People people;
  const AlignedBytes bytes(pack_population(people.options()));
  const Package package = open(bytes);
  const Population& population = package.population();
  ASSERT_EQ(population.size(), 3u);
  for (size_t m = 0; m < 3; ++m) {
    EXPECT_EQ(population.members[m].name, "00000" + std::to_string(m));
    EXPECT_EQ(population.members[m].split, Split::kTrain);
  }
  EXPECT_EQ(population.coding, DifferenceCoding::kInt8);
  EXPECT_EQ(package.provenance().settings.back().key, "population.init");
}

TEST(PackPopulation, DiffersFromTheCommonInitialWeightsOrFromAFile) {
  const People people;
  const AlignedBytes bytes(pack_population(people.options()));
  const Package package = open(bytes);
  model::PoseUNet unet(package.population().network, {.precision = model::Precision::kFloat32});
  std::vector<float> storage;
  const Network common = unet.export_network(storage);
  for (size_t i = 0; i < common.layers.size(); ++i) {
    EXPECT_TRUE(std::ranges::equal(common.layers[i].weights,
                                   package.population().network.layers[i].weights));
  }
  TensorFile file;
  size_t convolution = 0;
  for (const Layer& layer : common.layers) {
    if (layer.op != LayerOp::kConv2d) continue;
    const std::string name = "layer." + std::to_string(convolution++);
    const int64_t out = layer.out_channels, kernel = layer.kernel;
    const int64_t in = static_cast<int64_t>(layer.weights.size()) / (out * kernel * kernel);
    file.tensors[name + ".weight"] = {{out, kernel, kernel, in},
                                      std::vector<float>(layer.weights.size(), 0.25f)};
    file.tensors[name + ".bias"] = {{out}, std::vector<float>(layer.bias.size(), 0.5f)};
  }
  write_tensor_file(people.folder.path("init.safetensors"), file);
  PackPopulationOptions options = people.options();
  options.init = people.folder.path("init.safetensors");
  const AlignedBytes other(pack_population(options));
  EXPECT_EQ(open(other).population().network.layers[0].weights[7], 0.25f);
  options.init = people.folder.path("nothing.safetensors");
  expect_refused(options, "nothing.safetensors");
}

TEST(PackPopulation, TakesTheSplitFromItsFile) {
  const People people;
  people.write(
      "split.json",
      R"({"train": ["000001"], "validation": [0], "test": ["000002", "000009"], "seed": 3})");
  PackPopulationOptions options = people.options();
  options.split = people.folder.path("split.json");
  const AlignedBytes bytes(pack_population(options));
  const Package package = open(bytes);
  EXPECT_EQ(package.population().members[0].split, Split::kValidation);
  EXPECT_EQ(package.population().members[1].split, Split::kTrain);
  EXPECT_EQ(package.population().members[2].split, Split::kTest);
  people.write("split.json", R"({"train": ["000001"], "validation": [], "test": ["000002"]})");
  expect_refused(options, "member '000000' is in no part");
  people.write("split.json", R"({"train": ["000001"], "validation": [1], "test": []})");
  expect_refused(options, "'000001' is there twice");
  people.write("split.json", R"({"train": ["000001"], "test": []})");
  expect_refused(options, "validation: is not a list");
  people.write("split.json", R"({"train": [1.5], "validation": [], "test": []})");
  expect_refused(options, "neither a name nor a whole number");
}

TEST(PackPopulation, NamesTheInputThatDoesNotFit) {
  const People people;
  PackPopulationOptions options = people.options();
  const auto with = [&](const std::string& input) {
    PackPopulationOptions more = options;
    more.inputs.push_back(people.folder.path(input));
    return more;
  };
  expect_refused(with("000002.fgn"), "member '000002' is there twice");
  expect_refused(with("body.fgn"), "is a package of kind body, not avatar");
  expect_refused(with("missing.fgn"), "missing.fgn");
  std::filesystem::create_directories(people.folder.path("empty"));
  expect_refused(with("empty"), "has no avatar package below it");
  people.write("empty/broken.fgn", std::string("not a package"));
  expect_refused(with("empty"), "broken.fgn");
  people.write("wider.fgn",
               make_test_avatar(people.body, {.channels = 6, .name = "wider"}).bytes.bytes());
  expect_refused(with("wider.fgn"), "member 'wider': its network has another shape");
  const tests::SyntheticBody other = make_test_body({.seed = 2});
  people.write("stranger.fgn", make_test_avatar(other, {.name = "stranger"}).bytes.bytes());
  expect_refused(with("stranger.fgn"), "member 'stranger': was made for the body");
  people.write("fixed.fgn",
               make_test_avatar(people.body, {.held = tests::Held::kFixedPoint, .name = "fixed"})
                   .bytes.bytes());
  expect_refused(with("fixed.fgn"), "member 'fixed': holds no float weights");
}

TEST(AvatarFile, OpensPackagesAndMembers) {
  const People people;
  people.write("people.fgn", pack_population(people.options()));
  EXPECT_EQ(open_avatar(people.folder.path("000002.fgn")).avatar.name, "000002");
  EXPECT_EQ(open_avatar(people.folder.path("people.fgn#000001")).avatar.name, "000001");
  EXPECT_EQ(open_avatar(people.folder.path("people.fgn#2")).avatar.name, "000002");
  EXPECT_THROW(open_avatar(people.folder.path("people.fgn")), InputError);
  EXPECT_THROW(open_avatar(people.folder.path("people.fgn#3")), InputError);
  EXPECT_THROW(open_avatar(people.folder.path("000002.fgn#0")), InputError);
}

}  // namespace
}  // namespace figurine::train::pack_population_test
