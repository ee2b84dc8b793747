// People who are sampled while one looks: a seed, or a way between two seeds, and the person comes
// when a thread of its own is done; and the way back to those who were there before.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "samples/emulator/loading.h"
#include "samples/emulator/worker.h"

namespace figurine::emulator {

struct Seed {
  uint64_t seed = 0, to = 0;
  double mix = 0;  // how far from seed to to, 0 to 1
  friend bool operator==(const Seed&, const Seed&) = default;
};
std::string to_string(const Seed& seed);  // "seed 7", "seed 7 to 8 by 0.25"

struct Person {
  Seed seed;
  std::shared_ptr<samples::LoadedAvatar> avatar;  // in float and in fixed point
  std::shared_ptr<samples::LoadedPackage> body;
  double seconds = 0;  // that it took
};

// The newest seed that was asked for.
class PeopleSampler {
 public:
  PeopleSampler();

  void ask(const std::shared_ptr<LoadedSampler>& sampler, const Seed& seed);
  void cancel() { worker_.cancel(); }
  bool busy() const { return worker_.busy(); }
  // How much of the person that is being sampled is there, 0 to 1.
  double progress() const;
  std::optional<Result<Person>> done() { return worker_.done(); }

 private:
  struct Wish {
    std::shared_ptr<LoadedSampler> sampler;
    Seed seed;
  };
  Result<Person> sample(const Wish& wish, const std::atomic<bool>& cancelled);

  std::atomic<uint32_t> step_{0}, steps_{1};
  Worker<Wish, Person> worker_;  // last: it uses the others
};

// Who was there, in order; the newest are kept.
class PeopleHistory {
 public:
  static constexpr size_t kMost = 32;

  // Forgets those that undo() came back from.
  void add(Person person);
  bool can_undo() const { return at_ > 0; }
  bool can_redo() const { return at_ < people_.size(); }
  // The person before the present one, or null: nobody was sampled then. Not without can_undo().
  const Person* undo();
  const Person* redo();
  const Person* present() const { return at_ == 0 ? nullptr : &people_[at_ - 1]; }
  void clear();

 private:
  std::vector<Person> people_;
  size_t at_ = 0;  // people up to the present one
};

}  // namespace figurine::emulator
