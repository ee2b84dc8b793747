#include "toolchain/features/feature_trainer.h"

#include <torch/nn/functional/loss.h>
#include <torch/nn/functional/normalization.h>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <functional>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#include "ports/host/files.h"
#include "toolchain/error.h"
#include "toolchain/features/figurine_features.h"
#include "toolchain/features/perceptual_embedding.h"
#include "toolchain/features/solo_threads.h"
#include "toolchain/model/optimiser.h"
#include "toolchain/pictures/posed_members.h"
#include "toolchain/random/counter.h"
#include "toolchain/random/shuffled_order.h"
#include "toolchain/tensor_operations.h"
#include "toolchain/train/flat_tensor.h"
#include "toolchain/train/interrupt.h"
#include "toolchain/train/package_file.h"
#include "toolchain/train/population_file.h"
#include "toolchain/train/progress.h"
#include "toolchain/train/run_directory.h"
#include "toolchain/train/tensor_file.h"

namespace figurine::features {

using measure::Picture;
using pictures::members_of;
using pictures::PosedMembers;

namespace {

constexpr char kCheckpointFormat[] = "figurine-features checkpoint 1";
constexpr size_t kPiece = 8;  // pictures of a piece; part of what the weights depend on
constexpr double kScale = 16, kCosineMargin = 0.1;
constexpr double kSmallest = 0.85, kLargest = 1.12;  // of the picture, by augmentation
constexpr double kShift = 0.08;                      // of its side, at most
constexpr double kRunningMean = 0.02;
constexpr size_t kWeighedPairs = 256;  // of training members, for the weights of the distance
constexpr double kFloorShare = 0.5;
constexpr size_t kMostPictures = 8192;
constexpr uint32_t kViews = 6, kFewestViews = 2;
enum Stream : uint64_t { kZoom = 2, kShiftX = 3, kShiftY = 4, kPairs = 5, kClasses = 6 };

double now_s() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

nlohmann::json to_json(const FeatureSettings& settings) {
  return {{"poses", settings.poses},
          {"views", settings.views},
          {"batch", settings.batch},
          {"weight_decay", settings.weight_decay},
          {"seed", settings.seed},
          {"learning_rate", settings.schedule.peak},
          {"ramp_iterations", settings.schedule.ramp_iterations},
          {"learning_rate_floor", settings.schedule.floor_fraction},
          {"iterations", settings.schedule.budget.iterations}};
}

FeatureSettings settings_from_json(const std::string& text, const std::string& where) {
  try {
    const nlohmann::json json = nlohmann::json::parse(text);
    FeatureSettings settings;
    settings.poses = json.at("poses").get<uint32_t>(),
    settings.views = json.at("views").get<uint32_t>();
    settings.batch = json.at("batch").get<uint32_t>(),
    settings.weight_decay = json.at("weight_decay").get<double>();
    settings.seed = json.at("seed").get<uint64_t>(),
    settings.schedule.peak = json.at("learning_rate").get<double>();
    settings.schedule.ramp_iterations = json.at("ramp_iterations").get<uint64_t>();
    settings.schedule.floor_fraction = json.at("learning_rate_floor").get<double>();
    settings.schedule.budget.iterations = json.at("iterations").get<uint64_t>();
    return settings;
  } catch (const nlohmann::json::exception&) {
    throw InputError(where + ": settings: are not those of figurine-train features");
  }
}

// Pictures as the network sees them, in bytes: [pictures,3,S,S], those of a member one after the
// other.
struct PictureBank {
  size_t members = 0, shots = 0;
  torch::Tensor values;  // uint8
};

PictureBank draw_bank(const PosedMembers& posed, const std::vector<size_t>& members) {
  PictureBank bank{members.size(), posed.shots(), {}};
  bank.values = torch::empty(
      {static_cast<int64_t>(bank.members * bank.shots), 3, kFeatureSide_px, kFeatureSide_px},
      torch::kUInt8);
  posed.draw("drawing training members", members,
             [&](size_t i, const std::vector<Picture>& pictures) {
               const RgbPictures colours = over_grey(pictures);
               for (size_t shot = 0; shot < bank.shots; ++shot) {
                 const torch::Tensor bytes =
                     (prepare_for_features(colours[shot]) * 255).round().to(torch::kUInt8);
                 bank.values[static_cast<int64_t>(i * bank.shots + shot)].copy_(bytes[0]);
               }
             });
  return bank;
}

std::string text_of(const train::TensorFile& file, const std::string& path,
                    const std::string& key) {
  const auto found = file.metadata.find(key);
  if (found == file.metadata.end()) throw InputError(path + ": " + key + ": missing");
  return found->second;
}

// The network's weights, then a class vector for every member: [P + N F].
torch::Tensor initial_weights(const FeatureSettings& settings, size_t members) {
  auto generator =
      at::make_generator<at::CPUGeneratorImpl>(random::random_bits(settings.seed, kClasses, 0));
  return torch::cat({initial_feature_weights(settings.seed),
                     torch::randn({static_cast<int64_t>(members) * kFeatureDimension}, generator)});
}

class FeatureTrainer {
 public:
  FeatureTrainer(const FeatureRequest& request, const FeatureSettings& settings,
                 const PictureBank& bank, std::map<std::string, std::string> provenance)
      : request_(request),
        settings_(settings),
        bank_(bank),
        provenance_(std::move(provenance)),
        order_(settings.seed, bank.members * bank.shots),
        weights_(initial_weights(settings, bank.members)),
        optimiser_(model::adamw_group(static_cast<uint64_t>(weights_.numel())),
                   {.epsilon = 1e-8, .weight_decay = settings.weight_decay}),
        threads_(request.threads) {}

