// roofline: what this machine can do at most, for `figurine bench --roofline FILE` to hold a
// frame's stages against: products of int8 and of floats, the blend's operations, bytes from and to
// memory; on one thread and on all CPUs that this process may use. The best of many short rounds
// each: a machine that is busy in between measures the same, one that is always busy too little.
//
//   roofline [--seconds S] [-o FILE]
#include <CLI/CLI.hpp>
#include <algorithm>
#include <barrier>
#include <cstdio>
#include <cstring>
#include <functional>
#include <nlohmann/json.hpp>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "bench/roofline/peaks.h"
#include "ports/host/clock.h"
#include "ports/host/cpus.h"
#include "ports/host/files.h"
#include "samples/common/machine.h"

namespace figurine::roofline {
namespace {

using Json = nlohmann::ordered_json;

constexpr uint64_t kRounds = 100'000;        // of a loop: less than a millisecond
constexpr size_t kBufferBytes = 128u << 20;  // a thread's: beyond the caches of most machines

// Operations a second of `work`, which returns their number and is run by all threads at once: the
// best round of about so many seconds.
double best_rate(uint32_t threads, double seconds, const std::function<uint64_t(uint32_t)>& work) {
  double best = 0;
  std::barrier barrier(static_cast<std::ptrdiff_t>(threads));
  std::vector<uint64_t> counts(threads), began_ns(threads), ended_ns(threads);
  const uint64_t until_ns = ports::now_ns() + static_cast<uint64_t>(seconds * 1e9);
  bool more = true;
  const auto live = [&](uint32_t thread) {
    while (true) {
      barrier.arrive_and_wait();
      if (!more) return;
      began_ns[thread] = ports::now_ns();
      counts[thread] = work(thread);
      ended_ns[thread] = ports::now_ns();
      barrier.arrive_and_wait();
      if (thread != 0) continue;
      uint64_t count = 0;
      for (const uint64_t own : counts) count += own;
      const uint64_t took_ns = *std::max_element(ended_ns.begin(), ended_ns.end()) -
                               *std::min_element(began_ns.begin(), began_ns.end());
      best = std::max(best, static_cast<double>(count) * 1e9 / static_cast<double>(took_ns));
      more = ports::now_ns() < until_ns;  // read by the others behind the next barrier
    }
  };
  std::vector<std::thread> others;
  for (uint32_t thread = 1; thread < threads; ++thread) others.emplace_back(live, thread);
  live(0);
  for (std::thread& other : others) other.join();
  return best;
}

Json rates(const std::vector<Peak>& peaks, uint32_t threads, double seconds) {
  Json json = Json::object();
  std::vector<float> sinks(size_t{threads} * 16);  // a cache line each
  for (const Peak& peak : peaks) {
    json[peak.isa] = best_rate(threads, seconds, [&](uint32_t thread) {
      return peak.loop(kRounds, &sinks[size_t{thread} * 16]);
    });
  }
  return json;
}

double largest(const Json& rates) {
  double most = 0;
  for (const auto& [isa, rate] : rates.items()) most = std::max(most, rate.get<double>());
  return most;
}

uint64_t sum_of(const std::vector<uint64_t>& words) {
  uint64_t sums[8] = {};
  for (size_t i = 0; i + 8 <= words.size(); i += 8) {
    for (size_t k = 0; k < 8; ++k) sums[k] += words[i + k];
  }
  uint64_t sum = 0;
  for (const uint64_t part : sums) sum += part;
  return sum;
}

Json memory_rates(uint32_t threads, double seconds) {
  const size_t words = kBufferBytes / sizeof(uint64_t);
  std::vector<std::vector<uint64_t>> from(threads), to(threads);
  for (uint32_t t = 0; t < threads; ++t) from[t].assign(words, t + 1), to[t].assign(words, 1);
  std::vector<uint64_t> sinks(size_t{threads} * 8);
  const double read = best_rate(threads, seconds, [&](uint32_t t) {
    sinks[size_t{t} * 8] += sum_of(from[t]);
    return uint64_t{kBufferBytes};
  });
  const double copy = best_rate(threads, seconds, [&](uint32_t t) {
    std::memcpy(to[t].data(), from[t].data(), kBufferBytes);
    sinks[size_t{t} * 8] += to[t][words / 2];
    return 2 * uint64_t{kBufferBytes};
  });
  return {{"read", read}, {"copy", copy}};
}

Json measure(uint32_t threads, double seconds) {
  const Json int8 = rates(int8_macs(), threads, seconds),
             floats = rates(float_macs(), threads, seconds);
  return {{"threads", threads},
          {"int8_macs_per_s", largest(int8)},
          {"f32_macs_per_s", largest(floats)},
          {"int8_macs_per_s_by_isa", int8},
          {"f32_macs_per_s_by_isa", floats},
          {"blend_operations_per_s", rates(blend_operations(), threads, seconds)},
          {"memory_bytes_per_s", memory_rates(threads, seconds)}};
}

int run(int argc, char** argv) {
  CLI::App app{"roofline: measures what this machine can do at most"};
  std::string output = "-";
  double seconds = 0.5;
  app.add_option("-o", output, "JSON file; - prints it")->capture_default_str();
  app.add_option("--seconds", seconds, "for each measurement")
      ->check(CLI::Range(0.001, 60.0))
      ->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  Json json = {{"command", "roofline"},
               {"date", ports::date_utc()},
               {"machine", {{"cpu", samples::cpu_name()}, {"cpus", ports::usable_cpus()}}},
               {"seconds", seconds}};
  for (const uint32_t threads : std::set<uint32_t>{1, ports::usable_cpus()}) {
    std::fprintf(stderr, "roofline: %u threads\n", threads);
    json["rows"].push_back(measure(threads, seconds));
  }
  const std::string text = json.dump(2) + "\n";
  if (output == "-") {
    std::fputs(text.c_str(), stdout);
    return 0;
  }
  const Status written = ports::write_file_atomically(output, std::as_bytes(std::span(text)));
  if (written.ok()) return 0;
  std::fprintf(stderr, "roofline: %s\n", written.message().c_str());
  return 1;
}

}  // namespace
}  // namespace figurine::roofline

int main(int argc, char** argv) { return figurine::roofline::run(argc, argv); }
