# cmake -D SCENE=... -D RENDERER=... -D WORK_DIR=... -P run_example.cmake: the example renderer makes
# its pictures, within a budget that does not hold its scene.
file(REMOVE_RECURSE ${WORK_DIR})
file(MAKE_DIRECTORY ${WORK_DIR})
execute_process(COMMAND ${SCENE} ${WORK_DIR} RESULT_VARIABLE result)
if(NOT result EQUAL 0)
  message(FATAL_ERROR "${SCENE}: exit status ${result}")
endif()
execute_process(COMMAND ${RENDERER} ${WORK_DIR}/cornell.obj --output ${WORK_DIR}/picture --size 64 --memory 32
  --threads 2 RESULT_VARIABLE result OUTPUT_VARIABLE said)
message(STATUS "${said}")
foreach(picture occlusion color)
  if(NOT result EQUAL 0 OR NOT EXISTS ${WORK_DIR}/picture_${picture}.png)
    message(FATAL_ERROR "renderer: exit status ${result}, or no picture")
  endif()
endforeach()
