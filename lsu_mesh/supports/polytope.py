"""Vertices and volume of a bounded convex set that is known by its support points.

Refinement: the convex hull of the known points is an inner approximation; each of its facets is either confirmed by the
support point in the direction of its normal or gives a new vertex. For a polytope this ends with its vertices.
It works in coordinates in which a large inscribed simplex is the unit simplex, so thin sets are as easy as round ones.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]
SupportPoints = Callable[[Matrix], Matrix]
"""Directions (k, n) → a point of the set (k, n) that is farthest in each."""
Surface = Callable[[Matrix, Vector, Matrix], Matrix]
"""``(M, origin, corners)`` → vertices ``M x − origin`` (k, 3) of a solid, from the corners of an inscribed simplex."""

FLAT = 1e-11
"""A width below this share of the largest width counts as none."""
CONFIRMED = 1e-9
"""A facet is confirmed when no point lies farther than this, in units of the inscribed simplex."""
