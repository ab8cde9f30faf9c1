# Toolchain file: avr-gcc for the Arduino Mega 2560 (ATmega2560, 16 MHz).
set(CMAKE_SYSTEM_NAME Generic)
set(CMAKE_SYSTEM_PROCESSOR avr)
set(CMAKE_C_COMPILER avr-gcc)
set(CMAKE_CXX_COMPILER avr-g++)
set(CMAKE_TRY_COMPILE_TARGET_TYPE STATIC_LIBRARY)
set(CMAKE_EXECUTABLE_SUFFIX .elf)
# What every source is compiled with (the root's CMakeLists.txt adds it: CMake would keep ..._INIT flags of an older version).
# -flto, as in Arduino's own build; fat objects, so that their symbols can still be listed by library.
# -fno-tree-switch-conversion: the tables that it makes of switches sit in RAM. -mstrict-X, -fno-tree-forwprop,
# -fira-region=mixed: found by measuring, smaller and faster. -fno-inline-small-functions, -mcall-prologues: smaller; what is
# called often in a tick is declared inline, or is long enough not to notice. -fno-ipa-pure-const,
# -fno-move-loop-invariants: smaller. -fshort-enums: an enum takes a byte. --param=max-inline-insns-single=3 and what
# follows it: smaller, found by measuring. platformio.ini names the same.
set(NINESPRING_AVR_OPTIONS -flto -fno-tree-switch-conversion -mstrict-X -fno-tree-forwprop -fira-region=mixed
    -fno-inline-small-functions -mcall-prologues -fno-ipa-pure-const -fno-move-loop-invariants
    -fshort-enums --param=max-inline-insns-single=3 -fno-tree-dominator-opts -fno-tree-ter -fno-ipa-sra
    -fno-tree-tail-merge -fno-tree-coalesce-vars -flto-partition=one)
set(NINESPRING_MCU_FLAGS "-mmcu=atmega2560 -DF_CPU=16000000UL -ffunction-sections -fdata-sections -mrelax")
set(CMAKE_C_FLAGS_INIT "${NINESPRING_MCU_FLAGS}")
set(CMAKE_CXX_FLAGS_INIT "${NINESPRING_MCU_FLAGS}")
set(CMAKE_ASM_FLAGS_INIT "-mmcu=atmega2560")
set(CMAKE_EXE_LINKER_FLAGS_INIT "-mmcu=atmega2560 -mrelax -Wl,--gc-sections")
# Not ..._INIT: CMake would put its own -O3 behind it.
set(CMAKE_C_FLAGS_RELEASE "-Os" CACHE STRING "Flags of a release build")
set(CMAKE_CXX_FLAGS_RELEASE "-Os" CACHE STRING "Flags of a release build")
