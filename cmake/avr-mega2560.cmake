# Toolchain file: avr-gcc for the Arduino Mega 2560 (ATmega2560, 16 MHz).
set(CMAKE_SYSTEM_NAME Generic)
set(CMAKE_SYSTEM_PROCESSOR avr)
set(CMAKE_C_COMPILER avr-gcc)
set(CMAKE_CXX_COMPILER avr-g++)
set(CMAKE_TRY_COMPILE_TARGET_TYPE STATIC_LIBRARY)
set(CMAKE_EXECUTABLE_SUFFIX .elf)
# What every source is compiled and linked with, as in Arduino's own build; platformio.ini has the same. (The root's
# CMakeLists.txt adds it: CMake would keep ..._INIT flags of an older version.)
# The rest makes the worst tick shorter: a loop keeps what it could compute once before it, for which the target has no
# registers to spare (one percent); and the pointer that knows no offset (X) is used where none is asked for (half a percent).
# Not -mcall-prologues: one routine that saves the registers of all functions takes 6 KB less, and half a percent more cycles.
set(NINESPRING_AVR_OPTIONS -flto -fno-move-loop-invariants -mstrict-X)
set(NINESPRING_MCU_FLAGS "-mmcu=atmega2560 -DF_CPU=16000000UL -ffunction-sections -fdata-sections -mrelax")
set(CMAKE_C_FLAGS_INIT "${NINESPRING_MCU_FLAGS}")
set(CMAKE_CXX_FLAGS_INIT "${NINESPRING_MCU_FLAGS}")
set(CMAKE_ASM_FLAGS_INIT "-mmcu=atmega2560")
set(CMAKE_EXE_LINKER_FLAGS_INIT "-mmcu=atmega2560 -mrelax -Wl,--gc-sections")
# Not ..._INIT: CMake would put its own -O3 behind it.
set(CMAKE_C_FLAGS_RELEASE "-Os" CACHE STRING "Flags of a release build")
set(CMAKE_CXX_FLAGS_RELEASE "-Os" CACHE STRING "Flags of a release build")
