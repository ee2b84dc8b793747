#include "toolchain/body/mannequin.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "toolchain/body/skin.h"

namespace figurine::body {
namespace {

using Vec3 = Eigen::Vector3d;

constexpr double kStatureM = 1.70;  // of the mean template
constexpr double kAtlasUnits =
    32;                       // charts are laid out in 32nds of the atlas: at T = 32 a texel apart
constexpr int kCapRings = 4;  // rings of each rounded end, the pole not counted
constexpr int kRingsPerSpan = 5;  // rings between two sections of a tube

// A cross-section of a tube: an ellipse around the centre line.
struct Section {
  Vec3 centre;
  double side;   // half axis along the tube's `side` direction
  double front;  // half axis across it
};

// Which joint takes over where along a tube: the weight passes from one entry to the next around
// `at` within +-`blend` metres of arc length.
struct Takeover {
  uint8_t joint;
  Vec3 at;
  double blend_m;
};

struct Chart {
  double left, top, width, height;  // in 32nds of the atlas
};

struct Tube {
  Chart chart;
  int around;  // quads around
  Vec3 side;   // reference direction of the ellipse's first axis; front = side x tangent, the seam
               // lies opposite of front
  std::vector<Section> sections;
  double first_cap_m, last_cap_m;
  std::vector<Takeover>
      skin;  // ordered along the tube; the first joint's `at` and `blend_m` are not read
  Vec3 nose_tip = Vec3::Zero();
  double nose_scale = 0;  // 0: no nose
};

struct Figure {
  JointPositions joints{};
  std::vector<Tube> tubes;
};

void set(JointPositions& joints, int joint, const Vec3& p) {
  for (int i = 0; i < 3; ++i) joints[3 * joint + i] = static_cast<float>(p[i]);
}

Vec3 mirrored(const Vec3& p, int side) { return side == 0 ? p : Vec3(-p.x(), p.y(), p.z()); }

// Joints and sections of a mannequin. Lengths of the mean template are literal; `shape` moves and
// scales them.
class Builder {
 public:
  explicit Builder(const MannequinShape& shape)
      : scale_(1 + 0.07 * shape.stature / kStatureM),
        girth_(1 + 0.10 * shape.girth),
        legs_(0.03 * shape.legs),
        shoulders_(0.015 * shape.shoulders) {}

  Figure build() {
    trunk();
    for (int side = 0; side < 2; ++side) {
      leg(side);
      arm(side);
    }
    return std::move(figure_);
  }

 private:
  // A place of the mean template in this figure: longer legs lift everything above the knees'
  // middle, then all is scaled.
  Vec3 place(double x, double y, double z) const {
    const double lift = legs_ * std::clamp(y / 0.90, 0.0, 1.0);
    return scale_ * Vec3(x, y + lift, z);
  }
  Section section(const Vec3& centre, double side, double front) const {
    return {centre, side * girth_ * scale_, front * girth_ * scale_};
  }

