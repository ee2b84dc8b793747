// What an avatar's network knows of poses: how unusual a pose is beside those that it was trained
// on, and the pose that it may be shown in place of one that is far outside (docs/numerics.md,
// "Known poses").
//
// A pose is a vector x of rotation vectors, three numbers for each of some joints. Of the root it
// is that of its tilt alone: which way a figure faces is neither usual nor unusual. With the
// training poses' mean m and covariance C, distance = sqrt((x - m)^T C^-1 (x - m)) (Mahalanobis
// 1936). What a distance means is said by the training poses' own, of which a package has a table.
//
// In double and in a fixed order, without libm: the same bits on every CPU. All of it is const, and
// any number of threads may ask at a time.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "figurine/avatar.h"
#include "figurine/status.h"

namespace figurine {

// Of training poses, how many the knee begins beyond: nearer poses stay as they are, to the bit.
inline constexpr double kKnownShare = 0.95;

// How unusual a pose is.
struct PoseRarity {
  float distance = 0;      // from the training poses' mean, in their own deviations
  float share_beyond = 0;  // of the training poses, those that are farther out; 0 to 1
};

class KnownPoses {
 public:
  KnownPoses() = default;  // nothing is known
  // Copies what it needs. kInvalidArgument if the arrays' sizes do not fit the joints; kCorrupt
  // "pose.covariance: is not positive definite".
  static Result<KnownPoses> create(const PoseStatistics& statistics);

  // Whether there is no table of distances: then only distance() has a meaning, and where there is
  // no covariance either not even that.
  bool empty() const { return distances_.empty(); }

  // rotations: [J,4] quaternions, wxyz, J above the largest joint; one of no direction or that is
  // not finite counts as none. Finite, at most 1e30.
  double distance(std::span<const float> rotations) const;

  // There must be a table.
  PoseRarity rarity(std::span<const float> rotations) const;

  // The pose that is shown to the network: with the distance d, a = distance_beyond(1 -
  // kKnownShare) and b the largest of the table, x' = m + (d'/d) (x - m) where d > a,
  //   d' = a + (b - a) t / (1 + t),   t = (d - a) / (b - a)        (d' = a where b = a)
  // so that it bends away from the true one without a corner and never leaves b. Joints that are
  // not in the statistics keep their rotations, the root its heading. False where d <= a: then
  // nothing is written. pulled: [J,4] unit quaternions at those joints; not the same memory.
  bool pull(std::span<const float> rotations, std::span<float> pulled) const;

  // x' = m + share (x - m), whatever the distance; a table is not needed.
  void move_to_mean(std::span<const float> rotations, double share, std::span<float> moved) const;

  // The distance that this share of the training poses lie beyond; the inverse of share_beyond.
  double distance_beyond(double share) const;

  uint64_t memory_bytes() const {
    return lower_.capacity() * sizeof(double) + mean_.capacity() * sizeof(double) +
           distances_.capacity() * sizeof(float) + joints_.capacity();
  }

 private:
  size_t features() const { return mean_.size(); }
  void deviation(std::span<const float> rotations, double* out) const;  // x - m
  double length(const double* deviation) const;
  void move(std::span<const float> rotations, const double* deviation, double share,
            std::span<float> moved) const;
  double share_beyond(double distance) const;
  double knee(double distance) const;

  std::vector<uint8_t> joints_;   // [P]
  std::vector<double> mean_;      // [3P]
  std::vector<double> lower_;     // rows of L, C = L L^T: 3P (3P + 1) / 2
  std::vector<float> distances_;  // [Q]
};

// The vector x of a pose, [3P] of these joints; rotations as for KnownPoses::distance.
void pose_features(std::span<const uint8_t> joints, std::span<const float> rotations,
                   std::span<double> x);

// The rotation vector (axis times angle in radians, at most pi long) of a quaternion, wxyz, of any
// length; zero where that is zero or not finite.
std::array<double, 3> rotation_vector(const float* wxyz);

// As a table of distances: 2 to kMaxPoseDistances, finite, not negative, none below the one before.
// kCorrupt "pose.distances: ...".
Status validate_pose_distances(std::span<const float> distances);

}  // namespace figurine
