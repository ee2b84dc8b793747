#include "toolchain/generate/process_group.h"

#include <netdb.h>
#include <sys/socket.h>
#include <unistd.h>

#include <charconv>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <torch/csrc/distributed/c10d/ProcessGroupGloo.hpp>
#include <torch/csrc/distributed/c10d/TCPStore.hpp>

#include "toolchain/tensor_operations.h"

namespace figurine::generate {

namespace {

constexpr int kMaxRanks = 4096;
constexpr uint16_t kDefaultPort = 29500;  // torchrun's
constexpr int64_t kFirstJobPort = 20000,
                  kJobPorts = 10000;  // below the range from which the kernel gives ports away

using Environment = std::function<const char*(const char*)>;

int64_t number(const Environment& get, const char* name, int64_t low, int64_t high) {
  const char* text = get(name);
  if (text == nullptr)
    throw InputError(std::string(name) + ": is not set, but other variables of a rank are");
  int64_t value = 0;
  const char* end = text + std::strlen(text);
  const auto read = std::from_chars(text, end, value);
  if (read.ec != std::errc{} || read.ptr != end || value < low || value > high) {
    throw InputError(std::string(name) + ": '" + text + "' is no number of " + std::to_string(low) +
                     " to " + std::to_string(high));
  }
  return value;
}

// The address of this machine by which it reaches host: no packet is sent, the kernel looks into
// its routes.
std::string own_address_towards(const std::string& host, uint16_t port) {
  addrinfo hints{}, *list = nullptr;
  hints.ai_socktype = SOCK_DGRAM;
  const int error = getaddrinfo(host.c_str(), std::to_string(port).c_str(), &hints, &list);
  if (error != 0) throw std::runtime_error(host + ": " + gai_strerror(error));
  const std::unique_ptr<addrinfo, void (*)(addrinfo*)> owner(list, freeaddrinfo);
  for (const addrinfo* info = list; info != nullptr; info = info->ai_next) {
    const int fd = socket(info->ai_family, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    if (fd < 0) continue;
    sockaddr_storage own{};
    socklen_t length = sizeof(own);
    char text[NI_MAXHOST];
    const bool found = connect(fd, info->ai_addr, info->ai_addrlen) == 0 &&
                       getsockname(fd, reinterpret_cast<sockaddr*>(&own), &length) == 0 &&
                       getnameinfo(reinterpret_cast<sockaddr*>(&own), length, text, sizeof(text),
                                   nullptr, 0, NI_NUMERICHOST) == 0;
    close(fd);
    if (found) return text;
  }
  throw std::runtime_error(host + ": no route to it");
}

// The address of this rank for the others. Rank 0's own name may mean its loopback interface there,
// so it looks where the last rank is.
std::string own_address(c10d::Store& store, const RankPlace& place) {
  if (place.rank == 0) return own_address_towards(store.get_to_str("last_rank"), place.port);
  const std::string address = own_address_towards(place.host, place.port);
  if (place.rank == place.size - 1) store.set("last_rank", address);
  return address;
}

// c10 adds where it threw and the stack below: only the first line is for people.
std::string reason_of(const std::exception& error) {
  const auto* known = dynamic_cast<const c10::Error*>(&error);
  std::string text = known != nullptr ? known->what_without_backtrace() : error.what();
  text = text.substr(0, text.find('\n'));
  // "[file.cc:123] what": the place is Gloo's own.
  if (text.starts_with('[') && text.find("] ") != std::string::npos)
    text = text.substr(text.find("] ") + 2);
  while (!text.empty() && (text.back() == '.' || text.back() == ' ')) text.pop_back();
  return text;
}

}  // namespace

std::string first_host(const std::string& list) {
  std::string host;
  bool inside = false, skip = false;  // in brackets; behind their first number
  for (const char c : list) {
    if (c == '[') {
      inside = true, skip = false;
    } else if (c == ']') {
      inside = false;
    } else if (inside) {
      skip = skip || c == '-' || c == ',';
      if (!skip) host += c;
    } else if (c == ',') {
      break;
    } else {
      host += c;
    }
  }
  return host;
}

RankPlace rank_place_from(const Environment& get) {
  const char* address = get("MASTER_ADDR");
  RankPlace place;
  if (get("RANK") != nullptr || get("WORLD_SIZE") != nullptr) {
    place.size = static_cast<int>(number(get, "WORLD_SIZE", 1, kMaxRanks));
    place.rank = static_cast<int>(number(get, "RANK", 0, place.size - 1));
    place.port = kDefaultPort;
    if (place.size > 1 && address == nullptr)
      throw InputError("MASTER_ADDR: is not set: where is rank 0?");
  } else if (get("SLURM_STEP_NUM_TASKS") != nullptr) {
    place.size = static_cast<int>(number(get, "SLURM_STEP_NUM_TASKS", 1, kMaxRanks));
    place.rank = static_cast<int>(number(get, "SLURM_PROCID", 0, place.size - 1));
    if (place.size == 1) return {};
    place.port = static_cast<uint16_t>(kFirstJobPort +
                                       number(get, "SLURM_JOB_ID", 0, INT64_MAX) % kJobPorts);
    if (address == nullptr) {
      const char* nodes = get("SLURM_STEP_NODELIST");
      place.host = first_host(nodes != nullptr ? nodes : "");
      if (place.host.empty())
        throw InputError("SLURM_STEP_NODELIST: names no node, and MASTER_ADDR is not set");
    }
  }
  if (place.size == 1) return {};
  if (address != nullptr) place.host = address;
  if (get("MASTER_PORT") != nullptr)
    place.port = static_cast<uint16_t>(number(get, "MASTER_PORT", 1, 65535));
  return place;
}

RankPlace rank_place_from_environment() {
  return rank_place_from([](const char* name) -> const char* { return std::getenv(name); });
}

struct ProcessGroup::Impl {
  c10::intrusive_ptr<c10d::Store> store;
  c10::intrusive_ptr<c10d::ProcessGroupGloo> gloo;
};

std::string ProcessGroup::name() const {
  return "rank " + std::to_string(place_.rank) + " of " + std::to_string(place_.size);
}

template <class F>
void ProcessGroup::talk(const char* doing, F&& function) {
  try {
    function();
  } catch (const std::exception& error) {
    throw PeerLost(name() + ": " + doing + ": " + reason_of(error));
  }
}

ProcessGroup::ProcessGroup(const RankPlace& place, double timeout_s) : place_(place) {
  if (place_.size == 1) return;
  // c10d tells every attempt to connect with a stack below it; what is wrong in the end is said by
  // what is thrown here.
  setenv("TORCH_CPP_LOG_LEVEL", "FATAL", 0);
  c10::initLogging();
  // Gloo and the store write to connections of ranks that have just ended: that is to be an error
  // here, not the end of this rank.
  std::signal(SIGPIPE, SIG_IGN);
  const std::chrono::milliseconds timeout(static_cast<int64_t>(1000 * timeout_s));
  const std::string where = "no meeting of the ranks at " + place_.host + ":" +
                            std::to_string(place_.port) + " within " +
                            std::to_string(static_cast<int64_t>(timeout_s)) + " s";
  talk(where.c_str(), [&] {
    impl_ = std::make_unique<Impl>();
    c10d::TCPStoreOptions meeting;
    meeting.port = place_.port, meeting.isServer = leads(),
    meeting.numWorkers = static_cast<size_t>(place_.size);
    meeting.timeout = timeout, meeting.useLibUV = false;  // Debian's libtorch is built without
    impl_->store = c10::make_intrusive<c10d::TCPStore>(place_.host, meeting);
    const auto options = c10d::ProcessGroupGloo::Options::create(timeout);
    const char* interface = std::getenv("GLOO_SOCKET_IFNAME");
    options->devices.push_back(
        interface != nullptr
            ? c10d::ProcessGroupGloo::createDeviceForInterface(interface)
            : c10d::ProcessGroupGloo::createDeviceForHostname(own_address(*impl_->store, place_)));
    options->threads = 1;  // messages come one after the other
    impl_->gloo = c10::make_intrusive<c10d::ProcessGroupGloo>(impl_->store, place_.rank,
                                                              place_.size, options);
  });
}

ProcessGroup::~ProcessGroup() = default;

// Gloo reduces every stretch of the tensor on one rank and hands the result round, so all ranks get
// the same bits.
void ProcessGroup::sum(torch::Tensor& values) {
  if (!impl_) return;
  talk("lost another rank, which has ended or is silent", [&] {
    std::vector<at::Tensor> list{values};
    impl_->gloo->allreduce(list)->wait();
  });
}

void ProcessGroup::broadcast(torch::Tensor& values) {
  if (!impl_) return;
  talk("lost another rank, which has ended or is silent", [&] {
    std::vector<at::Tensor> list{values};
    impl_->gloo->broadcast(list)->wait();
  });
}

std::string ProcessGroup::broadcast(const std::string& text) {
  if (!impl_) return text;
  torch::Tensor size = torch::tensor({static_cast<int64_t>(text.size())});
  broadcast(size);
  torch::Tensor bytes = torch::zeros({size.item<int64_t>()}, torch::kUInt8);
  if (bytes.numel() == 0) return {};
  if (leads()) std::memcpy(bytes.data_ptr<uint8_t>(), text.data(), text.size());
  broadcast(bytes);
  return {reinterpret_cast<const char*>(bytes.data_ptr<uint8_t>()),
          static_cast<size_t>(bytes.numel())};
}

void ProcessGroup::barrier() {
  torch::Tensor one = torch::ones({1});
  sum(one);
}

void ProcessGroup::expect_same(const torch::Tensor& values, const std::string& what) {
  if (!impl_) return;
  const auto own = static_cast<int64_t>(hash_bits(values));
  torch::Tensor leader = torch::tensor({own});
  broadcast(leader);
  if (leader.item<int64_t>() != own)
    throw InputError(name() + ": " + what + " are no longer those of rank 0");
}

uint64_t hash_bits(const torch::Tensor& values) {
  const float* data = values.data_ptr<float>();
  uint64_t hash = 0x9e3779b97f4a7c15u;
  for (int64_t i = 0; i < values.numel(); ++i) {
    uint32_t word;
    std::memcpy(&word, data + i, sizeof(word));
    hash = (hash ^ word) * 0xbf58476d1ce4e5b9u;
    hash ^= hash >> 29;
  }
  return hash;
}

}  // namespace figurine::generate
