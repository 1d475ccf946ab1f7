"""Grid, continuous models, schedules and what sensors say of time, from the file to the settings."""

from __future__ import annotations

import tomllib
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from lsu_mesh.mesh.config import Configuration, ConfigurationError, load, load_values
from lsu_mesh.mesh.config.step_noise import noise_of_one_dt
from lsu_mesh.mesh.config.write import to_toml
from lsu_mesh.model import ContinuousModel, LSUModel

MESH = """
[mesh]
name = "timed"
dt = {dt}
start_time = {start}
[model]
A = [[0.0, 1.0], [0.0, 0.0]]
B = [[0.0], [1.0]]
noise_map = [[0.0], [1.0]]
rho = [0.5]
{model}
[model.prior]
lower = [-10.0, -1.0]
upper = [10.0, 1.0]
[sensors.gauge]
C = [[1.0, 0.0], [0.0, 1.0]]
r = [0.5, 0.1]
{sensor}
[sensors.wheel]
C = [[0.0, 1.0]]
r = [0.2]
[filters.box]
kind = "LSUO"
sensors = ["gauge", "wheel"]
"""


def mesh(
    folder: Path, *, dt: str = "0.1", start: str = "100.0", model: str = "continuous = true", sensor: str = ""
) -> Configuration:
    (folder / "mesh.toml").write_text(MESH.format(dt=dt, start=start, model=model, sensor=sensor))
    return load(folder / "mesh.toml")


def mistake(folder: Path, **parts: str) -> str:
    """The one mistake of a file, without the file and the line."""
    with pytest.raises(ConfigurationError) as caught:
        mesh(folder, **parts)
    (record,) = caught.value.records
    assert record.line is not None
    return record.sentence


def read_again(configuration: Configuration) -> Configuration:
    """As from a recording, which holds the values as text."""
    return load_values(tomllib.loads(to_toml(configuration.values)), configuration.path)


@pytest.mark.parametrize(
    ("text", "dt"),
    [
        ('"1/30"', Fraction(1, 30)), ('"0.02"', Fraction(1, 50)), ("0.02", Fraction(1, 50)), ("3", Fraction(3)),
        ("0.1", Fraction(1, 10)), ("0.0333333333333333333", Fraction("0.0333333333333333333")),
    ],
)  # fmt: skip
def test_dt_is_the_number_that_is_written(tmp_path: Path, text: str, dt: Fraction) -> None:
    configuration = mesh(tmp_path, dt=text)
    assert (configuration.mesh.exact_dt, configuration.mesh.dt, configuration.grid.dt) == (dt, float(dt), dt)
    assert read_again(configuration).mesh == configuration.mesh


def test_thirty_steps_of_a_thirtieth_are_a_second(tmp_path: Path) -> None:
    assert mesh(tmp_path, dt='"1/30"').grid.time_of(30 * 10**6) == 100 * 10**9 + 10**15


@pytest.mark.parametrize(
    ("start", "ns"),
    [
        ("1714564799.123456789", 1714564799_123456789),
        ('"1714564799.123456789"', 1714564799_123456789),
        ("1714564799123", 1714564799_123000000),
        ("2024-05-01T12:00:00.25Z", 1714564800_250000000),
        ("2024-05-01 14:00:00+02:00", 1714564800_000000000),
        ('"2024-05-01T12:00:00.123456789Z"', 1714564800_123456789),
        ("2024-05-01", 1714521600_000000000),
        ("-0.1", -100_000_000),
    ],
)
def test_a_start_keeps_every_nanosecond(tmp_path: Path, start: str, ns: int) -> None:
    configuration = mesh(tmp_path, start=start)
    assert (configuration.mesh.start_ns, configuration.grid.start_ns) == (ns, ns)
    assert configuration.mesh.start_time == float(Fraction(ns, 10**9))
    again = read_again(configuration)
    assert (again.mesh, again.grid, again.digest()) == (configuration.mesh, configuration.grid, configuration.digest())


def test_a_flag_keeps_every_digit_too(tmp_path: Path) -> None:
    mesh(tmp_path)
    overrides = ["mesh.start_time=1714564799.123456789", "mesh.dt=1/30"]
    configuration = load(tmp_path / "mesh.toml", overrides)
    assert (configuration.grid.start_ns, configuration.grid.dt) == (1714564799_123456789, Fraction(1, 30))


