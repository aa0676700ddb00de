# What `cmake --install` brings: the program with its man pages, completions and scenes (component
# program), the Python module where it was built (component python), and the headers, libraries and
# abbeConfig.cmake for programs of others (component development). `cpack -G DEB` makes a package of
# each.
include(CMakePackageConfigHelpers)
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "virtual five-axis machine tool that is wrong on purpose")

install(TARGETS abbe RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR} COMPONENT program)
install(TARGETS abbe_all_digits LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR}/abbe COMPONENT program)
# pages and completions are what the program says of itself
add_custom_command(OUTPUT ${CMAKE_BINARY_DIR}/shell/pages
                   COMMAND ${CMAKE_COMMAND} -DPROGRAM=$<TARGET_FILE:abbe> -DOUT=${CMAKE_BINARY_DIR}/shell
                           -DVERSION=${PROJECT_VERSION} "-DABOUT=${CPACK_PACKAGE_DESCRIPTION_SUMMARY}"
                           -P ${CMAKE_CURRENT_LIST_DIR}/shell_files.cmake
                   DEPENDS abbe ${CMAKE_CURRENT_LIST_DIR}/shell_files.cmake ${CMAKE_CURRENT_LIST_DIR}/manual.h2m VERBATIM)
add_custom_target(abbe_shell ALL DEPENDS ${CMAKE_BINARY_DIR}/shell/pages)
install(DIRECTORY ${CMAKE_BINARY_DIR}/shell/man1 DESTINATION ${CMAKE_INSTALL_MANDIR} COMPONENT program)
install(FILES ${CMAKE_BINARY_DIR}/shell/abbe DESTINATION ${CMAKE_INSTALL_DATADIR}/bash-completion/completions
        COMPONENT program)
install(FILES ${CMAKE_BINARY_DIR}/shell/_abbe DESTINATION ${CMAKE_INSTALL_DATADIR}/zsh/vendor-completions
        COMPONENT program)
install(FILES ${CMAKE_BINARY_DIR}/shell/abbe.fish DESTINATION ${CMAKE_INSTALL_DATADIR}/fish/vendor_completions.d
        COMPONENT program)
install(DIRECTORY scenes/ DESTINATION ${CMAKE_INSTALL_DATADIR}/abbe/scenes COMPONENT program
        PATTERN pictures EXCLUDE PATTERN out EXCLUDE)
install(FILES LICENSE README.md CHANGELOG.md DESTINATION ${CMAKE_INSTALL_DOCDIR} COMPONENT program)

if(TARGET abbe_python)
  install(TARGETS abbe_python LIBRARY DESTINATION lib/python3/dist-packages COMPONENT python)
endif()

get_property(rooms GLOBAL PROPERTY abbe_rooms)
set(abbe_package_dir ${CMAKE_INSTALL_LIBDIR}/cmake/abbe)
set(abbe_headers_dir ${CMAKE_INSTALL_INCLUDEDIR}/abbe)
set(libraries abbe_abi)
foreach(room ${rooms})
  string(REPLACE "/" "_" name ${room})
  list(APPEND libraries abbe_${name})
endforeach()
# The headers that programs of others include, and all that these include.
set(public_headers kinematics/chain.h kinematics/inverse_kinematics.h errors/geometric.h errors/compliance.h
                   errors/thermal_elements.h errors/thermal_run.h errors/vibration.h cutting/part/read_mesh.h
                   cutting/map/residual.h cutting/map/form.h cutting/stock/force.h sim/cut/workpiece.h
                   sim/compensation/plug_in.h sim/compensation/abbe_compensator.h)
set(unread ${public_headers})
while(unread)
  list(POP_FRONT unread header)
  set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/${header})
  file(STRINGS ${PROJECT_SOURCE_DIR}/${header} lines REGEX "^[ \t]*#[ \t]*include \"")
  foreach(line ${lines})
    string(REGEX REPLACE ".*\"([^\"]+)\".*" "\\1" included "${line}")
    if(NOT included IN_LIST public_headers)
      list(APPEND public_headers ${included})
      list(APPEND unread ${included})
    endif()
  endforeach()
endwhile()
foreach(header ${public_headers})
  get_filename_component(folder ${header} DIRECTORY)
  install(FILES ${PROJECT_SOURCE_DIR}/${header} DESTINATION ${abbe_headers_dir}/${folder} COMPONENT development)
endforeach()
if(TARGET abbe_glew_init)
  list(APPEND libraries abbe_glew_init)
endif()
install(TARGETS ${libraries} EXPORT abbe
        ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR}/abbe COMPONENT development
        OBJECTS DESTINATION ${CMAKE_INSTALL_LIBDIR}/abbe COMPONENT development)
install(EXPORT abbe NAMESPACE abbe:: FILE abbeTargets.cmake DESTINATION ${abbe_package_dir}
        COMPONENT development)
configure_package_config_file(${CMAKE_CURRENT_LIST_DIR}/abbeConfig.cmake.in
                              ${CMAKE_CURRENT_BINARY_DIR}/abbeConfig.cmake
                              INSTALL_DESTINATION ${abbe_package_dir})
write_basic_package_version_file(${CMAKE_CURRENT_BINARY_DIR}/abbeConfigVersion.cmake
                                 COMPATIBILITY SameMinorVersion)
install(FILES ${CMAKE_CURRENT_BINARY_DIR}/abbeConfig.cmake ${CMAKE_CURRENT_BINARY_DIR}/abbeConfigVersion.cmake
        DESTINATION ${abbe_package_dir} COMPONENT development)

set(CPACK_PACKAGE_VENDOR "the abbe project")
set(CPACK_PACKAGE_CONTACT "the abbe project")
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_COMPONENTS_ALL program development)
if(TARGET abbe_python)
  list(APPEND CPACK_COMPONENTS_ALL python)
endif()
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PROGRAM_PACKAGE_NAME abbe)
set(CPACK_DEBIAN_PROGRAM_PACKAGE_SECTION science)
set(CPACK_DEBIAN_PROGRAM_PACKAGE_SHLIBDEPS ON)
# the driver that draws without a display is opened by name, so no tool finds it
set(CPACK_DEBIAN_PROGRAM_PACKAGE_DEPENDS "libegl1, libgl1-mesa-dri")
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_NAME libabbe-dev)
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_SECTION libdevel)
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_DEPENDS
    "libeigen3-dev, libfmt-dev, libtbb-dev, libopenmesh-dev, libfcl-dev, libvtk9-dev, libglew-dev, \
libegl-dev, libcairo2-dev, libtomlplusplus-dev, nlohmann-json3-dev, libcli11-dev, libsqlite3-dev, libboost-dev")
set(CPACK_DEBIAN_PYTHON_PACKAGE_NAME python3-abbe)
set(CPACK_DEBIAN_PYTHON_PACKAGE_SECTION python)
set(CPACK_DEBIAN_PYTHON_PACKAGE_SHLIBDEPS ON)
if(TARGET abbe_python)
  # a module is loaded by the Python it was built for
  math(EXPR next_minor "${Python_VERSION_MINOR} + 1")
  set(CPACK_DEBIAN_PYTHON_PACKAGE_DEPENDS "abbe (= ${PROJECT_VERSION}), \
python3 (>= ${Python_VERSION_MAJOR}.${Python_VERSION_MINOR}), \
python3 (<< ${Python_VERSION_MAJOR}.${next_minor}), python3-numpy")
endif()
include(CPack)
