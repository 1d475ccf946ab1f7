"""A made-up mesh: sets of every kind that hold a made-up truth by construction, without filters and without network."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from lsu_mesh.mesh.config import Configuration, load
from lsu_mesh.mesh.keys import key
from lsu_mesh.mesh.messages import Bounds, Fused, Measurement, Message, Posterior, Prediction, Truth, encode
from lsu_mesh.mesh.sets import to_message
from lsu_mesh.supports.constrained_zonotope import ConstrainedZonotope
from lsu_mesh.supports.intersection import Intersection
from lsu_mesh.supports.orthotope import Orthotope
from lsu_mesh.supports.parallelotope import Parallelotope
from lsu_mesh.supports.support import Support
from lsu_mesh.supports.zonotope import Zonotope

START_NS = 1_700_000_000_000_000_000
STEP_NS = 20_000_000
KINDS = ("LSUO", "LSUP", "LSUCZ")
GREEK = ("alpha", "beta", "gamma", "delta", "epsilon", "zeta", "eta", "theta", "iota", "kappa", "lambda", "mu")


class Arrival(NamedTuple):
    """What the recorder is told of one message."""

    key: str
    payload: bytes
    arrival_ns: int
    message: Message


def written(folder: Path, states: int = 3, filters: int = 3, dt: float = 0.02) -> Configuration:
    """A configuration with so many states and filters, one sensor per state (six at most), and one fusion."""
    n = states
    sensors = [f"s{k + 1}" for k in range(min(n, 6))]
    names = [f"f{j + 1}" for j in range(filters)]
    lines = [
        f'[mesh]\nname = "made-up"\ndt = {dt}\nsteps = 600\nseed = 1\n[model]\nA = {np.eye(n).tolist()}',
        f"rho = {[0.1] * n}\nstates = {list(GREEK[:n])}\nunits = {['m'] * n}".replace("'", '"'),
        f"[model.prior]\nlower = {[-5.0] * n}\nupper = {[5.0] * n}\n[plant]",
    ]
    for k, sensor in enumerate(sensors):
        lines.append(f"[sensors.{sensor}]\nC = {np.eye(n)[[k]].tolist()}\nr = [0.3]")
    for j, name in enumerate(names):
        lines.append(f'[filters.{name}]\nkind = "{KINDS[j % 3]}"\nsensors = {sensors}'.replace("'", '"'))
    lines.append(f"[fusion.main]\nsources = {names}".replace("'", '"'))
    path = folder / "mesh.toml"
    path.write_text("\n".join(lines))
    return load(path)


class SyntheticMesh:
    """Messages of a mesh whose truth wanders and whose sets hold it by construction."""

    def __init__(self, configuration: Configuration, seed: int = 1) -> None:
        self.configuration = configuration
        self._rng = np.random.default_rng(seed)
        self._n = configuration.base_model.state_count
        self._x = np.zeros(self._n)
        self._sequences: dict[str, Iterator[int]] = {}

    def step(self, k: int) -> list[Arrival]:
        """All messages of one step, in the order of their arrival."""
        self._x = 0.97 * self._x + self._rng.uniform(-0.2, 0.2, self._n)
        messages: list[Message] = [Truth(**self.stamp("truth", "plant/plant", k), x=self._x.tolist())]
        messages += [self._measurement(name, k) for name in self.configuration.sensors]
        sets = {name: self._set(i) for i, name in enumerate(self.configuration.filters)}
        for name, drawn in sets.items():
            messages += [self._prediction(name, k, drawn), self.posterior(f"filter/{name}", k, drawn)]
        for name in self.configuration.fusion:
            boxes = [drawn.interval_hull() for drawn in sets.values()]
            lower = np.max([box.lower for box in boxes], axis=0)
            fused = Orthotope(lower, np.min([box.upper for box in boxes], axis=0))
            messages.append(self.posterior(f"fusion/{name}", k, fused, used=list(sets)))
        return [self.arrival(message, k, i) for i, message in enumerate(messages)]

    def run(self, steps: int) -> list[Arrival]:
        """Messages of the steps 1 … ``steps``."""
        return [arrival for k in range(1, steps + 1) for arrival in self.step(k)]

    def arrival(self, message: Message, k: int, i: int = 0) -> Arrival:
        """A message on its key, i-th of its step."""
        address = key(self.configuration.mesh.name, message.topic, message.name)
        return Arrival(address, encode(message), START_NS + k * STEP_NS + 1000 * i, message)

    def stamp(self, topic: str, src: str, k: int) -> dict[str, Any]:
        """The common fields of a message."""
        sequence = self._sequences.setdefault(f"{topic}/{src}", itertools.count())
        sent = START_NS + k * STEP_NS
        return {
            "v": 1, "src": src, "boot": "0123456789abcdef", "seq": next(sequence), "step": k,
            "sent_ns": sent, "origin_ns": sent - 3_000_000, "model": self.configuration.digest(),
        }  # fmt: skip

    def posterior(self, src: str, k: int, support: Support, used: Sequence[str] = (), **changes: Any) -> Posterior:
        """A posterior, or a fused set where ``src`` is a fusion."""
        lower, upper = support.bounds()
        volume = support.log_volume() if support.dim <= 3 else 0.0
        fields = {
            "kind": "made up", "support": to_message(support), "lower": lower.tolist(), "upper": upper.tolist(),
            "point": (0.5 * (lower + upper)).tolist(), "log_volume": volume if np.isfinite(volume) else None,
            "volume_of": "support", "status": "ok", "revision": 0, "epoch": 0, "guarantee": "declared",
            "base": "prior", "used": [("posterior", f"filter/{name}", "0123456789abcdef", k) for name in used],
            "bounds": Bounds(rho=[0.1], r=[0.3]), "missing": [],
        }  # fmt: skip
        if src.startswith("fusion/"):
            fields |= {"policy": "intersect", "faults": 0, "rejected": [], "quarantined": []}
            return Fused(**self.stamp("fused", src, k), **(fields | changes))
        return Posterior(**self.stamp("posterior", src, k), **(fields | changes))

    def _measurement(self, name: str, k: int) -> Measurement:
        y = np.array(self.configuration.sensors[name].C) @ self._x + self._rng.uniform(-0.3, 0.3)
        stamp = self.stamp("measurement", f"sensor/{name}", k)
        return Measurement(**stamp, y=[None] if k % 50 == 0 else y.tolist(), time_ns=stamp["sent_ns"])

    def _prediction(self, name: str, k: int, support: Support) -> Prediction:
        lower, upper = support.bounds()
        rows = np.vstack([self.configuration.sensors[s].C for s in self.configuration.filters[name].sensors])
        y_lower, y_upper = rows @ lower - 0.3, rows @ upper + 0.3
        return Prediction(
            **self.stamp("prediction", f"filter/{name}", k), support=to_message(support),
            lower=lower.tolist(), upper=upper.tolist(),
            y_lower=y_lower.tolist(), y_upper=y_upper.tolist(), y_point=(0.5 * (y_lower + y_upper)).tolist(),
            epoch=0, guarantee="declared",
        )  # fmt: skip

    def _set(self, i: int) -> Support:
        """A set of the i-th kind that holds the truth: the truth is its centre plus generators times some |ξ| < 1."""
        n, rng = self._n, self._rng
        widths = rng.uniform(0.3, 0.6, n)
        if i % 4 == 0:
            shift = rng.uniform(-0.5, 0.5, n) * widths
            return Orthotope(self._x + shift - widths, self._x + shift + widths)
        columns = n if i % 4 == 1 else n + 2
        generators = np.hstack([np.diag(widths), np.zeros((n, columns - n))]) + rng.uniform(-0.2, 0.2, (n, columns))
        xi = rng.uniform(-0.5, 0.5, columns)
        center = self._x - generators @ xi
        if i % 4 == 1:
            return Parallelotope(center, generators)
        if i % 4 == 2:
            A = rng.uniform(-1, 1, (2, columns))
            return ConstrainedZonotope(center, generators, A, A @ xi)
        parts = [Zonotope(center, generators), Orthotope(self._x - widths, self._x + 0.5 * widths)]
        return Intersection(parts)
