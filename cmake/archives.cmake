# Which libraries does the program contain? Those under Ceres are 17 shared ones that load half as many others, and
# looking up their names takes most of the time of a fit of a short recording. Where their archives are installed the
# program links these: identikal_archives_of_ceres, identikal_archives_of_text. Everything else (tests, libidentikal.so, the installed
# libraries) keeps the shared ones, for which IDENTIKAL_ARCHIVES is OFF on its target.

# identikal_find_archive(VARIABLE NAME...): appends the first that there is, an archive before a shared library.
function(identikal_find_archive variable)
  list(GET ARGN 0 name)
  list(TRANSFORM ARGN REPLACE "^([^.]+)$" "lib\\1.a;\\1" OUTPUT_VARIABLE files)
  # What belongs to the compiler lies in a folder of its own.
  execute_process(COMMAND ${CMAKE_CXX_COMPILER} -print-file-name=libgcc.a OUTPUT_VARIABLE libgcc OUTPUT_STRIP_TRAILING_WHITESPACE)
  get_filename_component(compiler_folder "${libgcc}" DIRECTORY)
  find_library(IDENTIKAL_ARCHIVE_${name} NAMES ${files} NAMES_PER_DIR HINTS ${compiler_folder})
  mark_as_advanced(IDENTIKAL_ARCHIVE_${name})
  if(IDENTIKAL_ARCHIVE_${name})
    set(${variable} ${${variable}} ${IDENTIKAL_ARCHIVE_${name}} PARENT_SCOPE)
  endif()
endfunction()

set(identikal_archives OFF)
set(ceres_archive "")
if(IDENTIKAL_ARCHIVES AND IDENTIKAL_BUILD_TOOL AND NOT IDENTIKAL_SANITIZE AND CMAKE_SYSTEM_NAME STREQUAL Linux)
  get_target_property(ceres_archive Ceres::ceres LOCATION)
endif()
if(ceres_archive MATCHES "\\.a$")
  set(archives ${ceres_archive})
  # libunwind has functions of the same names as the compiler's own library, which comes first.
  identikal_find_archive(archives glog)
  identikal_find_archive(archives gflags)
  list(APPEND archives -lgcc_s)
  foreach(name unwind lzma spqr cholmod amd camd ccolamd colamd suitesparseconfig cxsparse lapack f77blas cblas atlas)
    identikal_find_archive(archives ${name})
  endforeach()
  identikal_find_archive(archives metis libmetis.so.5)
  identikal_find_archive(archives gfortran libgfortran.so.5)
  identikal_find_archive(archives quadmath libquadmath.so.0)
  identikal_find_archive(archives gomp libgomp.so.1)
  set(archives_of_text "")
  identikal_find_archive(archives_of_text yaml-cpp)
  identikal_find_archive(archives_of_text crypto)
  identikal_find_archive(archives_of_text sqlite3)

  # Other systems' archives may call others: the shared libraries then.
  include(CheckCXXSourceCompiles)
  set(CMAKE_REQUIRED_LIBRARIES ${archives} Eigen3::Eigen Threads::Threads)
  set(CMAKE_REQUIRED_LINK_OPTIONS -no-pie)
  get_target_property(CMAKE_REQUIRED_INCLUDES Ceres::ceres INTERFACE_INCLUDE_DIRECTORIES)
  check_cxx_source_compiles("
    #include <ceres/ceres.h>
    int main() {
      ceres::Problem problem;
      ceres::Solver::Summary summary;
      ceres::Solve(ceres::Solver::Options(), &problem, &summary);
      return summary.IsSolutionUsable() ? 0 : 1;
    }" IDENTIKAL_ARCHIVES_LINK)
  set(identikal_archives ${IDENTIKAL_ARCHIVES_LINK})
  unset(CMAKE_REQUIRED_LIBRARIES)
  unset(CMAKE_REQUIRED_LINK_OPTIONS)
  unset(CMAKE_REQUIRED_INCLUDES)
endif()
add_library(identikal_archives_of_ceres INTERFACE)
add_library(identikal_archives_of_text INTERFACE)
if(identikal_archives)
  target_link_libraries(identikal_archives_of_ceres INTERFACE ${archives} Threads::Threads)
  target_link_libraries(identikal_archives_of_text INTERFACE ${archives_of_text})
endif()
