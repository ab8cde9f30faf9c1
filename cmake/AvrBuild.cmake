# The host build also makes the firmware and the on-target test programs, so that board tests run the
# ELF that is flashed. Without avr-gcc that part is left out, and says so.

get_filename_component(build_name ${CMAKE_BINARY_DIR} NAME)
get_filename_component(build_parent ${CMAKE_BINARY_DIR} DIRECTORY)
if(build_parent STREQUAL "${CMAKE_SOURCE_DIR}/build")
    set(NINESPRING_AVR_DIR ${CMAKE_SOURCE_DIR}/build/avr) # shared by host, asan and coverage
else()
    set(NINESPRING_AVR_DIR ${CMAKE_BINARY_DIR}/avr)
endif()

find_program(AVR_GCC avr-gcc)
if(AVR_GCC)
    add_custom_target(avr ALL
        COMMAND ${CMAKE_COMMAND} -S ${CMAKE_SOURCE_DIR} -B ${NINESPRING_AVR_DIR} -G Ninja
            -DCMAKE_TOOLCHAIN_FILE=${CMAKE_SOURCE_DIR}/cmake/avr-mega2560.cmake -DCMAKE_BUILD_TYPE=Release
        COMMAND ${CMAKE_COMMAND} --build ${NINESPRING_AVR_DIR}
        COMMENT "AVR build in ${NINESPRING_AVR_DIR}" USES_TERMINAL VERBATIM)
else()
    message(WARNING "avr-gcc not found: the firmware and every board test are LEFT OUT of this build. "
        "On Debian or Ubuntu: apt-get install gcc-avr avr-libc libsimavr-dev libelf-dev")
endif()
