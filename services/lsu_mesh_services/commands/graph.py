"""``lsu-mesh graph``: who publishes what to whom, from the configuration and, with ``--live``, who is there."""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable, Sequence

from lsu_mesh.mesh.access import EVERY_PEER
from lsu_mesh.mesh.config import Configuration
from lsu_mesh.mesh.flows import Flow, Peer, flows, in_order
from lsu_mesh_services.configuration import load_or_explain
from lsu_mesh_services.exit_codes import OK, USAGE

PRESENCE_S = 1.0
"""Tokens of the peers that are present arrive at once."""
SHAPES = {"sensor": "oval", "fusion": "hexagon"}


def main(options: argparse.Namespace) -> int:
    if options.live:
        from lsu_mesh_services.monitoring.subscriber import run_tool

        return run_tool(
            options, lambda configuration, _: _draw(configuration, options, _present(configuration, options))
        )
    configuration = load_or_explain(options.config, options, makes_filters=False)
    return USAGE if configuration is None else _draw(configuration, options, None)


def _draw(configuration: Configuration, options: argparse.Namespace, there: set[str] | None) -> int:
    peers, own = in_order(configuration), _own(configuration)
    drawn: Callable[[Sequence[Peer], Sequence[Flow], set[str] | None], str] = (
        dot if options.dot else mermaid if options.mermaid else lines if options.json else text
    )
    print(drawn(peers, own, there))
    return OK


def _own(configuration: Configuration) -> list[Flow]:
    """Without what every peer tells the recorder."""
    return [flow for flow in flows(configuration) if flow.topic not in EVERY_PEER]


def _present(configuration: Configuration, options: argparse.Namespace) -> set[str]:
    from lsu_mesh_services.monitoring.subscriber import watching

    there: set[str] = set()
    with watching(configuration, options) as watch:
        watch.listen([])
        for heard in watch.received(PRESENCE_S):
            if heard is not None and heard.message is None:
                (there.add if heard.is_there else there.discard)(heard.name)
    return there


def text(peers: Sequence[Peer], found: Sequence[Flow], there: set[str] | None) -> str:
    """Each peer with what it publishes, and who reads that."""
    told = []
    for role, name in peers:
        presence = "" if there is None else " – there" if name in there else " – not there"
        told.append(f"{role} {name}{presence}" if role != name else f"{role}{presence}")
        own = [flow for flow in found if (flow.role, flow.name) == (role, name)]
        width = max((len(flow.address) for flow in own), default=0)
        told += [
            f"  {flow.address:<{width}} → {', '.join(other for _, other in flow.readers) or 'no reader'}"
            for flow in own
        ]
    strangers = sorted((there or set()) - {name for _, name in peers})
    told += [f"{name} – there, but not of this configuration" for name in strangers]
    return "\n".join([*told, "health and event of every peer → recorder"])


def dot(peers: Sequence[Peer], found: Sequence[Flow], there: set[str] | None) -> str:
    """For Graphviz; a peer that is not there is dashed."""
    nodes = [
        f'  "{name}" [label="{name}\\n{role}", shape={SHAPES.get(role, "box")}{_dashed(name, there)}];'
        for role, name in peers
        if role != "recorder"
    ]
    edges = [
        f'  "{publisher}" -> "{reader}" [label="{", ".join(topics)}"];'
        for (publisher, reader), topics in _edges(found).items()
    ]
    return "\n".join(["digraph mesh {", "  rankdir=LR;", *nodes, *edges, "}"])


def _dashed(name: str, there: set[str] | None) -> str:
    return "" if there is None or name in there else ", style=dashed"


def mermaid(peers: Sequence[Peer], found: Sequence[Flow], there: set[str] | None) -> str:
    """For Mermaid; a peer that is not there is dashed."""
    number = {name: f"p{i}" for i, (_, name) in enumerate(peers)}
    nodes = [f'  {number[name]}["{name}<br>{role}"]' for role, name in peers if role != "recorder"]
    edges = [
        f"  {number[publisher]} -->|{', '.join(topics)}| {number[reader]}"
        for (publisher, reader), topics in _edges(found).items()
    ]
    away = [number[name] for role, name in peers if role != "recorder" and there is not None and name not in there]
    marks = [f"  classDef away stroke-dasharray: 4 4\n  class {','.join(away)} away"] if away else []
    return "\n".join(["flowchart LR", *nodes, *edges, *marks])


def _edges(found: Sequence[Flow]) -> dict[tuple[str, str], list[str]]:
    """Topics from publisher to reader; the recorder, which reads everything, is left out of drawings."""
    edges: dict[tuple[str, str], list[str]] = {}
    for flow in found:
        for role, reader in flow.readers:
            if role != "recorder":
                edges.setdefault((flow.name, reader), []).append(flow.topic)
    return edges


def lines(peers: Sequence[Peer], found: Sequence[Flow], there: set[str] | None) -> str:
    """For programs."""
    told: list[dict[str, object]] = [
        {"type": "peer", "role": role, "name": name, "there": None if there is None else name in there}
        for role, name in peers
    ]
    told += [
        {"type": "key", "topic": flow.topic, "name": flow.name, "role": flow.role,
         "readers": [reader for _, reader in flow.readers]}
        for flow in found
    ]  # fmt: skip
    return "\n".join(json.dumps(one) for one in told)