  void trunk() {
    JointPositions& j = figure_.joints;
    const Vec3 pelvis = place(0, 0.95, 0), spine1 = place(0, 1.06, -0.005),
               spine2 = place(0, 1.18, -0.005), spine3 = place(0, 1.28, -0.01);
    const Vec3 neck = place(0, 1.44, -0.01), head = place(0, 1.53, 0.005);
    set(j, kPelvis, pelvis);
    set(j, kSpine1, spine1);
    set(j, kSpine2, spine2);
    set(j, kSpine3, spine3);
    set(j, kNeck, neck);
    set(j, kHead, head);
    set(j, kJaw, place(0, 1.535, 0.03));
    for (int side = 0; side < 2; ++side)
      set(j, kLeftEye + side, mirrored(place(0.032, 1.60, 0.085), side));

    const double wide = shoulders_ / 0.17;  // broader shoulders widen the chest
    figure_.tubes.push_back(
        {.chart = {0.5, 0.5, 12, 13},
         .around = 40,
         .side = Vec3::UnitX(),
         .sections = {section(place(0, 0.86, 0), 0.13, 0.09),
                      section(place(0, 0.93, -0.005), 0.165, 0.112),
                      section(place(0, 1.02, -0.003), 0.152, 0.100),
                      section(place(0, 1.10, 0), 0.134, 0.090),
                      section(place(0, 1.20, 0), 0.148 * (1 + 0.5 * wide), 0.102),
                      section(place(0, 1.30, 0), 0.160 * (1 + wide), 0.108),
                      section(place(0, 1.375, -0.005), 0.152 * (1 + wide), 0.086),
                      section(place(0, 1.43, -0.01), 0.075, 0.062)},
         .first_cap_m = 0.06 * scale_,
         .last_cap_m = 0.02 * scale_,
         .skin = {{kPelvis, pelvis, 0},
                  {kSpine1, spine1, 0.06},
                  {kSpine2, spine2, 0.05},
                  {kSpine3, spine3, 0.05}}});
    figure_.tubes.push_back({.chart = {0.5, 14.5, 12, 10},
                             .around = 32,
                             .side = Vec3::UnitX(),
                             .sections = {section(place(0, 1.41, -0.012), 0.056, 0.056),
                                          section(place(0, 1.47, -0.004), 0.049, 0.053),
                                          section(place(0, 1.515, 0.012), 0.052, 0.066),
                                          section(place(0, 1.55, 0.022), 0.062, 0.082),
                                          section(place(0, 1.60, 0.018), 0.071, 0.093),
                                          section(place(0, 1.645, 0.012), 0.070, 0.090)},
                             .first_cap_m = 0.02 * scale_,
                             .last_cap_m = 0.055 * scale_,
                             .skin = {{kSpine3, spine3, 0},
                                      {kNeck, neck, 0.03},
                                      {kHead, place(0, 1.515, 0.012), 0.025}},
                             .nose_tip = place(0, 1.588, 0.11),
                             .nose_scale = scale_});
  }

  void leg(int side) {
    const auto at = [&](double x, double y, double z) { return mirrored(place(x, y, z), side); };
    const Vec3 hip = at(0.09, 0.90, 0), knee = at(0.10, 0.49, 0.005),
               ankle = at(0.105, 0.085, -0.012), ball = at(0.11, 0.025, 0.115);
    set(figure_.joints, kLeftHip + side, hip);
    set(figure_.joints, kLeftKnee + side, knee);
    set(figure_.joints, kLeftAnkle + side, ankle);
    set(figure_.joints, kLeftFoot + side, ball);
    figure_.tubes.push_back({.chart = {13.5 + 7 * side, 0.5, 6, 13},
                             .around = 24,
                             .side = Vec3::UnitX(),
                             .sections = {section(at(0.105, 0.07, -0.016), 0.034, 0.038),
                                          section(at(0.104, 0.19, -0.012), 0.037, 0.042),
                                          section(at(0.102, 0.37, -0.016), 0.051, 0.057),
                                          section(at(0.10, 0.49, 0.002), 0.053, 0.057),
                                          section(at(0.10, 0.56, 0.004), 0.059, 0.064),
                                          section(at(0.095, 0.72, 0.002), 0.075, 0.083),
                                          section(at(0.088, 0.88, 0), 0.084, 0.092)},
                             .first_cap_m = 0.03 * scale_,
                             .last_cap_m = 0.08 * scale_,
                             .skin = {{uint8_t(kLeftAnkle + side), ankle, 0},
                                      {uint8_t(kLeftKnee + side), ankle, 0.03},
                                      {uint8_t(kLeftHip + side), knee, 0.05},
                                      {kPelvis, at(0.088, 0.96, 0), 0.04}}});
    figure_.tubes.push_back({.chart = {27.5, 0.5 + 7.0 * side, 4, 6},
                             .around = 20,
                             .side = -Vec3::UnitX(),  // the seam under the sole
                             .sections = {section(at(0.105, 0.042, -0.045), 0.032, 0.040),
                                          section(at(0.106, 0.048, 0.0), 0.034, 0.046),
                                          section(at(0.108, 0.036, 0.06), 0.039, 0.034),
                                          section(at(0.11, 0.026, 0.115), 0.042, 0.024),
                                          section(at(0.112, 0.018, 0.165), 0.036, 0.016)},
                             .first_cap_m = 0.025 * scale_,
                             .last_cap_m = 0.02 * scale_,
                             .skin = {{uint8_t(kLeftAnkle + side), ankle, 0},
                                      {uint8_t(kLeftFoot + side), ball, 0.025}}});
  }

