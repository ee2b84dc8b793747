// The folder in which a population grows (docs/population.md):
//
//   recipe.json                the recipe, as it was when the folder was begun; another one is
//                              refused
//   split.json                 who is in which part; written before anything is trained
//   body.fgn                   the body of all
//   initial/                   the shared initial weights: weights.safetensors when they are done,
//                              history.csv, the rounds before; of a shared network, its run and
//                              shared.fgn, the avatar of its learners' mean map
//   captures/ID, runs/ID       while a member is made; removed when it is done, captures unless
//                              they are to be kept
//   members/ID.fgn, ID.json    the avatar (float weights, no picture) and what it was measured to
//                              be; ID.jpg: held-out pictures beside the
//                              truth
//   parts/K-of-N               while one of several processes makes its part; empty
//   members.csv                a table of all, written whenever one ends
//   population.fgn             the package; written now and then, and at the end
//
// All files appear whole or not at all, so the folder can be left and gone on with at any time.
#pragma once

#include <cstdint>
#include <string>

namespace figurine::population {

struct State {
  std::string folder;
  std::string recipe() const { return folder + "/recipe.json"; }
  std::string split() const { return folder + "/split.json"; }
  std::string body() const { return folder + "/body.fgn"; }
  std::string initial() const { return folder + "/initial"; }
  std::string initial_weights() const { return initial() + "/weights.safetensors"; }
  std::string shared() const { return initial() + "/shared.fgn"; }
  std::string captures() const { return folder + "/captures"; }
  std::string run(const std::string& identity) const { return folder + "/runs/" + identity; }
  std::string scratch_run(const std::string& identity) const {
    return folder + "/runs/" + identity + "_scratch";
  }
  std::string frozen_run(const std::string& identity) const {
    return folder + "/runs/" + identity + "_frozen";
  }
  std::string members() const { return folder + "/members"; }
  std::string member(const std::string& identity) const {
    return members() + "/" + identity + ".fgn";
  }
  std::string row(const std::string& identity) const {
    return members() + "/" + identity + ".json";
  }
  std::string sheet(const std::string& identity) const {
    return members() + "/" + identity + ".jpg";
  }
  std::string parts() const { return folder + "/parts"; }
  std::string part(uint32_t part, uint32_t parts) const {
    return this->parts() + "/" + std::to_string(part) + "-of-" + std::to_string(parts);
  }
  std::string table() const { return folder + "/members.csv"; }
  std::string package() const { return folder + "/population.fgn"; }
};

}  // namespace figurine::population
