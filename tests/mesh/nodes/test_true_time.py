"""Measurements at moments of their own, through whole meshes: no set misses the exact state, nothing contradicts."""

from __future__ import annotations

from pathlib import Path

import pytest
from exact_course import scene
from timed_mesh import Misses, TimedMesh, body, play, report

from lsu_mesh.mesh.verification import verify

SECOND = 10**9


@pytest.mark.parametrize("seed", range(3))
def test_a_car_that_reports_irregularly_is_held_by_every_set(tmp_path: Path, seed: int) -> None:
    made = scene(seed, speed=20.0, acceleration=1.0, r=0.5, apart=(0.15, 0.5), rows=60)
    configuration = body(tmp_path / "car.toml", made, dt=0.1)
    mesh = TimedMesh(configuration)
    sent = [
        (t + 10_000_000, report(configuration, "a", i, time_ns=t, y=made.Y[i].tolist()))
        for i, t in enumerate(made.times)
    ]
    play(mesh, sent, until_ns=made.times[-1] + SECOND, tick_ns=20_000_000)
    seen = Misses().look(mesh, made.course.at)
    assert seen.sets > 6 * 100
    assert seen.outside == 0
    assert mesh.events("contradiction") == []
    used = {reference for one in mesh.posteriors("lsuo") for reference in one.used}
    assert {message.reference for _, message in sent} <= used, "every report counts"
    found = verify(configuration, [message for _, message in mesh.sent])
    assert found.differences == []
    assert found.false_claims == []
    assert found.unverifiable == []