  void arm(int side) {
    // Broader shoulders move the whole arm outward.
    const Vec3 out = mirrored(Vec3(shoulders_ * scale_, 0, 0), side);
    const auto at = [&](double x, double y, double z) -> Vec3 {
      return mirrored(place(x, y, z), side) + out;
    };
    const Vec3 shoulder = at(0.172, 1.362, -0.01), elbow = at(0.363, 1.171, -0.02),
               wrist = at(0.532, 1.002, 0.01);
    set(figure_.joints, kLeftCollar + side, mirrored(place(0.03, 1.37, 0.0), side));
    set(figure_.joints, kLeftShoulder + side, shoulder);
    set(figure_.joints, kLeftElbow + side, elbow);
    set(figure_.joints, kLeftWrist + side, wrist);
    const auto between = [](const Vec3& a, const Vec3& b, double t) -> Vec3 {
      return a + t * (b - a);
    };
    figure_.tubes.push_back(
        {.chart = {13.5 + 6 * side, 14.5, 5, 10},
         .around = 24,
         .side = side == 0 ? Vec3::UnitZ()
                           : Vec3(-Vec3::UnitZ()),  // the seam on the inside of both arms
         .sections = {section(shoulder, 0.052, 0.054),
                      section(between(shoulder, elbow, 0.4), 0.047, 0.045),
                      section(between(shoulder, elbow, 0.85), 0.039, 0.037),
                      section(elbow, 0.037, 0.036),
                      section(between(elbow, wrist, 0.3), 0.040, 0.037),
                      section(between(elbow, wrist, 0.98), 0.027, 0.021)},
         .first_cap_m = 0.05 * scale_,
         .last_cap_m = 0.02 * scale_,
         .skin = {{uint8_t(kLeftCollar + side), shoulder, 0},
                  {uint8_t(kLeftShoulder + side), shoulder, 0.04},
                  {uint8_t(kLeftElbow + side), elbow, 0.035},
                  {uint8_t(kLeftWrist + side), wrist, 0.02}}});
    hand(side, wrist, (wrist - elbow).normalized());
  }

  void hand(int side, const Vec3& wrist, const Vec3& along) {
    const uint8_t wrist_joint = uint8_t(kLeftWrist + side);
    // Fingers lie side by side along z, the index in front: palms face the thighs when the arms
    // hang.
    const Vec3 front = (Vec3::UnitZ() - along.z() * along).normalized();
    const Vec3 palm =
        mirrored(Vec3(-1, -1, 0), side).normalized();  // towards the body and the ground
    const auto from_wrist = [&](double a, double f, double p) -> Vec3 {
      return wrist + scale_ * (a * along + f * front + p * palm);
    };
    figure_.tubes.push_back({.chart = {25.5, 14.5 + 5.0 * side, 6, 4.5},
                             .around = 20,
                             .side = side == 0 ? front : Vec3(-front),
                             .sections = {section(from_wrist(-0.005, 0, 0), 0.026, 0.019),
                                          section(from_wrist(0.03, 0.002, 0), 0.037, 0.018),
                                          section(from_wrist(0.065, 0.0, 0), 0.041, 0.015),
                                          section(from_wrist(0.088, -0.002, 0), 0.039, 0.012)},
                             .first_cap_m = 0.015 * scale_,
                             .last_cap_m = 0.012 * scale_,
                             .skin = {{wrist_joint, wrist, 0}}});
    struct Finger {
      int first;
      Vec3 base, direction;
      double length, radius;
    };
    const Vec3 bent = (along + 0.08 * palm).normalized();
    const std::array<Finger, 5> fingers = {
        {{kLeftIndex1, from_wrist(0.088, 0.029, 0), (bent + 0.06 * front).normalized(), 0.078,
          0.0095},
         {kLeftMiddle1, from_wrist(0.093, 0.010, 0), bent, 0.086, 0.0098},
         {kLeftPinky1, from_wrist(0.080, -0.029, 0), (bent - 0.10 * front).normalized(), 0.062,
          0.0082},
         {kLeftRing1, from_wrist(0.089, -0.010, 0), (bent - 0.04 * front).normalized(), 0.080,
          0.0094},
         {kLeftThumb1, from_wrist(0.030, 0.030, 0.006),
          (0.75 * along + 0.6 * front + 0.15 * palm).normalized(), 0.085, 0.0112}}};
    for (int f = 0; f < 5; ++f) {
      const Finger& finger = fingers[f];
      const int first = finger.first + side * (kRightIndex1 - kLeftIndex1);
      std::array<Vec3, 4> knuckle;
      const double share[4] = {0, 0.45, 0.75, 1};
      for (int i = 0; i < 4; ++i)
        knuckle[i] = finger.base + scale_ * finger.length * share[i] * finger.direction;
      for (int i = 0; i < 3; ++i) set(figure_.joints, first + i, knuckle[i]);
      figure_.tubes.push_back(
          {.chart = {0.5 + 3.1 * (f + 5 * side), 25.5, 2.3, 6},
           .around = 10,
           .side = side == 0 ? front : Vec3(-front),
           .sections = {section(knuckle[0], finger.radius, finger.radius),
                        section(knuckle[1], finger.radius * 0.95, finger.radius * 0.95),
                        section(knuckle[2], finger.radius * 0.88, finger.radius * 0.88),
                        section(knuckle[3], finger.radius * 0.78, finger.radius * 0.78)},
           .first_cap_m = 0.012 * scale_,
           .last_cap_m = 0.007 * scale_,
           .skin = {{wrist_joint, knuckle[0], 0},
                    {uint8_t(first), knuckle[0], 0.010},
                    {uint8_t(first + 1), knuckle[1], 0.008},
                    {uint8_t(first + 2), knuckle[2], 0.007}}});
    }
  }

