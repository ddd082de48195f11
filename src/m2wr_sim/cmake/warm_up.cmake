# Compiles the kernels of the package m2wr_sim in FOLDER before the first start: cmake -DPYTHON=/usr/bin/python3
# -DFOLDER=/path/to/dist-packages -P warm_up.cmake. If that fails they are compiled at the first start.
# tools/build.sh does this after the build, because catkin-tools delays the output.
if(DEFINED ENV{M2WR_KERNELS_LATER})
  return()
endif()
execute_process(
  COMMAND ${CMAKE_COMMAND} -E env "PYTHONPATH=${FOLDER}:$ENV{PYTHONPATH}" ${PYTHON} -m m2wr_sim.warm_up
  RESULT_VARIABLE result ERROR_VARIABLE error)
if(NOT result EQUAL 0)
  message(STATUS "m2wr_sim: the kernels are compiled at the first start, not now: ${error}")
endif()
