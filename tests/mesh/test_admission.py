"""Admission: new, known and sound messages are let in once."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import msgpack
import pytest

from lsu_mesh.mesh.admission import MAX_NAMES, Admission
from lsu_mesh.mesh.config import Configuration, load
from lsu_mesh.mesh.messages import Measurement, decode, encode

KEY = "lsu/v1/demo/measurement/s1"


@pytest.fixture
def configuration(demo: Path) -> Configuration:
    return load(demo)


@pytest.fixture
def admission(configuration: Configuration) -> Admission:
    return Admission(configuration, ["measurement"])


def payload(configuration: Configuration, **changes: Any) -> bytes:
    content: dict[str, Any] = {
        "v": 1, "src": "sensor/s1", "boot": "0" * 16, "seq": 0, "step": 1, "sent_ns": 1, "origin_ns": 1,
        "model": configuration.digest(), "y": [0.5], "time_ns": 0,
    }  # fmt: skip
    return encode(Measurement(**(content | changes)))


def test_a_copy_is_counted_and_not_passed_on(admission: Admission, configuration: Configuration) -> None:
    message = payload(configuration)
    assert admission.admit(KEY, message) is not None
    assert admission.admit(KEY, message) is None
    assert admission.counters == {"received": 1, "duplicates": 1, "gaps": 0}


def test_what_is_given_up_stays_counted_until_it_comes(admission: Admission, configuration: Configuration) -> None:
    for seq in (0, 1, 6):
        admission.admit(KEY, payload(configuration, seq=seq))
    admission.expect(KEY, "0" * 16, 5, 9)
    assert admission.gaps == 7, "2 to 5, and 7 to 9 behind the newest; 6 has come"
    assert admission.admit(KEY, payload(configuration, seq=8)) is not None
    assert admission.gaps == 6
    admission.expect(KEY, "1" * 16, 0, 99)
    assert admission.gaps == 106, "a boot of which nothing ever came"


def test_gaps_of_boots_that_are_forgotten_stay_counted(admission: Admission, configuration: Configuration) -> None:
    for boot in range(40):
        for seq in (0, 2):
            admission.admit(KEY, payload(configuration, seq=seq, boot=f"{boot:016x}"))
    assert admission.gaps == 40


def test_another_boot_starts_its_own_sequence(admission: Admission, configuration: Configuration) -> None:
    assert admission.admit(KEY, payload(configuration)) is not None
    assert admission.admit(KEY, payload(configuration, boot="1" * 16)) is not None


@pytest.mark.parametrize(
    ("key", "changes", "reason"),
    [
        ("lsu/v1/demo/posterior/box", {}, "key"),
        ("lsu/v1/other/measurement/s1", {}, "key"),
        ("lsu/v2/demo/measurement/s1", {}, "key"),
        (KEY, {"src": "sensor/s2"}, "source"),
        (KEY, {"src": "filter/s1"}, "source"),
        ("lsu/v1/demo/measurement/s9", {"src": "sensor/s9"}, "unknown"),
        (KEY, {"model": "0123456789abcdef"}, "model"),
        (KEY, {"y": [0.5, 0.5]}, "shape"),
        (KEY, {"step": 0}, "step"),
    ],
)
def test_what_does_not_belong_here_is_refused_by_reason(
    admission: Admission, configuration: Configuration, key: str, changes: dict[str, Any], reason: str
) -> None:
    assert admission.admit(key, payload(configuration, **changes)) is None
    assert admission.refused == {reason: 1}
    assert reason in admission.last_refusal


def newer(configuration: Configuration, *fields: str, **changes: Any) -> bytes:
    """A payload with further fields."""
    return msgpack.packb(msgpack.unpackb(payload(configuration, **changes)) | dict.fromkeys(fields, 1))


def test_a_message_with_unknown_fields_counts_once_and_each_field_by_name(
    admission: Admission, configuration: Configuration
) -> None:
    assert admission.admit(KEY, newer(configuration, "colour", "shade")) is not None
    assert admission.admit(KEY, newer(configuration, "colour", seq=1)) is not None
    assert admission.admit(KEY, newer(configuration, "colour", seq=1)) is None, "a copy"
    assert admission.admit(KEY, newer(configuration, "colour", seq=2, src="sensor/s2")) is None, "not the owner"
    assert admission.admit(KEY, payload(configuration, seq=3)) is not None
    assert admission.counters == {
        "received": 3, "duplicates": 1, "gaps": 1, "refused.source": 1, "unknown fields": 2,
        "unknown fields.measurement.colour": 2, "unknown fields.measurement.shade": 1,
    }  # fmt: skip


def test_names_of_unknown_fields_do_not_fill_the_memory(admission: Admission, configuration: Configuration) -> None:
    for seq in range(3 * MAX_NAMES):
        assert admission.admit(KEY, newer(configuration, f"field {seq}", seq=seq)) is not None
    assert admission.with_unknown_fields == 3 * MAX_NAMES
    assert len(admission.unknown_fields) == MAX_NAMES


def test_a_measurement_without_a_step_gets_that_of_its_time(admission: Admission, configuration: Configuration) -> None:
    timed = payload(configuration, step=0, time_ns=60_000_000, time_error_ns=0)
    message = decode("measurement", timed)
    assert isinstance(message, Measurement)
    assert (message.step, message.time_error_ns) == (0, 0)
    placed = admission.admit(KEY, timed)
    assert placed is not None
    assert placed.step == 3


def test_a_step_that_does_not_fit_the_time_is_refused(admission: Admission, configuration: Configuration) -> None:
    assert admission.admit(KEY, payload(configuration, step=4, time_ns=60_000_000, time_error_ns=0)) is None
    assert admission.refused == {"time": 1}


def test_the_time_of_a_measurement_that_tells_no_error_is_not_read(
    admission: Admission, configuration: Configuration
) -> None:
    message = admission.admit(KEY, payload(configuration, step=4, time_ns=60_000_000))
    assert message is not None
    assert message.step == 4


@pytest.mark.parametrize(("time_ns", "error_ns"), [(60_000_003, 0), (60_000_000, 1)])
def test_a_discrete_model_refuses_data_between_its_steps(
    admission: Admission, configuration: Configuration, time_ns: int, error_ns: int
) -> None:
    between = payload(configuration, step=0, time_ns=time_ns, time_error_ns=error_ns)
    assert admission.admit(KEY, between) is None
    assert admission.refused == {"off the grid": 1}
    assert "s1 at " in admission.last_refusal


def test_data_within_the_tolerance_are_of_the_step(configuration: Configuration) -> None:
    sensors = {"s1": replace(configuration.sensors["s1"], tolerance_ns=5)}
    near = Admission(replace(configuration, sensors={**configuration.sensors, **sensors}), ["measurement"])
    for seq, time_ns in enumerate((59_999_995, 60_000_005)):
        message = near.admit(KEY, payload(configuration, seq=seq, step=0, time_ns=time_ns, time_error_ns=0))
        assert message is not None
        assert message.step == 3


def test_several_measurements_of_one_step_are_admitted(admission: Admission, configuration: Configuration) -> None:
    assert admission.admit(KEY, payload(configuration, seq=0, step=5)) is not None
    assert admission.admit(KEY, payload(configuration, seq=1, step=5, y=[None])) is not None
