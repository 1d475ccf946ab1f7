"""Peers whose models differ in any item of the digest refuse one another's messages, and count them."""

from __future__ import annotations

from pathlib import Path

import pytest

from lsu_mesh.mesh.config import Configuration, load
from lsu_mesh.mesh.keys import key
from lsu_mesh.mesh.messages import Input, Measurement, Message, Posterior, encode
from lsu_mesh.mesh.nodes.filter import FilterNode
from lsu_mesh.mesh.nodes.fusion import FusionNode

SECOND = 10**9
MESH = """
[mesh]
name = "pair"
dt = {dt}
start_time = {start}
[model]
A = {A}
B = {B}
noise_map = {N}
rho = {rho}
{model}
[model.prior]
lower = [-10.0, -1.0]
upper = [10.0, 1.0]
[model.domain]
lower = [-1000.0, -100.0]
upper = [1000.0, 100.0]
[sensors.gauge]
C = {C}
r = {r}
{sensor}
[filters.box]
kind = "LSUO"
sensors = ["gauge"]
[fusion.main]
sources = ["box"]
"""
PLAIN = {
    "dt": "0.1", "start": "100.0", "A": "[[0.0, 1.0], [0.0, 0.0]]", "B": "[[0.0], [1.0]]", "N": "[[0.0], [1.0]]",
    "rho": "[0.5]", "C": "[[1.0, 0.0]]", "r": "[0.5]", "model": "", "sensor": "",
}  # fmt: skip
FLOW = {"model": "continuous = true"}
LATER = {"model": "schedule = [{ from = 4, A = [[0.0, 1.0], [-1.0, 0.0]] }]"}
NEAREST = {"sensor": 'off_grid = "nearest"'}
RATE = {"sensor": "rate = [1.0]"}
DIFFERENT: dict[str, tuple[dict[str, str], dict[str, str]]] = {
    "A": ({}, {"A": "[[0.0, 1.0], [0.0, 0.5]]"}),
    "B": ({}, {"B": "[[0.0], [2.0]]"}),
    "N": ({}, {"N": "[[0.0], [2.0]]"}),
    "C": ({}, {"C": "[[1.0, 0.5]]"}),
    "a": ({}, {"model": "offset = [0.0, 1.0]"}),
    "D": ({}, {"sensor": "D = [[1.0]]"}),
    "d": ({}, {"sensor": "offset = [1.0]"}),
    "period": ({}, {"sensor": "period = [360.0]"}),
    "continuous, and that a domain holds at every moment": ({}, FLOW),
    "rates": (FLOW, FLOW | {"A": "[[0.0, 1.0], [0.0, 0.5]]"}),
    "schedule": ({}, LATER),
    "step of the schedule": (LATER, {"model": LATER["model"].replace("from = 4", "from = 5")}),
    "matrix of the schedule": (LATER, {"model": LATER["model"].replace("-1.0", "-2.0")}),
    "dt of a continuous model": (FLOW, FLOW | {"dt": '"1/3"'}),
    "start of a continuous model": (FLOW, FLOW | {"start": "100.000000001"}),
    "dt of a schedule": (LATER, LATER | {"dt": "0.2"}),
    "off_grid": ({}, NEAREST),
    "rate": ({}, RATE),
    "another rate": (RATE, {"sensor": "rate = [2.0]"}),
    "start, with a rate": (RATE, RATE | {"start": "0"}),
}
EQUAL: dict[str, tuple[dict[str, str], dict[str, str]]] = {
    "bounds": ({}, {"rho": "[0.6]", "r": "[0.7]"}),
    "error of a clock": (FLOW, FLOW | {"sensor": 'time_error = "5ms"'}),
    "dt of a discrete model": ({}, {"dt": "0.2", "start": "0"}),
}


def pair(folder: Path, parts: tuple[dict[str, str], dict[str, str]]) -> list[Configuration]:
    found = []
    for name, changes in zip(("one", "other"), parts, strict=True):
        (folder / f"{name}.toml").write_text(MESH.format(**(PLAIN | changes)))
        found.append(load(folder / f"{name}.toml"))
    return found


def first_messages(configuration: Configuration) -> list[Message]:
    """A measurement, the inputs of two steps, and what a filter makes of them."""
    common = {"v": 1, "boot": "1" * 16, "sent_ns": 0, "origin_ns": 0, "model": configuration.digest()}
    told: list[Message] = [Measurement(**common, src="sensor/gauge", seq=0, step=1, y=[0.25], time_ns=0)]
    told += [Input(**common, src="plant/plant", seq=k, step=k, u=[0.0]) for k in (1, 2)]
    box = FilterNode(configuration, "box", "2" * 16)
    for message in told:
        box.deliver(key("pair", message.topic, message.name), encode(message), 0)
    sets = [message for message in box.tick(10 * SECOND) if isinstance(message, Posterior)]
    assert sets, "the filter takes what its own mesh says"
    return [*told, *sets[:1]]


def heard(configuration: Configuration, messages: list[Message]) -> tuple[FilterNode, FusionNode]:
    """A filter that is given the measurement and the inputs, a fusion that is given the set and the inputs."""
    box, main = FilterNode(configuration, "box", "3" * 16), FusionNode(configuration, "main", "4" * 16)
    for message in messages:
        address, payload = key("pair", message.topic, message.name), encode(message)
        for node in (box, main):
            if (message.topic, message.name) in node.subscriptions():
                node.deliver(address, payload, 0)
    box.tick(10 * SECOND)
    main.tick(10 * SECOND)
    return box, main


@pytest.mark.parametrize("item", DIFFERENT)
def test_peers_of_other_mathematics_refuse_one_another(tmp_path: Path, item: str) -> None:
    one, other = pair(tmp_path, DIFFERENT[item])
    for ours, theirs in ((one, other), (other, one)):
        box, main = heard(ours, first_messages(theirs))
        for node, count in ((box, 1), (main, 1)):
            assert node.admission.refused["model"] >= count
            assert sum(node.admission.refused.values()) == node.admission.refused["model"]
            assert (node.admission.received, node.current, node.last_posterior) == (0, None, None)
            assert node.admission.counters["refused.model"] == node.admission.refused["model"]
            assert f"made for model {theirs.digest()}" in node.admission.last_refusal


@pytest.mark.parametrize("item", EQUAL)
def test_peers_of_other_bounds_understand_one_another(tmp_path: Path, item: str) -> None:
    one, other = pair(tmp_path, EQUAL[item])
    for ours, theirs in ((one, other), (other, one)):
        box, main = heard(ours, first_messages(theirs))
        for node in (box, main):
            assert not node.admission.refused
            assert node.last_posterior is not None
            assert node.last_posterior.step >= 1
