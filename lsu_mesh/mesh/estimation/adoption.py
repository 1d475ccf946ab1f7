"""The bounds that a filter uses: the declared ones, or those that an identifier has found."""

from __future__ import annotations

from lsu_mesh.filters.filter import Filter
from lsu_mesh.filters.registry import filter_class
from lsu_mesh.mesh.config.settings import Configuration, FilterSettings
from lsu_mesh.mesh.messages import Suggestion
from lsu_mesh.model import LSUModel
from lsu_mesh.supports.support import Support


def is_due(message: Suggestion, k: int) -> bool:
    """Whether bounds are announced for step k or before."""
    return message.adopt_at is not None and k >= message.adopt_at


def make_engine(settings: FilterSettings, model: LSUModel, prior: Support) -> Filter:
    """The filter of this configuration on a model."""
    return filter_class(settings.kind)(model, prior, **settings.options)  # type: ignore[call-arg]


def adopted_model(configuration: Configuration, settings: FilterSettings, message: Suggestion) -> LSUModel:
    """The model of a filter with the suggested bounds; a sensor that the suggestion does not name keeps its r."""
    r = [width for sensor in settings.sensors for width in message.r.get(sensor, configuration.sensors[sensor].r)]
    return configuration.model(settings.sensors).replace(rho=message.rho, r=r)


def filter_algorithm(settings: FilterSettings, engine: Filter | type[Filter]) -> int:
    """Number of the arithmetic of a filter's sets; with that of conditioning, where it takes transfers."""
    return engine.algorithm + (engine.conditioning - 1 if settings.transfer != "off" else 0)
