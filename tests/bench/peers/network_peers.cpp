// An avatar's network by figurine and by other libraries, on the maps of recorded poses, one
// thread.
//
//   network_peers export AVATAR.fgn BODY.fgn MOTION.fgn DIR    layers and weights, for
//                                                              network_models.py to write models of
//   network_peers run AVATAR.fgn BODY.fgn MOTION.fgn DIR       JSON on standard output
//
// `run` first compares what every peer says with figurine's runner of the same precision, on every
// input, and then times all of them by turns, input by input: whatever else the machine does falls
// on all alike. Figurine's integer runner evaluates what an avatar's frame asks of it: six channels
// of 26 vary, and cells that the body does not cover are not evaluated at either end; "q8 dense" is
// the same without that knowledge, as the others have none. scripts/experiments/network_peers.py
// runs it all.
#include <time.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <functional>
#include <limits>
#include <nlohmann/json.hpp>
#include <numeric>
#include <string>
#include <vector>

#include "bench/peers/network_peer.h"
#include "figurine/package.h"
#include "figurine/texel_grid.h"
#include "ports/host/clock.h"
#include "ports/host/files.h"
#include "runtime/src/nn/fixed_point_runner.h"
#include "runtime/src/nn/network_runner.h"
#include "runtime/test_packages.h"

namespace figurine::peers {
namespace {

using Json = nlohmann::ordered_json;

constexpr uint32_t kInputs = 8;   // poses, evenly through the motion
constexpr uint32_t kRounds = 40;  // over all of them

[[noreturn]] void fail(const std::string& message) {
  std::fprintf(stderr, "network_peers: %s\n", message.c_str());
  std::exit(1);
}

struct Loaded {
  ports::MappedFile file;
  Package package;
};
Loaded load(const std::string& path, PackageKind kind) {
  Result<ports::MappedFile> file = ports::MappedFile::open(path);
  if (!file.ok()) fail(file.status().message());
  Result<Package> package = Package::open(file->bytes(), path);
  if (!package.ok()) fail(package.status().message());
  if (package->kind() != kind) fail(path + ": kind: is not a " + to_string(kind));
  return {std::move(*file), std::move(*package)};
}

// ---- figurine's own -----------------------------------------------------------------------------

class OurFloat final : public NetworkPeer {
 public:
  OurFloat(const Network& network, ThreadPool& pool)
      : runner_(std::move(NetworkRunner::create(network, pool)).value()) {}
  void set_input(std::span<const float> input) override {
    std::copy(input.begin(), input.end(), runner_->input().begin());
  }
  void run() override { FIG_CHECK(runner_->run().ok(), "the network runs"); }
  void get_output(std::span<float> output) override {
    std::copy_n(runner_->output().begin(), output.size(), output.begin());
  }

 private:
  std::unique_ptr<NetworkRunner> runner_;
};

class OurIntegers final : public NetworkPeer {
 public:
  // varying: channels, the first ones, that a pose changes; cells: that the body covers or borders.
  OurIntegers(const Avatar& avatar, uint32_t varying, std::vector<uint32_t> drawn,
              std::vector<uint32_t> wanted, std::span<const float> input, ThreadPool& pool)
      : channels_(avatar.network.input_channels),
        varying_(varying),
        drawn_(std::move(drawn)),
        wanted_(std::move(wanted)) {
    std::vector<float> constants;
    for (size_t at = 0; at < input.size(); at += channels_)
      constants.insert(constants.end(), input.begin() + static_cast<ptrdiff_t>(at + varying_),
                       input.begin() + static_cast<ptrdiff_t>(at + channels_));
    runner_ = std::move(FixedPointRunner::create(avatar.network, avatar.fixed_point,
                                                 {.varying_channels = varying_,
                                                  .constants = constants,
                                                  .drawn = drawn_,
                                                  .wanted = wanted_},
                                                 pool))
                  .value();
  }
  void set_input(std::span<const float> input) override {
    for (const uint32_t cell : drawn_) {
      std::copy_n(&input[size_t{cell} * channels_], varying_,
                  &runner_->input()[size_t{cell} * runner_->input_stride()]);
    }
  }
  void run() override { FIG_CHECK(runner_->run().ok(), "the network runs"); }
  // Cells that are not wanted are NaN.
  void get_output(std::span<float> output) override {
    std::fill(output.begin(), output.end(), std::numeric_limits<float>::quiet_NaN());
    const size_t outputs = runner_->output().size() / wanted_.size();
    for (size_t i = 0; i < wanted_.size(); ++i) {
      std::copy_n(&runner_->output()[i * outputs], outputs, &output[size_t{wanted_[i]} * outputs]);
    }
  }

