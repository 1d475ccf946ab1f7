"""What a filter's sets are worth at best, by its kind and by what its sensors declare of their times."""

from __future__ import annotations

from lsu_mesh.filters.registry import filter_class
from lsu_mesh.mesh.config.settings import Configuration, FilterSettings
from lsu_mesh.mesh.messages import Guarantee


def declared_guarantee(configuration: Configuration, settings: FilterSettings) -> Guarantee:
    """That of the kind; ``"none"`` where a discrete model takes data of any time as measured at the nearest step."""
    sensors = [configuration.sensors[name] for name in settings.sensors]
    moves_data = configuration.continuous is None and any(
        sensor.off_grid == "nearest" and not sensor.rate for sensor in sensors
    )
    return "none" if moves_data else filter_class(settings.kind).guarantee
