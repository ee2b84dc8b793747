// Two other ways of splatting on a CPU, re-made here as they are published, to be timed beside
// figurine's on the same Gaussians. They draw opaque RGB over black in float, and are measured from
// Gaussians in the world to pixels, as figurine is.
#pragma once

#include <cstdint>
#include <vector>

#include "figurine/camera.h"
#include "figurine/gaussian.h"

namespace figurine::peers {

// A Gaussian of SH degree 0 in the image, as the original rasterizer projects it.
struct Projected {
  float x, y;     // pixels
  float a, b, c;  // inverse covariance: a dx^2 + 2 b dx dy + c dy^2
  float radius;   // three deviations of the widest direction, pixels
  float depth;
  float opacity, red, green, blue;
};

// In front of the camera and inside the image, in the input's order. Based on: Kerbl et al., 3D
// Gaussian Splatting for Real-Time Radiance Field Rendering, 2023, and its rasterizer.
void project(const GaussianView& gaussians, const Camera& camera, std::vector<Projected>& out);

// The picture, and what a peer keeps from frame to frame.
struct Peer {
  struct Pair {
    uint64_t key;  // tile, then depth
    uint32_t index;
  };
  std::vector<Projected> projected;
  std::vector<float> rgb;            // [height,width,3]
  std::vector<float> transmittance;  // of draw_by_gaussian: negative where a pixel has stopped
  std::vector<uint32_t> order;       // of draw_by_gaussian: nearest first
  std::vector<Pair> pairs;           // of draw_by_rows
};

// Gaussian after Gaussian, nearest first, over every pixel of a box of three deviations, after the
// forward loop of OpenSplat's rasterizer for CPUs; without the lists that its gradients need, and
// the box is that of the widest direction both ways.
void draw_by_gaussian(const GaussianView& gaussians, const Camera& camera, Peer& peer);

// Tiles of 16 x 16 pixels, (tile, depth) pairs sorted together, a row of 16 pixels at a time: the
// design of published SIMD splatters.
void draw_by_rows(const GaussianView& gaussians, const Camera& camera, Peer& peer);

}  // namespace figurine::peers
