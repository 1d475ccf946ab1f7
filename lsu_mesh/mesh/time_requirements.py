"""What a peer cannot do with a mesh's times and models; the configuration and the nodes both ask here."""

from __future__ import annotations

from lsu_mesh.errors import ModelError
from lsu_mesh.mesh.config.settings import Configuration

NEEDS_ONE_STEP_MODEL = ("WindowMAP",)
"""Kinds that look for one course of states over a window of equal steps."""
ONE_UPDATE = ("WindowMAP",)
"""Kinds that take all data of a step in one update, one datum of each sensor."""


def time_problems(configuration: Configuration, role: str, name: str) -> list[str]:
    """Reasons for which a peer refuses to start, in words; empty where it can."""
    found = _of_the_mesh(configuration)
    has_more_models = not configuration.has_one_model
    if role == "identifier" and has_more_models:
        found.append(f"identifier {name} needs one discrete model: it looks for the bounds of equal steps; remove it")
    if role == "filter":
        settings = configuration.filters[name]
        if has_more_models and settings.kind in NEEDS_ONE_STEP_MODEL:
            found.append(
                f"filter {name}: {settings.kind} needs one discrete model, it estimates bounds of equal steps; choose "
                "another kind"
            )
        if has_more_models and settings.adopt:
            found.append(f"filter {name}: adopt needs one discrete model, bounds of a step are no rates; remove it")
        if configuration.continuous is not None and settings.lag:
            found.append(
                f"filter {name}: lag counts time updates, and a step of a continuous model may take several, to each "
                "datum between the steps; leave lag out, or give a discrete model"
            )
        if configuration.continuous is not None and settings.transfer == "data-predictor":
            found.append(
                f'filter {name}: "data-predictor" knows outputs of the grid only; transfer = "predictor" or "fused"'
            )
    return found


def _of_the_mesh(configuration: Configuration) -> list[str]:
    delay = configuration.input_delay_ns
    if not delay:
        return []
    found = []
    is_external = configuration.plant is not None and configuration.plant.is_external
    if configuration.continuous is None and not is_external:
        found.append("input_delay needs a continuous model: a discrete one knows nothing between its steps")
    if configuration.base_model.input_count and configuration.input_box is None:
        found.append("input_delay needs input_box: what acts before the first input is not known otherwise")
    grid = configuration.grid
    if delay > grid.time_of(2) - grid.time_of(1) - 1:
        found.append(f"input_delay of {delay} ns must be shorter than dt")
    return found


def check_times(configuration: Configuration, role: str, name: str) -> None:
    """Raises ``ModelError`` with all reasons."""
    found = time_problems(configuration, role, name)
    if found:
        raise ModelError(*found)
