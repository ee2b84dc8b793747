// What a file that was opened or dropped turns out to be: an avatar, a motion, a body, a sampler or
// a scene of Gaussians, checked and ready. Called by a thread that nobody waits for.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "figurine/avatar_sampler.h"
#include "ports/gaussians/gaussian_cloud.h"
#include "samples/common/loading.h"
#include "samples/common/scene.h"

namespace figurine::emulator {

// A sampler with what it works with. Used by one thread at a time.
struct LoadedSampler {
  std::shared_ptr<samples::LoadedPackage> package;
  std::unique_ptr<AvatarSampler> sampler;
  std::shared_ptr<samples::LoadedPackage> body;  // of its people; found with the first of them
};

struct LoadWish {
  std::string path;
  std::vector<std::shared_ptr<samples::LoadedPackage>> bodies;  // that were opened before
};

// One of them, and an avatar's body with it, and who draws it when it is small: the package beside
// it that is called so (coarse_name).
struct Loaded {
  std::string path;
  std::shared_ptr<samples::LoadedAvatar> avatar;
  std::shared_ptr<samples::LoadedPackage> body, motion;
  samples::Scene::Coarse coarse;
  Status coarse_trouble;  // why there is none although a file is called so
  std::shared_ptr<LoadedSampler> sampler;
  std::shared_ptr<ports::GaussianCloud> cloud;
};

// "person-coarse.fgn" of "person.fgn": the same person in less detail. Empty of what is no .fgn.
std::string coarse_name(const std::string& path);

// One line, as the readers say it.
Result<Loaded> load_file(const LoadWish& wish);

}  // namespace figurine::emulator
