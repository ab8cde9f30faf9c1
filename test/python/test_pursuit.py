"""Of causes that there are to choose from, the one that explains most is taken, for a while or all the time, beside what is out by now."""

from __future__ import annotations

import numpy as np
import pytest
from ninespring.find.causes import Cause
from ninespring.find.pursuit import Pursuit

ROWS, EDGES = 60, (0, 10, 20, 30, 40, 50)
STEPS = (np.arange(ROWS)[:, None] >= np.array(EDGES)).astype(np.float32)
RAMP = np.linspace(-1.0, 1.0, ROWS, dtype=np.float32)[:, None]
NOTHING = np.zeros((ROWS, 0), dtype=np.float32)
HEAT = Cause("heat", "a", (), STEPS, (*EDGES, ROWS))
DRIFT = Cause("trend", "b", (), RAMP)


def window(begin: int, end: int) -> np.ndarray:
    return ((np.arange(ROWS) >= begin) & (np.arange(ROWS) < end)).astype(np.float32)


@pytest.mark.parametrize(("begin", "end", "edges"), [(10, 40, (1, 4)), (30, 60, (3, 6)), (0, 20, (0, 2))])
def test_a_window_is_found_by_its_edges_whatever_its_sign(begin: int, end: int, edges: tuple[int, int]) -> None:
    for size in (3.0, -3.0):
        found = Pursuit([DRIFT, HEAT], NOTHING, 2).best(size * window(begin, end))
        assert found.cause is HEAT and (found.edges, found.rows) == (edges, (begin, end))
        assert found.drop == pytest.approx(9.0 * (end - begin)) and np.array_equal(found.vector, window(begin, end))


def test_what_is_there_all_the_time_has_no_edges() -> None:
    found = Pursuit([HEAT, DRIFT], NOTHING, 2).best(2.0 * RAMP[:, 0])
    assert found.cause is DRIFT and found.rows == (0, None)


def test_a_window_is_no_shorter_and_no_nearer_to_all_of_a_run_than_it_may_be() -> None:
    begin, end = Pursuit([HEAT], NOTHING, 2).best(window(20, 30)).edges
    assert end - begin == 2
    assert Pursuit([HEAT], NOTHING, 1).best(window(20, 30)).edges == (2, 3)
    assert Pursuit([HEAT], NOTHING, 2).best(window(0, 60)).edges == (0, 6)
    begin, end = Pursuit([HEAT], NOTHING, 2).best(window(0, 60), rests=2).edges
    assert end - begin == 4


def test_a_size_has_the_sign_that_its_kind_has() -> None:
    for left, found in ((window(10, 40), None), (-window(10, 40), HEAT)):
        best = Pursuit([HEAT], NOTHING, 2, {"heat": -1}).best(left)
        assert (best and best.cause) is found
    for size, drop in ((1.0, 0.0), (-1.0, float((RAMP**2).sum()))):
        assert Pursuit([DRIFT], NOTHING, 2, {"trend": -1}).best(size * RAMP[:, 0]).drop == pytest.approx(drop)


def test_what_is_taken_out_or_left_aside_explains_nothing_more() -> None:
    left = window(10, 40) + 0.1 * RAMP[:, 0]
    among = Pursuit([HEAT, DRIFT], NOTHING, 2)
    assert among.best(left, lambda one: one is HEAT).cause is DRIFT
    assert among.best(RAMP[:, 0], lambda one: one is DRIFT).cause is HEAT
    unit = window(10, 40)[:, None] / np.sqrt(30.0, dtype=np.float32)
    among.take(unit)
    after, anew = (one.best(left) for one in (among, Pursuit([HEAT, DRIFT], unit, 2)))
    assert (after.edges, after.drop) == (anew.edges, pytest.approx(anew.drop)) and after.edges != (1, 4)
    alone = Pursuit([DRIFT], NOTHING, 2)
    alone.take(RAMP / np.linalg.norm(RAMP))
    assert alone.gains(left)[0] == 0.0
    both = np.column_stack([unit, RAMP / np.linalg.norm(RAMP)])
    loud = Pursuit([Cause("heat", "a", (), 1e3 * STEPS, (*EDGES, ROWS)), DRIFT], both, 2)
    assert loud.gains(left)[0] == 0.0 and loud.best(left).edges != (1, 4), "what rounding leaves of it"