@pytest.mark.parametrize(
    ("parts", "words"),
    [
        ({"dt": '"1/0"'}, '[mesh] dt: expected a number > 0, or a fraction such as "1/30", found "1/0"'),
        ({"dt": '"-1/30"'}, '[mesh] dt: expected a number > 0, or a fraction such as "1/30", found "-1/30"'),
        ({"dt": "inf"}, '[mesh] dt: expected a number > 0, or a fraction such as "1/30", found inf'),
        ({"dt": "1e-12"}, "[mesh] dt: dt = 1/1000000000000 s is below a nanosecond"),
        (
            {"start": "1e300"},
            '[mesh] start_time: expected seconds, a moment such as 2024-05-01T12:00:00Z, or "now", found',
        ),
    ],
)
def test_a_grid_that_cannot_be_is_a_mistake(tmp_path: Path, parts: dict[str, str], words: str) -> None:
    assert mistake(tmp_path, **parts).startswith(words)


def test_a_continuous_model_is_of_the_rates_that_are_written(tmp_path: Path) -> None:
    configuration = mesh(tmp_path, model='continuous = true\noffset = [0.0, 0.25]\ninput_delay = "2ms"')
    flow = configuration.continuous
    assert flow is not None
    rates = flow.rates
    assert rates.a is not None
    assert (rates.A.tolist(), rates.rho.tolist(), rates.a.tolist()) == ([[0, 1], [0, 0]], [0.5], [0, 0.25])
    assert configuration.input_delay_ns == 2_000_000
    assert not configuration.has_one_model
    assert configuration.base_model is flow.discretised(100_000_000)
    np.testing.assert_allclose(configuration.base_model.A, [[1, 0.1], [0, 1]], rtol=1e-15)
    assert configuration.stretch_model(7) is configuration.base_model


def test_a_model_of_sensors_has_their_rows_in_both_times(tmp_path: Path) -> None:
    sensor = "D = [[0.0], [2.0]]\noffset = [1.0, 0.0]\nperiod = [0.0, 360.0]"
    configuration = mesh(tmp_path, sensor=sensor)
    model = configuration.model(["wheel", "gauge"])
    assert model.flow is not None
    for one in (model, model.flow.rates):
        assert one.C.tolist() == [[1, 0], [0, 1], [0, 1]]
        assert one.D is not None
        assert one.d is not None
        assert one.period is not None
        assert one.D.tolist() == [[0], [2], [0]]
        assert (one.d.tolist(), one.period.tolist()) == ([1, 0, 0], [0, 360, 0])
        assert one.r.tolist() == [0.5, 0.1, 0.2]
    assert model.radii is not None
    np.testing.assert_array_equal(model.A, configuration.base_model.A)
    np.testing.assert_array_equal(model.flow.discretised(33).A, configuration.continuous.discretised(33).A)  # type: ignore[union-attr]


def test_the_outputs_of_a_sensor_are_its_rows(tmp_path: Path) -> None:
    configuration = mesh(tmp_path, sensor="D = [[0.0], [2.0]]\noffset = [1.0, 0.0]\nperiod = [0.0, 360.0]")
    gauge, wheel = configuration.outputs("gauge"), configuration.outputs("wheel")
    assert gauge.D is not None
    assert gauge.D.tolist() == [[0], [2]]
    assert (wheel.C.tolist(), wheel.r.tolist(), wheel.D, wheel.d, wheel.period) == ([[0, 1]], [0.2], None, None, None)
    assert configuration.outputs("gauge") is gauge


def test_the_noise_of_one_dt_is_in_state_units(tmp_path: Path) -> None:
    configuration = mesh(tmp_path, model="continuous = true\nschedule = [{ from = 5, rho = [1.0] }]")
    first, later = noise_of_one_dt(configuration)
    assert (first.rho, later.rho, later.first) == ((0.5,), (1.0,), 5)
    # Of the double integrator: half-widths rho dt²/2 and rho dt.
    for noise in (first, later):
        assert list(noise.states) == ["x1", "x2"]
        exact = Fraction(noise.rho[0]) * Fraction(1, 10)
        assert exact <= Fraction(noise.states["x2"]) <= exact * Fraction(1001, 1000)
        assert exact / 20 <= Fraction(noise.states["x1"]) <= exact / 20 * Fraction(1001, 1000)
    assert noise_of_one_dt(mesh(tmp_path, model="")) == []


