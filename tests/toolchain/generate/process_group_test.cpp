// Ranks on this machine: who is who, what they say to each other, and that nobody waits for ever
// for one that is gone.
#include "toolchain/generate/process_group.h"
#include "toolchain/tensor_operations.h"

#include <gtest/gtest.h>

#include <map>

#include "tests/toolchain/generate/ranks.h"

namespace figurine::generate::process_group_test {
namespace {

using tests::Ranks;

RankPlace place_in(const std::map<std::string, std::string>& variables) {
  return rank_place_from([&](const char* name) -> const char* {
    const auto found = variables.find(name);
    return found == variables.end() ? nullptr : found->second.c_str();
  });
}

std::string refusal(const std::map<std::string, std::string>& variables) {
  try {
    place_in(variables);
  } catch (const InputError& error) {
    return error.what();
  }
  return "accepted";
}

TEST(RankPlace, IsReadFromTheEnvironment) {
  EXPECT_EQ(place_in({}).size, 1);
  EXPECT_EQ(place_in({{"SLURM_NTASKS", "4"}, {"SLURM_PROCID", "0"}}).size, 1)
      << "a batch script is not a step";
  EXPECT_EQ(place_in({{"SLURM_STEP_NUM_TASKS", "1"}, {"SLURM_PROCID", "0"}}).size, 1);
  const RankPlace by_hand = place_in({{"RANK", "2"},
                                      {"WORLD_SIZE", "3"},
                                      {"MASTER_ADDR", "10.0.0.7"},
                                      {"SLURM_STEP_NUM_TASKS", "9"}});
  EXPECT_EQ(by_hand.rank, 2);
  EXPECT_EQ(by_hand.size, 3);
  EXPECT_EQ(by_hand.host, "10.0.0.7");
  EXPECT_EQ(by_hand.port, 29500);
  std::map<std::string, std::string> step{{"SLURM_PROCID", "1"},
                                          {"SLURM_STEP_NUM_TASKS", "2"},
                                          {"SLURM_JOB_ID", "123456"},
                                          {"SLURM_STEP_NODELIST", "gpu-[003-007],x"}};
  EXPECT_EQ(place_in(step).rank, 1);
  EXPECT_EQ(place_in(step).host, "gpu-003");
  EXPECT_EQ(place_in(step).port, 23456);
  step["MASTER_ADDR"] = "10.1.1.1", step["MASTER_PORT"] = "4000";
  EXPECT_EQ(place_in(step).host, "10.1.1.1");
  EXPECT_EQ(place_in(step).port, 4000);
}

TEST(RankPlace, NamesTheVariableThatIsWrong) {
  EXPECT_NE(refusal({{"RANK", "0"}}).find("WORLD_SIZE: is not set"), std::string::npos);
  EXPECT_NE(refusal({{"RANK", "2"}, {"WORLD_SIZE", "2"}, {"MASTER_ADDR", "a"}})
                .find("RANK: '2' is no number of 0 to 1"),
            std::string::npos);
  EXPECT_NE(refusal({{"RANK", "1x"}, {"WORLD_SIZE", "2"}, {"MASTER_ADDR", "a"}}).find("RANK: '1x'"),
            std::string::npos);
  EXPECT_NE(refusal({{"RANK", "1"}, {"WORLD_SIZE", "2"}}).find("MASTER_ADDR: is not set"),
            std::string::npos);
  EXPECT_NE(
      refusal({{"RANK", "1"}, {"WORLD_SIZE", "2"}, {"MASTER_ADDR", "a"}, {"MASTER_PORT", "70000"}})
          .find("MASTER_PORT"),
      std::string::npos);
  EXPECT_NE(refusal({{"SLURM_PROCID", "0"}, {"SLURM_STEP_NUM_TASKS", "2"}, {"SLURM_JOB_ID", "1"}})
                .find("SLURM_STEP_NODELIST"),
            std::string::npos);
}

TEST(RankPlace, FindsTheFirstHostOfAList) {
  EXPECT_EQ(first_host("n1"), "n1");
  EXPECT_EQ(first_host("n1,n2"), "n1");
  EXPECT_EQ(first_host("gpu-[003-007,9],x"), "gpu-003");
  EXPECT_EQ(first_host("rack[2,4]node[10-12]"), "rack2node10");
  EXPECT_EQ(first_host(""), "");
}

// 10,007 values, so that no stretch of a ring is like the other. A sum of three floats is rounded
// twice: 2 x 2^-24 of the partial sums.
TEST(ProcessGroup, GivesEveryRankTheSameBits) {
  const auto values_of = [](int rank) {
    return torch::randn({10007},
                        at::make_generator<at::CPUGeneratorImpl>(static_cast<uint64_t>(rank)));
  };
  Ranks ranks(3, [&](const RankPlace& place) {
    ProcessGroup group(place, 30);
    torch::Tensor sum = values_of(group.rank()), leader = values_of(group.rank());
    group.sum(sum);
    group.broadcast(leader);
    torch::Tensor exact = torch::zeros({10007}, torch::kFloat64), size = exact.clone();
    for (int rank = 0; rank < 3; ++rank) exact += values_of(rank), size += values_of(rank).abs();
    const bool close = ((sum - exact).abs() <= size * 0x1p-23).all().item<bool>();
    group.barrier();
    return std::to_string(hash_bits(sum)) + (close ? " close" : " far") +
           (torch::equal(leader, values_of(0)) ? " leader's" : " own") +
           group.broadcast("hello from " + group.name()) + group.broadcast("");
  });
  const std::vector<std::string> told = ranks.wait_for_all();
  EXPECT_NE(told[0].find(" close leader'shello from rank 0 of 3"), std::string::npos) << told[0];
  EXPECT_EQ(told[1], told[0]);
  EXPECT_EQ(told[2], told[0]);
}

TEST(ProcessGroup, SeesARankThatDrifts) {
  Ranks ranks(2, [](const RankPlace& place) {
    ProcessGroup group(place, 30);
    torch::Tensor weights = torch::ones({100});
    group.expect_same(weights, "the weights");
    if (group.rank() == 1) weights[99] = 1.0000001f;
    group.expect_same(weights, "the weights");
    return std::string("same");
  });
  EXPECT_EQ(ranks.wait(1), "InputError: rank 1 of 2: the weights are no longer those of rank 0");
}

// The kernel closes what a killed process had open, so the others hear of it at once, from
// whichever rank they wait for.
TEST(ProcessGroup, EndsAllWhenOneDies) {
  for (const int victim : {0, 1, 2}) {
    Ranks ranks(3, [victim](const RankPlace& place) {
      ProcessGroup group(place, 120);
      group.barrier();
      if (group.rank() == victim) raise(SIGKILL);
      torch::Tensor values = torch::ones({1000});
      for (;;) group.sum(values);
      return std::string();
    });
    for (int rank = 0; rank < 3; ++rank) {
      const std::string told = ranks.wait(rank, 30);
      if (rank == victim) continue;
      EXPECT_EQ(told.rfind("PeerLost: rank " + std::to_string(rank) +
                               " of 3: lost another rank, which has ended or is silent: ",
                           0),
                0u)
          << told;
      EXPECT_EQ(told.find('\n'), std::string::npos) << told;
      if (victim == 1 && rank == 0) std::printf("  %s\n", told.c_str());
    }
    EXPECT_LT(ranks.seconds(), 30) << "far below the 120 s of the time limit";
  }
}

TEST(ProcessGroup, EndsAllWhenOneIsSilent) {
  Ranks ranks(2, [](const RankPlace& place) {
    ProcessGroup group(place, 3);
    group.barrier();
    if (group.rank() == 1) raise(SIGSTOP);
    group.barrier();
    return std::string("met");
  });
  const std::string told = ranks.wait(0, 30);
  EXPECT_EQ(
      told.rfind("PeerLost: rank 0 of 2: lost another rank, which has ended or is silent: ", 0), 0u)
      << told;
  std::printf("  %s (after %.1f s)\n", told.c_str(), ranks.seconds());
  ranks.send(1, SIGKILL);
}

TEST(ProcessGroup, SaysThatARankNeverCame) {
  Ranks leader(2, 1, [](const RankPlace& place) { return ProcessGroup(place, 2).name(); });
  const std::string told = leader.wait(0, 30);
  EXPECT_EQ(told.rfind("PeerLost: rank 0 of 2: no meeting of the ranks at 127.0.0.1:", 0), 0u)
      << told;
  EXPECT_NE(told.find("within 2 s"), std::string::npos) << told;
  EXPECT_EQ(told.find('\n'), std::string::npos) << told;
  Ranks follower(1, [](const RankPlace& place) {
    return ProcessGroup({1, 2, "127.0.0.1", place.port}, 2).name();
  });
  const std::string other = follower.wait(0, 30);
  EXPECT_EQ(other.rfind("PeerLost: rank 1 of 2: no meeting of the ranks at 127.0.0.1:", 0), 0u)
      << other;
  EXPECT_EQ(other.find('\n'), std::string::npos) << other;
}

TEST(ProcessGroup, AloneChangesNothing) {
  Ranks ranks(1, [](const RankPlace&) {
    ProcessGroup group({}, 1);
    torch::Tensor values = torch::randn({10}, at::make_generator<at::CPUGeneratorImpl>(1));
    const uint64_t before = hash_bits(values);
    group.sum(values), group.broadcast(values), group.barrier();
    return std::string(hash_bits(values) == before && group.broadcast("text") == "text" &&
                               group.leads()
                           ? "same"
                           : "changed");
  });
  EXPECT_EQ(ranks.wait(0), "same");
}

}  // namespace
}  // namespace figurine::generate::process_group_test