  void take_checkpoint(const train::TensorFile& file, const std::string& path) {
    train::take_flat_tensor(file, path, "weights", weights_);
    train::take_flat_tensor(file, path, "first_moment", optimiser_.first_moment);
    train::take_flat_tensor(file, path, "second_moment", optimiser_.second_moment);
    iteration_ = static_cast<uint64_t>(train::take_number(file, path, "iteration")),
    seconds_ = train::take_number(file, path, "seconds");
    optimiser_.steps = static_cast<int64_t>(train::take_number(file, path, "optimiser_steps"));
    loss_ = train::take_number(file, path, "loss"),
    accuracy_ = train::take_number(file, path, "accuracy");
    shown_ = iteration_;
  }

  FeatureResult run() {
    train::Progress progress("features", request_.quiet);
    const train::InterruptGuard interrupt;
    const uint64_t iterations = settings_.schedule.budget.iterations, session_first = iteration_;
    const double session_start = seconds_;
    double last_checkpoint = now_s();
    while (iteration_ < iterations) {
      if (interrupt.requested() || (request_.stop_after > 0 && iteration_ >= request_.stop_after)) {
        save_checkpoint();
        throw train::Interrupted(request_.output + ": stopped after " + std::to_string(iteration_) +
                                 " iterations; --resume goes on from here");
      }
      const double before = now_s();
      iterate();
      seconds_ += now_s() - before;
      ++iteration_;
      char line[160];
      std::snprintf(line, sizeof(line), "iteration %llu, loss %.3f, %.1f %% told right, %.2f it/s",
                    static_cast<unsigned long long>(iteration_), loss_, 100 * accuracy_,
                    static_cast<double>(iteration_ - session_first) /
                        std::max(1e-9, seconds_ - session_start));
      progress.show(static_cast<double>(iteration_) / static_cast<double>(iterations), line);
      if (now_s() - last_checkpoint > request_.checkpoint_period_s && iteration_ < iterations) {
        save_checkpoint();
        last_checkpoint = now_s();
      }
    }
    finish();
    return {.iteration = iteration_,
            .seconds = seconds_,
            .loss = loss_,
            .accuracy = accuracy_,
            .pictures = bank_.members * bank_.shots,
            .members = bank_.members};
  }

 private:
  struct Piece {
    size_t first = 0, count = 0;  // of the batch
    torch::Tensor gradient;
    double loss = 0;
    int64_t right = 0;
  };

