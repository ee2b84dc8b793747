// Processes that train together, and the few things they say to each other: c10d's Gloo over TCP,
// met at a TCPStore of rank 0.
//
// Who is who comes from the environment:
//
//   RANK, WORLD_SIZE, MASTER_ADDR, MASTER_PORT              by hand, or by a launcher; they come
//       first
//   SLURM_PROCID, SLURM_STEP_NUM_TASKS, SLURM_STEP_NODELIST inside srun; where rank 0 is:
//       MASTER_ADDR, or the step's first node
//
// Without them a process is alone: rank 0 of 1, for which everything here returns at once and
// changes no bit. SLURM_NTASKS is not looked at, because a batch script outside srun has it, too,
// and would wait for ranks that nobody starts.
//
// Messages run between the addresses by which the machines reach MASTER_ADDR, or over the interface
// GLOO_SOCKET_IFNAME.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include "toolchain/error.h"
#include "toolchain/tensor.h"

namespace figurine::generate {

struct RankPlace {
  int rank = 0, size = 1;
  std::string host;  // rank 0's, where the others meet it
  uint16_t port = 0;
};

// get: as getenv. Throws InputError naming the variable.
RankPlace rank_place_from(const std::function<const char*(const char*)>& get);
RankPlace rank_place_from_environment();

// The first host of a list as Slurm writes it: "gpu-[003-007,9],x" to "gpu-003".
std::string first_host(const std::string& list);

// Another rank has ended, is silent, or never came; the group can do nothing more.
class PeerLost : public InputError {
 public:
  using InputError::InputError;
};

class ProcessGroup {
 public:
  // Waits for all ranks; the process ignores SIGPIPE from then on. Whatever waits for another rank,
  // here or later, does so for timeout_s at most and then throws PeerLost; where a rank's process
  // ends, its connections do, and the others hear of it at once.
  ProcessGroup(const RankPlace& place, double timeout_s);
  ~ProcessGroup();
  ProcessGroup(const ProcessGroup&) = delete;
  ProcessGroup& operator=(const ProcessGroup&) = delete;

  int rank() const { return place_.rank; }
  int size() const { return place_.size; }
  bool leads() const { return place_.rank == 0; }  // it alone writes files and speaks
  std::string name() const;                        // "rank 1 of 4"

  // Every rank calls these in the same order with tensors of the same shape, contiguous.
  void sum(torch::Tensor& values);        // over all ranks, in place: the same bits on every rank
  void broadcast(torch::Tensor& values);  // rank 0's
  std::string broadcast(const std::string& text);  // rank 0's
  void barrier();                                  // returns when all are here
  void expect_same(
      const torch::Tensor& values,
      const std::string& what);  // float; throws InputError where the bits are not rank 0's

 private:
  struct Impl;
  template <class F>
  void talk(const char* doing, F&& function);

  RankPlace place_;
  std::unique_ptr<Impl> impl_;  // none: alone
};

// A hash of the bits of a contiguous float tensor.
uint64_t hash_bits(const torch::Tensor& values);

}  // namespace figurine::generate
