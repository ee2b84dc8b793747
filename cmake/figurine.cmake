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

# What takes time in a test is in the libraries: under sanitizers, and where it uses LibTorch, a
# test's own code is compiled as written. For the owners of the tests' precompiled headers too: GCC
# takes one only where both are optimised alike.
if(FIGURINE_SANITIZE)
  set(FIGURINE_TEST_OPTIONS -O0)
else()
  set(FIGURINE_TEST_OPTIONS $<$<NOT:$<CONFIG:Debug>>:-O1>)
endif()
set(FIGURINE_TENSOR_TEST_OPTIONS -O0)

# figurine_test_program(NAME LIBRARIES...): a GoogleTest program for several figurine_test(... IN
# NAME), whose files are compiled together and linked once. TENSORS: its files compute with
# LibTorch's tensors, and are compiled with a precompiled header of both.
function(figurine_test_program name)
  cmake_parse_arguments(arg "TENSORS" "" "LIBRARIES;DEFINITIONS" ${ARGN})
  add_executable(${name})
  target_link_libraries(${name} PRIVATE ${arg_LIBRARIES} GTest::gtest GTest::gtest_main)
  target_include_directories(${name} PRIVATE "${PROJECT_SOURCE_DIR}" "${PROJECT_SOURCE_DIR}/tests")
  target_compile_definitions(${name} PRIVATE FIGURINE_SOURCE_DIR="${PROJECT_SOURCE_DIR}"
    ${arg_DEFINITIONS} $<$<BOOL:${CMAKE_CROSSCOMPILING}>:FIGURINE_EMULATED>)
  target_compile_options(${name} PRIVATE -fPIC)  # as the owners of precompiled headers, not -fPIE
  set_target_properties(${name} PROPERTIES UNITY_BUILD_BATCH_SIZE 16)
  if(arg_TENSORS)
    target_compile_options(${name} PRIVATE ${FIGURINE_TENSOR_TEST_OPTIONS})
    target_precompile_headers(${name} REUSE_FROM figurine_tensor_test_header)
  else()
    target_compile_options(${name} PRIVATE ${FIGURINE_TEST_OPTIONS})
    target_precompile_headers(${name} REUSE_FROM figurine_test_header)
  endif()
endfunction()

# figurine_test_suites(VARIABLE SOURCE...): what --gtest_filter takes for the tests of these files.
# CMake runs again when one of them changes.
function(figurine_test_suites variable)
  set(patterns)
  foreach(source ${ARGN})
    set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS "${source}")
    file(READ "${source}" text)
    string(REGEX MATCHALL "\n *TEST(_F)?\\([A-Za-z0-9_]+" tests "${text}")
    list(TRANSFORM tests REPLACE "^.*\\((.*)$" "\\1.*")
    string(REGEX MATCHALL
      "\nINSTANTIATE_TEST_SUITE_P\\([ \n]*[A-Za-z0-9_]+,[ \n]*[A-Za-z0-9_]+" instances "${text}")
    list(TRANSFORM instances
      REPLACE "^.*\\([ \n]*([A-Za-z0-9_]+),[ \n]*([A-Za-z0-9_]+)$" "\\1/\\2.*")
    list(APPEND patterns ${tests} ${instances})
    # What is not found by the above would never run.
    if(text MATCHES "TYPED_TEST|\n +(TEST_P|INSTANTIATE_)")
      message(FATAL_ERROR
        "${source}: write '${CMAKE_MATCH_0}' otherwise, or in a program of its own")
    endif()
    string(REGEX MATCHALL "\nTEST_P\\([A-Za-z0-9_]+" parametric "${text}")
    foreach(suite ${parametric})
      string(REGEX REPLACE "^.*\\(" "/" suite "${suite}")
      if(NOT "${instances}" MATCHES "${suite}\\.")
        message(FATAL_ERROR "${source}: nothing instantiates ${suite}")
      endif()
    endforeach()
  endforeach()
  list(REMOVE_DUPLICATES patterns)
  if(NOT patterns)
    message(FATAL_ERROR "no test in ${ARGN}")
  endif()
  set(${variable} ${patterns} PARENT_SCOPE)
endfunction()

# figurine_test(NAME SOURCES... LIBRARIES...): a ctest entry and its GoogleTest program. Running no
# test is a failure. IN names a figurine_test_program: the sources become part of it, the entry runs
# their suites alone, which no other entry may have, and the target NAME builds the program. A file
# of a program with several has its own namespace, because their helpers are called alike.
# NOT_EMULATED names the tests (SUITE.NAME) that a cross build leaves out, with the reason beside
# them.
function(figurine_test name)
  cmake_parse_arguments(arg "TENSORS" "IN" "SOURCES;LIBRARIES;DEFINITIONS;LABELS;NOT_EMULATED"
    ${ARGN})
  list(TRANSFORM arg_SOURCES PREPEND "${CMAKE_CURRENT_SOURCE_DIR}/")
  set(filter)
  if(arg_IN)
    set(program ${arg_IN})
    figurine_test_suites(suites ${arg_SOURCES})
    get_target_property(taken ${program} FIGURINE_TEST_SUITES)
    foreach(suite ${suites})
      if(suite IN_LIST taken)
        message(FATAL_ERROR "${name}: another test of ${program} has the suite ${suite} too")
      endif()
    endforeach()
    set_property(TARGET ${program} APPEND PROPERTY FIGURINE_TEST_SUITES ${suites})
    target_link_libraries(${program} PRIVATE ${arg_LIBRARIES})
    target_compile_definitions(${program} PRIVATE ${arg_DEFINITIONS})
    add_custom_target(${name})
    add_dependencies(${name} ${program})
    list(JOIN suites ":" filter)
  else()
    set(program ${name})
    set(tensors)
    if(arg_TENSORS)
      set(tensors TENSORS)
    endif()
    figurine_test_program(${program} ${tensors} LIBRARIES ${arg_LIBRARIES}
      DEFINITIONS ${arg_DEFINITIONS})
    set_target_properties(${program} PROPERTIES UNITY_BUILD OFF)  # their helpers are called alike
  endif()
  target_sources(${program} PRIVATE ${arg_SOURCES})
  if(CMAKE_CROSSCOMPILING AND arg_NOT_EMULATED)
    list(JOIN arg_NOT_EMULATED ":" names)
    string(APPEND filter "-${names}")
  endif()
  if(filter)
    set(filter "--gtest_filter=${filter}")
  endif()
  add_test(NAME ${name} COMMAND ${program} ${filter})
  set_tests_properties(${name} PROPERTIES FAIL_REGULAR_EXPRESSION "Running 0 tests"
    LABELS "${arg_LABELS}" ENVIRONMENT "${FIGURINE_TEST_ENVIRONMENT}")
endfunction()