  // [n,3,S,S] of the pictures of a batch, moved and scaled.
  torch::Tensor augmented(const std::vector<size_t>& batch, const Piece& piece) const {
    std::vector<int64_t> rows;
    std::vector<float> affine;
    for (size_t i = piece.first; i < piece.first + piece.count; ++i) {
      const uint64_t counter = iteration_ * settings_.batch + i;
      const auto draw = [&](Stream stream) {
        return static_cast<double>(random::random_unit(settings_.seed, stream, counter));
      };
      rows.push_back(static_cast<int64_t>(batch[i]));
      const double zoom = kSmallest + (kLargest - kSmallest) * draw(kZoom);
      const float scale = static_cast<float>(1 / zoom),
                  x = static_cast<float>(2 * kShift * (2 * draw(kShiftX) - 1)),
                  y = static_cast<float>(2 * kShift * (2 * draw(kShiftY) - 1));
      affine.insert(affine.end(), {scale, 0, x, 0, scale, y});
    }
    const torch::Tensor theta = torch::tensor(affine).view({-1, 2, 3});
    const torch::Tensor around_grey =
        bank_.values.index_select(0, torch::tensor(rows)).to(torch::kFloat32) / 255 - 0.5;
    const torch::Tensor grid = at::affine_grid_generator(theta, around_grey.sizes(), false);
    return at::grid_sampler(around_grey, grid, /*bilinear*/ 0, /*zeros*/ 0, false) + 0.5;
  }

  void run_piece(const std::vector<size_t>& batch, Piece& piece) const {
    std::vector<int64_t> members;
    for (size_t i = piece.first; i < piece.first + piece.count; ++i)
      members.push_back(static_cast<int64_t>(batch[i] / bank_.shots));
    const torch::Tensor labels = torch::tensor(members);
    const torch::Tensor weights =
        weights_.detach().requires_grad_();  // shares the values, has a gradient of its own
    const torch::Tensor network = weights.narrow(0, 0, feature_parameter_count());
    const torch::Tensor classes =
        weights.narrow(0, feature_parameter_count(), weights.numel() - feature_parameter_count())
            .view({-1, kFeatureDimension});
    const torch::Tensor features = run_feature_network(network, augmented(batch, piece)).features /
                                   std::sqrt(double(kFeatureDimension));
    const torch::Tensor cosine =
        torch::matmul(features, torch::nn::functional::normalize(classes).t());
    const torch::Tensor logits =
        kScale * (cosine - kCosineMargin * torch::one_hot(labels, cosine.size(1)));
    const torch::Tensor loss =
        torch::nn::functional::cross_entropy(
            logits, labels,
            torch::nn::functional::CrossEntropyFuncOptions().reduction(torch::kSum)) /
        static_cast<double>(batch.size());
    piece.gradient = torch::autograd::grad({loss}, {weights})[0];
    piece.loss = loss.item<double>();
    piece.right = logits.argmax(1).eq(labels).sum().item<int64_t>();
  }

  void iterate() {
    std::vector<size_t> batch;
    for (size_t i = 0; i < settings_.batch; ++i)
      batch.push_back(order_.item(iteration_ * settings_.batch + i));
    std::vector<Piece> pieces;
    for (size_t first = 0; first < batch.size(); first += kPiece) {
      pieces.push_back(
          {.first = first, .count = std::min(kPiece, batch.size() - first), .gradient = {}});
    }
    threads_.each(pieces.size(), [&](size_t i) { run_piece(batch, pieces[i]); });
    torch::Tensor gradient = pieces[0].gradient;
    double loss = pieces[0].loss;
    int64_t right = pieces[0].right;
    for (size_t i = 1; i < pieces.size(); ++i) {
      gradient.add_(pieces[i].gradient);
      loss += pieces[i].loss, right += pieces[i].right;
    }
    if (!optimiser_.step(weights_, gradient,
                         train::learning_rate(settings_.schedule, iteration_, seconds_)) ||
        !std::isfinite(loss)) {
      throw InputError(request_.output + ": iteration " + std::to_string(iteration_) +
                       ": a gradient is not finite; the last checkpoint is kept");
    }
    const double weight = std::max(kRunningMean, 1.0 / static_cast<double>(++shown_));
    loss_ += weight * (loss - loss_);
    accuracy_ +=
        weight * (static_cast<double>(right) / static_cast<double>(batch.size()) - accuracy_);
  }

  std::string checkpoint() const { return request_.output + ".checkpoint"; }

