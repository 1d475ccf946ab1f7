"""An intersection whose numbers outgrow double precision is no reason to fail: X itself holds it."""

from __future__ import annotations

import numpy as np

from lsu_mesh.filters.joining import joined
from lsu_mesh.supports.constrained_zonotope import ConstrainedZonotope
from lsu_mesh.supports.linear_programs import is_proved_empty, safe_maxima


def test_a_set_at_the_end_of_all_numbers_leaves_x_as_it_is() -> None:
    far = ConstrainedZonotope([-1.5e308, 0.0], np.eye(2), np.zeros((0, 2)), [])
    own = ConstrainedZonotope([1.5e308, 0.0], np.eye(2), np.zeros((0, 2)), [])
    body = own.arrays
    assert joined(body, own.bounds(), far, None) is body


def test_programs_with_infinite_numbers_prove_nothing() -> None:
    A, b = np.array([[np.inf, -np.inf]]), np.array([np.inf])
    assert not is_proved_empty(A, b)
    found = safe_maxima(np.eye(2), A, b)
    assert not found.empty
    assert (found.values >= 1.0).all()
