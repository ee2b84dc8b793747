#include "figurine/known_poses.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "figurine/check.h"
#include "figurine/detail/double_math.h"

namespace figurine {

namespace {

constexpr size_t kMaxFeatures = 3 * size_t{kMaxJoints};
constexpr double kFarthest = 1e30;  // also of what no number says
constexpr double kSmallAngle = 1e-9;

struct Quaternion {
  double w = 1, x = 0, y = 0, z = 0;
};

// Of unit length and with w >= 0: q and -q are one rotation, and this one turns by at most pi.
Quaternion normalised(const float* wxyz) {
  double length2 = 0;
  for (int k = 0; k < 4; ++k) length2 += double{wxyz[k]} * wxyz[k];
  if (!(length2 > 1e-36) || !(length2 < 1e36)) return {};
  const double factor = (wxyz[0] < 0 ? -1.0 : 1.0) / std::sqrt(length2);
  return {factor * wxyz[0], factor * wxyz[1], factor * wxyz[2], factor * wxyz[3]};
}

Quaternion product(const Quaternion& a, const Quaternion& b) {
  return {
      a.w * b.w - a.x * b.x - a.y * b.y - a.z * b.z, a.w * b.x + a.x * b.w + a.y * b.z - a.z * b.y,
      a.w * b.y - a.x * b.z + a.y * b.w + a.z * b.x, a.w * b.z + a.x * b.y - a.y * b.x + a.z * b.w};
}

// Of a unit quaternion with w >= 0.
void to_rotation_vector(const Quaternion& q, double* out) {
  const double sine = std::sqrt(q.x * q.x + q.y * q.y + q.z * q.z);
  const double factor = sine < kSmallAngle ? 2.0 : 2.0 * angle_of(sine, q.w) / sine;
  out[0] = factor * q.x;
  out[1] = factor * q.y;
  out[2] = factor * q.z;
}

Quaternion from_rotation_vector(const double* r) {
  constexpr double kTwoTurns = 8 * double_math::kHalfPi;  // of the half angle, in radians
  const double angle = std::sqrt(r[0] * r[0] + r[1] * r[1] + r[2] * r[2]);
  if (angle < kSmallAngle) return {1, 0.5 * r[0], 0.5 * r[1], 0.5 * r[2]};
  const double turns = angle / kTwoTurns;
  const SineCosine half = sine_cosine_of_turns(turns - std::floor(turns));
  const double factor = half.sine / angle;
  return {half.cosine, factor * r[0], factor * r[1], factor * r[2]};
}

// q = turn about the vertical x tilt, the tilt's axis horizontal. Upside down there is no heading
// to tell, and the turn is none.
Quaternion turn_of(const Quaternion& q) {
  const double length2 = q.w * q.w + q.y * q.y;
  if (!(length2 > 1e-24)) return {};
  const double length = std::sqrt(length2);
  return {q.w / length, 0, q.y / length, 0};
}

}  // namespace

std::array<double, 3> rotation_vector(const float* wxyz) {
  std::array<double, 3> vector;
  to_rotation_vector(normalised(wxyz), vector.data());
  return vector;
}

Status validate_pose_distances(std::span<const float> distances) {
  const auto corrupt = [](const std::string& what) {
    return Status(StatusCode::kCorrupt, "pose.distances: " + what);
  };
  if (distances.size() < 2 || distances.size() > kMaxPoseDistances)
    return corrupt("has not 2 to " + std::to_string(kMaxPoseDistances) + " values");
  for (size_t i = 0; i < distances.size(); ++i) {
    if (!(distances[i] >= 0 && distances[i] <= kMaxPoseDistance)) {
      return corrupt("value " + std::to_string(i) + " is not within 0 and 1e6");
    }
    if (i > 0 && distances[i] < distances[i - 1])
      return corrupt("value " + std::to_string(i) + " is below the one before");
  }
  return {};
}

Result<KnownPoses> KnownPoses::create(const PoseStatistics& statistics) {
  const size_t n = 3 * statistics.joints.size();
  if (n == 0 || n > kMaxFeatures || statistics.mean.size() != n ||
      statistics.covariance.size() != n * n) {
    return Status(StatusCode::kInvalidArgument,
                  "pose statistics: mean or covariance do not fit the joints");
  }
  if (!statistics.distances.empty())
    FIG_RETURN_IF_ERROR(validate_pose_distances(statistics.distances));
  KnownPoses known;
  known.joints_ = statistics.joints;
  known.mean_.assign(statistics.mean.begin(), statistics.mean.end());
  known.distances_.assign(statistics.distances.begin(), statistics.distances.end());
  known.lower_.resize(n * (n + 1) / 2);
  for (size_t i = 0, row = 0; i < n; row += ++i) {
    double* const of_i = known.lower_.data() + row;
    for (size_t j = 0, other = 0; j <= i; other += ++j) {
      const double* const of_j = known.lower_.data() + other;
      double sum = statistics.covariance[i * n + j];
      for (size_t k = 0; k < j; ++k) sum -= of_i[k] * of_j[k];
      if (j == i && !(sum > 0))
        return Status(StatusCode::kCorrupt, "pose.covariance: is not positive definite");
      of_i[j] = j == i ? std::sqrt(sum) : sum / of_j[j];
    }
  }
  return known;
}

void pose_features(std::span<const uint8_t> joints, std::span<const float> rotations,
                   std::span<double> x) {
  FIG_CHECK(x.size() == 3 * joints.size(), "three numbers a joint");
  for (size_t p = 0; p < joints.size(); ++p) {
    const size_t joint = joints[p];
    FIG_CHECK(4 * joint + 4 <= rotations.size(), "a rotation for every joint of the statistics");
    Quaternion q = normalised(&rotations[4 * joint]);
    if (joint == 0) {
      const Quaternion turn = turn_of(q);
      q = product({turn.w, 0, -turn.y, 0}, q);
      q.y = 0;  // but for rounding it is
      if (q.w < 0) q = {-q.w, -q.x, 0, -q.z};
    }
    to_rotation_vector(q, &x[3 * p]);
  }
}

void KnownPoses::deviation(std::span<const float> rotations, double* out) const {
  pose_features(joints_, rotations, {out, features()});
  for (size_t i = 0; i < features(); ++i) out[i] -= mean_[i];
}

double KnownPoses::length(const double* deviation) const {
  double whitened[kMaxFeatures];
  double sum2 = 0;
  const double* row = lower_.data();
  for (size_t i = 0; i < features(); row += ++i) {
    double value = deviation[i];
    for (size_t k = 0; k < i; ++k) value -= row[k] * whitened[k];
    whitened[i] = value / row[i];
    sum2 += whitened[i] * whitened[i];
  }
  const double distance = std::sqrt(sum2);
  return distance < kFarthest ? distance : kFarthest;  // NaN as well
}

double KnownPoses::distance(std::span<const float> rotations) const {
  double x[kMaxFeatures];
  deviation(rotations, x);
  return length(x);
}

// Of Q distances value k is one that k / (Q - 1) of the training poses do not exceed, straight
// lines between.
double KnownPoses::share_beyond(double distance) const {
  const auto above = std::upper_bound(distances_.begin(), distances_.end(), distance);
  if (above == distances_.begin()) return 1;
  if (above == distances_.end()) return 0;
  const double low = above[-1], high = above[0];
  const double place =
      static_cast<double>(above - distances_.begin() - 1) + (distance - low) / (high - low);
  return 1 - place / static_cast<double>(distances_.size() - 1);
}

double KnownPoses::distance_beyond(double share) const {
  FIG_CHECK(!empty(), "a table of distances");
  const double last = static_cast<double>(distances_.size() - 1);
  const double place = (1 - std::clamp(share, 0.0, 1.0)) * last;
  const double whole = std::min(std::floor(place), last - 1);
  const float* const low = &distances_[static_cast<size_t>(whole)];
  return low[0] + (place - whole) * (double{low[1]} - low[0]);
}

PoseRarity KnownPoses::rarity(std::span<const float> rotations) const {
  FIG_CHECK(!empty(), "a table of distances");
  const double far = distance(rotations);
  return {.distance = static_cast<float>(far),
          .share_beyond = static_cast<float>(share_beyond(far))};
}

double KnownPoses::knee(double distance) const {
  const double a = distance_beyond(1 - kKnownShare), room = distances_.back() - a;
  if (distance <= a || !(room > 0)) return std::min(distance, a);
  const double t = (distance - a) / room;
  return a + room * (t / (1 + t));
}

bool KnownPoses::pull(std::span<const float> rotations, std::span<float> pulled) const {
  FIG_CHECK(!empty() && pulled.size() == rotations.size(), "a table, and room for the pose");
  double x[kMaxFeatures];
  deviation(rotations, x);
  const double far = length(x), near = knee(far);
  if (near >= far) return false;
  move(rotations, x, near / far, pulled);
  return true;
}

void KnownPoses::move_to_mean(std::span<const float> rotations, double share,
                              std::span<float> moved) const {
  FIG_CHECK(moved.size() == rotations.size(), "room for the pose");
  double x[kMaxFeatures];
  deviation(rotations, x);
  move(rotations, x, share, moved);
}

void KnownPoses::move(std::span<const float> rotations, const double* deviation, double share,
                      std::span<float> moved) const {
  std::copy(rotations.begin(), rotations.end(), moved.begin());
  for (size_t p = 0; p < joints_.size(); ++p) {
    double r[3];
    for (size_t k = 0; k < 3; ++k) r[k] = mean_[3 * p + k] + share * deviation[3 * p + k];
    Quaternion q = from_rotation_vector(r);
    if (joints_[p] == 0) q = product(turn_of(normalised(rotations.data())), q);
    float* const out = &moved[4 * size_t{joints_[p]}];
    out[0] = static_cast<float>(q.w), out[1] = static_cast<float>(q.x);
    out[2] = static_cast<float>(q.y), out[3] = static_cast<float>(q.z);
  }
}

}  // namespace figurine
