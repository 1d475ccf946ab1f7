"""What sets say of themselves is proved: each claim, altered in a recorded stream, is found and named."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from msgspec import structs

from lsu_mesh.mesh.messages import (
    Fused,
    Measurement,
    Message,
    Posterior,
    Prediction,
    Rejection,
    Truth,
    decode,
    encode,
)
from lsu_mesh.mesh.verification import Verification, verify

MakeMesh = Callable[..., Any]
Alter = Callable[[Any], dict[str, Any]]
STEP = 25
OTHER_MARK = ("filter/para", "00000000000000ff", 3)


def recorded(mesh: Any) -> list[Message]:
    return [decode(message.topic, encode(message)) for _, message in mesh.sent]


@pytest.fixture(scope="module")
def plain(module_mesh: MakeMesh) -> Any:
    """The demo, with a sensor that is silent at one step."""
    mesh = module_mesh("mesh.steps=40", 'sensors.s1.faults=[{kind="lost", from=20, to=20}]')
    mesh.run(1.5)
    return mesh


@pytest.fixture(scope="module")
def liar(root: Path) -> Any:
    """Four sources of a relaxed fusion, one of which lies and is quarantined."""
    from local_mesh import LocalMesh

    from lsu_mesh.mesh.config import load

    mesh = LocalMesh(load(root / "examples" / "liar.toml", ["mesh.steps=140"]))
    mesh.run(3.5)
    return mesh


def altered(mesh: Any, name: str, alter: Alter, choose: Callable[[Any], bool]) -> tuple[Message, Verification]:
    """One set of a peer with other claims, and what the verification of everything says."""
    messages = recorded(mesh)
    at = next(i for i, m in enumerate(messages) if m.name == name and choose(m))
    messages[at] = structs.replace(messages[at], **alter(messages[at]))
    return messages[at], verify(mesh.configuration, messages)


def assert_found(message: Message, found: Verification, claim: str) -> None:
    """The altered claim is named with its set, and the recording does not hold."""
    named = {(one.peer, one.topic, one.step, one.seq, one.field) for one in found.false_claims}
    assert (message.src, message.topic, message.step, message.seq, claim) in named, found.false_claims
    assert not found.holds
    assert not found.differences, "the numbers are as they were"


def a_set(kind: type[Message], step: int = STEP) -> Callable[[Any], bool]:
    return lambda message: type(message) is kind and message.step == step


def test_what_is_not_altered_holds(plain: Any, liar: Any) -> None:
    for mesh in (plain, liar):
        found = verify(mesh.configuration, recorded(mesh))
        assert [str(one) for one in (*found.false_claims[:3], *found.differences[:3])] == []
        assert found.holds


@pytest.mark.parametrize("kind", [Posterior, Prediction])
@pytest.mark.parametrize(
    ("claim", "alter"),
    [
        ("guarantee", lambda m: {"guarantee": "learned"}),
        ("guarantee", lambda m: {"guarantee": "none"}),
        ("epoch", lambda m: {"epoch": m.epoch + 1}),
        ("descent", lambda m: {"descent": [OTHER_MARK]}),
    ],
)
def test_where_a_set_comes_from(plain: Any, kind: type[Message], claim: str, alter: Alter) -> None:
    assert_found(*altered(plain, "box", alter, a_set(kind)), claim)


@pytest.mark.parametrize(
    ("claim", "alter"),
    [
        ("guarantee", lambda m: {"guarantee": "learned"}),
        ("epoch", lambda m: {"epoch": 2}),
        ("descent", lambda m: {"descent": m.descent[1:]}),
        ("descent", lambda m: {"descent": [*m.descent, OTHER_MARK]}),
        ("status", lambda m: {"status": "predicted"}),
        ("status", lambda m: {"status": "restarted"}),
        ("status", lambda m: {"status": "inconsistent"}),
        ("missing", lambda m: {"missing": ["box"]}),
        ("missing", lambda m: {"missing": ["nobody"]}),
        ("rejected", lambda m: {"rejected": [Rejection(source="box", reason="status inconsistent")]}),
        ("quarantined", lambda m: {"quarantined": ["para"]}),
        ("policy", lambda m: {"policy": "relaxed"}),
        ("faults", lambda m: {"faults": 1}),
    ],
)
def test_claims_of_a_fused_set(plain: Any, claim: str, alter: Alter) -> None:
    assert_found(*altered(plain, "main", alter, a_set(Fused)), claim)


@pytest.mark.parametrize("status", ["predicted", "restarted", "inconsistent"])
def test_status_of_a_filter(plain: Any, status: str) -> None:
    assert_found(*altered(plain, "box", lambda m: {"status": status}, a_set(Posterior)), "status")


def test_the_first_epoch(plain: Any) -> None:
    assert_found(*altered(plain, "box", lambda m: {"epoch": 1}, a_set(Posterior, 1)), "epoch")


def test_a_prediction_whose_posterior_the_recorder_missed_is_not_accused(plain: Any) -> None:
    messages = [m for m in recorded(plain) if not (isinstance(m, Posterior) and (m.name, m.step) == ("box", STEP))]
    found = verify(plain.configuration, messages)
    assert found.false_claims == []
    assert found.unproved["epoch: of a prediction whose posterior the recorder missed"] == 1
    assert found.holds


def test_a_sensor_that_was_there_and_one_that_was_not(plain: Any) -> None:
    for missing in (["s1"], ["s9"], ["s2", "s1"]):
        changed = altered(plain, "para", lambda m, names=missing: {"missing": names}, a_set(Posterior))
        assert_found(*changed, "missing")
    messages = [m for m in recorded(plain) if not (isinstance(m, Measurement) and (m.name, m.step) == ("s1", 20))]
    found = verify(plain.configuration, messages)
    assert {one.field for one in found.false_claims} == {"missing"}, "nobody knows of the nil that s1 sent"


@pytest.mark.parametrize(
    ("claim", "alter"),
    [
        ("rejected", lambda m: {"rejected": []}),
        ("rejected", lambda m: {"rejected": [*m.rejected, Rejection(source="fa", reason=m.rejected[0].reason)]}),
        ("quarantined", lambda m: {"quarantined": []}),
        ("quarantined", lambda m: {"quarantined": ["fa", *m.quarantined]}),
        ("faults", lambda m: {"faults": 2}),
        ("policy", lambda m: {"policy": "intersect"}),
    ],
)
def test_claims_of_a_fusion_with_a_liar(liar: Any, claim: str, alter: Alter) -> None:
    assert_found(*altered(liar, "main", alter, lambda m: isinstance(m, Fused) and m.rejected and m.quarantined), claim)


def test_a_reset_is_told_by_an_event(module_mesh: MakeMesh) -> None:
    mesh = module_mesh(
        "mesh.steps=60",
        'sensors.s1.faults=[{kind="bias", from=30, to=60, size=6.0}]',
        "model.domain.lower=[-100.0, -100.0, -100.0]",
        "model.domain.upper=[100.0, 100.0, 100.0]",
        "filters.box.reset_after=2",
    )
    mesh.run(2.0)
    messages = recorded(mesh)
    assert verify(mesh.configuration, messages).holds
    found = verify(mesh.configuration, [m for m in messages if m.topic != "event"])
    assert {"epoch", "status"} <= {one.field for one in found.false_claims if one.peer == "filter/box"}


def test_a_guarantee_that_a_set_only_claims_excuses_no_miss(plain: Any) -> None:
    """The truth lies elsewhere; the set says that it is not guaranteed, and nothing that it was made from agrees."""
    messages = recorded(plain)
    at = next(i for i, m in enumerate(messages) if isinstance(m, Truth) and m.step == STEP)
    x = [value + 1000.0 for value in plain.truth()[STEP]]
    messages[at] = structs.replace(messages[at], x=x)  # type: ignore[type-var]
    for i, message in enumerate(messages):
        if isinstance(message, Prediction) and message.step == STEP:
            messages[i] = structs.replace(message, guarantee="none")
    found = verify(plain.configuration, messages)
    assert {(miss.peer, miss.topic) for miss in found.containment.misses if miss.topic == "prediction"} == {
        ("filter/box", "prediction"),
        ("filter/cz", "prediction"),
        ("filter/para", "prediction"),
    }
    assert not any("guarantee" in reason for reason in found.containment.excused)


def test_what_only_the_process_knows_is_counted_by_name(module_mesh: MakeMesh) -> None:
    """A measurement that the recorder got and the filter did not: lost or late, nobody else can tell."""
    from local_mesh import LocalMesh

    configuration = module_mesh("mesh.steps=40").configuration
    mesh = LocalMesh(
        configuration,
        lambda address, payload, node: "/measurement/s1" not in address or decode("measurement", payload).step != 20,
    )
    mesh.run(1.5)
    found = verify(configuration, recorded(mesh))
    assert found.holds
    assert found.unproved["missing: whether what s1 sent came late or never"] >= 1


@pytest.mark.parametrize("is_whole", [True, False], ids=["it published no set of the step", "the recorder missed it"])
def test_a_source_that_a_set_does_not_speak_of_sent_nothing_or_is_not_recorded(plain: Any, is_whole: bool) -> None:
    def of_para(message: Message) -> bool:
        return isinstance(message, Posterior) and message.name == "para"

    messages = [one for one in recorded(plain) if one.name != "para" or one.step != STEP]
    if is_whole:
        messages = [
            structs.replace(one, seq=one.seq - 1) if of_para(one) and one.step > STEP else one for one in messages
        ]
    at = next(i for i, one in enumerate(messages) if isinstance(one, Fused) and one.step == STEP)
    fused = messages[at]
    assert isinstance(fused, Fused)
    used = [reference for reference in fused.used if reference[1] != "filter/para"]
    messages[at] = structs.replace(fused, used=used)
    found = verify(plain.configuration, messages)
    claims = [one for one in found.false_claims if (one.peer, one.step, one.field) == ("fusion/main", STEP, "missing")]
    words = "missing: what para sent, because the recorder missed some of it"
    assert (len(claims), found.unproved[words]) == ((1, 0) if is_whole else (0, 1))
