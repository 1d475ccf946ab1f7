"""What a mesh tells of its model is what its file says."""

from __future__ import annotations

from pathlib import Path

import msgpack

from lsu_mesh.mesh.config import load
from lsu_mesh.mesh.model_answer import encode_model, model_answer


def test_plain_msgpack_reads_the_model(demo: Path) -> None:
    configuration = load(demo)
    model = configuration.base_model
    told = msgpack.unpackb(encode_model(model_answer(configuration)))
    assert (told["v"], told["model"], told["dt"]) == (1, configuration.digest(), configuration.mesh.dt)
    assert told["A"] == model.A.tolist()
    assert model.B is not None
    assert told["B"] == model.B.tolist()
    assert told["rho"] == model.rho.tolist()
    assert (told["states"], told["units"]) == (list(model.states), list(model.units))
    assert set(told["sensors"]) == set(configuration.sensors)
    for name, sensor in configuration.sensors.items():
        rows = [list(row) for row in sensor.C]
        assert told["sensors"][name] == {"C": rows, "r": list(sensor.r), "outputs": list(sensor.outputs)}
    assert (told["start_ns"], told["boot"]) == (None, None), "kept for later, and told by nobody yet"


def test_what_a_model_does_not_have_is_nil(tmp_path: Path) -> None:
    file = tmp_path / "mesh.toml"
    file.write_text(
        '[mesh]\nname = "still"\ndt = 1.0\n[model]\nA = [[1.0]]\nrho = [0.1]\n[model.prior]\nlower = [0.0]\n'
        'upper = [1.0]\n[plant]\n[sensors.s]\nC = [[1.0]]\nr = [0.1]\n[filters.f]\nkind = "LSUO"\nsensors = ["s"]\n'
    )
    told = msgpack.unpackb(encode_model(model_answer(load(file))))
    assert (told["B"], told["noise_map"]) == (None, None)


def test_the_parts_of_a_full_model_are_told(tmp_path: Path) -> None:
    file = tmp_path / "mesh.toml"
    file.write_text(
        '[mesh]\nname = "full"\ndt = "1/4"\nstart_time = 100.000000001\n'
        "[model]\ncontinuous = true\nA = [[-1.0]]\nB = [[2.0]]\noffset = [0.5]\nrho = [0.1]\n"
        "schedule = [{ from = 9, A = [[-2.0]] }]\n"
        "[model.prior]\nlower = [0.0]\nupper = [1.0]\n[plant]\n"
        '[sensors.s]\nC = [[1.0]]\nr = [0.1]\nD = [[3.0]]\noffset = [0.25]\nperiod = [360.0]\ntime_error = "5ms"\n'
        '[sensors.t]\nC = [[1.0]]\nr = [0.1]\n[filters.f]\nkind = "LSUO"\nsensors = ["s"]\n'
    )
    configuration = load(file)
    told = msgpack.unpackb(encode_model(model_answer(configuration)))
    first = configuration.base_model
    assert first.a is not None
    assert (told["A"], told["offset"]) == (first.A.tolist(), first.a.tolist()), "those of one dt"
    rates = {"A": [[-1.0]], "B": [[2.0]], "offset": [0.5], "noise_map": None, "rho": [0.1]}
    assert told["continuous"] == rates
    assert told["schedule"] == [{"first": 9, "model": rates | {"A": [[-2.0]]}}]
    assert (told["dt"], told["dt_exact"], told["start_ns"]) == (0.25, "1/4", 100_000_000_001)
    assert told["sensors"]["s"] == {
        "C": [[1.0]], "r": [0.1], "outputs": ["s"], "D": [[3.0]], "d": [0.25], "period": [360.0],
        "time_error_ns": 5_000_000,
    }  # fmt: skip
    assert set(told["sensors"]["t"]) == {"C", "r", "outputs"}, "what is 0 is not told"


def test_what_a_program_may_send_is_told(tmp_path: Path) -> None:
    file = tmp_path / "mesh.toml"
    file.write_text(
        '[mesh]\nname = "live"\ndt = "1/30"\n[model]\ncontinuous = true\nA = [[-1.0]]\nB = [[2.0]]\nrho = [0.1]\n'
        "[model.prior]\nlower = [0.0]\nupper = [1.0]\n"
        '[model.input_box]\nlower = [0.0]\nupper = [1.0]\n[plant]\nname = "arm"\nsource = "external"\n'
        '[sensors.s]\nC = [[1.0]]\nr = [0.1]\nsource = "external"\n[filters.f]\nkind = "LSUO"\nsensors = ["s"]\n'
    )
    told = msgpack.unpackb(encode_model(model_answer(load(file))))
    assert (told["plant"], told["sensors"]["s"]["source"], told["dt_exact"]) == ("arm", "external", "1/30")
