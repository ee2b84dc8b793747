// Plays a motion as a VMC performer would, to try `figurine live --pose vmc://:39539` without one,
// and to measure it:
//
//   vmc_send BODY.fgn MOTION.fgn [--to ADDRESS:PORT] [--fps N] [--seconds N] [--split]
//   vmc_send BODY.fgn MOTION.fgn --round-trip     how far poses are from themselves after it, as
//   JSON vmc_send BODY.fgn MOTION.fgn --seeds FOLDER   the first pose's datagrams as files, for a
//   fuzzer
//
// --split: every message is a datagram of its own, where usually a bundle holds twenty.
#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <string>

#include "figurine/package.h"
#include "ports/host/clock.h"
#include "ports/host/files.h"
#include "ports/vmc/udp.h"
#include "ports/vmc/vmc_round_trip.h"

namespace figurine::tests {
namespace {

struct Options {
  std::string body, motion, seeds;
  ports::UdpAddress to;
  double frames_per_second = 60, seconds = 1e9;
  bool round_trip = false, split = false;
};

int refuse(const std::string& why) {
  std::fprintf(stderr, "vmc_send: %s\n", why.c_str());
  return 1;
}

// Every figure that a test asserts, for scripts.
int print_round_trip(const Body& body, const Motion& motion) {
  const RoundTrip trip = measure_round_trip(body, motion, 1400);
  std::printf(
      "{\"worst_deg\": %.9g, \"worst_joint\": \"%s\", \"worst_root_m\": %.9g, "
      "\"frames\": %u, \"datagrams\": %llu}\n",
      trip.worst_deg, trip.worst_joint.c_str(), trip.worst_root_m, motion.frame_count,
      static_cast<unsigned long long>(trip.datagrams));
  return 0;
}

int write_seeds(const Options& options, const ports::HumanoidRig& rig, const Motion& motion) {
  const ports::HumanoidPose pose = rig.from_body(motion.pose(0));
  const auto write = [&](const std::string& name, const OscWriter& packet) {
    return ports::write_file_atomically(options.seeds + "/" + name + ".osc", packet.packet());
  };
  const std::vector<OscWriter> messages = vmc_messages(pose, 0.5);
  OscWriter types, inner, nested;
  types.message("/t", "ifsbTFNIhdt").word(7).real(0.5f).text("name").blob("blob!").long_word(1);
  types.long_word(0x3FE0000000000000).long_word(1);
  inner.bundle().element(messages[4]).element(messages.back());
  nested.bundle().element(messages[0]).element(inner);
  const std::pair<const char*, const OscWriter*> seeds[] = {
      {"ok", &messages[0]},
      {"time", &messages[1]},
      {"root", &messages[2]},
      {"bone", &messages[3]},
      {"channel", &messages[3 + ports::kHumanoidBones]},
      {"apply", &messages.back()},
      {"types", &types},
      {"nested", &nested}};
  for (const auto& [name, packet] : seeds) {
    if (const Status status = write(name, *packet); !status.ok()) return refuse(status.message());
  }
  const OscWriter bundle = vmc_datagrams(pose, 0.5)[0];
  const Status status = write("bundle", bundle);
  return status.ok() ? 0 : refuse(status.message());
}

int send(const Options& options, const ports::HumanoidRig& rig, const Motion& motion) {
  const int descriptor = ::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  sockaddr_in place{};
  place.sin_family = AF_INET;
  place.sin_port = htons(options.to.port);
  ::inet_pton(AF_INET, options.to.host.c_str(), &place.sin_addr);
  if (descriptor < 0) return refuse(std::strerror(errno));
  const uint64_t start_ns = ports::now_ns();
  for (uint64_t tick = 0;; ++tick) {
    const double time_s = static_cast<double>(tick) / options.frames_per_second;
    if (time_s >= options.seconds) break;
    ports::sleep_until(start_ns + static_cast<uint64_t>(time_s * 1e9));
    const auto frame = static_cast<uint64_t>(time_s * motion.frames_per_second);
    const PoseView pose = motion.pose(static_cast<uint32_t>(frame % motion.frame_count));
    for (const OscWriter& datagram :
         vmc_datagrams(rig.from_body(pose), time_s, options.split ? 0 : 1400)) {
      // A listener that is not there (yet) is no error of a sender.
      ::sendto(descriptor, datagram.packet().data(), datagram.size(), 0,
               reinterpret_cast<const sockaddr*>(&place), sizeof(place));
    }
  }
  ::close(descriptor);
  return 0;
}

int main_of(const Options& options) {
  const Result<ports::MappedFile> body_file = ports::MappedFile::open(options.body),
                                  motion_file = ports::MappedFile::open(options.motion);
  if (!body_file.ok()) return refuse(body_file.status().message());
  if (!motion_file.ok()) return refuse(motion_file.status().message());
  const Result<Package> body_package = Package::open(body_file.value().bytes(), options.body),
                        motion_package = Package::open(motion_file.value().bytes(), options.motion);
  if (!body_package.ok()) return refuse(body_package.status().message());
  if (!motion_package.ok()) return refuse(motion_package.status().message());
  if (body_package.value().kind() != PackageKind::kBody ||
      motion_package.value().kind() != PackageKind::kMotion)
    return refuse("wants a body and a motion");
  const Body& body = body_package.value().body();
  const Motion& motion = motion_package.value().motion();
  if (const Status fits = check_motion_fits_body(motion, body); !fits.ok())
    return refuse(fits.message());
  Result<ports::HumanoidRig> rig =
      ports::HumanoidRig::create(body.joint_names, body.mean_skeleton());
  if (!rig.ok()) return refuse(rig.status().message());
  if (options.round_trip) return print_round_trip(body, motion);
  if (!options.seeds.empty()) return write_seeds(options, rig.value(), motion);
  return send(options, rig.value(), motion);
}

}  // namespace
}  // namespace figurine::tests

int main(int argc, char** argv) {
  using namespace figurine;
  tests::Options options;
  int places = 0;
  for (int i = 1; i < argc; ++i) {
    const std::string word = argv[i];
    const bool last = i + 1 == argc;
    if (word == "--round-trip") {
      options.round_trip = true;
    } else if (word == "--split") {
      options.split = true;
    } else if (word.starts_with("--") && last) {
      return tests::refuse(word + ": wants a value");
    } else if (word == "--seeds") {
      options.seeds = argv[++i];
    } else if (word == "--fps") {
      options.frames_per_second = std::atof(argv[++i]);
    } else if (word == "--seconds") {
      options.seconds = std::atof(argv[++i]);
    } else if (word == "--to") {
      const Result<ports::UdpAddress> to =
          ports::parse_vmc_address(std::string("vmc://") + argv[++i]);
      if (!to.ok()) return tests::refuse(to.status().message());
      options.to = to.value();
    } else if (word.starts_with("--") || places == 2) {
      return tests::refuse(word + ": unknown");
    } else {
      (places++ == 0 ? options.body : options.motion) = word;
    }
  }
  if (places != 2 || !(options.frames_per_second > 0)) return tests::refuse("see vmc_send.cpp");
  return tests::main_of(options);
}
