"""Every set that a mesh publishes is recomputed from its provenance, bit by bit, whatever the mesh went through."""

from __future__ import annotations

import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from msgspec import structs

from lsu_mesh.mesh.messages import Fused, Input, Measurement, Message, Posterior, Prediction, decode, encode
from lsu_mesh.mesh.verification import Verification, verify

MakeMesh = Callable[..., Any]
DOMAIN = (
    "model.domain.lower=[-100.0, -100.0, -100.0]",
    "model.domain.upper=[100.0, 100.0, 100.0]",
)


def recorded(mesh: Any) -> list[Message]:
    """Everything that was published, as a recorder would read it."""
    return [decode(message.topic, encode(message)) for _, message in mesh.sent]


def verified(mesh: Any, leave_out: Callable[[Message], bool] = lambda message: False) -> Verification:
    return verify(mesh.configuration, [message for message in recorded(mesh) if not leave_out(message)])


def check(mesh: Any) -> Verification:
    """All sets equal, none unverifiable, none misses the truth; the verification for more."""
    found = verified(mesh)
    assert [str(difference) for difference in found.differences[:3]] == []
    assert [str(missing) for missing in found.unverifiable[:3]] == []
    assert [str(miss) for miss in found.containment.misses[:3]] == []
    sets = [message for _, message in mesh.sent if isinstance(message, Posterior | Prediction)]
    assert found.exact.total() == len(sets) > 0
    assert found.holds
    return found


def lossy(seed: int, share: float = 0.2) -> Callable[..., bool]:
    """Measurements get lost on their way to some, sets on their way to others."""
    rng = np.random.default_rng(seed)

    def carry(address: str, payload: bytes, node: object) -> bool:
        return not any(f"/{topic}/" in address for topic in ("measurement", "posterior")) or rng.random() >= share

    return carry


@pytest.mark.parametrize("seed", [None, 3])
def test_a_recording_without_predictions(mesh_of: MakeMesh, seed: int | None) -> None:
    mesh = mesh_of("mesh.steps=100", carry=None if seed is None else lossy(seed))
    for node in mesh.nodes.values():
        node.predicts = False
    mesh.run(2.6)
    assert mesh.of(Prediction) == []
    found = check(mesh)
    assert set(found.exact) == {("filter/box", "posterior"), ("filter/cz", "posterior"), ("filter/para", "posterior"),
                                ("fusion/main", "fused")}  # fmt: skip
    assert found.exact.total() == found.containment.holding >= 390


def test_the_demo(mesh_of: MakeMesh) -> None:
    mesh = mesh_of("mesh.steps=100")
    mesh.run(2.2)
    found = check(mesh)
    assert found.exact["filter/cz", "posterior"] == found.exact["fusion/main", "fused"] == 100
    assert found.containment.holding == found.exact.total() - 3, "all but the predictions of step 101"
    assert not found.containment.excused


@pytest.mark.parametrize("kind", ["LSUPB", "ZonotopicKalman", "predictor form", "nearest point", "WindowMAP", "Kalman"])
def test_every_kind_of_filter_with_data_missing(mesh_of: MakeMesh, kind: str) -> None:
    options = {
        "LSUPB": ['filters.box.kind="LSUPB"', 'filters.para.kind="LSUPB"'],
        "ZonotopicKalman": ['filters.box.kind="ZonotopicKalman"'],
        "predictor form": ['filters.box.kind="ZonotopicKalman"', 'filters.box.form="predictor"'],
        "WindowMAP": ['filters.box.kind="WindowMAP"', "filters.box.window=5", 'fusion.main.sources=["cz", "para"]'],
        "Kalman": [
            'filters.box.kind="Kalman"',
            'filters.para.kind="TruncatedKalman"',
            'fusion.main.sources=["cz"]',
            *DOMAIN,
        ],
        "nearest point": ['filters.cz.point="nearest"'],
    }[kind]
    mesh = mesh_of("mesh.steps=60", *options, carry=lossy(1))
    mesh.run(2.0)
    check(mesh)
    is_estimate = kind in ("WindowMAP", "Kalman")
    assert {message.guarantee for message in mesh.posteriors("box")} == {"none" if is_estimate else "declared"}


