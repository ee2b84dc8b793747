// figurine-train motion on .glb clips, the way a user runs it: the emotes become packages that say
// where they are from; bad files leave nothing.
#include <cstdlib>

#include "figurine/package.h"
#include "formats/writer/package_writer.h"
#include "gtest/gtest.h"
#include "ports/host/files.h"
#include "ports/motion/glb_builder.h"
#include "samples/program.h"
#include "toolchain/body/mannequin.h"
#include "toolchain/body/texel_body.h"

namespace figurine::cli::motion_test {
namespace {

using tests::ProgramRun;
using tests::TestFolder;

void write_body(const TestFolder& folder) {
  const body::TexelBody body = body::make_texel_body(body::make_mannequin(), 32);
  const auto bytes = write_package(body.view(), Provenance{});
  ASSERT_TRUE(bytes.ok()) << bytes.status().message();
  ASSERT_TRUE(ports::write_file_atomically(folder.path("body.fgn"), *bytes).ok());
}

ProgramRun motion(const TestFolder& folder, const std::string& arguments) {
  return tests::run_shell(FIGURINE_TRAIN " motion " + arguments + " --body body.fgn -o motion.fgn",
                          folder);
}

std::string emote(const std::string& name) {
  const char* folder = std::getenv("FIGURINE_EMOTES");
  return std::string(folder == nullptr ? "FIGURINE_EMOTES is not set: run this through scripts/run"
                                       : folder) +
         "/" + name;
}

TEST(MotionCommand, AnEmoteBecomesAPackageThatSaysWhereItIsFrom) {
  const TestFolder folder;
  write_body(folder);
  const ProgramRun run = motion(folder, "'" + emote("walk.glb") + "' --fps 24");
  ASSERT_EQ(run.exit_code, 0) << run.err;
  EXPECT_NE(run.err.find("25 frames at 24 a second"), std::string::npos) << run.err;
  const auto file = ports::MappedFile::open(folder.path("motion.fgn"));
  ASSERT_TRUE(file.ok());
  const auto package = Package::open(file->bytes(), "motion.fgn");
  ASSERT_TRUE(package.ok()) << package.status().message();
  EXPECT_EQ(package->motion().name, "walk");
  ASSERT_EQ(package->provenance().sources.size(), 1u);
  EXPECT_EQ(
      package->provenance().sources[0],
      "walk.glb: emotes/walk.glb of the npm package @dcl/wearable-preview 1.28.1, Apache-2.0");
}

TEST(MotionCommand, BadFilesGiveOneLineAndNothingElse) {
  const TestFolder folder;
  write_body(folder);
  ports::tests::GlbBuilder still;
  still.node("Avatar_Hips", -1);
  still.json.erase("animations");
  ports::tests::GlbBuilder strange;
  strange.track(strange.node("tail", -1), "translation", "LINEAR", {0, 1}, {0, 0, 0, 1, 1, 1});
  const auto bytes = ports::MappedFile::open(emote("walk.glb"));
  ASSERT_TRUE(bytes.ok()) << bytes.status().message();
  const std::string whole(reinterpret_cast<const char*>(bytes->bytes().data()),
                          bytes->bytes().size());
  folder.write("empty.glb", "");
  folder.write("half.glb", whole.substr(0, whole.size() / 2));
  folder.write("text.glb", "HIERARCHY ROOT Hips");
  folder.write("still.glb", still.file());
  folder.write("strange.glb", strange.file());
  folder.write("walk.glb", whole);
  folder.write("walk.fbx", whole);
  const std::vector<std::string> before = folder.names();
  for (const auto& [arguments, wanted] :
       {std::pair{"none.glb", "none.glb"},
        {"empty.glb", "empty.glb: header: the file ends early"},
        {"half.glb", "half.glb: header: length: "},
        {"text.glb", "text.glb: header: magic: not a glTF file"},
        {"still.glb", "still.glb: animations: there are none"},
        {"strange.glb", "strange.glb: no joint has a known name"},
        {"walk.fbx", "walk.fbx: unsupported: a motion is a .bvh, .npz, .glb, .gltf"},
        {"walk.glb --animation 1", "walk.glb: animations: no number 1: there are 1"},
        {"walk.glb --start 500", "walk.glb: start 500: the clip has 32 frames"}}) {
    const ProgramRun run = motion(folder, arguments);
    EXPECT_EQ(run.exit_code, 1) << arguments;
    EXPECT_EQ(run.error_lines(), 1u) << run.err;
    EXPECT_NE(run.err.find(wanted), std::string::npos) << run.err;
    EXPECT_EQ(folder.names(), before) << arguments;
  }
  EXPECT_EQ(motion(folder, "walk.glb --neutral upright").exit_code, 2);
}

}  // namespace
}  // namespace figurine::cli::motion_test
