# The package: reader (what a device links), writer (offline and tests).

find_program(FIGURINE_FLATC flatc REQUIRED)
set(schema_header "${CMAKE_CURRENT_BINARY_DIR}/schema/package_generated.h")
add_custom_command(
  OUTPUT "${schema_header}"
  COMMAND "${FIGURINE_FLATC}" --cpp --cpp-std c++17 --scoped-enums -o "${CMAKE_CURRENT_BINARY_DIR}/schema" "${CMAKE_CURRENT_SOURCE_DIR}/schema/package.fbs"
  DEPENDS schema/package.fbs
  COMMENT "flatc package.fbs"
  VERBATIM)
add_custom_target(figurine_schema DEPENDS "${schema_header}")

add_library(figurine_formats STATIC
  src/checksum.cpp src/package.cpp src/package_avatar.cpp src/package_body.cpp src/package_container.cpp src/package_content.cpp src/package_population.cpp
  src/package_sampler.cpp src/package_text.cpp src/refusal.cpp)
add_dependencies(figurine_formats figurine_schema)
target_link_libraries(figurine_formats PUBLIC figurine_words)
target_include_directories(figurine_formats PRIVATE "${PROJECT_SOURCE_DIR}")
# Both libraries are used by their headers alone: nothing to link, nothing to ship.
target_include_directories(figurine_formats SYSTEM PRIVATE "${CMAKE_CURRENT_BINARY_DIR}/schema" ${XXHASH_INCLUDE_DIRS})
target_compile_options(figurine_formats PRIVATE -fno-exceptions)
if(NOT CMAKE_BUILD_TYPE STREQUAL "Debug")
  # A package is opened once: of its reader, size is what a device pays for. Checksums read every byte of it and stay fast.
  get_target_property(reader figurine_formats SOURCES)
  list(FILTER reader INCLUDE REGEX "package")
  set_source_files_properties(${reader} PROPERTIES COMPILE_OPTIONS -Os)
endif()

add_library(figurine_writer STATIC writer/package_assemble.cpp writer/package_parts.cpp writer/package_writer.cpp writer/population_writer.cpp writer/rans_encoder.cpp
  writer/sampler_writer.cpp)
add_dependencies(figurine_writer figurine_schema)
target_link_libraries(figurine_writer PUBLIC figurine_formats)
target_include_directories(figurine_writer PUBLIC "${PROJECT_SOURCE_DIR}")
target_include_directories(figurine_writer SYSTEM PRIVATE "${CMAKE_CURRENT_BINARY_DIR}/schema")
target_compile_options(figurine_writer PRIVATE -fno-exceptions)
figurine_guard(figurine_formats figurine_writer)
