// Reads five_texels.json into the views of formats; owns the arrays that they point into.
#pragma once

#include <array>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "figurine/avatar.h"
#include "figurine/body.h"

namespace figurine::golden {

using Json = nlohmann::json;

template <class T>
void flatten(const Json& value, std::vector<T>& out) {
  if (value.is_array()) {
    for (const Json& element : value) flatten(element, out);
  } else {
    out.push_back(value.get<T>());
  }
}

template <class T>
std::vector<T> flatten(const Json& value) {
  std::vector<T> out;
  flatten(value, out);
  return out;
}

struct FiveTexels {
  Json document, expected;
  std::vector<int16_t> parents;
  std::vector<float> joints, joint_basis, positions, normals, weights, spacing, basis, rotations,
      shape, network_weights, network_bias;
  std::vector<uint32_t> texel, border_texel, border_source;
  std::vector<uint8_t> texel_joints;
  Body body;
  PoseView pose;
  MapStatistics statistics;
  HeadDecoding decoding;
  uint32_t fourier_octaves = 0;
  Camera camera;

  FiveTexels(const FiveTexels&) = delete;
  FiveTexels() {
    std::ifstream(FIGURINE_SOURCE_DIR "/tests/golden/posing/five_texels.json") >> document;
    expected = document["expected"];
    const Json &b = document["body"], &a = document["avatar"], &p = document["pose"],
               &c = document["camera"];
    parents = flatten<int16_t>(b["parents"]);
    joints = flatten<float>(b["joint_position_m"]);
    joint_basis = flatten<float>(b["joint_shape_basis_m"]);
    texel = flatten<uint32_t>(b["texel"]);
    positions = flatten<float>(b["texel_position_m"]);
    normals = flatten<float>(b["texel_normal"]);
    texel_joints = flatten<uint8_t>(b["texel_joints"]);
    weights = flatten<float>(b["texel_weights"]);
    spacing = flatten<float>(b["texel_spacing_m"]);
    basis = flatten<float>(b["texel_shape_basis_m"]);
    border_texel = flatten<uint32_t>(b["border_texel"]);
    border_source = flatten<uint32_t>(b["border_source"]);
    body = {.name = "five texels",
            .uv_size = b["uv_size"],
            .joint_names = b["joint_names"],
            .parents = parents,
            .joint_position_m = joints,
            .joint_shape_basis_m = joint_basis,
            .texel = texel,
            .texel_position_m = positions,
            .texel_normal = normals,
            .texel_joints = texel_joints,
            .texel_weights = weights,
            .texel_spacing_m = spacing,
            .texel_shape_basis_m = basis,
            .border_texel = border_texel,
            .border_source = border_source};
    rotations = flatten<float>(p["rotations"]);
    pose = {p["root_translation_m"].get<std::array<float, 3>>(), rotations};
    statistics = {a["map_mean"].get<std::array<float, 6>>(),
                  a["map_scale"].get<std::array<float, 6>>()};
    decoding = {.offset_scale_m = a["offset_scale_m"],
                .spacing_scale = a["spacing_scale"],
                .max_log_scale = a["max_log_scale"],
                .opacity_bias = a["opacity_bias"]};
    fourier_octaves = a["fourier_octaves"];
    shape = flatten<float>(a["shape"]);
    network_weights = flatten<float>(a["weights"]);
    network_bias = flatten<float>(a["bias"]);
    camera = {.width_px = c["width_px"],
              .height_px = c["height_px"],
              .fx_px = c["fx_px"],
              .fy_px = c["fy_px"],
              .cx_px = c["cx_px"],
              .cy_px = c["cy_px"],
              .view_from_world = c["view_from_world"].get<std::array<float, 12>>(),
              .near_m = c["near_m"]};
  }
};

}  // namespace figurine::golden