@pytest.mark.parametrize("way", ["predictor", "fused"])
def test_with_transfer(mesh_of: MakeMesh, way: str) -> None:
    ways = [f'filters.{name}.transfer="{way}"' for name in ("box", "para", "cz")]
    mesh = mesh_of("mesh.steps=60", *ways, carry=lossy(2, 0.05))
    mesh.run(2.0)
    check(mesh)
    assert any(message.gain is not None for message in mesh.posteriors("box"))


def test_with_the_formal_transfer_of_output_predictors(mesh_of: MakeMesh) -> None:
    sharp = ("sensors.s4={C=[[1.0, 0.0, 0.5]], r=[0.05]}", 'filters.sharp={kind="LSUCZ", sensors=["s2", "s3", "s4"]}')
    way = ('filters.box.transfer="data-predictor"', 'filters.box.transfer_from=["sharp"]', "sensors.s1.r=[1.0]")
    mesh = mesh_of("mesh.steps=60", *sharp, *way)
    mesh.run(1.6)
    check(mesh)
    assert any(message.guarantee == "none" for message in mesh.posteriors("box"))


def test_a_filter_and_the_fusion_are_killed_and_start_again(mesh_of: MakeMesh) -> None:
    mesh = mesh_of("mesh.steps=150")
    mesh.run(0.8)
    mesh.kill("box")
    mesh.run(0.4)
    mesh.start("filter", "box")
    mesh.run(0.6)
    mesh.kill("main")
    mesh.run(0.3)
    mesh.start("fusion", "main")
    mesh.run(2.0)
    check(mesh)
    assert len({message.boot for message in mesh.posteriors("box")}) == 2
    assert any(
        isinstance(message.base, tuple) and message.base[1] == "fusion/main" for message in mesh.posteriors("box")
    )


def test_contradictions_resets_and_epochs(mesh_of: MakeMesh) -> None:
    fault = 'sensors.s1.faults=[{kind="bias", from=30, to=60, size=6.0}]'
    mesh = mesh_of("mesh.steps=100", fault, *DOMAIN, "filters.box.reset_after=2", 'filters.para.transfer="fused"')
    mesh.run(2.5)
    found = check(mesh)
    assert mesh.events("reset")
    assert {message.status for message in mesh.posteriors("box")} == {"ok", "inconsistent", "restarted"}
    assert list(found.containment.broken) == ["s1"]
    assert found.containment.excused["sensor s1"] > 0


def test_a_fusion_that_drops_its_own_prediction(mesh_of: MakeMesh) -> None:
    fault = 'sensors.s1.faults=[{kind="bias", from=30, to=40, size=6.0}]'
    options = [
        'filters.box.on_inconsistency="widen"',
        'filters.box.sensors=["s1"]',
        'fusion.main.sources=["box", "para"]',
    ]
    mesh = mesh_of("mesh.steps=80", fault, *DOMAIN, *options, "filters.para.reset_after=1")
    mesh.run(2.0)
    check(mesh)
    assert any(message.base == "sources" for message in mesh.posteriors("main"))


def test_the_relaxed_fusion_of_a_liar(mesh_of: MakeMesh, root: Path) -> None:
    mesh = mesh_of("mesh.steps=180", file=root / "examples" / "liar.toml")
    mesh.run(4.0)
    found = check(mesh)
    assert found.containment.excused.keys() <= {"guarantee 'learned'", "sensor c"}
    assert found.containment.broken["c"].startswith("step 10")


