"""Transfer from neighbour to neighbour, without any fusion: over random graphs all learn what a hub would know."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

MakeMesh = Callable[..., Any]
Graph = Mapping[int, set[int]]
KINDS = ("LSUO", "LSUP", "LSUPB", "LSUCZ", "ZonotopicKalman")


def random_graph(count: int, seed: int) -> Graph:
    """A random tree with two edges more: connected, both ways."""
    rng = np.random.default_rng(seed)
    edges = {(int(rng.integers(0, i)), i) for i in range(1, count)}
    while len(edges) < count + 1:
        a, b = sorted(rng.choice(count, 2, replace=False).tolist())
        edges.add((a, b))
    return {i: {a + b - i for a, b in edges if i in (a, b)} for i in range(count)}


def diameter(graph: Graph) -> int:
    """The longest of the shortest paths."""
    longest = 0
    for start in graph:
        reached, steps = {start}, 0
        while len(reached) < len(graph):
            reached |= {other for node in reached for other in graph[node]}
            steps += 1
        longest = max(longest, steps)
    return longest


def gossip(graph: Graph, kinds: tuple[str, ...], A: str, rho: str, steps: int, seed: int) -> str:
    """Filters with a sensor each, who listen to their neighbours' predictions."""
    rng = np.random.default_rng(seed)
    lines = [
        f'[mesh]\nname = "gossip"\ndt = 0.02\nsteps = {steps}\nseed = {seed}',
        f"[model]\nA = {A}\nrho = {rho}\nprior = {{ lower = [-10.0, -10.0], upper = [10.0, 10.0] }}",
        "[plant]\nx1 = [1.0, -2.0]",
    ]
    for i, neighbours in graph.items():
        row = rng.normal(size=2).tolist()
        listed = ", ".join(f'"f{j}"' for j in sorted(neighbours))
        lines.append(f"[sensors.s{i}]\nC = [{row}]\nr = [{rng.uniform(0.2, 0.8)}]")
        lines.append(
            f'[filters.f{i}]\nkind = "{kinds[i % len(kinds)]}"\nsensors = ["s{i}"]\n'
            f'transfer = "predictor"\ntransfer_from = [{listed}]'
        )
    return "\n\n".join(lines)


def finished(mesh_of: MakeMesh, folder: Path, text: str, steps: int) -> Any:
    file = folder / "gossip.toml"
    file.write_text(text)
    mesh = mesh_of(file=file)
    mesh.run(steps * 0.02 + 0.3)
    return mesh


def outside(mesh: Any, name: str) -> list[int]:
    truth = mesh.truth()
    return [
        p.step
        for p in mesh.posteriors(name)
        if not all(low <= x <= high for low, x, high in zip(p.lower, truth[p.step], p.upper, strict=True))
    ]


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_on_a_static_state_all_reach_the_hull_of_a_hub_after_a_diameter_of_steps(
    mesh_of: MakeMesh, tmp_path: Path, seed: int
) -> None:
    steps, graph = 30, random_graph(8, seed)
    text = gossip(graph, ("LSUO",), "[[1.0, 0.0], [0.0, 1.0]]", "[0.0, 0.0]", steps, seed)
    mesh = finished(mesh_of, tmp_path, text, steps)
    newest = {f"f{i}": mesh.newest(f"f{i}") for i in graph}
    far = diameter(graph)
    assert far >= 3
    for k in range(5, steps + 1 - far):
        hub_lower = np.max([by_step[k].lower for by_step in newest.values()], axis=0)
        hub_upper = np.min([by_step[k].upper for by_step in newest.values()], axis=0)
        for name, by_step in newest.items():
            widths = np.subtract(by_step[k + far].upper, by_step[k + far].lower)
            assert (widths <= 1.01 * (hub_upper - hub_lower)).all(), (name, k)
    for name in newest:
        assert outside(mesh, name) == []


@pytest.mark.parametrize("seed", [1, 2])
def test_mixed_filters_on_a_moving_state_gain_by_gossip_and_hold_the_truth(
    mesh_of: MakeMesh, tmp_path: Path, seed: int
) -> None:
    steps, graph = 50, random_graph(6, seed)
    A, rho = "[[0.9, 0.3], [-0.3, 0.9]]", "[0.05, 0.05]"
    text = gossip(graph, KINDS, A, rho, steps, seed)
    together = finished(mesh_of, tmp_path, text, steps)
    alone = finished(mesh_of, tmp_path, text.replace('transfer = "predictor"', "").replace("transfer_from", "#"), steps)
    gains = []
    for i in graph:
        name = f"f{i}"
        assert outside(together, name) == []
        width, isolated = (
            np.mean([np.subtract(p.upper, p.lower) for p in mesh.newest(name).values()]) for mesh in (together, alone)
        )
        gains.append(width / isolated)
    assert max(gains) < 1.0
    assert np.mean(gains) < 0.8