  void save_checkpoint() const {
    train::TensorFile file{.metadata = provenance_, .tensors = {}};
    file.metadata["format"] = kCheckpointFormat;
    file.metadata["iteration"] = std::to_string(iteration_);
    file.metadata["optimiser_steps"] = std::to_string(optimiser_.steps);
    file.metadata["seconds"] = train::exact_number(seconds_),
    file.metadata["loss"] = train::exact_number(loss_),
    file.metadata["accuracy"] = train::exact_number(accuracy_);
    file.tensors["weights"] = train::flat_tensor(weights_);
    file.tensors["first_moment"] = train::flat_tensor(optimiser_.first_moment);
    file.tensors["second_moment"] = train::flat_tensor(optimiser_.second_moment);
    train::write_tensor_file(checkpoint(), file);
  }

  // For every layer e, a share of the mean |a|, and one weight of all channels, 1 / (layers x mean
  // distance): over pairs of training members in one shot.
  std::vector<LayerWeights> weigh_layers(const torch::Tensor& network) {
    struct Pair {
      size_t a, b, shot;
    };
    std::vector<Pair> pairs;
    for (size_t i = 0; i < kWeighedPairs; ++i) {
      const auto draw = [&](uint64_t what, size_t count) {
        return static_cast<size_t>(random::random_bits(settings_.seed, kPairs, 3 * i + what) %
                                   count);
      };
      const size_t a = draw(0, bank_.members);
      pairs.push_back(
          {a, (a + 1 + draw(1, bank_.members - 1)) % bank_.members, draw(2, bank_.shots)});
    }
    const auto activations = [&](size_t member, size_t shot) {
      const torch::NoGradGuard no_gradient;
      const torch::Tensor picture =
          bank_.values.narrow(0, static_cast<int64_t>(member * bank_.shots + shot), 1);
      return run_feature_network(network, picture.to(torch::kFloat32) / 255).activations;
    };
    std::vector<double> floors = mean_of_layers(
        pairs.size(), [&](size_t i) { return layer_norms(activations(pairs[i].a, pairs[i].shot)); },
        "sees nothing of training members");
    for (double& floor : floors)
      floor = static_cast<float>(kFloorShare * floor);  // as it will be stored
    const std::vector<double> distances = mean_of_layers(
        pairs.size(),
        [&](size_t i) {
          return layer_distances(activations(pairs[i].a, pairs[i].shot),
                                 activations(pairs[i].b, pairs[i].shot), floors);
        },
        "sees no difference between training members");
    std::vector<LayerWeights> weights;
    for (size_t l = 0; l < kFeatureLayers; ++l) {
      const double weight = 1 / (static_cast<double>(kFeatureLayers) * distances[l]);
      weights.push_back({torch::full({kFeatureStages[l].out}, weight, torch::kFloat32), floors[l]});
    }
    return weights;
  }

  // Means of one value a layer over `count` pieces, which must be above 0.
  std::vector<double> mean_of_layers(size_t count,
                                     const std::function<std::vector<double>(size_t)>& piece,
                                     const std::string& otherwise) {
    std::vector<std::vector<double>> values(count);
    threads_.each(count, [&](size_t i) { values[i] = piece(i); });
    std::vector<double> means(kFeatureLayers, 0);
    for (size_t l = 0; l < kFeatureLayers; ++l) {
      for (const std::vector<double>& own : values) means[l] += own[l] / static_cast<double>(count);
      if (!(means[l] > 0))
        throw InputError(request_.output + ": layer " + std::to_string(l) + " " + otherwise);
    }
    return means;
  }

  void finish() {
    const torch::Tensor network = weights_.narrow(0, 0, feature_parameter_count()).clone();
    std::vector<LayerWeights> distance = weigh_layers(network);
    provenance_["train_seconds"] = train::exact_number(seconds_),
    provenance_["loss"] = train::exact_number(loss_),
    provenance_["accuracy"] = train::exact_number(accuracy_);
    provenance_["created"] = train::utc_now();
    FigurineFeatures(network, std::move(distance), provenance_).save(request_.output);
    std::error_code ignored;
    std::filesystem::remove(checkpoint(), ignored);
  }