def test_a_schedule_replaces_what_it_names(tmp_path: Path) -> None:
    schedule = """
[[model.schedule]]
from = 4
A = [[0.0, 1.0], [-1.0, 0.0]]
[[model.schedule]]
from = 101.0
B = [[0.0], [3.0]]
offset = [0.0, 1.0]
[[model.schedule]]
from = "1970-01-01T00:01:42Z"
noise_map = [[1.0, 0.0], [0.0, 1.0]]
rho = [0.1, 0.2]
"""
    for is_continuous in (True, False):
        configuration = mesh(tmp_path, model=f"continuous = {str(is_continuous).lower()}\n{schedule}")
        assert [entry.first for entry in configuration.schedule] == [4, 10, 20]
        models = [entry.model for entry in configuration.schedule]
        assert {type(model) for model in models} == {ContinuousModel if is_continuous else LSUModel}
        rates = [model.rates if isinstance(model, ContinuousModel) else model for model in models]
        assert [one.A.tolist() for one in rates] == [[[0, 1], [-1, 0]]] * 3
        assert [one.B.tolist() for one in rates if one.B is not None] == [[[0], [1]], [[0], [3]], [[0], [3]]]
        assert [None if one.a is None else one.a.tolist() for one in rates] == [None, [0, 1], [0, 1]]
        assert rates[2].rho.tolist() == [0.1, 0.2]
        assert configuration.stretch_model(3).A.tolist() == configuration.base_model.A.tolist()
        assert configuration.stretch_model(4).A.tolist() != configuration.base_model.A.tolist()
        again = read_again(configuration)
        assert again.digest() == configuration.digest()
        assert [entry.first for entry in again.schedule] == [4, 10, 20]


BETWEEN = (
    "is 60 ms before step 11 at 101.1 s; a model changes at a step: take that moment, or from = 11, or a dt that has "
    "a step there"
)
NO_SPAN = (
    'expected a duration such as "5ms" or "200us", or a number of seconds, found 5e-10; it is no whole number of '
    "nanoseconds"
)


@pytest.mark.parametrize(
    ("entries", "words"),
    [
        ("{ from = 1, rho = [1.0] }", "[model.schedule[0]] from: expected a step ≥ 2, or a moment on the grid"),
        ("{ from = 100.05, rho = [1.0] }",
         "[model.schedule[0]] from: is 50 ms before step 1 at 100.1 s; a model changes at a step: take that moment"),
        ("{ from = 101.04, rho = [1.0] }", f"[model.schedule[0]] from: {BETWEEN}"),
        ("{ from = 5 }", "[model.schedule[0]]: changes nothing; give one of A, B, offset, noise_map, rho"),
        ("{ from = 5, rho = [1.0, 2.0] }", "[model.schedule[0]] rho: must have 1 entries, one per process noise"),
        ("{ from = 5, offset = [1.0] }", "[model.schedule[0]] offset: must have 2 entries, one per state"),
        ("{ from = 5, B = [[1.0]] }", "[model.schedule[0]] B: expected 2 rows of 1, as in [model], found 1 rows of 1"),
        ("{ from = 5, rho = 1.0 }, { from = 5, rho = 2.0 }",
         "[model.schedule[1]] from: is step 5, not after step 5 of the entry before"),
        ("{ rho = [1.0] }", "[model.schedule[0]] from: is missing; expected a step ≥ 2"),
        ("{ from = true, rho = [1.0] }", "[model.schedule[0]] from: expected a step ≥ 2"),
        ("{ from = 5, r = [1.0], rho = 1.0 }", "[model.schedule[0]] r: unknown key; did you mean"),
    ],
)  # fmt: skip
def test_a_schedule_that_cannot_be_is_a_mistake(tmp_path: Path, entries: str, words: str) -> None:
    for model in ("", "continuous = true\n"):
        assert mistake(tmp_path, model=f"{model}schedule = [{entries}]").startswith(words)


def test_durations_are_whole_nanoseconds(tmp_path: Path) -> None:
    keys = 'time_error = "5ms"\nevery = 0.15\njitter = "20.5us"\nclock_error = 1e-9'
    sensor = mesh(tmp_path, sensor=keys).sensors["gauge"]
    assert (sensor.time_error_ns, sensor.every_ns) == (5_000_000, 150_000_000)
    assert (sensor.jitter_ns, sensor.clock_error_ns) == (20_500, 1)
    keys = 'rate = [1.0, 2.0]\ntime_error = "200 ns"\ngrid_tolerance = "1min"'
    sensor = mesh(tmp_path, model="", sensor=keys).sensors["gauge"]
    assert (sensor.rate, sensor.time_error_ns, sensor.tolerance_ns) == ((1.0, 2.0), 200, 60 * 10**9)
    assert mesh(tmp_path, model="", sensor='off_grid = "nearest"').sensors["gauge"].off_grid == "nearest"


