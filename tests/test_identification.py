"""Bounds that explain data: smallest, with a margin, tried on the rest, and honest about what breaks them."""

from __future__ import annotations

import numpy as np
import pytest

from lsu_mesh import LSUCZ, InconsistentData, LSUModel, ModelError, Orthotope, metrics, run_filter, simulate, systems
from lsu_mesh.identification import explain, report

DOMAIN = ([-20.0] * 3, [20.0] * 3)
TRUE = systems.get("P3").replace(domain=DOMAIN)


def test_the_true_bounds_need_no_factor_above_one() -> None:
    data = simulate(TRUE, 200, 1)
    found = explain(TRUE, data.Y, data.U, margin=1.0, share=1.0)
    assert 0.5 < found.factor <= 1.0
    assert found.held_out is None


def test_halved_noise_is_found_out_and_explained_with_a_margin() -> None:
    """r is declared at half the truth: its factor is near 2, not above, and with a margin the rest is explained."""
    declared = TRUE.replace(r=TRUE.r / 2)
    data = simulate(TRUE, 600, 1)
    found = explain(declared, data.Y, data.U, learn="r", margin=1.2)
    assert 1.4 < found.factor <= 2.0
    np.testing.assert_allclose(found.r, 1.2 * found.factor * declared.r)
    np.testing.assert_array_equal(found.rho, declared.rho)
    assert found.held_out is not None
    assert found.held_out.is_explained
    assert found.held_out.broken == ()
    run = run_filter(LSUCZ(found.model, Orthotope(*DOMAIN)), data.Y, data.U)
    assert metrics.containment(run.lower, run.upper, data.X) >= 0.99


def test_no_filter_contradicts_the_data_with_the_smallest_bounds() -> None:
    data = simulate(TRUE, 120, 3)
    found = explain(TRUE, data.Y, data.U, margin=1.0 + 1e-6, share=1.0)
    run_filter(LSUCZ(found.model, Orthotope(*DOMAIN)), data.Y, data.U)
    small = found.model.replace(rho=found.rho * 0.5, r=found.r * 0.5)
    with pytest.raises(InconsistentData):
        run_filter(LSUCZ(small, Orthotope(*DOMAIN)), data.Y, data.U)


def test_reports_that_break_the_bounds_are_named() -> None:
    data = simulate(TRUE, 200, 4)
    Y = data.Y.copy()
    Y[150, 1] += 5.0
    found = explain(TRUE, Y, data.U, margin=1.5)
    assert found.held_out is not None
    assert not found.held_out.is_explained
    assert found.held_out.broken is not None
    assert [(b.step, b.output) for b in found.held_out.broken] == [(151, 1)]
    assert "step 151: y2" in report(found)
    assert "NOT explained" in report(found)


def test_each_half_width_for_itself_has_the_smallest_sum() -> None:
    data = simulate(TRUE, 150, 5)
    separate = explain(TRUE, data.Y, data.U, learn="separate", share=1.0)
    both = explain(TRUE, data.Y, data.U, share=1.0)
    total = separate.smallest_rho.sum() + separate.smallest_r.sum()
    assert total < both.smallest_rho.sum() + both.smallest_r.sum()
    assert np.isnan(separate.factor)


def test_an_unknown_entry_is_found_with_the_bounds() -> None:
    true = LSUModel([[0.9, 0.2], [-0.3, 0.7]], [[1.0], [0.5]], [[1.0, 0.0]], 0.01, 0.02)
    data = simulate(true, 300, 1)
    wrong = true.replace(A=[[0.6, 0.2], [-0.3, 0.7]])
    found = explain(wrong, data.Y, data.U, unknown=[["A", 1, 1, 0.0, 1.0]], share=1.0)
    assert found.theta[0] == pytest.approx(0.9, abs=0.01)
    assert found.model.A[0, 0] == found.theta[0]
    assert found.factor < 0.2 * explain(wrong, data.Y, data.U, share=1.0).factor


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"margin": 0.9}, "margin must be at least 1"),
        ({"share": 0.0}, "share must be above 0"),
        ({"learn": "q"}, "learn must be one of"),
    ],
)
def test_wrong_arguments_are_named(options: dict[str, object], words: str) -> None:
    data = simulate(TRUE, 10, 1)
    with pytest.raises(ModelError, match=words):
        explain(TRUE, data.Y, data.U, **options)  # type: ignore[arg-type]


def test_bounds_of_zero_have_no_ratio() -> None:
    data = simulate(TRUE, 10, 1)
    with pytest.raises(ModelError, match="give their ratio"):
        explain(TRUE.replace(r=0.0), data.Y, data.U, learn="r")


def test_offsets_and_feedthrough_are_taken_off_and_put_back() -> None:
    """The bounds found are those of the same data without the offsets; the model found has them again."""
    plain = LSUModel([[0.8]], [[1.0]], [[1.0]], 0.1, 0.2, domain=([-50.0], [50.0]))
    full = plain.replace(D=[[2.0]], a=[0.5], d=[3.0])
    data = simulate(full, 60, 3)
    offset = 0.5 / (1.0 - 0.8)  # the plain state is x − offset
    shifted = data.Y - 3.0 - 2.0 * data.U - offset
    found, same = explain(full, data.Y, data.U), explain(plain, shifted, data.U)
    np.testing.assert_allclose(found.factor, same.factor, rtol=1e-6)
    assert found.model.a is not None
    np.testing.assert_allclose(found.model.a, [0.5])
    np.testing.assert_allclose(found.model.B, [[1.0]])  # type: ignore[arg-type]
    assert found.model.D is not None
    assert found.held_out is not None
    assert same.held_out is not None
    np.testing.assert_allclose(found.held_out.factor, same.held_out.factor, rtol=1e-6)
    with pytest.raises(ModelError, match="give U with 60 rows"):
        explain(full, data.Y, data.U[:-1])
    with pytest.raises(ModelError, match="identification knows no period"):
        explain(plain.replace(period=360.0), data.Y, data.U)
