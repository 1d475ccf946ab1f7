"""LSUCZ and ZonotopicKalman: a run and a bank have the bits of single steps, and single steps those of their parts."""

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
    FilterBank,
    InconsistentData,
    ModelError,
    Orthotope,
    run_filter,
    simulate,
    systems,
)
from lsu_mesh.filters import compiled_sets
from lsu_mesh.filters.zonotopic_kalman import ZonotopicKalman

PRIOR = Orthotope([-1.0] * 3, [1.0] * 3)
P3 = systems.get("P3")
WIDE, NARROW = P3.replace(domain=([-6.0] * 3, [6.0] * 3)), P3.replace(domain=([-1.2] * 3, [1.2] * 3))
MAKE: dict[str, Callable[[Any], Any]] = {
    "LSUCZ": lambda model: LSUCZ(model, PRIOR, 12, 4, point="centre"),
    "LSUCZ without limit of constraints": lambda model: LSUCZ(model, PRIOR, 14, None, point="centre"),
    "LSUCZ mean": lambda model: LSUCZ(model, PRIOR),
    "ZonotopicKalman": lambda model: ZonotopicKalman(model, PRIOR, order=8, point="centre"),
    "ZonotopicKalman without box": lambda model: ZonotopicKalman(model, PRIOR, box=False, scaled=False),
}
KINDS: dict[str, tuple[Any, dict[str, Any]]] = {
    "LSUO": (LSUO, {}),
    "LSUP": (LSUP, {}),
    "LSUPB": (LSUPB, {}),
    "LSUCZ": (LSUCZ, {"max_generators": 10, "max_constraints": 4, "point": "centre"}),
    "LSUCZ mean": (LSUCZ, {"max_generators": 10, "max_constraints": 4}),
    "ZonotopicKalman": (ZonotopicKalman, {"point": "centre"}),
    "ZonotopicKalman mean": (ZonotopicKalman, {}),
}


def _data(model: Any, steps: int = 25, seed: int = 4) -> tuple[np.ndarray, np.ndarray]:
    made = simulate(model, steps, seed=seed)
    Y = made.Y.copy()
    Y[5] = np.nan
    Y[9, 1] = np.nan
    Y[12:14] = np.nan
    return Y, made.U


def _arrays(filter: Any) -> list[np.ndarray]:
    body = filter.support
    arrays = body.arrays if hasattr(body, "arrays") else (body.center, body.generators)
    return [np.array(array) for array in arrays]