  double scale_, girth_, legs_, shoulders_;
  Figure figure_;
};

// One ring of a lofted tube, and where it lies along the tube in metres.
struct Ring {
  Vec3 centre, side, front;  // axes with their half lengths
  double arc_m;              // along the centre line, for skin weights
  double surface_m;          // along the surface, for the chart
};

template <class T>
T catmull_rom(const T& a, const T& b, const T& c, const T& d, double t) {
  return 0.5 * (2.0 * b + (c - a) * t + (2.0 * a - 5.0 * b + 4.0 * c - d) * (t * t) +
                (3.0 * (b - c) + d - a) * (t * t * t));
}

// Rings from pole to pole: rounded cap, the sections joined by Catmull-Rom splines, rounded cap.
// The first and last ring are the poles (axes zero).
std::vector<Ring> loft(const Tube& tube) {
  const std::vector<Section>& sections = tube.sections;
  const int last = static_cast<int>(sections.size()) - 1;
  const auto control = [&](int i) {
    Eigen::Matrix<double, 5, 1> c;
    const Section& s = sections[static_cast<size_t>(std::clamp(i, 0, last))];
    c << s.centre, s.side, s.front;
    return c;
  };
  std::vector<Eigen::Matrix<double, 5, 1>> line;
  for (int span = 0; span < last; ++span) {
    for (int i = 0; i < kRingsPerSpan; ++i) {
      line.push_back(catmull_rom(control(span - 1), control(span), control(span + 1),
                                 control(span + 2), i / double(kRingsPerSpan)));
    }
  }
  line.push_back(control(last));

  const Vec3 first_tangent = (line[1].head<3>() - line[0].head<3>()).normalized();
  const Vec3 last_tangent =
      (line[line.size() - 1].head<3>() - line[line.size() - 2].head<3>()).normalized();
  std::vector<Ring> rings;
  const auto push = [&](const Vec3& centre, const Vec3& tangent, double side, double front) {
    const Vec3 s = (tube.side - tube.side.dot(tangent) * tangent).normalized();
    Ring ring{centre, s * side, s.cross(tangent) * front, 0, 0};
    if (!rings.empty()) {
      const Ring& before = rings.back();
      const double step = (centre - before.centre).norm();
      const double growth = 0.5 * (side + front - before.side.norm() - before.front.norm());
      ring.arc_m = before.arc_m + step;
      ring.surface_m = before.surface_m + std::hypot(step, growth);
    }
    rings.push_back(ring);
  };
  const auto cap = [&](int i, double length, const Eigen::Matrix<double, 5, 1>& end,
                       const Vec3& outward, const Vec3& tangent) {
    const double angle = std::numbers::pi / 2 * i / (kCapRings + 1);  // 0 at the pole
    const double radius = i == 0 ? 0 : std::sin(angle);
    push(end.head<3>() + length * std::cos(angle) * outward, tangent, radius * end[3],
         radius * end[4]);
  };
  for (int i = 0; i <= kCapRings; ++i)
    cap(i, tube.first_cap_m, line.front(), -first_tangent, first_tangent);
  for (size_t i = 0; i < line.size(); ++i) {
    const Vec3 before = line[i == 0 ? 0 : i - 1].head<3>(),
               after = line[std::min(i + 1, line.size() - 1)].head<3>();
    push(line[i].head<3>(), (after - before).normalized(), line[i][3], line[i][4]);
  }
  for (int i = kCapRings; i >= 0; --i)
    cap(i, tube.last_cap_m, line.back(), last_tangent, last_tangent);
  return rings;
}

// Arc length along the rings' centre line of the point nearest to p.
double arc_of(const std::vector<Ring>& rings, const Vec3& p) {
  double best = 1e30, arc = 0;
  for (size_t i = 0; i + 1 < rings.size(); ++i) {
    const Vec3 d = rings[i + 1].centre - rings[i].centre;
    const double length2 = d.squaredNorm();
    const double t = length2 > 0 ? std::clamp((p - rings[i].centre).dot(d) / length2, 0.0, 1.0) : 0;
    const double distance = (rings[i].centre + t * d - p).norm();
    if (distance < best) {
      best = distance;
      arc = rings[i].arc_m + t * std::sqrt(length2);
    }
  }
  return arc;
}

double smoothstep(double x) {
  x = std::clamp(x, 0.0, 1.0);
  return x * x * (3 - 2 * x);
}

SkinAccumulator skin_at(const Tube& tube, const std::vector<Ring>& rings, double arc_m) {
  SkinAccumulator skin;
  double rest = 1;  // what later joints have not taken
  for (size_t i = tube.skin.size(); i-- > 1;) {
    const Takeover& takeover = tube.skin[i];
    const double share =
        smoothstep((arc_m - arc_of(rings, takeover.at)) / (2 * takeover.blend_m) + 0.5);
    skin.add(takeover.joint, rest * share);
    rest *= 1 - share;
  }
  skin.add(tube.skin[0].joint, rest);
  return skin;
}

// A nose, so that a picture tells front from back. tip: on the face, at the tube's scale.
double nose_m(const Vec3& p, const Vec3& tip, double scale) {
  const Vec3 d = (p - tip) / scale;
  return p.z() < 0.5 * tip.z() ? 0
                               : 0.024 * scale *
                                     std::exp(-d.x() * d.x() / (2 * 0.010 * 0.010) -
                                              d.y() * d.y() / (2 * 0.016 * 0.016));
}

// Angles start at the seam, opposite of `front`, and run so that the outside sees triangles
// counter-clockwise.
Vec3 tube_point(const Tube& tube, const Ring& ring, int around) {
  const double angle = 2 * std::numbers::pi * around / tube.around;
  Vec3 p = ring.centre - std::cos(angle) * ring.front - std::sin(angle) * ring.side;
  if (tube.nose_scale > 0) p.z() += nose_m(p, tube.nose_tip, tube.nose_scale);
  return p;
}

// Appends a tube to the surface: vertices ring by ring between two poles, welded at the seam; its
// chart is a rectangle.
void append(const Tube& tube, Surface& surface) {
  const std::vector<Ring> rings = loft(tube);
  const int count = static_cast<int>(rings.size()), around = tube.around;
  const uint32_t first_vertex = surface.vertex_count(),
                 first_uv = static_cast<uint32_t>(surface.uv.size() / 2);
  const auto is_pole = [&](int ring) { return ring == 0 || ring == count - 1; };
  const auto vertex = [&](int ring, int k) {
    if (ring == 0) return first_vertex;
    return first_vertex + 1 +
           static_cast<uint32_t>((ring - 1) * around + (is_pole(ring) ? 0 : k % around));
  };
  const auto uv = [&](int ring, int k) {
    return first_uv + static_cast<uint32_t>(ring * (around + 1) + k);
  };
  for (int ring = 0; ring < count; ++ring) {
    uint8_t joints[kSkinInfluences];
    float weights[kSkinInfluences];
    skin_at(tube, rings, rings[static_cast<size_t>(ring)].arc_m).store(joints, weights);
    for (int k = 0; k < (is_pole(ring) ? 1 : around); ++k) {
      const Vec3 p = tube_point(tube, rings[static_cast<size_t>(ring)], k);
      for (int i = 0; i < 3; ++i) surface.position_m.push_back(static_cast<float>(p[i]));
      surface.skin_joints.insert(surface.skin_joints.end(), joints, joints + kSkinInfluences);
      surface.skin_weights.insert(surface.skin_weights.end(), weights, weights + kSkinInfluences);
    }
    const double v = rings[static_cast<size_t>(ring)].surface_m / rings.back().surface_m;
    for (int k = 0; k <= around; ++k) {
      const double u = (k + (is_pole(ring) && k < around ? 0.5 : 0.0)) /
                       around;  // a pole has one coordinate per quad, in its middle
      surface.uv.push_back(
          static_cast<float>((tube.chart.left + tube.chart.width * u) / kAtlasUnits));
      surface.uv.push_back(
          static_cast<float>((tube.chart.top + tube.chart.height * v) / kAtlasUnits));
    }
  }
  const auto triangle = [&](std::array<int, 3> ring, std::array<int, 3> k) {
    for (int c = 0; c < 3; ++c) {
      surface.triangles.push_back(vertex(ring[c], k[c]));
      surface.uv_triangles.push_back(uv(ring[c], k[c]));
    }
    surface.hidden.push_back(0);
  };
  for (int ring = 0; ring + 1 < count; ++ring) {
    for (int k = 0; k < around; ++k) {
      if (!is_pole(ring))
        triangle({ring, ring, ring + 1}, {k, k + 1, is_pole(ring + 1) ? k : k + 1});
      if (!is_pole(ring + 1)) triangle({ring, ring + 1, ring + 1}, {k, k + 1, k});
    }
  }
}

Figure make_figure(const MannequinShape& shape) { return Builder(shape).build(); }

}  // namespace

std::vector<float> mannequin_vertices(const MannequinShape& shape) {
  Surface surface;
  for (const Tube& tube : make_figure(shape).tubes) append(tube, surface);
  return surface.position_m;
}

JointPositions mannequin_joints(const MannequinShape& shape) { return make_figure(shape).joints; }

BodyModel make_mannequin() {
  BodyModel model;
  model.name = "mannequin";
  const Figure mean = make_figure({});
  for (const Tube& tube : mean.tubes) append(tube, model.surface);
  model.joint_m = mean.joints;
  model.shape_count = kMannequinShapeCount;
  constexpr std::array<float MannequinShape::*, kMannequinShapeCount> kCoefficients = {
      &MannequinShape::stature, &MannequinShape::girth, &MannequinShape::legs,
      &MannequinShape::shoulders};
  for (float MannequinShape::* coefficient : kCoefficients) {
    MannequinShape more, less;
    more.*coefficient = 1;
    less.*coefficient = -1;
    const std::vector<float> vertices_more = mannequin_vertices(more),
                             vertices_less = mannequin_vertices(less);
    for (size_t i = 0; i < vertices_more.size(); ++i)
      model.vertex_shape_basis_m.push_back(0.5f * (vertices_more[i] - vertices_less[i]));
    const JointPositions joints_more = mannequin_joints(more), joints_less = mannequin_joints(less);
    for (size_t i = 0; i < joints_more.size(); ++i)
      model.joint_shape_basis_m.push_back(0.5f * (joints_more[i] - joints_less[i]));
  }
  model.provenance.sources = {"procedural: no outside data"};
  model.provenance.licence_name = "CC0-1.0";
  model.provenance.licence_url = "https://creativecommons.org/publicdomain/zero/1.0/";
  model.provenance.authors = {"figurine"};
  model.provenance.avatar_permission = "everyone";
  model.provenance.commercial_usage = "corporation";
  model.provenance.depicted_person = "synthetic";
  return model;
}

}  // namespace figurine::body
