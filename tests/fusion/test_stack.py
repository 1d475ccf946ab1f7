"""A stack of sets of all kinds: exact states stay in it, its hull is that of the parts, prefixes are built once."""

from __future__ import annotations

import numpy as np
import pytest

from lsu_mesh import LSUCZ, LSUO, LSUP, LSUPB, InconsistentData, Intersection, Orthotope, Support, Zonotope
from lsu_mesh.filters.filter import Filter
from lsu_mesh.fusion import stack as stacks
from lsu_mesh.fusion.stack import NO_LIMITS, Families, Stack
from lsu_mesh.supports.constrained_zonotope import ConstrainedZonotope
from lsu_mesh.supports.exact import Membership
from lsu_mesh.supports.reduction import Limits, Settled
from lsu_mesh.testing.exact_plant import EXTREMES, KINDS, draw_case, exact_steps, inside_box

LIMITS = Limits(12, 5)
UNIT = (np.array([-1.0, -1.0]), np.array([1.0, 1.0]))


def _told(*supports: Support) -> list[stacks.Told]:
    return [(support, support.bounds()) for support in supports]


def _square(limits: Limits = LIMITS) -> Stack:
    return Stack.of(Orthotope(*UNIT).to_constrained_zonotope().arrays, *UNIT, limits)


def _random_set(rng: np.random.Generator, x: np.ndarray) -> ConstrainedZonotope:
    """A constrained zonotope with x in its interior."""
    G, A, xi = rng.normal(size=(x.size, 8)), rng.normal(size=(3, 8)), rng.uniform(-0.5, 0.5, 8)
    return ConstrainedZonotope(x - G @ xi, G, A, A @ xi)


@pytest.mark.parametrize("kind", [kind for kind in (*KINDS, *EXTREMES) if kind != "huge prior"])
@pytest.mark.parametrize("seed", [0, 1])
def test_a_state_in_exact_rationals_stays_in_the_fused_set(kind: str, seed: int) -> None:
    """Filters of four kinds with the data of one plant, fused with the own prediction at each step."""
    case = draw_case(np.random.default_rng(seed), kind)
    n, C = case.model.state_count, case.model.C
    filters: list[Filter] = [kind(case.model, case.prior) for kind in (LSUO, LSUP, LSUPB, LSUCZ)]
    engine = LSUCZ(case.model, case.prior, max(12, n + 3), 5, point="centre")
    limits = Limits(max(12, n + 3), 5)
    for step in exact_steps(case, np.random.default_rng(seed + 1), 12):
        for local in filters:
            local.update(np.where(np.random.default_rng(step.y.size).random(len(C)) < 0.2, np.nan, step.y))
        told = [(local.support, local.bounds()) for local in filters]
        held = engine.snapshot()
        own = Stack.of(held.body, held.lower, held.upper, limits)
        found = Families(own, told, limits).settled((0, 1, 2, 3))
        assert found is not None
        assert limits.allow(found.body) or found.body is held.body
        for lower, upper in (bounds for _, bounds in told):
            assert (found.lower >= lower).all()
            assert (found.upper <= upper).all()
        assert inside_box(found.lower, found.upper, step.x)
        fused = ConstrainedZonotope.of_arrays(*found.body)
        assert fused.membership(step.x) is Membership.INSIDE
        engine.resume(fused, found.lower, found.upper)
        for one in (engine, *filters):
            one.predict(step.u if case.model.B is not None else None)


@pytest.mark.parametrize("seed", range(8))
def test_the_hull_is_that_of_all_parts(seed: int) -> None:
    rng = np.random.default_rng(seed)
    x = rng.normal(size=2)
    parts: list[Support] = [
        _random_set(rng, x),
        Orthotope(x - rng.random(2), x + rng.random(2)),
        Intersection([Orthotope(x - 1.0, x + 0.3), Zonotope(x, rng.normal(size=(2, 4)))]),
        Orthotope(x - 0.5, x + 0.5).to_parallelotope().linear_map([[1.0, 0.3], [-0.2, 1.0]], [-0.3 * x[1], 0.2 * x[0]]),
    ]
    expected = Intersection(parts).bounds()
    for order in (parts, parts[::-1], parts[2:] + parts[:2]):
        found = Families(None, _told(*order), NO_LIMITS).settled((0, 1, 2, 3))
        assert found is not None
        assert np.abs(np.subtract((found.lower, found.upper), expected)).max() <= 1e-9
        body = ConstrainedZonotope.of_arrays(*found.body)
        for d in rng.normal(size=(5, 2)):
            assert body.support(d) == pytest.approx(Intersection(parts).support(d), abs=1e-9)


def test_many_boxes_cost_one_strip_a_coordinate() -> None:
    boxes = [Orthotope([-2.0, -0.5 - 0.1 * i], [2.0, 0.9 - 0.1 * i]) for i in range(4)]
    stack = Families(_square(), _told(*boxes), LIMITS).stack((0, 1, 2, 3))
    assert stack is not None
    c, G, A, b = stack.closed()
    assert A.shape == (1, 3)
    assert ConstrainedZonotope.of_arrays(c, G, A, b).bounds()[1] == pytest.approx([1.0, 0.6], abs=1e-12)


