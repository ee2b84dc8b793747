#include "toolchain/train/run_directory.h"

#include <sys/utsname.h>
#include <unistd.h>

#include <charconv>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <thread>

#include "figurine/package.h"
#include "ports/host/files.h"
#include "toolchain/error.h"
#include "toolchain/model/network_adapter.h"
#include "toolchain/model/optimiser.h"
#include "toolchain/model/unet.h"
#include "toolchain/tensor_operations.h"
#include "toolchain/train/flat_tensor.h"
#include "toolchain/train/smallest_extent.h"
#include "toolchain/train/static_map.h"

namespace figurine::train {

namespace {

constexpr char kLogHeader[] = "iteration,seconds,learning_rate,loss,psnr_db\n";

std::span<const std::byte> bytes_of(const std::string& text) {
  return {reinterpret_cast<const std::byte*>(text.data()), text.size()};
}

void write_text(const std::string& path, const std::string& text) {
  throw_if_error(ports::write_file_atomically(path, bytes_of(text)), "cannot save");
}

// Doubles as text that reads back to the same bits.
std::string exact(double value) {
  char text[40];
  const auto end = std::to_chars(text, text + sizeof(text), value);
  return {text, end.ptr};
}

double parse_double(const std::string& path, const std::map<std::string, std::string>& metadata,
                    const std::string& key) {
  const auto found = metadata.find(key);
  double value = 0;
  if (found == metadata.end()) throw InputError(path + ": " + key + ": missing");
  const std::string& text = found->second;
  const auto end = std::from_chars(text.data(), text.data() + text.size(), value);
  if (end.ec != std::errc{} || end.ptr != text.data() + text.size() || !(value >= 0) ||
      value > 1e15) {
    throw InputError(path + ": " + key + ": \"" + text + "\" is no sound number");
  }
  return value;
}

void add_weights(const model::PoseUNet& unet, TensorFile& file) {
  std::vector<float> storage;
  const Network network = unet.export_network(storage);
  for (size_t i = 0, conv = 0; i < network.layers.size(); ++i) {
    const Layer& layer = network.layers[i];
    if (layer.op != LayerOp::kConv2d) continue;
    const std::string name = "layer." + std::to_string(conv++);
    const int64_t out = layer.out_channels, kernel = layer.kernel;
    const int64_t in = static_cast<int64_t>(layer.weights.size()) / (out * kernel * kernel);
    file.tensors[name + ".weight"] = {{out, kernel, kernel, in},
                                      {layer.weights.begin(), layer.weights.end()}};
    file.tensors[name + ".bias"] = {{out}, {layer.bias.begin(), layer.bias.end()}};
  }
}

void take_weights(const std::string& path, const TensorFile& file, model::PoseUNet& unet) {
  std::vector<float> storage;
  Network network = unet.export_network(storage);
  size_t conv = 0;
  for (Layer& layer : network.layers) {
    if (layer.op != LayerOp::kConv2d) continue;
    const std::string name = "layer." + std::to_string(conv++);
    for (const bool is_bias : {false, true}) {
      const std::string field = name + (is_bias ? ".bias" : ".weight");
      const auto found = file.tensors.find(field);
      if (found == file.tensors.end()) throw InputError(path + ": " + field + ": missing");
      std::span<const float>& values = is_bias ? layer.bias : layer.weights;
      const int64_t out = layer.out_channels, kernel = layer.kernel;
      const std::vector<int64_t> shape =
          is_bias ? std::vector<int64_t>{out}
                  : std::vector<int64_t>{out, kernel, kernel,
                                         int64_t(values.size()) / (out * kernel * kernel)};
      if (found->second.shape != shape)
        throw InputError(path + ": " + field + ": is of another shape than this run's network");
      values = found->second.values;
    }
  }
  unet.import_network(network);
}

std::string static_name(size_t group) { return "static." + std::to_string(group); }

void add_statics(const StaticMap& statics, TensorFile& file, const std::string& prefix = "") {
  const float* from = statics.empty() ? nullptr : statics.values.const_data_ptr<float>();
  for (size_t g = 0; g < statics.shapes.size(); ++g) {
    const auto [cells, channels] = statics.shapes[g];
    file.tensors[prefix + static_name(g)] = {{cells, channels}, {from, from + cells * channels}};
    from += cells * channels;
  }
}

void take_statics(const std::string& path, const TensorFile& file, StaticMap& statics,
                  const std::string& prefix = "") {
  float* to = statics.empty() ? nullptr : statics.values.mutable_data_ptr<float>();
  for (size_t g = 0; g < statics.shapes.size(); ++g) {
    const std::string name = prefix + static_name(g);
    const auto found = file.tensors.find(name);
    if (found == file.tensors.end()) throw InputError(path + ": " + name + ": missing");
    const auto [cells, channels] = statics.shapes[g];
    if (found->second.shape != std::vector<int64_t>{cells, channels})
      throw InputError(path + ": " + name + ": is of another shape than this run's static part");
    to = std::copy(found->second.values.begin(), found->second.values.end(), to);
  }
}

constexpr char kExtentScale[] = "smallest_extent.scale_m", kExtentCode[] = "smallest_extent.code";

void add_extents(const SmallestExtentMap& extents, TensorFile& file) {
  const SmallestExtents view = extents.view();
  file.tensors[kExtentScale] = {{1}, {view.scale_m}};
  file.tensors[kExtentCode] = {{static_cast<int64_t>(view.codes.size())},
                               {view.codes.begin(), view.codes.end()}};
}

void take_extents(const std::string& path, const TensorFile& file, SmallestExtentMap& extents) {
  const auto find = [&](const char* name) -> const std::vector<float>& {
    const auto found = file.tensors.find(name);
    if (found == file.tensors.end()) throw InputError(path + ": " + name + ": missing");
    return found->second.values;
  };
  const std::vector<float>&scale = find(kExtentScale), &values = find(kExtentCode);
  if (scale.size() != 1) throw InputError(path + ": " + kExtentScale + ": is not one number");
  std::vector<uint8_t> codes;
  for (const float value : values) {
    if (!(value >= 0 && value <= kLargestExtentCode) || value != std::floor(value))
      throw InputError(path + ": " + kExtentCode + ": a value is no whole number of 0 to 255");
    codes.push_back(static_cast<uint8_t>(value));
  }
  extents.set(scale[0], std::move(codes), path);
}

void add_parts(const LearnedParts& parts, TensorFile& file) {
  if (parts.unet != nullptr) add_weights(*parts.unet, file);
  if (parts.statics != nullptr) add_statics(*parts.statics, file);
  if (parts.extents != nullptr) add_extents(*parts.extents, file);
}

void take_parts(const std::string& path, const TensorFile& file, const LearnedParts& parts) {
  if (parts.unet != nullptr) take_weights(path, file, *parts.unet);
  if (parts.statics != nullptr) take_statics(path, file, *parts.statics);
  if (parts.extents != nullptr) take_extents(path, file, *parts.extents);
}

// [P]'s state under "prefix.". Its number of steps by a key of its own.
void add_optimiser(const std::string& prefix, const model::Optimiser& optimiser, TensorFile& file) {
  file.tensors[prefix + ".first_moment"] = flat_tensor(optimiser.first_moment);
  file.tensors[prefix + ".second_moment"] = flat_tensor(optimiser.second_moment);
  file.metadata[prefix + "_steps"] = exact(static_cast<double>(optimiser.steps));
}

void take_optimiser(const std::string& path, const TensorFile& file, const std::string& prefix,
                    model::Optimiser& optimiser) {
  take_flat_tensor(file, path, prefix + ".first_moment", optimiser.first_moment);
  take_flat_tensor(file, path, prefix + ".second_moment", optimiser.second_moment);
  optimiser.steps = static_cast<int64_t>(parse_double(path, file.metadata, prefix + "_steps"));
}

void add_adapter(const model::NetworkAdapter& adapter, TensorFile& file) {
  file.tensors["adapter.base"] = flat_tensor(adapter.base());
  file.tensors["adapter.factors"] = flat_tensor(adapter.factors());
  if (adapter.kind() == model::AdapterKind::kBasis)
    file.tensors["adapter.basis"] = flat_tensor(adapter.basis());
}

void take_adapter(const std::string& path, const TensorFile& file, model::NetworkAdapter& adapter) {
  torch::Tensor base = torch::empty_like(adapter.base());
  take_flat_tensor(file, path, "adapter.base", base);
  adapter.set_base(base);
  take_flat_tensor(file, path, "adapter.factors", adapter.factors());
  if (adapter.kind() != model::AdapterKind::kBasis) return;
  torch::Tensor basis = torch::empty_like(adapter.basis());
  take_flat_tensor(file, path, "adapter.basis", basis);
  if (!torch::equal(basis, adapter.basis()))
    throw InputError(path + ": adapter.basis: network_basis is another file than it was");
}

std::string person_prefix(size_t further) { return "person." + std::to_string(further + 1) + "."; }

std::string weights_file(const std::string& path) {
  return std::filesystem::is_directory(path) ? RunDirectory{path}.weights() : path;
}

struct StageField {
  const char* name;
  double StageSeconds::* member;
};
constexpr StageField kStageFields[] = {{"seconds_data", &StageSeconds::data},
                                       {"seconds_unet_forward", &StageSeconds::unet_forward},
                                       {"seconds_compose", &StageSeconds::compose},
                                       {"seconds_splat_forward", &StageSeconds::splat_forward},
                                       {"seconds_loss", &StageSeconds::loss},
                                       {"seconds_perceptual", &StageSeconds::perceptual},
                                       {"seconds_splat_backward", &StageSeconds::splat_backward},
                                       {"seconds_unet_backward", &StageSeconds::unet_backward},
                                       {"seconds_optimiser", &StageSeconds::optimiser}};

}  // namespace

void save_weights(const RunDirectory& run, const LearnedParts& parts) {
  TensorFile file;
  add_parts(parts, file);
  write_tensor_file(run.weights(), file);
}

void load_weights(const std::string& path, const LearnedParts& parts) {
  const std::string file = weights_file(path);
  take_parts(file, read_tensor_file(file), parts);
}

void load_weights(const std::string& path, model::PoseUNet& unet) {
  load_weights(path, LearnedParts{.unet = &unet, .statics = nullptr});
}

void load_initial_weights(const std::string& path, const LearnedParts& parts) {
  const std::string file = weights_file(path);
  const TensorFile tensors = read_tensor_file(file);
  LearnedParts there = parts;
  if (!tensors.tensors.contains(static_name(0))) there.statics = nullptr;
  there.extents = nullptr;
  take_parts(file, tensors, there);
}

void save_checkpoint(const RunDirectory& run, const TrainingState& state, const LearnedParts& parts,
                     const PartOptimisers& optimisers, const std::vector<FurtherPerson>& further) {
  TensorFile file;
  add_parts(parts, file);
  if (optimisers.unet != nullptr) add_optimiser("optimiser", *optimisers.unet, file);
  if (optimisers.statics != nullptr) add_optimiser("static_optimiser", *optimisers.statics, file);
  if (parts.adapter != nullptr) add_adapter(*parts.adapter, file);
  for (size_t p = 0; p < further.size(); ++p) {
    add_statics(*further[p].statics, file, person_prefix(p));
    add_optimiser(person_prefix(p) + "static_optimiser", *further[p].optimiser, file);
  }
  file.metadata["iteration"] = exact(static_cast<double>(state.iteration));
  file.metadata["seconds"] = exact(state.seconds);
  file.metadata["settings"] = state.settings_hash;
  for (const StageField& field : kStageFields)
    file.metadata[field.name] = exact(state.stages.*field.member);
  write_tensor_file(run.checkpoint(), file);
}

TrainingState load_checkpoint(const RunDirectory& run, const LearnedParts& parts,
                              const PartOptimisers& optimisers,
                              const std::vector<FurtherPerson>& further) {
  const std::string path = run.checkpoint();
  const TensorFile file = read_checkpoint_file(path);
  TrainingState state;
  state.iteration = static_cast<uint64_t>(parse_double(path, file.metadata, "iteration"));
  state.seconds = parse_double(path, file.metadata, "seconds");
  if (const auto found = file.metadata.find("settings"); found != file.metadata.end())
    state.settings_hash = found->second;
  for (const StageField& field : kStageFields) {
    // Checkpoints of before there were these stages say nothing of them.
    const bool may_lack =
        field.member == &StageSeconds::compose || field.member == &StageSeconds::perceptual;
    if (file.metadata.contains(field.name) || !may_lack)
      state.stages.*field.member = parse_double(path, file.metadata, field.name);
  }
  take_parts(path, file, parts);
  if (optimisers.unet != nullptr) take_optimiser(path, file, "optimiser", *optimisers.unet);
  if (optimisers.statics != nullptr)
    take_optimiser(path, file, "static_optimiser", *optimisers.statics);
  if (parts.adapter != nullptr) take_adapter(path, file, *parts.adapter);
  for (size_t p = 0; p < further.size(); ++p) {
    take_statics(path, file, *further[p].statics, person_prefix(p));
    take_optimiser(path, file, person_prefix(p) + "static_optimiser", *further[p].optimiser);
  }
  return state;
}

void save_log(const RunDirectory& run, const std::vector<LogRow>& rows) {
  std::string text = kLogHeader;
  for (const LogRow& row : rows) {
    char line[160];
    std::snprintf(line, sizeof(line), "%llu,%.3f,%.6g,%.6f,%.3f\n",
                  static_cast<unsigned long long>(row.iteration), row.seconds, row.learning_rate,
                  row.loss, row.psnr_db);
    text += line;
  }
  write_text(run.log(), text);
}

std::vector<LogRow> load_log(const RunDirectory& run, uint64_t iteration) {
  std::vector<LogRow> rows;
  std::ifstream file(run.log());
  std::string line;
  std::getline(file, line);
  while (std::getline(file, line)) {
    LogRow row;
    unsigned long long at = 0;
    if (std::sscanf(line.c_str(), "%llu,%lf,%lf,%lf,%lf", &at, &row.seconds, &row.learning_rate,
                    &row.loss, &row.psnr_db) != 5) {
      throw InputError(run.log() + ": row " + std::to_string(rows.size() + 1) +
                       ": not five numbers");
    }
    row.iteration = at;
    if (row.iteration <= iteration) rows.push_back(row);
  }
  return rows;
}

nlohmann::json read_json(const std::string& path) {
  const ports::MappedFile file = [&] {
    Result<ports::MappedFile> opened = ports::MappedFile::open(path);
    if (!opened.ok()) throw InputError(opened.status().message());
    return std::move(opened).value();
  }();
  const char* text = reinterpret_cast<const char*>(file.bytes().data());
  try {
    return nlohmann::json::parse(text, text + file.bytes().size());
  } catch (const nlohmann::json::exception&) {
    throw InputError(path + ": is not JSON");
  }
}

void write_json(const std::string& path, const nlohmann::json& json) {
  write_text(path, json.dump(2) + "\n");
}

std::string hash_of_settings(nlohmann::json settings) {
  settings.erase("threads");
  const std::string text = settings.dump();
  return format_hash(hash_picture({reinterpret_cast<const uint8_t*>(text.data()), text.size()}));
}

void make_folder(const std::string& path) {
  std::error_code error;
  std::filesystem::create_directories(path, error);
  if (error) throw InputError(path + ": cannot be created: " + error.message());
}

nlohmann::json describe_machine() {
  std::string cpu = "unknown", line;
  std::ifstream info("/proc/cpuinfo");
  while (std::getline(info, line)) {
    if (line.rfind("model name", 0) != 0) continue;
    if (const size_t colon = line.find(": "); colon != std::string::npos)
      cpu = line.substr(colon + 2);
    break;
  }
  utsname name{};
  uname(&name);
  return {{"cpu", cpu},
          {"cores", std::thread::hardware_concurrency()},
          {"architecture", name.machine},
          {"system", name.sysname}};
}

std::string utc_now() {
  const std::time_t now = std::time(nullptr);
  std::tm parts{};
  gmtime_r(&now, &parts);
  char text[32];
  std::strftime(text, sizeof(text), "%Y-%m-%dT%H:%M:%SZ", &parts);
  return text;
}

std::string current_command() {
  std::ifstream file("/proc/self/cmdline", std::ios::binary);
  std::string command, argument;
  while (std::getline(file, argument, '\0')) {
    if (command.empty()) argument = std::filesystem::path(argument).filename().string();
    command += (command.empty() ? "" : " ") +
               (argument.find(' ') == std::string::npos ? argument : "'" + argument + "'");
  }
  return command;
}

std::string current_commit() {
  if (const char* given = std::getenv("FIGURINE_COMMIT"); given != nullptr && *given != 0)
    return given;
  std::error_code error;
  for (std::filesystem::path folder = std::filesystem::current_path(error); !error;
       folder = folder.parent_path()) {
    std::string head;
    std::ifstream file(folder / ".git" / "HEAD");
    if (std::getline(file, head)) {
      if (head.rfind("ref: ", 0) != 0) return head;
      std::string commit;
      std::ifstream reference(folder / ".git" / head.substr(5));
      if (std::getline(reference, commit)) return commit;
      break;
    }
    if (folder == folder.root_path()) break;
  }
  return "unknown";
}

}  // namespace figurine::train
