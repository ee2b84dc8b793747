// What one person changes of a network that stays, against sums in double.
#include "toolchain/model/network_adapter.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <string>

#include "tests/toolchain/model/random_tensor.h"
#include "toolchain/error.h"
#include "toolchain/tensor_operations.h"

namespace figurine::model::network_adapter_test {
namespace {

using testing_tools::random_tensor;
using testing_tools::to_double;

constexpr AdapterKind kKinds[] = {AdapterKind::kResidual, AdapterKind::kScale, AdapterKind::kBasis};

Network small_network() { return make_pose_unet(16, 6, 4, head_channels(0)); }

// Of people whose kernels differ from the network's by noise.
KernelBasis some_basis(const PoseUNet& unet, uint32_t rank) {
  std::vector<torch::Tensor> people;
  for (uint32_t p = 0; p < 4; ++p)
    people.push_back(unet.weights().detach() + random_tensor({unet.weights().numel()}, 40 + p));
  return find_kernel_basis(unet, people, rank);
}

NetworkAdapter make(AdapterKind kind, const PoseUNet& unet, uint32_t rank, uint64_t seed) {
  AdapterOptions options{.kind = kind, .rank = rank, .seed = seed, .basis = {}};
  if (kind == AdapterKind::kBasis) options.basis = some_basis(unet, rank);
  return {unet, options};
}

// The definitions of the header, kernel by kernel; factors: [Q].
std::vector<double> folded_in_double(const NetworkAdapter& adapter, const PoseUNet& unet,
                                     int64_t most_rank) {
  const std::vector<double> base = to_double(adapter.base()),
                            factors = to_double(adapter.factors()),
                            basis = to_double(adapter.basis());
  std::vector<double> folded = base;
  const bool shared = adapter.kind() == AdapterKind::kBasis;
  size_t at = 0, basis_at = 0;
  for (const KernelMatrix& kernel : unet.kernels()) {
    const auto rank = static_cast<size_t>(std::min({most_rank, kernel.rows, kernel.columns})),
               rows = static_cast<size_t>(kernel.rows),
               columns = static_cast<size_t>(kernel.columns),
               begin = static_cast<size_t>(kernel.begin);
    const double *a = &factors[at], *b = shared ? &basis[basis_at] : a + rows * rank;
    at += rows * rank + (shared ? 0 : rank * columns);
    basis_at += rank * columns;
    for (size_t i = 0; i < rows; ++i) {
      for (size_t k = 0; k < columns; ++k) {
        double product = 0;
        for (size_t r = 0; r < rank; ++r) product += a[i * rank + r] * b[r * columns + k];
        double& weight = folded[begin + i * columns + k];
        weight = adapter.kind() == AdapterKind::kScale ? weight * (1 + product) : weight + product;
      }
    }
  }
  EXPECT_EQ(at, factors.size());
  EXPECT_TRUE(!shared || basis_at == basis.size());
  return folded;
}

TEST(NetworkAdapter, StartsAtItsNetworkAndFoldsIntoTheKernels) {
  for (const AdapterKind kind : kKinds) {
    PoseUNet unet(make_pose_unet(16, 6, 8, head_channels(0)), {.seed = 5});
    const torch::Tensor before = unet.weights().detach().clone();
    NetworkAdapter adapter = make(kind, unet, 3, 7), again = make(kind, unet, 3, 7);
    EXPECT_TRUE(torch::equal(adapter.factors(), again.factors()));
    if (kind != AdapterKind::kBasis) {
      EXPECT_FALSE(torch::equal(adapter.factors(), make(kind, unet, 3, 8).factors()));
    }
    adapter.fold_into(unet.weights());
    EXPECT_TRUE(torch::equal(unet.weights(), before)) << to_string(kind);
    adapter.factors().add_(random_tensor({adapter.factors().numel()}, 3));
    adapter.fold_into(unet.weights());
    const std::vector<double> expected = folded_in_double(adapter, unet, 3),
                              folded = to_double(unet.weights());
    double largest = 0, scale = 0;
    for (size_t i = 0; i < expected.size(); ++i) {
      largest = std::max(largest, std::abs(expected[i] - folded[i]));
      scale = std::max(scale, std::abs(expected[i]));
    }
    std::printf("%s: largest error of a folded weight %.3g of %.3g\n", to_string(kind), largest,
                scale);
    EXPECT_LT(largest, 2e-6 * scale) << to_string(kind);
    adapter.fold_into(unet.weights());
    EXPECT_EQ(to_double(unet.weights()), folded) << "folding again adds nothing";
  }
}

TEST(NetworkAdapter, IsNoWiderThanAKernel) {
  const PoseUNet unet(small_network(), {});
  for (const AdapterKind kind : kKinds) {
    const NetworkAdapter adapter = make(kind, unet, 100, 1);
    int64_t count = 0;
    for (const KernelMatrix& kernel : unet.kernels()) {
      const int64_t columns = kind == AdapterKind::kBasis ? 0 : kernel.columns;
      count += (kernel.rows + columns) * std::min(kernel.rows, kernel.columns);
    }
    EXPECT_EQ(adapter.factors().numel(), count) << to_string(kind);
    EXPECT_EQ(factor_count(unet, kind, 100), static_cast<uint64_t>(count)) << to_string(kind);
  }
}

// A linear function of the weights is at most bilinear in the factors: central differences of it
// are exact but for rounding. What stays of A has no gradient.
TEST(NetworkAdapter, GradientsEqualDifferencesInDouble) {
  const PoseUNet unet(small_network(), {.seed = 5});
  const torch::Tensor by_weights = random_tensor({unet.weights().numel()}, 7);
  const std::vector<double> wide = to_double(by_weights);
  for (const AdapterKind kind : kKinds) {
    NetworkAdapter adapter = make(kind, unet, 2, 3);
    adapter.factors().add_(random_tensor({adapter.factors().numel()}, 8), 0.1);
    const std::vector<double> gradient = to_double(adapter.gradients(by_weights));
    float* const factors = adapter.factors().mutable_data_ptr<float>();
    const auto loss = [&] {
      const std::vector<double> weights = folded_in_double(adapter, unet, 2);
      double sum = 0;
      for (size_t i = 0; i < weights.size(); ++i) sum += wide[i] * weights[i];
      return sum;
    };
    double scale = 0, largest = 0;
    for (const double value : gradient)
      scale += value * value / static_cast<double>(gradient.size());
    scale = std::sqrt(scale);
    size_t checked = 0, still = 0;
    for (size_t i = 0; i < gradient.size(); i += 7) {
      const float kept = factors[i];
      factors[i] = kept + 0.25f;
      const double up = loss(), above = factors[i];
      factors[i] = kept - 0.25f;
      const double down = loss(), below = factors[i];
      factors[i] = kept;
      if (gradient[i] == 0 && kind == AdapterKind::kScale) {
        ++still;
        continue;
      }
      ++checked;
      largest = std::max(largest, std::abs(gradient[i] - (up - down) / (above - below)));
    }
    std::printf("%s: largest error %.3g of RMS over %zu values, %zu stay\n", to_string(kind),
                largest / scale, checked, still);
    EXPECT_LT(largest, 1e-5 * scale) << to_string(kind);
    if (kind == AdapterKind::kScale) {
      // A half of A, which is fewer values than B.
      EXPECT_GT(still, checked / 40);
      EXPECT_LT(still, checked / 2);
    } else {
      EXPECT_EQ(still, 0u);
    }
  }
}

// A step of AdamW moves every factor that learns by the learning rate: a weight of every kind then
// moves about as far as if it learned itself.
TEST(NetworkAdapter, AStepMovesWeightsAsFarAsAStepOnThem) {
  for (const AdapterKind kind : kKinds) {
    PoseUNet unet(make_pose_unet(16, 6, 16, head_channels(0)), {.seed = 5});
    const std::vector<double> before = to_double(unet.weights());
    NetworkAdapter adapter = make(kind, unet, 4, 9);
    const torch::Tensor direction =
        adapter.gradients(random_tensor({unet.weights().numel()}, 12)).sign();
    adapter.factors().add_(direction, 1e-3);
    adapter.fold_into(unet.weights());
    const std::vector<double> after = to_double(unet.weights());
    double sum = 0;
    size_t count = 0;
    for (const KernelMatrix& kernel : unet.kernels()) {
      for (int64_t i = kernel.begin; i < kernel.begin + kernel.rows * kernel.columns; ++i, ++count)
        sum += std::pow(after[size_t(i)] - before[size_t(i)], 2);
    }
    const double step = std::sqrt(sum / static_cast<double>(count)) / 1e-3;
    std::printf("%s: a weight moves %.2f steps\n", to_string(kind), step);
    EXPECT_GT(step, 0.5) << to_string(kind);
    EXPECT_LT(step, 2) << to_string(kind);
  }
}

TEST(KernelBasis, FindsTheDirectionsThatPeopleDifferBy) {
  const PoseUNet unet(small_network(), {.seed = 5});
  const torch::Tensor base = unet.weights().detach();
  // Two directions of every kernel's inputs, the first used three times as much.
  std::vector<torch::Tensor> directions, people;
  uint32_t seed = 100;
  for (const KernelMatrix& kernel : unet.kernels()) {
    torch::Tensor pair = random_tensor({2, kernel.columns}, seed++);
    pair[0].div_(pair[0].norm());
    pair[1].sub_(pair[0] * pair[0].dot(pair[1]));
    pair[1].div_(pair[1].norm());
    directions.push_back(pair);
  }
  for (int p = 0; p < 3; ++p) {
    torch::Tensor weights = base.clone();
    size_t l = 0;
    for (const KernelMatrix& kernel : unet.kernels()) {
      torch::Tensor amounts = random_tensor({kernel.rows, 2}, seed++);
      amounts.select(1, 0).mul_(3);
      weights.narrow(0, kernel.begin, kernel.rows * kernel.columns)
          .add_(at::mm(amounts, directions[l++]).flatten());
    }
    people.push_back(weights);
  }
  std::vector<double> energy;
  const KernelBasis two = find_kernel_basis(unet, people, 2, &energy);
  ASSERT_EQ(two.size(), directions.size());
  for (size_t l = 0; l < two.size(); ++l) {
    EXPECT_NEAR(energy[l], 1, 1e-9) << l;
    const torch::Tensor overlap = at::mm(two[l], directions[l].t());
    EXPECT_NEAR(overlap.square().sum().item<double>(), 2, 1e-4) << "the same plane, layer " << l;
    EXPECT_NEAR((at::mm(two[l], two[l].t()) - torch::eye(2)).abs().max().item<double>(), 0, 1e-5);
    for (int64_t r = 0; r < 2; ++r) {
      const torch::Tensor row = two[l][r];
      EXPECT_GT(row[row.abs().argmax().item<int64_t>()].item<float>(), 0) << "sign, layer " << l;
    }
  }
  find_kernel_basis(unet, people, 1, &energy);
  for (const double share : energy) {
    EXPECT_GT(share, 0.5);
    EXPECT_LT(share, 1);
  }
  find_kernel_basis(unet, {base, base}, 2, &energy);
  for (const double share : energy) EXPECT_EQ(share, 1) << "nobody differs";
}

TEST(KernelBasis, OfAnotherNetworkIsRefused) {
  const PoseUNet unet(small_network(), {}), wide(make_pose_unet(16, 6, 8, head_channels(0)), {});
  const auto refusal = [&](KernelBasis basis, uint32_t rank) {
    try {
      const NetworkAdapter adapter(
          unet, {.kind = AdapterKind::kBasis, .rank = rank, .seed = 1, .basis = std::move(basis)});
    } catch (const InputError& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  EXPECT_NE(refusal(some_basis(wide, 2), 2).find("layer"), std::string::npos);
  EXPECT_NE(refusal(some_basis(unet, 2), 3).find("needs 3 rows"), std::string::npos);
  KernelBasis short_one = some_basis(unet, 2);
  short_one.pop_back();
  EXPECT_NE(refusal(short_one, 2).find("kernels"), std::string::npos);
  EXPECT_EQ(refusal(some_basis(unet, 3), 2), "") << "more rows than wanted";
}

}  // namespace
}  // namespace figurine::model::network_adapter_test
