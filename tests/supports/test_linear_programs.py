"""Programs whose numbers have outgrown double precision."""

from __future__ import annotations

import numpy as np

from lsu_mesh.supports.linear_programs import is_proved_empty, safe_maxima


def test_programs_with_infinite_numbers_prove_nothing() -> None:
    A, b = np.array([[np.inf, -np.inf]]), np.array([np.inf])
    assert not is_proved_empty(A, b)
    found = safe_maxima(np.eye(2), A, b)
    assert not found.empty
    assert (found.values >= 1.0).all()
