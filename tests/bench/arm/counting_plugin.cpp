// A plugin of QEMU's (qemu-system-aarch64, one CPU): counts the instructions that programs execute,
// by kind, and hands the program the counts when it asks (counters.h).
//
//   qemu-system-aarch64 -object memory-backend-file,id=ram,share=on,mem-path=FILE,size=SIZE
//     -machine virt,memory-backend=ram -plugin PLUGIN,ram=FILE
//
// Counts are exact and of the program alone, not of the kernel under it, whatever else the machine
// does. They are added up by whole translated blocks; a read counts its own function's rest as
// well. A plugin of this version cannot write to the guest's registers or memory, so the guest's
// memory is a file that is mapped here too.
//
// Based on: QEMU TCG Plugins, API version 4; Debian ships no header of it, so what is used is
// declared here.
#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>

#include "bench/arm/counters.h"
#include "bench/arm/instruction_kind.h"

#define FIG_EXPORT __attribute__((visibility("default")))

extern "C" {

struct qemu_plugin_tb;
struct qemu_plugin_insn;
struct qemu_plugin_scoreboard;
struct qemu_plugin_hwaddr;
struct qemu_plugin_u64 {
  qemu_plugin_scoreboard* score;
  size_t offset;
};
enum qemu_plugin_op { QEMU_PLUGIN_INLINE_ADD_U64 };
enum qemu_plugin_cb_flags { QEMU_PLUGIN_CB_NO_REGS };
enum qemu_plugin_mem_rw { QEMU_PLUGIN_MEM_R = 1, QEMU_PLUGIN_MEM_W };

void qemu_plugin_register_vcpu_tb_trans_cb(uint64_t id, void (*)(uint64_t id, qemu_plugin_tb*));
void qemu_plugin_register_vcpu_tb_exec_inline_per_vcpu(qemu_plugin_tb*, qemu_plugin_op,
                                                       qemu_plugin_u64, uint64_t add);
void qemu_plugin_register_vcpu_mem_cb(qemu_plugin_insn*,
                                      void (*)(unsigned vcpu, uint32_t info, uint64_t address,
                                               void* user),
                                      qemu_plugin_cb_flags, qemu_plugin_mem_rw, void* user);
size_t qemu_plugin_tb_n_insns(const qemu_plugin_tb*);
uint64_t qemu_plugin_tb_vaddr(const qemu_plugin_tb*);
qemu_plugin_insn* qemu_plugin_tb_get_insn(const qemu_plugin_tb*, size_t index);
size_t qemu_plugin_insn_data(const qemu_plugin_insn*, void* to, size_t size_bytes);
qemu_plugin_hwaddr* qemu_plugin_get_hwaddr(uint32_t info, uint64_t address);
bool qemu_plugin_hwaddr_is_io(const qemu_plugin_hwaddr*);
uint64_t qemu_plugin_hwaddr_phys_addr(const qemu_plugin_hwaddr*);
qemu_plugin_scoreboard* qemu_plugin_scoreboard_new(size_t size_bytes);
void* qemu_plugin_scoreboard_find(qemu_plugin_scoreboard*, unsigned vcpu);

FIG_EXPORT int qemu_plugin_version = 4;

}  // extern "C"

namespace figurine::bench {
namespace {

constexpr uint64_t kRamStart = 0x40000000;  // of the machine "virt"
constexpr uint32_t kHint = 0xD503201Fu | (kReadHint << 5);

qemu_plugin_scoreboard* counts = nullptr;  // [kCounters] of each CPU
const char* ram_path = nullptr;
std::byte* ram = nullptr;
uint64_t ram_bytes = 0;

[[noreturn]] void stop(const char* what) {
  std::fprintf(stderr, "counting_plugin: %s\n", what);
  std::_Exit(1);
}

// Only when the first count is asked for: QEMU makes the file after it has loaded its plugins.
void map_ram() {
  const int file = open(ram_path, O_RDWR);
  struct stat status{};
  if (file < 0 || fstat(file, &status) != 0) stop("cannot open the guest's memory");
  ram_bytes = static_cast<uint64_t>(status.st_size);
  void* const mapped = mmap(nullptr, ram_bytes, PROT_READ | PROT_WRITE, MAP_SHARED, file, 0);
  close(file);
  if (mapped == MAP_FAILED) stop("cannot map the guest's memory");
  ram = static_cast<std::byte*>(mapped);
}

// After the program's store to the words.
void fill(unsigned vcpu, uint32_t info, uint64_t address, void*) {
  const qemu_plugin_hwaddr* const place = qemu_plugin_get_hwaddr(info, address);
  if (place == nullptr || qemu_plugin_hwaddr_is_io(place)) stop("the words are not in memory");
  if (ram == nullptr) map_ram();
  constexpr size_t kSize = kCounters * sizeof(uint64_t);
  const uint64_t offset = qemu_plugin_hwaddr_phys_addr(place) - kRamStart;
  if (offset > ram_bytes - kSize) stop("the words are not in the guest's memory");
  std::memcpy(ram + offset, qemu_plugin_scoreboard_find(counts, vcpu), kSize);
}

void translate(uint64_t, qemu_plugin_tb* block) {
  if (qemu_plugin_tb_vaddr(block) >> 63 != 0) return;  // the kernel
  uint64_t executed[kCounters] = {};
  const size_t size = qemu_plugin_tb_n_insns(block);
  bool after_hint = false;
  for (size_t i = 0; i < size; ++i) {
    qemu_plugin_insn* const instruction = qemu_plugin_tb_get_insn(block, i);
    uint32_t word = 0;
    if (qemu_plugin_insn_data(instruction, &word, sizeof(word)) != sizeof(word))
      stop("half an instruction");
    ++executed[static_cast<size_t>(Counter::kInstructions)];
    ++executed[static_cast<size_t>(kind_of(word))];
    if (after_hint) {
      qemu_plugin_register_vcpu_mem_cb(instruction, fill, QEMU_PLUGIN_CB_NO_REGS, QEMU_PLUGIN_MEM_W,
                                       nullptr);
    }
    after_hint = word == kHint;
  }
  if (after_hint) stop("a block ends between the hint and its store");
  for (size_t i = 0; i < kCounters; ++i) {
    if (executed[i] == 0) continue;
    qemu_plugin_register_vcpu_tb_exec_inline_per_vcpu(block, QEMU_PLUGIN_INLINE_ADD_U64,
                                                      {counts, i * sizeof(uint64_t)}, executed[i]);
  }
}

}  // namespace
}  // namespace figurine::bench

extern "C" FIG_EXPORT int qemu_plugin_install(uint64_t id, const void*, int argc, char** argv) {
  namespace bench = figurine::bench;
  if (argc != 1 || std::strncmp(argv[0], "ram=", 4) != 0) {
    std::fprintf(stderr, "counting_plugin: wants ram=FILE\n");
    return 1;
  }
  bench::ram_path = argv[0] + 4;  // QEMU keeps it
  bench::counts = qemu_plugin_scoreboard_new(bench::kCounters * sizeof(uint64_t));
  qemu_plugin_register_vcpu_tb_trans_cb(id, bench::translate);
  return 0;
}
