#include "toolchain/measure/weight_space.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "figurine/check.h"
#include "figurine/texel_grid.h"

namespace figurine::measure {

namespace {

constexpr double kRounding =
    1e-10;  // of the largest variance: a Gram matrix of a few hundred rows in double leaves 1e-14

size_t vector_size(const std::vector<Token>& tokens) {
  return tokens.empty() ? 0 : tokens.back().begin + tokens.back().size;
}

// All members' values of a stretch agree in column d.
bool is_shared(const RowMatrix& training, Eigen::Index d) {
  for (Eigen::Index n = 1; n < training.rows(); ++n) {
    if (training(n, d) != training(0, d)) return false;
  }
  return true;
}

}  // namespace

namespace {

// The place of a cell on a curve on which cells that are near each other on the grid mostly are,
// too (Morton, 1966): the bits of row and column by turns.
uint64_t z_order(uint32_t v, uint32_t u) {
  uint64_t place = 0;
  for (uint32_t bit = 0; bit < 16; ++bit) {
    place |= uint64_t{v >> bit & 1} << (2 * bit + 1) | uint64_t{u >> bit & 1} << (2 * bit);
  }
  return place;
}

}  // namespace

// The cells of every part of the body along that curve, cut into pieces of one size, or one more:
// `pieces` of the grid, and one more for every part that does not fill its last. names:
// "PART.PIECE" of each.
WeightLayout::Patches WeightLayout::cut_into_patches(const TexelGrid& grid, const Body& body,
                                                     size_t pieces, std::vector<PatchName>& names) {
  const std::vector<BodyPart> of_texel = texel_parts(body);
  const size_t most = (grid.cell_count() + pieces - 1) / pieces;
  WeightLayout::Patches patches;
  for (const BodyPart part : kBodyParts) {
    std::vector<uint32_t> rows;
    for (uint32_t row = 0; row < grid.cell_count(); ++row) {
      if (of_texel[grid.source[row]] == part) rows.push_back(row);
    }
    std::ranges::sort(rows, {}, [&](uint32_t row) {
      return z_order(grid.cell[row] / grid.size, grid.cell[row] % grid.size);
    });
    const size_t own = (rows.size() + most - 1) / most;
    for (size_t p = 0; p < own; ++p) {
      const size_t size = rows.size() * (p + 1) / own - rows.size() * p / own;
      patches.patch_rows.push_back(static_cast<uint32_t>(size));
      names.push_back({std::string(to_string(part)) + "." + std::to_string(p), part});
    }
    patches.row.insert(patches.row.end(), rows.begin(), rows.end());
  }
  return patches;
}

WeightLayout::WeightLayout(const Network& network, size_t shape_coefficients) {
  add_network(network);
  if (shape_coefficients > 0) add("shape", shape_coefficients);
  end_network();
}

WeightLayout::WeightLayout(const Population& population, const Body& body, size_t pieces)
    : own_network_(population.coding != DifferenceCoding::kNone) {
  FIG_CHECK(pieces >= 1, "a grid in one piece or more");
  if (own_network_) add_network(population.network);
  const size_t shape = population.shape.size() / population.size();
  if (shape > 0) add("shape", shape);
  end_network();
  for (size_t g = 0; g < population.static_part.groups.size(); ++g) {
    const StaticGroup& group = population.static_part.groups[g];
    std::vector<PatchName> names;
    Patches patches = cut_into_patches(make_texel_grid(body, group.grid_size), body, pieces, names);
    FIG_CHECK(patches.row.size() * group.channels == group.values.size(),
              "a row of static values for every cell");
    add_group(g, group.channels, std::move(patches), names);
  }
}

WeightLayout::WeightLayout(const Sampler& sampler) : own_network_(!sampler.shares_network) {
  if (own_network_) {
    const std::vector<size_t> sizes = sampler_token_sizes(sampler);
    for (const Layer& layer : sampler.network.layers) {
      if (layer.op == LayerOp::kConv2d)
        add("layer." + std::to_string(tokens_.size()), sizes[tokens_.size()]);
    }
    kernel_tokens_ = tokens_.size();
  }
  if (sampler.shape_count > 0) add("shape", sampler.shape_count);
  end_network();
  for (size_t g = 0; g < sampler.static_groups.size(); ++g) {
    const SampledStaticGroup& group = sampler.static_groups[g];
    std::vector<PatchName> names;
    for (size_t p = 0; p < group.patch_rows.size(); ++p) names.push_back({std::to_string(p), {}});
    add_group(g, group.channels, {{group.row.begin(), group.row.end()}, group.patch_rows}, names);
  }
}

void WeightLayout::add(const std::string& name, size_t size, std::optional<BodyPart> part) {
  tokens_.push_back({name, size_, size, part});
  size_ += size;
}

void WeightLayout::add_network(const Network& network) {
  for (const Layer& layer : network.layers) {
    if (layer.op == LayerOp::kConv2d)
      add("layer." + std::to_string(tokens_.size()), layer.weights.size() + layer.bias.size());
  }
  kernel_tokens_ = tokens_.size();
}

void WeightLayout::end_network() {
  network_size_ = size_;
  map_begin_ = tokens_.size();
}

void WeightLayout::add_group(size_t group, uint32_t channels, Patches patches,
                             const std::vector<PatchName>& names) {
  const size_t first = place_.size();
  place_.resize(first + patches.row.size() * channels);
  size_t next = 0;
  for (size_t p = 0; p < patches.patch_rows.size(); ++p) {
    size_t at = size_;
    for (uint32_t k = 0; k < patches.patch_rows[p]; ++k, ++next) {
      for (uint32_t c = 0; c < channels; ++c)
        place_[first + size_t{patches.row[next]} * channels + c] = at++;
    }
    add("static." + std::to_string(group) + "." + names[p].name, at - size_, names[p].part);
  }
  patches_.push_back(std::move(patches));
}

void WeightLayout::read(const Avatar& avatar, std::span<double> weights) const {
  FIG_CHECK(weights.size() == size_, "one value for each of the avatar's");
  auto out = weights.begin();
  if (own_network_) {
    for (const Layer& layer : avatar.network.layers) {
      out = std::copy(layer.weights.begin(), layer.weights.end(), out);
      out = std::copy(layer.bias.begin(), layer.bias.end(), out);
    }
  }
  out = std::copy(avatar.shape.begin(), avatar.shape.end(), out);
  FIG_CHECK(static_cast<size_t>(out - weights.begin()) == network_size_,
            "as many values of network and shape as the layout has");
  if (place_.empty()) return;
  size_t k = 0;
  for (const StaticGroup& group : avatar.static_part.groups) {
    for (size_t i = 0; i < group.values.size(); ++i)
      weights[place_[k++]] = double{group.scale[i % group.channels]} * group.values[i];
  }
  FIG_CHECK(k == place_.size(), "as many static values as the layout has");
}

RowMatrix WeightLayout::read(const Population& population) const {
  std::vector<size_t> everybody(population.size());
  std::iota(everybody.begin(), everybody.end(), size_t{0});
  return read(population, everybody);
}

RowMatrix WeightLayout::read(const Population& population, std::span<const size_t> members) const {
  RowMatrix rows(static_cast<Eigen::Index>(members.size()), static_cast<Eigen::Index>(size_));
  std::vector<float> storage(member_floats(population));
  for (size_t i = 0; i < members.size(); ++i)
    read(open_member(population, members[i], storage), {&rows(Eigen::Index(i), 0), size_});
  return rows;
}

Avatar WeightLayout::with(const Avatar& avatar, std::span<const double> weights,
                          WeightStorage& storage) const {
  FIG_CHECK(weights.size() == size_, "one value for each of the avatar's");
  size_t scales = 0;
  for (const StaticGroup& group : avatar.static_part.groups) scales += group.channels;
  storage.floats.resize(network_size_ + (place_.empty() ? 0 : scales));
  std::transform(weights.begin(), weights.begin() + static_cast<ptrdiff_t>(network_size_),
                 storage.floats.begin(), [](double value) { return static_cast<float>(value); });
  Avatar changed = avatar;
  size_t at = 0;
  const auto take = [&](size_t count) {
    at += count;
    return std::span<float>(storage.floats).subspan(at - count, count);
  };
  if (own_network_) {
    for (Layer& layer : changed.network.layers) {
      layer.weights = take(layer.weights.size());
      layer.bias = take(layer.bias.size());
    }
  }
  changed.shape = take(changed.shape.size());
  changed.fixed_point = {};
  FIG_CHECK(at == network_size_, "as many values of network and shape as the layout has");
  if (place_.empty()) return changed;
  storage.integers.resize(place_.size());
  size_t first = 0;
  for (StaticGroup& group : changed.static_part.groups) {
    const std::span<float> scale = take(group.channels);
    const std::span<int8_t> out =
        std::span<int8_t>(storage.integers).subspan(first, group.values.size());
    for (uint32_t c = 0; c < group.channels; ++c) {
      const double most =
          group.first_channel + c < kStaticColour ? kMaxStaticValue : kMaxStaticLogGain;
      double largest = 0;
      for (size_t i = c; i < out.size(); i += group.channels)
        largest = std::max(largest, std::abs(weights[place_[first + i]]));
      scale[c] = std::max(static_cast<float>(std::min(largest, 0.999 * most) / 127),
                          std::numeric_limits<float>::min());
      for (size_t i = c; i < out.size(); i += group.channels)
        out[i] = predict_static(static_cast<float>(weights[place_[first + i]]), scale[c]);
    }
    group.values = out;
    group.scale = scale;
    first += out.size();
  }
  return changed;
}

Standardisation::Standardisation(const RowMatrix& training, std::vector<Token> tokens)
    : tokens_(std::move(tokens)),
      mean_(training.colwise().mean()),
      factor_(RowVector::Zero(training.cols())) {
  FIG_CHECK(training.rows() >= 2 && size_t(training.cols()) == vector_size(tokens_),
            "at least two members of these tokens");
  const auto members = static_cast<double>(training.rows());
  for (const Token& token : tokens_) {
    const auto begin = static_cast<Eigen::Index>(token.begin),
               end = static_cast<Eigen::Index>(token.begin + token.size);
    double squares = 0;
    size_t count = 0;
    for (Eigen::Index d = begin; d < end; ++d) {
      if (is_shared(training, d)) {
        mean_[d] = training(0, d);  // to the bit: a mean of equal values may differ from them
        continue;
      }
      squares += (training.col(d).array() - mean_[d]).square().sum();
      factor_[d] = 1;
      ++count;
    }
    const double scale =
        count == 0 ? 0 : std::sqrt(squares / (members * static_cast<double>(count)));
    if (count > 0) factor_.segment(begin, end - begin) /= scale;
    scale_.push_back(scale);
    varying_.push_back(count);
  }
}

size_t Standardisation::varying() const {
  size_t sum = 0;
  for (const size_t count : varying_) sum += count;
  return sum;
}

RowMatrix Standardisation::standardise(RowMatrix weights) const {
  weights = ((weights.rowwise() - mean_).array().rowwise() * factor_.array()).matrix();
  return weights;
}

RowVector Standardisation::restore(const RowVector& z) const {
  RowVector weights = mean_;
  for (size_t t = 0; t < tokens_.size(); ++t) {
    for (size_t i = tokens_[t].begin; i < tokens_[t].begin + tokens_[t].size; ++i) {
      const auto d = static_cast<Eigen::Index>(i);
      if (factor_[d] > 0) weights[d] += scale_[t] * z[d];
    }
  }
  return weights;
}

PrincipalBasis::PrincipalBasis(const RowMatrix& training, size_t begin, size_t size)
    : training_(&training), begin_(begin), size_(size) {
  const auto block =
      training.middleCols(static_cast<Eigen::Index>(begin), static_cast<Eigen::Index>(size));
  const Eigen::Index members = training.rows();
  Eigen::MatrixXd gram = Eigen::MatrixXd::Zero(members, members);
  gram.selfadjointView<Eigen::Lower>().rankUpdate(block);
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(
      gram);  // ascending; reads the lower triangle
  const Eigen::VectorXd& values = solver.eigenvalues();
  Eigen::Index rank = 0;
  while (rank < members - 1 && values[members - 1 - rank] > kRounding * values[members - 1]) ++rank;
  variance_.resize(rank);
  mixture_.resize(members, rank);
  for (Eigen::Index k = 0; k < rank; ++k) {
    const double squares = values[members - 1 - k];
    variance_[k] = squares / static_cast<double>(members);
    mixture_.col(k) = solver.eigenvectors().col(members - 1 - k) / std::sqrt(squares);
  }
}

RowMatrix PrincipalBasis::directions(size_t rank) const {
  const auto block =
      training_->middleCols(static_cast<Eigen::Index>(begin_), static_cast<Eigen::Index>(size_));
  return mixture_.leftCols(static_cast<Eigen::Index>(std::min(rank, this->rank()))).transpose() *
         block;
}

Eigen::VectorXd PrincipalBasis::coordinates(const RowVector& z) const {
  const auto begin = static_cast<Eigen::Index>(begin_), size = static_cast<Eigen::Index>(size_);
  const Eigen::VectorXd against_members =
      training_->middleCols(begin, size) * z.segment(begin, size).transpose();
  return mixture_.transpose() * against_members;
}

RowVector PrincipalBasis::combine(const Eigen::VectorXd& coordinates, size_t rank) const {
  const auto block =
      training_->middleCols(static_cast<Eigen::Index>(begin_), static_cast<Eigen::Index>(size_));
  const auto used = static_cast<Eigen::Index>(std::min(rank, this->rank()));
  const Eigen::VectorXd of_members = mixture_.leftCols(used) * coordinates.head(used);
  return of_members.transpose() * block;
}

size_t directions_for(const Eigen::VectorXd& variance, double share) {
  const double wanted =
      share * variance.sum() * (1 - 1e-12);  // a share of exactly all must not fail by a rounding
  double sum = 0;
  for (Eigen::Index k = 0; k < variance.size(); ++k) {
    sum += variance[k];
    if (sum >= wanted) return static_cast<size_t>(k) + 1;
  }
  return static_cast<size_t>(variance.size());
}

double participation_ratio(const Eigen::VectorXd& variance) {
  const double squares = variance.squaredNorm(), sum = variance.sum();
  return squares > 0 ? sum * sum / squares : 0;
}

RowMatrix rms_distances(const RowMatrix& a, const RowMatrix& b, size_t varying) {
  // |x - y|^2 = |x|^2 + |y|^2 - 2 x.y, which cancels: distances below 1e-7 of the vectors' length
  // are rounding.
  RowMatrix squares = -2 * (a * b.transpose());
  squares.colwise() += a.rowwise().squaredNorm();
  squares.rowwise() += b.rowwise().squaredNorm().transpose();
  return (squares.array().max(0) / static_cast<double>(std::max<size_t>(varying, 1)))
      .sqrt()
      .matrix();
}

}  // namespace figurine::measure
