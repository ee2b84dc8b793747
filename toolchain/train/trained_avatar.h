// A finished (or interrupted) run, opened for looking at: data set, body and the model in float, as
// a device computes it.
#pragma once

#include <memory>
#include <string>

#include "toolchain/dataset/dataset.h"
#include "toolchain/train/package_file.h"
#include "toolchain/train/trainer.h"

namespace figurine::train {

class AvatarModel;

struct OpenRunOptions {
  std::string run;
  std::string data;  // empty: where run.json says
  std::string body;  // empty: where run.json says
  uint32_t threads = 1;
};

class TrainedAvatar {
 public:
  // Throws InputError: no run, another body than the run's, data of another shape.
  static TrainedAvatar open(const OpenRunOptions& options);

  const RunDescription& description() const { return description_; }
  const PackageFile& body_file() const { return *body_; }
  const Body& body() const { return body_->package.body(); }
  const dataset::Dataset& data() const { return *data_; }
  AvatarModel& model() { return *model_; }
  const AvatarModel& model() const { return *model_; }

  TrainedAvatar(TrainedAvatar&&) noexcept;
  ~TrainedAvatar();

 private:
  TrainedAvatar();

  RunDescription description_;
  std::unique_ptr<PackageFile> body_;
  std::unique_ptr<dataset::Dataset> data_;
  std::unique_ptr<AvatarModel> model_;
};

}  // namespace figurine::train
