# find_package(figurine): figurine::c for programs in C, figurine::runtime for C++20. Components c
# and runtime ask for one of them; without any, both are there. figurine::pthreadpool is always
# there: the threads of figurine::c, and for programs with figurine::runtime that want them too.
if(NOT figurine_FIND_COMPONENTS)
  set(figurine_FIND_COMPONENTS c runtime)
endif()
set(figurine_FOUND TRUE)
foreach(part ${figurine_FIND_COMPONENTS})
  if(NOT EXISTS "${CMAKE_CURRENT_LIST_DIR}/figurine-${part}.cmake")
    set(figurine_FOUND FALSE)
    set(figurine_NOT_FOUND_MESSAGE "figurine has no component '${part}': there are c and runtime")
    return()
  endif()
endforeach()

if("runtime" IN_LIST figurine_FIND_COMPONENTS)  # static: its user links what it needs
  include(CMakeFindDependencyMacro)
  list(PREPEND CMAKE_MODULE_PATH "${CMAKE_CURRENT_LIST_DIR}")
  find_dependency(XNNPACK)
  list(POP_FRONT CMAKE_MODULE_PATH)
endif()
include("${CMAKE_CURRENT_LIST_DIR}/figurine-pthreadpool.cmake")
foreach(part ${figurine_FIND_COMPONENTS})
  include("${CMAKE_CURRENT_LIST_DIR}/figurine-${part}.cmake")
  set(figurine_${part}_FOUND TRUE)
endforeach()
