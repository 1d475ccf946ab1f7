"""Every registered filter, with every option that has code of its own, keeps the contract; filters that do not fail."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import ArrayLike

from lsu_mesh import (
    LSUCZ,
    LSUO,
    LSUP,
    LSUPB,
    Filter,
    Kalman,
    LSUModel,
    Orthotope,
    OutputPrediction,
    Support,
    UnboundedSupport,
    ZonotopicKalman,
)
from lsu_mesh.filters.registry import FILTERS, filter_class
from lsu_mesh.testing import check_filter

Make = Callable[[LSUModel, Orthotope], Filter]
OPTIONS: dict[str, tuple[dict[str, Any], ...]] = {
    "LSUO": ({"hull": "lp"}, {"meet": False}),
    "LSUP": tuple({"time_update": name} for name in ("cgz", "edges", "strips")),
    "LSUCZ": ({"max_generators": 12, "max_constraints": 4, "point": "nearest"}, {"max_constraints": 0}),
    "TruncatedKalman": ({"feedback": False},),
    "WindowMAP": ({"window": 3}, {"window": 3, "objective": "log", "point": "vertex"}),
    "ZonotopicKalman": ({"order": 6}, {"order": 9, "form": "predictor"}),
}
"""Options beside the defaults."""
UNREDUCED: dict[str, dict[str, Any]] = {
    "LSUCZ": {"reduce": False},
    "ZonotopicKalman": {"reduce": False},
}
"""Sets without limits grow with every step."""
CHOICES = [(kind, options) for kind in sorted(FILTERS) for options in ({}, *OPTIONS.get(kind, ()))]
SHRUNK = 1 - 1e-4


def made_with(kind: str, options: dict[str, Any]) -> Make:
    cls: Any = filter_class(kind)
    return lambda model, prior: cls(model, prior, **options)


def names_of(choice: object) -> str:
    return ", ".join(f"{k}={v}" for k, v in choice.items()) if isinstance(choice, dict) else str(choice)


@pytest.mark.parametrize(("kind", "options"), CHOICES, ids=names_of)
def test_every_filter_keeps_the_contract(kind: str, options: dict[str, Any]) -> None:
    check_filter(made_with(kind, options), seeds=6 if kind == "WindowMAP" else 19, steps=3)


@pytest.mark.parametrize("kind", UNREDUCED)
def test_filters_without_limits_keep_the_contract(kind: str) -> None:
    check_filter(made_with(kind, UNREDUCED[kind]), seeds=19, steps=2)


@pytest.mark.soak
@pytest.mark.timeout(7200)
@pytest.mark.parametrize(("kind", "options"), CHOICES, ids=names_of)
def test_every_filter_keeps_the_contract_in_many_problems(kind: str, options: dict[str, Any]) -> None:
    check_filter(made_with(kind, options), seeds=range(1000, 3000), steps=8)


class ShrunkBox(LSUO):
    """Sets 0.01 % smaller in each update with data."""

    def update(self, y: ArrayLike, r: ArrayLike | None = None) -> Support:
        super().update(y, r)
        if not np.isnan(y).all():
            middle = self._state.mean(axis=0)
            self._state = middle + SHRUNK * (self._state - middle)
        return self.support


class ShrunkParallelotope(LSUP):
    def update(self, y: ArrayLike, r: ArrayLike | None = None) -> Support:
        super().update(y, r)
        if not np.isnan(y).all():
            self._state = np.vstack([self._state[0], SHRUNK * self._state[1:]])
        return self.support


class ShrunkBundle(LSUPB):
    """Only the parallelotope is shrunk: the bounds stay right."""

    def update(self, y: ArrayLike, r: ArrayLike | None = None) -> Support:
        super().update(y, r)
        if not np.isnan(y).all():
            n = self._state.shape[1]
            self._state = np.vstack([self._state[0], SHRUNK * self._state[1 : n + 1], self._state[n + 1 :]])
        return self.support


class ShrunkConstrainedZonotope(LSUCZ):
    def update(self, y: ArrayLike, r: ArrayLike | None = None) -> Any:
        super().update(y, r)
        if not np.isnan(y).all():
            c, G, A, b = self._held.body
            self._hold(self._held._replace(body=(c, SHRUNK * G, A, b)))
        return self.support


class ShrunkZonotope(ZonotopicKalman):
    def update(self, y: ArrayLike, r: ArrayLike | None = None) -> Any:
        super().update(y, r)
        if not np.isnan(y).all():
            self._held = self._held._replace(H=SHRUNK * self._held.H)
        return self.support


class ShrunkPrediction(LSUO):
    def predict(self, *arguments: Any, **named: Any) -> Support:
        super().predict(*arguments, **named)
        middle = self._state.mean(axis=0)
        self._state = middle + SHRUNK * (self._state - middle)
        return self.support


class ShrunkTransfer(LSUO):
    """Takes a transferred set for an independent measurement, and halves what both say."""

    def _condition(self, support: Support) -> float:
        gain = super()._condition(support)
        middle = self._state.mean(axis=0)
        self._state = middle + 0.5 * (self._state - middle)
        return gain


class WideningTransfer(LSUO):
    def _condition(self, support: Support) -> float:
        gain = super()._condition(support)
        self._state = self._state + np.array([[-1.0], [1.0]]) * np.abs(self._state).max()
        return gain


class ForgetfulOfErrors(LSUO):
    """Has written into its state before it finds that the data contradict it."""

    def update(self, y: ArrayLike, r: ArrayLike | None = None) -> Support:
        before = self._state
        self._state = self._state + np.array([[-1.0], [1.0]]) * (1.0 + np.abs(self._state).max())
        super().update(y, r)
        self._state = before
        return super().update(y, r)


class AliasedSnapshot(LSUO):
    """Writes into the array that it gave away as a snapshot."""

    def update(self, y: ArrayLike, r: ArrayLike | None = None) -> Support:
        state = self._state
        super().update(y, r)
        state[:] = self._state
        self._state = state
        return self.support


class WrongResumption(LSUO):
    def resume(self, support: Support, lower: Any, upper: Any) -> None:
        self.reset(Orthotope(np.nextafter(lower, -np.inf), upper))


class NoiselessOutput(LSUO):
    def predict_output(self) -> OutputPrediction:
        lower, upper, point = super().predict_output()
        r = np.minimum(self.model.r, 0.4 * (upper - lower))
        return OutputPrediction(lower + r, upper - r, point)


class EndlessBox(LSUO):
    """Goes on with infinite bounds where a guaranteed filter gives up."""

    def predict(self, *arguments: Any, **named: Any) -> Support:
        try:
            return super().predict(*arguments, **named)
        except UnboundedSupport:
            self._state = np.array([[-np.inf], [np.inf]]) * np.ones(self.model.state_count)
            return self.support


class WideBounds(LSUO):
    def bounds(self) -> Any:
        lower, upper = super().bounds()
        return lower - 1e-3 * np.abs(lower) - 1e-3, upper


class NoData(LSUO):
    """An update without data changes the state."""

    def update(self, y: ArrayLike, r: ArrayLike | None = None) -> Support:
        super().update(y, r)
        self._state = self._state + np.array([[-1.0], [1.0]]) * np.abs(self._state) * 1e-15
        return self.support


class UncheckedArguments(LSUO):
    def update(self, y: ArrayLike, r: ArrayLike | None = None) -> Support:
        return super().update(np.asarray(y)[: self.model.output_count], r)


class EstimateWithoutState(Kalman):
    """Promises no set, but snapshots."""

    def restore(self, snapshot: object) -> None:
        pass


BROKEN: list[tuple[type[Filter], str]] = [
    (ShrunkBox, "update: found bounds .* without the true state"),
    (ShrunkParallelotope, "update: found bounds .* without the true state"),
    (ShrunkBundle, "found a support without the true state"),
    (ShrunkConstrainedZonotope, "without the true state"),
    (ShrunkZonotope, "without the true state"),
    (ShrunkPrediction, "predict: found bounds .* without the true state"),
    (ShrunkTransfer, "condition on a .* without"),
    (WideningTransfer, "condition on a .* expected none outside of those before"),
    (ForgetfulOfErrors, "another state after an update that contradicts the set"),
    (AliasedSnapshot, r"another state after restore\(snapshot"),
    (WrongResumption, "other sets after resume"),
    (NoiselessOutput, "predict_output of y"),
    (EndlessBox, "finite"),
    (WideBounds, "bounds wider than those of the support"),
    (NoData, "another state after an update with all outputs missing"),
    (UncheckedArguments, "no error at update with one output too many"),
    (EstimateWithoutState, r"another state after restore\(snapshot"),
]


@pytest.mark.parametrize(("cls", "message"), BROKEN, ids=[cls.__name__ for cls, _ in BROKEN])
def test_a_filter_that_breaks_a_promise_is_caught(cls: Any, message: str) -> None:
    with pytest.raises(AssertionError, match=message) as caught:
        check_filter(cls, seeds=19, steps=3)
    assert str(caught.value).startswith(f"{cls.__name__}, ")
    assert "expected" in str(caught.value)


def test_a_filter_that_states_no_guarantee_cannot_be_written() -> None:
    def write() -> type[Filter]:
        class Unsure(Filter):
            kind = "Unsure"
            model = support = point = None  # type: ignore[assignment]
            predict_output = update = predict = condition = reset = snapshot = restore = None  # type: ignore[assignment]

        return Unsure

    with pytest.raises(TypeError, match=r'Unsure states no guarantee; write in its class `guarantee = "declared"`'):
        write()


def test_a_guarantee_that_does_not_exist_is_named() -> None:
    with pytest.raises(TypeError, match="states the guarantee 'surely'"):
        type("Sure", (LSUO,), {"guarantee": "surely"})


def test_every_class_says_what_it_promises() -> None:
    found = {kind: filter_class(kind).guarantee for kind in FILTERS}
    estimates = {"Kalman", "TruncatedKalman", "WindowMAP"}
    assert found == {kind: "none" if kind in estimates else "declared" for kind in FILTERS}
