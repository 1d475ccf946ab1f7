"""Bands over time: an interval as a filled strip, with its bounds and a point as lines.

One entity holds four series, ``interval lower point upper``, as ``Measurements``: the first has the middle of the
interval as value and its half-width as standard deviation, the others have none. The viewer would take Scalars on the
same entity for measurements.
"""

from __future__ import annotations

import numpy as np
import rerun as rr

from lsu_mesh.array_types import Array
from lsu_mesh_services.recording.palette import TRUTH, Color

_VISIBLE_BOUNDS = [False, True, False, True]


def band_columns(lower: Array, point: Array, upper: Array) -> rr.ComponentColumnList:
    """Rows of a band; each array (rows,)."""
    half = 0.5 * (upper - lower)
    none = np.zeros_like(half)
    values = np.stack([lower + half, lower, point, upper], axis=1)
    variances = np.stack([half * half, none, none, none], axis=1)
    return rr.Measurements.columns(values=values, variances=variances)


def band_style(peer: str, color: Color) -> rr.Measurements:
    """Static style of a peer's band."""
    names = [f"{peer} interval", f"{peer} lower", f"{peer} point", f"{peer} upper"]
    return rr.Measurements.from_fields(colors=[color] * 4, widths=[0.0, 1.0, 1.5, 1.0], names=names)


def smoothed_style(peer: str, color: Color) -> rr.Measurements:
    """Static style of the band of a peer's smoothed sets: it lies in the peer's own, darker and without a point."""
    names = [f"{peer} smoothed {what}" for what in ("interval", "lower", "middle", "upper")]
    return rr.Measurements.from_fields(colors=[darker(color)] * 4, widths=[0.0, 1.5, 0.0, 1.5], names=names)


def darker(color: Color, share: float = 0.55) -> Color:
    """The same colour with so much of its brightness."""
    red, green, blue = (int(share * part) for part in color)
    return red, green, blue


def error_columns(lower: Array, point: Array, upper: Array) -> rr.ComponentColumnList:
    """Rows of a band of errors, with the line at zero where the truth is."""
    half = 0.5 * (upper - lower)
    none = np.zeros_like(half)
    values = np.stack([lower + half, lower, point, upper, none], axis=1)
    variances = np.stack([half * half, none, none, none, none], axis=1)
    return rr.Measurements.columns(values=values, variances=variances)


def error_style(peer: str, color: Color) -> rr.Measurements:
    """Static style of a peer's errors."""
    names = [f"{peer} interval", f"{peer} lower", f"{peer} point", f"{peer} upper", "truth"]
    return rr.Measurements.from_fields(colors=[color] * 4 + [TRUTH], widths=[0.0, 1.0, 1.5, 1.0, 1.5], names=names)


def line_style(name: str, color: Color, width: float) -> rr.Measurements:
    """Static style of a single line that is drawn above bands."""
    return rr.Measurements.from_fields(colors=[color], widths=[width], names=[name])


def outline() -> rr.blueprint.Visualizer:
    """A band without its filling, for views in which many bands overlap."""
    return rr.Measurements.from_fields(variances=[0.0] * 4, visible_series=_VISIBLE_BOUNDS).visualizer()
