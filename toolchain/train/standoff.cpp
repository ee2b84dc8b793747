#include "toolchain/train/standoff.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "figurine/check.h"

namespace figurine::train {

namespace {

constexpr int kCell_px = 8;
constexpr double kFadeStart = 0.3, kFadeEnd = 0.5;  // of the budget

std::array<double, 3> to_view(const Camera& camera, const float* world) {
  std::array<double, 3> view;
  for (int i = 0; i < 3; ++i) {
    const float* row = &camera.view_from_world[4 * i];
    view[i] = double(row[0]) * world[0] + double(row[1]) * world[1] + double(row[2]) * world[2] +
              double(row[3]);
  }
  return view;
}

// Projected centres in square cells over a crop; centres outside it lie in the cells at its edge,
// which are never farther than they are.
class NearestCentre {
 public:
  NearestCentre(const StandoffView& view, std::span<const float> position_m)
      : columns_(int(view.crop.width) / kCell_px + 1),
        rows_(int(view.crop.height) / kCell_px + 1),
        begin_(size_t(columns_) * rows_ + 1) {
    std::vector<Centre> centres;
    std::vector<uint32_t> cells;
    for (uint32_t i = 0; i < position_m.size() / 3; ++i) {
      const std::array<double, 3> at = to_view(*view.camera, &position_m[3 * size_t(i)]);
      if (!(at[2] > view.camera->near_m)) continue;
      const double x = view.camera->fx_px * at[0] / at[2] + view.camera->cx_px - view.crop.x;
      const double y = view.camera->fy_px * at[1] / at[2] + view.camera->cy_px - view.crop.y;
      if (!std::isfinite(x) || !std::isfinite(y)) continue;
      centres.push_back({x, y, i});
      cells.push_back(uint32_t(cell(y, rows_) * columns_ + cell(x, columns_)));
      ++begin_[cells.back() + 1];
    }
    for (size_t c = 1; c < begin_.size(); ++c) begin_[c] += begin_[c - 1];
    centres_.resize(centres.size());
    std::vector<uint32_t> next(begin_.begin(), begin_.end() - 1);
    for (size_t i = 0; i < centres.size(); ++i) centres_[next[cells[i]]++] = centres[i];
  }

  // The index of the nearest centre to (x, y) in the crop; false if there is none.
  bool find(double x, double y, uint32_t& index) const {
    double best = std::numeric_limits<double>::infinity();
    const int column = cell(x, columns_), row = cell(y, rows_);
    for (int ring = 0; ring < std::max(columns_, rows_); ++ring) {
      const double unseen_px =
          double(ring - 1) * kCell_px;  // what lies in this ring is at least so far away
      if (ring > 0 && unseen_px > 0 && unseen_px * unseen_px > best) break;
      for (int r = std::max(0, row - ring); r <= std::min(rows_ - 1, row + ring); ++r) {
        const int step = std::abs(r - row) == ring || ring == 0 ? 1 : 2 * ring;
        for (int c = column - ring; c <= column + ring; c += step) {
          if (c >= 0 && c < columns_) search(size_t(r) * columns_ + c, x, y, best, index);
        }
      }
    }
    return std::isfinite(best);
  }

 private:
  struct Centre {
    double x, y;
    uint32_t index;
  };

  static int cell(double at, int count) {
    return int(std::clamp(std::floor(at / kCell_px), 0.0, double(count - 1)));
  }

  void search(size_t cell, double x, double y, double& best, uint32_t& index) const {
    for (uint32_t i = begin_[cell]; i < begin_[cell + 1]; ++i) {
      const double dx = centres_[i].x - x, dy = centres_[i].y - y, squared = dx * dx + dy * dy;
      if (squared < best) best = squared, index = centres_[i].index;
    }
  }

  int columns_, rows_;
  std::vector<uint32_t> begin_;  // of each cell in centres_, and the end
  std::vector<Centre> centres_;
};

// Huber's function of what a distance exceeds the reach by, and its slope.
std::array<double, 2> pull(double distance, const StandoffOptions& options) {
  const double beyond = distance - options.reach_m, soft = options.soft_m;
  if (beyond <= 0) return {0, 0};
  return beyond < soft ? std::array{beyond * beyond / (2 * soft), beyond / soft}
                       : std::array{beyond - soft / 2, 1.0};
}

}  // namespace

double standoff_loss(const StandoffView& view, std::span<const float> position_m,
                     const StandoffOptions& options, double scale, std::span<double> gradient) {
  FIG_CHECK(gradient.size() == position_m.size(), "one gradient per centre");
  const Camera& camera = *view.camera;
  const NearestCentre nearest(view, position_m);
  const double share =
      options.weight / (double(options.unit_m) * view.crop.width * view.crop.height);
  double loss = 0;
  for (uint32_t row = 0; row < view.crop.height; ++row) {
    for (uint32_t column = 0; column < view.crop.width; ++column) {
      const size_t pixel = size_t(row) * view.crop.width + column;
      const double uncovered = double(view.mask[pixel]) - view.alpha[pixel];
      if (!(uncovered > options.smallest_uncovered)) continue;
      const double x = column + 0.5, y = row + 0.5;
      uint32_t index = 0;
      if (!nearest.find(x, y, index)) return 0;
      std::array<double, 3> ray{(x + view.crop.x - camera.cx_px) / camera.fx_px,
                                (y + view.crop.y - camera.cy_px) / camera.fy_px, 1};
      const double length = std::sqrt(ray[0] * ray[0] + ray[1] * ray[1] + 1);
      for (double& value : ray) value /= length;
      const std::array<double, 3> centre = to_view(camera, &position_m[3 * size_t(index)]);
      const double along = ray[0] * centre[0] + ray[1] * centre[1] + ray[2] * centre[2];
      std::array<double, 3> across;
      for (int k = 0; k < 3; ++k) across[k] = centre[k] - along * ray[k];
      const double distance =
          std::sqrt(across[0] * across[0] + across[1] * across[1] + across[2] * across[2]);
      const auto [cost, slope] = pull(distance, options);
      loss += share * uncovered * cost;
      if (slope == 0) continue;
      const double factor = scale * share * uncovered * slope / distance;
      for (int k = 0; k < 3; ++k) {
        const float* m = camera.view_from_world.data();
        gradient[3 * size_t(index) + k] +=
            factor * (m[k] * across[0] + m[4 + k] * across[1] + m[8 + k] * across[2]);
      }
    }
  }
  return loss;
}

void add_offset_gradient(const model::HeadFrame& frame, std::span<const double> position_gradient,
                         float* head_gradient) {
  const Body& body = *frame.body;
  const uint32_t channels = head_channels(frame.decoding.sh_degree);
  for (uint32_t i = 0; i < body.texel_count(); ++i) {
    const double* d = &position_gradient[3 * size_t(i)];
    if (d[0] == 0 && d[1] == 0 && d[2] == 0) continue;
    const std::array<float, 12> m =
        blend(frame.world_from_rest, &body.texel_joints[size_t(i) * kSkinInfluences],
              &body.texel_weights[size_t(i) * kSkinInfluences])
            .m;
    float* const dh = head_gradient + size_t(i) * channels;
    for (int k = 0; k < 3; ++k)
      dh[k] +=
          float(frame.decoding.offset_scale_m * (m[k] * d[0] + m[4 + k] * d[1] + m[8 + k] * d[2]));
  }
}

double standoff_fade(double progress) {
  return std::clamp((kFadeEnd - progress) / (kFadeEnd - kFadeStart), 0.0, 1.0);
}

}  // namespace figurine::train
