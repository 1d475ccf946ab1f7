"""Programs of others as sensors of real processes: any order of start, restarts, wrong clocks, copies."""

from __future__ import annotations

import random
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from external_mesh import MESH, ExternalMesh
from lsu_mesh_services.bus import Bus, Clock, SessionSettings

from lsu_mesh.mesh.config.load import load
from lsu_mesh.mesh.model_answer import encode_model, model_answer

pytestmark = pytest.mark.live
ALONE = MESH[: MESH.index("[filters.cz]")]
"""One filter and no fusion."""
PEERS = (("filter", "box"), ("filter", "cz"), ("fusion", "main"))


@pytest.fixture(scope="module")
def mesh(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ExternalMesh]:
    """Two filters and a fusion, started by hand, with two sensors that are programs."""
    with ExternalMesh(tmp_path_factory.mktemp("external")) as mesh:
        mesh.program("gauge")
        mesh.program("speed")
        for role, name in PEERS:
            mesh.start(role, name)
        mesh.until(lambda: all(mesh.flows(name) for _, name in PEERS), "estimates flow")
        yield mesh
        assert mesh.outside == []


def all_flow(mesh: ExternalMesh) -> bool:
    return all(mesh.flows(name) and not mesh.last[name]["missing"] for _, name in PEERS)


def test_peers_started_by_hand_agree_on_one_start_that_the_fusion_decides(mesh: ExternalMesh) -> None:
    assert len(set(mesh.starts.values())) == 1
    start = next(iter(mesh.starts.values()))
    assert abs(start - time.time_ns()) < 120 * 10**9
    words = {child.name: "\n".join(child.words) for child in mesh.supervisor.children}
    assert "the mesh starts now" in words["main"]
    assert "the mesh starts now" not in words["box"] + words["cz"]


def test_who_is_killed_comes_back_with_the_same_start_and_the_present_step(mesh: ExternalMesh) -> None:
    before = dict(mesh.starts)
    for _, name in PEERS:
        child = next(one for one in mesh.supervisor.children if one.name == name)
        assert child.process is not None
        child.process.kill()
        mesh.until(lambda child=child: child.restarts > 0, f"{name} is started again")
        mesh.until(lambda: all_flow(mesh), f"estimates flow after {name} came back")
    assert mesh.starts == before
    for _, name in PEERS:
        step_ns = next(iter(before.values())) + mesh.last[name]["step"] * 10**8
        assert abs(step_ns - time.time_ns()) < 2 * 10**9


def test_a_sensor_that_starts_again_and_counts_from_0_is_taken_at_once(mesh: ExternalMesh) -> None:
    old = next(one for one in mesh.programs if one.name == "gauge")
    mesh.end(old)
    mesh.until(lambda: "gauge" in mesh.last["box"]["missing"], "it is missed")
    mesh.program("gauge")
    mesh.until(lambda: all_flow(mesh), "estimates flow", 5.0)


@pytest.mark.parametrize("offset_s", [3600.0, 10.0, -10.0, -3600.0])
def test_a_clock_that_is_wrong_is_named_and_heals(mesh: ExternalMesh, offset_s: float) -> None:
    sensor = next(one for one in mesh.programs if one.name == "gauge")
    reason = "refused.future" if offset_s > 0 else "refused.past"
    before = mesh.health["box"]["counters"].get(reason, 0)
    sensor.offset_ns = int(offset_s * 10**9)
    mesh.until(lambda: mesh.health["box"]["counters"].get(reason, 0) > before, "what it says is refused by name", 4.0)
    mesh.until(lambda: mesh.flows("box"), "the other sensor is enough", 5.0)
    sensor.offset_ns = 0
    mesh.until(lambda: all_flow(mesh), "it heals without a restart of others", 5.0)
    assert mesh.outside == []


