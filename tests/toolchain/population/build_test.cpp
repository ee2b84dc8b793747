// A whole small population, from the recipe to the package: what is left behind, that a build
// killed anywhere goes on to the same bits, and that a member that fails takes no other with it.
// Builds fork, so nothing here starts a thread.
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "tests/toolchain/population/small_recipe.h"
#include "tests/toolchain/train/small_capture.h"
#include "toolchain/error.h"
#include "toolchain/population/build.h"
#include "toolchain/population/state.h"
#include "toolchain/train/package_file.h"
#include "toolchain/train/population_file.h"
#include "toolchain/train/run_directory.h"

namespace figurine::population {
namespace {

namespace fs = std::filesystem;
using testing_tools::TemporaryFolder;

constexpr const char* kPeople[] = {"000000", "000001", "000002", "000010"};

struct Workplace {
  TemporaryFolder folder;
  explicit Workplace(const nlohmann::json& recipe = testing_tools::small_recipe()) {
    testing_tools::write_swinging_motion(folder.path("swinging.fgn"));
    train::write_json(folder.path("recipe.json"), recipe);
  }
  BuildOptions options(const std::string& state) const {
    return {.recipe = folder.path("recipe.json"),
            .state = folder.path(state),
            .makehuman = {},
            .slots = 2,
            .quiet = true};
  }
};

std::string bytes_of(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

void expect_same_weights(const std::string& a, const std::string& b) {
  const train::PackageFile first = train::open_package(a, PackageKind::kAvatar),
                           second = train::open_package(b, PackageKind::kAvatar);
  const Network &one = first.package.avatar().network, &other = second.package.avatar().network;
  ASSERT_EQ(one.layers.size(), other.layers.size());
  for (size_t i = 0; i < one.layers.size(); ++i) {
    EXPECT_TRUE(std::ranges::equal(one.layers[i].weights, other.layers[i].weights))
        << a << " layer " << i;
    EXPECT_TRUE(std::ranges::equal(one.layers[i].bias, other.layers[i].bias))
        << a << " layer " << i;
  }
}

size_t entries(const std::string& folder) {
  return fs::exists(folder) ? static_cast<size_t>(std::distance(fs::directory_iterator(folder),
                                                                fs::directory_iterator()))
                            : 0;
}

fs::file_time_type newest_image(const std::string& folder) {
  fs::file_time_type newest = fs::file_time_type::min();
  for (const fs::directory_entry& entry : fs::recursive_directory_iterator(folder)) {
    const fs::path kind = entry.path().extension();
    if (kind == ".jpg" || kind == ".png") newest = std::max(newest, entry.last_write_time());
  }
  EXPECT_GT(newest, fs::file_time_type::min()) << "there are images";
  return newest;
}

// Before anybody is photographed: a line a clip, and an error where it cannot be what is asked.
TEST(BuildPopulation, SaysWhatItsMotionsAreAndRefusesWhatTheyCannotBe) {
  nlohmann::json recipe = testing_tools::small_recipe();
  recipe["motions"] = {{{"clip", FIGURINE_SOURCE_DIR "/tests/data/cases/bvh-no-tpose/in.bvh"},
                        {"name", "walk"},
                        {"neutral", "first"}}};
  const auto built = [](const Workplace& place) {
    std::string error;
    testing::internal::CaptureStderr();
    try {
      build(place.options("state"));
    } catch (const InputError& refused) {
      error = refused.what();
    }
    return std::pair(testing::internal::GetCapturedStderr(), error);
  };
  {
    // Too short for the recipe's captures: it ends there.
    recipe["motions"][0]["frames"] = 4;
    const auto [said, error] = built(Workplace(recipe));
    EXPECT_NE(said.find("motion walk: 4 frames at 30 a second, soles in contact"),
              std::string::npos)
        << said;
    EXPECT_NE(said.find("; read: "), std::string::npos) << said;
    EXPECT_EQ(std::count(said.begin(), said.end(), '\n'), 1) << said;
    EXPECT_NE(error, "");
  }
  {
    recipe["motions"][0]["neutral"] = "axes";
    const auto [said, error] = built(Workplace(recipe));
    EXPECT_EQ(said, "");
    EXPECT_NE(error.find("in.bvh: neutral: a BVH has"), std::string::npos) << error;
  }
  {
    recipe["motions"] = {{{"clip", "swinging.fgn"}, {"neutral", 3}}};
    EXPECT_NE(built(Workplace(recipe)).second.find("this is a motion package"), std::string::npos);
  }
}

TEST(BuildPopulation, LeavesMembersTableSplitAndPackage) {
  const Workplace place;
  build(place.options("state"));
  const State state{place.folder.path("state")};
  const train::PackageFile package = train::open_package(state.package(), PackageKind::kPopulation);
  const Population& population = package.package.population();
  ASSERT_EQ(population.size(), 4u);
  for (size_t m = 0; m < 4; ++m) {
    EXPECT_EQ(population.members[m].name, kPeople[m]);
    EXPECT_TRUE(fs::exists(state.sheet(kPeople[m])));
  }
  EXPECT_EQ(population.members[3].split, Split::kTest);
  const nlohmann::json row = train::read_json(state.row("000010"));
  EXPECT_EQ(row.at("split"), "test");
  EXPECT_GT(row.at("quality").at("held_out_views").at("psnr_db").get<double>(), 10);
  EXPECT_TRUE(row.at("frozen_pose").at("held_out_views").at("psnr_db").is_number());
  EXPECT_TRUE(row.at("from_scratch").at("quality").at("held_out_views").at("psnr_db").is_number());
  EXPECT_EQ(row.at("from_scratch").at("log").size(), row.at("log").size());
  EXPECT_LT(std::abs(row.at("rounding").at("views").at("loss_db").get<double>()), 1);
  EXPECT_FALSE(train::read_json(state.row("000000")).contains("rounding"));
  EXPECT_EQ(train::read_json(state.split()).at("train").size(), 3u);
  EXPECT_NE(bytes_of(state.table()).find("000010,test,finished"), std::string::npos);
  EXPECT_EQ(entries(state.captures()) + entries(state.folder + "/runs"), 0u);
  EXPECT_FALSE(fs::exists(state.initial() + "/rounds"));
  // Two rounds' rows under the head.
  const std::string history = bytes_of(state.initial() + "/history.csv");
  EXPECT_EQ(std::count(history.begin(), history.end(), '\n'), 3);

  // Called again it makes nothing; another recipe is refused.
  const fs::file_time_type before = fs::last_write_time(state.member("000001"));
  build(place.options("state"));
  EXPECT_EQ(fs::last_write_time(state.member("000001")), before);
  nlohmann::json other = testing_tools::small_recipe();
  other["training"]["iterations"] = 41;
  train::write_json(place.folder.path("recipe.json"), other);
  try {
    build(place.options("state"));
    FAIL() << "went on with another recipe";
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what()).find("training: differs from"), std::string::npos)
        << error.what();
  }
}

TEST(BuildPopulation, OfOneNetworkHoldsItOnceAndAMapForEach) {
  const Workplace place(testing_tools::small_shared_recipe());
  BuildOptions keeping = place.options("state");
  keeping.keep_captures = true;
  build(keeping);
  const State state{place.folder.path("state")};
  const train::PackageFile package = train::open_package(state.package(), PackageKind::kPopulation),
                           shared = train::open_package(state.shared(), PackageKind::kAvatar);
  const Population& population = package.package.population();
  ASSERT_EQ(population.size(), 4u);
  EXPECT_EQ(population.coding, DifferenceCoding::kNone);
  const Network& network = shared.package.avatar().network;
  std::vector<float> storage(member_floats(population));
  for (size_t m = 0; m < 4; ++m) {
    const Avatar member = open_member(population, m, storage);
    for (size_t i = 0; i < network.layers.size(); ++i)
      EXPECT_TRUE(std::ranges::equal(member.network.layers[i].weights, network.layers[i].weights));
    const train::PackageFile own =
        train::open_package(state.member(kPeople[m]), PackageKind::kAvatar);
    EXPECT_FALSE(own.package.avatar().has_network()) << "a member's file is its map alone";
    EXPECT_TRUE(std::ranges::equal(own.package.avatar().static_part.groups[0].values,
                                   member.static_part.groups[0].values));
  }
  const nlohmann::json row = train::read_json(state.row("000010"));
  EXPECT_GT(row.at("quality").at("held_out_views").at("psnr_db").get<double>(), 10);
  // What a member was measured to be comes through its package, busts and views as well.
  for (const auto& [name, group, metric] :
       {std::tuple{"psnr_pose_db", "held_out_poses", "psnr_db"},
        {"highpass_correlation", "held_out_poses", "highpass_correlation"},
        {"bust_head_psnr_db", "held_out_poses", "bust_head_psnr_db"},
        {"view_highpass_ratio", "held_out_views", "highpass_ratio"},
        {"view_bust_psnr_db", "held_out_views", "bust_psnr_db"},
        {"view_bust_highpass_correlation", "held_out_views", "bust_highpass_correlation"}}) {
    const auto at = std::ranges::find(population.quality_names, name);
    ASSERT_NE(at, population.quality_names.end()) << name;
    EXPECT_EQ(population.members[3].quality[size_t(at - population.quality_names.begin())],
              row.at("quality").at(group).at(metric).get<double>())
        << name;
  }
  EXPECT_LT(std::abs(row.at("rounding").at("views").at("loss_db").get<double>()), 1);
  EXPECT_EQ(entries(state.initial()), 2u) << "weights and avatar; captures and run are gone";

  // The folder is read as its package is, and wherever it lies the same bytes come of it.
  const train::PackageFile from_folder = train::open_population(state.folder);
  const Population& same = from_folder.package.population();
  ASSERT_EQ(same.size(), 4u);
  EXPECT_EQ(same.members[3].split, Split::kTest);
  EXPECT_TRUE(std::ranges::equal(same.static_code, population.static_code));
  EXPECT_EQ(same.members[3].quality, population.members[3].quality);
  fs::create_directories(place.folder.path("elsewhere"));
  fs::copy(state.folder, place.folder.path("elsewhere/state"), fs::copy_options::recursive);
  EXPECT_EQ(train::open_population(place.folder.path("elsewhere/state/")).package.content_hash(),
            from_folder.package.content_hash());
  fs::remove(state.member("000001"));
  EXPECT_EQ(train::open_population(state.folder).package.population().size(), 3u)
      << "a part of it is one too";

  const Workplace again(testing_tools::small_shared_recipe());
  BuildOptions one_slot = again.options("state");
  one_slot.slots = 1;
  one_slot.initial_weights_only = true;
  build(one_slot);
  EXPECT_EQ(bytes_of(State{again.folder.path("state")}.initial_weights()),
            bytes_of(state.initial_weights()))
      << "whatever the number of slots";
  // On images that another population of the same people left it makes the same members, and no
  // image anew.
  const State third{again.folder.path("state")};
  EXPECT_EQ(entries(state.captures()), 4u);
  fs::remove_all(third.captures());
  fs::rename(state.captures(), third.captures());
  const fs::file_time_type before = newest_image(third.captures());
  one_slot.initial_weights_only = false, one_slot.keep_captures = true;
  build(one_slot);
  EXPECT_EQ(newest_image(third.captures()), before);
  for (const char* name : {"000000", "000010"}) {
    const train::PackageFile own = train::open_package(state.member(name), PackageKind::kAvatar),
                             other = train::open_package(third.member(name), PackageKind::kAvatar);
    EXPECT_TRUE(std::ranges::equal(own.package.avatar().static_part.groups[0].values,
                                   other.package.avatar().static_part.groups[0].values));
  }
}

TEST(BuildPopulation, KilledAnywhereItGoesOnToTheSameBits) {
  const Workplace place;
  build(place.options("straight"));
  // Killed at growing distances from its start, until a build lives to its end.
  int kills = 0;
  for (int delay_ms = 400;; delay_ms += 1400) {
    ASSERT_LT(kills, 60);
    const pid_t child = fork();
    ASSERT_GE(child, 0);
    if (child == 0) {
      try {
        build(place.options("killed"));
      } catch (...) {
        _exit(1);
      }
      _exit(0);
    }
    int status = 0;
    for (int waited_ms = 0; waitpid(child, &status, WNOHANG) == 0; waited_ms += 10) {
      if (waited_ms == delay_ms) kill(child, SIGKILL);
      usleep(10000);
    }
    if (WIFEXITED(status)) {
      ASSERT_EQ(WEXITSTATUS(status), 0);
      break;
    }
    ++kills;
    usleep(300000);  // the children of the killed one notice, save and leave
  }
  EXPECT_GT(kills, 1);
  const State straight{place.folder.path("straight")}, killed{place.folder.path("killed")};
  EXPECT_EQ(bytes_of(straight.initial_weights()), bytes_of(killed.initial_weights()));
  for (const char* name : kPeople) expect_same_weights(straight.member(name), killed.member(name));
}

TEST(BuildPopulation, AMemberThatFailsTakesNoOtherWithIt) {
  const Workplace place;
  const State state{place.folder.path("state")};
  fs::create_directories(state.captures() + "/000001");
  std::ofstream(state.captures() + "/000001/figurine.json") << "{\"version\": 1, \"compl";
  testing::internal::CaptureStderr();
  try {
    build(place.options("state"));
    ADD_FAILURE() << "said nothing";
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what()).find("1 of 4 members failed"), std::string::npos)
        << error.what();
  }
  const std::string said = testing::internal::GetCapturedStderr();
  EXPECT_EQ(std::count(said.begin(), said.end(), '\n'), 1) << said;
  EXPECT_NE(said.find("000001: "), std::string::npos) << said;
  EXPECT_NE(said.find("figurine.json"), std::string::npos) << said;
  EXPECT_EQ(
      train::open_package(state.package(), PackageKind::kPopulation).package.population().size(),
      3u);
  EXPECT_NE(bytes_of(state.table()).find("000001,train,failed"), std::string::npos);
  // Mended, the build goes on with that one alone.
  fs::remove_all(state.captures() + "/000001");
  build(place.options("state"));
  EXPECT_EQ(
      train::open_package(state.package(), PackageKind::kPopulation).package.population().size(),
      4u);
}

}  // namespace
}  // namespace figurine::population
