"""The routes of the gateway."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib.resources import files
from typing import Any

import msgspec
from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import Route
from starlette.types import ASGIApp

from lsu_mesh.mesh.config import Configuration
from lsu_mesh.mesh.config.problem import nearest
from lsu_mesh.mesh.json_form import Json, dumps
from lsu_mesh.mesh.model_answer import model_answer
from lsu_mesh_services.gateway.board import Board
from lsu_mesh_services.gateway.event_stream import Clients, EstimateFeed, EventFeed, EventStream, Feed, HealthFeed
from lsu_mesh_services.gateway.http_address import AllowedHosts
from lsu_mesh_services.gateway.measurement_request import MAX_BODY, read_reading, sensor_of
from lsu_mesh_services.gateway.metrics import MeshMetrics, exposition
from lsu_mesh_services.gateway.protection import Protection
from lsu_mesh_services.gateway.publisher import Publisher
from lsu_mesh_services.gateway.refusal import Refusal
from lsu_mesh_services.gateway.token import is_token

MAX_CLIENTS = 512
"""Streams that are open at a time."""
RATE_HZ, MAX_RATE_HZ = 10.0, 50.0
"""Parcels a second: so often a client is sent what is new."""
EVENT_RATE_HZ = 4.0
PAGE = {
    "index.html": "text/html; charset=utf-8",
    "gateway.css": "text/css; charset=utf-8",
    "gateway.js": "text/javascript; charset=utf-8",
    "stream.js": "text/javascript; charset=utf-8",
    "history.js": "text/javascript; charset=utf-8",
    "chart.js": "text/javascript; charset=utf-8",
    "peers.js": "text/javascript; charset=utf-8",
    "icon.svg": "image/svg+xml",
}
"""Files of the page."""
UNHEALTHY = ("ERROR", "STALE")


@dataclass(frozen=True)
class Parts:
    """What the routes stand on."""

    configuration: Callable[[], Configuration]
    """As it is known now: the start of the mesh may be told later."""
    board: Board
    publisher: Publisher | None
    token: str | None
    """None: no sensor is external, so that nobody may publish."""
    now: Callable[[], int]
    clients: Clients


def application(parts: Parts, hosts: AllowedHosts) -> ASGIApp:
    """An ASGI application."""
    routes = Routes(parts)
    listed = [
        Route("/", routes.page, name="index.html"),
        *(Route(f"/{name}", routes.page, name=name) for name in PAGE if name != "index.html"),
        Route("/estimates", routes.estimates),
        Route("/estimates/{name}", routes.estimates),
        Route("/events", routes.events),
        Route("/live", routes.live),
        Route("/health", routes.health),
        Route("/model", routes.model),
        Route("/metrics", routes.metrics),
        Route("/measurements/{name}", routes.measurement, methods=["POST"]),
    ]
    handlers: Mapping[Any, Any] = {Refusal: _refused, HTTPException: _not_served}
    return Protection(Starlette(routes=listed, exception_handlers=handlers), hosts)


class Routes:
    """One method per route."""

    def __init__(self, parts: Parts) -> None:
        self._parts = parts
        configuration = parts.configuration()
        self._metrics = MeshMetrics(configuration, parts.board, parts.clients, parts.now)
        folder = files("lsu_mesh_services.gateway") / "page"
        self._page = {name: (folder / name).read_bytes() for name in PAGE}

    async def page(self, request: Request) -> Response:
        """A file of the page."""
        name = request.url.path.removeprefix("/") or "index.html"
        return Response(self._page[name], media_type=PAGE[name], headers={"cache-control": "no-cache"})

    async def estimates(self, request: Request) -> EventStream:
        """Estimates as they come, of all estimators or of one; with ``rate`` only the newest of each, so often."""
        name = request.path_params.get("name")
        configuration = self._parts.configuration()
        known = [*configuration.filters, *configuration.fusion]
        if name is not None and name not in known:
            remedy = nearest(name, known)
            raise Refusal(404, f"the mesh has no filter or fusion {name!r}", remedy, key="NAME", value=name)
        is_whole = _flag(request, "full")
        names = None if name is None else (name,)
        feed = EstimateFeed(self._parts.board, names, is_whole, only_newest="rate" in request.query_params)
        return self._stream(request, [feed])

    async def events(self, request: Request) -> EventStream:
        """The events of the mesh; a client that comes back gets those it has missed."""
        feed = EventFeed(self._parts.board, request.headers.get("last-event-id", ""))
        return self._stream(request, [feed], EVENT_RATE_HZ)

    async def live(self, request: Request) -> EventStream:
        """Health, events and estimates in one stream: browsers open few connections to one host."""
        board, last = self._parts.board, request.headers.get("last-event-id", "")
        estimates = EstimateFeed(board, with_kept=True)
        return self._stream(request, [HealthFeed(board, self._parts.now), EventFeed(board, last), estimates])

    async def health(self, request: Request) -> Response:
        """Every peer; status 503 where one is in error or gone."""
        found = self._parts.board.health(self._parts.now())
        return _json(found, 503 if found["level"] in UNHEALTHY else 200)

    async def model(self, request: Request) -> Response:
        """What the ``model`` query tells, the estimators, and which sensors are external."""
        configuration = self._parts.configuration()
        answer = msgspec.to_builtins(model_answer(configuration))
        start_ns = answer["start_ns"]
        filters = [{"name": one.name, "topic": "posterior", "kind": one.kind} for one in configuration.filters.values()]
        fusions = [{"name": name, "topic": "fused", "kind": "fusion"} for name in configuration.fusion]
        external = [name for name, sensor in configuration.sensors.items() if sensor.live == "external"]
        return _json(
            answer
            | {"start_ns": None if start_ns is None else str(start_ns), "mesh": configuration.mesh.name}
            | {"estimators": [*fusions, *filters], "external": external}
        )

    async def metrics(self, request: Request) -> Response:
        """OpenMetrics."""
        body, content_type = exposition(self._metrics, request.headers.get("accept", ""))
        return Response(body, headers={"content-type": content_type})

    async def measurement(self, request: Request) -> Response:
        """Publish a measurement of an external sensor."""
        self._check_token(request)
        configuration, name = self._parts.configuration(), request.path_params["name"]
        sensor = sensor_of(configuration, name)
        assert self._parts.publisher is not None, "there is an external sensor"
        body = await _body(request)
        reading = read_reading(sensor, body, self._parts.now())
        sent = await run_in_threadpool(self._parts.publisher.publish, configuration, name, reading)
        told = {"src": sent.src, "boot": sent.boot, "seq": str(sent.seq), "step": sent.step}
        return _json(told | {"time_ns": str(sent.time_ns), "time_error_ns": str(sent.time_error_ns)}, 202)

    def _check_token(self, request: Request) -> None:
        token = self._parts.token
        if token is None:
            remedy = 'give a sensor source = "external" in the configuration of the whole mesh'
            raise Refusal(403, "no sensor of the mesh is external, so that nobody may publish", remedy)
        scheme, _, given = request.headers.get("authorization", "").partition(" ")
        if scheme.lower() != "bearer" or not is_token(given.strip(), token):
            remedy = "send the header `Authorization: Bearer TOKEN`; the file of the token was told at the start"
            raise Refusal(401, "the token is missing or wrong", remedy)

    def _stream(self, request: Request, feeds: list[Feed], usual_hz: float = RATE_HZ) -> EventStream:
        if self._parts.clients.is_full:
            raise Refusal(503, f"{MAX_CLIENTS} streams are open, and no more are served", "close one and come back")
        return EventStream(feeds, self._parts.clients, 1.0 / _rate(request, usual_hz))


def _rate(request: Request, usual_hz: float) -> float:
    text = request.query_params.get("rate", str(usual_hz))
    try:
        rate = float(text)
    except ValueError:
        rate = 0.0
    if not 0.0 < rate <= MAX_RATE_HZ:
        text_of = f"rate is {text[:40]!r}, expected a number above 0 and up to {MAX_RATE_HZ:g}"
        raise Refusal(400, text_of, f"leave it out for {usual_hz:g} a second", key="rate", value=text)
    return rate


def _flag(request: Request, name: str) -> bool:
    text = request.query_params.get(name, "0")
    if text not in ("0", "1"):
        raise Refusal(400, f"{name} is {text[:40]!r}, expected 0 or 1", "leave it out for 0", key=name, value=text)
    return text == "1"


async def _body(request: Request) -> bytes:
    body = b""
    async for part in request.stream():
        body += part
        if len(body) > MAX_BODY:
            raise Refusal(413, f"the body is larger than {MAX_BODY} bytes", "send one measurement in each request")
    return body


def _json(value: Json, status: int = 200) -> Response:
    return Response(dumps(value), status, media_type="application/json")


async def _refused(request: Request, refusal: Exception) -> Response:
    assert isinstance(refusal, Refusal)
    return refusal.response({"www-authenticate": "Bearer"} if refusal.status == 401 else None)


async def _not_served(request: Request, error: Exception) -> Response:
    """A path or a method that there is not."""
    assert isinstance(error, HTTPException)
    remedy = "GET / /estimates /estimates/NAME /events /live /health /model /metrics, or POST /measurements/NAME"
    text = f"{request.method} {request.url.path}: {error.detail}"
    return Refusal(error.status_code, text, remedy).response(error.headers)
