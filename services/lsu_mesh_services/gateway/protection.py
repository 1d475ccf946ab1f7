"""What every request and response passes: whose name was asked for, and what a page may do."""

from __future__ import annotations

from urllib.parse import urlsplit

from starlette.datastructures import Headers, MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from lsu_mesh_services.gateway.http_address import AllowedHosts
from lsu_mesh_services.gateway.refusal import Refusal

POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; img-src 'self'; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
"""The page loads nothing from elsewhere, runs no code but its files, and stands in no other page."""
HEADERS = {
    "content-security-policy": POLICY,
    "x-content-type-options": "nosniff",
    "referrer-policy": "no-referrer",
    "cross-origin-resource-policy": "same-origin",
}


class Protection:
    """Refuses names that are not ours and writes from other pages, and adds headers to every response."""

    def __init__(self, app: ASGIApp, hosts: AllowedHosts) -> None:
        self._app, self._hosts = app, hosts

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return

        async def send_protected(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                for name, value in HEADERS.items():
                    headers[name] = value
                headers.setdefault("cache-control", "no-store")
            await send(message)

        refusal = self._refusal(Headers(scope=scope))
        app = self._app if refusal is None else refusal.response()
        await app(scope, receive, send_protected)

    def _refusal(self, headers: Headers) -> Refusal | None:
        host, origin = headers.get("host", ""), headers.get("origin")
        if not self._hosts.allow(host):
            remedy = f"use one of {', '.join(sorted(self._hosts.names))}; --host NAME allows another one"
            return Refusal(421, "the name in the address is not one of this gateway", remedy, key="Host", value=host)
        if origin is not None and urlsplit(origin).netloc.lower() != host.lower():
            text = "pages of other origins may not use the gateway"
            return Refusal(403, text, "send from the gateway's own page or from a program", key="Origin", value=origin)
        return None
