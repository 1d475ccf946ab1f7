"""Banks under seeded loss, copies, delays and restarts: every set holds its target, and all are recomputed."""

from __future__ import annotations

import random
from pathlib import Path

import pytest
from bank_mesh import DOMAIN, targets, truths
from local_mesh import MILLISECOND, LocalMesh

from lsu_mesh.mesh.bank_messages import INCONSISTENT, BankSets, BankTruth
from lsu_mesh.mesh.nodes.bank_filter import BankFilterNode
from lsu_mesh.mesh.nodes.bank_fusion import BankFusionNode
from lsu_mesh.mesh.nodes.node import Node
from lsu_mesh.mesh.verification import verify

FUSION = (
    "filters.second={kind='LSUPB',sensors=['lidar','radar'],instances=12}",
    "fusion.main={sources=['targets','second']}",
)
LOST, LATE, COPIED = 0.1, 0.2, 0.1
"""Shares of the payloads."""
MAX_DELAY_MS = 400
STEPS = 40


class Disorder:
    """What happens to each payload on its way, from a seed."""

    def __init__(self, seed: int) -> None:
        self.rng = random.Random(seed)
        self.under_way: list[tuple[int, str, bytes, str]] = []
        self.mesh: LocalMesh | None = None

    def carry(self, address: str, payload: bytes, node: Node) -> bool:
        """Whether it arrives at once; what comes late, or once more, is under way."""
        assert self.mesh is not None
        lot = self.rng.random()
        delay = self.rng.randint(1, MAX_DELAY_MS) * MILLISECOND
        if lot < LATE + COPIED:
            self.under_way.append((self.mesh.now + delay, address, payload, node.name))
        return lot >= LATE + LOST + COPIED or lot < COPIED

    def arrive(self) -> None:
        """What is due."""
        assert self.mesh is not None
        due = [one for one in self.under_way if one[0] <= self.mesh.now]
        self.under_way = [one for one in self.under_way if one[0] > self.mesh.now]
        for _, address, payload, name in due:
            node = self.mesh.nodes.get(name)
            if node is not None:
                self.mesh.publish(node, node.deliver(address, payload, self.mesh.now))


def run(folder: Path, seed: int) -> LocalMesh:
    """A mesh with and without a domain, in which each peer may be killed and started again."""
    disorder = Disorder(seed)
    domain = (DOMAIN,) if seed % 2 else ()
    disorder.mesh = mesh = LocalMesh(targets(folder, *FUSION, *domain), disorder.carry)
    roles = {name: role for role, name in mesh.configuration.peers() if role != "recorder"}
    down: dict[str, int] = {}
    while mesh.now < 6_000 * MILLISECOND:
        mesh.turn()
        disorder.arrive()
        mesh.now += 10 * MILLISECOND
        if disorder.rng.random() < 0.01 and (name := disorder.rng.choice(sorted(roles))) in mesh.nodes:
            mesh.kill(name)
            down[name] = mesh.now + disorder.rng.randint(10, 800) * MILLISECOND
        for name in [name for name, until in down.items() if until <= mesh.now]:
            del down[name]
            node, fusion = mesh.start(roles[name], name), mesh.nodes.get("main")
            last = fusion.last_of.get(name) if isinstance(fusion, BankFusionNode) else None
            if isinstance(node, BankFilterNode) and last is not None and disorder.rng.random() < 0.7:
                node.receive(last, mesh.now)
    return mesh


@pytest.mark.parametrize("seed", range(12))
def test_sets_hold_and_are_recomputed(tmp_path: Path, seed: int) -> None:
    mesh = run(tmp_path, seed)
    x, sets = truths(mesh.sent), [one for _, one in mesh.sent if isinstance(one, BankSets)]
    assert len(sets) > STEPS
    for one in sets:
        state = x[one.step].matrix("x")
        inside = ((one.matrix("lower") <= state) & (state <= one.matrix("upper"))).all(axis=1)
        assert (inside | (one.status_codes == INCONSISTENT)).all(), (one.src, one.step)
        assert (one.status_codes != INCONSISTENT).all(), "no bound is broken"
    found = verify(mesh.configuration, [message for _, message in mesh.sent])
    assert found.differences == []
    assert found.unverifiable == []
    assert found.exact.total() == len(sets)
    assert found.holds
    assert len({one.step for _, one in mesh.sent if isinstance(one, BankTruth)}) == STEPS
