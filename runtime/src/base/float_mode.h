// How a thread's floats round, trap and treat denormals: what a frame and a sampler run in,
// whatever their caller has, and what he gets back. Denormals cost some CPUs a hundred cycles an
// operation; a frame takes them for zero, inputs and results (docs/numerics.md, "Same pixels").
//
// On other architectures nothing is set.
#pragma once

#include <cstdint>

#if defined(__x86_64__)
#include <xmmintrin.h>
#endif

namespace figurine {

class FloatMode {
 public:
  static FloatMode of_this_thread() { return FloatMode(get()); }
  // To nearest, no traps, denormals kept: IEEE 754's default.
  static FloatMode exact() { return FloatMode(kDefault); }
  // The same with denormals as zeros, inputs and results: of all that is drawn.
  static FloatMode frame() { return exact().without_denormals(); }

  FloatMode without_denormals() const { return FloatMode(bits_ | kFlushToZero); }
  bool operator==(const FloatMode&) const = default;

  // Of this thread, from here on. A barrier for the compiler, which would otherwise move arithmetic
  // that loads or stores past it.
  void set() const {
    asm volatile("" ::: "memory");
    set(bits_);
    asm volatile("" ::: "memory");
  }

 private:
#if defined(__x86_64__)
  using Register = unsigned int;
  static constexpr Register kDefault = 0x1F80;      // MXCSR: all exceptions masked
  static constexpr Register kFlushToZero = 0x8040;  // FTZ of results and DAZ of inputs
  static Register get() { return _mm_getcsr(); }
  static void set(Register value) { _mm_setcsr(value); }
#elif defined(__aarch64__)
  using Register = uint64_t;
  static constexpr Register kDefault = 0;              // FPCR
  static constexpr Register kFlushToZero = 0x1080000;  // FZ and FZ16: inputs and results
  static Register get() {
    Register value;
    asm volatile("mrs %0, fpcr" : "=r"(value));
    return value;
  }
  static void set(Register value) { asm volatile("msr fpcr, %0" : : "r"(value)); }
#else
  using Register = unsigned int;
  static constexpr Register kDefault = 0, kFlushToZero = 0;
  static Register get() { return 0; }
  static void set(Register) {}
#endif

  explicit FloatMode(Register bits) : bits_(bits) {}

  Register bits_;
};

// This thread's mode for as long as it lives; then the one before, status flags included.
class FloatModeScope {
 public:
  explicit FloatModeScope(FloatMode mode) : before_(FloatMode::of_this_thread()) { mode.set(); }
  ~FloatModeScope() { before_.set(); }
  FloatModeScope(const FloatModeScope&) = delete;
  FloatModeScope& operator=(const FloatModeScope&) = delete;

 private:
  const FloatMode before_;
};

}  // namespace figurine
