"""Every row is delivered or counted, and a file of which nothing can be played names the likely mistake."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from data_file_settings import ReadText
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from lsu_mesh.mesh.data_files.account import account, place
from lsu_mesh.mesh.grid import Grid

NS = 10**9
EPOCH = 1_600_120_070
HALF_SECONDS = Grid(100 * NS, Fraction(1, 2))
reusing = settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
LEFT_OUT = (
    "1 before start_time, 1 after the last step of the run, "
    "1 share a step with an earlier row (a smaller dt keeps them), 1 blank"
)
GAUGE = "t,y\n100.5,1.0\n101.02,\n102.5,1.5\n102.6,7\n99,3\n,\n200,1\n"


def test_an_account_in_words(read_text: ReadText) -> None:
    found = account(read_text(GAUGE), HALF_SECONDS, 100)
    path = found.path
    assert found.lines() == [
        f"{path}: 7 rows, 99 s to 200 s (1.683 min); period 1.48 s (from 100 ms to 1.623 min)",
        "  played: 3 rows on 3 steps, 1 to 5, 2 of them without a row; 1 value missing",
        "  farthest from the grid: 20 ms; 1 row off the grid",
        f"  left out: {LEFT_OUT}",
        "  order: 1 row after a later one (sorted), 0 at the same moment as another",
    ]
    assert found.warnings() == [
        f"{path}: 4 of 7 rows are left out: {LEFT_OUT}",
        f"{path}: rows lie off the grid (1, by up to 20 ms) and are taken as measured at their step",
    ]
    assert found.error is None


def test_an_account_of_steps(read_text: ReadText) -> None:
    found = account(read_text("step,y\n1,1\n2,2\n4,\n4,5\n", index="step"), HALF_SECONDS)
    assert found.lines()[:3] == [
        f"{found.path}: 4 rows, steps 1 to 4; every 1 step (from 1 to 2)",
        "  played: 3 rows on 3 steps, 1 to 4, 1 of them without a row; 1 value missing",
        "  left out: 1 share a step with an earlier row (a smaller dt keeps them)",
    ]


def test_with_times_of_their_own_rows_share_a_step_and_stay(read_text: ReadText) -> None:
    data = read_text("t,y\n100.30,1\n100.40,2\n100.51,3\n")
    placed = place(data, HALF_SECONDS, nearest=False)
    assert placed.steps.tolist() == [1, 1, 2]
    assert placed.is_delivered.all()
    tolerant = place(data, HALF_SECONDS, nearest=False, tolerance_ns=NS // 100)
    assert tolerant.steps.tolist() == [1, 1, 1], "a row within the tolerance of t_1 is of step 1"
    found = account(data, HALF_SECONDS, nearest=False)
    assert (found.delivered, found.sharing, found.left_out, found.off_grid) == (3, 1, 0, 3)
    assert found.warnings() == []


moments = st.integers(-50, 400).map(lambda hundredths: f"{100 + hundredths / 100:.2f}")
values = st.sampled_from(["1", "-2.5", "", "nan"])
tables = st.lists(st.tuples(moments, values), min_size=1, max_size=30)


@reusing
@given(rows=tables, dt=st.sampled_from([Fraction(1, 2), Fraction(1, 30), Fraction(1, 50), Fraction(2)]),
       last=st.one_of(st.none(), st.integers(1, 40)), nearest=st.booleans())  # fmt: skip
def test_every_row_is_delivered_or_counted(
    read_text: ReadText, rows: list[tuple[str, str]], dt: Fraction, last: int | None, nearest: bool
) -> None:
    data = read_text("t,y\n" + "".join(f"{t},{y}\n" for t, y in rows))
    grid = Grid(100 * NS, dt)
    placed, found = place(data, grid, last, nearest=nearest), account(data, grid, last, nearest=nearest, tolerance_ns=0)
    left_out = found.before + found.after + (found.sharing if nearest else 0) + found.blank
    assert found.delivered + left_out == found.rows == len(rows)
    assert (found.error is None) == bool(found.delivered)
    assert data.time_ns is not None
    taken: set[int] = set()
    for t, k, delivered in zip(data.time_ns.tolist(), placed.steps.tolist(), placed.is_delivered.tolist(), strict=True):
        assert k == (grid.nearest_step(t) if nearest else grid.step_of(t))
        inside = k >= 1 and (last is None or k <= last)
        assert delivered == (inside and not (nearest and k in taken))
        taken |= {k} if inside else set()
    assert found.steps_used == len(taken)


@reusing
@given(rows=st.lists(st.tuples(st.integers(-3, 30), values), min_size=1), last=st.one_of(st.none(), st.integers(1, 20)))
def test_every_row_by_step_is_delivered_or_counted(
    read_text: ReadText, rows: list[tuple[int, str]], last: int | None
) -> None:
    data = read_text("step,y\n" + "".join(f"{k},{y}\n" for k, y in rows), index="step")
    found = account(data, HALF_SECONDS, last)
    inside = [k for k, _ in rows if 1 <= k <= (last or 99)]
    assert found.delivered == len(set(inside))
    assert found.sharing == len(inside) - len(set(inside))
    assert found.before + found.after == len(rows) - len(inside)
    assert (found.error is None) == bool(inside)


FROM_1970 = (
    "no row is played: its times count from 1970, start_time does not; the first row would be step 1 with "
    "start_time = 2020-09-14T21:47:50Z"
)
NOT_FROM_1970 = (
    "no row is played: start_time counts from 1970, its times do not (its rows are from 5 s to 6 s); "
    "the first row would be step 1 with start_time = 4.5"
)
TOO_LATE = (
    "no row is played: start_time = 10 s is after all rows; its rows are from 5 s to 6 s; "
    "the first row would be step 1 with start_time = 4.5"
)
TOO_SHORT = (
    "no row is played: its rows are from 50 s to 60.5 s, after the last step 20 at 20 s; "
    "the first row would be step 1 with start_time = 49.5, or take more steps"
)


@pytest.mark.parametrize(
    ("text", "start", "last", "words"),
    [
        ("t,y\n1600120070.5,1\n", 0, None, FROM_1970),
        ("t,y\n1600120070500,1\n", 0, 100, FROM_1970),
        ("t,y\n5,1\n6,1\n", EPOCH, None, NOT_FROM_1970),
        ("t,y\n5,1\n6,1\n", 10, None, TOO_LATE),
        ("t,y\n50,1\n60.5,1\n", 10, 20, TOO_SHORT),
    ],
)
def test_nothing_playable_is_an_error_that_says_what_to_write(
    read_text: ReadText, text: str, start: int, last: int | None, words: str
) -> None:
    found = account(read_text(text), Grid(start * NS, Fraction(1, 2)), last)
    assert found.error == words


def test_steps_that_no_run_reaches_are_an_error(read_text: ReadText) -> None:
    zero = account(read_text("step,y\n0,1\n-1,1\n", index="step"), HALF_SECONDS)
    assert zero.error == ("no row is played: its steps are -1 to 0, and the first step of a run is 1; count from 1")
    late = account(read_text("step,y\n30,1\n40,1\n", index="step"), HALF_SECONDS, 20)
    assert late.error == "no row is played: its steps are 30 to 40, and the run ends at step 20; take more steps"


def test_a_first_row_far_inside_the_run_is_a_doubt(read_text: ReadText) -> None:
    found = account(read_text("t,y\n5000,1\n5000.5,1\n"), HALF_SECONDS)
    assert found.warnings() == [f"{found.path}: the first row is step 9800; start_time = 4999.5 makes it step 1"]


def test_a_period_of_a_thousand_steps_looks_like_milliseconds(read_text: ReadText) -> None:
    text = "t,y\n" + "".join(f"{500 * i},1\n" for i in range(1, 9))
    found = account(read_text(text), Grid(0, Fraction(1, 2)))
    assert found.doubts == ('the period 8.333 min is 1000 times dt; are the times in ms? Then say time_unit = "ms"',)
    assert account(read_text(text, time_unit="ms"), Grid(0, Fraction(1, 2))).doubts == ()


def test_the_largest_distance_is_that_of_the_rows_that_are_played(read_text: ReadText) -> None:
    data = read_text("t,y\n100.5,1\n101.2,1\n77.777,1\n")
    found = account(data, HALF_SECONDS)
    assert found.largest_distance_ns == NS // 5
    distances = HALF_SECONDS.distances(data.time_ns if data.time_ns is not None else np.zeros(0, dtype=np.int64))
    assert found.largest_distance_ns < distances.max()
