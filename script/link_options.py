"""For PlatformIO: the compiler's options also when linking, where -flto generates the code."""

Import("env")  # noqa: F821 (given by PlatformIO)

env.Append(LINKFLAGS=[option for option in env["CCFLAGS"] if str(option).startswith(("-f", "-m", "--param"))])  # noqa: F821
