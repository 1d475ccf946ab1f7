"""The same set again changes no bit: memory of the last set met, sweeps that settle, boxes beside densities."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from lsu_mesh import (
    LSUCZ,
    LSUO,
    LSUP,
    LSUPB,
    ConstrainedZonotope,
    Filter,
    Intersection,
    Kalman,
    LSUModel,
    Orthotope,
    Parallelotope,
    Support,
    TruncatedKalman,
    Zonotope,
    ZonotopicKalman,
    simulate,
    systems,
)
from lsu_mesh.filters.last_met import holds, is_same
from lsu_mesh.filters.registry import FILTERS, filter_class
from lsu_mesh.filters.transfer_gain import SETTLED
from lsu_mesh.testing import check_filter
from lsu_mesh.testing.filter_state import state_of

COPIES = 6
SMALL: dict[str, dict[str, Any]] = {
    "LSUCZ": {"max_generators": 8, "max_constraints": 2},
    "ZonotopicKalman": {"order": 6},
    "WindowMAP": {"window": 3},
}
SHAPES: dict[str, Callable[[np.ndarray, np.ndarray], Support]] = {
    "box": lambda c, T: Orthotope(c - 0.5 * np.abs(T).sum(axis=1), c + 0.6 * np.abs(T).sum(axis=1)),
    "parallelotope": Parallelotope,
    "zonotope": lambda c, T: Zonotope(c, np.hstack([0.6 * T, 0.2 * T[:, ::-1]])),
    "constrained zonotope": lambda c, T: ConstrainedZonotope(
        c, np.hstack([T, 0.5 * T]), [[1.0, 0, 0, 1.0, 0, 0]], [0.1]
    ),
    "intersection": lambda c, T: Intersection([Parallelotope(c, T), Orthotope(c - 0.3, c + 0.3)]),
}


def prepared(kind: str, seed: int) -> tuple[Filter, np.ndarray, np.random.Generator]:
    """A filter at a prediction on P3, and the true state."""
    model = systems.get("P3").replace(domain=([-20.0] * 3, [20.0] * 3))
    filter = filter_class(kind)(model, Orthotope([-2.0] * 3, [2.0] * 3), **SMALL.get(kind, {}))  # type: ignore[call-arg]
    data = simulate(model, 6, seed, x1=[1.0, 0.5, -0.5])
    for k in range(5):
        filter.update(data.Y[k])
        filter.predict(data.U[k])
    return filter, data.X[5], np.random.default_rng(seed)


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("kind", sorted(FILTERS))
def test_the_same_set_six_times_changes_nothing_after_the_first(kind: str, shape: str) -> None:
    did_change = False
    for seed in range(8):
        filter, x, rng = prepared(kind, seed)
        other = SHAPES[shape](x, rng.uniform(-0.4, 0.4, (3, 3)))
        before = state_of(filter)
        filter.condition(other)
        first, held = state_of(filter), filter.snapshot()
        did_change |= first != before
        for _ in range(COPIES - 1):
            assert filter.condition(other) == 0.0
            assert state_of(filter) == first
        filter.predict([0.1])
        filter.restore(held)
        filter.condition(other)
        assert state_of(filter) == first, "the memory is part of the snapshot"
    assert did_change


@pytest.mark.parametrize("kind", ["LSUO", "LSUP", "LSUPB", "LSUCZ", "ZonotopicKalman"])
def test_a_set_that_holds_the_last_one_met_changes_nothing(kind: str) -> None:
    filter, x, rng = prepared(kind, 1)
    T = rng.uniform(-0.4, 0.4, (3, 3))
    filter.condition(Parallelotope(x, T))
    first = state_of(filter)
    filter.condition(Parallelotope(x, 1.01 * T))
    filter.condition(Orthotope(x - 1.3, x + 1.3))
    assert state_of(filter) == first


@pytest.mark.parametrize("kind", ["LSUO", "LSUP", "LSUPB", "LSUCZ", "ZonotopicKalman"])
@pytest.mark.parametrize("action", ["update", "predict", "reset", "another set"])
def test_what_changes_the_set_ends_the_memory(kind: str, action: str) -> None:
    filter, x, rng = prepared(kind, 2)
    other = Parallelotope(x, rng.uniform(-0.4, 0.4, (3, 3)))
    filter.condition(other)
    assert filter.last_met is other
    if action == "update":
        filter.update(filter.model.C @ x, [0.05, 0.05])
    elif action == "predict":
        filter.predict([0.0])
    elif action == "reset":
        filter.reset(Orthotope(x - 1.0, x + 1.0))
    else:
        filter.condition(Orthotope(x - 0.1, x + 0.1))
    assert filter.last_met is not other


@pytest.mark.parametrize("kind", ["LSUO", "LSUP", "LSUPB", "LSUCZ", "ZonotopicKalman"])
def test_a_time_update_of_a_state_at_rest_ends_the_memory_too(kind: str) -> None:
    """Its set may be the same, bit by bit, and a replay that starts from there knows no set that was met."""
    model = LSUModel(np.eye(2), None, [[1.0, 0.0]], 0.0, 0.1)
    filter: Filter = filter_class(kind)(model, Orthotope([-1.0, -1.0], [1.0, 1.0]))  # type: ignore[call-arg]
    other = Orthotope([-0.5, -0.5], [0.5, 0.5])
    filter.condition(other)
    filter.predict()
    assert filter.last_met is None
    filter.condition(other)
    filter.resume(filter.support, *filter.bounds())
    assert filter.last_met is None


def test_an_update_without_data_leaves_the_memory() -> None:
    for kind in ("LSUO", "LSUP", "LSUPB", "LSUCZ", "ZonotopicKalman"):
        filter, x, rng = prepared(kind, 3)
        other = Parallelotope(x, rng.uniform(-0.4, 0.4, (3, 3)))
        filter.condition(other)
        filter.update([np.nan, np.nan])
        assert filter.last_met is other


@pytest.mark.parametrize("kind", [LSUO, LSUPB, LSUP])
def test_faces_are_met_until_a_sweep_gains_no_more(kind: Any) -> None:
    """A filter without memory, which goes through the faces once more, gains next to nothing."""
    gained = []
    for seed in range(20):
        rng = np.random.default_rng(seed)
        model = LSUModel(np.eye(2), None, [[1.0, 1.0]], 0.1, 0.1)
        other = Parallelotope(rng.uniform(-0.3, 0.3, 2), rng.normal(size=(2, 2)))
        filter = kind(model, Orthotope([-1.0, -1.0], [1.0, 1.0]))
        filter.condition(other)
        filter.skips_met = False
        gained.append(filter.condition(other, gain=None))
    assert np.mean(np.array(gained) < SETTLED) >= 0.8, "four sweeps settle most"
    assert max(gained) < 0.02


def test_the_same_box_narrows_no_band_of_a_density() -> None:
    """Taken as six measurements the same box narrowed a band of 1.55 to .69."""
    model = LSUModel([[1.0]], None, [[1.0]], 0.1, 0.5)
    for filter in (
        Kalman(model, Orthotope([-1.0], [1.0])),
        TruncatedKalman(model.replace(domain=([-9.0], [9.0])), Orthotope([-1.0], [1.0])),
    ):
        filter.update([0.2])
        covariance, box = filter.covariance, Orthotope([-0.4], [0.5])
        for _ in range(COPIES):
            filter.condition(box)
            assert [side.tolist() for side in filter.bounds()] == [[-0.4], [0.5]]
        np.testing.assert_array_equal(filter.covariance, covariance)
        filter.predict()
        lower, upper = filter.bounds()
        assert (lower[0], upper[0]) == pytest.approx((-0.5, 0.6), abs=1e-12), "interval arithmetic carries the box on"
        assert filter.bounds()[0] <= filter.point <= filter.bounds()[1]


def test_a_density_far_from_what_was_transferred_is_told_at_its_nearest_face() -> None:
    filter = Kalman(LSUModel([[1.0]], None, [[1.0]], 0.01, 0.1), Orthotope([-1.0], [1.0]))
    filter.condition(Orthotope([0.0], [0.5]))
    for _ in range(8):
        filter.update([2.0])
    lower, upper = filter.bounds()
    assert (lower, upper, filter.point) == (0.5, 0.5, 0.5)
    band = filter.predict_output()
    assert band.lower <= band.point <= band.upper == pytest.approx(0.6)


def test_what_holds_what() -> None:
    square, wide = Orthotope([-1.0, -1.0], [1.0, 1.0]), Orthotope([-2.0, -1.0], [1.0, 1.0])
    diamond = Parallelotope([0.0, 0.0], [[0.49, 0.49], [-0.49, 0.49]])
    around = Parallelotope([0.0, 0.0], [[1.01, 1.01], [-1.01, 1.01]])
    small = ConstrainedZonotope([0.0, 0.0], [[0.2, 0.1, 0.0], [0.0, 0.1, 0.2]], [[1.0, 1.0, 1.0]], [0.0])
    true = [(wide, square), (square, diamond), (around, square), (around, diamond), (diamond, small), (square, small)]
    for outer, inner in true:
        assert holds(outer, inner)
        assert not holds(inner, outer)
    both = Intersection([square, around])
    assert holds(both, diamond)
    assert holds(wide, both), "one of its parts is held"
    assert not holds(both, wide)
    zonotope = Zonotope([0.0, 0.0], [[1.0, 0.5, 0.2], [0.0, 0.5, 0.1]])
    assert not holds(zonotope, small), "not found out"
    assert is_same(zonotope, Zonotope([0.0, 0.0], [[1.0, 0.5, 0.2], [0.0, 0.5, 0.1]]))
    assert not is_same(zonotope, Zonotope([0.0, 0.0], [[1.0, 0.5, 0.2], [0.0, 0.5, 0.1 + 2e-17]]))
    assert not is_same(square, Zonotope([0.0, 0.0], np.eye(2)))


class ForgetsWhatItMet(LSUPB):
    """Goes through a set again that it has just met, and through its strips once."""

    skips_met = False


class ForgetsAtSnapshots(LSUCZ):
    def restore(self, snapshot: Any) -> None:
        super().restore(snapshot._replace(met=None))


class SecondMeasurement(Kalman):
    """Takes a transferred box for a measurement."""

    def condition(self, support: Support, gain: Any = "support") -> float:
        found = super().condition(support, gain)
        self._held = self._held._replace(covariance=0.5 * self._held.covariance)
        return found


@pytest.mark.parametrize(
    ("cls", "message"),
    [
        (ForgetsWhatItMet, "another state after the same set transferred 2 times in a row"),
        (ForgetsAtSnapshots, "the same set transferred once more"),
        (SecondMeasurement, "another state after the same set transferred 2 times in a row"),
    ],
)
def test_the_contract_catches_a_filter_that_a_copy_changes(cls: Any, message: str) -> None:
    with pytest.raises(AssertionError, match=message):
        check_filter(cls, seeds=57, steps=4)


def test_a_larger_zonotopic_filter_stays_as_it_is_too() -> None:
    rng = np.random.default_rng(4)
    model = LSUModel(0.5 * rng.normal(size=(6, 6)) / 6, None, rng.normal(size=(2, 6)), 0.1, 0.1)
    filter = ZonotopicKalman(model, Orthotope([-1.0] * 6, [1.0] * 6), form="predictor")
    filter.update([0.0, 0.1])
    other = Orthotope([-0.6] * 6, [0.8] * 6)
    filter.condition(other)
    first = state_of(filter)
    filter.condition(other)
    assert state_of(filter) == first
