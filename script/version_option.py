"""For PlatformIO: the version, which stands in CMakeLists.txt alone, as a macro."""

import re
from pathlib import Path

Import("env")  # noqa: F821 (given by PlatformIO)

text = Path(env["PROJECT_DIR"], "CMakeLists.txt").read_text()  # noqa: F821
version = re.search(r"project\(ninespring VERSION ([0-9.]+)", text)[1]
env.Append(CPPDEFINES=[("NINESPRING_VERSION", env.StringifyMacro(version))])  # noqa: F821
