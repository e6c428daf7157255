# Builds TARGETS of the release preset, in RELEASE, for a build that links them; configures it where nobody has yet.
if(NOT EXISTS ${RELEASE}/build.ninja)
    execute_process(COMMAND ${CMAKE_COMMAND} --preset release COMMAND_ERROR_IS_FATAL ANY)
endif()
execute_process(COMMAND ${CMAKE_COMMAND} --build ${RELEASE} --target ${TARGETS} COMMAND_ERROR_IS_FATAL ANY)
