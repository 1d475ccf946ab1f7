"""The fusion node when its sources are late, silent, or contradict it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from lsu_mesh.mesh.keys import key
from lsu_mesh.mesh.messages import Bounds, Fused, OrthotopeMessage, Posterior, encode
from lsu_mesh.mesh.nodes.node import Node

MakeMesh = Callable[..., Any]
STEPS = 40


def holds_truth(mesh: Any, name: str) -> bool:
    truth = mesh.truth()
    return all(
        all(low <= x <= high for low, x, high in zip(p.lower, truth[p.step], p.upper, strict=True))
        for p in mesh.posteriors(name)
    )


def test_a_late_posterior_refines_its_step_and_what_follows(mesh_of: MakeMesh) -> None:
    kept: list[tuple[str, bytes]] = []
    is_open = [False]

    def carry(address: str, payload: bytes, node: Node) -> bool:
        import msgpack

        late = address.endswith("posterior/cz") and node.name == "main" and msgpack.unpackb(payload)["step"] == 30
        if late and not is_open[0]:
            kept.append((address, payload))
            return False
        return True

    mesh = mesh_of(f"mesh.steps={STEPS}", carry=carry)
    mesh.run(STEPS * 0.02 + 0.3)
    before = mesh.newest("main")
    assert before[30].missing == ["cz"]
    is_open[0] = True
    node = mesh.nodes["main"]
    mesh.publish(node, node.deliver(*kept[0], mesh.now))
    mesh.turn()
    after = mesh.newest("main")
    assert after[30].revision == 1
    assert after[30].missing == []
    assert holds_truth(mesh, "main")
    orderly = mesh_of(f"mesh.steps={STEPS}")
    orderly.run(STEPS * 0.02 + 0.3)
    assert {k: p.support for k, p in after.items()} == {k: p.support for k, p in orderly.newest("main").items()}


def test_with_one_source_dead_the_fusion_goes_on_and_names_it(mesh_of: MakeMesh) -> None:
    mesh = mesh_of(f"mesh.steps={STEPS}")
    mesh.run(0.3)
    mesh.kill("box")
    mesh.run(STEPS * 0.02 + 0.3)
    newest = mesh.newest("main")
    assert max(newest) == STEPS
    assert newest[STEPS].missing == ["box"]
    assert newest[STEPS].status == "ok"
    assert holds_truth(mesh, "main")


def test_a_source_that_is_known_to_be_gone_is_not_waited_for(mesh_of: MakeMesh) -> None:
    mesh = mesh_of(f"mesh.steps={STEPS}")
    mesh.kill("box")
    mesh.nodes["main"].absent.add("box")
    mesh.run(STEPS * 0.02 + 0.3)
    delays = [p.sent_ns - p.origin_ns for p in mesh.posteriors("main")]
    assert len(delays) == STEPS
    assert max(delays) < 0.05e9


def posterior_of(mesh: Any, name: str, step: int, lower: list[float], upper: list[float], seq: int) -> bytes:
    content: dict[str, Any] = {
        "v": 1, "src": f"filter/{name}", "boot": "f" * 16, "seq": seq, "step": step, "sent_ns": mesh.now,
        "origin_ns": mesh.now, "model": mesh.configuration.digest(), "kind": "LSUO",
        "support": OrthotopeMessage(lower=lower, upper=upper), "lower": lower, "upper": upper, "point": lower,
        "log_volume": None, "volume_of": "support", "status": "ok", "revision": 0, "epoch": 0, "guarantee": "declared",
        "base": "prior", "used": [], "bounds": Bounds(rho=[0.1] * 3, r=[]), "missing": [],
    }  # fmt: skip
    return encode(Posterior(**content))


@pytest.fixture
def hand_fed(mesh_of: MakeMesh) -> Any:
    """Only the plant and the fusion run; the test speaks for the filters."""
    mesh = mesh_of("mesh.steps=10")
    for name in ("box", "para", "cz", "s1", "s2", "s3"):
        mesh.kill(name)
    return mesh


def feed(mesh: Any, step: int, sets: dict[str, tuple[list[float], list[float]]]) -> Fused:
    for name, (lower, upper) in sets.items():
        mesh.hand_over(key("demo", "posterior", name), posterior_of(mesh, name, step, lower, upper, step))
    mesh.turn()
    fused = mesh.newest("main")[step]
    assert isinstance(fused, Fused)
    return fused


def test_when_the_own_prediction_is_disjoint_from_agreeing_sources_it_is_dropped(hand_fed: Any) -> None:
    hand_fed.turn()
    far = ([90.0] * 3, [91.0] * 3)
    fused = feed(hand_fed, 1, dict.fromkeys(("box", "para", "cz"), far))
    assert fused.status == "restarted"
    assert fused.epoch == 1
    assert fused.rejected == []
    assert np.allclose(fused.lower, far[0], atol=1e-9)
    assert np.allclose(fused.upper, far[1], atol=1e-9)
    assert hand_fed.events("prediction-dropped")


def test_a_source_disjoint_from_the_others_and_the_prediction_is_left_out_by_name(hand_fed: Any) -> None:
    hand_fed.turn()
    near = ([-1.0] * 3, [1.0] * 3)
    fused = feed(hand_fed, 1, {"box": ([90.0] * 3, [91.0] * 3), "para": near, "cz": near})
    assert [r.source for r in fused.rejected] == ["box"]
    assert fused.status == "ok"
    assert fused.upper == pytest.approx([1.0] * 3)
    (event,) = hand_fed.events("source-rejected")
    assert event.about == {"source": "box", "step": 1}


def test_a_source_whose_status_is_not_sound_is_ignored(mesh_of: MakeMesh) -> None:
    fault = 'sensors.s2.faults=[{kind="bias", from=20, to=20, size=5.0}]'
    mesh = mesh_of(f"mesh.steps={STEPS}", fault)
    mesh.run(STEPS * 0.02 + 0.3)
    fused = mesh.newest("main")[20]
    assert [(r.source, r.reason) for r in fused.rejected] == [
        ("box", "status inconsistent"),
        ("cz", "status inconsistent"),
    ]
    assert [reference[1] for reference in fused.used] == ["plant/plant", "filter/para"]
    assert holds_truth(mesh, "main")


def test_a_fusion_that_starts_late_starts_from_what_its_sources_say_together(mesh_of: MakeMesh) -> None:
    mesh = mesh_of("mesh.steps=100")
    mesh.kill("main")
    mesh.run(1.0)
    mesh.start("fusion", "main")
    mesh.run(1.5)
    posteriors = mesh.posteriors("main")
    assert posteriors[0].step > 45
    assert posteriors[0].base == "sources"
    assert posteriors[0].status == "restarted"
    assert {topic for topic, *_ in posteriors[0].used} == {"posterior"}
    assert posteriors[-1].step == 100
    assert holds_truth(mesh, "main")
