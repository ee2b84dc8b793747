#include "toolchain/body/body_model.h"

#include <Eigen/Dense>

#include "figurine/check.h"

namespace figurine::body {
namespace {

template <class Out>
void add_shape(std::span<const float> basis, std::span<const float> shape, uint32_t count,
               Out& values) {
  for (uint32_t s = 0; s < count && s < shape.size(); ++s) {
    const float* direction = basis.data() + size_t{s} * values.size();
    for (size_t i = 0; i < values.size(); ++i) values[i] += shape[s] * direction[i];
  }
}

}  // namespace

std::vector<float> shaped_vertices(const BodyModel& model, std::span<const float> shape) {
  std::vector<float> vertices = model.surface.position_m;
  add_shape(model.vertex_shape_basis_m, shape, model.shape_count, vertices);
  return vertices;
}

JointPositions shaped_joints(const BodyModel& model, std::span<const float> shape) {
  JointPositions joints = model.joint_m;
  add_shape(model.joint_shape_basis_m, shape, model.shape_count, joints);
  return joints;
}

std::vector<float> project_shape(const BodyModel& model, std::span<const float> vertices_m) {
  const size_t values = model.surface.position_m.size();
  FIG_CHECK(vertices_m.size() == values, "project_shape needs the surface's own vertices");
  using RowMatrix = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  const Eigen::Map<const RowMatrix> basis(model.vertex_shape_basis_m.data(), model.shape_count,
                                          static_cast<Eigen::Index>(values));
  const Eigen::Map<const Eigen::VectorXf> target(vertices_m.data(),
                                                 static_cast<Eigen::Index>(values));
  const Eigen::Map<const Eigen::VectorXf> mean(model.surface.position_m.data(),
                                               static_cast<Eigen::Index>(values));
  // Normal equations in double: S is small and the directions are far from parallel.
  const Eigen::MatrixXd b = basis.cast<double>();
  const Eigen::VectorXd x = (b * b.transpose()).ldlt().solve(b * (target - mean).cast<double>());
  std::vector<float> shape(model.shape_count);
  for (uint32_t s = 0; s < model.shape_count; ++s) shape[s] = static_cast<float>(x[s]);
  return shape;
}

}  // namespace figurine::body
