"""The relay has the keys, readers and order of the mesh."""

from __future__ import annotations

from collections import deque

from lsu_mesh_services.benchmarks.relay_plan import RelayPart, relay_plan
from lsu_mesh_services.benchmarks.relay_process import MAX_PENDING, StepsAwaited, step_of, step_payload

from lsu_mesh.experiments.mesh_speed.benchmark_mesh import configuration
from lsu_mesh.experiments.mesh_speed.local_steps import message_sizes

MESH = configuration(50.0, 4)
SIZES = message_sizes(MESH, 10)


def test_a_part_for_every_peer_that_survives_its_text() -> None:
    parts = relay_plan(MESH, SIZES, recorder=True)
    assert [part.label for part in parts] == [f"{role} {name}" for role, name in MESH.peers()]
    assert all(RelayPart.read(part.text()) == part for part in parts)
    assert [part.label for part in parts if part.rate] == ["plant plant"]
    assert {part.links for part in relay_plan(MESH, SIZES, recorder=False)} == {len(parts) - 1}


def test_a_step_passes_through_all_parts_and_every_message_is_sent_once() -> None:
    parts = relay_plan(MESH, SIZES, recorder=False)
    counts = {part.label: StepsAwaited(part.awaits) for part in parts}
    sent: dict[str, int] = {}
    queue = deque(part for part in parts if part.rate)
    while queue:
        for address, size in queue.popleft().sends.items():
            assert address not in sent
            sent[address] = size
            queue.extend(part for part in parts if address in part.reads and counts[part.label].complete(address, 7))
    assert sent == SIZES


def test_steps_that_never_become_complete_are_forgotten() -> None:
    counts = StepsAwaited(("a", "b"))
    for step in range(2 * MAX_PENDING):
        assert not counts.complete("a", step)
    assert not counts.complete("b", 0), "forgotten"
    assert counts.complete("b", 2 * MAX_PENDING - 1)
    assert not counts.complete("c", 5), "of somebody else"


def test_a_message_has_its_step_and_its_size() -> None:
    assert len(step_payload(258, 100)) == 100
    assert step_of(step_payload(258, 100)) == 258
    assert step_of(step_payload(3, 1)) == 3, "a step is never cut off"