@pytest.mark.parametrize("model", [P3, WIDE, NARROW], ids=["no domain", "wide", "narrow"])
@pytest.mark.parametrize("make", MAKE.values(), ids=MAKE.keys())
def test_compiled_steps_have_the_bits_of_their_parts(
    make: Callable[[Any], Any], model: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where compiled code tells nothing, the parts of a step are called one by one."""
    Y, U = _data(model)
    whole = make(model)
    found = []
    for y, u in zip(Y, U, strict=True):
        interval = whole.predict_output()
        whole.update(y)
        found.append([interval.lower, interval.upper, interval.point, *whole.bounds(), whole.point, *_arrays(whole)])
        whole.predict(u)
    monkeypatch.setattr(compiled_sets.CompiledSets, "_stepped", lambda *_, **__: None)
    monkeypatch.setattr(compiled_sets.CompiledSets, "_output", lambda *_, **__: None)
    parts = make(model)
    for y, u, row in zip(Y, U, found, strict=True):
        interval = parts.predict_output()
        parts.update(y)
        expected = [interval.lower, interval.upper, interval.point, *parts.bounds(), parts.point, *_arrays(parts)]
        for one, other in zip(row, expected, strict=True):
            np.testing.assert_array_equal(one, other)
        parts.predict(u)


@pytest.mark.parametrize("points", [True, False])
@pytest.mark.parametrize("make", MAKE.values(), ids=MAKE.keys())
def test_a_run_has_the_bits_of_its_steps(make: Callable[[Any], Any], points: bool) -> None:
    Y, U = _data(NARROW)
    whole, stepped = make(NARROW), make(NARROW)
    assert whole.has_compiled_loop
    run = run_filter(whole, Y, U, points=points)
    assert run.status.count("missing") == 3
    for k, y in enumerate(Y):
        interval = stepped.predict_output()
        np.testing.assert_array_equal((interval.lower, interval.upper), (run.y_lower[k], run.y_upper[k]))
        stepped.update(y)
        np.testing.assert_array_equal(stepped.bounds(), (run.lower[k], run.upper[k]))
        assert stepped.volume() == run.volumes[k]
        if points:
            np.testing.assert_array_equal(interval.point, run.y_points[k])
            np.testing.assert_array_equal(stepped.point, run.points[k])
        if k + 1 < len(Y):
            stepped.predict(U[k])
    np.testing.assert_array_equal(whole.point, stepped.point)
    for one, other in zip(_arrays(whole), _arrays(stepped), strict=True):
        np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize("own_models", [False, True])
@pytest.mark.parametrize("threads", [1, 2])
@pytest.mark.parametrize(("kind", "options"), KINDS.values(), ids=KINDS.keys())
def test_a_bank_has_the_bits_of_single_filters(
    kind: Any, options: dict[str, Any], threads: int, own_models: bool
) -> None:
    """With inputs of their own, missing data, and models of their own or one for all."""
    count, steps = 5, 8
    random = np.random.default_rng(0)
    models = [WIDE.replace(rho=WIDE.rho * random.uniform(0.5, 1.0)) for _ in range(count)]
    used = models if own_models else [WIDE] * count
    runs = [simulate(model, steps, seed=seed) for seed, model in enumerate(models)]
    Y, U = np.array([run.Y for run in runs]), np.array([run.U for run in runs])
    Y[1, 3], Y[2, 4, 0], Y[3, :2] = np.nan, np.nan, np.nan
    Y[4, 6] += 50.0
    priors = [PRIOR] * (count - 1) + [Orthotope([-1.5] * 3, [1.0] * 3)]
    bank = FilterBank(kind, models if own_models else WIDE, priors, threads=threads, **options)
    record, done = bank.run(Y, U)
    assert done.tolist() == [steps] * 4 + [6]
    stepped = FilterBank(kind, models if own_models else WIDE, priors, threads=threads, **options)
    for k in range(steps):
        accepted = stepped.update(Y[:, k])
        assert accepted.tolist() == [True] * 4 + [k != 6]
        if k + 1 < steps:
            assert stepped.predict(U[:, k]).all()
    for i in range(count):
        single = kind(used[i], priors[i], **options)
        rows = 6 if i == 4 else steps
        run = run_filter(single, Y[i, :rows], U[i, :rows])
        for name in ("lower", "upper", "points", "y_lower", "y_upper", "y_points"):
            np.testing.assert_array_equal(getattr(record, name)[i, :rows], getattr(run, name))
            assert np.isnan(getattr(record, name)[i, rows + 1 :]).all()
        if i < 4:
            np.testing.assert_array_equal(single.point, bank.points[i])
            np.testing.assert_array_equal(single.bounds(), [side[i] for side in bank.bounds()])
            np.testing.assert_array_equal(single.bounds(), [side[i] for side in stepped.bounds()])
            np.testing.assert_array_equal(single.support.center, bank.support(i).center)


@pytest.mark.parametrize("make", MAKE.values(), ids=MAKE.keys())
def test_a_contradiction_is_told_as_by_single_steps(make: Callable[[Any], Any]) -> None:
    Y, U = _data(WIDE)
    Y[7, 1] += 50.0
    whole, stepped = make(WIDE), make(WIDE)
    with pytest.raises(InconsistentData, match=r"row 7 \(step 8\).*y2") as caught:
        run_filter(whole, Y, U, points=False)
    assert caught.value.run is not None
    assert len(caught.value.run.lower) == 7
    run_filter(stepped, Y[:7], U[:7], points=False)
    stepped.predict(U[6])
    np.testing.assert_array_equal(whole.bounds(), stepped.bounds())
    held = run_filter(make(WIDE), Y, U, points=False, on_inconsistency="hold")
    assert held.status[7] == "held"
    assert len(held.sets) == len(Y)
    assert np.isfinite(held.volumes).all()


def test_kinds_without_limits_have_no_bank() -> None:
    for options in ({"reduce": False}, {"lag": 1}):
        with pytest.raises(ModelError, match="no compiled bank"):
            FilterBank(LSUCZ, P3, [PRIOR] * 2, **options)
    with pytest.raises(ModelError, match="no compiled bank"):
        FilterBank(ZonotopicKalman, P3, [PRIOR] * 2, form="predictor")
