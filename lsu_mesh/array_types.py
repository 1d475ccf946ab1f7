"""Names for the types of arrays; shapes stand in the docstring of each function."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]
"""One axis."""
Matrix = NDArray[np.float64]
"""Two axes."""
Stack = NDArray[np.float64]
"""Three axes: matrices of many runs or many steps."""
Array = NDArray[np.float64]
"""Any number of axes."""
Indices = NDArray[np.int64]
"""Places in another array."""
Counts = NDArray[np.int64]
"""How often."""
Flags = NDArray[np.bool_]
"""Yes or no, one an entry."""
Integers = NDArray[np.int64]
"""Whole numbers, such as times in nanoseconds."""
CellTexts = NDArray[np.bytes_]
"""Texts of equal length."""
RawBytes = NDArray[np.uint8]
"""The bytes of a file."""
