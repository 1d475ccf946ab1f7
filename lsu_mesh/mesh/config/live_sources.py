"""Sources that are programs of their own: what the rest of the configuration has to be, so that time fits them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from lsu_mesh.mesh.config.problem import Problem, Problems
from lsu_mesh.mesh.config.settings import MeshSettings, PlantSettings, SensorSettings
from lsu_mesh.mesh.config.system import System
from lsu_mesh.mesh.config.table import Table


def settle_start(
    mesh: MeshSettings, root: Table, plant: PlantSettings | None, *, sensors: Mapping[str, SensorSettings]
) -> MeshSettings:
    """``[mesh]`` with the start that live sources need: the one that is given, or ``"now"``."""
    live = [f"sensors.{name}" for name, sensor in sensors.items() if sensor.is_live]
    live += ["plant"] if plant is not None and plant.is_external else []
    problems, given = root.problems, _table(root, "mesh")
    if live and mesh.start_ns is None:
        mesh = replace(mesh, starts_now=True)
    if not live and not mesh.starts_now:
        return mesh
    if "rate" in given:
        why = f"[{live[0]}] is live" if live else 'start_time is "now"'
        text = f"has no place here: {why}, and step k is due at start_time + k dt; remove it"
        problems.add("mesh", "rate", text, expected="no such key here")
    if mesh.starts_now:
        _check_no_moments(root, plant, sensors)
    return replace(mesh, is_live=True)


def _check_no_moments(root: Table, plant: PlantSettings | None, sensors: Mapping[str, SensorSettings]) -> None:
    """Moments of the past have no step in a mesh that starts when it is started."""
    files = {f"sensors.{name}": sensor.file for name, sensor in sensors.items()}
    files["plant"] = None if plant is None else plant.file
    for table, file in files.items():
        if file is not None and file.indexed_by == "time":
            text = 'orders rows by time, but [mesh] start_time is "now"; give start_time, or order the rows by step'
            root.problems.add(table, "time", text, expected="step, the name of a column of steps")
    schedule = _table(root, "model").get("schedule")
    for i, entry in enumerate(schedule if isinstance(schedule, list) else []):
        if isinstance(entry, dict) and "from" in entry and not isinstance(entry["from"], int):
            text = 'is a moment, but [mesh] start_time is "now"; give start_time, or a step'
            root.problems.add(f"model.schedule[{i}]", "from", text, expected="a step ≥ 2")


def _table(root: Table, name: str) -> Mapping[str, object]:
    found = root.values.get(name)
    return found if isinstance(found, dict) else {}


def check_external_plant(
    plant: PlantSettings | None, sensors: Mapping[str, SensorSettings], system: System, problems: Problems
) -> None:
    """A plant that is a program tells inputs only: of a model that has some, and nothing is simulated on it."""
    if plant is None or not plant.is_external or system.model is None:
        return
    if system.model.input_count == 0:
        text = 'is "external", but the model has no inputs that a program could send; remove [plant], or give [model] B'
        problems.add("plant", "source", text, expected="no [plant], or a model with inputs")
    elif system.input_box is None:
        text = 'is missing; a plant with source = "external" needs it: what acts before its first input is not known'
        problems.add("model.input_box", "", text, expected="a box that holds every input")
    if not system.is_continuous and any(sensor.D for sensor in sensors.values()):
        text = (
            'is "external", whose inputs begin within a step, and what an output with D sees then is not known of a '
            "discrete model; set [model] continuous = true"
        )
        problems.add("plant", "source", text, expected="a continuous model, or no D")
    for name, sensor in sensors.items():
        if sensor.is_simulated:
            text = 'is simulated, but the plant is external and tells no state; set source = "external" or give a file'
            problems.add(f"sensors.{name}", "source", text, expected='"external", or "file"')


def input_delay_ns(mesh: MeshSettings, plant: PlantSettings | None, declared_ns: int) -> int:
    """How late in its step an input may begin; those of a program begin anywhere in it."""
    if declared_ns or plant is None or not plant.is_external or mesh.exact_dt is None:
        return declared_ns
    return max(0, int(mesh.exact_dt * 10**9) - 1)


def live_source_warnings(
    file: str, sensors: Mapping[str, SensorSettings], *, is_continuous: bool, has_unknown_inputs: bool
) -> Sequence[Problem]:
    """What is legal, and yet will not work as most would want."""
    found: list[Problem] = []
    live = [sensor for sensor in sensors.values() if sensor.is_live]
    for sensor in live:
        if not (is_continuous or sensor.rate or sensor.off_grid == "nearest" or sensor.tolerance_ns):
            text = (
                "sends times, and a discrete model takes only those on the grid: all others are refused; "
                "set [model] continuous = true, or give rate, or grid_tolerance"
            )
            expected = "a continuous model, or rate"
            found.append(_warning(file, (f"sensors.{sensor.name}", "source"), text, expected))
    simulated = [sensor.name for sensor in sensors.values() if sensor.is_simulated]
    if live and simulated:
        text = (
            f"is simulated, beside {live[0].name}, which is live: they agree only if {live[0].name} measures the "
            "simulated plant too"
        )
        found.append(_warning(file, (f"sensors.{simulated[0]}", "source"), text, "sources that measure one plant"))
    if live and has_unknown_inputs:
        text = "is missing, and the model has inputs that nobody sends: every filter waits for them; give input_box"
        found.append(_warning(file, ("model", "input_box"), text, "a box of all inputs, or [plant]"))
    return found


def _warning(file: str, place: tuple[str, str], text: str, expected: str) -> Problem:
    return Problem(file=file, table=place[0], key=place[1], text=text, expected=expected, is_warning=True)