 private:
  uint32_t channels_, varying_;
  std::vector<uint32_t> drawn_, wanted_;
  std::unique_ptr<FixedPointRunner> runner_;
};

// ---- Export -------------------------------------------------------------------------------------

class Blob {
 public:
  template <class T>
  Json add(std::span<const T> values) {
    const Json place = {bytes_.size(), values.size()};
    const std::span<const std::byte> raw = std::as_bytes(values);
    bytes_.insert(bytes_.end(), raw.begin(), raw.end());
    bytes_.resize((bytes_.size() + 7) / 8 * 8);
    return place;
  }
  const std::vector<std::byte>& bytes() const { return bytes_; }

 private:
  std::vector<std::byte> bytes_;
};

// network.json, with places [first byte, count] in network.bin.
void export_network(const Avatar& avatar, const std::string& folder) {
  static constexpr const char* kNames[] = {"conv", "max_pool", "upsample", "concat"};
  Blob blob;
  Json json = {{"input_size", avatar.network.input_size},
               {"input_channels", avatar.network.input_channels}};
  for (const Quantisation& value : avatar.fixed_point.values)
    json["values"].push_back({{"scale", value.scale}, {"zero_point", value.zero_point}});
  for (size_t i = 0; i < avatar.network.layers.size(); ++i) {
    const Layer& layer = avatar.network.layers[i];
    Json entry = {{"op", kNames[static_cast<size_t>(layer.op)]},
                  {"inputs", {layer.inputs[0], layer.inputs[1]}}};
    if (layer.op == LayerOp::kConv2d) {
      const FixedPointConvolution& fixed = avatar.fixed_point.convolutions[i];
      entry.update({{"out_channels", layer.out_channels},
                    {"kernel", layer.kernel},
                    {"relu", layer.relu},
                    {"weights", blob.add(layer.weights)},
                    {"bias", blob.add(layer.bias)},
                    {"fixed_weights", blob.add(fixed.weights)},
                    {"weight_scale", blob.add(fixed.weight_scale)},
                    {"fixed_bias", blob.add(fixed.bias)}});
    }
    json["layers"].push_back(entry);
  }
  const std::string text = json.dump(1) + "\n";
  Status written = ports::write_file_atomically(folder + "/network.bin", blob.bytes());
  if (written.ok())
    written =
        ports::write_file_atomically(folder + "/network.json", std::as_bytes(std::span(text)));
  if (!written.ok()) fail(written.message());
}

// ---- Comparing and timing -----------------------------------------------------------------------

struct Contestant {
  std::string name, precision, library;
  std::unique_ptr<NetworkPeer> peer;
  size_t truth = 0;  // that it is compared with
  double largest_error = 0, sum_of_squares = 0;
  uint64_t values = 0;
  std::vector<double> ms, cpu_ms;
};

// Against the truth's last output; values that either does not have (NaN) do not count.
void compare(std::span<const float> truth, std::span<const float> output, Contestant& of) {
  for (size_t i = 0; i < truth.size(); ++i) {
    if (std::isnan(truth[i]) || std::isnan(output[i])) continue;
    const double error = std::abs(double{truth[i]} - double{output[i]});
    of.largest_error = std::max(of.largest_error, error);
    of.sum_of_squares += error * error;
    ++of.values;
  }
}

// Of this thread, which does all the work: where a machine is busy, wall time is its neighbours'.
double cpu_ms() {
  timespec time{};
  ::clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) * 1e3 + static_cast<double>(time.tv_nsec) * 1e-6;
}

double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return values[values.size() / 2];
}

