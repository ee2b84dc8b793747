// One network for several people: trained on all of them, or frozen, or changed by an adapter that
// ends up in the kernels.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "tests/toolchain/train/requests.h"
#include "toolchain/error.h"
#include "toolchain/tensor_operations.h"
#include "toolchain/train/avatar_model.h"
#include "toolchain/train/interrupt.h"
#include "toolchain/train/kernel_basis_file.h"
#include "toolchain/train/pack_avatar.h"
#include "toolchain/train/trained_avatar.h"
#include "toolchain/train/trainer.h"

namespace figurine::train::shared_network_test {
namespace {

namespace fs = std::filesystem;
using testing_tools::both_parts;
using testing_tools::bytes_of;
using testing_tools::error_of;
using testing_tools::request;
using testing_tools::small_capture;
using testing_tools::TemporaryFolder;

// A finished run of both parts that others start from.
const std::string& run_of_both_parts() {
  static const TemporaryFolder folder;
  static const std::string run = [] {
    train_avatar(both_parts(folder.path("run"), 20));
    return folder.path("run");
  }();
  return run;
}

// A finished run, made again in `run` with a stop in its middle.
void expect_same_bits_after_a_stop(const TrainRequest& straight, const std::string& run) {
  TrainRequest broken = straight;
  broken.run = run;
  broken.stop_after = 5;
  EXPECT_THROW(train_avatar(broken), Interrupted);
  broken.stop_after = 0;
  broken.resume = true;
  train_avatar(broken);
  EXPECT_TRUE(bytes_of(RunDirectory{straight.run}.weights()) ==
              bytes_of(RunDirectory{broken.run}.weights()));
}

TEST(Training, WithAFrozenNetworkMovesTheStaticValuesAlone) {
  const TemporaryFolder folder;
  TrainRequest straight = both_parts(folder.path("straight"), 12);
  straight.settings.init = run_of_both_parts();
  straight.settings.freeze_network = true;
  straight.settings.poses_per_iteration = 2;
  train_avatar(straight);
  const TensorFile first = read_tensor_file(RunDirectory{run_of_both_parts()}.weights()),
                   frozen = read_tensor_file(RunDirectory{straight.run}.weights());
  ASSERT_EQ(first.tensors.size(), frozen.tensors.size());
  for (const auto& [name, tensor] : first.tensors)
    EXPECT_EQ(frozen.tensors.at(name).values == tensor.values, name != "static.0") << name;
  TrainRequest broken = straight;
  broken.run = folder.path("broken");
  broken.settings.threads = 2;
  broken.stop_after = 5;
  EXPECT_THROW(train_avatar(broken), Interrupted);
  broken.stop_after = 0;
  broken.resume = true;
  broken.settings.init.clear();  // a run goes on by its own settings, from its checkpoint
  train_avatar(broken);
  EXPECT_TRUE(bytes_of(RunDirectory{straight.run}.weights()) ==
              bytes_of(RunDirectory{broken.run}.weights()));
  TrainRequest bad = both_parts(folder.path("bad"), 5);
  bad.settings.freeze_network = true;
  EXPECT_NE(error_of(bad).find("init"), std::string::npos) << error_of(bad);
  bad.settings.init = run_of_both_parts();
  bad.settings.static_grids.clear();
  EXPECT_NE(error_of(bad).find("static_grids"), std::string::npos) << error_of(bad);
}

TEST(Training, OfALowRankResidualLeavesTheSumInTheKernelsAndBiasesAlone) {
  const TemporaryFolder folder;
  TrainRequest straight = both_parts(folder.path("straight"), 12);
  straight.settings.init = run_of_both_parts();
  straight.settings.freeze_network = true;
  straight.settings.adapter.rank = 2;
  straight.settings.clip_gradient = 1e-2;
  train_avatar(straight);
  expect_same_bits_after_a_stop(straight, folder.path("broken"));

  const TensorFile first = read_tensor_file(RunDirectory{run_of_both_parts()}.weights()),
                   tuned = read_tensor_file(RunDirectory{straight.run}.weights()),
                   checkpoint = read_tensor_file(RunDirectory{straight.run}.checkpoint());
  const std::vector<float>& factors = checkpoint.tensors.at("adapter.factors").values;
  size_t at = 0;
  double largest = 0, moved = 0;
  for (int layer = 0; layer < 15; ++layer) {
    const std::string name = "layer." + std::to_string(layer);
    EXPECT_EQ(tuned.tensors.at(name + ".bias").values, first.tensors.at(name + ".bias").values);
    const NamedTensor &before = first.tensors.at(name + ".weight"),
                      &after = tuned.tensors.at(name + ".weight");
    const auto rows = static_cast<size_t>(before.shape[0]), columns = before.values.size() / rows;
    const float *a = &factors.at(at), *b = a + rows * 2;
    at += 2 * (rows + columns);
    for (size_t i = 0; i < before.values.size(); ++i) {
      double sum = before.values[i];
      for (size_t r = 0; r < 2; ++r)
        sum += double(a[i / columns * 2 + r]) * double(b[r * columns + i % columns]);
      largest = std::max(largest, std::abs(sum - double(after.values[i])));
      moved = std::max(moved, std::abs(double(after.values[i]) - double(before.values[i])));
    }
  }
  EXPECT_EQ(at, factors.size());
  std::printf("largest error of a folded weight %.3g, largest step %.3g\n", largest, moved);
  EXPECT_LT(largest, 1e-6);
  EXPECT_GT(moved, 1e-3);
  const nlohmann::json parts = read_run({straight.run}).json.at("parts");
  EXPECT_EQ(parts.at("network").at("adapter").at("values"), factors.size());
  TrainedAvatar avatar = TrainedAvatar::open({.run = straight.run});
  const AlignedBytes bytes(pack_avatar(avatar, {straight.run}, {}));
  const Package package = value_or_throw(Package::open(bytes.bytes(), "package"), "package");
  const std::span<const float> packed = package.avatar().network.layers[0].weights;
  EXPECT_TRUE(
      std::equal(packed.begin(), packed.end(), tuned.tensors.at("layer.0.weight").values.begin()));
  TrainRequest bad = straight;
  bad.run = folder.path("bad");
  bad.settings.freeze_network = false;
  EXPECT_NE(error_of(bad).find("network_rank"), std::string::npos) << error_of(bad);
}

TEST(Training, OfABasisMovesKernelsInItsDirectionsAloneAndGoesOnWithThatBasisAlone) {
  const TemporaryFolder folder;
  TrainRequest free = both_parts(folder.path("free"), 8);
  free.settings.init = run_of_both_parts();
  train_avatar(free);
  const std::string basis = folder.path("basis.safetensors");
  const KernelBasisReport report = make_kernel_basis(run_of_both_parts(), {free.run}, 2, basis);
  EXPECT_EQ(report.people, 1u);
  ASSERT_EQ(report.energy.size(), 15u);
  for (const double share : report.energy) EXPECT_GT(share, 0.05);

  TrainRequest straight = both_parts(folder.path("straight"), 12);
  straight.settings.init = run_of_both_parts();
  straight.settings.freeze_network = true;
  straight.settings.adapter = {.kind = model::AdapterKind::kBasis, .rank = 2, .basis = basis};
  train_avatar(straight);
  expect_same_bits_after_a_stop(straight, folder.path("broken"));

  // Whatever a kernel changed by lies in its two directions.
  const TensorFile first = read_tensor_file(RunDirectory{run_of_both_parts()}.weights()),
                   tuned = read_tensor_file(RunDirectory{straight.run}.weights());
  const model::KernelBasis directions = read_kernel_basis(basis);
  double outside = 0, moved = 0;
  for (size_t layer = 0; layer < directions.size(); ++layer) {
    const std::string name = "layer." + std::to_string(layer) + ".weight";
    const int64_t columns = directions[layer].size(1);
    const torch::Tensor difference =
        torch::tensor(at::ArrayRef<float>(tuned.tensors.at(name).values)).view({-1, columns}) -
        torch::tensor(at::ArrayRef<float>(first.tensors.at(name).values)).view({-1, columns});
    const torch::Tensor inside =
        at::mm(at::mm(difference, directions[layer].t()), directions[layer]);
    outside = std::max(outside, (difference - inside).abs().max().item<double>());
    moved = std::max(moved, difference.abs().max().item<double>());
  }
  std::printf("largest step %.3g, outside of the basis %.3g\n", moved, outside);
  EXPECT_GT(moved, 1e-3);
  EXPECT_LT(outside, 1e-6);

  TrainRequest other = straight;
  other.run = folder.path("other");
  other.stop_after = 5;
  EXPECT_THROW(train_avatar(other), Interrupted);
  make_kernel_basis(free.run, {run_of_both_parts(), straight.run}, 2, basis);
  other.stop_after = 0;
  other.resume = true;
  EXPECT_NE(error_of(other).find("network_basis"), std::string::npos) << error_of(other);
}

// The capture under two names.
TrainRequest of_two_people(const TemporaryFolder& folder, const char* run, uint64_t iterations) {
  TrainRequest two = both_parts(folder.path(run), iterations);
  for (const char* name : {"ann", "bob"}) {
    if (!fs::exists(folder.path(name)))
      fs::copy(small_capture().data, folder.path(name), fs::copy_options::recursive);
  }
  two.data = folder.path("ann");
  two.more_data = {folder.path("bob") + "/"};
  return two;
}

TEST(Training, OfSeveralPeopleSharesTheNetworkAndGivesEachARun) {
  const TemporaryFolder folder;
  TrainRequest straight = of_two_people(folder, "straight", 13);
  train_avatar(straight);
  TrainRequest broken = of_two_people(folder, "broken", 13);
  broken.stop_after = 5;  // it is bob's turn
  EXPECT_THROW(train_avatar(broken), Interrupted);
  broken.stop_after = 0;
  broken.resume = true;
  train_avatar(broken);
  const auto weights = [](const std::string& run) {
    return read_tensor_file(RunDirectory{run}.weights());
  };
  for (const char* whose : {"", "/ann", "/bob"})
    EXPECT_TRUE(bytes_of(RunDirectory{straight.run + whose}.weights()) ==
                bytes_of(RunDirectory{broken.run + whose}.weights()))
        << whose;
  const TensorFile all = weights(straight.run), ann = weights(straight.run + "/ann"),
                   bob = weights(straight.run + "/bob");
  for (const auto& [name, tensor] : ann.tensors)
    EXPECT_EQ(bob.tensors.at(name).values == tensor.values, name != "static.0") << name;
  const std::vector<float>&of_ann = ann.tensors.at("static.0").values,
        &of_bob = bob.tensors.at("static.0").values, &mean = all.tensors.at("static.0").values;
  for (size_t i = 0; i < mean.size(); ++i)
    ASSERT_EQ(mean[i], (of_ann[i] + of_bob[i]) / 2) << "a value to start from";
  for (const char* whose : {"/ann", "/bob"}) {
    TrainedAvatar avatar = TrainedAvatar::open({.run = straight.run + whose});
    EXPECT_FALSE(pack_avatar(avatar, {straight.run + whose}, {}).empty());
    EXPECT_EQ(avatar.description().json.at("status"), "finished");
    EXPECT_EQ(avatar.description().json.at("one_of"), 2);
  }
  const auto refusal = [](const auto& call) {
    try {
      call();
    } catch (const InputError& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  EXPECT_NE(refusal([&] { TrainedAvatar::open({.run = straight.run}); }).find("several people"),
            std::string::npos);
  TrainRequest one = request(straight.run + "/bob", 13);
  one.resume = true;
  EXPECT_NE(error_of(one).find("one of several people"), std::string::npos) << error_of(one);
}

TEST(Training, OfSeveralPeopleIsRefusedWithoutValuesOfTheirOwnOrWithFewer) {
  const TemporaryFolder folder;
  TrainRequest bad = of_two_people(folder, "run", 5);
  bad.settings.static_grids.clear();
  EXPECT_NE(error_of(bad).find("static_grids"), std::string::npos) << error_of(bad);
  bad = of_two_people(folder, "run", 5);
  bad.stop_after = 2;
  bad.more_data.push_back(folder.path("ann"));  // of another capture, for all we know
  EXPECT_THROW(train_avatar(bad), Interrupted);
  for (const char* whose : {"/ann", "/bob", "/ann_2"})
    EXPECT_TRUE(fs::exists(RunDirectory{bad.run + whose}.weights())) << whose;
  bad.resume = true;
  bad.more_data.clear();
  EXPECT_NE(error_of(bad).find("was begun with 3 people, not 1"), std::string::npos)
      << error_of(bad);
}

}  // namespace
}  // namespace figurine::train::shared_network_test
