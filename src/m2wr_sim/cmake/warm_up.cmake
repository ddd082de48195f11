# Compiles the kernels of the package m2wr_sim in FOLDER, so that the first start need not: cmake -DPYTHON=/usr/bin/python3
# -DFOLDER=/path/to/dist-packages -P warm_up.cmake. Where that fails they are compiled at the first start.
# tools/build.sh does it itself, after the build: catkin-tools would keep back what is said meanwhile.
if(DEFINED ENV{M2WR_KERNELS_LATER})
  return()
endif()
execute_process(
  COMMAND ${CMAKE_COMMAND} -E env "PYTHONPATH=${FOLDER}:$ENV{PYTHONPATH}" ${PYTHON} -m m2wr_sim.warm_up
  RESULT_VARIABLE result ERROR_VARIABLE said)
if(NOT result EQUAL 0)
  message(STATUS "m2wr_sim: the kernels are compiled at the first start, not now: ${said}")
endif()
