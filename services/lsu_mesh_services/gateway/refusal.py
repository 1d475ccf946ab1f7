"""What a client is told when its request cannot be served: the key, the value, what was expected, the remedy."""

from __future__ import annotations

from collections.abc import Mapping

from starlette.responses import Response

from lsu_mesh.mesh.json_form import dumps

MAX_SHOWN = 200


class Refusal(Exception):
    """A request that is answered with a status of 400 or more."""

    def __init__(self, status: int, text: str, remedy: str, *, key: str = "", value: object = None) -> None:
        super().__init__(text)
        self.status, self.text, self.remedy, self.key, self.value = status, text, remedy, key, value

    def response(self, headers: Mapping[str, str] | None = None) -> Response:
        """JSON of it."""
        about = {"key": self.key, "value": str(self.value)[:MAX_SHOWN]} if self.key else {}
        body = dumps({"error": self.text, **about, "remedy": self.remedy})
        return Response(body, self.status, headers, media_type="application/json")
