#include "toolchain/capture/person.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <cstdio>

#include "toolchain/body/makehuman_model.h"
#include "toolchain/body/mannequin.h"
#include "toolchain/body/skin.h"
#include "toolchain/body/texel_body.h"
#include "toolchain/capture/cloth_strength.h"
#include "toolchain/capture/cover.h"
#include "toolchain/capture/folds.h"
#include "toolchain/capture/proxy.h"
#include "toolchain/capture/wardrobe.h"
#include "toolchain/error.h"
#include "toolchain/random/counter.h"

namespace figurine::capture {

using random::CounterRandom;

namespace {

// Streams of a person's seed.
constexpr uint64_t kShapeStream = 1, kWardrobeStream = 2, kFoldStream = 5;

constexpr uint32_t kMannequinTextureSize = 512;

std::shared_ptr<const Texture> colour_texture(const ports::ImageU8& image) {
  return std::make_shared<Texture>(image, TextureEncoding::kColour);
}

std::string text(double value) {
  char out[32];
  std::snprintf(out, sizeof out, "%.3g", value);
  return out;
}

// Loads and fits proxies of one person, and keeps track of which body vertices they cover.
class Dresser {
 public:
  Dresser(const body::MakeHuman& makehuman, const std::string& directory,
          std::span<const float> vertices_m)
      : makehuman_(makehuman),
        directory_(directory),
        vertices_m_(vertices_m),
        covered_(body::MakeHuman::kVertexCount, 0) {}

  Mesh& add(const std::string& kind, const std::string& name, const std::string& texture,
            Surfacing surfacing) {
    return add(load_proxy(directory_, kind, name), texture_path(kind, name, texture), surfacing);
  }
  Mesh& add(const Proxy& proxy, const std::string& texture, Surfacing surfacing) {
    for (uint32_t v : proxy.hidden_body_vertices) covered_[v] = 1;
    Mesh mesh = fit_proxy(proxy, vertices_m_, makehuman_);
    mesh.material.colour = colour_texture(read_png(texture));
    mesh.material.surfacing = surfacing;
    meshes_.push_back(std::move(mesh));
    return meshes_.back();
  }

  // A garment: emblems covered, dyed by the seed, with its normal map.
  Mesh& add_garment(const Garment& garment, const Outfit& outfit, Surfacing surfacing) {
    const Proxy proxy = load_proxy(directory_, "clothes", garment.name);
    const std::string texture =
        texture_path("clothes", garment.name, std::string(garment.name) + "_diffuse.png");
    Mesh& mesh = add(proxy, texture, surfacing);
    ports::ImageU8 image = read_png(texture);
    for (const ClonedRegion& clone : garment.cover) clone_region(image, clone.region, clone.shift);
    for (const Region& region : garment.dyed)
      recolour_region(image, region, outfit.dye_turn_rad, outfit.dye_saturation, outfit.dye_value);
    const ports::ImageU8 undyed = image;
    for (const DyedCloth& cloth : garment.cloths) {
      const auto fabric = static_cast<size_t>(cloth.fabric);
      const DyeBath bath{.fibre = cloth.fibre,
                         .dye = outfit.dye[fabric],
                         .reference = cloth.reference,
                         .amount = outfit.dye_amount[fabric]};
      dye_region(image, undyed, cloth.region, bath);
    }
    mesh.material.colour = colour_texture(image);
    if (!proxy.normal_map.empty())
      mesh.material.normal =
          std::make_shared<Texture>(read_png(proxy.normal_map), TextureEncoding::kVector);
    return mesh;
  }

  // Whether the clothes so far hide the feet, so that shoes would come twice.
  bool feet_covered() const {
    size_t feet = 0, hidden = 0;
    for (uint32_t v = 0; v < body::MakeHuman::kBodyVertexCount; ++v) {
      const uint8_t joint = makehuman_.skin_joints()[size_t{v} * kSkinInfluences];
      if (joint != body::kLeftFoot && joint != body::kRightFoot) continue;
      ++feet;
      hidden += covered_[v];
    }
    return 2 * hidden > feet;
  }

