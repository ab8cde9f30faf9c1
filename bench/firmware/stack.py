"""Worst-case stack of a firmware ELF, from its disassembly alone.

Each label is a node: bytes it pushes and reserves, and where it calls, jumps or falls to. A path costs
what its nodes hold plus a return address of three bytes a call. The deepest path from main, plus the
deepest interrupt on top of it (interrupts do not nest here: one that enables interrupts is refused), is the
worst case. Arguments pushed for a call count as if they stayed, so the figure is an upper bound.
Indirect calls are listed, and resolved by the table INDIRECT; one that is not in it is refused.
"""

from __future__ import annotations

import re
import subprocess
from dataclasses import dataclass, field
from pathlib import Path

RETURN_ADDRESS = 3  # bytes, on a chip with more than 128 KB of flash
SAVED_BY_HELPER = 18  # registers that __prologue_saves__ can push

# Who calls through a pointer, and what can be behind it. The functions behind text_output_t and
# record_storage_t are in firmware/main.cpp, a record's bytes in settings_record.c, a word's in console_words.c, what scrub looks through in
# controller_fixed.c and console_settings.c; nothing attaches to Wire as a slave.
OUTPUT = (r"serial_room", r"telemetry_room", r"serial_write")
STORAGE = (r"eeprom_read", r"eeprom_ready", r"eeprom_write", r"record_byte")
STRETCHES = (r"^controller_fixed$", r"^stretch_of")
WORDS = (r"^word_\w+",)
NOTHING = (r"twi_onSlave\w+",)
INDIRECT: tuple[tuple[str, tuple[str, ...]], ...] = (
    (r"^(console_execute|console_receive|take_input)", WORDS + OUTPUT),
    (
        r"^(main|setup|loop|run_tick|_ZL\d+(take_input|serve|tell_status|run_tick|start))",
        WORDS + OUTPUT + STORAGE,
    ),  # the linker's optimiser moves what is called once
    (
        r"^(console_|out_end|echo|answer|room_for|list_settings|selftest|start_telemetry|end_job|save|print_|apply_settings)",
        OUTPUT,
    ),
    (r"^(telemetry_|flush|write_csv|write_spring|write_sight|write_mark)", OUTPUT),
    (r"^(settings_|record_store_|examine|slot_|next_byte|take)", STORAGE),
    (r"^(scrub_|checksum)", STRETCHES),
    (r"^__vector_39", NOTHING),
    (r"^__do_global_ctors|^__tablejump2__|^__do_global_dtors", (r"^_GLOBAL__sub_I",)),
    (
        r"^(_ZN\d+Adafruit|_ZN7TwoWire|_ZN5Print|_ZN6Stream|_ZL\d+read_|current_sensor_)",
        (r"^_ZN7TwoWire5writeEh$", r"^_ZN7TwoWire\d+(read|available|peek|flush)"),
    ),
)
# Calls that close no circle, though they seem to: the I2C library's begin() sets a flag before detected() asks it, and
# soft-float's entry for special numbers lies behind the label that it calls. They count as one level that calls nothing.
GUARDED = {
    ("_ZN18Adafruit_I2CDevice8detectedEv", "_ZN18Adafruit_I2CDevice5beginEb"),
    ("_ZN18Adafruit_I2CDevice8detectedEv", "_ZN18Adafruit_I2CDevice8detectedEv"),  # begin() put into it
    ("__fp_splitA", "__fp_splitA"),
}
# The same of a routine that is entered by either label: it jumps back behind the call, never to it.
ENTERED_BY_BOTH = {("__mulsf3", "__mulsf3x"), ("__addsf3", "__addsf3x")}


@dataclass
class Node:
    """One label of the disassembly."""

    name: str
    own: int = 0
    calls: set[str] = field(default_factory=set)
    jumps: set[str] = field(default_factory=set)
    indirect: int = 0
    enables_interrupts: bool = False


@dataclass
class Stack:
    """Bytes, and the path of names that needs them."""

    main: int
    main_path: list[str]
    interrupt: int
    interrupt_path: list[str]
    indirect: list[tuple[str, list[str]]]

    @property
    def worst(self) -> int:
        """Deepest path of main with the deepest interrupt on top."""
        return self.main + self.interrupt


