"""Bodies of ``POST /measurements/NAME``."""

from __future__ import annotations

import json

import pytest
from gateway_mesh import START_NS
from lsu_mesh_services.gateway.measurement_request import Reading, read_reading, sensor_of
from lsu_mesh_services.gateway.refusal import Refusal

from lsu_mesh.mesh.config import Configuration

NOW = START_NS + 10 * 10**9


def read(configuration: Configuration, body: object) -> Reading:
    text = body if isinstance(body, bytes) else json.dumps(body).encode()
    return read_reading(sensor_of(configuration, "gauge"), text, NOW)


@pytest.mark.parametrize(
    ("time", "ns"),
    [
        ("now", NOW),
        (str(NOW - 1), NOW - 1),
        ("2026-05-01T12:00:00Z", START_NS),
        ("2026-05-01T14:00:00.123456789+02:00", START_NS + 123_456_789),
        ("2026-05-01T12:00:00.5", START_NS + 500_000_000),
    ],
)
def test_times_are_exact(configuration: Configuration, time: str, ns: int) -> None:
    assert read(configuration, {"y": [1, 2.5], "time": time}) == Reading([1.0, 2.5], ns, 1_000_000)


def test_what_is_left_out_is_now_and_the_error_of_the_configuration(configuration: Configuration) -> None:
    assert read(configuration, {"y": [None, 2]}) == Reading([None, 2.0], NOW, 1_000_000)


@pytest.mark.parametrize(("text", "ns"), [("2ms", 2_000_000), (0.25, 250_000_000), (0, 0), ("0ms", 0)])
def test_the_error_of_a_time(configuration: Configuration, text: object, ns: int) -> None:
    assert read(configuration, {"y": [1, 2], "time_error": text}).time_error_ns == ns


@pytest.mark.parametrize(
    ("body", "status", "key", "words"),
    [
        (b"", 400, "", "not JSON"),
        (b'{"y": [1, NaN]}', 400, "", "not JSON"),
        (b"\xff", 400, "", "not JSON"),
        (b"[" * 100_000, 400, "", "not JSON"),
        ([1, 2], 400, "", "no object"),
        ({}, 422, "y", "missing"),
        ({"y": 1.0}, 422, "y", "expected a list of 2"),
        ({"y": [1]}, 422, "y", "1 entries, expected a list of 2"),
        ({"y": [1, "2"]}, 422, "y[1]", "finite number or null"),
        ({"y": [1, True]}, 422, "y[1]", "finite number or null"),
        (b'{"y": [1, 1e400]}', 400, "", "not JSON"),
        ({"y": [1, 10**400]}, 422, "y[1]", "finite number or null"),
        ({"y": [1, 2], "tiem": "now"}, 422, "tiem", "unknown key"),
        ({"y": [1, 2], "time": NOW}, 422, "time", "expected a string"),
        ({"y": [1, 2], "time": "yesterday"}, 422, "time", "no moment"),
        ({"y": [1, 2], "time": "9" * 19}, 422, "time", "no moment from 1970"),
        ({"y": [1, 2], "time": "1" * 4000}, 422, "time", "no moment from 1970"),
        ({"y": [1, 2], "time": "1969-05-01T12:00:00Z"}, 422, "time", "no moment from 1970"),
        ({"y": [1, 2], "time": "-5"}, 422, "time", "no moment"),
        ({"y": [1, 2], "time_error": "-1ms"}, 422, "time_error", "expected a duration"),
        ({"y": [1, 2], "time_error": "soon"}, 422, "time_error", "expected a duration"),
        ({"y": [1, 2], "time_error": None}, 422, "time_error", "expected a duration"),
    ],
)
def test_mistakes_are_named_with_their_remedy(
    configuration: Configuration, body: object, status: int, key: str, words: str
) -> None:
    with pytest.raises(Refusal, match=words) as refused:
        read(configuration, body)
    refusal = refused.value
    assert (refusal.status, refusal.key) == (status, key)
    assert refusal.remedy
    told = json.loads(refusal.response().body)
    assert set(told) == ({"error", "key", "value", "remedy"} if key else {"error", "remedy"})


def test_only_external_sensors_are_published(configuration: Configuration) -> None:
    with pytest.raises(Refusal, match="no sensor 'gage'") as refused:
        sensor_of(configuration, "gage")
    assert refused.value.status == 404
    assert "gauge" in refused.value.remedy
    with pytest.raises(Refusal, match="not external") as refused:
        sensor_of(configuration, "file")
    assert refused.value.status == 409
    assert 'source = "external"' in refused.value.remedy
