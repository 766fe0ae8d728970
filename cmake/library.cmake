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
