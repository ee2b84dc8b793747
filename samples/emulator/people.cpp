#include "samples/emulator/people.h"

#include <algorithm>
#include <format>

#include "figurine/check.h"
#include "ports/host/clock.h"

namespace figurine::emulator {

namespace {

// Counts the steps, and ends the sampling when nobody wants the person any more.
class Steps final : public AvatarSampler::Trace {
 public:
  Steps(std::atomic<uint32_t>& step, const std::atomic<bool>& cancelled)
      : step_(step), cancelled_(cancelled) {}
  Status after_step(uint32_t step, double, const SampledAvatar&) override {
    step_ = step;
    return cancelled_ ? Status(StatusCode::kInterrupted, "cancelled") : Status();
  }

 private:
  std::atomic<uint32_t>& step_;
  const std::atomic<bool>& cancelled_;
};

// What a sampled avatar borrows from.
struct Weights {
  std::shared_ptr<samples::LoadedPackage> sampler;
  SampledAvatar avatar;
};

}  // namespace

std::string to_string(const Seed& seed) {
  if (seed.mix == 0) return std::format("seed {}", seed.seed);
  return std::format("seed {} to {} by {:.2f}", seed.seed, seed.to, seed.mix);
}

PeopleSampler::PeopleSampler()
    : worker_([this](const Wish& wish, const std::atomic<bool>& cancelled) {
        return sample(wish, cancelled);
      }) {}

void PeopleSampler::ask(const std::shared_ptr<LoadedSampler>& sampler, const Seed& seed) {
  worker_.ask({sampler, seed});
}

double PeopleSampler::progress() const {
  return worker_.busy() ? static_cast<double>(step_) / std::max<uint32_t>(steps_, 1) : 1;
}

Result<Person> PeopleSampler::sample(const Wish& wish, const std::atomic<bool>& cancelled) {
  const uint64_t start_ns = ports::now_ns();
  LoadedSampler& from = *wish.sampler;
  const Sampler& sampler = from.package->package.sampler();
  step_ = 0, steps_ = sampler.steps;
  auto weights = std::make_shared<Weights>();
  weights->sampler = from.package;
  Steps steps(step_, cancelled);
  FIG_RETURN_IF_ERROR(from.sampler
                          ->sample({.seed = wish.seed.seed,
                                    .to = wish.seed.to,
                                    .mix = std::clamp(wish.seed.mix, 0.0, 1.0)},
                                   weights->avatar, &steps)
                          .within(from.package->path));
  Person person{.seed = wish.seed};
  person.avatar = std::make_shared<samples::LoadedAvatar>();
  person.avatar->name = to_string(wish.seed);
  person.avatar->avatar = weights->avatar.avatar();
  person.avatar->avatar.name = person.avatar->name;
  person.avatar->made_of = weights;
  if (!from.body) {
    Result<std::unique_ptr<samples::LoadedPackage>> body =
        samples::find_body(person.avatar->avatar, person.avatar->name, from.package->path, "");
    if (!body.ok()) return body.status();
    from.body = std::move(*body);
  }
  person.body = from.body;
  person.seconds = static_cast<double>(ports::now_ns() - start_ns) * 1e-9;
  return person;
}

void PeopleHistory::add(Person person) {
  people_.resize(at_);
  people_.push_back(std::move(person));
  if (people_.size() > kMost) people_.erase(people_.begin());
  at_ = people_.size();
}

const Person* PeopleHistory::undo() {
  FIG_CHECK(can_undo(), "somebody to undo");
  --at_;
  return present();
}

const Person* PeopleHistory::redo() {
  FIG_CHECK(can_redo(), "somebody to redo");
  ++at_;
  return present();
}

void PeopleHistory::clear() {
  people_.clear();
  at_ = 0;
}

}  // namespace figurine::emulator
