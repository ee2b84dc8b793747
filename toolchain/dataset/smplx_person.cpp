#include "toolchain/dataset/smplx_person.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "toolchain/dataset/dataset.h"
#include "toolchain/dataset/json_fields.h"
#include "toolchain/dataset/read_file.h"
#include "toolchain/error.h"

namespace figurine::dataset {

namespace {

using Quaternion = std::array<double, 4>;  // wxyz
using Vector = std::array<double, 3>;

constexpr size_t kBodyNumbers = 66;                           // the root and 21 joints
constexpr size_t kHandNumbers = 45;                           // 15 joints
constexpr size_t kJaw = 22, kLeftHand = 25, kRightHand = 40;  // joints
constexpr double kMostTurn_rad = 30;  // a rotation vector beyond is in degrees, or damaged
constexpr double kMostDistance_m = 1e5;
constexpr double kMostShape = 1e3;
// Of SMPL's mean body, in its own coordinates (2 cm higher or lower with the sex). SMPL-X's is
// where the body package says.
constexpr Vector kSmplPelvis_m{-0.0018, -0.2233, 0.0282};

// The unit quaternion of a rotation vector.
Quaternion quaternion_from_rotation_vector(const double* v) {
  const double angle = std::sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
  const double s = angle < 1e-8 ? 0.5 : std::sin(angle / 2) / angle;
  return {std::cos(angle / 2), s * v[0], s * v[1], s * v[2]};
}

Quaternion multiply(const Quaternion& a, const Quaternion& b) {
  return {a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
          a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
          a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
          a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0]};
}

Vector rotate(const Quaternion& q, const Vector& v) {
  const Quaternion r = multiply(multiply(q, {0, v[0], v[1], v[2]}), {q[0], -q[1], -q[2], -q[3]});
  return {r[1], r[2], r[3]};
}

// Numbers that may be rotations: what is beyond all sense is degrees or damage.
std::vector<double> turns(const JsonField& field, size_t count = 0) {
  std::vector<double> values = field.numbers(count);
  for (const double value : values) {
    if (!(std::abs(value) <= kMostTurn_rad))
      field.fail("holds a rotation of " + std::to_string(value) + " rad; are these degrees?");
  }
  return values;
}

Vector translation(const JsonField& field) {
  const std::vector<double> values = field.numbers(3);
  for (const double value : values) {
    if (!(std::abs(value) <= kMostDistance_m)) field.fail("is not within 100 km");
  }
  return {values[0], values[1], values[2]};
}

void set_joints(SmplxPerson& person, size_t first, const double* values, size_t count) {
  std::copy_n(values, count, &person.joints[3 * first]);
}

// Of the key that is there.
void set_part(const JsonField& field, const char* key, size_t first, size_t count,
              SmplxPerson& person) {
  if (!field.has(key)) return;
  const std::vector<double> values = turns(field[key]);
  if (values.size() == count) set_joints(person, first, values.data(), count);
}

void read_poses(const JsonField& field, SmplxPerson& person) {
  const std::vector<double> poses = turns(field);
  const size_t count = poses.size();
  if (count == 63 || count == 69) {  // without the root's three
    set_joints(person, 1, poses.data(), 63);
  } else if (count == 66 || count == 72 || count == 78 || count == 87 || count == 156 ||
             count == 165) {
    // Beside Rh they are zeros; of SMPL's own files they are the rotation.
    set_joints(person, 0, poses.data(), kBodyNumbers);
  } else {
    field.fail("has " + std::to_string(count) +
               " numbers; 63, 66, 69, 72, 78, 87, 156 and 165 are known");
  }
  if (count == 87) set_joints(person, kJaw, &poses[78], 9);
  if (count == 165) set_joints(person, kJaw, &poses[66], 9);
  if (count == 156 || count == 165)
    set_joints(person, kLeftHand, &poses[count - 2 * kHandNumbers], 2 * kHandNumbers);
  person.smpl = count == 69 || count == 72 || count == 78 || count == 156;
}

void read_shapes(const JsonField& field, SmplxPerson& person) {
  const std::vector<double> shapes = field.numbers();
  if (shapes.size() < 10)
    field.fail("has " + std::to_string(shapes.size()) + " numbers, expected 10 or more");
  for (const double value : shapes) {
    if (!(std::abs(value) <= kMostShape)) field.fail("holds a coefficient that is no person's");
    person.shapes.push_back(static_cast<float>(value));
  }
}

std::optional<int64_t> read_id(const JsonField& field) {
  for (const char* key : {"id", "personID"}) {
    if (!field.has(key)) continue;
    const nlohmann::json& value = field[key].json();
    if (value.is_number_integer()) return value.get<int64_t>();
    if (value.is_number_float() && value.get<double>() == std::floor(value.get<double>()))
      return static_cast<int64_t>(value.get<double>());
    if (value.is_string()) {
      const std::string text = value.get<std::string>();
      if (!text.empty() && text.size() < 10 &&
          text.find_first_not_of("0123456789") == std::string::npos)
        return std::stoll(text);
    }
    field[key].fail("is no whole number");
  }
  return std::nullopt;
}

SmplxPerson read_person(const JsonField& field) {
  SmplxPerson person;
  person.id = read_id(field);
  person.about_origin = field.has("Rh") || field.has("Th") || !field.has("global_orient");
  const char* orient = person.about_origin ? "Rh" : "global_orient";
  person.rotation = quaternion_from_rotation_vector(turns(field[orient], 3).data());
  person.translation_m = translation(field[person.about_origin ? "Th" : "transl"]);
  read_poses(field[field.has("poses") || person.about_origin ? "poses" : "body_pose"], person);
  set_part(field, "jaw_pose", kJaw, 3, person);
  set_part(field, "leye_pose", kJaw + 1, 3, person);
  set_part(field, "reye_pose", kJaw + 2, 3, person);
  set_part(field, "left_hand_pose", kLeftHand, kHandNumbers, person);
  set_part(field, "right_hand_pose", kRightHand, kHandNumbers, person);
  read_shapes(field[field.has("shapes") || !field.has("betas") ? "shapes" : "betas"], person);
  return person;
}

}  // namespace

