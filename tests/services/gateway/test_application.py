"""The routes, without a network."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import pytest
from gateway_mesh import START_NS
from lsu_mesh_services.gateway.application import PAGE, Parts, application
from lsu_mesh_services.gateway.board import Board
from lsu_mesh_services.gateway.event_stream import Clients
from lsu_mesh_services.gateway.http_address import HttpAddress, allowed_hosts
from lsu_mesh_services.gateway.measurement_request import MAX_BODY, Reading
from lsu_mesh_services.gateway.publisher import Publisher
from prometheus_client.openmetrics.parser import text_string_to_metric_families
from starlette.testclient import TestClient

from lsu_mesh.mesh.config import Configuration
from lsu_mesh.mesh.measurement_time import placed
from lsu_mesh.mesh.messages import Measurement, Message

Make = Callable[..., Message]
TOKEN = "t" * 40
NOW = START_NS + 10**10
ALLOWED = {"authorization": f"Bearer {TOKEN}"}


class Recorded(Publisher):
    """Sends nothing."""

    def __init__(self) -> None:
        self.sent: list[tuple[str, Reading]] = []

    def publish(self, configuration: Configuration, name: str, reading: Reading) -> Measurement:
        self.sent.append((name, reading))
        fields = {"y": reading.y, "time_ns": reading.time_ns, "time_error_ns": reading.time_error_ns}
        return placed(
            configuration,
            Measurement(
                v=1, src=f"sensor/{name}", boot="0" * 16, seq=len(self.sent) - 1, step=0, sent_ns=NOW, origin_ns=NOW,
                model=configuration.digest(), **fields,
            ),
        )  # fmt: skip


@pytest.fixture
def parts(configuration: Configuration, board: Board) -> Parts:
    return Parts(lambda: configuration, board, Recorded(), TOKEN, lambda: NOW, Clients(4))


def client_of(parts: Parts) -> TestClient:
    app = application(parts, allowed_hosts(HttpAddress("127.0.0.1", 8080), []))
    return TestClient(app, base_url="http://127.0.0.1:8080")


@pytest.fixture
def client(parts: Parts) -> Iterator[TestClient]:
    with client_of(parts) as opened:
        yield opened


def test_health_is_503_while_a_peer_is_gone(client: TestClient, board: Board, message: Make) -> None:
    for peer in ("filter/box", "fusion/main", "sensor/gauge", "sensor/file", "recorder/recorder", "plant/plant"):
        board.record(message("health", src=peer, role=peer.split("/")[0]), START_NS)
    board.check(START_NS)
    answer = client.get("/health")
    assert (answer.status_code, answer.json()["level"]) == (200, "OK")
    board.record_presence("box", is_there=False)
    board.check(START_NS)
    answer = client.get("/health")
    assert (answer.status_code, answer.json()["level"]) == (503, "STALE")
    assert {peer["name"]: peer["level"] for peer in answer.json()["peers"]}["box"] == "STALE"


def test_the_model_names_states_estimators_and_external_sensors(client: TestClient) -> None:
    model = client.get("/model").json()
    assert (model["states"], model["units"]) == (["position", "speed"], ["m", "m/s"])
    assert model["start_ns"] == str(START_NS)
    assert model["external"] == ["gauge"]
    assert model["mesh"] == "lab"
    assert [(one["name"], one["topic"]) for one in model["estimators"]] == [("main", "fused"), ("box", "posterior")]


def test_metrics_are_openmetrics(client: TestClient, board: Board, message: Make) -> None:
    board.record(message("posterior"), START_NS)
    board.record(message("health"), NOW - 250_000_000)
    board.check(NOW)
    answer = client.get("/metrics", headers={"accept": "application/openmetrics-text"})
    assert answer.headers["content-type"].startswith("application/openmetrics-text; version=1")
    samples = {
        (sample.name, *sorted(sample.labels.items())): sample.value
        for family in text_string_to_metric_families(answer.text)
        for sample in family.samples
    }
    box = (("estimator", "box"), ("topic", "posterior"))
    assert samples["lsu_estimate_width", box[0], ("state", "position"), box[1]] == 1.0
    assert samples["lsu_estimate_width", box[0], ("state", "speed"), box[1]] == 0.5
    assert samples["lsu_estimate_step", *box] == 42
    assert samples["lsu_estimate_age_seconds", *box] == 10.0
    assert samples["lsu_estimates_total", *box] == 1
    peer = (("peer", "box"), ("role", "filter"))
    assert samples["lsu_peer_health", ("lsu_peer_health", "OK"), *peer] == 1
    assert samples["lsu_peer_health", ("lsu_peer_health", "STALE"), *peer] == 0
    assert samples["lsu_peer_heartbeat_age_seconds", *peer] == 0.25
    assert samples["lsu_peer_count_total", *peer, ("what", "received")] == 84
    plain = client.get("/metrics")
    assert plain.headers["content-type"].startswith("text/plain")


def post(client: TestClient, body: Any, name: str = "gauge", **headers: str) -> Any:
    content = body if isinstance(body, bytes) else json.dumps(body)
    return client.post(f"/measurements/{name}", content=content, headers={**ALLOWED, **headers})


def test_a_measurement_is_published_and_told_with_its_step(client: TestClient, parts: Parts) -> None:
    answer = post(client, {"y": [1.5, None], "time": "2026-05-01T12:00:00.25Z", "time_error": "2ms"})
    assert answer.status_code == 202
    assert answer.json() == {
        "src": "sensor/gauge", "boot": "0" * 16, "seq": "0", "step": 3,
        "time_ns": str(START_NS + 250_000_000), "time_error_ns": "2000000",
    }  # fmt: skip
    assert isinstance(parts.publisher, Recorded)
    assert parts.publisher.sent == [("gauge", Reading([1.5, None], START_NS + 250_000_000, 2_000_000))]


@pytest.mark.parametrize("given", ["", "Bearer", "Bearer wrong", f"Basic {TOKEN}", f"Bearer {TOKEN}x", TOKEN])
def test_without_the_token_nothing_is_published(client: TestClient, parts: Parts, given: str) -> None:
    answer = post(client, {"y": [1, 2]}, authorization=given)
    assert answer.status_code == 401
    assert answer.headers["www-authenticate"] == "Bearer"
    assert "Authorization: Bearer TOKEN" in answer.json()["remedy"]
    assert isinstance(parts.publisher, Recorded)
    assert parts.publisher.sent == []


def test_where_no_sensor_is_external_nobody_may_publish(parts: Parts) -> None:
    with client_of(replace(parts, token=None)) as client:
        answer = post(client, {"y": [1, 2]})
        assert answer.status_code == 403
        assert 'source = "external"' in answer.json()["remedy"]


@pytest.mark.parametrize(
    ("name", "body", "status"),
    [
        ("nobody", {"y": [1, 2]}, 404), ("file", {"y": [1]}, 409), ("gauge", {"y": [1]}, 422), ("gauge", b"{", 400),
        ("gauge", b" " * (MAX_BODY + 1), 413),
    ],
)  # fmt: skip
def test_mistakes_have_their_status_and_a_remedy(client: TestClient, name: str, body: Any, status: int) -> None:
    answer = post(client, body, name)
    assert answer.status_code == status
    assert answer.json()["remedy"]


def test_every_file_of_the_page_is_served_and_may_load_nothing_from_elsewhere(client: TestClient) -> None:
    for name, kind in {"": "text/html", **PAGE}.items():
        answer = client.get(f"/{name}") if name != "index.html" else client.get("/")
        assert answer.status_code == 200, name
        assert answer.headers["content-type"].startswith(kind.split(";")[0]), name
        assert "://" not in answer.text.replace("http://www.w3.org/2000/svg", ""), name
        policy = answer.headers["content-security-policy"]
        assert "default-src 'none'" in policy
        assert "unsafe" not in policy
        assert "access-control-allow-origin" not in answer.headers


def test_a_name_that_is_not_ours_is_refused(client: TestClient) -> None:
    answer = client.get("/health", headers={"host": "evil.com:8080"})
    assert answer.status_code == 421
    assert answer.json()["value"] == "evil.com:8080"
    assert "--host NAME" in answer.json()["remedy"]


def test_pages_of_other_origins_are_refused(client: TestClient) -> None:
    assert post(client, {"y": [1, 2]}, origin="http://evil.com").status_code == 403
    assert post(client, {"y": [1, 2]}, origin="http://127.0.0.1:8080").status_code == 202
    assert client.get("/health", headers={"origin": "null"}).status_code == 403


@pytest.mark.parametrize(
    ("method", "path", "status"),
    [
        ("GET", "/nothing", 404), ("POST", "/health", 405), ("GET", "/measurements/gauge", 405),
        ("GET", "/estimates/nobody", 404), ("GET", "/estimates?rate=0", 400), ("GET", "/estimates?rate=nan", 400),
        ("GET", "/estimates?rate=1e9", 400), ("GET", "/estimates?full=yes", 400), ("GET", "/../mesh.toml", 404),
    ],
)  # fmt: skip
def test_what_there_is_not_is_said(client: TestClient, method: str, path: str, status: int) -> None:
    answer = client.request(method, path)
    assert answer.status_code == status
    assert answer.json()["remedy"]


def test_so_many_streams_and_no_more(client: TestClient, parts: Parts) -> None:
    parts.clients.open = parts.clients.most
    answer = client.get("/estimates")
    assert answer.status_code == 503
    assert "no more are served" in answer.json()["error"]
