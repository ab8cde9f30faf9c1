"""A third world: boards of two heaters in a box, hours at 1 Hz, written apart from the model that explains them.

Explicit Euler at a tenth of a second of five stores of heat (two heaters, two thermometers, the air of the box) and of two
wandering heat flows. Thermometers step by half a kelvin and now and then show nonsense; the room is not logged. Read by
`hours.py`; nothing of the diagnosis is used here.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

STEP_S = 0.1
HEATERS = 2
HOUR_S = 3600.0


@dataclass(frozen=True)
class Board:
    """Numbers of one board: J/K, W/K, W, s, K."""

    capacity: float = 2.2
    loss: float = 0.011
    coupling: float = 0.004
    power: tuple[float, float] = (1.0, 0.75)
    lag_s: float = 15.0
    box_s: float = HOUR_S
    """Time constant of the box; 0: there is none, the heaters stand in the room."""
    box_capacity: float = 60.0
    wander: float = 0.005
    """Of the usual heat: how far a heat flow wanders, rms ..."""
    wander_s: float = HOUR_S
    """... and how long it remembers."""
    flicker: float = 0.0
    """Of the usual heat, in white noise over a second."""
    step_k: float = 0.5
    spikes: float = 5e-4
    """Of the rows, those in which a thermometer shows nonsense."""


def random_board(rng: np.random.Generator, wander: float = 0.005) -> Board:
    """Return a board with a box and a lag."""
    u = rng.uniform
    return Board(
        capacity=u(1.6, 3.0),
        loss=u(0.008, 0.016),
        coupling=u(0.002, 0.006),
        power=(u(0.8, 1.2), u(0.6, 0.9)),
        lag_s=u(5.0, 30.0),
        box_s=HOUR_S * u(0.7, 1.3),
        box_capacity=u(40.0, 90.0),
        wander=wander,
        flicker=u(0.5, 2.0) * wander,
    )


def random_steps(rng: np.random.Generator, rows: int, which: tuple[int, ...]) -> np.ndarray:
    """Return commands (rows, 2), 0..1: some heaters stepped at random, at rest for the first minute."""
    out = np.zeros((rows, HEATERS))
    for k in which:
        at = int(rng.integers(30, 90))
        while at < rows:
            hold = int(rng.integers(120, 600))
            out[at : at + hold, k] = rng.choice([0.0, 0.2, 0.4, 0.6, 0.8, 1.0])
            at += hold
    return out


def wandering(rng: np.random.Generator, rows: int, size: float, lasts_s: float, columns: int) -> np.ndarray:
    """Return what wanders about zero and remembers, (rows, columns) of a second each; `size` is its rms."""
    keep = np.exp(-1.0 / lasts_s)
    out = np.empty((rows, columns))
    now = rng.normal(0.0, size, columns)
    for n in range(rows):
        now = keep * now + np.sqrt(1.0 - keep**2) * rng.normal(0.0, size, columns)
        out[n] = now
    return out


def _walk(rng: np.random.Generator, steps: int, board: Board) -> np.ndarray:
    """Return two heat flows (steps, 2) about zero, in parts of the usual heat: each wanders, remembers, and flickers."""
    seconds = -(-steps // round(1.0 / STEP_S))
    slow = wandering(rng, seconds, board.wander, board.wander_s, HEATERS)
    slow += rng.normal(0.0, board.flicker, slow.shape)
    return np.repeat(slow, round(1.0 / STEP_S), axis=0)[:steps]


def simulate(board: Board, command: np.ndarray, room_c: float, walk: np.ndarray | None = None) -> np.ndarray:
    """Return what the thermometers would show without steps or nonsense, (rows, 2), degC, at 1 Hz."""
    rows, each = len(command), round(1.0 / STEP_S)
    heater, lagging, box = np.full(HEATERS, room_c), np.full(HEATERS, room_c), room_c
    usual = 0.5 * np.asarray(board.power)
    out = np.empty((rows, HEATERS))
    out_w_per_k = board.box_capacity / board.box_s if board.box_s else 0.0
    for n in range(rows):
        out[n] = lagging
        given = command[n] * board.power
        for s in range(each):
            heat = given if walk is None else given + walk[n * each + s] * usual
            around = box if board.box_s else room_c
            lost = board.loss * (heater - around)
            across = board.coupling * (heater - heater[::-1])
            lagging = lagging + STEP_S * (heater - lagging) / board.lag_s if board.lag_s else heater
            heater = heater + STEP_S * (heat - lost - across) / board.capacity
            if board.box_s:
                box += STEP_S * (lost.sum() - out_w_per_k * (box - room_c)) / board.box_capacity
    return out


def as_logged(rng: np.random.Generator, board: Board, shown: np.ndarray) -> np.ndarray:
    """Return readings: with a little noise, in steps, and now and then nonsense."""
    read = shown + rng.normal(0.0, 0.25 * board.step_k, shown.shape)
    read = board.step_k * np.round(read / board.step_k)
    nonsense = rng.random(read.shape) < board.spikes
    nonsense[0] = False
    return np.where(nonsense, rng.choice([-32.0, 0.0, 120.0], read.shape), read)


def log_of(
    rng: np.random.Generator, board: Board, command: np.ndarray, room_c: float
) -> tuple[dict[str, np.ndarray], np.ndarray]:
    """Return the columns of one log, and what the board without wandering heat would show."""
    walk = _walk(rng, len(command) * round(1.0 / STEP_S), board)
    read = as_logged(rng, board, simulate(board, command, room_c, walk))
    columns = {f"u{k + 1}": command[:, k] for k in range(HEATERS)}
    return columns | {f"t{k + 1}_c": read[:, k] for k in range(HEATERS)}, simulate(board, command, room_c)
