// The C interface: the same pixels as the C++ one, and every refusal by code and message. Handles
// of what was removed, of another kind or in use are refused, never followed.
#include "figurine.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstddef>
#include <cstring>
#include <fstream>
#include <iterator>
#include <string>
#include <thread>
#include <vector>

#include "figurine/avatar_sampler.h"
#include "figurine/renderer.h"
#include "formats/writer/population_writer.h"
#include "runtime/test_packages.h"

extern "C" {
int count_unsound_defaults(void);
fig_status open_nothing(void);
}

namespace figurine::tests {
namespace {

constexpr uint32_t kWidth = 48, kHeight = 40;

#define EXPECT_OK(call) EXPECT_EQ(call, FIG_OK) << fig_last_message()
// The code, and a part of the message, which is one line.
#define EXPECT_REFUSED(call, code, words)                                                       \
  do {                                                                                          \
    EXPECT_EQ(call, code);                                                                      \
    const std::string message = fig_last_message();                                             \
    EXPECT_NE(message.find(words), std::string::npos) << "'" << message << "' lacks " << words; \
    EXPECT_EQ(message.find('\n'), std::string::npos) << message;                                \
  } while (false)

fig_package open_bytes(std::span<const std::byte> bytes, const char* name = "test") {
  fig_package_options options = fig_default_package_options();
  options.name = name;
  fig_package package{};
  EXPECT_OK(fig_package_open(bytes.data(), bytes.size(), &options, &package));
  return package;
}

fig_pose c_pose(const SyntheticPose& pose) {
  fig_pose out = fig_default_pose();
  std::copy(pose.root_translation_m.begin(), pose.root_translation_m.end(), out.root_translation_m);
  out.rotations = pose.rotations.data();
  out.joint_count = static_cast<uint32_t>(pose.rotations.size() / 4);
  return out;
}

AlignedBytes read_sample(const std::string& name) {
  std::ifstream file(FIGURINE_SOURCE_DIR "/samples/" + name, std::ios::binary);
  const std::vector<char> bytes{std::istreambuf_iterator<char>(file), {}};
  return AlignedBytes(std::as_bytes(std::span(bytes)));
}

// A body, an avatar of it, a renderer that shows it from the front, and the same in C++.
class CApi : public testing::Test {
 protected:
  void SetUp() override {
    body = open_bytes(test_body.bytes.bytes(), "body");
    avatar = open_bytes(test_avatar.bytes.bytes(), "avatar");
    EXPECT_OK(fig_renderer_create(nullptr, &renderer));
    EXPECT_OK(fig_renderer_add_avatar(renderer, avatar, 0, body, nullptr, &person));
    pose = c_pose(test_pose);
    const Camera from = make_test_camera(kWidth, kHeight);
    camera = fig_default_camera();
    camera.width_px = from.width_px, camera.height_px = from.height_px;
    camera.fx_px = from.fx_px, camera.fy_px = from.fy_px;
    camera.cx_px = from.cx_px, camera.cy_px = from.cy_px;
    std::copy(from.view_from_world.begin(), from.view_from_world.end(), camera.view_from_world);
    camera.near_m = from.near_m;
    seen = fig_default_frame_avatar();
    seen.avatar = person, seen.pose = &pose;
    frame = fig_default_frame();
    frame.camera = &camera, frame.avatars = &seen, frame.avatar_count = 1;
    image = fig_default_image();
    image.pixels = pixels.data(), image.stride_bytes = kWidth * 4;
  }
  void TearDown() override {
    static_cast<void>(fig_renderer_destroy(renderer));
    EXPECT_OK(fig_package_close(avatar));
    EXPECT_OK(fig_package_close(body));
  }

  std::vector<uint8_t> render_in_cpp(std::span<const GaussianView> gaussians = {}) const {
    const std::unique_ptr<Renderer> cpp = std::move(Renderer::create({})).value();
    const FrameAvatar shown[] = {
        {.avatar = *cpp->add_avatar(*test_avatar.package, *test_body.package),
         .pose = test_pose.view()}};
    std::vector<uint8_t> out(size_t{4} * kWidth * kHeight);
    EXPECT_TRUE(cpp->render({.camera = make_test_camera(kWidth, kHeight),
                             .avatars = shown,
                             .gaussians = gaussians},
                            {.pixels = out.data(), .stride_bytes = kWidth * 4})
                    .ok());
    return out;
  }

  fig_status render() { return fig_renderer_render(renderer, &frame, &image); }

