"""The demo's nodes together, when nothing goes wrong."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

from lsu_mesh.filters.registry import filter_class
from lsu_mesh.mesh.messages import Input, Measurement, Message, Posterior, Prediction
from lsu_mesh.mesh.sets import to_support

STEPS = 60


@pytest.fixture(scope="module")
def mesh(module_mesh):  # type: ignore[no-untyped-def]
    finished = module_mesh(f"mesh.steps={STEPS}")
    finished.run(STEPS * 0.02 + 0.2)
    return finished


def test_every_estimator_publishes_every_step_once(mesh) -> None:  # type: ignore[no-untyped-def]
    for name in mesh.estimators():
        assert [posterior.step for posterior in mesh.posteriors(name)] == list(range(1, STEPS + 1)), name


def test_every_set_and_its_bounds_hold_the_truth(mesh) -> None:  # type: ignore[no-untyped-def]
    truth = mesh.truth()
    for name in mesh.estimators():
        for posterior in mesh.posteriors(name):
            x = truth[posterior.step]
            assert all(
                low <= value <= high for low, value, high in zip(posterior.lower, x, posterior.upper, strict=True)
            )
            assert to_support(posterior.support).contains(x)


def test_the_simulated_truth_keeps_the_declared_bounds_in_exact_arithmetic(mesh) -> None:  # type: ignore[no-untyped-def]
    model, truth = mesh.configuration.base_model, mesh.truth()
    inputs = {m.step: m.u for m in mesh.of(Input)}
    for k in range(1, STEPS):
        exact = [
            sum((Fraction(a) * Fraction(x) for a, x in zip(row, truth[k], strict=True)), Fraction(0))
            + sum((Fraction(b) * Fraction(u) for b, u in zip(drive, inputs[k], strict=True)), Fraction(0))
            for row, drive in zip(model.A.tolist(), model.B.tolist(), strict=True)
        ]
        noise = [abs(Fraction(x) - e) for x, e in zip(truth[k + 1], exact, strict=True)]
        assert all(n <= Fraction(rho) for n, rho in zip(noise, model.rho.tolist(), strict=True))


def test_the_fused_bounds_lie_inside_those_of_every_source(mesh) -> None:  # type: ignore[no-untyped-def]
    fused = mesh.newest("main")
    for name in mesh.configuration.filters:
        for posterior in mesh.posteriors(name):
            assert np.all(np.array(fused[posterior.step].lower) >= posterior.lower)
            assert np.all(np.array(fused[posterior.step].upper) <= posterior.upper)


def test_the_provenance_of_a_filter_is_a_chain_of_its_own_posteriors(mesh) -> None:  # type: ignore[no-untyped-def]
    for name in mesh.configuration.filters:
        base: object = "prior"
        for posterior in mesh.posteriors(name):
            assert posterior.base == base
            base = posterior.reference


@pytest.mark.parametrize("name", ["box", "para"])
def test_a_posterior_can_be_recomputed_from_its_base_and_what_it_used(mesh, name: str) -> None:  # type: ignore[no-untyped-def]
    settings = mesh.configuration.filters[name]
    by_reference: dict[object, Message] = {m.reference: m for _, m in mesh.sent}
    rows = {sensor: row for row, sensor in enumerate(settings.sensors)}
    for posterior in mesh.posteriors(name):
        engine = filter_class(settings.kind)(mesh.configuration.model(settings.sensors), mesh.configuration.prior)
        if posterior.base != "prior":
            base = by_reference[posterior.base]
            assert isinstance(base, Posterior)
            engine.resume(to_support(base.support), np.array(base.lower), np.array(base.upper))
        y = np.full(len(rows), np.nan)
        for reference in posterior.used:
            message = by_reference[reference]
            if isinstance(message, Input):
                engine.predict(message.u)
            else:
                assert isinstance(message, Measurement)
                y[rows[message.name]] = message.y[0]
        engine.update(y)
        assert engine.bounds()[0].tolist() == posterior.lower
        assert engine.bounds()[1].tolist() == posterior.upper


def test_predictions_hold_the_next_truth_and_the_next_measurement(mesh) -> None:  # type: ignore[no-untyped-def]
    truth = mesh.truth()
    measured = {(m.name, m.step): m.y[0] for m in mesh.of(Measurement)}
    checked = 0
    for prediction in mesh.of(Prediction):
        if prediction.step not in truth:
            continue
        assert to_support(prediction.support).contains(truth[prediction.step])
        for row, sensor in enumerate(mesh.configuration.filters[prediction.name].sensors):
            assert prediction.y_lower[row] <= measured[sensor, prediction.step] <= prediction.y_upper[row]
            checked += 1
    assert checked > STEPS


def test_two_runs_with_one_seed_send_the_same_sets(mesh, module_mesh) -> None:  # type: ignore[no-untyped-def]
    again = module_mesh(f"mesh.steps={STEPS}")
    again.run(STEPS * 0.02 + 0.2)
    for name in mesh.estimators():
        assert [p.support for p in again.posteriors(name)] == [p.support for p in mesh.posteriors(name)]


def test_another_seed_gives_other_truth(mesh, module_mesh) -> None:  # type: ignore[no-untyped-def]
    other = module_mesh("mesh.steps=3", "mesh.seed=2")
    other.run(0.1)
    assert other.truth()[2] != mesh.truth()[2]
