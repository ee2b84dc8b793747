// People of the shipped sampler, live: in each other's place, taken back and again to the bit,
// kept, cancelled.
#include "samples/emulator/people.h"

#include <gtest/gtest.h>

#include "samples/emulator/session_fixture.h"

namespace figurine::emulator::people_test {
namespace {

class People : public SessionTest {};

TEST_F(People, SamplesPeopleAndTakesThemBack) {
  EXPECT_EQ(session_->sample({.seed = 1}).code(), StatusCode::kNotFound);
  ASSERT_TRUE(session_->set_profile(*find_profile("a53-panel")).ok());
  session_->set_paced(false);
  open(FIGURINE_SOURCE_DIR "/samples/samplers/edge.fgn");
  ASSERT_TRUE(session_->has_sampler()) << last_message();
  const auto sampled = [&](const Seed& seed) {
    EXPECT_TRUE(session_->sample(seed).ok());
    EXPECT_TRUE(run_until([&] { return session_->idle(); }));
    EXPECT_FALSE(last_is_error()) << last_message();
    (void)session_->draw();
    return session_->picture().u8.pixels;
  };
  const std::vector<uint8_t> nobody = session_->picture().u8.pixels;
  const std::vector<uint8_t> seven = sampled({.seed = 7}), between = sampled({7, 8, 0.5});
  EXPECT_NE(seven, nobody);
  EXPECT_NE(seven, between);
  EXPECT_EQ(session_->figure_count(), 1u) << "in the place of the one before";
  EXPECT_EQ(session_->figure(0).avatar.name, "seed 7 to 8 by 0.50");
  session_->undo();
  (void)session_->draw();
  EXPECT_EQ(session_->picture().u8.pixels, seven) << "to the bit";
  EXPECT_EQ(session_->seed(), (Seed{.seed = 7}));
  session_->undo();
  EXPECT_EQ(session_->figure_count(), 0u);
  EXPECT_FALSE(session_->can_undo());
  session_->redo();
  session_->redo();
  (void)session_->draw();
  EXPECT_EQ(session_->figure(0).avatar.name, "seed 7 to 8 by 0.50");
  // One who is kept stays when the next one comes.
  session_->keep_person();
  (void)sampled({.seed = 9});
  EXPECT_EQ(session_->figure_count(), 2u);
  // What is cancelled does not come.
  EXPECT_TRUE(session_->sample({.seed = 11}).ok());
  session_->cancel_sampling();
  EXPECT_TRUE(run_until([&] { return session_->idle(); }));
  EXPECT_EQ(session_->figure(1).avatar.name, "seed 9");
}

}  // namespace
}  // namespace figurine::emulator::people_test
