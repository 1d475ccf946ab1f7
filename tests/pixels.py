"""How much of a colour is in a picture of the viewer."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
from PIL import Image

CLOSE = 9
"""Largest difference of hue, of 256, between a colour and what the viewer makes of it."""


class Area(NamedTuple):
    """A part of a picture, in shares of its width and height."""

    left: float = 0.0
    right: float = 1.0
    top: float = 0.08
    bottom: float = 0.92


WHOLE = Area()


def pixels(picture: Path, color: tuple[int, int, int], area: Area = WHOLE) -> int:
    """Pixels of a colour's hue; shades and veils keep the hue."""
    image = np.asarray(Image.open(picture).convert("HSV")).astype(np.int16)
    height, width = image.shape[:2]
    rows = slice(int(area.top * height), int(area.bottom * height))
    part = image[rows, int(area.left * width) : int(area.right * width)]
    hue = int(np.asarray(Image.new("RGB", (1, 1), color).convert("HSV"))[0, 0, 0])
    apart = np.abs((part[:, :, 0] - hue + 128) % 256 - 128)
    return int(((apart <= CLOSE) & (part[:, :, 1] > 110) & (part[:, :, 2] > 90)).sum())
