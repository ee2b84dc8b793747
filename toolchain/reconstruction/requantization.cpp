#include "toolchain/reconstruction/requantization.h"

#include <nlohmann/json.hpp>
#include <vector>

#include "toolchain/error.h"
#include "toolchain/reconstruction/reconstruction.h"
#include "toolchain/tensor_operations.h"
#include "toolchain/train/avatar_model.h"

namespace figurine::reconstruction {

nlohmann::json evaluate_requantization(train::TrainedAvatar& avatar, const Avatar& member,
                                       const RequantizationOptions& options) {
  if (member.body_hash != avatar.body_file().package.content_hash()) {
    throw InputError("member '" + member.name + "': was made for body " +
                     format_hash(member.body_hash) + ", the run for another");
  }
  const ReconstructionOptions reconstruction{.quiet = options.quiet,
                                             .view_frame_step = options.view_frame_step};
  model::PoseUNet& unet = avatar.model().unet();
  std::vector<float> storage;
  const Network own = unet.export_network(storage);
  const nlohmann::json before = evaluate_reconstruction(avatar, reconstruction);
  train::StaticMap& statics = avatar.model().statics();
  const torch::Tensor own_values = statics.values.clone();
  unet.import_network(member.network);
  if (!member.static_part.empty()) {
    train::take_static_part(member.static_part, train::head_layout(avatar.description().settings),
                            statics);
  }
  const nlohmann::json after = evaluate_reconstruction(avatar, reconstruction);
  unet.import_network(own);
  statics.values.copy_(own_values);
  nlohmann::json report;
  for (const auto& [name, group] :
       {std::pair{"views", "held_out_views"}, std::pair{"poses", "held_out_poses"}}) {
    const nlohmann::json &a = before.at(group).at("psnr_db"), &b = after.at(group).at("psnr_db");
    const bool measured = a.is_number() && b.is_number();
    report[name] = {
        {"psnr_db", a},
        {"member_psnr_db", b},
        {"loss_db", measured ? nlohmann::json(a.get<double>() - b.get<double>()) : nullptr}};
  }
  return report;
}

}  // namespace figurine::reconstruction
