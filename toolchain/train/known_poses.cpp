#include "toolchain/train/known_poses.h"

#include <algorithm>

#include "figurine/known_poses.h"
#include "formats/writer/package_writer.h"
#include "toolchain/error.h"

namespace figurine::train {

namespace {

constexpr uint32_t kBodyJoints = 22;  // SMPL-X joints 0..21: body without hands and face
// Added to every feature's spread, so that a joint that never moved in training still has a scale.
constexpr double kPoseDeviation_rad = 0.03;

using Rows = std::vector<std::vector<double>>;  // [F][3P]

// Of all rows but those from `begin` to `end`.
void measure(const Rows& rows, size_t begin, size_t end, KnownPoseStatistics& out) {
  const size_t size = rows[0].size();
  const auto counts = [&](size_t i) { return i < begin || i >= end; };
  const double count = static_cast<double>(rows.size() - (end - begin));
  std::vector<double> mean(size, 0), covariance(size * size, 0);
  for (size_t r = 0; r < rows.size(); ++r) {
    if (!counts(r)) continue;
    for (size_t i = 0; i < size; ++i) mean[i] += rows[r][i] / count;
  }
  for (size_t r = 0; r < rows.size(); ++r) {
    if (!counts(r)) continue;
    for (size_t i = 0; i < size; ++i) {
      for (size_t k = 0; k < size; ++k)
        covariance[i * size + k] += (rows[r][i] - mean[i]) * (rows[r][k] - mean[k]) / count;
    }
  }
  for (size_t i = 0; i < size; ++i)
    covariance[i * size + i] += kPoseDeviation_rad * kPoseDeviation_rad;
  out.mean.assign(mean.begin(), mean.end());
  out.covariance.assign(covariance.begin(), covariance.end());
}

// Values at 0, 1/64, ..., 1 of their order, straight lines between.
std::vector<float> quantiles(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  std::vector<float> table;
  for (size_t k = 0; k < kPoseDistances; ++k) {
    const double place = static_cast<double>(k * (values.size() - 1)) / (kPoseDistances - 1);
    const size_t low = static_cast<size_t>(place), high = std::min(low + 1, values.size() - 1);
    const double share = place - static_cast<double>(low);
    table.push_back(static_cast<float>(values[low] + share * (values[high] - values[low])));
  }
  return table;
}

}  // namespace

KnownPoseStatistics known_poses(const std::vector<std::vector<float>>& poses,
                                uint32_t joint_count) {
  if (poses.empty()) throw InputError("training poses: there are none");
  KnownPoseStatistics all;
  for (uint32_t j = 0; j < std::min(kBodyJoints, joint_count); ++j)
    all.joints.push_back(static_cast<uint8_t>(j));
  Rows rows(poses.size(), std::vector<double>(3 * all.joints.size()));
  for (size_t i = 0; i < poses.size(); ++i) pose_features(all.joints, poses[i], rows[i]);
  measure(rows, 0, 0, all);

  const size_t folds = std::min(kPoseFolds, poses.size());
  std::vector<double> distances;
  KnownPoseStatistics others{.joints = all.joints, .mean = {}, .covariance = {}, .distances = {}};
  for (size_t fold = 0; fold < folds; ++fold) {
    const size_t begin = fold * poses.size() / folds, end = (fold + 1) * poses.size() / folds;
    measure(rows, begin, folds > 1 ? end : begin, others);  // of one pose its own
    const KnownPoses known = value_or_throw(KnownPoses::create(others.view()), "training poses");
    for (size_t i = begin; i < end; ++i)
      distances.push_back(std::min(known.distance(poses[i]), double{kMaxPoseDistance}));
  }
  all.distances = quantiles(std::move(distances));
  return all;
}

std::vector<std::byte> with_known_poses(const Package& avatar,
                                        const KnownPoseStatistics& statistics) {
  Avatar content = avatar.avatar();
  content.pose_statistics = statistics.view();
  return value_or_throw(write_package(content, avatar.budget(), avatar.provenance()), content.name);
}

}  // namespace figurine::train