def test_a_long_backlog_whose_intermediate_sets_are_not_published(mesh_of: MakeMesh) -> None:
    mesh = mesh_of("mesh.steps=300", "mesh.rate=1000.0", *DOMAIN, 'filters.box.transfer="fused"')
    mesh.kill("box")
    mesh.kill("main")
    mesh.run(0.4)
    node, fusion = mesh.start("filter", "box"), mesh.start("fusion", "main")
    for address, message in list(mesh.sent):
        for late in (node, fusion):
            if isinstance(message, Input | Measurement | Posterior) and listens(late, message):
                late.deliver(address, encode(message), mesh.now)
    mesh.run(1.0)
    check(mesh)
    assert node.counters()["behind"] > 100
    assert fusion.counters()["behind"] > 100
    assert max(len(message.used) for message in mesh.posteriors("main")) > 200, "one set is made from many steps"


def listens(node: Any, message: Message) -> bool:
    return (message.topic, message.name) in node.subscriptions()


def test_an_input_that_is_missing_and_bounded(mesh_of: MakeMesh) -> None:
    lost = range(40, 45)

    def carry(address: str, payload: bytes, node: object) -> bool:
        return "/input/" not in address or decode("input", payload).step not in lost

    box = ("model.input_box.lower=[-6.0]", "model.input_box.upper=[6.0]")
    mesh = mesh_of("mesh.steps=60", *box, carry=carry)
    mesh.run(2.5)
    found = verified(mesh, lambda message: isinstance(message, Input) and message.step in lost)
    assert not found.differences
    assert not found.unverifiable
    assert found.holds


def test_one_bit_of_one_measurement_is_found_at_its_place(mesh_of: MakeMesh) -> None:
    mesh = mesh_of("mesh.steps=60")
    mesh.run(1.5)
    messages = recorded(mesh)
    at = next(i for i, m in enumerate(messages) if isinstance(m, Measurement) and (m.name, m.step) == ("s2", 41))
    messages[at] = structs.replace(messages[at], y=[flipped(messages[at].y[0], 20)])  # type: ignore[attr-defined]
    found = verify(mesh.configuration, messages)
    assert not found.holds
    assert {(difference.peer, difference.step) for difference in found.differences} == {
        ("filter/box", 41),
        ("filter/cz", 41),
    }, "each set is recomputed from recorded messages alone, so only those that used the measurement differ"
    first = found.differences[0]
    assert first.recorded != first.recomputed
    assert first.field.startswith(("lower[", "upper[", "point["))
    assert f"{first.peer}, step 41, {first.field} of posterior" in str(first)


@pytest.mark.parametrize("kind", [Posterior, Prediction, Fused])
def test_one_bit_of_a_published_set_is_found(mesh_of: MakeMesh, kind: type[Message]) -> None:
    mesh = mesh_of("mesh.steps=30")
    mesh.run(1.0)
    messages = recorded(mesh)
    at = next(i for i, m in enumerate(messages) if type(m) is kind and m.step == 20)
    changed = messages[at]
    assert isinstance(changed, Posterior | Prediction)
    messages[at] = structs.replace(changed, lower=[flipped(changed.lower[0], 0), *changed.lower[1:]])
    found = verify(mesh.configuration, messages)
    first = found.differences[0]
    assert (first.peer, first.step, first.field) == (changed.src, 20, "lower[0]")
    assert first.recomputed == changed.lower[0]


def flipped(value: float, bit: int) -> float:
    """The number with one bit of its 64 changed; 0 is the last of the mantissa."""
    (number,) = struct.unpack("<Q", struct.pack("<d", value))
    return float(struct.unpack("<d", struct.pack("<Q", number ^ (1 << bit)))[0])


def test_what_the_recorder_missed_is_unverifiable_by_name_and_the_rest_is_exact(mesh_of: MakeMesh) -> None:
    mesh = mesh_of("mesh.steps=60")
    mesh.run(1.5)
    gap = range(20, 30)
    found = verified(mesh, lambda message: message.step in gap and message.name in ("s2", "cz"))
    assert not found.differences
    by_peer = {missing.peer for missing in found.unverifiable}
    assert by_peer == {"filter/box", "filter/cz", "fusion/main"}
    words = [str(missing) for missing in found.unverifiable]
    assert any("filter/box, step 20, posterior" in line and "of sensor/s2" in line for line in words)
    after = [missing for missing in found.unverifiable if missing.step > gap.stop]
    assert after == [], "a set is made from the set before, which is a message, so a gap does not spread"
    assert found.exact["filter/para", "posterior"] == 60


