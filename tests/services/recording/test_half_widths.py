"""Half-widths are drawn where they can change: what filters go by, and what an identifier suggests."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from local_mesh import LocalMesh
from lsu_mesh_services.recording.recorder import Recorder
from lsu_mesh_services.recording.synthetic_mesh import SyntheticMesh, written
from msgspec import structs
from recorded_mesh import record
from rerun.chunk import RrdReader

from lsu_mesh.mesh.config import load
from lsu_mesh.mesh.messages import Suggestion, encode

STEPS = 60


@pytest.fixture(scope="module")
def mesh(root: Path) -> LocalMesh:
    """The example up to its first suggestion, made at step 50."""
    mesh = LocalMesh(load(root / "examples" / "learning.toml", [f"mesh.steps={STEPS}", "recorder.draw_hz=1000"]))
    mesh.run(1.6)
    return mesh


def drawn(path: Path, entity: str) -> dict[int, list[float]]:
    """Values by step."""
    rows: dict[int, list[float]] = {}
    for chunk in RrdReader(path).stream().filter(content=entity):
        batch = chunk.to_record_batch()
        if "Scalars:scalars" in batch.schema.names:
            columns = (batch.column(name).to_pylist() for name in ("step", "Scalars:scalars"))
            rows |= dict(zip(*columns, strict=True))
    return rows


def test_the_half_widths_are_those_of_the_messages(mesh: LocalMesh, tmp_path: Path) -> None:
    path = record(mesh, tmp_path / "learning.rrd")
    (suggestion,) = (message for message in mesh.of(Suggestion) if isinstance(message, Suggestion))
    for i, sensor in enumerate(("a", "b")):
        assert drawn(path, f"/half_widths/r/{sensor}/{sensor}/bounds") == {50: suggestion.r[sensor]}
        for name in ("bundle", "window"):
            told = {step: [posterior.bounds.r[i]] for step, posterior in mesh.newest(name).items()}
            assert drawn(path, f"/half_widths/r/{sensor}/{sensor}/{name}") == told
            assert len(told) == STEPS
    told = {step: [posterior.bounds.rho[1]] for step, posterior in mesh.newest("window").items()}
    assert drawn(path, "/half_widths/rho/x2/window") == told
    assert len(set(map(tuple, told.values()))) > 10, "the window estimates them anew at every step"
    assert drawn(path, "/factor/bounds") == {50: [suggestion.factor, 1.0]}


def test_nothing_is_drawn_where_nothing_can_change(tmp_path: Path) -> None:
    configuration = written(tmp_path)
    recorder = Recorder(configuration, tmp_path / "fixed.rrd")
    for arrival in SyntheticMesh(configuration).run(10):
        recorder.record(*arrival)
    recorder.close()
    entities = {chunk.entity_path for chunk in RrdReader(recorder.path).stream()}
    assert any(entity.startswith("/bands/") for entity in entities)
    assert not any(entity.startswith(("/half_widths", "/factor")) for entity in entities)


def test_a_suggestion_that_does_not_fit_the_mesh_is_a_problem_and_spoils_nothing(
    mesh: LocalMesh, tmp_path: Path
) -> None:
    recorder = Recorder(mesh.configuration, tmp_path / "odd.rrd")
    for address, message in mesh.sent:
        odd: Any = structs.replace(message, rho=[0.1]) if isinstance(message, Suggestion) else message
        recorder.record(address, encode(odd), message.sent_ns, odd)
    recorder.close()
    assert recorder.problems == [
        "drawing bounds of identifier/bounds: ValueError: 1 half-widths of the disturbance, the configuration has 3"
    ]
    assert len(drawn(recorder.path, "/half_widths/r/a/a/bundle")) == STEPS
