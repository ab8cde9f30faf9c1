"""The firmware's machine code uses no torn pointer: half of a register pair overwritten, then the whole of it as an address.

    torn_pointers.py build/avr

avr-gcc 5.4 takes r31 for a constant and goes on as if Z (r31:r30) still held what it held before (its pass after reload adds a
difference to half of a pointer). What was read then lay anywhere. It depends on which registers are left, so any change of the
code may bring it, in any file; it was found as a read beyond the RAM, when a spring had lost phase.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from pathlib import Path

PAIRS = {"Z": (30, 31), "X": (26, 27)}
LOADS = {"mov", "ld", "ldd", "lds", "pop", "in", "lpm", "elpm", "clr", "eor", "ldi"}
"""What sets a register anew."""
LEAVES = {"call", "rcall", "icall", "eicall", "ret", "reti", "jmp", "rjmp"}
LINE = re.compile(r"^\s*([0-9a-f]+):\s+(\S+)\s*([^;]*)")
HEAD = re.compile(r"^[0-9a-f]+ <(.*)>:")

# As avr-gcc has made it of see_crossing: r31 is 0xFB where `sbiw` takes Z for a pointer.
TORN = """
00000000 <torn>:
   0:	movw	r30, r14
   2:	std	Z+3, r25
   4:	ldi	r31, 0x46
   6:	sub	r14, r31
   8:	sbiw	r30, 0x38
   a:	ld	r22, Z
"""
WHOLE = TORN.replace("sbiw	r30, 0x38", "movw	r30, r14")


def torn(listing: str) -> list[str]:
    """Return where a pair is used as a pointer after its upper half alone was set to a constant."""
    found: list[str] = []
    function = ""
    scratch: dict[str, bool] = {}
    lower_is_new: dict[str, bool] = {}
    for line in listing.splitlines():
        if head := HEAD.match(line):
            function, scratch, lower_is_new = head[1], {}, {}
            continue
        code = LINE.match(line)
        if not code:
            continue
        address, name, operands = code[1], code[2], code[3].strip()
        first = operands.split(",")[0]
        for pair, (low, high) in PAIRS.items():
            points = re.search(rf"(?<![A-Za-z]){pair}(?![a-z])", operands) or (
                name in ("adiw", "sbiw") and first == f"r{low}"
            )
            if scratch.get(pair) and points:
                found.append(f"{function}, {address}: {name} {operands}")
                scratch[pair] = False
            if first == f"r{low}" and (name == "movw" or name in LOADS):
                scratch[pair] = False
                lower_is_new[pair] = name != "movw"
            elif first == f"r{high}":
                scratch[pair] = name == "ldi" and not lower_is_new.get(pair, False)
                lower_is_new[pair] = False
        if name in LEAVES:
            scratch, lower_is_new = {}, {}
    return found


def main() -> int:
    """Look at each ELF of the folder."""
    if torn(TORN) != ["torn, 8: sbiw r30, 0x38"] or torn(WHOLE):
        sys.exit("torn_pointers: it does not find what it is for")
    if not shutil.which("avr-objdump"):
        print("SKIPPED: no avr-objdump")
        return 77
    elves = sorted(Path(sys.argv[1]).rglob("*.elf"))
    if not elves:
        sys.exit(f"torn_pointers: no ELF in {sys.argv[1]}")
    bad = 0
    for elf in elves:
        dump = subprocess.run(
            ["avr-objdump", "-d", "--no-show-raw-insn", str(elf)], check=True, capture_output=True, text=True
        )
        for one in torn(dump.stdout):
            print(f"{elf}: a pointer of which half was overwritten: {one}. Write that function otherwise.")
            bad += 1
    print(f"{len(elves)} ELFs, {bad} torn pointers")
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