def test_a_set_that_misses_the_truth_without_any_excuse_is_named(mesh_of: MakeMesh) -> None:
    mesh = mesh_of("mesh.steps=40", *DOMAIN)
    mesh.run(1.0)
    messages = recorded(mesh)
    at = next(i for i, m in enumerate(messages) if m.topic == "truth" and m.step == 30)
    messages[at] = structs.replace(messages[at], x=[90.0, 0.0, 0.0])  # type: ignore[attr-defined]
    measured = [i for i, m in enumerate(messages) if isinstance(m, Measurement) and m.step == 30]
    for i in measured:  # as if the sensors had seen it
        row = np.array(mesh.configuration.sensors[messages[i].name].C[0])
        messages[i] = structs.replace(messages[i], y=[float(row @ [90.0, 0.0, 0.0])])  # type: ignore[attr-defined]
    found = verify(mesh.configuration, messages)
    assert not found.holds
    assert found.containment.misses
    assert {miss.step for miss in found.containment.misses} == {30}
    assert "misses the truth" in str(found.containment.misses[0])


def test_fusions_of_fusions(mesh_of: MakeMesh) -> None:
    more = ('fusion.top.sources=["main", "box"]', 'filters.para.transfer="fused"', 'filters.para.from=["main"]')
    mesh = mesh_of("mesh.steps=40", *more[:2], carry=lossy(3, 0.1))
    mesh.run(1.5)
    check(mesh)
    assert mesh.posteriors("top")


@pytest.mark.parametrize("kind", ["WindowMAP", "TruncatedKalman", "LSUO"])
def test_messages_that_overtake_one_another_on_their_way_to_the_recorder(mesh_of: MakeMesh, kind: str) -> None:
    options = (f'filters.box.kind="{kind}"', 'fusion.main.sources=["cz", "para"]', 'filters.para.transfer="predictor"')
    mesh = mesh_of("mesh.steps=60", *options, *DOMAIN)
    mesh.run(1.5)
    messages = recorded(mesh)
    order = np.argsort(np.arange(len(messages)) + np.random.default_rng(4).uniform(0.0, 60.0, len(messages)))
    shuffled = [messages[i] for i in order]
    found, in_order = verify(mesh.configuration, shuffled), verify(mesh.configuration, messages)
    assert [str(missing) for missing in found.unverifiable[:3]] == []
    assert found.holds
    assert found.exact == in_order.exact
    assert found.containment.excused == in_order.containment.excused


def test_excuses_do_not_depend_on_the_order_of_arrival(mesh_of: MakeMesh) -> None:
    """A prediction that comes before the posterior it was made from rests on the same broken sensor."""
    mesh = mesh_of("mesh.steps=60", "sensors.s2.simulated_r=[0.6]", *DOMAIN)
    mesh.run(1.5)
    messages = recorded(mesh)
    found = verify(mesh.configuration, sorted(messages, key=lambda message: isinstance(message, Posterior)))
    assert found.containment.excused == verify(mesh.configuration, messages).containment.excused
    assert found.containment.excused["sensor s2"] > 10
    assert found.holds


def test_a_circle_of_bases_ends(mesh_of: MakeMesh) -> None:
    mesh = mesh_of("mesh.steps=10")
    mesh.run(1.0)
    messages = recorded(mesh)
    at = [i for i, m in enumerate(messages) if isinstance(m, Posterior) and m.name == "box"][3:5]
    for i, other in (at, at[::-1]):
        messages[i] = structs.replace(messages[i], base=messages[other].reference)  # type: ignore[type-var]
    found = verify(mesh.configuration, messages)
    assert [difference.peer for difference in found.differences[:1]] == ["filter/box"]
