"""A fourth world: two finned heaters in a box that is left by still air, a quarter of an hour to 40 minutes a run.

Explicit Euler at a quarter of a second: each heater a heated end and two parts of a fin, losses that grow with the 5/4th power of how
much hotter it is, the other's current in its supply, a late thermometer, the air of the box, a heat that wanders. One run in five begins
warm, rows are missing, thermometers step, the room is not logged. Read by `hours.py`; nothing of the diagnosis is used here.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from boards import HEATERS, wandering

STEP_S = 0.25
WARM = 0.2
"""Of the runs, those that begin warm."""
EXPONENT = 1.25
OPEN = 5.0
"""W/K by which a box without walls leaves its heat to the room."""


@dataclass(frozen=True)
class Board:
    """Numbers of one board: J/K, W/K, W, s, K."""

    capacity: np.ndarray
    """Of the heated end and the parts of the fin, from there on."""
    fin: float
    loss: np.ndarray
    """W at 1 K above the air, of each of those."""
    coupling: float
    power: tuple[float, float]
    sag: float
    """Of a heater's power, the part that the other one takes when it is full on."""
    lag_s: float
    air_capacity: float
    air_loss: float
    wander: float
    wander_s: float
    step_k: float
    noise_k: float
    offset_k: np.ndarray


def random_board(rng: np.random.Generator) -> Board:
    """Return a board."""
    u = rng.uniform
    return Board(
        capacity=np.array([0.45, 0.3, 0.25]) * u(3.0, 6.0),
        fin=u(0.15, 0.6),
        loss=u(0.0033, 0.007) * np.array([0.3, 0.35, 0.35]),
        coupling=u(0.001, 0.006),
        power=(u(0.8, 1.3), u(0.6, 1.1)),
        sag=u(0.05, 0.15) if rng.random() < 0.5 else 0.0,
        lag_s=u(2.0, 20.0),
        air_capacity=u(15.0, 80.0),
        air_loss=u(0.02, 0.12) if rng.random() < 0.7 else OPEN,
        wander=u(0.002, 0.015),
        wander_s=u(200.0, 1500.0),
        step_k=float(rng.choice([0.1, 0.3223, 0.5])),
        noise_k=u(0.05, 0.25),
        offset_k=rng.normal(0.0, 0.3, HEATERS),
    )


def random_steps(rng: np.random.Generator, rows: int, which: tuple[int, ...]) -> np.ndarray:
    """Return commands (rows, 2), 0 to 1: some heaters stepped at random."""
    out = np.zeros((rows, HEATERS))
    for k in which:
        at = int(rng.integers(0, 200))
        while at < rows:
            out[at:, k] = rng.choice([0.0, 0.2, 0.4, 0.5, 0.7, 0.8, 1.0])
            at += int(rng.integers(100, 500))
    return out


State = tuple[np.ndarray, np.ndarray, float]
"""Ends and fins (2, 3), thermometers (2,), air: degC."""


def simulate(
    board: Board, command: np.ndarray, room_c: np.ndarray, heat: np.ndarray, state: State | None = None
) -> tuple[np.ndarray, State]:
    """Return what exact thermometers would show, (rows, 2) of a second each, and how it ends; `heat` is a part of each power."""
    first = float(room_c[0])
    hot, seen, air = (np.full((HEATERS, 3), first), np.full(HEATERS, first), first) if state is None else state
    out = np.empty((len(command), HEATERS))
    for n, level in enumerate(command):
        out[n] = seen
        power = level * np.array(board.power) * (1.0 - board.sag * level[::-1]) * (1.0 + heat[n])
        for _ in range(round(1.0 / STEP_S)):
            over = hot - air
            lost = board.loss * np.sign(over) * np.abs(over) ** EXPONENT
            along = board.fin * -np.diff(hot, axis=1)
            across = board.coupling * (hot[0, 0] - hot[1, 0]) * np.array([1.0, -1.0])
            flow = np.column_stack([power - along[:, 0] - across, along[:, 0] - along[:, 1], along[:, 1]]) - lost
            seen = seen + STEP_S * (hot[:, 0] - seen) / board.lag_s
            hot = hot + STEP_S * flow / board.capacity
            air += STEP_S * (float(lost.sum()) - board.air_loss * (air - room_c[n])) / board.air_capacity
    return out, (hot, seen, air)


def log_of(rng: np.random.Generator, board: Board, which: tuple[int, ...]) -> tuple[dict[str, np.ndarray], np.ndarray]:
    """Return the columns of a run's log, and what a model that knows all but the wandering would show: at its rows, its thermometers'
    offsets too."""
    rows = int(rng.integers(1200, 2400))
    command = random_steps(rng, rows, which)
    room = rng.uniform(18.0, 26.0) + wandering(rng, rows, rng.uniform(0.1, 0.4), 3600.0, 1)[:, 0]
    state = None
    if rng.random() < WARM:
        before = np.tile(rng.choice([0.0, 0.5, 1.0], HEATERS), (int(rng.integers(300, 900)), 1))
        before[-int(rng.integers(30, 240)) :] = 0.0
        state = simulate(board, before, np.full(len(before), room[0]), np.zeros(before.shape))[1]
    heat = wandering(rng, rows, board.wander, board.wander_s, HEATERS)
    shown = simulate(board, command, room, heat, state)[0] + board.offset_k
    usual = simulate(board, command, np.full(rows, room.mean()), np.zeros(heat.shape), state)[0] + board.offset_k
    read = shown + rng.normal(0.0, board.noise_k, shown.shape)
    read = board.step_k * np.round(read / board.step_k)
    time_s = np.arange(rows) + rng.uniform(-0.04, 0.04, rows)
    time_s[0] = 0.0
    there = rng.random(rows) > 0.01
    for _ in range(int(rng.integers(0, 3))):
        at = int(rng.integers(100, rows - 50))
        there[at : at + int(rng.integers(3, 12))] = False
    there[:5] = True
    columns = {"time_s": time_s} | {f"u{k + 1}": command[:, k] for k in range(HEATERS)}
    columns |= {f"t{k + 1}_c": read[:, k] for k in range(HEATERS)}
    return {name: column[there] for name, column in columns.items()}, usual[there]