def _parse(listing: str) -> dict[str, Node]:
    nodes: dict[str, Node] = {}
    node: Node | None = None
    ended = True
    frame_low = 0
    high = 0
    moved = 0
    _data, _mark, code = listing.partition("<__ctors_end>:\n")  # tables in flash come first
    for line in code.splitlines():
        if label := re.match(r"^[0-9a-f]+ <(.+)>:$", line):
            name = label[1]
            if node is not None and not ended:
                node.jumps.add(name)
            node = nodes.setdefault(name, Node(name))
            ended = False
            continue
        parts = line.split("\t")
        if node is None or len(parts) < 3:
            continue
        operation = parts[2].strip()
        rest = "\t".join(parts[3:])
        operands = rest.split(";")[0].strip()
        # <__vectors>: address 0, a hook of the core that nobody has defined
        target = re.search(r"<(?!__vectors)([^>+]+)(?:\+0x([0-9a-f]+))?>", rest)
        ended = operation in {"ret", "reti", "jmp", "rjmp", "ijmp", "eijmp"}
        if operation not in {"in", "out", "cli", "sbiw", "sbci", "sbc"}:
            moved = 0
        if operation == "push":
            node.own += 1
        elif operation == "rcall" and operands in {".+0", ".+0x0"}:
            node.own += RETURN_ADDRESS  # reserves room
        elif operation == "ldi" and operands.startswith("r26,"):
            frame_low = int(operands.split(",")[1], 0)
        elif operation == "ldi" and operands.startswith("r27,"):
            high = int(operands.split(",")[1], 0)
        elif operation == "sbiw" and operands.startswith("r28,"):
            moved = int(operands.split(",")[1], 0)
        elif operation == "subi" and operands.startswith("r28,"):
            frame_low = int(operands.split(",")[1], 0)
        elif operation == "sbci" and operands.startswith("r29,"):
            size = frame_low + 256 * int(operands.split(",")[1], 0)
            moved = size if size < 0x8000 else 0  # else it gives the room back
        elif operation == "sbc" and operands == "r29, r1":
            moved = frame_low
        elif operation == "out" and operands == "0x3e, r29":
            node.own += moved  # the frame pointer also moves to reach far locals: then it stays out of SP
            moved = 0
        elif operation == "sei" and node.name.startswith("__vector"):
            node.enables_interrupts = True
        elif operation in {"icall", "eicall"}:
            node.indirect += 1
        elif target and target[1] == "__prologue_saves__":
            node.own += SAVED_BY_HELPER - int(target[2] or "0", 16) // 2 + frame_low + 256 * high
            ended = False
        elif target and target[1] == "__epilogue_restores__":
            pass
        elif operation in {"call", "rcall"} and target and target[1] == node.name and target[2]:
            node.own += RETURN_ADDRESS  # into its own middle: the soft-float routines do
        elif operation in {"call", "rcall"} and target:
            node.calls.add(target[1])
        elif target and target[1] != node.name and operation not in {"lds", "sts"}:
            node.jumps.add(target[1])
    for helper in ("__prologue_saves__", "__epilogue_restores__"):
        nodes.pop(helper, None)
    return nodes


def _resolve(nodes: dict[str, Node]) -> list[tuple[str, list[str]]]:
    found = []
    for node in nodes.values():
        if not node.indirect:
            continue
        patterns = next((to for caller, to in INDIRECT if re.search(caller, node.name)), None)
        if patterns is None:
            raise ValueError(f"{node.name} calls through a pointer: name what can be behind it in stack.py's INDIRECT")
        targets = [name for name in nodes if any(re.search(p, name) for p in patterns)]
        node.calls.update(targets)
        found.append((node.name, targets))
    return found


def _deepest(nodes: dict[str, Node], start: str) -> tuple[int, list[str]]:
    known: dict[str, tuple[int, list[str]]] = {}
    path: list[str] = []

    def visit(name: str) -> tuple[int, list[str]]:
        if name in known:
            return known[name]
        node = nodes.get(name, Node(name))
        path.append(name)
        best: tuple[int, list[str]] = (0, [])
        for callee in sorted(node.calls):
            if (name, callee) in GUARDED:
                best = max(best, (nodes[callee].own + RETURN_ADDRESS, [callee]))
                continue
            if callee in path and (name, callee) in ENTERED_BY_BOTH:
                continue
            if callee in path:
                raise ValueError(f"recursion: {' > '.join(path)} > {callee}: its stack has no bound")
            depth, way = visit(callee)
            best = max(best, (depth + RETURN_ADDRESS, way))
        for target in sorted(node.jumps):
            if target not in path:  # a loop through a label of its own holds nothing more
                best = max(best, visit(target))
        path.pop()
        known[name] = (node.own + best[0], [f"{name} {node.own}", *best[1]])
        return known[name]

    return visit(start)


def analyse(elf: Path, objdump: str = "avr-objdump") -> Stack:
    """Stack of an ELF in bytes; ValueError where it has no bound or a pointer is not named."""
    listing = subprocess.run([objdump, "-d", str(elf)], check=True, capture_output=True, text=True).stdout
    nodes = _parse(listing)
    indirect = _resolve(nodes)
    main, main_path = _deepest(nodes, "main")
    vectors = [n for n in nodes if re.match(r"__vector_\d+$", n)]
    for name in vectors:
        if nodes[name].enables_interrupts:
            raise ValueError(f"{name} enables interrupts: they could nest without bound")
    interrupt, interrupt_path = max((_deepest(nodes, name) for name in vectors), default=(0, []))
    return Stack(main + RETURN_ADDRESS, main_path, interrupt + RETURN_ADDRESS, interrupt_path, indirect)
