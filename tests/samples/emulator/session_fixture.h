// A session on synthetic packages, carried on as a window would.
#pragma once

#include <gtest/gtest.h>

#include <chrono>
#include <memory>
#include <string>
#include <thread>

#include "samples/emulator/session.h"
#include "samples/program.h"

namespace figurine::emulator {

class SessionTest : public testing::Test {
 protected:
  // For what other threads do: a core that is emulated on a busy machine takes a minute for what
  // is there at once elsewhere.
  static constexpr std::chrono::minutes kLongestWait{10};

  static void SetUpTestSuite() {
    packages_ = new tests::TestFolder;
    tests::write_test_packages(*packages_);
    packages_->write("broken.fgn", packages_->read("avatar.fgn").substr(0, 3000));
    packages_->write("none.ply", "this is no scene");
    packages_->write("point.ply",
                     "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\n"
                     "property float z\nproperty float scale_0\nproperty float scale_1\n"
                     "property float scale_2\nproperty float rot_0\nproperty float rot_1\n"
                     "property float rot_2\nproperty float rot_3\nproperty float opacity\n"
                     "property float f_dc_0\nproperty float f_dc_1\nproperty float f_dc_2\n"
                     "end_header\n0 0 0 -2 -2 -2 1 0 0 0 4 1 0 -1\n");
  }
  static void TearDownTestSuite() {
    delete packages_;
    packages_ = nullptr;
  }
  void SetUp() override {
    Result<std::unique_ptr<Session>> created = Session::create({});
    ASSERT_TRUE(created.ok()) << created.status().message();
    session_ = std::move(*created);
    session_->set_measuring(false);
  }

  // As a window goes on, until it holds; false if it does not within kLongestWait.
  template <class Condition>
  bool run_until(Condition holds) {
    const auto end = std::chrono::steady_clock::now() + kLongestWait;
    while (std::chrono::steady_clock::now() < end) {
      session_->advance(0.01);
      (void)session_->draw();
      if (holds()) return true;
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
    return false;
  }
  void open(const std::string& name) {
    session_->open(name[0] == '/' ? name : packages_->path(name));
    EXPECT_TRUE(run_until([&] { return session_->idle(); })) << name;
  }
  std::string last_message() const {
    return session_->messages().empty() ? "" : session_->messages().back().text;
  }
  bool last_is_error() const {
    return !session_->messages().empty() && session_->messages().back().error;
  }

  inline static tests::TestFolder* packages_ = nullptr;
  std::unique_ptr<Session> session_;
};

}  // namespace figurine::emulator
