"""Frames: readable scales that change in jumps, and views that follow the sets."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import rerun as rr
from hypothesis import given
from hypothesis import strategies as st
from lsu_mesh_services.recording.entity_paths import EntityPaths
from lsu_mesh_services.recording.frame import READABLE, Frame, readable_scale
from lsu_mesh_services.recording.synthetic_mesh import written
from lsu_mesh_services.recording.timeline import Moment, Timelines


@given(st.lists(st.floats(1e-12, 1e12), min_size=1, max_size=3))
def test_a_scale_is_a_readable_number_not_below_the_half_width(half_widths: list[float]) -> None:
    scale = readable_scale(np.array(half_widths))
    for width, shown in zip(half_widths, scale, strict=True):
        assert width <= shown * (1 + 1e-9)
        leading = shown / 10.0 ** np.floor(np.log10(shown) + 1e-9)
        assert min(abs(leading - number) for number in READABLE) < 1e-6


def test_like_axes_share_a_scale_and_unlike_ones_do_not() -> None:
    assert readable_scale(np.array([0.9, 0.3, 0.5])).tolist() == [1.0, 1.0, 1.0]
    assert readable_scale(np.array([12.5, 0.9])).tolist() == [15.0, 1.0]


@pytest.mark.parametrize("half_widths", [[0.0, 0.0, 0.0], [1.0, 0.0, 2.0], [0.0, 1e-300, 1.0]])
def test_flat_sets_have_a_scale(half_widths: list[float]) -> None:
    scale = readable_scale(np.array(half_widths))
    assert (scale > 0).all()
    assert np.isfinite(scale).all()


def test_the_scale_stays_while_the_set_breathes_and_jumps_when_it_grows(tmp_path: Path) -> None:
    stream = rr.RecordingStream("frames")
    stream.memory_recording()
    frame = Frame(stream, Timelines(0.02), EntityPaths(written(tmp_path)), "f1")
    shown = []
    for k, size in enumerate([0.9, 1.0, 0.7, 0.95, 1.05, 4.0, 3.5, 0.5]):
        frame.look_at(Moment(k, k), np.zeros(3), np.full(3, size))
        shown.append(float(frame.scale[0]))
    assert shown == [1.0, 1.0, 1.0, 1.0, 1.0, 4.0, 4.0, 0.5]
    frame.flush()
