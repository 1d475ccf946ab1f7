"""Where things lie in a recording, and how they are called there.

===========================================  =======================================================================
``/raw/<topic>/<name>``                      every message as it came: payload, key, arrival
``/raw/refused``                             payloads that are no message of this mesh
``/truth/<state>``                           true state
``/bands/<state>/<peer>``                    interval, with lower, point and upper, of a filter or a fusion
``/smoothed/<state>/<peer>``                 the same of a filter with a lag, of the state given later data
``/errors/<state>/<peer>``                   point − truth, lower − truth, upper − truth
``/widths/<peer>``                           widths of the interval hull, one series per state
``/log_volume/<peer>``                       natural logarithm of the volume
``/gain/<peer>``                             gain of a step's Bayesian transfers, in nats
``/measured/<sensor>/<output>``              measured outputs
``/outputs/<sensor>/<output>/<peer>``        predicted interval of the output
``/space/sets/<peer>``                       set in three coordinates, ``…/edges`` its edges
``/space/truth``                             the true state among the sets
``/space/frames/<peer>``                     place and scale at which views look, ``…/axes`` the axes
``/status/<peer>``                           status of the posterior; ``/health/<peer>`` how the process does
``/trust/<fusion>/<source>``                 what the fusion does with a source
``/topology``                                peers and who listens to whom
``/events/<peer>``                           events as text
``/half_widths/rho/<state>/<peer>``          half-widths of the disturbance, and
``/half_widths/r/<sensor>/<output>/<peer>``  of a sensor's noise: in force at a filter, or suggested by an identifier
``/factor/<identifier>``                     by what the half-widths in force must be multiplied to explain the data
``/bank_widths/<peer>``                      quantiles of the mean widths of all targets of a bank
``/bank_counts/<peer>``                      how many of its targets are inconsistent, how many restarted
``/targets/<i>/<state>/bands/<peer>``        interval of a target that is shown, ``…/truth`` its true state
``/latency/<peer>``                          age of the oldest measurement at the arrival of the posterior, in ms
===========================================  =======================================================================
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import lru_cache

import rerun as rr

from lsu_mesh.mesh.access import truth_is_known
from lsu_mesh.mesh.config import Configuration
from lsu_mesh.mesh.config.settings import SensorSettings
from lsu_mesh.mesh.messages import Measurement, Message, Posterior, Prediction, Smoothed, Suggestion, Truth


@lru_cache(maxsize=4096)
def path(*parts: str) -> str:
    """Entity path of the parts, each escaped."""
    return str(rr.new_entity_path(list(parts)))


def told_apart(names: Sequence[str]) -> tuple[str, ...]:
    """The names; each with its number behind where one is empty or occurs twice."""
    if all(names) and len(set(names)) == len(names):
        return tuple(names)
    return tuple(f"{name}#{i + 1}" for i, name in enumerate(names))


@dataclass(frozen=True)
class Output:
    """One row of C of a sensor: its place in the sensor's y, its name in entity paths and for people."""

    sensor: str
    row: int
    part: str
    label: str

    def measured(self) -> str:
        """Entity of the measured values."""
        return path("measured", self.sensor, self.part)

    def predicted(self, peer: str) -> str:
        """Entity of the interval that a filter predicts."""
        return path("outputs", self.sensor, self.part, peer)

    def half_width(self, peer: str) -> str:
        """Entity of the half-width of the noise, in force at a filter or suggested."""
        return path("half_widths", "r", self.sensor, self.part, peer)


