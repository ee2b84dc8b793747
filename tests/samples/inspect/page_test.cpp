// figurine-inspect --html: the page holds what --json says, whatever texts a package has, and is
// there whole or not at all.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <set>

#include "formats/package_samples.h"
#include "ports/media/png.h"
#include "samples/common/html_page.h"
#include "samples/program.h"

namespace figurine::tests::page_test {
namespace {

using Json = nlohmann::ordered_json;

const std::string kGolden = FIGURINE_SOURCE_DIR "/tests/golden/packages/",
                  kShipped = FIGURINE_SOURCE_DIR "/samples/";

ProgramRun inspect(const TestFolder& folder, const std::string& arguments) {
  return run_shell("'" FIGURINE_INSPECT "' " + arguments, folder);
}

size_t count(const std::string& text, const std::string& part) {
  size_t found = 0;
  for (size_t at = 0; (at = text.find(part, at)) != std::string::npos; at += part.size()) ++found;
  return found;
}

// A page's tags open and close each other, its links lead to places on it, and it takes nothing
// from elsewhere and runs nothing.
void expect_sound_page(const std::string& page) {
  std::vector<std::string> open;
  std::set<std::string> ids, links;
  for (size_t at = page.find('<'); at != std::string::npos; at = page.find('<', at + 1)) {
    const size_t end = page.find('>', at);
    ASSERT_NE(end, std::string::npos) << page.substr(at, 80);
    const std::string tag = page.substr(at + 1, end - at - 1);
    const std::string name = tag.substr(0, tag.find(' '));
    for (const auto& [attribute, into] : {std::pair(" id=\"", &ids), {" href=\"#", &links}}) {
      const size_t from = tag.find(attribute);
      if (from == std::string::npos) continue;
      const size_t value = from + std::string(attribute).size();
      into->insert(tag.substr(value, tag.find('"', value) - value));
    }
    EXPECT_EQ(tag.find(" on"), std::string::npos) << tag.substr(0, 80);
    EXPECT_TRUE(tag.find("href=") == std::string::npos || tag.find("href=\"#") != std::string::npos)
        << tag.substr(0, 80);
    EXPECT_TRUE(tag.find("src=") == std::string::npos ||
                tag.find("src=\"data:image/png;base64,") != std::string::npos)
        << tag.substr(0, 80);
    if (name == "!doctype" || name == "meta" || name == "img") continue;
    static const std::set<std::string> kKnown = {
        "html", "head", "title", "style",  "body",       "h1",      "h2",     "p", "dl",
        "div",  "dt",   "dd",    "table",  "tr",         "th",      "td",     "i", "ul",
        "li",   "nav",  "a",     "figure", "figcaption", "details", "summary"};
    if (name.starts_with("/")) {
      ASSERT_FALSE(open.empty()) << name;
      EXPECT_EQ("/" + open.back(), name);
      open.pop_back();
      continue;
    }
    EXPECT_TRUE(kKnown.contains(name)) << "<" << name << ">";
    open.push_back(name);
    if (name == "style") at = page.find("</style>", at) - 1;
  }
  EXPECT_TRUE(open.empty());
  EXPECT_EQ(links, ids);
  EXPECT_FALSE(links.empty());
}

TEST(InspectPage, HoldsWhatTheJsonSaysOfEveryKind) {
  const TestFolder folder;
  for (const std::string kind :
       {"body", "avatar", "fixed_point_avatar", "static_avatar", "static_only_avatar",
        "filtered_avatar", "motion", "population", "half_population", "static_population",
        "sampler", "static_sampler"}) {
    const std::string package = "'" + kGolden + kind + "_v1.fgn'";
    const ProgramRun made = inspect(folder, package + " --html " + kind);
    ASSERT_EQ(made.exit_code, 0) << made.err;
    EXPECT_EQ(made.out, "");
    EXPECT_EQ(made.error_lines(), 1u) << made.err;
    const std::string page = folder.read(kind + "/index.html");
    expect_sound_page(page);
    const Json json = Json::parse(inspect(folder, package + " --json").out);
    const Json leaves = json.flatten();
    size_t figures = 0;
    for (const auto& [name, value] : leaves.items()) {
      const std::string text = value.is_string() ? value.get<std::string>() : value.dump();
      EXPECT_NE(page.find("<td>" + samples::escape_html(name) + "</td><td>" +
                          samples::escape_html(text) + "</td>"),
                std::string::npos)
          << kind << name << " " << text;
      ++figures;
    }
    EXPECT_GT(figures, 30u);
    for (const auto& [part, bytes] : json["parts"].items()) {
      EXPECT_NE(page.find("<td>" + part + "</td><td>" + bytes.dump() + "</td>"), std::string::npos)
          << kind << part;
    }
  }
}

TEST(InspectPage, HostileTextsAreTexts) {
  const TestFolder folder;
  const std::string hostile =
      "</title></style><script>alert(1)</script><img src=x onerror='alert(2)'>\"& \xe2\x80\xae";
  samples::AvatarSample sample;
  sample.avatar.name = hostile;
  sample.avatar.preset = hostile;
  Provenance provenance = samples::make_provenance();
  provenance.tool = hostile;
  provenance.licence_url = "javascript:alert(3)";
  provenance.sources.push_back(hostile);
  provenance.settings.push_back({hostile, hostile});
  provenance.quality.push_back({hostile, 1.5f});
  const auto bytes = write_package(sample.avatar, sample.budget, provenance);
  ASSERT_TRUE(bytes.ok()) << bytes.status().message();
  const std::string name = "<b>&\"'.fgn";
  folder.write(name, std::string(reinterpret_cast<const char*>(bytes->data()), bytes->size()));
  const ProgramRun made = inspect(folder, "\"<b>&\\\"'.fgn\" --html page");
  ASSERT_EQ(made.exit_code, 0) << made.err;
  const std::string page = folder.read("page/index.html");
  expect_sound_page(page);
  EXPECT_EQ(page.find("<script"), std::string::npos);
  EXPECT_EQ(page.find("<b>"), std::string::npos);
  EXPECT_NE(page.find("&lt;script&gt;alert(1)&lt;/script&gt;"), std::string::npos);
  EXPECT_EQ(page.find("href=\"javascript"), std::string::npos);

  samples::SamplerSample sampler;
  sampler.sampler.report = R"({"</td><script>": "\u0000\u009b<script>", "a": ["<i>", 1e400]})";
  const auto written = sampler.write();
  ASSERT_TRUE(written.ok()) << written.status().message();
  folder.write("s.fgn",
               std::string(reinterpret_cast<const char*>(written->data()), written->size()));
  ASSERT_EQ(inspect(folder, "s.fgn --html s").exit_code, 0);
  expect_sound_page(folder.read("s/index.html"));
}

TEST(InspectPage, EscapesWhatIsNoText) {
  EXPECT_EQ(samples::escape_html("a<b>&\"'"), "a&lt;b&gt;&amp;&quot;&#39;");
  EXPECT_EQ(samples::escape_html("gr\xc3\xbc\xc3\x9f \xf0\x9f\x99\x82"),
            "gr\xc3\xbc\xc3\x9f \xf0\x9f\x99\x82");
  const std::string none = "\xEF\xBF\xBD";
  for (const std::string& broken :
       {std::string("\x80"), std::string("\xff"), std::string("\x1b"), std::string("\x7f"),
        std::string(1, '\0'), std::string("\xc2\x9b")})
    EXPECT_EQ(samples::escape_html(broken), none) << broken;
  EXPECT_EQ(samples::escape_html("\xc0\xbc"), none + none) << "an overlong <";
  EXPECT_EQ(samples::escape_html("\xed\xa0\x80").find("\xed"), std::string::npos) << "a surrogate";
  EXPECT_EQ(samples::escape_html("\xe2\x82"), none + none) << "cut short";
}

TEST(InspectPage, IsThereWholeOrNotAtAll) {
  const TestFolder folder;
  std::string bytes;
  {
    const auto sound = samples::AvatarSample().write();
    ASSERT_TRUE(sound.ok());
    bytes.assign(reinterpret_cast<const char*>(sound->data()), sound->size());
  }
  folder.write("sound.fgn", bytes);
  bytes[bytes.size() / 2] ^= 4;
  folder.write("broken.fgn", bytes);
  folder.write("taken", "a file");
  const auto expect_refused = [&](const std::string& arguments, int exit_code,
                                  const std::string& words) {
    const std::vector<std::string> before = folder.names();
    const ProgramRun run = inspect(folder, arguments);
    EXPECT_EQ(run.exit_code, exit_code) << arguments;
    EXPECT_EQ(run.error_lines(), 1u) << run.err;
    EXPECT_NE(run.err.find(words), std::string::npos) << run.err;
    EXPECT_EQ(run.out, "");
    EXPECT_EQ(folder.names(), before) << arguments;
  };
  expect_refused("broken.fgn --html page", 1, "checksum does not match");
  expect_refused("none.fgn --html page", 1, "none.fgn");
  expect_refused("sound.fgn --html taken", 1, "taken");
  expect_refused("sound.fgn --html page --tensors", 2, "--tensors");
  expect_refused("sound.fgn --html page --diff sound.fgn", 2, "--diff");
  expect_refused("sound.fgn --body body.fgn", 2, "--html");
  expect_refused("'" FIGURINE_SOURCE_DIR "/tests/data/gaussians/scene.splat' --html page", 1,
                 "--html are for packages");
  const ProgramRun full =
      run_shell("ulimit -f 1; '" FIGURINE_INSPECT "' sound.fgn --html page", folder);
  EXPECT_EQ(full.exit_code, 1);
  EXPECT_EQ(full.error_lines(), 1u) << full.err;
  EXPECT_FALSE(folder.has("page"));

  ASSERT_EQ(inspect(folder, "sound.fgn --html page").exit_code, 0);
  folder.write("page/notes.txt", "mine");
  const std::string before = folder.read("page/index.html");
  EXPECT_EQ(
      run_shell("ulimit -f 1; '" FIGURINE_INSPECT "' sound.fgn --html page", folder).exit_code, 1);
  EXPECT_EQ(folder.read("page/index.html"), before);
  EXPECT_EQ(folder.read("page/notes.txt"), "mine");
  ASSERT_EQ(inspect(folder, "sound.fgn --html page --json").exit_code, 0);
  EXPECT_EQ(folder.read("page/notes.txt"), "mine");
}

// Decoded, and more than one colour in each.
void expect_pictures(const std::string& page, size_t wanted) {
  const std::string start = "src=\"data:image/png;base64,";
  ASSERT_EQ(count(page, start), wanted);
  std::set<std::string> different;
  for (size_t at = page.find(start); at != std::string::npos; at = page.find(start, at + 1)) {
    std::vector<std::byte> bytes;
    uint32_t bits = 0, held = 0;
    size_t i = at + start.size();
    for (; page[i] != '"' && page[i] != '='; ++i) {
      const char c = page[i];
      const int digit = c >= 'A' && c <= 'Z'   ? c - 'A'
                        : c >= 'a' && c <= 'z' ? c - 'a' + 26
                        : c >= '0' && c <= '9' ? c - '0' + 52
                        : c == '+'             ? 62
                                               : 63;
      bits = bits << 6 | static_cast<uint32_t>(digit), held += 6;
      if (held >= 8) held -= 8, bytes.push_back(static_cast<std::byte>(bits >> held & 255));
    }
    different.insert(page.substr(at, i - at));
    const Result<ports::ImageU8> image = ports::decode_png(bytes, "a picture");
    ASSERT_TRUE(image.ok()) << image.status().message();
    size_t changes = 0;
    for (size_t p = image->channels; p < image->pixels.size(); ++p)
      changes += image->pixels[p] != image->pixels[p - image->channels];
    EXPECT_GT(changes, image->pixels.size() / 100);
  }
  EXPECT_GT(different.size(), wanted / 2);
}

TEST(InspectPage, DrawsWhatThePackagesHold) {
  const TestFolder folder;
  const std::string body = kShipped + "packages/body-64.fgn";
  for (const auto& [arguments, pictures, words] :
       std::vector<std::tuple<std::string, size_t, std::string>>{
           {kShipped + "packages/person-coarse.fgn", 0,
            "its hash is the package&#39;s, to the bit"},
           {body, 3, "from behind"},
           {kShipped + "packages/walk.fgn", 0, "named with --body"},
           {kShipped + "packages/walk.fgn --body " + body, 11, "frame 0, 0.00 s"},
           {kShipped + "populations/nano.fgn", 24, "evenly chosen"},
           {kShipped + "samplers/edge.fgn", 12, "seed 11"}}) {
    const ProgramRun made = inspect(folder, arguments + " --html page");
    ASSERT_EQ(made.exit_code, 0) << made.err;
    const std::string page = folder.read("page/index.html");
    expect_sound_page(page);
    EXPECT_NE(page.find(words), std::string::npos) << arguments;
    EXPECT_EQ(page.find("Not drawn"), std::string::npos)
        << page.substr(page.find("Not drawn"), 300);
    if (pictures > 0) expect_pictures(page, pictures);
  }
  // Without its body a package is sound, and its page says what is missing.
  folder.write("alone.fgn", [] {
    const auto sound = samples::AvatarSample().write();
    return std::string(reinterpret_cast<const char*>(sound->data()), sound->size());
  }());
  const ProgramRun alone = inspect(folder, "alone.fgn --html alone");
  EXPECT_EQ(alone.exit_code, 0) << alone.err;
  for (const char* words : {"This device did not draw it: ", "body: needs ",
                            "Not shown: the package&#39;s picture: png: "})
    EXPECT_NE(folder.read("alone/index.html").find(words), std::string::npos) << words;
}

}  // namespace
}  // namespace figurine::tests::page_test
