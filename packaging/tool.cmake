# The program, its data, documents and manual, and the Debian packages.
install(TARGETS identikal RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR} COMPONENT tool)
if(TARGET identikal_mpi)
  install(TARGETS identikal_mpi LIBRARY DESTINATION lib/identikal COMPONENT mpi)
endif()
if(type STREQUAL SHARED_LIBRARY)
  set_target_properties(identikal PROPERTIES INSTALL_RPATH $ORIGIN/../${CMAKE_INSTALL_LIBDIR})
endif()
set(share ${CMAKE_INSTALL_DATADIR}/identikal)
install(DIRECTORY ${PROJECT_SOURCE_DIR}/examples DESTINATION ${share} COMPONENT tool
  FILES_MATCHING PATTERN *.yaml PATTERN *.md PATTERN *.cpp PATTERN *.c PATTERN *.py)
install(DIRECTORY ${PROJECT_SOURCE_DIR}/data DESTINATION ${share} COMPONENT tool
  FILES_MATCHING PATTERN *.csv PATTERN *.md)
install(FILES ${PROJECT_SOURCE_DIR}/identify/result/result.schema.json DESTINATION ${share} COMPONENT tool)
install(FILES ${PROJECT_SOURCE_DIR}/README.md ${PROJECT_SOURCE_DIR}/CHANGELOG.md THIRD_PARTY_NOTICES.md
  DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/identikal COMPONENT tool)
install(DIRECTORY ${PROJECT_SOURCE_DIR}/docs DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/identikal
  COMPONENT tool FILES_MATCHING PATTERN *.md PATTERN *.png PATTERN *.ipynb)
install(FILES ${PROJECT_SOURCE_DIR}/LICENSE DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/identikal
  COMPONENT tool RENAME copyright)

# The manual page and what shells complete, from the command line's own definition.
set(generated man/identikal.1 bash/identikal.bash zsh/_identikal fish/identikal.fish)
foreach(file IN LISTS generated)
  get_filename_component(kind ${file} DIRECTORY)
  add_custom_command(OUTPUT ${file}
    COMMAND ${CMAKE_COMMAND} -E make_directory ${kind}
    COMMAND identikal --generate ${kind} > ${file} DEPENDS identikal VERBATIM)
endforeach()
add_custom_target(command_reference ALL DEPENDS ${generated})
set(here ${CMAKE_CURRENT_BINARY_DIR})
install(FILES ${here}/man/identikal.1 DESTINATION ${CMAKE_INSTALL_MANDIR}/man1 COMPONENT tool)
install(FILES ${here}/bash/identikal.bash DESTINATION ${CMAKE_INSTALL_DATADIR}/bash-completion/completions
  COMPONENT tool RENAME identikal)
install(FILES ${here}/fish/identikal.fish DESTINATION ${CMAKE_INSTALL_DATADIR}/fish/vendor_completions.d
  COMPONENT tool)
# Debian's zsh looks into another folder for what packages bring.
install(FILES ${here}/zsh/_identikal DESTINATION ${CMAKE_INSTALL_DATADIR}/zsh/site-functions
  COMPONENT zsh)
install(FILES ${here}/zsh/_identikal DESTINATION ${CMAKE_INSTALL_DATADIR}/zsh/vendor-completions
  COMPONENT tool EXCLUDE_FROM_ALL)

# The Debian packages: `cpack --config build/CPackConfig.cmake`. They hold static libraries.
if(type STREQUAL SHARED_LIBRARY)
  return()
endif()
set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_NAME identikal)
set(CPACK_PACKAGE_VENDOR "Identikal developers")
set(CPACK_PACKAGE_CONTACT "Identikal developers <developers@identikal.invalid>")
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_COMPONENTS_ALL tool dev)
set(CPACK_COMPONENTS_GROUPING IGNORE)
set(CPACK_STRIP_FILES ON)
set(CPACK_DEBIAN_TOOL_PACKAGE_NAME identikal)
set(CPACK_DEBIAN_TOOL_PACKAGE_SECTION science)
set(CPACK_DEBIAN_TOOL_PACKAGE_SHLIBDEPS ON)
set(CPACK_COMPONENT_TOOL_DESCRIPTION
  "Tunes the noise covariances of a Kalman filter from a log, and identifies
cornering stiffness, yaw inertia and other vehicle parameters from a test
drive. Every number comes with its error, its Cramer-Rao bound, and a verdict
on whether the data determine it at all.")
set(CPACK_DEBIAN_DEV_PACKAGE_NAME libidentikal-dev)
set(CPACK_DEBIAN_DEV_PACKAGE_SECTION libdevel)
set(CPACK_DEBIAN_DEV_PACKAGE_DEPENDS "identikal (= ${PROJECT_VERSION}), libeigen3-dev (>= 3.4), libceres-dev (>= 2.1), \
libnlopt-dev, libhwy-dev, libyaml-cpp-dev, libfmt-dev, libssl-dev")
set(CPACK_DEBIAN_DEV_PACKAGE_SUGGESTS identikal)
set(CPACK_COMPONENT_DEV_DESCRIPTION
  "Headers and static libraries of Identikal, to be found by CMake and
pkg-config.")
if(TARGET identikal_python)
  list(APPEND CPACK_COMPONENTS_ALL python)
  set(CPACK_DEBIAN_PYTHON_PACKAGE_NAME python3-identikal)
  set(CPACK_DEBIAN_PYTHON_PACKAGE_SECTION python)
  set(CPACK_DEBIAN_PYTHON_PACKAGE_SHLIBDEPS ON)
  math(EXPR next "${Python_VERSION_MINOR} + 1")  # a module is of one minor version
  set(CPACK_DEBIAN_PYTHON_PACKAGE_DEPENDS
    "python3 (>= ${Python_VERSION_MAJOR}.${Python_VERSION_MINOR}), python3 (<< ${Python_VERSION_MAJOR}.${next}), python3-numpy")
  set(CPACK_DEBIAN_PYTHON_PACKAGE_SUGGESTS "python3-pandas, python3-matplotlib")
  set(CPACK_COMPONENT_PYTHON_DESCRIPTION
    "Identikal for Python: Kalman filters tuned and models fitted from numpy
arrays and pandas tables, in this process and without files.")
endif()
include(CPack)
