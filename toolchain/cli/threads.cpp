#include "toolchain/cli/threads.h"

#include <algorithm>
#include <charconv>
#include <string_view>

#include "ports/host/cpus.h"
#include "ports/host/process.h"

namespace figurine::cli {
namespace {

constexpr const char* kForce = "--force-threads";
constexpr uint32_t kMost = 256;  // beyond it the option's range says what is wrong
bool g_forced = false;           // read before options are, whose order is the user's

std::string lower(std::string& text) {
  uint32_t threads = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), threads);
  const uint32_t cpus = ports::usable_cpus();
  const bool number = error == std::errc() && end == text.data() + text.size();
  if (g_forced || !number || threads <= cpus || threads > kMost) return {};
  ports::say("--threads " + std::to_string(threads) + ": lowered to the " + std::to_string(cpus) +
             " usable (" + kForce + ")");
  text = std::to_string(cpus);
  return {};
}

}  // namespace

void add_force_threads(CLI::App& app, int argc, const char* const* argv) {
  g_forced = std::any_of(argv, argv + argc,
                         [](const char* word) { return std::string_view(word) == kForce; });
  app.fallthrough();  // so that commands know it as well
  app.add_flag(kForce, "More threads than usable CPUs all the same");
}

CLI::Validator usable_threads() { return {lower, "", "usable threads"}; }

}  // namespace figurine::cli
