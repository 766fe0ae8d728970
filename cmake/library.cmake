# identikal_sources(VARIABLE): every source below the current folder, so that a new file is found by where it lies.
macro(identikal_sources variable)
  file(GLOB_RECURSE ${variable} CONFIGURE_DEPENDS RELATIVE ${CMAKE_CURRENT_SOURCE_DIR} ${CMAKE_CURRENT_SOURCE_DIR}/*.cpp)
endmacro()

# identikal_library(LAYER SOURCE...): the library identikal_LAYER, which other projects link as identikal::LAYER;
# static, or shared with BUILD_SHARED_LIBS.
function(identikal_library layer)
  set(name identikal_${layer})
  add_library(${name} ${ARGN})
  add_library(identikal::${layer} ALIAS ${name})
  set_target_properties(${name} PROPERTIES EXPORT_NAME ${layer} DEFINE_SYMBOL "")
  if(NOT PROJECT_IS_TOP_LEVEL)
    set_target_properties(${name} PROPERTIES EXCLUDE_FROM_ALL ON)
  endif()
  # Over CMake's -O3, which takes the compiler a fifth longer and runs no faster but in a few kernels.
  target_compile_options(${name} PRIVATE $<$<CONFIG:Release>:-O2>)
  get_target_property(type ${name} TYPE)
  if(type STREQUAL SHARED_LIBRARY)
    # The sources carry no export macros: a library shows the names of namespace identikal and hides everything
    # else, above all what templates of Eigen and others leave in it. Before 1.0 every minor version may break its users.
    set(exports ${PROJECT_SOURCE_DIR}/cmake/exports.map)
    target_link_options(${name} PRIVATE LINKER:--version-script=${exports} LINKER:--no-undefined)
    set_target_properties(${name} PROPERTIES LINK_DEPENDS ${exports}
      VERSION ${PROJECT_VERSION} SOVERSION ${PROJECT_VERSION_MAJOR}.${PROJECT_VERSION_MINOR}
      INSTALL_RPATH $ORIGIN)
  endif()
endfunction()

# identikal_precompile(TARGET HEADER... [REUSE_FROM OTHER]): lib/internal/precompiled.h and the headers named are compiled
# once, ahead of the target's sources; or those of another target with the same options are used.
function(identikal_precompile target)
  cmake_parse_arguments(PARSE_ARGV 1 arg "" "REUSE_FROM" "")
  if(arg_REUSE_FROM)
    target_precompile_headers(${target} REUSE_FROM ${arg_REUSE_FROM})
    # g++ takes a precompiled header only where all macros of its command line are defined again.
    target_compile_definitions(${target} PRIVATE $<TARGET_PROPERTY:${arg_REUSE_FROM},COMPILE_DEFINITIONS>)
  else()
    target_precompile_headers(${target} PRIVATE <lib/internal/precompiled.h>
      ${arg_UNPARSED_ARGUMENTS})
  endif()
  # A shared library hides Eigen's functions from the others.
  if(NOT BUILD_SHARED_LIBS)
    target_compile_definitions(${target} PRIVATE IDENTIKAL_EIGEN_INSTANCES)
  endif()
  # For ccache.
  if(CMAKE_CXX_COMPILER_ID STREQUAL GNU)
    target_compile_options(${target} PRIVATE -fpch-preprocess)
  elseif(CMAKE_CXX_COMPILER_ID STREQUAL Clang)
    target_compile_options(${target} PRIVATE "SHELL:-Xclang -fno-pch-timestamp")
  endif()
endfunction()

# identikal_optimise_little(TARGET): -O1, for what reads options and prints. From g++ 13 on a precompiled header serves one
# level alone, which is that of the rooms it is taken from.
function(identikal_optimise_little target)
  if(CMAKE_CXX_COMPILER_ID STREQUAL GNU AND CMAKE_CXX_COMPILER_VERSION VERSION_GREATER_EQUAL 13)
    target_compile_options(${target} PRIVATE $<$<CONFIG:Release>:-O2>)
  else()
    target_compile_options(${target} PRIVATE $<$<CONFIG:Release>:-O1>)
  endif()
endfunction()