  const SyntheticBody test_body = make_test_body();
  const SyntheticAvatar test_avatar = make_test_avatar(test_body);
  const SyntheticPose test_pose = make_test_pose(test_body.body(), 1);
  fig_package body{}, avatar{};
  fig_renderer renderer{};
  fig_avatar person{};
  fig_pose pose{};
  fig_camera camera{};
  fig_frame_avatar seen{};
  fig_frame frame{};
  fig_image image{};
  std::vector<uint8_t> pixels = std::vector<uint8_t>(size_t{4} * kWidth * kHeight, 77);
};

TEST(CLibrary, StructsBeginWithTheirSize) { EXPECT_EQ(count_unsound_defaults(), 0); }

TEST(CLibrary, SaysItsVersionAndNames) {
  EXPECT_EQ(std::string(fig_version()), std::to_string(FIG_VERSION_MAJOR) + "." +
                                            std::to_string(FIG_VERSION_MINOR) + "." +
                                            std::to_string(FIG_VERSION_PATCH));
  EXPECT_STREQ(fig_network_library(), network_library());
  EXPECT_STREQ(fig_status_name(FIG_CORRUPT), "corrupt");
  EXPECT_STREQ(fig_status_name(static_cast<fig_status>(10)), "unknown status");
  EXPECT_STREQ(fig_isa_name(FIG_ISA_BEST), "best");
  EXPECT_STREQ(fig_isa_name(FIG_ISA_AVX2), "avx2");
  EXPECT_STREQ(fig_isa_name(static_cast<fig_isa>(6)), "unknown instruction set");
  EXPECT_EQ(fig_isa_supported(FIG_ISA_BEST), 1);
  EXPECT_EQ(fig_isa_supported(FIG_ISA_BASELINE), 1);
  EXPECT_EQ(fig_isa_supported(static_cast<fig_isa>(6)), 0);
}

TEST(CLibrary, AMessageIsItsThreadsOwn) {
  std::thread([] { EXPECT_STREQ(fig_last_message(), ""); }).join();
  EXPECT_REFUSED(open_nothing(), FIG_CORRUPT, "four zeros: ");
  std::thread([] { EXPECT_STREQ(fig_last_message(), ""); }).join();
  fig_package_options options = fig_default_package_options();
  options.name = "two\nlines";
  options.copy = 1;
  fig_package package;
  EXPECT_REFUSED(fig_package_open("", 1, &options, &package), FIG_CORRUPT, "two lines: ");
  const std::string long_name(5000, 'x');
  options.name = long_name.c_str();
  EXPECT_REFUSED(fig_package_open("", 1, &options, &package), FIG_CORRUPT, "xxx");
}

TEST(CLibrary, TheCheckHandlerHearsOfABrokenContract) {
  EXPECT_EXIT(
      {
        fig_set_check_handler(
            [](const char* message, void*) {
              std::_Exit(std::strstr(message, "an avatar that is there") != nullptr ? 42 : 43);
            },
            nullptr);
        static_cast<void>((*Renderer::create({}))->precision(AvatarId(5)));
      },
      testing::ExitedWithCode(42), "");
}

TEST_F(CApi, DrawsTheSamePixelsAsCpp) {
  const float position[] = {0, 0.8f, 0.5f, 0.2f, 0.7f, 0.5f}, opacity[] = {0.7f, 0.9f},
              factor[] = {0.05f, 0, 0, 0, 0.05f, 0, 0, 0, 0.05f,
                          0.03f, 0, 0, 0, 0.09f, 0, 0, 0, 0.01f},
              sh[] = {1, 0, 0, 0, 1, 0};
  const GaussianView view{.count = 2,
                          .sh_degree = 0,
                          .position_m = position,
                          .covariance_factor = factor,
                          .opacity = opacity,
                          .sh = sh};
  fig_gaussians gaussians = fig_default_gaussians();
  gaussians.count = 2;
  gaussians.position_m = position, gaussians.covariance_factor = factor;
  gaussians.opacity = opacity, gaussians.sh = sh;

  ASSERT_EQ(render(), FIG_OK) << fig_last_message();
  EXPECT_EQ(pixels, render_in_cpp());
  frame.gaussians = &gaussians, frame.gaussians_count = 1;
  ASSERT_EQ(render(), FIG_OK) << fig_last_message();
  EXPECT_EQ(pixels, render_in_cpp({&view, 1}));
  EXPECT_NE(pixels, render_in_cpp());
}

TEST_F(CApi, SwitchesAndFormatsArriveWhereTheyBelong) {
  uint64_t now = 0;
  fig_renderer_options options = fig_default_renderer_options();
  options.now_ns = [](void* user) { return *static_cast<uint64_t*>(user) += 10; };
  options.now_user = &now;
  options.isa = FIG_ISA_BASELINE;
  fig_renderer timed{};
  ASSERT_EQ(fig_renderer_create(&options, &timed), FIG_OK) << fig_last_message();
  ASSERT_EQ(fig_renderer_add_avatar(timed, avatar, 0, body, nullptr, &seen.avatar), FIG_OK);

  camera.cx_px -= 27;  // a part of the person is outside the image
  const auto counts = [&] {
    EXPECT_OK(fig_renderer_render(timed, &frame, &image));
    fig_statistics statistics = fig_default_statistics();
    EXPECT_OK(fig_renderer_statistics(timed, &statistics));
    return statistics;
  };
  const fig_statistics all = counts();
  const std::vector<uint8_t> picture = pixels;
  EXPECT_EQ(all.gaussians, test_body.body().texel_count());
  EXPECT_GT(all.macs, 0u);
  EXPECT_GT(all.outside, 0u);
  for (const uint64_t ns : {all.maps_ns, all.network_ns, all.decode_ns, all.skin_ns, all.project_ns,
                            all.bin_ns, all.sort_ns, all.blend_ns, all.resolve_ns})
    EXPECT_GT(ns, 0u);
  frame.leave_out = FIG_LEAVE_OUT_ALL & ~FIG_LEAVE_OUT_OUTSIDE;
  EXPECT_EQ(counts().outside, 0u);
  EXPECT_EQ(pixels, picture);
  frame.leave_out = 0;
  const fig_statistics none = counts();
  EXPECT_EQ(none.hidden_texels + none.transparent + none.outside + none.missed_tiles + none.stopped,
            0u);
  EXPECT_EQ(pixels, picture);

  const float background[] = {1, 0, 0};
  frame.background = background;
  EXPECT_OK(fig_renderer_render(timed, &frame, &image));
  const std::vector<uint8_t> red = pixels;
  EXPECT_NE(red, picture);
  image.format = FIG_PIXEL_BGRA8;
  EXPECT_OK(fig_renderer_render(timed, &frame, &image));
  for (size_t i = 0; i < red.size(); i += 4) {
    ASSERT_EQ(pixels[i], red[i + 2]);
    ASSERT_EQ(pixels[i + 1], red[i + 1]);
  }
  image.format = FIG_PIXEL_RGBA8;
  frame.antialiased = FIG_ANTIALIASED_OFF;
  EXPECT_OK(fig_renderer_render(timed, &frame, &image));
  EXPECT_EQ(pixels, red) << "as the avatar was trained";
  frame.antialiased = FIG_ANTIALIASED_ON;
  EXPECT_OK(fig_renderer_render(timed, &frame, &image));
  EXPECT_NE(pixels, red);
  frame.antialiased = FIG_ANTIALIASED_AS_TRAINED;
  frame.fast_blend = 1, frame.network_below_px = 1;  // no figure is that small
  EXPECT_OK(fig_renderer_render(timed, &frame, &image));
  int largest = 0;
  for (size_t i = 0; i < red.size(); ++i)
    largest = std::max(largest, std::abs(int{pixels[i]} - int{red[i]}));
  EXPECT_LE(largest, 8) << "near the exact picture";
  frame.fast_blend = 0, frame.network_below_px = 0;
  frame.averted_above = 0;
  EXPECT_OK(fig_renderer_render(timed, &frame, &image));
  EXPECT_NE(pixels, red) << "what is thin shows its back";
  frame.averted_above = 1, frame.network_interval = 3, frame.sh_degree = 0;
  EXPECT_OK(fig_renderer_render(timed, &frame, &image));
  EXPECT_EQ(pixels, red) << "the first of three, and there is nothing above degree 0";
  frame.network_interval = 1, frame.sh_degree = 3;
  frame.alpha_cut = 0.4f;
  EXPECT_OK(fig_renderer_render(timed, &frame, &image));
  EXPECT_NE(pixels, red);

  std::vector<uint8_t> luma(size_t{kWidth} * kHeight), chroma(luma.size() / 2);
  image = fig_default_image();
  image.format = FIG_PIXEL_NV12;
  image.pixels = luma.data(), image.stride_bytes = kWidth;
  image.chroma = chroma.data(), image.chroma_stride_bytes = kWidth;
  EXPECT_OK(fig_renderer_render(timed, &frame, &image));
  EXPECT_GE(*std::min_element(luma.begin(), luma.end()), 16);
  const std::vector<uint8_t> of_709 = luma;
  image.matrix = FIG_MATRIX_BT601;
  EXPECT_OK(fig_renderer_render(timed, &frame, &image));
  EXPECT_NE(luma, of_709);
  EXPECT_OK(fig_renderer_destroy(timed));
}

TEST_F(CApi, PosesAnAvatarAsCppDoes) {
  fig_gaussians posed = fig_default_gaussians();
  ASSERT_EQ(fig_renderer_pose_avatar(renderer, person, &pose, &posed), FIG_OK);
  const std::unique_ptr<Renderer> cpp = std::move(Renderer::create({})).value();
  const AvatarId id = *cpp->add_avatar(*test_avatar.package, *test_body.package);
  const GaussianView view = *cpp->pose_avatar(id, test_pose.view());
  ASSERT_EQ(posed.count, view.count);
  EXPECT_TRUE(std::equal(view.position_m.begin(), view.position_m.end(), posed.position_m));
  EXPECT_TRUE(std::equal(view.sh.begin(), view.sh.end(), posed.sh));
}

TEST_F(CApi, DescribesPackages) {
  fig_package_info info = fig_default_package_info();
  ASSERT_EQ(fig_package_get_info(body, &info), FIG_OK);
  EXPECT_EQ(info.kind, FIG_PACKAGE_BODY);
  EXPECT_EQ(info.joint_count, test_body.body().joint_count());
  const std::array<uint64_t, 2> hash = test_body.package->content_hash();
  EXPECT_TRUE(std::equal(hash.begin(), hash.end(), info.content_hash));
  fig_package_info of_avatar = fig_default_package_info();
  ASSERT_EQ(fig_package_get_info(avatar, &of_avatar), FIG_OK);
  EXPECT_EQ(of_avatar.kind, FIG_PACKAGE_AVATAR);
  EXPECT_STREQ(of_avatar.name, "test avatar");
  EXPECT_TRUE(std::equal(hash.begin(), hash.end(), of_avatar.body_hash));
  EXPECT_EQ(of_avatar.holds_f32, 1);
  EXPECT_EQ(of_avatar.holds_q8, 0);
  fig_precision precision{};
  EXPECT_OK(fig_renderer_avatar_precision(renderer, person, &precision));
  EXPECT_EQ(precision, FIG_PRECISION_F32);

  fig_joint joint = fig_default_joint();
  ASSERT_EQ(fig_package_joint(body, 1, &joint), FIG_OK);
  EXPECT_EQ(joint.name, test_body.body().joint_names[1]);
  EXPECT_EQ(joint.parent, 0);
  EXPECT_EQ(joint.rest_position_m[1], test_body.body().joint_position_m[4]);
  EXPECT_REFUSED(fig_package_joint(body, 4, &joint), FIG_INVALID_ARGUMENT, "joint 4");
  EXPECT_REFUSED(fig_package_joint(avatar, 0, &joint), FIG_MISMATCH, "a body is wanted");

  fig_camera golden = fig_default_camera();
  fig_pose golden_pose = fig_default_pose();
  EXPECT_OK(fig_package_golden_view(avatar, 0, &golden, &golden_pose));
  EXPECT_EQ(golden.width_px, test_avatar.package->avatar().golden.camera.width_px);
  EXPECT_EQ(golden_pose.rotations, test_avatar.package->avatar().golden.rotations.data());
  EXPECT_REFUSED(fig_package_golden_view(avatar, 1, &golden, nullptr), FIG_INVALID_ARGUMENT,
                 "no population");
  EXPECT_REFUSED(fig_package_golden_view(body, 0, nullptr, nullptr), FIG_MISMATCH,
                 "has no golden view");
}

TEST_F(CApi, OrbitsAsCppDoes) {
  fig_orbit orbit = fig_default_orbit();
  orbit.azimuth_deg = 30, orbit.target_m[1] = 1;
  fig_camera made = fig_default_camera();
  ASSERT_EQ(fig_make_orbit_camera(&orbit, 64, 32, &made), FIG_OK);
  const Camera cpp = *make_orbit_camera({.azimuth_deg = 30, .target_m = {0, 1, 0}}, 64, 32);
  EXPECT_EQ(made.fx_px, cpp.fx_px);
  EXPECT_TRUE(
      std::equal(cpp.view_from_world.begin(), cpp.view_from_world.end(), made.view_from_world));
  EXPECT_OK(fig_make_orbit_camera(nullptr, 64, 32, &made));
  orbit.elevation_deg = 95;
  EXPECT_REFUSED(fig_make_orbit_camera(&orbit, 64, 32, &made), FIG_INVALID_ARGUMENT, "elevation");
}

TEST_F(CApi, PlaysAMotion) {
  const AlignedBytes bytes = read_sample("packages/walk.fgn");
  const fig_package motion = open_bytes(bytes.bytes());
  fig_package_info info = fig_default_package_info();
  ASSERT_EQ(fig_package_get_info(motion, &info), FIG_OK);
  EXPECT_EQ(info.kind, FIG_PACKAGE_MOTION);
  EXPECT_GT(info.frames_per_second, 0);
  fig_pose walking = fig_default_pose();
  ASSERT_EQ(fig_package_motion_pose(motion, info.frame_count - 1, &walking), FIG_OK);
  EXPECT_EQ(walking.joint_count, info.joint_count);
  EXPECT_REFUSED(fig_package_motion_pose(motion, info.frame_count, &walking), FIG_INVALID_ARGUMENT,
                 "frame ");
  EXPECT_REFUSED(fig_package_motion_pose(avatar, 0, &walking), FIG_MISMATCH, "a motion is wanted");
  seen.pose = &walking;
  EXPECT_REFUSED(render(), FIG_INVALID_ARGUMENT, "avatars[0]: ");  // another body's
  EXPECT_OK(fig_package_close(motion));
}

TEST_F(CApi, DrawsAMemberOfAPopulation) {
  const SyntheticAvatar initial = make_test_avatar(test_body, {.seed = 99}),
                        ada = make_test_avatar(test_body, {.seed = 5, .name = "ada"}),
                        bob = make_test_avatar(test_body, {.seed = 6, .name = "bob"});
  NewPopulation population{.name = "people", .initial = initial.package->avatar().network};
  for (const SyntheticAvatar* member : {&ada, &bob}) {
    population.members.push_back(
        {&member->package->avatar(), &member->package->provenance(), Split::kTrain});
  }
  const Result<std::vector<std::byte>> written = write_population(population);
  ASSERT_TRUE(written.ok()) << written.status().message();
  const AlignedBytes bytes(*written);
  const fig_package people = open_bytes(bytes.bytes(), "people");

  fig_package_info info = fig_default_package_info();
  ASSERT_EQ(fig_package_get_info(people, &info), FIG_OK);
  EXPECT_EQ(info.member_count, 2u);
  uint32_t found = 7;
  EXPECT_OK(fig_package_find_member(people, "bob", &found));
  EXPECT_EQ(found, 1u);
  const char* name = nullptr;
  EXPECT_OK(fig_package_member_name(people, found, &name));
  EXPECT_STREQ(name, "bob");
  EXPECT_REFUSED(fig_package_find_member(people, "eve", &found), FIG_NOT_FOUND, "'eve'");
  EXPECT_REFUSED(fig_package_member_name(people, 2, &name), FIG_NOT_FOUND, "member 2");
  EXPECT_REFUSED(fig_package_find_member(avatar, "bob", &found), FIG_MISMATCH, "population");

  fig_avatar member{};
  EXPECT_REFUSED(fig_renderer_add_avatar(renderer, people, 2, body, nullptr, &member),
                 FIG_NOT_FOUND, "member 2");
  EXPECT_EQ(member.id, 0u);
  ASSERT_EQ(fig_renderer_add_avatar(renderer, people, 1, body, nullptr, &member), FIG_OK);
  seen.avatar = member;
  ASSERT_EQ(render(), FIG_OK) << fig_last_message();

  const Result<Package> opened = Package::open(bytes.bytes(), "people");
  std::vector<float> storage(member_floats(opened->population()));
  const std::unique_ptr<Renderer> cpp = std::move(Renderer::create({})).value();
  const FrameAvatar shown[] = {
      {.avatar =
           *cpp->add_avatar(open_member(opened->population(), 1, storage), *test_body.package),
       .pose = test_pose.view()}};
  std::vector<uint8_t> expected(pixels.size());
  ASSERT_TRUE(cpp->render({.camera = make_test_camera(kWidth, kHeight), .avatars = shown},
                          {.pixels = expected.data(), .stride_bytes = kWidth * 4})
                  .ok());
  EXPECT_EQ(pixels, expected);

  EXPECT_REFUSED(fig_package_close(people), FIG_INVALID_ARGUMENT, "package: still in use");
  EXPECT_OK(fig_renderer_remove_avatar(renderer, member));
  EXPECT_OK(fig_package_close(people));
}

TEST_F(CApi, SamplesAnAvatarAndDrawsIt) {
  const AlignedBytes sampler_bytes = read_sample("samplers/edge.fgn"),
                     body_bytes = read_sample("populations/edge/body.fgn");
  const fig_package from = open_bytes(sampler_bytes.bytes(), "sampler"),
                    on = open_bytes(body_bytes.bytes(), "body");
  fig_sampler sampler{};
  EXPECT_REFUSED(fig_sampler_create(avatar, nullptr, &sampler), FIG_MISMATCH, "sampler is wanted");
  fig_sampler_options options = fig_default_sampler_options();
  options.isa = static_cast<fig_isa>(9);
  EXPECT_REFUSED(fig_sampler_create(from, &options, &sampler), FIG_INVALID_ARGUMENT, "isa");
  ASSERT_EQ(fig_sampler_create(from, nullptr, &sampler), FIG_OK) << fig_last_message();

  fig_sample_options wanted = fig_default_sample_options();
  wanted.seed = 7, wanted.steps = 2, wanted.solver = FIG_SOLVER_DDIM;
  fig_sampled sampled{};
  ASSERT_EQ(fig_sampler_sample(sampler, &wanted, &sampled), FIG_OK) << fig_last_message();
  fig_sampled_info info = fig_default_sampled_info();
  ASSERT_EQ(fig_sampled_get_info(sampled, &info), FIG_OK);

  const Result<Package> opened = Package::open(sampler_bytes.bytes(), "sampler");
  const auto cpp = std::move(AvatarSampler::create(opened->sampler())).value();
  SampledAvatar expected;
  ASSERT_TRUE(cpp->sample({.seed = 7, .steps = 2, .method = SolverMethod::kDdim}, expected).ok());
  const Avatar& same = expected.avatar();
  const std::array<uint64_t, 2> hash = hash_weights(same.fixed_point, same.shape, same.static_part);
  EXPECT_TRUE(std::equal(hash.begin(), hash.end(), info.weights_hash));
  ASSERT_EQ(info.shape_count, same.shape.size());
  EXPECT_TRUE(std::equal(same.shape.begin(), same.shape.end(), info.shape));

  fig_convolution last = fig_default_convolution();
  ASSERT_EQ(fig_sampled_convolution(sampled, info.convolution_count - 1, &last), FIG_OK);
  const Layer& layer = same.network.layers.back();
  EXPECT_EQ(last.out_channels, layer.out_channels);
  ASSERT_EQ(size_t{last.out_channels} * last.kernel * last.kernel * last.in_channels,
            layer.weights.size());
  EXPECT_TRUE(std::equal(layer.weights.begin(), layer.weights.end(), last.weights));
  const FixedPointConvolution& fixed = same.fixed_point.convolutions.back();
  EXPECT_TRUE(std::equal(fixed.weights.begin(), fixed.weights.end(), last.q8_weights));
  EXPECT_TRUE(std::equal(fixed.bias.begin(), fixed.bias.end(), last.q8_bias));
  EXPECT_REFUSED(fig_sampled_convolution(sampled, info.convolution_count, &last),
                 FIG_INVALID_ARGUMENT, "convolution ");

  wanted.mix = 2;
  fig_sampled none{};
  EXPECT_REFUSED(fig_sampler_sample(sampler, &wanted, &none), FIG_INVALID_ARGUMENT, "mix");
  wanted.mix = 0, wanted.solver = static_cast<fig_solver>(3);
  EXPECT_REFUSED(fig_sampler_sample(sampler, &wanted, &none), FIG_INVALID_ARGUMENT, "solver");

  fig_avatar member{};
  EXPECT_REFUSED(fig_renderer_add_sampled(renderer, sampled, body, nullptr, &member), FIG_MISMATCH,
                 "body");
  ASSERT_EQ(fig_renderer_add_sampled(renderer, sampled, on, nullptr, &member), FIG_OK)
      << fig_last_message();
  fig_precision precision{};
  EXPECT_OK(fig_renderer_avatar_precision(renderer, member, &precision));
  EXPECT_EQ(precision, FIG_PRECISION_Q8);
  fig_camera golden = fig_default_camera();
  fig_pose golden_pose = fig_default_pose();
  EXPECT_OK(fig_package_golden_view(from, 0, &golden, &golden_pose));
  std::vector<uint8_t> rgba(size_t{4} * golden.width_px * golden.height_px);
  seen.avatar = member, seen.pose = &golden_pose, frame.camera = &golden;
  image.pixels = rgba.data(), image.stride_bytes = size_t{4} * golden.width_px;
  ASSERT_EQ(render(), FIG_OK) << fig_last_message();
  EXPECT_GT(std::count(rgba.begin(), rgba.end(), 255), 100);

  // From the end of the chain: what is used stays.
  EXPECT_OK(fig_sampler_destroy(sampler));
  EXPECT_REFUSED(fig_package_close(from), FIG_INVALID_ARGUMENT, "package: still in use");
  EXPECT_REFUSED(fig_sampled_destroy(sampled), FIG_INVALID_ARGUMENT, "sampled avatar: still");
  EXPECT_OK(fig_renderer_remove_avatar(renderer, member));
  EXPECT_OK(fig_sampled_destroy(sampled));
  EXPECT_REFUSED(fig_sampled_get_info(sampled, &info), FIG_INVALID_ARGUMENT, "stale");
  EXPECT_REFUSED(fig_sampler_sample(sampler, nullptr, &sampled), FIG_INVALID_ARGUMENT, "stale");
  EXPECT_OK(fig_package_close(from));
  EXPECT_OK(fig_package_close(on));
}

TEST_F(CApi, KeepsACopyWhereTheBytesGo) {
  std::vector<char> bytes(test_avatar.bytes.bytes().size() + 1);  // not at a multiple of 64
  char* const place = bytes.data() + (reinterpret_cast<uintptr_t>(bytes.data()) % 64 == 0 ? 1 : 0);
  const size_t size = test_avatar.bytes.bytes().size();
  std::memcpy(place, test_avatar.bytes.bytes().data(), size);
  fig_package package{};
  EXPECT_REFUSED(fig_package_open(place, size, nullptr, &package), FIG_INVALID_ARGUMENT, "align");
  fig_package_options options = fig_default_package_options();
  options.copy = 1;
  ASSERT_EQ(fig_package_open(place, size, &options, &package), FIG_OK) << fig_last_message();
  std::fill(bytes.begin(), bytes.end(), '\0');
  fig_avatar copied{};
  ASSERT_EQ(fig_renderer_add_avatar(renderer, package, 0, body, nullptr, &copied), FIG_OK);
  seen.avatar = copied;
  ASSERT_EQ(render(), FIG_OK);
  EXPECT_EQ(pixels, render_in_cpp());
  EXPECT_OK(fig_renderer_remove_avatar(renderer, copied));
  EXPECT_OK(fig_package_close(package));
}

TEST_F(CApi, StaleHandlesAreRefused) {
  EXPECT_REFUSED(fig_package_close(avatar), FIG_INVALID_ARGUMENT, "package: still in use");
  EXPECT_REFUSED(fig_package_close(body), FIG_INVALID_ARGUMENT, "package: still in use");
  EXPECT_OK(fig_renderer_remove_avatar(renderer, person));
  EXPECT_REFUSED(render(), FIG_INVALID_ARGUMENT, "avatars[0]: avatar: a stale handle");
  EXPECT_REFUSED(fig_renderer_remove_avatar(renderer, person), FIG_INVALID_ARGUMENT, "stale");
  // What comes next takes the place, and the old handle still finds nothing.
  fig_avatar next{};
  ASSERT_EQ(fig_renderer_add_avatar(renderer, avatar, 0, body, nullptr, &next), FIG_OK);
  EXPECT_NE(next.id, person.id);
  EXPECT_REFUSED(render(), FIG_INVALID_ARGUMENT, "avatars[0]: avatar: a stale handle");
  EXPECT_OK(fig_renderer_destroy(renderer));
  fig_precision precision{};
  EXPECT_REFUSED(fig_renderer_avatar_precision(renderer, next, &precision), FIG_INVALID_ARGUMENT,
                 "renderer: a stale handle");
  fig_renderer other{};
  ASSERT_EQ(fig_renderer_create(nullptr, &other), FIG_OK);
  EXPECT_REFUSED(fig_renderer_remove_avatar(other, next), FIG_INVALID_ARGUMENT, "stale");
  EXPECT_REFUSED(render(), FIG_INVALID_ARGUMENT, "renderer: a stale handle");
  EXPECT_OK(fig_renderer_destroy(other));
}

TEST_F(CApi, HandlesOfAnotherKindOrOfNothingAreRefused) {
  fig_renderer_info info = fig_default_renderer_info();
  EXPECT_REFUSED(fig_renderer_get_info({body.id}, &info), FIG_INVALID_ARGUMENT,
                 "renderer: the handle is one of a package");
  EXPECT_REFUSED(fig_package_close({0}), FIG_INVALID_ARGUMENT, "the handle is zero");
  for (const uint64_t id : {uint64_t{1} << 32, uint64_t{5}, ~uint64_t{0},
                            body.id + (uint64_t{1} << 32), (uint64_t{1} << 32) | 0xffffff}) {
    EXPECT_REFUSED(fig_package_close({id}), FIG_INVALID_ARGUMENT, "never given out");
  }
  fig_renderer other{};
  ASSERT_EQ(fig_renderer_create(nullptr, &other), FIG_OK);
  EXPECT_REFUSED(fig_renderer_render(other, &frame, &image), FIG_INVALID_ARGUMENT,
                 "avatars[0]: avatar: the handle is one of another renderer's");
  EXPECT_OK(fig_renderer_get_info(renderer, &info));
  EXPECT_EQ(info.avatar_count, 1u);
  EXPECT_EQ(info.threads, 1u);
  EXPECT_NE(info.isa, FIG_ISA_BEST);
  EXPECT_GT(info.memory_bytes, 1000u);
  EXPECT_OK(fig_renderer_destroy(other));
}

TEST_F(CApi, NullIsRefused) {
  const auto refused = [](fig_status status) {
    EXPECT_EQ(status, FIG_INVALID_ARGUMENT);
    EXPECT_NE(std::string(fig_last_message()).find("is NULL"), std::string::npos)
        << fig_last_message();
  };
  fig_package package{};
  refused(fig_package_open(nullptr, 64, nullptr, &package));
  refused(fig_package_open("", 1, nullptr, nullptr));
  refused(fig_package_get_info(body, nullptr));
  refused(fig_package_joint(body, 0, nullptr));
  refused(fig_package_member_name(body, 0, nullptr));
  uint32_t member = 0;
  refused(fig_package_find_member(body, nullptr, &member));
  refused(fig_package_find_member(body, "x", nullptr));
  refused(fig_make_orbit_camera(nullptr, 4, 4, nullptr));
  refused(fig_package_motion_pose(body, 0, nullptr));
  refused(fig_threads_create(1, nullptr));
  refused(fig_renderer_create(nullptr, nullptr));
  refused(fig_renderer_add_avatar(renderer, avatar, 0, body, nullptr, nullptr));
  refused(fig_renderer_add_sampled(renderer, {0}, body, nullptr, nullptr));
  refused(fig_renderer_get_info(renderer, nullptr));
  refused(fig_renderer_avatar_precision(renderer, person, nullptr));
  refused(fig_renderer_render(renderer, nullptr, &image));
  refused(fig_renderer_render(renderer, &frame, nullptr));
  refused(fig_renderer_pose_avatar(renderer, person, &pose, nullptr));
  fig_gaussians out = fig_default_gaussians();
  refused(fig_renderer_pose_avatar(renderer, person, nullptr, &out));
  refused(fig_renderer_statistics(renderer, nullptr));
  refused(fig_sampler_create(body, nullptr, nullptr));
  refused(fig_sampler_sample({0}, nullptr, nullptr));
  refused(fig_sampled_get_info({0}, nullptr));
  refused(fig_sampled_convolution({0}, 0, nullptr));
  frame.camera = nullptr;
  refused(render());
  frame.camera = &camera, frame.avatars = nullptr;
  refused(render());
  frame.avatars = &seen, seen.pose = nullptr;
  refused(render());
  seen.pose = &pose, pose.rotations = nullptr;
  refused(render());
  pose.rotations = test_pose.rotations.data(), frame.gaussians_count = 1;
  refused(render());
  fig_gaussians gaussians = fig_default_gaussians();
  gaussians.count = 1;
  frame.gaussians = &gaussians;
  refused(render());
  gaussians.count = 0;
  EXPECT_OK(render());
}

TEST_F(CApi, StructsOfAnotherSizeAreRefused) {
  const auto both = [](size_t& struct_bytes, const auto& call) {
    const size_t sound = struct_bytes;
    for (const size_t less : {size_t{0}, sizeof(size_t), sound - 1}) {
      struct_bytes = less;
      EXPECT_REFUSED(call(), FIG_INVALID_ARGUMENT, "struct_bytes");
    }
    struct_bytes = sound + 8;
    EXPECT_REFUSED(call(), FIG_UNSUPPORTED, "of a later version");
    struct_bytes = sound;
  };
  const auto drawn = [&] { return render(); };
  both(frame.struct_bytes, drawn);
  both(camera.struct_bytes, drawn);
  both(pose.struct_bytes, drawn);
  both(seen.struct_bytes, drawn);
  both(image.struct_bytes, drawn);
  fig_gaussians gaussians[2] = {fig_default_gaussians(), fig_default_gaussians()};
  frame.gaussians = gaussians, frame.gaussians_count = 2;
  both(gaussians[0].struct_bytes, drawn);
  both(gaussians[1].struct_bytes, drawn);
  EXPECT_OK(render());

  fig_package_options package = fig_default_package_options();
  both(package.struct_bytes, [&] {
    fig_package opened;
    return fig_package_open("", 1, &package, &opened);
  });
  fig_renderer_options options = fig_default_renderer_options();
  both(options.struct_bytes, [&] {
    fig_renderer created;
    return fig_renderer_create(&options, &created);
  });
  fig_avatar_options added = fig_default_avatar_options();
  both(added.struct_bytes, [&] {
    fig_avatar id;
    return fig_renderer_add_avatar(renderer, avatar, 0, body, &added, &id);
  });
  fig_statistics statistics = fig_default_statistics();
  both(statistics.struct_bytes, [&] { return fig_renderer_statistics(renderer, &statistics); });
  fig_pose_rarity rarity = fig_default_pose_rarity();
  both(rarity.struct_bytes,
       [&] { return fig_renderer_pose_rarity(renderer, person, &pose, &rarity); });
  fig_package_info info = fig_default_package_info();
  both(info.struct_bytes, [&] { return fig_package_get_info(body, &info); });
  fig_orbit orbit = fig_default_orbit();
  both(orbit.struct_bytes, [&] { return fig_make_orbit_camera(&orbit, 4, 4, &camera); });
}

// A program that was built with a later version's header and runs with this library.
TEST_F(CApi, ALongerStructIsFilledWithinItsSizeAndRefused) {
  struct Later {
    fig_frame frame;
    uint64_t added, behind;
  } later;
  std::memset(&later, 0x5a, sizeof later);
  fig_set_default_frame(&later.frame, offsetof(Later, behind));
  EXPECT_EQ(later.frame.struct_bytes, offsetof(Later, behind));
  EXPECT_EQ(later.frame.alpha_cut, frame.alpha_cut);
  EXPECT_EQ(later.added, 0u);
  EXPECT_EQ(later.behind, 0x5a5a5a5a5a5a5a5au);
  EXPECT_REFUSED(fig_renderer_render(renderer, &later.frame, &image), FIG_UNSUPPORTED,
                 "frame: struct_bytes of ");
  // An earlier one's shorter struct is not written past its end.
  std::memset(&later, 0x5a, sizeof later);
  fig_set_default_frame(&later.frame, offsetof(fig_frame, alpha_cut));
  EXPECT_EQ(later.frame.struct_bytes, offsetof(fig_frame, alpha_cut));
  EXPECT_EQ(later.frame.leave_out, 0x5a5a5a5au);
}

TEST_F(CApi, UnsoundValuesAreRefused) {
  fig_renderer_options options = fig_default_renderer_options();
  options.threads = 65;
  fig_renderer created{};
  EXPECT_REFUSED(fig_renderer_create(&options, &created), FIG_INVALID_ARGUMENT, "threads");
  options.threads = 1, options.isa = static_cast<fig_isa>(1000);
  EXPECT_REFUSED(fig_renderer_create(&options, &created), FIG_INVALID_ARGUMENT, "isa");
  fig_avatar_options added = fig_default_avatar_options();
  added.precision = static_cast<fig_precision>(7);
  fig_avatar id{};
  EXPECT_REFUSED(fig_renderer_add_avatar(renderer, avatar, 0, body, &added, &id),
                 FIG_INVALID_ARGUMENT, "precision");
  added.precision = FIG_PRECISION_Q8;
  EXPECT_REFUSED(fig_renderer_add_avatar(renderer, avatar, 0, body, &added, &id), FIG_UNSUPPORTED,
                 "q8");
  EXPECT_REFUSED(fig_renderer_add_avatar(renderer, body, 0, body, nullptr, &id), FIG_MISMATCH,
                 "an avatar is wanted, not a body");
  EXPECT_REFUSED(fig_renderer_add_avatar(renderer, avatar, 0, avatar, nullptr, &id), FIG_MISMATCH,
                 "body");
  EXPECT_REFUSED(fig_renderer_add_avatar(renderer, avatar, 1, body, nullptr, &id),
                 FIG_INVALID_ARGUMENT, "member");

  pose.joint_count = 3;
  EXPECT_REFUSED(render(), FIG_INVALID_ARGUMENT, "avatars[0]: ");
  fig_gaussians posed = fig_default_gaussians();
  EXPECT_REFUSED(fig_renderer_pose_avatar(renderer, person, &pose, &posed), FIG_INVALID_ARGUMENT,
                 "pose: ");
  pose.joint_count = 4;
  frame.leave_out = 64;
  EXPECT_REFUSED(render(), FIG_INVALID_ARGUMENT, "leave_out");
  frame.leave_out = FIG_LEAVE_OUT_ALL, frame.fast_blend = 2;
  EXPECT_REFUSED(render(), FIG_INVALID_ARGUMENT, "fast_blend");
  frame.fast_blend = 0, frame.network_below_px = -1;
  EXPECT_REFUSED(render(), FIG_INVALID_ARGUMENT, "network_below_px");
  frame.network_below_px = 0, frame.network_interval = 0;
  EXPECT_REFUSED(render(), FIG_INVALID_ARGUMENT, "network_interval");
  frame.network_interval = 1, frame.averted_above = 2;
  EXPECT_REFUSED(render(), FIG_INVALID_ARGUMENT, "averted_above");
  frame.averted_above = 1, frame.sh_degree = 4;
  EXPECT_REFUSED(render(), FIG_INVALID_ARGUMENT, "sh_degree");
  frame.sh_degree = 3, frame.coarse_below_px = -1;
  EXPECT_REFUSED(render(), FIG_INVALID_ARGUMENT, "coarse_below_px");
  frame.coarse_below_px = 0, seen.coarse.id = ~uint64_t{0};
  EXPECT_REFUSED(render(), FIG_INVALID_ARGUMENT, "coarse");
  seen.coarse.id = 0, frame.alpha_cut = 0;
  EXPECT_REFUSED(render(), FIG_INVALID_ARGUMENT, "alpha cut");
  frame.alpha_cut = 0.01f, frame.antialiased = static_cast<fig_antialiased>(3);
  EXPECT_REFUSED(render(), FIG_INVALID_ARGUMENT, "frame: unknown antialiased 3");
  frame.antialiased = FIG_ANTIALIASED_AS_TRAINED, camera.fx_px = 0;
  EXPECT_REFUSED(render(), FIG_INVALID_ARGUMENT, "camera");
  camera.fx_px = camera.fy_px, image.format = static_cast<fig_pixel_format>(256);
  EXPECT_REFUSED(render(), FIG_INVALID_ARGUMENT, "pixel format");
  image.format = FIG_PIXEL_YUYV, image.matrix = static_cast<fig_matrix>(2);
  EXPECT_REFUSED(render(), FIG_INVALID_ARGUMENT, "matrix");
  image.matrix = FIG_MATRIX_BT709;
  EXPECT_REFUSED(render(), FIG_INVALID_ARGUMENT, "background");
  image.format = FIG_PIXEL_RGBA8, image.stride_bytes = 5;
  EXPECT_REFUSED(render(), FIG_INVALID_ARGUMENT, "rows of 5 bytes");
  image.stride_bytes = kWidth * 4;
  fig_gaussians gaussians = fig_default_gaussians();
  gaussians.sh_degree = 4;
  frame.gaussians = &gaussians, frame.gaussians_count = 1;
  EXPECT_REFUSED(render(), FIG_INVALID_ARGUMENT, "gaussians[0]: SH degree 4");
  frame.gaussians_count = 0;
  std::fill(pixels.begin(), pixels.end(), uint8_t{77});
  EXPECT_OK(render());
}

TEST_F(CApi, OneRendererServesOneThreadAtATime) {
  // The clock runs within a frame: a call with the same renderer from there is refused.
  struct Nested {
    fig_renderer renderer{};
    fig_status status = FIG_OK;
    std::string message;
  } nested;
  fig_renderer_options options = fig_default_renderer_options();
  options.now_ns = [](void* user) -> uint64_t {
    Nested& self = *static_cast<Nested*>(user);
    self.status = fig_renderer_destroy(self.renderer);
    self.message = fig_last_message();
    return 1;
  };
  options.now_user = &nested;
  ASSERT_EQ(fig_renderer_create(&options, &nested.renderer), FIG_OK);
  frame.avatar_count = 0;
  EXPECT_OK(fig_renderer_render(nested.renderer, &frame, &image));
  EXPECT_EQ(nested.status, FIG_INVALID_ARGUMENT);
  EXPECT_EQ(nested.message, "renderer: still in use");
  EXPECT_OK(fig_renderer_destroy(nested.renderer));
}

TEST_F(CApi, RenderersShareThreads) {
  fig_threads threads{};
  EXPECT_REFUSED(fig_threads_create(0, &threads), FIG_INVALID_ARGUMENT, "threads");
  ASSERT_EQ(fig_threads_create(2, &threads), FIG_OK) << fig_last_message();
  fig_renderer_options options = fig_default_renderer_options();
  options.pool = threads;
  const std::vector<uint8_t> expected = render_in_cpp();
  std::vector<std::thread> users;
  for (int i = 0; i < 2; ++i) {
    users.emplace_back([&] {
      fig_renderer own{};
      ASSERT_EQ(fig_renderer_create(&options, &own), FIG_OK) << fig_last_message();
      fig_frame_avatar shown = fig_default_frame_avatar();
      ASSERT_EQ(fig_renderer_add_avatar(own, avatar, 0, body, nullptr, &shown.avatar), FIG_OK);
      shown.pose = &pose;
      fig_frame view = frame;
      view.avatars = &shown;
      std::vector<uint8_t> rgba(pixels.size());
      fig_image target = image;
      target.pixels = rgba.data();
      for (int k = 0; k < 10; ++k) EXPECT_OK(fig_renderer_render(own, &view, &target));
      EXPECT_EQ(rgba, expected);
      EXPECT_OK(fig_renderer_destroy(own));
    });
  }
  for (std::thread& user : users) user.join();
  fig_renderer last{};
  EXPECT_OK(fig_renderer_create(&options, &last));
  EXPECT_REFUSED(fig_threads_destroy(threads), FIG_INVALID_ARGUMENT, "threads: still in use");
  EXPECT_OK(fig_renderer_destroy(last));
  EXPECT_OK(fig_threads_destroy(threads));
  EXPECT_REFUSED(fig_renderer_create(&options, &last), FIG_INVALID_ARGUMENT, "threads: a stale");
}

}  // namespace
}  // namespace figurine::tests
