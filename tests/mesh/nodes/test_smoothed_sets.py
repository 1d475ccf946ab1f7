"""A filter with a lag publishes the sets of earlier states given later data: those of the library, late data or not."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lsu_mesh import LSUCZ, ModelError
from lsu_mesh.mesh.admission import most_generators
from lsu_mesh.mesh.config import Configuration, load
from lsu_mesh.mesh.messages import Input, Measurement, Smoothed, decode
from lsu_mesh.mesh.nodes.filter import FilterNode
from lsu_mesh.mesh.nodes.node import Node
from lsu_mesh.mesh.sets import to_message, to_support
from lsu_mesh.mesh.simulator.time_variants import timed

MakeMesh = Callable[..., Any]
LAG = 4
SMOOTHING = ("mesh.steps=40", f"filters.cz.lag={LAG}")
DOMAIN = ("model.domain.lower=[-100.0, -100.0, -100.0]", "model.domain.upper=[100.0, 100.0, 100.0]")


@pytest.fixture(scope="module")
def orderly(module_mesh: MakeMesh) -> Any:
    """A mesh in which nothing is late."""
    mesh = module_mesh(*SMOOTHING)
    mesh.run(1.5)
    return mesh


def smoothed(mesh: Any) -> dict[int, Smoothed]:
    """The newest smoothed set of each step."""
    return {message.step: message for message in mesh.of(Smoothed, "cz")}


def content(found: dict[int, Smoothed]) -> dict[int, object]:
    return {step: (one.support, one.lower, one.upper) for step, one in found.items()}


def computed(mesh: Any) -> dict[int, object]:
    """The same by the library alone, from what the sensors and the plant have sent."""
    configuration: Configuration = mesh.configuration
    settings = configuration.filters["cz"]
    measured = {(one.name, one.step): one.y for one in mesh.of(Measurement)}
    inputs = {one.step: one.u for one in mesh.of(Input)}
    filter = LSUCZ(configuration.model(settings.sensors), configuration.prior, **settings.options)
    found: dict[int, object] = {}
    for k in range(1, 41):
        filter.update([value for sensor in settings.sensors for value in measured[sensor, k]])
        if k > LAG:
            lower, upper = filter.smoothed_bounds(LAG)
            found[k - LAG] = (to_message(filter.smoothed(LAG)), lower.tolist(), upper.tolist())
        filter.predict(inputs[k])
    return found


def test_the_smoothed_sets_are_those_of_the_library(orderly: Any) -> None:
    found = smoothed(orderly)
    assert list(found) == list(range(1, 40 - LAG + 1)), "none in the first steps, whose states are not held yet"
    assert content(found) == computed(orderly)


def test_each_belongs_to_the_posterior_some_steps_later(orderly: Any) -> None:
    posteriors = orderly.newest("cz")
    for step, one in smoothed(orderly).items():
        base = posteriors[step + LAG]
        assert (one.lag, one.base, one.revision) == (LAG, base.reference, base.revision)
        assert (one.epoch, one.guarantee, one.algorithm) == (base.epoch, base.guarantee, base.algorithm)
        assert one.origin_ns == base.origin_ns


def test_they_hold_the_truth_and_are_narrower(orderly: Any) -> None:
    truth, posteriors, found = orderly.truth(), orderly.newest("cz"), smoothed(orderly)
    widths = [], []  # type: ignore[var-annotated]
    for step, one in found.items():
        x = np.array(truth[step])
        assert ((one.lower <= x) & (x <= one.upper)).all()
        assert to_support(one.support).contains(x)
        widths[0].append(np.subtract(one.upper, one.lower))
        widths[1].append(np.subtract(posteriors[step].upper, posteriors[step].lower))
    assert (np.mean(widths[0], axis=0) < 0.9 * np.mean(widths[1], axis=0)).all()


def test_late_data_publish_the_smoothed_sets_again(mesh_of: MakeMesh, orderly: Any) -> None:
    held: list[tuple[str, bytes]] = []

    def carry(address: str, payload: bytes, node: Node) -> bool:
        is_late = node.name == "cz" and "/measurement/s2" in address and decode("measurement", payload).step == 20
        if is_late:
            held.append((address, payload))
        return not is_late

    mesh = mesh_of(*SMOOTHING, carry=carry)
    mesh.run(0.53)
    before = smoothed(mesh)
    assert max(before) > 20
    mesh._carry = lambda address, payload, node: True
    for address, payload in held:
        mesh.hand_over(address, payload)
    mesh.run(1.0)
    again = [one for one in mesh.of(Smoothed, "cz") if one.revision == 1]
    first = 20 - LAG
    assert {one.step for one in again} == set(range(first, max(before) + 1)), "all that the late datum is in"
    assert content(smoothed(mesh)) == content(smoothed(orderly)), "the newest are those of the orderly run"
    assert all(one.lower != before[one.step].lower for one in again if one.step == 20)


def test_without_a_lag_none_are_published(mesh_of: MakeMesh) -> None:
    mesh = mesh_of("mesh.steps=10")
    mesh.run(0.5)
    assert mesh.of(Smoothed) == []
    assert mesh.nodes["cz"].publishes == ("prediction", "posterior")


def test_none_of_data_that_contradict_and_none_just_after_a_reset(mesh_of: MakeMesh) -> None:
    fault = 'sensors.s2.faults=[{kind="bias", from=15, to=18, size=6.0}]'
    mesh = mesh_of("mesh.steps=40", f"filters.cz.lag={LAG}", "filters.cz.reset_after=2", fault, *DOMAIN)
    mesh.run(1.5)
    newest = mesh.newest("cz")
    resets = [event.step for event in mesh.events("reset") if event.name == "cz"]
    assert resets
    assert any(one.status == "inconsistent" for one in newest.values())
    found = mesh.of(Smoothed, "cz")
    by_reference = {one.reference: one for one in mesh.posteriors("cz")}
    bases = [by_reference[one.base] for one in found]
    assert all(base.status != "inconsistent" for base in bases)
    sets = {one.reference: one for _, one in mesh.sent}
    for reset in resets:
        base, epoch = newest[reset].base, newest[reset].epoch
        start = sets[base].step if isinstance(base, tuple) else reset
        assert all(one.step >= start for one in found if one.epoch == epoch), "nothing is known of states before it"
    assert max(base.step for base in bases) == 40, "smoothing goes on"


def test_a_lag_needs_a_discrete_model(demo: Path) -> None:
    configuration = timed(load(demo, SMOOTHING), "continuous")
    with pytest.raises(ModelError, match=r"filter cz: lag counts time updates.*leave lag out"):
        FilterNode(configuration, "cz", "0" * 16)
    plain = replace(configuration.filters["cz"], options={})
    FilterNode(replace(configuration, filters=configuration.filters | {"cz": plain}), "cz", "0" * 16)


def test_receivers_admit_the_generators_of_the_earlier_states(root: Path) -> None:
    """By default a filter with a lag keeps n generators more for each step."""
    file = root / "examples" / "mesh.toml"
    limits = [most_generators(load(file, [f"filters.cz.lag={lag}"])) for lag in (0, 300)]
    assert limits[1] >= 20 + 3 * 300 > limits[0]