@dataclass(frozen=True)
class EntityPaths:
    """EntityPaths that a configuration gives to what is drawn."""

    configuration: Configuration
    states: tuple[str, ...] = field(init=False)
    """Entity path part of each state."""
    estimators: tuple[str, ...] = field(init=False)
    """Filters and fusion peers."""
    outputs: tuple[Output, ...] = field(init=False)

    def __post_init__(self) -> None:
        configuration = self.configuration
        object.__setattr__(self, "states", told_apart(configuration.base_model.states))
        object.__setattr__(self, "estimators", (*configuration.filters, *configuration.fusion))
        listed = [output for sensor in configuration.sensors.values() for output in outputs_of(sensor)]
        object.__setattr__(self, "outputs", tuple(listed))

    @property
    def disturbances(self) -> tuple[str, ...]:
        """Entity path part of each component of the disturbance: the states' names where each has its own."""
        model = self.configuration.base_model
        return self.states if model.noise_map is None else tuple(f"w{i + 1}" for i in range(len(model.rho)))

    @property
    def learners(self) -> tuple[str, ...]:
        """Peers by which half-widths may change: identifiers, and filters that estimate them."""
        filters = [name for name, one in self.configuration.filters.items() if one.kind == "WindowMAP"]
        return (*self.configuration.identifiers, *filters)

    @property
    def smoothers(self) -> tuple[str, ...]:
        """Filters with a lag, which publish smoothed sets too."""
        return tuple(name for name, one in self.configuration.filters.items() if one.lag)

    @property
    def truth_is_known(self) -> bool:
        """Whether a sensor is simulated; real measurements come without the truth."""
        return truth_is_known(self.configuration)

    def check(self, message: Message) -> None:
        """Raise ``ValueError`` where a message does not fit the mesh: it would spoil the batch of the others."""
        states = len(self.states)
        if isinstance(message, Truth):
            _check_count("states", len(message.x), states)
        elif isinstance(message, Posterior | Smoothed):
            _check_count("states", len(message.lower), states)
        elif isinstance(message, Measurement):
            _check_count("outputs", len(message.y), len(self.configuration.sensors[message.name].C))
        elif isinstance(message, Prediction):
            _check_count("outputs", len(message.y_lower), len(self.outputs_of_filter(message.name)))
        elif isinstance(message, Suggestion):
            found = sum(map(len, message.r.values()))
            _check_count("half-widths of outputs", found, len(self.outputs_of_watcher(message.name)))
            _check_count("half-widths of the disturbance", len(message.rho), len(self.disturbances))

    def label(self, state: int) -> str:
        """Name of a state with its unit, such as ``position [m]``."""
        unit = self.configuration.base_model.units[state]
        return f"{self.states[state]} [{unit}]" if unit else self.states[state]

    def axes(self) -> tuple[int, ...]:
        """The states that span the 3-D views: ``recorder.axes`` where it names any, else the first three."""
        states = self.configuration.base_model.states
        chosen = [states.index(name) for name in self.configuration.recorder.axes if name in states]
        return tuple(dict.fromkeys(chosen))[:3] or tuple(range(min(3, len(states))))

    def outputs_of_filter(self, name: str) -> tuple[Output, ...]:
        """Outputs in the order of a filter's rows of C: sensors by name, then rows."""
        return self._outputs_of(self.configuration.filters[name].sensors)

    def outputs_of_watcher(self, name: str) -> tuple[Output, ...]:
        """Outputs of a filter or an identifier: sensors by name, then rows."""
        watcher = self.configuration.filters.get(name) or self.configuration.identifiers[name]
        return self._outputs_of(watcher.sensors)

    def _outputs_of(self, chosen: Sequence[str]) -> tuple[Output, ...]:
        return tuple(output for sensor in sorted(chosen) for output in self.outputs if output.sensor == sensor)


def _check_count(what: str, found: int, expected: int) -> None:
    if found != expected:
        raise ValueError(f"{found} {what}, the configuration has {expected}")


def outputs_of(sensor: SensorSettings) -> list[Output]:
    """The outputs of one sensor."""
    parts = told_apart(sensor.outputs)
    return [
        Output(sensor.name, row, part, part if part == sensor.name else f"{sensor.name}: {part}")
        for row, part in enumerate(parts)
    ]