Json run_all(const Avatar& avatar, const Body& body, const Motion& motion,
             const std::string& folder) {
  const std::vector<ValueShape> shapes = *infer_shapes(avatar.network, true);
  const ValueShape in = shapes.front(), out = shapes.back();
  std::vector<std::vector<float>> inputs;
  for (uint32_t k = 0; k < kInputs; ++k)
    inputs.push_back(tests::network_input(
        avatar, body,
        motion.pose(static_cast<uint32_t>(uint64_t{k} * motion.frame_count / kInputs))));

  ThreadPool pool = std::move(ThreadPool::create(1)).value();
  const TexelGrid grid = make_texel_grid(body, avatar.network.input_size);
  std::vector<uint32_t> cells(grid.cell.begin(), grid.cell.end()), drawn = cells;
  drawn.insert(drawn.end(), grid.border_cell.begin(), grid.border_cell.end());
  std::sort(drawn.begin(), drawn.end());
  std::vector<uint32_t> all(size_t{in.size} * in.size);
  std::iota(all.begin(), all.end(), 0u);

  std::vector<Contestant> contestants;
  const auto add = [&](const char* name, const char* precision, const std::string& library,
                       std::unique_ptr<NetworkPeer> peer, size_t truth) {
    if (peer == nullptr) fail(std::string(name) + ": cannot run");
    contestants.push_back({.name = name,
                           .precision = precision,
                           .library = library,
                           .peer = std::move(peer),
                           .truth = truth,
                           .ms = {},
                           .cpu_ms = {}});
  };
  add("figurine f32", "f32", "figurine", std::make_unique<OurFloat>(avatar.network, pool), 0);
  add("figurine q8 dense", "q8", "figurine",
      std::make_unique<OurIntegers>(avatar, in.channels, all, all, inputs[0], pool), 1);
  add("figurine q8", "q8", "figurine",
      std::make_unique<OurIntegers>(avatar, kMapChannels, drawn, cells, inputs[0], pool), 1);
  add("onnx f32", "f32", onnx_name(), make_onnx_peer(folder + "/f32.onnx", in, out), 0);
  add("onnx q8", "q8", onnx_name(), make_onnx_peer(folder + "/q8.onnx", in, out), 1);
#ifdef FIGURINE_TORCH_PEER
  add("torch f32", "f32", torch_name(), make_torch_peer(avatar.network, in, out), 0);
#endif

  const size_t outputs = size_t{out.size} * out.size * out.channels;
  double largest_output = 0;
  std::vector<std::vector<float>> output(contestants.size(), std::vector<float>(outputs));
  for (const std::vector<float>& input : inputs) {
    for (size_t i = 0; i < contestants.size(); ++i) {
      contestants[i].peer->set_input(input);
      contestants[i].peer->run();
      contestants[i].peer->get_output(output[i]);
      compare(output[contestants[i].truth], output[i], contestants[i]);
    }
    for (const float value : output[0])
      largest_output = std::max(largest_output, std::abs(double{value}));
  }
  for (uint32_t round = 0; round < kRounds; ++round) {
    for (size_t k = 0; k < inputs.size(); ++k) {
      for (size_t turn = 0; turn < contestants.size(); ++turn) {
        Contestant& one = contestants[(turn + round + k) % contestants.size()];
        one.peer->set_input(inputs[k]);
        const double start_cpu_ms = cpu_ms();
        const uint64_t start_ns = ports::now_ns();
        one.peer->run();
        one.ms.push_back(static_cast<double>(ports::now_ns() - start_ns) * 1e-6);
        one.cpu_ms.push_back(cpu_ms() - start_cpu_ms);
      }
    }
  }

  Json json = {{"macs", count_macs(avatar.network, shapes)},
               {"input", {in.size, in.size, in.channels}},
               {"poses", kInputs},
               {"rounds", kRounds},
               {"largest_output", largest_output}};
  for (const Contestant& one : contestants) {
    const double ms = median(one.ms), spent_ms = median(one.cpu_ms);
    json["rows"].push_back(
        {{"name", one.name},
         {"library", one.library},
         {"precision", one.precision},
         {"median_ms", ms},
         {"median_cpu_ms", spent_ms},
         {"against", contestants[one.truth].name},
         {"largest_error", one.largest_error},
         {"rms_error",
          std::sqrt(one.sum_of_squares / static_cast<double>(std::max<uint64_t>(one.values, 1)))},
         {"ratio_to_figurine", ms / median(contestants[one.truth].ms)},
         {"cpu_ratio_to_figurine", spent_ms / median(contestants[one.truth].cpu_ms)}});
  }
  return json;
}

int run(int argc, char** argv) {
  const std::string what = argc == 6 ? argv[1] : "";
  if (what != "export" && what != "run") {
    std::fprintf(stderr, "usage: network_peers export|run AVATAR.fgn BODY.fgn MOTION.fgn DIR\n");
    return 2;
  }
  const Loaded avatar = load(argv[2], PackageKind::kAvatar),
               body = load(argv[3], PackageKind::kBody),
               motion = load(argv[4], PackageKind::kMotion);
  for (const Status& fits :
       {check_avatar_fits_body(avatar.package.avatar(), body.package),
        check_motion_fits_body(motion.package.motion(), body.package.body())}) {
    if (!fits.ok()) fail(fits.message());
  }
  const Avatar& content = avatar.package.avatar();
  if (!content.has_network() || !content.holds(Precision::kFloat32) ||
      !content.holds(Precision::kFixedPoint))
    fail(std::string(argv[2]) + ": network: must be there in float and in fixed point");
  if (what == "export") {
    export_network(content, argv[5]);
    return 0;
  }
  std::printf(
      "%s\n",
      run_all(content, body.package.body(), motion.package.motion(), argv[5]).dump(2).c_str());
  return 0;
}

}  // namespace
}  // namespace figurine::peers

int main(int argc, char** argv) { return figurine::peers::run(argc, argv); }
