// Members of a population that is a folder: the same avatars as those of its package.
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <span>

#include "formats/writer/population_writer.h"
#include "samples/common/loading.h"
#include "samples/program.h"

namespace figurine::samples {
namespace {

using tests::make_test_avatar;
using tests::SyntheticAvatar;

// Two maps and the network that they share, in a folder as `figurine-train population` leaves it.
class MemberFolder : public testing::Test {
 protected:
  MemberFolder()
      : body_(tests::make_test_body()),
        shared_(make_test_avatar(
            body_, {.held = tests::Held::kBoth, .network_step = 2, .static_part = true})),
        ada_(make_map("ada", 2)),
        bob_(make_map("bob", 3)) {
    std::filesystem::create_directories(folder_.path("people/members"));
    std::filesystem::create_directories(folder_.path("people/initial"));
    save("people/body.fgn", body_.bytes);
    save("people/initial/shared.fgn", shared_.bytes);
    save("people/members/ada.fgn", ada_.bytes);
    save("people/members/bob.fgn", bob_.bytes);
  }
  SyntheticAvatar make_map(const std::string& name, uint64_t seed) const {
    return make_test_avatar(body_, {.shape = {0.1f, static_cast<float>(seed) / 10},
                                    .seed = seed,
                                    .network_step = 0,
                                    .static_part = true,
                                    .name = name});
  }
  void save(const std::string& name, const tests::AlignedBytes& bytes) const {
    folder_.write(name,
                  {reinterpret_cast<const char*>(bytes.bytes().data()), bytes.bytes().size()});
  }
  std::string error_of(const std::string& name) const {
    const auto loaded = load_avatar(folder_.path(name));
    return loaded.ok() ? "" : loaded.status().message();
  }

  tests::TestFolder folder_;
  tests::SyntheticBody body_;
  SyntheticAvatar shared_, ada_, bob_;
};

template <class T>
void expect_equal(std::span<const T> a, std::span<const T> b) {
  EXPECT_TRUE(std::ranges::equal(a, b));
}

TEST_F(MemberFolder, HoldsTheAvatarsOfItsPackage) {
  const NewPopulation from{.name = "people",
                           .initial = shared_.package->avatar().network,
                           .shared = &shared_.package->avatar(),
                           .coding = DifferenceCoding::kNone,
                           .members = {{&ada_.package->avatar(), &ada_.package->provenance()},
                                       {&bob_.package->avatar(), &bob_.package->provenance()}}};
  const Result<std::vector<std::byte>> written = write_population(from);
  ASSERT_TRUE(written.ok()) << written.status().message();
  const tests::AlignedBytes bytes(*written);
  const Result<Package> package = Package::open(bytes.bytes(), "people.fgn");
  ASSERT_TRUE(package.ok()) << package.status().message();
  const Population& population = package->population();
  const char* const names[] = {"ada", "bob"};
  for (size_t m = 0; m < 2; ++m) {
    std::vector<float> storage(member_floats(population));
    const Avatar packed = open_member(population, m, storage);
    for (const std::string& member : {std::string(names[m]), std::to_string(m)}) {
      const auto loaded = load_avatar(folder_.path("people#") + member);
      ASSERT_TRUE(loaded.ok()) << loaded.status().message();
      const Avatar& avatar = (*loaded)->avatar;
      EXPECT_EQ(avatar.name, packed.name);
      EXPECT_EQ(avatar.texels_a_side(), packed.texels_a_side());
      EXPECT_EQ(avatar.network.input_size, packed.network.input_size);
      EXPECT_EQ(avatar.fourier_octaves, packed.fourier_octaves);
      ASSERT_EQ(avatar.network.layers.size(), packed.network.layers.size());
      for (size_t i = 0; i < packed.network.layers.size(); ++i)
        expect_equal(avatar.network.layers[i].weights, packed.network.layers[i].weights);
      expect_equal(avatar.shape, packed.shape);
      expect_equal(avatar.static_part.groups[0].values, packed.static_part.groups[0].values);
      EXPECT_EQ(avatar.map_statistics.mean, packed.map_statistics.mean);
      EXPECT_TRUE(avatar.holds(Precision::kFixedPoint)) << "what the shared network has";
      EXPECT_TRUE(find_body(**loaded, "").ok()) << "the folder's own";
    }
  }
}

TEST_F(MemberFolder, AMemberWithANetworkOfItsOwnNeedsNoOther) {
  std::filesystem::remove(folder_.path("people/initial/shared.fgn"));
  save("people/members/cy.fgn", make_test_avatar(body_, {.name = "cy"}).bytes);
  const auto loaded = load_avatar(folder_.path("people#cy"));
  ASSERT_TRUE(loaded.ok()) << loaded.status().message();
  EXPECT_EQ((*loaded)->network, nullptr);
  EXPECT_NE(error_of("people#ada").find("initial/shared.fgn"), std::string::npos)
      << error_of("people#ada");
}

TEST_F(MemberFolder, SaysWhatIsWrongInALine) {
  EXPECT_NE(error_of("people").find("name one of its 2 members"), std::string::npos)
      << error_of("people");
  EXPECT_NE(error_of("people#eve").find("members have the numbers 0 to 1"), std::string::npos)
      << error_of("people#eve");
  EXPECT_NE(error_of("people#2"), "");
  EXPECT_NE(error_of("people#").find("none of this name"), std::string::npos);
  EXPECT_NE(error_of("people/members#ada").find("members/"), std::string::npos)
      << "no package is in its folder members/";
  // A map of another body, and one of another number of texels.
  const tests::SyntheticBody other = tests::make_test_body({.seed = 2});
  save("people/members/eve.fgn",
       make_test_avatar(other, {.network_step = 0, .static_part = true}).bytes);
  EXPECT_NE(error_of("people#eve").find("eve.fgn: body: is not that of"), std::string::npos)
      << error_of("people#eve");
  save("people/initial/shared.fgn", ada_.bytes);
  EXPECT_NE(error_of("people#ada").find("shared.fgn: has no network"), std::string::npos)
      << error_of("people#ada");
}

// The shipped one: members of one network, each a file that says how good it is.
TEST_F(MemberFolder, TheShippedOneHasPeople) {
  const std::string folder = FIGURINE_SOURCE_DIR "/samples/populations/edge";
  const auto loaded = load_avatar(folder + "#0");
  ASSERT_TRUE(loaded.ok()) << loaded.status().message();
  EXPECT_EQ((*loaded)->avatar.name, "000000");
  EXPECT_FALSE((*loaded)->avatar.network.layers.empty()) << "everybody's";
  EXPECT_FALSE((*loaded)->avatar.static_part.groups.empty()) << "its own";
  EXPECT_TRUE(find_body(**loaded, "").ok());
  const tests::ProgramRun run = tests::run_figurine("render '" + folder + "#000000' --size 96x96" +
                                                    " --json -o " + folder_.path("member.png"));
  EXPECT_EQ(run.exit_code, 0) << run.err;
  EXPECT_TRUE(folder_.has("member.png"));
}

TEST_F(MemberFolder, IsDrawnByTheProgram) {
  const tests::ProgramRun run = tests::run_figurine("render " + folder_.path("people#bob") +
                                                    " --size 48x48 -o " + folder_.path("bob.png"));
  EXPECT_EQ(run.exit_code, 0) << run.err;
  EXPECT_TRUE(folder_.has("bob.png"));
}

}  // namespace
}  // namespace figurine::samples
