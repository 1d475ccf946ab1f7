"""Who publishes what to whom is what the nodes themselves subscribe to and publish."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from lsu_mesh.mesh.flows import flows, in_order
from lsu_mesh.mesh.messages import Event, Health


def test_the_flows_of_the_demo_are_those_of_its_nodes(mesh_of: Callable[..., Any]) -> None:
    mesh = mesh_of("mesh.steps=8", 'filters.box.transfer="predictor"')
    mesh.run(0.3)
    found = {flow.address: flow for flow in flows(mesh.configuration)}
    said = {f"{message.topic}/{message.name}" for _, message in mesh.sent}
    assert said <= set(found)
    assert {address for address in found if not address.startswith(("event/", "health/"))} <= said
    for name, node in mesh.nodes.items():
        listened = {flow.address for flow in found.values() if name in [reader for _, reader in flow.readers]}
        assert listened == {f"{topic}/{other}" for topic, other in node.subscriptions()}
    unrecorded = {address for address, flow in found.items() if ("recorder", "recorder") not in flow.readers}
    assert unrecorded == {"prediction/box"}, "that of no other filter's use"
    for _, message in mesh.sent:
        if not isinstance(message, Health | Event):
            assert found[f"{message.topic}/{message.name}"].role == message.src.partition("/")[0]


def test_a_plant_without_inputs_publishes_none(mesh_of: Callable[..., Any]) -> None:
    mesh = mesh_of()
    without = mesh.configuration.base_model.replace(B=None)
    object.__setattr__(mesh.configuration, "base_model", without)
    assert "input/plant" not in {flow.address for flow in flows(mesh.configuration)}


def test_peers_come_in_the_order_of_the_data(mesh_of: Callable[..., Any]) -> None:
    names = [name for _, name in in_order(mesh_of().configuration)]
    assert names == ["plant", "s1", "s2", "s3", "box", "cz", "para", "main", "recorder"]