def test_what_is_0_is_not_there(tmp_path: Path) -> None:
    sensor = mesh(tmp_path, sensor="D = [[0.0], [0.0]]\noffset = [0.0, 0.0]\nperiod = [0, 0]").sensors["gauge"]
    assert (sensor.D, sensor.offset, sensor.period) == ((), (), ())


GAUGE = "[sensors.gauge] "
NO_STEPS = "puts its measurements off the grid, and a discrete model knows nothing between steps; set [model] contin"


@pytest.mark.parametrize(
    ("model", "sensor", "words"),
    [
        ("", "D = [[1.0]]", "D: expected 2 rows, one per row of C, and 1 columns, one per input, found 1 rows of 1"),
        ("", "D = [[1.0, 1.0], [1.0, 1.0]]", "D: expected 2 rows, one per row of C, and 1 columns"),
        ("", "offset = [1.0]", "offset: expected 2 numbers, one per row of C, found 1"),
        ("", "period = [360.0, -1.0]", "period: expected periods ≥ 0 (0: none), found [360.0, -1.0]"),
        ("", "rate = [1.0, -1.0]", "rate: expected bounds ≥ 0 of |dy/dt|, per second, found [1.0, -1.0]"),
        ("", "time_error = 5e-10", f"time_error: {NO_SPAN}"),
        ("", 'time_error = "5 hours"', "time_error: expected a duration such as"),
        ("", "every = 0", "every: expected a duration of at least 1 ns such as"),
        ("", 'off_grid = "nearst"', 'off_grid: "nearst" is no choice; did you mean "nearest"?'),
        ("", 'off_grid = "nearest"\nrate = [1.0, 1.0]', "off_grid: has no effect beside rate"),
        ("", 'time_error = "1ms"', f"time_error: {NO_STEPS}"),
        ("", 'jitter = "1ms"', f"jitter: {NO_STEPS}"),
        ("", 'clock_error = "1ms"', f"clock_error: {NO_STEPS}"),
        ("", "every = 0.15", f"every: {NO_STEPS}"),
        ("continuous = true", "rate = [1.0, 1.0]", "rate: has no effect with a continuous model, which takes every"),
        ("continuous = true", 'off_grid = "nearest"', "off_grid: has no effect with a continuous model"),
        ("continuous = true", "grid_tolerance = 0.1", "grid_tolerance: has no effect with a continuous model"),
    ],
)  # fmt: skip
def test_a_key_of_a_sensor_that_cannot_be_is_a_mistake(tmp_path: Path, model: str, sensor: str, words: str) -> None:
    assert mistake(tmp_path, model=model, sensor=sensor).startswith(GAUGE + words)


@pytest.mark.parametrize("key", ["every", "jitter", "clock_error"])
def test_what_is_simulated_is_none_of_a_sensor_that_plays_a_file(tmp_path: Path, key: str) -> None:
    (tmp_path / "gauge.csv").write_text("step,a,b\n1,0.5,1\n")
    words = mistake(tmp_path, sensor=f'file = "gauge.csv"\n{key} = "1ms"')
    assert words == f"{GAUGE}{key}: is simulated, and this sensor is not; remove the key"


def test_a_feedthrough_needs_inputs(tmp_path: Path) -> None:
    (tmp_path / "mesh.toml").write_text(
        MESH.format(dt=1.0, start=0, model="", sensor="D = [[1.0], [1.0]]").replace("B = [[0.0], [1.0]]\n", "")
    )
    with pytest.raises(ConfigurationError) as caught:
        load(tmp_path / "mesh.toml")
    assert [one.sentence for one in caught.value.records] == [
        "[sensors.gauge] D: has no effect: the model has no inputs; give [model] B, or remove it"
    ]


def test_an_input_delay_needs_a_continuous_model(tmp_path: Path) -> None:
    words = mistake(tmp_path, model='input_delay = "2ms"')
    assert words.startswith("[model] input_delay: has no effect: the inputs of a discrete model act for a whole step")


