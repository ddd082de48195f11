# The CMake functions of ROS xacro, for packages that expand their descriptions at build time.
#
#   xacro_add_xacro_file(<input> [<output>] [INORDER] [REMAP name:=value ...] [DEPENDS file ...])
#     Expand one file; its path is then in XACRO_OUTPUT_FILE.  Without <output> it is the input's name without .xacro.
#   xacro_install(<target> <file> ... [DESTINATION <folder below share>])
#     Make a target for files of the function above, and install them.
#   xacro_add_files(<input> ... TARGET <target> [INORDER] [REMAP ...] [DEPENDS ...] [INSTALL [DESTINATION <folder>]])
#     Both for several files.

set(_xacro_command "${xacro_DIR}/../../../bin/xacro")

function(xacro_add_xacro_file input)
  cmake_parse_arguments(_arg "INORDER;LEGACY" "OUTPUT" "REMAP;DEPENDS" ${ARGN})
  set(_output "${_arg_OUTPUT}${_arg_UNPARSED_ARGUMENTS}")
  get_filename_component(_input "${input}" ABSOLUTE)
  if(_output STREQUAL "")
    get_filename_component(_output "${input}" NAME)
    string(REGEX REPLACE "\\.xacro$" "" _output "${_output}")
    if(NOT _output MATCHES "\\.")
      set(_output "${_output}.urdf")
    endif()
  endif()
  if(NOT IS_ABSOLUTE "${_output}")
    set(_output "${CMAKE_CURRENT_BINARY_DIR}/${_output}")
  endif()
  execute_process(COMMAND ${CATKIN_ENV} "${_xacro_command}" --deps "${_input}" ${_arg_REMAP}
    OUTPUT_VARIABLE _included ERROR_QUIET)
  string(REPLACE " " ";" _included "${_included}")
  set(_known)
  foreach(_file ${_included})
    string(STRIP "${_file}" _file)
    if(EXISTS "${_file}")
      list(APPEND _known "${_file}")
    endif()
  endforeach()
  get_filename_component(_folder "${_output}" DIRECTORY)
  file(MAKE_DIRECTORY "${_folder}")
  add_custom_command(OUTPUT "${_output}"
    COMMAND ${CATKIN_ENV} "${_xacro_command}" -o "${_output}" "${_input}" ${_arg_REMAP}
    DEPENDS "${_input}" ${_known} ${_arg_DEPENDS}
    COMMENT "xacro: ${_output}")
  set(XACRO_OUTPUT_FILE "${_output}" PARENT_SCOPE)
endfunction()

function(xacro_install target)
  cmake_parse_arguments(_arg "" "DESTINATION" "" ${ARGN})
  add_custom_target(${target} ALL DEPENDS ${_arg_UNPARSED_ARGUMENTS})
  install(FILES ${_arg_UNPARSED_ARGUMENTS} DESTINATION "${CATKIN_PACKAGE_SHARE_DESTINATION}/${_arg_DESTINATION}")
endfunction()

function(xacro_add_files)
  cmake_parse_arguments(_arg "INORDER;LEGACY;INSTALL" "TARGET;DESTINATION" "REMAP;DEPENDS" ${ARGN})
  if(NOT _arg_TARGET)
    message(FATAL_ERROR "xacro_add_files: no TARGET; expected TARGET and a name behind the files")
  endif()
  set(_outputs)
  foreach(_file ${_arg_UNPARSED_ARGUMENTS})
    xacro_add_xacro_file("${_file}" REMAP ${_arg_REMAP} DEPENDS ${_arg_DEPENDS})
    list(APPEND _outputs "${XACRO_OUTPUT_FILE}")
  endforeach()
  if(_arg_INSTALL)
    xacro_install(${_arg_TARGET} ${_outputs} DESTINATION "${_arg_DESTINATION}")
  else()
    add_custom_target(${_arg_TARGET} ALL DEPENDS ${_outputs})
  endif()
endfunction()
