# Cross build for 64-bit ARM Linux with Debian's cross compiler, which brings its C and C++
# libraries, and an overlay of the other libraries that `scripts/setup arm` unpacks
# (docs/decisions/0013-sysroot-overlay.md). scripts/run says where the overlay is. Test programs run
# under QEMU; QEMU_CPU in the environment chooses the core, e.g. cortex-a53.

set(CMAKE_SYSTEM_NAME Linux)
set(CMAKE_SYSTEM_PROCESSOR aarch64)
set(CMAKE_C_COMPILER aarch64-linux-gnu-gcc)
set(CMAKE_CXX_COMPILER aarch64-linux-gnu-g++)

set(FIGURINE_SYSROOT "$ENV{FIGURINE_SYSROOT}" CACHE PATH
  "Libraries and headers for arm64 beside those of the cross compiler")
set(CMAKE_TRY_COMPILE_PLATFORM_VARIABLES FIGURINE_SYSROOT)
if(NOT EXISTS "${FIGURINE_SYSROOT}/usr/include/xnnpack.h")
  message(FATAL_ERROR "No arm64 libraries in '${FIGURINE_SYSROOT}': call scripts/setup arm, "
    "then this through scripts/run")
endif()

# Programs (flatc, python3) are the host's; headers, libraries and packages the overlay's alone.
set(CMAKE_FIND_ROOT_PATH "${FIGURINE_SYSROOT}")
set(CMAKE_FIND_ROOT_PATH_MODE_PROGRAM NEVER)
set(CMAKE_FIND_ROOT_PATH_MODE_LIBRARY ONLY)
set(CMAKE_FIND_ROOT_PATH_MODE_INCLUDE ONLY)
set(CMAKE_FIND_ROOT_PATH_MODE_PACKAGE ONLY)
set(CMAKE_LIBRARY_ARCHITECTURE aarch64-linux-gnu)
set(ENV{PKG_CONFIG_LIBDIR}
  "${FIGURINE_SYSROOT}/usr/lib/aarch64-linux-gnu/pkgconfig:${FIGURINE_SYSROOT}/usr/share/pkgconfig")
set(ENV{PKG_CONFIG_SYSROOT_DIR} "${FIGURINE_SYSROOT}")

set(CMAKE_CXX_STANDARD_INCLUDE_DIRECTORIES "${FIGURINE_SYSROOT}/usr/include"
  "${FIGURINE_SYSROOT}/usr/include/aarch64-linux-gnu")

# XNNPACK's own libraries are found by the program's path, at link time and, with the older kind of
# tag, at run time.
set(CMAKE_EXE_LINKER_FLAGS_INIT
  "-Wl,--disable-new-dtags -Wl,-rpath-link,${FIGURINE_SYSROOT}/usr/lib/aarch64-linux-gnu")
set(CMAKE_SHARED_LINKER_FLAGS_INIT "${CMAKE_EXE_LINKER_FLAGS_INIT}")

find_program(FIGURINE_QEMU qemu-aarch64 REQUIRED)
set(CMAKE_CROSSCOMPILING_EMULATOR "${FIGURINE_QEMU}" -L /usr/aarch64-linux-gnu)
