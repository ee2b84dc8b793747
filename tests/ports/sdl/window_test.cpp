// A window as SDL's dummy display has it: what it shows is what was given, whatever the shapes are;
// it says when it was closed and what was dropped on it; without a display there is one line.
#include "ports/sdl/window.h"

#include <SDL.h>
#include <gtest/gtest.h>

#include <array>
#include <cstdlib>

namespace figurine::ports::window_test {
namespace {

class WindowTest : public testing::Test {
 protected:
  void SetUp() override {
    ::setenv("SDL_VIDEODRIVER", "dummy", 1);
    ::setenv("SDL_RENDER_DRIVER", "software", 1);
  }
};

// Red grows to the right, green downwards.
std::vector<uint8_t> ramp(uint32_t width, uint32_t height) {
  std::vector<uint8_t> pixels;
  for (uint32_t y = 0; y < height; ++y) {
    for (uint32_t x = 0; x < width; ++x)
      pixels.insert(pixels.end(), {static_cast<uint8_t>(10 * x), static_cast<uint8_t>(20 * y), 7,
                                   static_cast<uint8_t>(x == 0 ? 0 : 255)});
  }
  return pixels;
}

void push(SDL_Event event) { ASSERT_EQ(SDL_PushEvent(&event), 1); }

TEST_F(WindowTest, ShowsThePixelsThatItWasGiven) {
  const auto window = Window::open({.width_px = 23, .height_px = 11});
  ASSERT_TRUE(window.ok()) << window.status().message();
  const std::vector<uint8_t> pixels = ramp(23, 11);
  for (int i = 0; i < 3; ++i) {
    ASSERT_TRUE((*window)->set_picture(pixels, 23, 11).ok());
    ASSERT_TRUE((*window)->show_picture().ok());
    EXPECT_TRUE((*window)->poll());
  }
  const Result<ImageU8> seen = (*window)->read_frame();
  ASSERT_TRUE(seen.ok()) << seen.status().message();
  ASSERT_EQ(seen->width_px, 23u);
  ASSERT_EQ(seen->height_px, 11u);
  for (uint32_t y = 0; y < 11; ++y) {
    for (uint32_t x = 0; x < 23; ++x) {
      const uint8_t* const at = seen->at(x, y);
      ASSERT_EQ(
          (std::array{at[0], at[1], at[2]}),
          (std::array<uint8_t, 3>{static_cast<uint8_t>(10 * x), static_cast<uint8_t>(20 * y), 7}))
          << x << " " << y << ": alpha is not looked at";
    }
  }
}

TEST_F(WindowTest, APictureOfAnotherShapeLiesInTheMiddle) {
  const auto window = Window::open({.width_px = 40, .height_px = 20});
  ASSERT_TRUE(window.ok()) << window.status().message();
  // The size may change from picture to picture.
  ASSERT_TRUE((*window)->set_picture(ramp(7, 3), 7, 3).ok());
  const std::vector<uint8_t> white(size_t{4} * 10 * 10, 255);
  ASSERT_TRUE((*window)->set_picture(white, 10, 10).ok());
  ASSERT_TRUE((*window)->show_picture().ok());
  const Result<ImageU8> seen = (*window)->read_frame();
  ASSERT_TRUE(seen.ok()) << seen.status().message();
  for (uint32_t y = 0; y < 20; ++y) {
    for (uint32_t x = 0; x < 40; ++x)
      ASSERT_EQ(*seen->at(x, y), x >= 10 && x < 30 ? 255 : 0) << x << " " << y;
  }
}

TEST_F(WindowTest, SaysThatItWasClosed) {
  for (const bool whole_program : {false, true}) {
    const auto window = Window::open({.width_px = 8, .height_px = 8});
    ASSERT_TRUE(window.ok()) << window.status().message();
    EXPECT_TRUE((*window)->poll());
    SDL_Event event{};
    event.type = whole_program ? SDL_QUIT : SDL_WINDOWEVENT;
    if (!whole_program) event.window.event = SDL_WINDOWEVENT_CLOSE;
    push(event);
    EXPECT_FALSE((*window)->poll());
    EXPECT_FALSE((*window)->poll()) << "for good";
  }
}

TEST_F(WindowTest, GivesTheFilesThatWereDroppedOnIt) {
  const auto window = Window::open({.width_px = 8, .height_px = 8});
  ASSERT_TRUE(window.ok()) << window.status().message();
  std::vector<std::string> files;
  int events = 0;
  for (const char* name : {"a b.fgn", "c.ply"}) (*window)->drop(name);
  EXPECT_TRUE((*window)->poll([&](const SDL_Event& event) { events += event.type == SDL_DROPFILE; },
                              &files));
  EXPECT_EQ(files, (std::vector<std::string>{"a b.fgn", "c.ply"}));
  EXPECT_EQ(events, 2);
}

TEST_F(WindowTest, WithoutADisplayThereIsOneLine) {
  ::setenv("SDL_VIDEODRIVER", "x11", 1);
  ::unsetenv("DISPLAY");
  const auto window = Window::open({.width_px = 8, .height_px = 8});
  ASSERT_FALSE(window.ok());
  EXPECT_EQ(window.status().code(), StatusCode::kUnsupported);
  const std::string said = window.status().message();
  EXPECT_EQ(said.rfind("window: there is no display to open it on: ", 0), 0u) << said;
  EXPECT_EQ(said.find('\n'), std::string::npos) << said;
  SetUp();
  EXPECT_TRUE(Window::open({.width_px = 8, .height_px = 8}).ok()) << "and where there is one: one";
}

}  // namespace
}  // namespace figurine::ports::window_test
