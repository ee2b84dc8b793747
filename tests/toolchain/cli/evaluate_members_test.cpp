// figurine-train evaluate members, the way a user runs it: on a population of synthetic avatars a
// report and pictures; what cannot be measured is one line and no file.
#include <algorithm>
#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>

#include "formats/writer/population_writer.h"
#include "gtest/gtest.h"
#include "ports/host/files.h"
#include "samples/program.h"
#include "tests/toolchain/members/small_members.h"

namespace figurine::cli::evaluate_members_test {
namespace {

using tests::make_test_avatar;
using tests::make_test_body;
using tests::ProgramRun;
using tests::SyntheticAvatar;
using tests::TestFolder;

// Members of random weights around common ones; `training` of them train, then one validates and
// one tests if held_out. With a twin the last held-out member has the first training member's
// weights.
struct PeopleOptions {
  size_t training = 4;
  bool held_out = true;
  bool twin = false;
};

void write_people(const TestFolder& folder, const std::string& name, const PeopleOptions& options) {
  const tests::SyntheticBody body = make_test_body();
  const SyntheticAvatar initial = make_test_avatar(body, {.seed = 99});
  std::vector<SyntheticAvatar> avatars;
  std::vector<Provenance> provenance;
  const size_t count = options.training + (options.held_out ? 2 : 0);
  for (size_t m = 0; m < count; ++m) {
    const bool twin = options.twin && m + 1 == count;
    avatars.push_back(make_test_avatar(body, {.shape = {0.1f * float(twin ? 0 : m), 0.2f},
                                              .seed = twin ? 0 : m,
                                              .name = "person" + std::to_string(m)}));
    provenance.push_back(avatars.back().package->provenance());
    provenance.back().quality = {{"psnr_pose_db", 20.0 + double((m * 3) % 5)}};
  }
  NewPopulation population{.name = "people", .initial = initial.package->avatar().network};
  for (size_t m = 0; m < count; ++m) {
    const Split split = m < options.training    ? Split::kTrain
                        : m == options.training ? Split::kValidation
                                                : Split::kTest;
    population.members.push_back({&avatars[m].package->avatar(), &provenance[m], split});
  }
  const auto bytes = write_population(population);
  ASSERT_TRUE(bytes.ok()) << bytes.status().message();
  ASSERT_TRUE(ports::write_file_atomically(folder.path(name), *bytes).ok());
}

ProgramRun members(const TestFolder& folder, const std::string& arguments) {
  return tests::run_shell(
      FIGURINE_TRAIN " evaluate members " + arguments + " -o report.json --threads 2", folder);
}

nlohmann::json report_of(const TestFolder& folder) {
  std::ifstream file(folder.path("report.json"));
  return nlohmann::json::parse(file);
}

bool is_jpeg(const TestFolder& folder, const std::string& name) {
  return folder.has(name) && folder.read(name).substr(0, 2) == "\xff\xd8";
}

TEST(EvaluateMembers, SaysWhatAPopulationIsLike) {
  const TestFolder folder;
  tests::write_test_packages(folder);
  write_people(folder, "six.fgn", {});
  const ProgramRun run = members(folder,
                                 "six.fgn --body body.fgn --ranks 1,2,64 --wall wall.jpg "
                                 "--interpolation strip.jpg --worst 3 --worst-sheet worst.jpg");
  ASSERT_EQ(run.exit_code, 0) << run.err;
  const nlohmann::json report = report_of(folder);
  EXPECT_EQ(report.at("members"), nlohmann::json({{"train", 4}, {"validation", 1}, {"test", 1}}));
  EXPECT_EQ(report.at("quality").at("train").at("psnr_pose_db").at("count"), 4);
  EXPECT_EQ(report.at("quality").at("worst_members").at(0).at("name"), "person0");
  EXPECT_EQ(report.at("distances").at("members").size(), 6u);
  EXPECT_EQ(report.at("distances").at("correlation").at("training_pairs"), 6);
  EXPECT_EQ(report.at("spectrum").at("whole").at("directions"), 3);
  EXPECT_EQ(report.at("spectrum").at("tokens").size(), 16u);
  EXPECT_EQ(report.at("span").at("ranks"), nlohmann::json({1, 2, 3}))
      << "what is beyond N - 1 is N - 1";
  EXPECT_EQ(report.at("span_db").size(), 3u);
  EXPECT_EQ(report.at("interpolation").at("pairs").at(0).at("steps").size(), 5u);
  EXPECT_EQ(report.at("span").at("by_kind").size(), 1u) << "kernels: they have no maps";
  EXPECT_EQ(report.at("span").at("by_kind").at("kernels").size(), 3u);
  EXPECT_TRUE(report.at("part_mixtures").is_null());
  for (const char* picture : {"wall.jpg", "strip.jpg", "worst.jpg"})
    EXPECT_TRUE(is_jpeg(folder, picture)) << picture;
}

TEST(EvaluateMembers, OfMapsSaysWhatPartsAreLikeAndShowsBusts) {
  const TestFolder folder;
  const tests::SmallMembers people({.own_networks = false});
  ASSERT_TRUE(
      ports::write_file_atomically(folder.path("body.fgn"), people.body.bytes.bytes()).ok());
  ASSERT_TRUE(ports::write_file_atomically(folder.path("people.fgn"), people.bytes.bytes()).ok());
  const ProgramRun run = members(folder,
                                 "people.fgn --body body.fgn --ranks 1 --part-mixtures parts.jpg "
                                 "--bust-wall busts.jpg --wall wall.jpg");
  ASSERT_EQ(run.exit_code, 0) << run.err;
  const nlohmann::json report = report_of(folder);
  EXPECT_EQ(report.at("span").at("by_kind").size(), 1u);
  EXPECT_EQ(report.at("span").at("by_kind").at("map").size(), 2u) << "ranks 1 and N - 1";
  EXPECT_EQ(report.at("spectrum").at("by_kind").at("map").at("directions"), 4);
  EXPECT_EQ(report.at("part_mixtures").at("pairs").at(0).at("rows").size(), 5u);
  EXPECT_NE(run.out.find("map alone, rank 1"), std::string::npos) << run.out;
  EXPECT_NE(run.out.find("upper_body"), std::string::npos) << run.out;
  for (const char* picture : {"parts.jpg", "busts.jpg", "wall.jpg"})
    EXPECT_TRUE(is_jpeg(folder, picture)) << picture;
}

TEST(EvaluateMembers, AHeldOutTwinIsInTheSpan) {
  const TestFolder folder;
  tests::write_test_packages(folder);
  write_people(folder, "six.fgn", {.twin = true});
  ASSERT_EQ(members(folder, "six.fgn --body body.fgn --motion motion.fgn").exit_code, 0);
  const nlohmann::json report = report_of(folder);
  for (const nlohmann::json& member : report.at("distances").at("members")) {
    if (member.at("name") != "person5") continue;
    EXPECT_EQ(member.at("weights").at("nearest"), "person0");
    EXPECT_NEAR(member.at("weights").at("rms").get<double>(), 0, 1e-6);
    EXPECT_TRUE(member.at("pictures").at("psnr_db").is_null()) << "no difference at all";
  }
  // The other held-out member is a stranger, so only the spread between the two tells.
  const nlohmann::json& last = report.at("span").at("per_layer").back();
  EXPECT_EQ(last.at("worst_member"), "person4");
  EXPECT_GT(last.at("variance_kept").get<double>(),
            report.at("span").at("per_layer").front().at("variance_kept").get<double>());
}

TEST(EvaluateMembers, WithoutHeldOutMembersThereIsNoSpan) {
  const TestFolder folder;
  tests::write_test_packages(folder);
  write_people(folder, "four.fgn", {.held_out = false});
  ASSERT_EQ(members(folder, "four.fgn --body body.fgn").exit_code, 0);
  const nlohmann::json report = report_of(folder);
  EXPECT_TRUE(report.at("span").is_null());
  EXPECT_TRUE(report.at("span_db").is_null());
  EXPECT_TRUE(report.at("quality").at("test").is_null());
  EXPECT_TRUE(report.at("distances").at("weights").at("test_nearest_quantiles").is_null());
}

TEST(EvaluateMembers, BadInputGivesOneLineAndNothingElse) {
  const TestFolder folder;
  tests::write_test_packages(folder);
  write_people(folder, "six.fgn", {});
  const std::vector<std::string> before = folder.names();
  for (const auto& [arguments, wanted] :
       {std::pair{"none.fgn --body body.fgn", "none.fgn"},
        {"avatar.fgn --body body.fgn", "is a package of kind avatar, not population"},
        {"six.fgn --body avatar.fgn", "is a package of kind avatar, not body"},
        {"six.fgn --body other_body.fgn", "does not fit the body: made for "},
        {"people.fgn --body body.fgn", "has 2 training members, at least 3 are needed"},
        {"six.fgn --body body.fgn --motion body.fgn", "is a package of kind body, not motion"},
        {"six.fgn --body body.fgn --wall wall.png", "--wall: 'wall.png' must end in .jpg"},
        {"six.fgn --body body.fgn --bust-wall busts.png", "--bust-wall: 'busts.png' must end in"},
        {"six.fgn --body body.fgn --bust-wall busts.jpg",
         "--bust-wall: body 'jointed cylinder': has no texel that a joint called head"},
        {"six.fgn --body body.fgn --part-mixtures parts.jpg",
         "--part-mixtures: population 'people': its members have no static values"}}) {
    const ProgramRun run = members(folder, arguments);
    EXPECT_EQ(run.exit_code, 1) << arguments;
    EXPECT_EQ(run.error_lines(), 1u) << run.err;
    EXPECT_NE(run.err.find(wanted), std::string::npos) << run.err;
    EXPECT_EQ(folder.names(), before) << arguments;
  }
  EXPECT_EQ(members(folder, "six.fgn --body body.fgn --ranks 0").exit_code, 2);
}

}  // namespace
}  // namespace figurine::cli::evaluate_members_test