  const FeatureRequest& request_;
  FeatureSettings settings_;
  const PictureBank& bank_;
  std::map<std::string, std::string> provenance_;
  random::ShuffledOrder order_;
  torch::Tensor weights_;
  model::Optimiser optimiser_;
  SoloThreads threads_;
  uint64_t iteration_ = 0, shown_ = 0;
  double seconds_ = 0, loss_ = 0, accuracy_ = 0;
};

std::map<std::string, std::string> describe(const FeatureRequest& request,
                                            const FeatureSettings& settings,
                                            const train::PackageFile& population,
                                            const train::PackageFile& body,
                                            const std::vector<size_t>& members) {
  nlohmann::json names = nlohmann::json::array();
  for (const size_t member : members)
    names.push_back(population.package.population().members[member].name);
  return {{"tool", "figurine-train " FIGURINE_VERSION},
          {"command", request.command},
          {"commit", train::current_commit()},
          {"machine", train::describe_machine().dump()},
          {"population", population.package.population().name},
          {"population_hash", format_hash(population.package.content_hash())},
          {"body_hash", format_hash(body.package.content_hash())},
          {"members", names.dump()},
          {"settings", to_json(settings).dump()}};
}

// What decides the weights besides the settings: a checkpoint is gone on with only where these are
// the same.
void check_same(const std::map<std::string, std::string>& wanted, const train::TensorFile& file,
                const std::string& path) {
  for (const char* key : {"population_hash", "body_hash", "motion_hash"}) {
    const auto own = file.metadata.find(key), given = wanted.find(key);
    const std::string own_value = own == file.metadata.end() ? "none" : own->second;
    const std::string given_value = given == wanted.end() ? "none" : given->second;
    if (own_value != given_value)
      throw InputError(path + ": " + key + " is " + own_value + ", that of what is given " +
                       given_value);
  }
}

FeatureResult finished(const std::string& path) {
  const train::TensorFile file = train::read_tensor_file(path);
  const FeatureSettings settings = settings_from_json(text_of(file, path, "settings"), path);
  return {.iteration = settings.schedule.budget.iterations,
          .seconds = train::take_number(file, path, "train_seconds"),
          .loss = train::take_number(file, path, "loss"),
          .accuracy = train::take_number(file, path, "accuracy"),
          .was_finished = true};
}

uint32_t default_views(const FeatureSettings& settings, size_t members) {
  const size_t fitting = kMostPictures / std::max<size_t>(1, members * settings.poses);
  return static_cast<uint32_t>(std::clamp<size_t>(fitting, kFewestViews, kViews));
}

}  // namespace

FeatureResult train_features(const FeatureRequest& request) {
  const std::string checkpoint = request.output + ".checkpoint";
  const bool begun = std::filesystem::exists(checkpoint);
  if (begun && !request.resume)
    throw InputError(checkpoint + ": is of a training that was stopped; --resume goes on with it");
  if (!begun && request.resume) {
    if (!std::filesystem::exists(request.output))
      throw InputError(checkpoint + ": no training to resume");
    return finished(request.output);
  }
  const train::PackageFile population = train::open_population(request.population);
  const train::PackageFile body = train::open_package(request.body, PackageKind::kBody);
  std::optional<train::PackageFile> motion;
  if (!request.motion.empty()) {
    motion.emplace(train::open_package(request.motion, PackageKind::kMotion));
    throw_if_error(check_motion_fits_body(motion->package.motion(), body.package.body()),
                   request.motion);
  }
  const std::vector<size_t> members = members_of(population.package.population(), Split::kTrain);
  FeatureSettings settings = request.settings;
  train::TensorFile state;
  if (begun) {
    state = train::read_tensor_file(checkpoint);
    if (text_of(state, checkpoint, "format") != kCheckpointFormat)
      throw InputError(checkpoint + ": format: is no checkpoint of figurine-train features");
    settings = settings_from_json(text_of(state, checkpoint, "settings"), checkpoint);
  }
  if (settings.views == 0) settings.views = default_views(settings, members.size());
  std::map<std::string, std::string> provenance =
      describe(request, settings, population, body, members);
  if (motion) provenance["motion_hash"] = format_hash(motion->package.content_hash());
  if (begun) check_same(provenance, state, checkpoint);
  const PosedMembers posed(population.package, body.package,
                           {.motion = motion ? &motion->package.motion() : nullptr,
                            .poses = settings.poses,
                            .views = settings.views,
                            .seed = settings.seed,
                            .threads = request.threads,
                            .quiet = request.quiet});
  const PictureBank bank = draw_bank(posed, members);
  FeatureTrainer trainer(request, settings, bank, std::move(provenance));
  if (begun) trainer.take_checkpoint(state, checkpoint);
  return trainer.run();
}

}  // namespace figurine::features