  // The body's quads that something of it shows: those with a vertex that no garment hides.
  Mesh skin() const {
    Mesh mesh;
    mesh.name = "skin";
    mesh.position_m.assign(vertices_m_.begin(),
                           vertices_m_.begin() + size_t{body::MakeHuman::kBodyVertexCount} * 3);
    mesh.uv = makehuman_.uv();
    for (const body::Quad& quad : makehuman_.quads()) {
      if (makehuman_.group_names()[quad.group] != "body") continue;
      if (std::all_of(quad.vertex.begin(), quad.vertex.end(),
                      [&](uint32_t v) { return covered_[v] != 0; }))
        continue;
      for (int c = 2; c < 4; ++c) {
        mesh.triangles.insert(mesh.triangles.end(),
                              {quad.vertex[0], quad.vertex[c - 1], quad.vertex[c]});
        mesh.uv_triangles.insert(mesh.uv_triangles.end(), {quad.uv[0], quad.uv[c - 1], quad.uv[c]});
      }
    }
    const size_t influences = size_t{body::MakeHuman::kBodyVertexCount} * kSkinInfluences;
    mesh.skin_joints.assign(makehuman_.skin_joints().begin(),
                            makehuman_.skin_joints().begin() + influences);
    mesh.skin_weights.assign(makehuman_.skin_weights().begin(),
                             makehuman_.skin_weights().begin() + influences);
    mesh.material.surfacing = Surfacing::kSkin;
    return mesh;
  }

  const Mesh& garment() const { return meshes_.front(); }  // the first one added
  std::vector<Mesh> take() { return std::move(meshes_); }

 private:
  std::string texture_path(const std::string& kind, const std::string& name,
                           const std::string& texture) const {
    return directory_ + "/public/data/proxies/" + kind + "/" + name + "/textures/" + texture;
  }

