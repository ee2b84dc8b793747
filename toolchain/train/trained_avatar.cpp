#include "toolchain/train/trained_avatar.h"

#include <filesystem>

#include "toolchain/error.h"
#include "toolchain/model/threads.h"
#include "toolchain/tensor_operations.h"
#include "toolchain/train/avatar_model.h"

namespace figurine::train {

TrainedAvatar::TrainedAvatar() = default;
TrainedAvatar::TrainedAvatar(TrainedAvatar&&) noexcept = default;
TrainedAvatar::~TrainedAvatar() = default;

TrainedAvatar TrainedAvatar::open(const OpenRunOptions& options) {
  TrainedAvatar avatar;
  const RunDirectory run{options.run};
  avatar.description_ = read_run(run);
  RunDescription& description = avatar.description_;
  if (!description.more_data.empty()) {
    throw InputError(options.run +
                     ": is a training of several people; open the run of one, a folder in it");
  }
  if (!options.data.empty()) description.data = options.data;
  if (!options.body.empty()) description.body = options.body;
  avatar.body_ = std::make_unique<PackageFile>(open_package(description.body, PackageKind::kBody));
  const std::string hash = format_hash(avatar.body_->package.content_hash());
  if (hash != description.body_hash) {
    throw InputError(description.body + ": is body " + hash + ", " + options.run +
                     " was trained on " + description.body_hash);
  }
  avatar.data_ = std::make_unique<dataset::Dataset>(dataset::Dataset::open(
      description.data,
      {.body = &avatar.body_->package.body(),
       .body_hash = hash,
       .origin = dataset::model_origin(avatar.body_->package, description.body)}));
  if (avatar.data_->shape() != description.shape)
    throw InputError(description.data + ": shape: is not the person of " + options.run);
  TrainSettings settings = description.settings;
  settings.threads = options.threads;
  model::use_threads(options.threads);
  avatar.model_ = std::make_unique<AvatarModel>(avatar.body_->package.body(), description.shape,
                                                settings, false);
  if (!std::filesystem::exists(run.weights()))
    throw InputError(options.run + ": has no weights yet");
  load_weights(run.weights(), avatar.model_->parts());
  return avatar;
}

}  // namespace figurine::train
