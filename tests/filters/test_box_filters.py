"""LSUO, LSUP and LSUPB: formulas, options, arguments, transfers, snapshots."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from lsu_mesh import (
    LSUO,
    LSUP,
    LSUPB,
    InconsistentData,
    Intersection,
    LSUModel,
    ModelError,
    Orthotope,
    Parallelotope,
    run_filter,
    simulate,
    systems,
)
from lsu_mesh.filters.compiled import CompiledFilter
from lsu_mesh.filters.registry import FILTERS, filter_class

PRIOR = Orthotope([-1.0] * 3, [1.0] * 3)
P3 = systems.get("P3")
KINDS: dict[str, Callable[[LSUModel], CompiledFilter]] = {
    "LSUO": lambda model: LSUO(model, PRIOR),
    "LSUP": lambda model: LSUP(model, PRIOR),
    "LSUPB": lambda model: LSUPB(model, PRIOR),
}
every_kind = pytest.mark.parametrize("make", KINDS.values(), ids=KINDS.keys())
Make = Callable[[LSUModel], CompiledFilter]


def test_every_kind_is_registered_under_its_own_name() -> None:
    for kind in FILTERS:
        assert filter_class(kind).__name__ == kind == filter_class(kind).kind


def test_an_unknown_kind_names_the_nearest() -> None:
    with pytest.raises(ModelError, match="did you mean 'LSUCZ'"):
        filter_class("LSU-CZ")
    with pytest.raises(ModelError, match="valid: Kalman, LSUCZ, LSUO"):
        filter_class("qqqq")


def test_the_box_prediction_is_the_formula() -> None:
    """``c⁺ = A c + B u``, ``q⁺ = |A| q + rho`` (Pavelková & Jirsa 2018, eq. 9)."""
    filter = LSUO(P3, PRIOR)
    filter.predict([2.0])
    center, reach = P3.B @ [2.0], np.abs(P3.A).sum(axis=1) + P3.rho
    np.testing.assert_allclose(filter.bounds(), [center - reach, center + reach], rtol=1e-13)


def test_the_image_of_a_parallelotope_is_the_formula() -> None:
    """Edges along A T, grown by ``|(A T)⁻¹| rho`` (Lainová et al. 2019, errata)."""
    filter = LSUP(P3, PRIOR)
    filter.predict([2.0])
    support = filter.support
    assert isinstance(support, Parallelotope)
    growth = 1 + np.abs(np.linalg.inv(P3.A)) @ P3.rho
    np.testing.assert_allclose(support.generators, P3.A @ np.diag(growth), atol=1e-12)
    np.testing.assert_allclose(support.center, P3.B @ [2.0], rtol=1e-13)


@every_kind
def test_the_noise_map_is_the_same_as_noise_of_its_columns(make: Make) -> None:
    """A diagonal N with rho is the identity with ``N rho``."""
    mapped = P3.replace(noise_map=np.diag([1.0, 2.0, 3.0]), rho=[0.3, 0.2, 0.1])
    plain = P3.replace(rho=[0.3, 0.4, 0.3])
    one, other = make(mapped), make(plain)
    for k in range(5):
        one.predict([0.1 * k])
        other.predict([0.1 * k])
    np.testing.assert_allclose(one.bounds(), other.bounds(), rtol=1e-9)


@every_kind
def test_an_unknown_input_gives_room_for_every_input_of_its_box(make: Make) -> None:
    unknown = make(P3)
    unknown.predict(Orthotope([-1.0], [3.0]))
    lower, upper = unknown.bounds()
    for u in (-1.0, 0.5, 3.0):
        known = make(P3)
        known.predict([u])
        for vertex in known.support.vertices()[:4]:
            assert unknown.support.contains(vertex * (1 - 1e-9) + known.point * 1e-9)
    assert (upper - lower).sum() > np.subtract(*known.bounds()[::-1]).sum() + 1.0


@every_kind
def test_rho_r_and_model_of_one_step_only(make: Make) -> None:
    wide, usual = make(P3), make(P3)
    wide.predict([0.0], rho=0.5)
    usual.predict([0.0])
    assert (wide.bounds()[1] > usual.bounds()[1]).all()
    held = make(P3)
    held.predict([0.0], model=P3.replace(A=np.eye(3), rho=0.0))
    np.testing.assert_allclose(held.bounds(), PRIOR.bounds(), rtol=1e-12)
    tight, loose = make(P3), make(P3)
    tight.update([0.1, 0.1], r=[0.01, 0.01])
    loose.update([0.1, 0.1])
    assert tight.volume() < loose.volume()
    tight.predict([0.0])
    np.testing.assert_array_equal(tight.model.r, P3.r)


@every_kind
def test_arguments_that_do_not_fit_are_named(make: Make) -> None:
    filter = make(P3)
    before = filter.bounds()
    for call, message in [
        (lambda: filter.update([1.0]), "y must have 2 entries"),
        (lambda: filter.update([1.0, math.inf]), "finite or NaN"),
        (lambda: filter.update([1.0, 0.0], r=[-1.0, 0.0]), "r must be finite and not negative"),
        (lambda: filter.predict(), r"1 input\(s\)"),
        (lambda: filter.predict([1.0, 2.0]), "u must have 1 entries"),
        (lambda: filter.predict([math.nan]), "a missing input is an Orthotope"),
        (lambda: filter.predict(Orthotope([0.0, 0.0], [1.0, 1.0])), "box of inputs must have 1"),
        (lambda: filter.predict([1.0], rho=[1.0]), "rho must have 3 entries"),
        (lambda: filter.predict([1.0], model=systems.get("S2")), "must have 3 states"),
        (lambda: filter.condition(Orthotope([0.0], [1.0])), "3 coordinates"),
        (lambda: filter.reset(Orthotope([0.0], [1.0])), "3 coordinates"),
    ]:
        with pytest.raises(ModelError, match=message):
            call()
    np.testing.assert_array_equal(filter.bounds(), before)
    with pytest.raises(ModelError, match="support such as Orthotope"):
        type(filter)(P3, [0.0, 1.0])  # type: ignore[call-arg, arg-type]
    paired = type(filter)(P3, ([-1.0] * 3, [1.0] * 3))  # type: ignore[call-arg, arg-type]
    np.testing.assert_array_equal(paired.bounds(), filter.bounds())


@every_kind
def test_a_missing_output_is_no_strip(make: Make) -> None:
    filter, one = make(P3), make(P3.replace(C=P3.C[:1], r=P3.r[:1]))
    before = filter.snapshot().state
    filter.update([math.nan, math.nan])
    np.testing.assert_array_equal(filter.snapshot().state, before)
    filter.update([0.2, math.nan])
    one.update([0.2])
    np.testing.assert_array_equal(filter.bounds(), one.bounds())


@every_kind
def test_contradictory_data_name_the_strips_and_change_nothing(make: Make) -> None:
    filter = make(P3)
    before = filter.snapshot().state
    with pytest.raises(InconsistentData, match="y1") as caught:
        filter.update([10.0, 0.0])
    assert caught.value.rows == (0,)
    assert caught.value.gap == pytest.approx(10.0 - 0.3 - 1.5)
    with pytest.raises(InconsistentData, match="y1, y2") as caught:  # each strip meets the box, both together do not
        make(P3.replace(C=[[1.0, 0.0, 0.0], [1.0, 0.0, 0.0]], r=0.1)).update([0.5, -0.5])
    assert caught.value.rows == (0, 1)
    assert caught.value.gap == 0.0
    np.testing.assert_array_equal(filter.snapshot().state, before)


@every_kind
def test_a_snapshot_brings_back_the_very_bits(make: Make) -> None:
    filter = make(P3)
    data = simulate(P3, 10, seed=2)
    run_filter(filter, data.Y, data.U)
    snapshot, bounds = filter.snapshot(), filter.bounds()
    filter.predict([1.0])
    filter.update([math.nan, math.nan])
    filter.condition(Orthotope([-50.0] * 3, [50.0] * 3))
    filter.restore(snapshot)
    np.testing.assert_array_equal(filter.bounds(), bounds)


@every_kind
def test_reset_starts_from_the_given_set(make: Make) -> None:
    filter = make(P3)
    filter.predict([1.0])
    filter.reset(Orthotope([5.0] * 3, [6.0] * 3))
    np.testing.assert_allclose(filter.bounds(), [[5.0] * 3, [6.0] * 3], rtol=1e-14)
    assert (filter.bounds()[0] <= 5.0).all()
    assert (filter.bounds()[1] >= 6.0).all()


@every_kind
def test_transfer_gains_what_the_volume_loses(make: Make) -> None:
    filter = make(P3)
    before = math.log(filter.volume())
    gain = filter.condition(Orthotope([0.0, -2.0, -2.0], [2.0, 2.0, 2.0]))
    assert gain == pytest.approx(math.log(2.0))
    assert before - math.log(filter.volume()) == pytest.approx(gain)
    assert filter.condition(Orthotope([-9.0] * 3, [9.0] * 3)) == 0.0
    state = filter.snapshot().state
    with pytest.raises(InconsistentData, match="no point in common"):
        filter.condition(Orthotope([-2.0] * 3, [-1.5] * 3))
    np.testing.assert_array_equal(filter.snapshot().state, state)


@every_kind
def test_transfer_uses_the_faces_of_a_parallelotope(make: Make) -> None:
    """A thin slanted body whose interval hull says nothing about the box."""
    slanted = Parallelotope([0.0] * 3, [[1.0, -0.05, 0.0], [1.0, 0.05, 0.0], [0.0, 0.0, 1.0]])
    filter = make(P3)
    filter.condition(Orthotope([0.5, -1.0, -1.0], [1.0, 1.0, 1.0]))
    gain = filter.condition(Intersection([slanted, PRIOR]))
    assert gain > 0.5
    assert filter.bounds()[0][1] > 0.3


def test_the_bundle_is_inside_both_of_its_parts_alone() -> None:
    data = simulate(P3, 200, seed=3)
    bundle = run_filter(LSUPB(P3, PRIOR), data.Y, data.U)
    box = run_filter(LSUO(P3, PRIOR), data.Y, data.U)
    assert (np.subtract(bundle.upper, bundle.lower).mean(axis=0) < np.subtract(box.upper, box.lower).mean(axis=0)).all()
    filter = LSUPB(P3, PRIOR)
    parallelotope, orthotope = filter.support.parts
    assert isinstance(parallelotope, Parallelotope)
    assert isinstance(orthotope, Orthotope)


def test_meet_keeps_the_posterior_inside_the_prediction() -> None:
    data = simulate(P3, 100, seed=1)
    met, plain = LSUO(P3, PRIOR), LSUO(P3, PRIOR, meet=False)
    exceeded = False
    for y, u in zip(data.Y, data.U, strict=True):
        for filter in (met, plain):
            lower, upper = filter.bounds()
            filter.update(y)
            outside = (filter.bounds()[0] < lower).any() or (filter.bounds()[1] > upper).any()
            assert not (outside and filter is met)
            exceeded = exceeded or outside
            filter.predict(u)
    assert exceeded


def test_the_hull_by_programs_is_the_exact_hull_of_box_and_strips() -> None:
    from scipy.optimize import linprog

    rng = np.random.default_rng(0)
    for _ in range(10):
        model = LSUModel(np.eye(3), None, rng.normal(size=(2, 3)), 0.1, 0.2)
        y = model.C @ rng.uniform(-1, 1, 3)
        filter, strips = LSUO(model, PRIOR, hull="lp"), LSUO(model, PRIOR)
        filter.update(y)
        strips.update(y)
        rows, sides = np.vstack([model.C, -model.C]), np.concatenate([y + model.r, model.r - y])
        ends = [[s * linprog(s * np.eye(3)[i], rows, sides, bounds=(-1, 1)).fun for i in range(3)] for s in (1, -1)]
        np.testing.assert_allclose(filter.bounds(), ends, atol=1e-7)
        assert (filter.bounds()[0] >= strips.bounds()[0]).all()


def test_options_are_checked() -> None:
    with pytest.raises(ModelError, match="hull must be"):
        LSUO(P3, PRIOR, hull="exact")  # type: ignore[arg-type]
    with pytest.raises(ModelError, match="time_update must be one of image, cgz, edges, strips"):
        LSUP(P3, PRIOR, time_update="best")  # type: ignore[arg-type]
    large = LSUModel(np.eye(7), None, np.zeros((0, 7)), 1.0, 1.0)
    with pytest.raises(ModelError, match="up to 6 states"):
        LSUP(large, Orthotope(-np.ones(7), np.ones(7)), time_update="edges")


@pytest.mark.parametrize("seed", range(5))
def test_exhaustive_edges_leave_the_least_volume_of_one_time_update(seed: int) -> None:
    rng = np.random.default_rng(seed)
    model = LSUModel(rng.normal(size=(3, 3)), None, np.zeros((0, 3)), rng.random(3), 1.0)
    volumes = {}
    for name in ("image", "cgz", "edges"):
        filter = LSUP(model, PRIOR, time_update=name)  # type: ignore[arg-type]
        filter.predict()
        volumes[name] = filter.volume()
    assert volumes["edges"] <= min(volumes.values()) * (1 + 1e-9)


def test_more_than_one_state_of_noise_and_of_input_fits_every_time_update() -> None:
    rng = np.random.default_rng(1)
    model = LSUModel(
        rng.normal(size=(2, 2)), rng.normal(size=(2, 3)), np.eye(2), rng.random(4), 1.0, rng.normal(size=(2, 4))
    )
    for name in ("image", "cgz", "edges", "strips"):
        filter = LSUP(model, Orthotope([-1.0, -1.0], [1.0, 1.0]), time_update=name)  # type: ignore[arg-type]
        filter.predict(Orthotope([-1.0] * 3, [1.0] * 3))
        reach = np.abs(model.A).sum(axis=1) + np.abs(model.noise_map) @ model.rho + np.abs(model.B).sum(axis=1)
        assert (filter.bounds()[1] >= reach - 1e-9).all()


@pytest.mark.parametrize("unknown", [False, True])
def test_exhaustive_edges_stay_few_with_many_inputs(unknown: bool) -> None:
    """6 states, 6 noises and 60 inputs would be 5e8 combinations; known inputs are no edges, unknown ones too many."""
    rng = np.random.default_rng(4)
    model = LSUModel(rng.normal(size=(6, 6)), rng.normal(size=(6, 60)), np.zeros((0, 6)), rng.random(6), 1.0)
    assert model.B is not None
    u, prior = rng.normal(size=60), Orthotope(-np.ones(6), np.ones(6))
    filters = [LSUP(model, prior, time_update=name) for name in ("edges", "cgz")]  # type: ignore[arg-type]
    for filter in filters:
        filter.predict(Orthotope(u - 1.0, u + 1.0) if unknown else u)
        reach = np.abs(model.A).sum(axis=1) + model.rho + (np.abs(model.B).sum(axis=1) if unknown else 0.0)
        assert (filter.bounds()[1] >= model.B @ u + reach - 1e-9).all()
    exhaustive, greedy = (filter.volume() for filter in filters)
    assert exhaustive == greedy if unknown else exhaustive <= greedy * (1 + 1e-9)
