"""Meshes in one process whose sensors report at moments of their own: a body on a line, with its exact course."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path

import numpy as np
from exact_course import Course, Scene, inside, scene
from local_mesh import LocalMesh, boot

from lsu_mesh import Orthotope
from lsu_mesh.mesh.config import Configuration, load
from lsu_mesh.mesh.grid import Grid
from lsu_mesh.mesh.keys import key
from lsu_mesh.mesh.messages import Measurement, Message, Posterior, encode
from lsu_mesh.mesh.nodes.node import Node
from lsu_mesh.mesh.sets import to_support

BODY = """
[mesh]
name = "body"
dt = {dt}
start_time = 0
[model]
A = [[1.0, {dt}], [0.0, 1.0]]
noise_map = [[0.0], [1.0]]
rho = [0.1]
prior = {{ lower = [-1.0, -1.0], upper = [1.0, 1.0] }}
[sensors.a]
C = [[1.0, 0.0]]
r = [0.5]
{more}
"""
FILTERS = ("LSUO", "LSUP", "LSUPB", "LSUCZ", "ZonotopicKalman")
OWN = "".join(f'[filters.{kind.lower()}]\nkind = "{kind}"\nsensors = ["a"]\n' for kind in FILTERS)
EVERY = OWN + f"[fusion.main]\nsources = {[kind.lower() for kind in FILTERS]}\n"


def body(path: Path, made: Scene, dt: float, more: str = EVERY, **sensor: object) -> Configuration:
    """The mesh of a scene: its continuous model, a grid from 0 s on, and the prior around the exact state of t_1."""
    path.write_text(BODY.format(dt=dt, more=more))
    read = load(path)
    grid = Grid(0, Fraction(str(dt)))
    x1 = np.array([float(v) for v in made.course.at(grid.time_of(1))])
    reach = np.array([1.5, 1.0])
    step = made.flow.discretised(grid.time_of(2) - grid.time_of(1))
    without = made.flow.replace(C=np.zeros((0, 2)), r=[])
    sensors = {
        name: replace(one, r=tuple(made.flow.rates.r.tolist()), **sensor)  # type: ignore[arg-type]
        for name, one in read.sensors.items()
    }
    return replace(
        read,
        continuous=without,
        base_model=step.replace(C=np.zeros((0, 2)), r=[]),
        prior=Orthotope(x1 - reach, x1 + reach),
        sensors=sensors,
    )


class TimedMesh(LocalMesh):
    """Filters, fusions and identifiers; what plant and sensors say comes from the test."""

    def start(self, role: str, name: str) -> Node | None:  # type: ignore[override]
        return None if role in ("plant", "sensor") else super().start(role, name)


def report(configuration: Configuration, name: str, seq: int, *, time_ns: int, y: Sequence[float | None],
           error_ns: int = 0, step: int = 0, number: int = 1) -> Measurement:  # fmt: skip
    """A measurement with a moment of its own."""
    return Measurement(
        v=1, src=f"sensor/{name}", boot=boot(1000 + number), seq=seq, step=step, sent_ns=time_ns, origin_ns=time_ns,
        model=configuration.digest(), y=list(y), time_ns=time_ns, time_error_ns=error_ns,
    )  # fmt: skip


def play(mesh: LocalMesh, messages: Iterable[tuple[int, Message]], until_ns: int, tick_ns: int) -> LocalMesh:
    """Hand each message over at its time, and turn the clock on between them."""
    name = mesh.configuration.mesh.name
    for at, message in sorted(messages, key=lambda one: one[0]):
        while mesh.now < at:
            mesh.now = min(at, mesh.now + tick_ns)
            mesh.turn()
        mesh.sent.append((key(name, message.topic, message.name), message))
        mesh.hand_over(key(name, message.topic, message.name), encode(message))
    while mesh.now < until_ns:
        mesh.now += tick_ns
        mesh.turn()
    return mesh


@dataclass
class Misses:
    """How many sets a test looked at, and how many of them do not hold the exact state."""

    sets: int = 0
    outside: int = 0

    def look(self, mesh: LocalMesh, state: Callable[[int], list[Fraction]]) -> Misses:
        """All posteriors and fused sets; the support is asked too, by the float next to the exact state."""
        for name in mesh.estimators():
            for one in mesh.posteriors(name):
                x = state(mesh.configuration.grid.time_of(one.step))
                self.sets += 1
                held = inside(np.array(one.lower), np.array(one.upper), x)
                self.outside += not (held and to_support(one.support).contains([float(v) for v in x]))
        return self


def sets_of(mesh: LocalMesh, name: str) -> dict[int, Posterior]:
    """The newest set of each step."""
    return mesh.newest(name)


__all__ = ["EVERY", "FILTERS", "Course", "Misses", "TimedMesh", "body", "play", "report", "scene", "sets_of"]