def test_a_wide_source_changes_no_set() -> None:
    own = _square()
    found = Families(own, _told(Orthotope([-9.0, -9.0], [9.0, 9.0])), LIMITS).settled((0,))
    assert found is not None
    assert found.body is own.body


def test_what_brings_next_to_nothing_changes_only_the_box() -> None:
    rng = np.random.default_rng(3)
    body = _random_set(rng, np.zeros(2))
    lower, upper = body.bounds()
    own = Stack.of(body.arrays, lower, upper, Limits(8, 3))
    box = Orthotope(lower + 1e-6, upper + 1.0)
    found = Families(own, _told(box), own.limits).settled((0,))
    assert found is not None
    assert found.body is own.body
    assert (found.lower >= box.lower).all()


def test_a_set_that_is_far_more_complex_is_taken_by_its_box() -> None:
    rng = np.random.default_rng(5)
    complex_set = Zonotope([0.5, 0.0], 0.02 * rng.normal(size=(2, 60)))
    found = Families(_square(), _told(complex_set), LIMITS).stack((0,))
    assert found is not None
    assert found.body[2].shape[0] == 0
    lower, upper = complex_set.bounds()
    assert (found.lower == np.maximum(lower, -1.0)).all()
    assert (found.upper == np.minimum(upper, 1.0)).all()


def test_a_stack_that_grows_too_large_is_reduced_on_the_way() -> None:
    rng = np.random.default_rng(1)
    x = np.array([0.1, -0.2])
    sets = [_random_set(rng, x) for _ in range(9)]
    families = Families(_square(), _told(*sets), LIMITS)
    stack = families.stack(tuple(range(9)))
    found = families.settled(tuple(range(9)))
    assert stack is not None
    assert found is not None
    assert stack.body[1].shape[1] <= stacks.MAX_STACKED * 12 + 10
    assert LIMITS.allow(found.body)
    for one in sets:
        assert (found.lower >= one.bounds()[0]).all()
    assert ConstrainedZonotope.of_arrays(*found.body).contains(x)


def test_families_with_one_beginning_build_it_once(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(2)
    sets = [_random_set(rng, np.zeros(2)) for _ in range(4)]
    met, calls = Stack.met, []
    monkeypatch.setattr(Stack, "met", lambda self, *told: calls.append(1) or met(self, *told))
    families = Families(_square(NO_LIMITS), _told(*sets), NO_LIMITS)
    apart: list[Settled | None] = []
    for family in ((0, 1, 2), (0, 1, 3), (0, 2, 3), (1, 2, 3)):
        together = families.settled(family)
        calls_before = len(calls)
        apart.append(Families(_square(NO_LIMITS), _told(*(sets[i] for i in family)), NO_LIMITS).settled((0, 1, 2)))
        del calls[calls_before:]
        assert together is not None
        assert apart[-1] is not None
        assert [part.tobytes() for part in together.body] == [part.tobytes() for part in apart[-1].body]
    assert len(calls) == 9, "0, 01, 012, 013, 02, 023, 1, 12, 123"


def test_sets_without_a_common_point_are_proved_so() -> None:
    slanted = Orthotope([-0.1, -3.0], [0.1, 3.0]).to_parallelotope().linear_map([[1.0, 1.0], [0.0, 1.0]], [1.5, 0.0])
    corner = Orthotope([-1.0, 0.0], [-0.2, 1.0])
    families = Families(_square(), _told(slanted, corner, Orthotope([2.0, 2.0], [3.0, 3.0])), LIMITS)
    assert families.settled((0,)) is not None
    assert families.stack((0, 1)) is not None
    assert families.settled((0, 1)) is None
    assert families.settled((2,)) is None
    with pytest.raises(InconsistentData):
        _square().met(*_told(Orthotope([2.0, 2.0], [3.0, 3.0]))[0])


def test_numbers_beyond_double_precision_are_left_out() -> None:
    huge = Zonotope([0.0, 0.0], [[1e300, 0.0, 1e308], [0.0, 1e308, 1e300]]).to_constrained_zonotope()
    found = _square().met(huge, UNIT).settled()
    assert (found.lower <= -1.0).all()
    assert (found.upper >= 1.0).all()


def test_another_solver_where_the_simplex_is_troubled(monkeypatch: pytest.MonkeyPatch) -> None:
    plain = stacks.settle_stack

    def troubled(*arguments: object) -> object:
        _, values, body = plain(*arguments)
        return stacks.LOOSE, np.full_like(values, 2.0), body

    told = _told(Orthotope([-2.0, -0.5], [2.0, 0.25]).to_parallelotope())
    expected = Families(_square(), told, LIMITS).settled((0,))
    monkeypatch.setattr(stacks, "settle_stack", troubled)
    found = Families(_square(), told, LIMITS).settled((0,))
    assert expected is not None
    assert found is not None
    assert found.lower == pytest.approx(expected.lower, abs=1e-12)
    assert found.upper == pytest.approx(expected.upper, abs=1e-12)