def test_an_exponential_that_overflows_is_a_mistake(tmp_path: Path) -> None:
    words = mistake(tmp_path, dt="1e9", model="continuous = true\noffset = [1.0]")
    assert words.startswith("[model] offset: must have 2 entries")
    text = MESH.format(dt=1e6, start=0, model="continuous = true", sensor="").replace("[0.0, 0.0]]", "[0.0, 9.0]]", 1)
    (tmp_path / "mesh.toml").write_text(text)
    with pytest.raises(ConfigurationError, match=r"\[model\] continuous: a stretch of \d+ ns is too long"):
        load(tmp_path / "mesh.toml")


ENTRY = "schedule = [{{ from = {}, A = [[0.0, 1.0], [{}, 0.0]] }}]"
LATER = {"model": ENTRY.format(4, -1.0)}
NEAREST = {"model": "", "sensor": 'off_grid = "nearest"'}
RATE = {"model": "", "sensor": "rate = [1.0, 1.0]"}
DIFFERENT: dict[str, tuple[dict[str, str], dict[str, str]]] = {
    "continuous": ({}, {"model": ""}),
    "offset": ({"model": "offset = [0.0, 1.0]"}, {"model": ""}),
    "its value": ({"model": "offset = [0.0, 1.0]"}, {"model": "offset = [0.0, 2.0]"}),
    "rates": ({"model": "continuous = true\noffset = [0.0, 1.0]"}, {}),
    "D": ({"model": "", "sensor": "D = [[1.0], [0.0]]"}, {"model": ""}),
    "d": ({"model": "", "sensor": "offset = [1.0, 0.0]"}, {"model": ""}),
    "period": ({"model": "", "sensor": "period = [1.0, 0.0]"}, {"model": "", "sensor": "offset = [1.0, 0.0]"}),
    "schedule": (LATER, {"model": ""}),
    "its step": (LATER, {"model": ENTRY.format(5, -1.0)}),
    "its matrix": (LATER, {"model": ENTRY.format(4, -2.0)}),
    "rate": (RATE, {"model": "", "sensor": "rate = [1.0, 2.0]"}),
    "off_grid": (NEAREST, {"model": ""}),
    "dt": ({}, {"dt": "0.2"}),
    "dt to the last digit": ({"dt": '"1/3"'}, {"dt": "0.3333333333333333"}),
    "start": ({}, {"start": "100.000000001"}),
    "dt, nearest": (NEAREST, NEAREST | {"dt": "0.2"}),
    "start, rate": (RATE, RATE | {"start": "0"}),
    "start, schedule": (LATER, LATER | {"start": "0"}),
}
"""Pairs of files that differ in one item of the digest."""


@pytest.mark.parametrize("item", DIFFERENT)
def test_each_item_of_the_mathematics_changes_the_digest(tmp_path: Path, item: str) -> None:
    one, other = DIFFERENT[item]
    assert mesh(tmp_path, **one).digest() != mesh(tmp_path, **other).digest()


@pytest.mark.parametrize(
    ("one", "other"),
    [
        ({"model": ""}, {"model": "", "dt": "0.2", "start": "5.0"}),
        ({"model": ""}, {"model": "offset = [0.0, 0.0]", "sensor": "period = [0.0, 0.0]"}),
        ({}, {"sensor": 'time_error = "5ms"'}),
        ({}, {"model": 'continuous = true\ninput_delay = "1ms"'}),
        ({}, {"sensor": 'every = "150ms"\njitter = "1ms"\nclock_error = "1ms"'}),
        ({}, {"dt": '"1/10"', "start": "1970-01-01T00:01:40Z"}),
    ],
)
def test_bounds_and_what_does_not_matter_stay_out(tmp_path: Path, one: dict[str, str], other: dict[str, str]) -> None:
    assert mesh(tmp_path, **one).digest() == mesh(tmp_path, **other).digest()


@pytest.mark.parametrize(
    ("file", "digest"),
    [
        ("services/lsu_mesh_services/demo.toml", "b015983c54681c34"),
        ("docker/mesh.toml", "b015983c54681c34"),
        ("examples/mesh.toml", "b015983c54681c34"),
        ("examples/learning.toml", "05427a83c31f51aa"),
        ("examples/liar.toml", "3ab76e9e54e20f16"),
    ],
)
def test_a_model_without_the_new_parts_keeps_its_digest(root: Path, file: str, digest: str) -> None:
    assert load(root / file).digest() == digest
