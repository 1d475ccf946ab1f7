"""The table of policies: a third one is one entry and one function, and works from the configuration to the proof."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from local_mesh import LocalMesh
from msgspec import structs

from lsu_mesh import LSUCZ, ModelError, Orthotope, fuse
from lsu_mesh.fusion import policies
from lsu_mesh.fusion.intersection import Fusion, meet_bounds
from lsu_mesh.fusion.policies import POLICIES, Policy
from lsu_mesh.mesh.admission import Admission
from lsu_mesh.mesh.config import ConfigurationError, load
from lsu_mesh.mesh.keys import key
from lsu_mesh.mesh.messages import TYPES, Fused, decode, encode
from lsu_mesh.mesh.verification import verify
from lsu_mesh.supports.support import Support

BOXES = (Orthotope([0.0, 0.0], [2.0, 2.0]), Orthotope([1.0, -1.0], [3.0, 1.0]))


def meet_of_hulls(supports: Sequence[Support], faults: int) -> Fusion:
    """The intersection of the interval hulls: simple, and wider than that of the sets."""
    lower, upper = meet_bounds(supports)
    return Fusion(Orthotope(lower, upper), (lower, upper), 0.5 * lower + 0.5 * upper, ())


@pytest.fixture
def third(monkeypatch: pytest.MonkeyPatch) -> Policy:
    policy = Policy("hulls", meet_of_hulls, algorithm=7, takes_faults=False, sources_needed=lambda faults: 2)
    monkeypatch.setitem(POLICIES, policy.name, policy)  # type: ignore[arg-type]
    return policy


def test_a_third_policy_fuses(third: Policy) -> None:
    assert np.array_equal(fuse(BOXES, "hulls").bounds, [[1.0, 0.0], [2.0, 1.0]])
    with pytest.raises(ModelError, match='needs policy = "relaxed"; "hulls" trusts every source'):
        fuse(BOXES, "hulls", faults=1)


def test_a_third_policy_works_from_the_configuration_to_the_proof(third: Policy, demo: Path) -> None:
    more = 'fusion.top.sources=["main", "box"]'
    mesh = LocalMesh(load(demo, ["mesh.steps=30", 'fusion.main.policy="hulls"', more]))
    mesh.run(1.2)
    fused = mesh.posteriors("main")
    assert [message.step for message in fused] == list(range(1, 31))
    assert {(message.policy, message.algorithm) for message in fused if isinstance(message, Fused)} == {
        ("hulls", 7 + LSUCZ.algorithm - 1)
    }
    assert all(any(used[1] == "fusion/main" for used in message.used) for message in mesh.posteriors("top")[1:])
    found = verify(mesh.configuration, [decode(message.topic, encode(message)) for _, message in mesh.sent])
    assert [str(one) for one in (*found.differences, *found.false_claims, *found.containment.misses)] == []
    assert found.exact["fusion/main", "fused"] == 30


def test_a_policy_that_nobody_knows_is_a_mistake_of_the_configuration(demo: Path) -> None:
    with pytest.raises(ConfigurationError, match="hulls"):
        load(demo, ['fusion.main.policy="hulls"'])


def test_a_message_of_a_policy_that_this_peer_does_not_know_is_refused_with_the_reason(mesh_of_demo: LocalMesh) -> None:
    message = structs.replace(mesh_of_demo.posteriors("main")[0], policy="hulls")
    admission = Admission(mesh_of_demo.configuration, TYPES)
    address = key(mesh_of_demo.configuration.mesh.name, "fused", "main")
    assert admission.admit(address, encode(message)) is None
    assert admission.refused["policy"] == 1
    assert "'hulls', which this peer does not know (intersect, relaxed)" in admission.last_refusal


@pytest.fixture(scope="module")
def mesh_of_demo(demo: Path) -> LocalMesh:
    mesh = LocalMesh(load(demo, ["mesh.steps=5"]))
    mesh.run(0.5)
    return mesh


def test_every_policy_trusts_all_or_needs_more_sources_than_may_be_wrong() -> None:
    for policy in policies.POLICIES.values():
        for faults in range(5) if policy.takes_faults else (0,):
            assert policy.sources_needed(faults) > faults, policy.name
