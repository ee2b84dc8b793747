// Usable CPUs: the quota of a control group and of all above it, as the kernel writes them.
#include "ports/host/cpus.h"

#include <gtest/gtest.h>
#include <sched.h>

#include <filesystem>
#include <fstream>

namespace figurine::ports::cpus_test {
namespace {

class Quota : public testing::Test {
 protected:
  void SetUp() override {
    std::string pattern = testing::TempDir() + "/figurine_cpus_XXXXXX";
    ASSERT_NE(::mkdtemp(pattern.data()), nullptr);
    root_ = pattern;
  }
  void TearDown() override { std::filesystem::remove_all(root_); }
  void write(const std::string& group, const std::string& text) const {
    std::filesystem::create_directories(root_ + group);
    std::ofstream(root_ + group + "/cpu.max") << text;
  }
  std::string root_;
};

TEST_F(Quota, IsTheSmallestOfAGroupAndAllAboveIt) {
  EXPECT_EQ(quota_cpus("0::/a/b\n", root_), 0u);  // no files at all
  write("/a/b", "max 100000\n");
  EXPECT_EQ(quota_cpus("0::/a/b\n", root_), 0u);
  write("/a/b", "400000 100000\n");
  EXPECT_EQ(quota_cpus("0::/a/b\n", root_), 4u);
  write("/a", "250000 100000\n");
  EXPECT_EQ(quota_cpus("0::/a/b\n", root_), 3u);
  write("", "100000 100000\n");
  EXPECT_EQ(quota_cpus("0::/a/b\n", root_), 1u);
  EXPECT_EQ(quota_cpus("0::/\n", root_), 1u);  // as a container sees itself
  EXPECT_EQ(quota_cpus("0::/gone/elsewhere\n", root_), 1u);
}

TEST_F(Quota, RoundsUpAndNeverBelowOne) {
  for (const auto& [text, cpus] : std::initializer_list<std::pair<const char*, uint32_t>>{
           {"1000 100000", 1}, {"100001 100000", 2}, {"150000 100000", 2}, {"200000 100000", 2}}) {
    write("", text);
    EXPECT_EQ(quota_cpus("0::/\n", root_), cpus) << text;
  }
}

TEST_F(Quota, IsNoneWhereTheTextIsNotTheKernels) {
  for (const char* text : {"", "max", "100000", "-1 100000", "100000 0", "nan nan", "x y"}) {
    write("", text);
    EXPECT_EQ(quota_cpus("0::/\n", root_), 0u) << text;
  }
  write("", "100000 100000");
  EXPECT_EQ(quota_cpus("", root_), 1u);
  EXPECT_EQ(quota_cpus("5:cpu:/somewhere\n0::/\n", root_), 1u);
}

// A host of v1: a folder a hierarchy, quota and period in files of their own; -1 is none.
class QuotaOfV1 : public Quota {
 protected:
  void write(const std::string& group, const std::string& quota, const std::string& period) const {
    std::filesystem::create_directories(root_ + group);
    if (!quota.empty()) std::ofstream(root_ + group + "/cpu.cfs_quota_us") << quota;
    if (!period.empty()) std::ofstream(root_ + group + "/cpu.cfs_period_us") << period;
  }
  static constexpr const char* kMembership =
      "12:memory:/docker/abc\n5:cpu,cpuacct:/docker/abc\n1:name=systemd:/docker/abc\n";
};

TEST_F(QuotaOfV1, IsTheSmallestOfAGroupAndAllAboveIt) {
  EXPECT_EQ(quota_cpus(kMembership, root_), 0u);
  write("/cpu,cpuacct", "-1\n", "100000\n");
  EXPECT_EQ(quota_cpus(kMembership, root_), 0u);
  write("/cpu,cpuacct/docker/abc", "150000\n", "100000\n");
  EXPECT_EQ(quota_cpus(kMembership, root_), 2u);
  write("/cpu,cpuacct/docker", "50000\n", "100000\n");
  EXPECT_EQ(quota_cpus(kMembership, root_), 1u);
}

TEST_F(QuotaOfV1, IsFoundUnderEitherNameAndInAContainersOwnRoot) {
  write("/cpu/docker/abc", "400000\n", "100000\n");
  EXPECT_EQ(quota_cpus(kMembership, root_), 4u) << "a folder called like one controller";
  std::filesystem::remove_all(root_ + "/cpu");
  write("/cpu,cpuacct", "300000\n", "100000\n");
  EXPECT_EQ(quota_cpus(kMembership, root_), 3u) << "the group's path is its host's";
  EXPECT_EQ(quota_cpus("7:cpu:/\n", root_), 0u) << "another hierarchy";
  EXPECT_EQ(quota_cpus("7:cpuset:/\n", root_), 0u) << "another controller";
}

TEST_F(QuotaOfV1, StandsBesideV2OnAHostOfBoth) {
  const std::string both = "5:cpu,cpuacct:/a\n0::/a\n";
  write("/cpu,cpuacct/a", "300000\n", "100000\n");
  EXPECT_EQ(quota_cpus(both, root_), 3u);
  Quota::write("/unified/a", "200000 100000\n");
  EXPECT_EQ(quota_cpus(both, root_), 2u);
}

TEST_F(QuotaOfV1, IsNoneWhereTheTextIsNotTheKernels) {
  for (const auto& [quota, period] : std::initializer_list<std::pair<const char*, const char*>>{
           {"", "100000"}, {"100000", ""}, {"x", "100000"}, {"100000", "0"}, {"0", "100000"}}) {
    std::filesystem::remove_all(root_ + "/cpu,cpuacct");
    write("/cpu,cpuacct/docker/abc", quota, period);
    EXPECT_EQ(quota_cpus(kMembership, root_), 0u) << quota << " of " << period;
  }
  EXPECT_EQ(quota_cpus("5:cpu\n:\n\nnonsense\n5:cpu,cpuacct", root_), 0u);
}

TEST(UsableCpus, AreAtLeastOneAndWithinTheAffinityMask) {
  cpu_set_t set;
  ASSERT_EQ(::sched_getaffinity(0, sizeof(set), &set), 0);
  EXPECT_GE(usable_cpus(), 1u);
  EXPECT_LE(usable_cpus(), static_cast<uint32_t>(CPU_COUNT(&set)));
}

}  // namespace
}  // namespace figurine::ports::cpus_test
