# What an application builds against, in two components:
#   runtime      libfigurine.so.0, for programs in C, and its threads, libfigurine_pthreadpool.so.0
#   development  headers, the static libraries for C++, CMake package, pkg-config files
# The prefix may be moved afterwards: every path in it is relative.
include(CMakePackageConfigHelpers)

set(package "${CMAKE_INSTALL_LIBDIR}/cmake/figurine")
set_target_properties(figurine_words PROPERTIES EXPORT_NAME words)
set_target_properties(figurine_formats PROPERTIES EXPORT_NAME formats)
set_target_properties(figurine_runtime PROPERTIES EXPORT_NAME runtime)
set_target_properties(figurine_c PROPERTIES EXPORT_NAME c)
set_target_properties(figurine_pthreadpool_shared PROPERTIES EXPORT_NAME pthreadpool)

install(TARGETS figurine_c EXPORT figurine_c
  LIBRARY DESTINATION "${CMAKE_INSTALL_LIBDIR}" COMPONENT runtime NAMELINK_COMPONENT development)
install(TARGETS figurine_pthreadpool_shared EXPORT figurine_pthreadpool
  LIBRARY DESTINATION "${CMAKE_INSTALL_LIBDIR}" COMPONENT runtime NAMELINK_COMPONENT development)
install(TARGETS figurine_runtime figurine_formats figurine_words EXPORT figurine_runtime
  ARCHIVE DESTINATION "${CMAKE_INSTALL_LIBDIR}" COMPONENT development)
install(DIRECTORY "${PROJECT_SOURCE_DIR}/runtime/include/" "${PROJECT_SOURCE_DIR}/formats/include/"
  DESTINATION "${CMAKE_INSTALL_INCLUDEDIR}" COMPONENT development FILES_MATCHING PATTERN "*.h")

foreach(part pthreadpool c runtime)
  install(EXPORT figurine_${part} NAMESPACE figurine:: FILE figurine-${part}.cmake
    DESTINATION "${package}" COMPONENT development)
endforeach()
write_basic_package_version_file("${CMAKE_CURRENT_BINARY_DIR}/figurine-config-version.cmake"
  COMPATIBILITY SameMinorVersion)
install(FILES "${PROJECT_SOURCE_DIR}/cmake/figurine-config.cmake"
    "${PROJECT_SOURCE_DIR}/cmake/FindXNNPACK.cmake"
    "${CMAKE_CURRENT_BINARY_DIR}/figurine-config-version.cmake"
  DESTINATION "${package}" COMPONENT development)

install(FILES "${PROJECT_SOURCE_DIR}/LICENSE" DESTINATION "${CMAKE_INSTALL_DOCDIR}"
  COMPONENT runtime)

# From the files' own place to the prefix, however deep the library folder is.
file(RELATIVE_PATH prefix_from_pc "/${CMAKE_INSTALL_LIBDIR}/pkgconfig" "/")
foreach(name figurine figurine-pthreadpool figurine-runtime)
  configure_file("${PROJECT_SOURCE_DIR}/cmake/${name}.pc.in"
    "${CMAKE_CURRENT_BINARY_DIR}/${name}.pc" @ONLY)
  install(FILES "${CMAKE_CURRENT_BINARY_DIR}/${name}.pc"
    DESTINATION "${CMAKE_INSTALL_LIBDIR}/pkgconfig" COMPONENT development)
endforeach()
