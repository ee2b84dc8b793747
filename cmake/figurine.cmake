# Build settings that every target shares, and the few functions that the folders' lists use.

include(GNUInstallDirs)

if(NOT CMAKE_BUILD_TYPE AND PROJECT_IS_TOP_LEVEL)
  set(CMAKE_BUILD_TYPE RelWithDebInfo CACHE STRING "" FORCE)
endif()
set(CMAKE_C_STANDARD 11)
set(CMAKE_C_STANDARD_REQUIRED ON)
set(CMAKE_C_EXTENSIONS OFF)
set(CMAKE_CXX_STANDARD 20)
set(CMAKE_CXX_STANDARD_REQUIRED ON)
set(CMAKE_CXX_EXTENSIONS OFF)
set(CMAKE_POSITION_INDEPENDENT_CODE ON)
set(CMAKE_CXX_VISIBILITY_PRESET hidden)
set(CMAKE_VISIBILITY_INLINES_HIDDEN ON)
# RelWithDebInfo keeps FIG_DCHECK: it tests FIGURINE_DCHECKS, not NDEBUG.
set(CMAKE_CXX_FLAGS_RELWITHDEBINFO "-O2 -g1 -DFIGURINE_DCHECKS=1")
set(CMAKE_CXX_FLAGS_RELEASE "-O2 -DNDEBUG")

find_program(FIGURINE_CCACHE ccache)
if(FIGURINE_CCACHE AND NOT CMAKE_CXX_COMPILER_LAUNCHER)
  set(CMAKE_C_COMPILER_LAUNCHER "${FIGURINE_CCACHE}")
  set(CMAKE_CXX_COMPILER_LAUNCHER "${FIGURINE_CCACHE}")
endif()

# One arithmetic on every CPU: no fused multiply-add behind the code's back (docs/numerics.md, "Same
# pixels").
add_compile_options(-ffp-contract=off -Wall -Wextra -Wshadow -Wno-missing-field-initializers)
if(FIGURINE_SANITIZE)
  # -O1: half the build time, better stacks, and the checks are the same. vptr looks at run-time
  # types, which the device's objects (a shared_ptr's count among them) are made without.
  add_compile_options(-O1 -fsanitize=${FIGURINE_SANITIZE} -fno-sanitize-recover=all
    -fno-sanitize=vptr -fno-omit-frame-pointer)
  add_link_options(-fsanitize=${FIGURINE_SANITIZE})
endif()

# Several files of a target compiled as one: headers are read, and templates made, once for all of
# them. Five files with LibTorch took 23 CPU seconds apart and 7.4 as one. But one changed file
# compiles its neighbours as well. What a device links stays apart (figurine_guard), and so do files
# with options of their own.
option(FIGURINE_UNITY "Compile several files as one where they allow it" OFF)
set(CMAKE_UNITY_BUILD ${FIGURINE_UNITY})
set(CMAKE_UNITY_BUILD_BATCH_SIZE 8)

# figurine_alone(SOURCE...): files whose names in anonymous namespaces are another file's too.
function(figurine_alone)
  set_source_files_properties(${ARGN} PROPERTIES SKIP_UNITY_BUILD_INCLUSION ON)
endfunction()

# figurine_guard(TARGET...): what runs on devices says every conversion that may lose a value, and
# has no warning. Errors only where we build it ourselves: another compiler's new warning is not a
# user's problem.
function(figurine_guard)
  foreach(target ${ARGN})
    target_compile_options(${target} PRIVATE -Wconversion)
    set_target_properties(${target} PROPERTIES COMPILE_WARNING_AS_ERROR ${FIGURINE_WERROR}
      UNITY_BUILD OFF)
  endforeach()
endfunction()

# figurine_program(VARIABLE TARGET): what a test calls to run the built program: its path or, in a
# cross build, that of a script with the emulator in front.
function(figurine_program variable target)
  if(NOT CMAKE_CROSSCOMPILING)
    set(${variable} "$<TARGET_FILE:${target}>" PARENT_SCOPE)
    return()
  endif()
  set(script "${CMAKE_CURRENT_BINARY_DIR}/emulated-${target}")
  list(JOIN CMAKE_CROSSCOMPILING_EMULATOR " " emulator)
  file(GENERATE OUTPUT "${script}"
    CONTENT "#!/bin/sh\nexec ${emulator} '$<TARGET_FILE:${target}>' \"$@\"\n"
    FILE_PERMISSIONS OWNER_READ OWNER_WRITE OWNER_EXECUTE)
  set(${variable} "${script}" PARENT_SCOPE)
endfunction()

# Tests run side by side, one a core: OpenMP's and OpenBLAS' threads are one unless a test asks for
# more, and those that wait sleep. Two that spin for a core that another test has take three times
# the CPU time.
set(FIGURINE_TEST_ENVIRONMENT "OMP_NUM_THREADS=1" "OMP_WAIT_POLICY=passive")

# figurine_test(NAME SOURCES... LIBRARIES...): a GoogleTest program, one ctest entry. Running no
# test is a failure. NOT_EMULATED names the tests (SUITE.NAME) that a cross build leaves out, with
# the reason beside them. TENSORS: its files compute with LibTorch's tensors, and are compiled with
# figurine_model's precompiled header in place of GoogleTest's.
function(figurine_test name)
  cmake_parse_arguments(arg "TENSORS" "" "SOURCES;LIBRARIES;DEFINITIONS;LABELS;NOT_EMULATED"
    ${ARGN})
  add_executable(${name} ${arg_SOURCES})
  set_target_properties(${name} PROPERTIES UNITY_BUILD OFF)  # their helpers are called alike
  target_link_libraries(${name} PRIVATE ${arg_LIBRARIES} GTest::gtest GTest::gtest_main)
  target_include_directories(${name} PRIVATE "${PROJECT_SOURCE_DIR}" "${PROJECT_SOURCE_DIR}/tests")
  target_compile_definitions(${name} PRIVATE FIGURINE_SOURCE_DIR="${PROJECT_SOURCE_DIR}"
    ${arg_DEFINITIONS})
  target_compile_options(${name} PRIVATE -fPIC)  # as the owners of precompiled headers, not -fPIE
  if(arg_TENSORS)
    target_precompile_headers(${name} REUSE_FROM figurine_model)
  else()
    target_precompile_headers(${name} REUSE_FROM figurine_test_header)
  endif()
  set(filter)
  if(CMAKE_CROSSCOMPILING AND arg_NOT_EMULATED)
    list(JOIN arg_NOT_EMULATED ":" names)
    set(filter "--gtest_filter=-${names}")
  endif()
  add_test(NAME ${name} COMMAND ${name} ${filter})
  set_tests_properties(${name} PROPERTIES FAIL_REGULAR_EXPRESSION "Running 0 tests"
    LABELS "${arg_LABELS}" ENVIRONMENT "${FIGURINE_TEST_ENVIRONMENT}")
endfunction()