std::vector<SmplxPerson> read_smplx_people(const std::string& path) {
  const nlohmann::json value = read_json_file(path);
  const JsonField whole(value, path + ": ");
  std::vector<SmplxPerson> people;
  if (value.is_object() && !whole.has("annots")) {
    people.push_back(read_person(whole));  // one person's file
  } else {
    const std::vector<JsonField> items =
        value.is_object() ? whole["annots"].items() : whole.items();
    for (const JsonField& item : items) people.push_back(read_person(item));
  }
  return people;
}

std::map<uint32_t, SmplxPerson> choose_person(
    const std::map<uint32_t, std::vector<SmplxPerson>>& people, const std::string& folder) {
  std::set<std::optional<int64_t>> ids;
  size_t most = 0;
  for (const auto& [number, here] : people) {
    most = std::max(most, here.size());
    for (const SmplxPerson& person : here) ids.insert(person.id);
  }
  if (most > 1 && !ids.contains(0)) {
    throw InputError(folder +
                     ": id: there are several people, and none is 0, which is whom the capture is "
                     "of");
  }
  const bool by_id = ids.contains(0);
  if (!by_id && ids.size() > 1)
    throw InputError(folder + ": id: differs from file to file, and none is 0");
  std::map<uint32_t, SmplxPerson> chosen;
  for (const auto& [number, here] : people) {
    for (const SmplxPerson& person : here) {
      if (by_id && person.id != 0) continue;
      if (!chosen.emplace(number, person).second)
        throw InputError(folder + ": id: two people of frame " + std::to_string(number) + " are 0");
    }
  }
  return chosen;
}

// World point = R (x of the model, its root at rest) + Th: a rotation about the model's origin.
// Our root turns about its own joint r and stands at r + t:
//   about the origin   r + t = R r_model + Th,   r_model = r - origin
//   about the pelvis   r + t = r_model + transl
void set_pose(const SmplxPerson& person, const std::array<double, 3>& root_rest_m,
              const ModelOrigin& origin, CaptureFrame& frame) {
  frame.rotations.assign(size_t{kSmplxJoints} * 4, 0.0f);
  for (uint32_t j = 0; j < kSmplxJoints; ++j) {
    Quaternion q = quaternion_from_rotation_vector(&person.joints[3 * size_t{j}]);
    if (j == 0) q = multiply(person.rotation, q);
    for (size_t i = 0; i < 4; ++i) frame.rotations[j * 4 + i] = static_cast<float>(q[i]);
  }
  Vector pelvis{};
  for (size_t i = 0; i < 3; ++i) pelvis[i] = root_rest_m[i] - origin.position_m[i];
  if (person.smpl && origin.smplx) pelvis = kSmplPelvis_m;
  if (person.about_origin) pelvis = rotate(person.rotation, pelvis);
  for (size_t i = 0; i < 3; ++i)
    frame.root_translation_m[i] =
        static_cast<float>(pelvis[i] + person.translation_m[i] - root_rest_m[i]);
}

std::array<double, 3> root_rest_position(const Body& body, const std::vector<float>& shape) {
  Vector root{body.joint_position_m[0], body.joint_position_m[1], body.joint_position_m[2]};
  const size_t used = std::min<size_t>(shape.size(), body.shape_count());
  for (size_t s = 0; s < used; ++s) {
    for (size_t i = 0; i < 3; ++i)
      root[i] += double{shape[s]} * body.joint_shape_basis_m[s * body.joint_count() * 3 + i];
  }
  return root;
}

void check_shape(const Body& body, const std::vector<float>& shape, const std::string& where) {
  const auto size = [&](std::span<const float> joints) {
    double sum = 0;
    for (size_t j = 1; j < body.joint_count(); ++j) {
      double squared = 0;
      for (size_t i = 0; i < 3; ++i) {
        const double across = double{joints[3 * j + i]} - joints[i];
        squared += across * across;
      }
      sum += std::sqrt(squared);
    }
    return sum / std::max(1u, body.joint_count() - 1);
  };
  std::vector<float> joints(body.joint_position_m.begin(), body.joint_position_m.end());
  for (size_t s = 0; s < std::min<size_t>(shape.size(), body.shape_count()); ++s) {
    for (size_t i = 0; i < joints.size(); ++i)
      joints[i] += shape[s] * body.joint_shape_basis_m[s * joints.size() + i];
  }
  const double ratio = size(joints) / size(body.joint_position_m);
  if (!(ratio >= 0.2 && ratio <= 5))
    throw InputError(where + ": makes no person: bones " + std::to_string(ratio) +
                     " times as long as those of the mean body");
}

}  // namespace figurine::dataset