  const body::MakeHuman& makehuman_;
  std::string directory_;
  std::span<const float> vertices_m_;
  std::vector<uint8_t> covered_;  // [19158]
  std::vector<Mesh> meshes_;
};

}  // namespace

namespace {

// [N,3] where the body's texels lie on a person's surface. A body that does not state their places
// on the mesh has the mesh's own layout.
std::vector<float> texel_positions(const Body& body, const body::Surface& surface) {
  constexpr const char* kOtherMesh =
      "--body: its texels are not those of this mesh; was it made from other data?";
  if (body.texel_triangle.empty()) {
    body::BodyModel own;
    own.name = "person";
    own.surface = surface;
    body::TexelBody texels = body::make_texel_body(own, body.uv_size);
    if (!std::ranges::equal(texels.texel, body.texel)) throw InputError(kOtherMesh);
    return std::move(texels.position_m);
  }
  std::vector<float> position_m;
  position_m.reserve(size_t{body.texel_count()} * 3);
  for (size_t row = 0; row < body.texel_count(); ++row) {
    const uint32_t triangle = body.texel_triangle[row];
    if (triangle >= surface.triangle_count()) throw InputError(kOtherMesh);
    double position[3] = {0, 0, 0};
    body::SkinAccumulator skin;
    for (size_t c = 0; c < 3; ++c) {
      const size_t vertex = surface.triangles[3 * size_t{triangle} + c];
      const double weight = body.texel_barycentric[3 * row + c];
      for (size_t i = 0; i < 3; ++i) position[i] += weight * surface.position_m[3 * vertex + i];
      for (size_t k = vertex * kSkinInfluences; k < (vertex + 1) * kSkinInfluences; ++k)
        skin.add(surface.skin_joints[k], weight * double{surface.skin_weights[k]});
    }
    uint8_t joints[kSkinInfluences];
    float weights[kSkinInfluences];
    skin.store(joints, weights);
    if (std::fabs(weights[0] - body.texel_weights[row * kSkinInfluences]) > 1e-4f)
      throw InputError(kOtherMesh);
    for (double value : position) position_m.push_back(static_cast<float>(value));
  }
  return position_m;
}

}  // namespace

ShapeFit fit_shape(const Body& body, const body::Surface& surface) {
  const std::vector<float> position_m = texel_positions(body, surface);
  const Eigen::Index rows = static_cast<Eigen::Index>(body.texel_count()) * 3,
                     count = body.shape_count();
  using Matrix = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic>;
  const Eigen::Map<const Matrix> basis(body.texel_shape_basis_m.data(), rows,
                                       count);  // [S,N,3] row-major is [3N,S] column-major
  const Eigen::VectorXf wanted =
      Eigen::Map<const Eigen::VectorXf>(position_m.data(), rows) -
      Eigen::Map<const Eigen::VectorXf>(body.texel_position_m.data(), rows);
  const Eigen::MatrixXd wide = basis.cast<double>();
  const Eigen::VectorXd right = wide.transpose() * wanted.cast<double>();
  // A little regularisation: a direction that moves nothing gets coefficient 0 instead of none.
  const Eigen::MatrixXd normal =
      wide.transpose() * wide + 1e-9 * Eigen::MatrixXd::Identity(count, count);
  const Eigen::VectorXd shape = normal.ldlt().solve(right);
  const Eigen::VectorXd left_over = wide * shape - wanted.cast<double>();
  ShapeFit fit;
  for (Eigen::Index s = 0; s < count; ++s) fit.shape.push_back(static_cast<float>(shape[s]));
  for (Eigen::Index i = 0; i < rows; i += 3)
    fit.error_m += left_over.segment<3>(i).norm() / (static_cast<double>(rows) / 3);
  return fit;
}

Person make_makehuman_person(const PersonRequest& request, const body::MakeHuman& makehuman,
                             const std::string& directory, const Body& body) {
  const body::MacroShape shape =
      body::sample_macro_shape(CounterRandom(request.seed, kShapeStream).bits(0) >> 32);
  const Outfit outfit = choose_outfit(request.seed, shape, request.limits);

  const std::vector<float> vertices_m = makehuman.vertices(shape);
  Dresser dresser(makehuman, directory, vertices_m);
  Mesh& garment = dresser.add_garment(*outfit.garment, outfit, Surfacing::kCloth);
  garment.fold_strength = cloth_strength(garment);
  garment.folds = std::make_shared<FoldPattern>(garment, outfit.garment->folds,
                                                CounterRandom(request.seed, kFoldStream).bits(0));
  const bool barefoot = !dresser.feet_covered();
  if (barefoot) {
    Mesh& shoes = dresser.add_garment(*outfit.shoes, outfit, Surfacing::kLeather);
    remove_triangles(shoes, covered_vertices(shoes, dresser.garment()));
  }
  dresser.add("hair", outfit.hair->name, outfit.hair->texture, Surfacing::kHair).material.tint =
      outfit.hair_tint;
  Mesh& brows =
      dresser.add("eyebrows", outfit.eyebrows, outfit.eyebrows + ".png", Surfacing::kHair);
  brows.material.casts_shadow = false;
  Mesh& lashes =
      dresser.add("eyelashes", outfit.eyelashes, outfit.eyelashes + ".png", Surfacing::kHair);
  lashes.material.casts_shadow = false;
  dresser.add("eyes", "HighPolyEyes", outfit.eyes, Surfacing::kEye).material.tint = outfit.eye_tint;
  dresser.add("teeth", "Teeth_Base", "teeth.png", Surfacing::kSkin);

  Mesh skin = dresser.skin();
  remove_triangles(
      skin, covered_vertices(skin, dresser.garment(), {.outward_m = 0.03f, .inward_m = 0.006f}));
  skin.material.colour = colour_texture(read_png(directory + "/public/data/skins/" + outfit.skin +
                                                 "/textures/" + outfit.skin_texture));

  skin.material.tint = outfit.skin_tint;

  Person person;
  person.meshes = dresser.take();
  person.meshes.push_back(std::move(skin));
  const ShapeFit fit = fit_shape(body, makehuman.body_surface(vertices_m));
  person.shape = fit.shape;
  person.shape_error_m = fit.error_m;
  person.description = {{"gender", text(shape.gender)},
                        {"age_years", text(shape.age_years)},
                        {"muscle", text(shape.muscle)},
                        {"weight", text(shape.weight)},
                        {"height", text(shape.height)},
                        {"african", text(shape.african)},
                        {"asian", text(shape.asian)},
                        {"caucasian", text(shape.caucasian)},
                        {"skin", outfit.skin_texture},
                        {"garment", outfit.garment->name},
                        {"shoes", barefoot ? outfit.shoes->name : "of the garment"},
                        {"hair", outfit.hair->name},
                        {"eyebrows", outfit.eyebrows},
                        {"eyelashes", outfit.eyelashes},
                        {"eyes", outfit.eyes}};
  return person;
}

namespace {

// What the mannequin wears, as a function of the rest pose: hair, face, striped shirt, gloves of
// skin, trousers with a seam, shoes.
std::array<uint8_t, 3> paint_mannequin(const float* position_m, uint8_t joint,
                                       const std::array<Vec3, 4>& dyes) {
  const Vec3 p = load(position_m);
  const Vec3 skin{0.80f, 0.60f, 0.48f};
  Vec3 colour = skin;
  if (joint == body::kHead || joint == body::kJaw || joint == body::kLeftEye ||
      joint == body::kRightEye || joint == body::kNeck) {
    const auto spot = [&](float x, float y, float rx, float ry) {
      const float dx = (p.x - x) / rx, dy = (p.y - y) / ry;
      return p.z > 0.05f && dx * dx + dy * dy < 1;
    };
    if (p.y > 1.665f || (p.z < 0.0f && p.y > 1.50f))
      colour = dyes[3] * (0.8f + 0.2f * std::sin(p.x * 900));
    for (float side : {-1.0f, 1.0f}) {
      if (spot(side * 0.030f, 1.607f, 0.014f, 0.008f)) colour = {0.95f, 0.95f, 0.93f};
      if (spot(side * 0.030f, 1.607f, 0.006f, 0.007f)) colour = {0.15f, 0.12f, 0.10f};
      if (spot(side * 0.032f, 1.627f, 0.019f, 0.004f)) colour = dyes[3] * 0.7f;
    }
    if (spot(0, 1.545f, 0.022f, 0.006f)) colour = {0.62f, 0.24f, 0.22f};
  } else if (joint == body::kLeftAnkle || joint == body::kRightAnkle || joint == body::kLeftFoot ||
             joint == body::kRightFoot) {
    colour = p.y < 0.015f ? Vec3{0.9f, 0.88f, 0.84f} : dyes[2];
  } else if (joint == body::kLeftHip || joint == body::kRightHip || joint == body::kLeftKnee ||
             joint == body::kRightKnee || p.y < 0.96f) {
    const bool arm = joint >= body::kLeftShoulder;
    if (!arm)
      colour = p.y > 0.94f ? Vec3{0.25f, 0.17f, 0.10f}
                           : dyes[1] * (1 + 0.06f * std::sin(p.x * 700) * std::sin(p.y * 700));
  } else if (joint < body::kLeftWrist) {
    colour = std::sin(p.y * 120) > 0 ? dyes[0] : Vec3{0.92f, 0.90f, 0.86f};
  }
  const auto byte = [](float x) {
    return static_cast<uint8_t>(std::lround(std::clamp(x, 0.0f, 1.0f) * 255));
  };
  return {byte(colour.x), byte(colour.y), byte(colour.z)};
}

}  // namespace

Person make_mannequin_person(const PersonRequest& request, const Body& body) {
  const body::BodyModel model = body::make_mannequin();
  for (size_t i = 0; i < model.joint_m.size(); ++i) {
    if (body.joint_position_m.size() != model.joint_m.size() ||
        std::fabs(body.joint_position_m[i] - model.joint_m[i]) > 1e-5f) {
      throw InputError(
          "--body: not this version's mannequin; make it again with figurine-train body "
          "--mannequin");
    }
  }
  if (!request.limits.empty())
    throw InputError(
        "--outfit, --skin, --hair and their exclusions: the mannequin has no wardrobe");
  const CounterRandom shape(request.seed, kShapeStream), wardrobe(request.seed, kWardrobeStream);
  Person person;
  for (uint32_t s = 0; s < model.shape_count; ++s)
    person.shape.push_back(static_cast<float>(std::clamp(shape.normal(s), -1.5, 1.5)));

  std::array<Vec3, 4> dyes;  // shirt, trousers, shoes, hair
  for (size_t i = 0; i < dyes.size(); ++i) {
    const auto hue = [&](int k) {
      return static_cast<float>(
          wardrobe.uniform(3 * i + static_cast<uint64_t>(k), 0.12, i == 0 ? 0.8 : 0.45));
    };
    dyes[i] = {hue(0), hue(1), hue(2)};
  }
  // Painted on the mean template, texel by texel; the border carries the charts' edges into the
  // gaps.
  const body::TexelBody texels = body::make_texel_body(model, kMannequinTextureSize);
  ports::ImageU8 image(kMannequinTextureSize, kMannequinTextureSize, 3);
  for (size_t n = 0; n < texels.texel.size(); ++n) {
    const std::array<uint8_t, 3> rgb =
        paint_mannequin(&texels.position_m[n * 3], texels.joints[n * kSkinInfluences], dyes);
    std::copy(rgb.begin(), rgb.end(), &image.pixels[size_t{texels.texel[n]} * 3]);
  }
  for (size_t i = 0; i < texels.border_texel.size(); ++i) {
    const uint8_t* from = &image.pixels[size_t{texels.texel[texels.border_source[i]]} * 3];
    std::copy(from, from + 3, &image.pixels[size_t{texels.border_texel[i]} * 3]);
  }

  Mesh mesh;
  mesh.name = "mannequin";
  mesh.position_m = body::shaped_vertices(model, person.shape);
  mesh.triangles = model.surface.triangles;
  mesh.uv = model.surface.uv;
  mesh.uv_triangles = model.surface.uv_triangles;
  mesh.skin_joints = model.surface.skin_joints;
  mesh.skin_weights = model.surface.skin_weights;
  mesh.material.colour = colour_texture(image);
  mesh.material.surfacing = Surfacing::kCloth;
  mesh.fold_strength = cloth_strength(mesh);
  mesh.folds = std::make_shared<FoldPattern>(mesh, FoldStyle{},
                                             CounterRandom(request.seed, kFoldStream).bits(0));
  person.meshes.push_back(std::move(mesh));
  person.shape.resize(std::max<size_t>(person.shape.size(), body.shape_count()), 0.0f);
  person.description = {{"body", "mannequin"}};
  return person;
}

}  // namespace figurine::capture