def test_what_a_wrong_clock_has_stamped_is_not_taken_later_from_a_cache(mesh: ExternalMesh) -> None:
    """Ten seconds after a clock was ten seconds ahead, what it said then looks true."""
    sensor = next(one for one in mesh.programs if one.name == "gauge")
    sensor.offset_ns = 10 * 10**9
    time.sleep(3.0)
    sensor.offset_ns = 0
    wrong_since = time.monotonic()
    time.sleep(6.5)
    child = next(one for one in mesh.supervisor.children if one.name == "box")
    assert child.process is not None
    child.process.kill()
    mesh.until(lambda: time.monotonic() > wrong_since + 13.0, "what was stamped then is of the past", 15.0)
    mesh.until(lambda: all_flow(mesh), "estimates flow")
    assert mesh.outside == []


def test_copies_and_data_in_disorder_change_nothing(mesh: ExternalMesh) -> None:
    for program in mesh.programs:
        program.copies = program.holds_back = True
    since = time.monotonic()
    mesh.until(lambda: time.monotonic() > since + 2.0 and all_flow(mesh), "estimates flow", 10.0)
    for program in mesh.programs:
        program.copies = program.holds_back = False


def test_a_peer_that_meets_an_earlier_start_begins_again_and_says_so(tmp_path: Path) -> None:
    with ExternalMesh(tmp_path, ALONE) as mesh:
        mesh.program("gauge")
        mesh.program("speed")
        mesh.start("filter", "box")
        mesh.until(lambda: mesh.flows("box"), "estimates flow")
        earlier = min(mesh.starts.values()) - 7 * 10**9 - 3
        answer = encode_model(model_answer(load(mesh.file).started(earlier), "0" * 16))
        with Bus(SessionSettings(connect=(mesh.entry,)), Clock()) as other:
            other.answer("lsu/v1/own/model", lambda: ("lsu/v1/own/model", answer, "application/msgpack"))
            other.declare_alive("lsu/v1/own/live/other")
            digest = load(mesh.file).started(earlier).digest()
            mesh.until(lambda: mesh.last["box"]["model"] == digest, "it goes on with the earlier start", 20.0)
            mesh.until(lambda: mesh.flows("box"), "estimates flow")
        assert any(one["code"] == "start-changed" for one in mesh.events)
        assert mesh.outside == []


@pytest.mark.soak
def test_two_hundred_faults_with_real_processes(tmp_path: Path) -> None:
    """Restarts, clock steps, copies, disorder and kills of peers, each while estimates flow."""
    rng = random.Random(16)
    with ExternalMesh(tmp_path) as mesh:
        for name in ("gauge", "speed"):
            mesh.program(name)
        for role, name in PEERS:
            mesh.start(role, name)
        mesh.until(lambda: all_flow(mesh), "estimates flow")
        refused = 0
        for i in range(200):
            program = rng.choice(mesh.programs)
            kind = rng.choice(("restart", "clock", "clock", "copies", "disorder", "kill"))
            if kind == "restart":
                mesh.end(program)
                time.sleep(rng.uniform(0.0, 1.0))
                mesh.program(program.name)
            elif kind == "clock":
                refused += 1
                program.offset_ns = round(rng.choice((-1, 1)) * 10 ** rng.uniform(10.0, 12.556))
                time.sleep(rng.uniform(0.3, 1.5))
                program.offset_ns = 0
            elif kind == "kill":
                child = rng.choice(mesh.supervisor.children)
                assert child.process is not None
                child.process.kill()
                mesh.supervisor.watch(time.monotonic())
            else:
                program.copies, program.holds_back = kind == "copies", kind == "disorder"
                time.sleep(rng.uniform(0.3, 1.5))
                program.copies = program.holds_back = False
            mesh.until(lambda: all_flow(mesh), f"estimates flow after {kind} number {i}", 30.0)
            assert mesh.outside == [], (i, kind)
        counters = mesh.health["box"]["counters"]
        print(f"{dict(mesh.sets)} sets, {refused} clock steps, {counters}")
        assert sum(mesh.sets.values()) > 5000
        assert refused > 20
