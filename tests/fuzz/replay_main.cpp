// Runs a libFuzzer entry over the files named on the command line, folders included, so that every
// compiler replays the corpus as a test. With
// --rounds N each file is also bent N times, deterministically. Prints how many inputs ran; none is
// a failure.
#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string_view>
#include <vector>

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size);

namespace {

size_t run(const std::filesystem::path& path, int rounds) {
  std::ifstream file(path, std::ios::binary);
  const std::vector<char> chars{std::istreambuf_iterator<char>(file), {}};
  const std::vector<uint8_t> input(chars.begin(), chars.end());
  LLVMFuzzerTestOneInput(input.data(), input.size());
  uint32_t state = 1;  // a linear congruential generator will do: Numerical Recipes' constants
  const auto next = [&] { return (state = state * 1664525u + 1013904223u) >> 8; };
  for (int round = 0; round < rounds && !input.empty(); ++round) {
    std::vector<uint8_t> bent = input;
    for (uint32_t changes = 1 + next() % 4; changes > 0; --changes)
      bent[next() % bent.size()] = static_cast<uint8_t>(next());
    if (next() % 4 == 0) bent.resize(next() % (bent.size() + 64));
    LLVMFuzzerTestOneInput(bent.data(), bent.size());
  }
  return 1 + size_t(rounds);
}

}  // namespace

int main(int argc, char** argv) {
  std::vector<std::filesystem::path> files;
  int rounds = 0;
  for (int i = 1; i < argc; ++i) {
    if (std::string_view(argv[i]) == "--rounds" && i + 1 < argc) {
      rounds = std::atoi(argv[++i]);
    } else if (std::filesystem::is_directory(argv[i])) {
      for (const auto& entry : std::filesystem::recursive_directory_iterator(argv[i])) {
        if (entry.is_regular_file()) files.push_back(entry.path());
      }
    } else {
      files.emplace_back(argv[i]);
    }
  }
  std::sort(files.begin(), files.end());
  size_t inputs = 0;
  for (const auto& file : files) inputs += run(file, rounds);
  std::printf("%zu files, %zu inputs\n", files.size(), inputs);
  return inputs == 0 ? 1 : 0;
}
