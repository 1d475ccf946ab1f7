"""The systems of the papers."""

from __future__ import annotations

import numpy as np
import pytest

from lsu_mesh import ModelError, systems


def test_every_system_is_a_model_with_its_papers_noise() -> None:
    shapes = {
        name: (m.state_count, m.input_count, m.output_count) for name in systems.SYSTEMS for m in [systems.get(name)]
    }
    assert shapes == {"S1": (3, 1, 1), "S2": (2, 1, 1), "S3": (2, 1, 1), "P3": (3, 1, 2)}
    model = systems.get("P3", rho=0.2, r=[0.1, 0.5])
    np.testing.assert_array_equal(model.rho, [0.2, 0.2, 0.2])
    np.testing.assert_array_equal(model.r, [0.1, 0.5])


def test_s1_and_p3_share_the_input_but_not_the_dynamics() -> None:
    np.testing.assert_array_equal(systems.get("S1").B, systems.get("P3").B)
    assert np.abs(np.linalg.eigvals(systems.get("S1").A)).max() < 1


def test_an_unknown_system_names_the_nearest() -> None:
    with pytest.raises(ModelError, match="did you mean 'P3'"):
        systems.get("p3")
