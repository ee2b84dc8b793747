// Jobs in processes of their own: how each ends is told, and a training that is killed at any
// moment goes on to the same bits. Trainings run in forked children here, so this process starts no
// thread before the last comparison.
#include <gtest/gtest.h>
#include <signal.h>
#include <unistd.h>

#include <chrono>
#include <fstream>
#include <map>
#include <stdexcept>
#include <thread>

#include "tests/toolchain/train/small_capture.h"
#include "toolchain/error.h"
#include "toolchain/train/interrupt.h"
#include "toolchain/train/slots.h"
#include "toolchain/train/trainer.h"

namespace figurine::train::slots_test {
namespace {

namespace fs = std::filesystem;
using testing_tools::small_capture;
using testing_tools::TemporaryFolder;

std::map<size_t, JobResult> results_of(
    size_t count, unsigned slots, const std::function<std::string(size_t)>& job,
    const std::function<void()>& waiting = [] {}) {
  std::map<size_t, JobResult> results;
  run_in_slots(
      count, {.slots = slots, .poll_period_s = 0.01}, job,
      [&](size_t i, const JobResult& result) { results[i] = result; }, waiting);
  return results;
}

// A rank that stops with the others before its own signal has come: the signal does not end it.
TEST(Interrupt, ThatComesAfterAnAgreedStopIsIgnored) {
  for (const bool late : {false, true}) {
    const std::map<size_t, JobResult> results = results_of(1, 1, [late](size_t) -> std::string {
      signal(SIGTERM, SIG_DFL);  // not what the slots' parent does with it
      {
        InterruptGuard interrupt;
        if (late) interrupt.ignore_late();
      }
      raise(SIGTERM);
      return "said so";
    });
    EXPECT_EQ(results.at(0).done, late);
  }
}

TEST(Slots, TellHowEveryJobEnded) {
  const std::map<size_t, JobResult> results = results_of(5, 2, [](size_t i) -> std::string {
    if (i == 1) throw InputError("b.fgn: is damaged");
    if (i == 2) raise(SIGKILL);
    if (i == 3) throw Interrupted("stopped");
    if (i == 4) return std::string(300000, 'x');  // more than a pipe holds
    return "done";
  });
  ASSERT_EQ(results.size(), 5u);
  EXPECT_TRUE(results.at(0).done);
  EXPECT_EQ(results.at(0).text, "done");
  EXPECT_FALSE(results.at(1).done);
  EXPECT_EQ(results.at(1).text, "b.fgn: is damaged");
  EXPECT_FALSE(results.at(2).done);
  EXPECT_EQ(results.at(2).text.find("ended by signal 9"), 0u);
  EXPECT_TRUE(results.at(3).interrupted);
  EXPECT_TRUE(results.at(4).done);
  EXPECT_EQ(results.at(4).text.size(), 300000u);
}

TEST(Slots, RunAsManyJobsAtATimeAsThereAreSlots) {
  const TemporaryFolder folder;
  const auto alive = [&] {
    return std::distance(fs::directory_iterator(folder.path("")), fs::directory_iterator());
  };
  std::ptrdiff_t most = 0;
  const std::map<size_t, JobResult> results = results_of(
      6, 3,
      [&](size_t i) {
        const std::string mark = folder.path(std::to_string(i));
        std::ofstream{mark};
        // Until three are there, which two at a time would never be. The last three find none of
        // the first.
        for (int k = 0; k < 2000 && alive() < 3; ++k)
          std::this_thread::sleep_for(std::chrono::milliseconds(1));
        const std::ptrdiff_t seen = alive();
        std::this_thread::sleep_for(std::chrono::milliseconds(100));
        fs::remove(mark);
        return std::to_string(seen);
      },
      [&] { most = std::max(most, alive()); });
  for (const auto& [i, result] : results) EXPECT_TRUE(result.done) << i;
  EXPECT_EQ(results.at(0).text, "3");
  EXPECT_EQ(most, 3);
}

TEST(Slots, PassAnInterruptOnAndStartNothingMore) {
  std::map<size_t, JobResult> results;
  const auto job = [](size_t) -> std::string {
    const InterruptGuard interrupt;
    for (int k = 0; k < 20000 && !interrupt.requested(); ++k)
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    if (interrupt.requested()) throw Interrupted("saved");
    return "never asked";
  };
  int waits = 0;
  EXPECT_THROW(run_in_slots(
                   9, {.slots = 2, .poll_period_s = 0.01}, job,
                   [&](size_t i, const JobResult& result) { results[i] = result; },
                   [&] {
                     if (++waits == 50) raise(SIGTERM);
                   }),
               Interrupted);
  ASSERT_EQ(results.size(), 2u);
  for (const auto& [i, result] : results)
    EXPECT_TRUE(result.interrupted) << i << ": " << result.text;
}

TEST(Slots, ATrainingKilledAnywhereResumesToTheSameBits) {
  const TemporaryFolder folder;
  const auto train = [&](const std::string& run) {
    TrainRequest request{.data = small_capture().data,
                         .body = small_capture().body,
                         .run = run,
                         .settings = preset_settings("nano"),
                         .resume = fs::exists(RunDirectory{run}.run_json()),
                         .quiet = true,
                         .checkpoint_period_s = 0.05};
    request.settings.schedule.budget = {.iterations = 150, .seconds = 0};
    request.settings.threads = 1;
    return std::to_string(train_avatar(request).state.iteration);
  };
  const std::string straight = folder.path("straight"), killed = folder.path("killed");
  small_capture();  // made once, here: the children share it
  ASSERT_EQ(results_of(1, 1, [&](size_t) { return train(straight); }).at(0).text, "150");
  // Killed three times, a little later after each checkpoint it is seen to have written.
  int kills = 0;
  for (int round = 0; round < 3; ++round) {
    const fs::path checkpoint = RunDirectory{killed}.checkpoint();
    const auto job = [&](size_t) {
      const fs::file_time_type before =
          fs::exists(checkpoint) ? fs::last_write_time(checkpoint) : fs::file_time_type::min();
      std::thread([=] {
        while (!fs::exists(checkpoint) || fs::last_write_time(checkpoint) <= before)
          std::this_thread::sleep_for(std::chrono::microseconds(200));
        std::this_thread::sleep_for(std::chrono::milliseconds(3 * round));
        kill(getpid(), SIGKILL);
      }).detach();
      return train(killed);
    };
    kills += results_of(1, 1, job).at(0).text.find("ended by signal 9") == 0;
  }
  EXPECT_GT(kills, 0);
  ASSERT_EQ(results_of(1, 1, [&](size_t) { return train(killed); }).at(0).text, "150");
  const auto bytes_of = [](const std::string& path) {
    std::ifstream file(path, std::ios::binary);
    return std::string(std::istreambuf_iterator<char>(file), {});
  };
  EXPECT_EQ(bytes_of(RunDirectory{killed}.weights()), bytes_of(RunDirectory{straight}.weights()));
}

}  // namespace
}  // namespace figurine::train::slots_test
