"""What a mesh of banks may not have is refused with its place, its value and a remedy."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from bank_mesh import targets, write

from lsu_mesh.mesh.config import ConfigurationError, load

SECOND = "filters.other={kind='LSUO',sensors=['radar'],instances=12}"
MODEL = "lower=[[-1.0,-1.0,-1.0,-1.0]],upper=[[1.0,1.0,1.0,1.0]]"


def refusal(folder: Path, *overrides: str) -> str:
    """The lines about a configuration."""
    with pytest.raises(ConfigurationError) as found:
        targets(folder, *overrides)
    return str(found.value)


def test_a_mesh_of_banks(tmp_path: Path) -> None:
    configuration = targets(tmp_path, SECOND)
    assert configuration.instances is not None
    assert configuration.instances.count == 12
    assert [one.instances for one in configuration.filters.values()] == [12, 12]
    assert load(write(tmp_path), ["filters.targets.instances=13"]).digest() != configuration.digest()


@pytest.mark.parametrize(
    ("overrides", "words"),
    [
        (
            ["filters.targets.instances=0"],
            "[filters.targets] instances: expected a whole number from 1 to 100000, found 0; remove the key",
        ),
        (["filters.targets.instances=100001"], "instances: expected a whole number from 1 to 100000, found 100001"),
        (["filters.targets.instances=true"], "instances: expected a whole number from 1 to 100000, found true"),
        (
            ["filters.targets.kind=WindowMAP"],
            '[filters.targets] kind: "WindowMAP" cannot be a bank: WindowMAP with these options has no compiled bank',
        ),
        (
            [SECOND, "filters.targets.transfer=predictor"],
            '[filters.targets] transfer: is "predictor", and a bank takes no transfers',
        ),
        (["filters.targets.history=3"], "[filters.targets] history: has no effect: a bank does not do steps again"),
        (["filters.targets.on_inconsistency=widen"], 'on_inconsistency: is "widen", and a bank does not widen'),
        (
            ["filters.other={kind='LSUO',sensors=['radar']}"],
            "[filters.targets] instances: is 12, and [filters.other] is a single filter",
        ),
        (
            ["filters.other={kind='LSUO',sensors=['radar'],instances=3}"],
            "[filters.other] instances: is 3, and [filters.targets] has 12",
        ),
        (["model.B=[[1.0],[0.0],[0.0],[0.0]]"], "[model] B: a bank takes no inputs; remove B"),
        (["model.continuous=true"], "[model] continuous: a bank goes by steps"),
        (["model.schedule=[{from=4,rho=[0.1,0.1,0.1,0.1]}]"], "[model] schedule: a bank keeps one model"),
        (["plant.x1=[0.0,0.0,0.0,0.0]"], "[plant] x1: is the state of one target; give x1 in [model.instances]"),
        (["sensors.radar.offset=[1.0,0.0]"], "[sensors.radar] offset: a bank uses plain outputs C x"),
        (["sensors.radar.period=[360.0,0.0]"], "[sensors.radar] period: a bank uses plain outputs C x"),
        (["sensors.radar.time_error='1ms'"], "[sensors.radar] time_error: a bank uses plain outputs"),
        (
            ["sensors.radar.faults=[{kind='lost',instances=[12]}]"],
            "instances: names instance 12; the bank has instances 0 to 11",
        ),
        (["identifier.learn={sensors=['radar']}"], "[identifier.learn]: nobody identifies bounds"),
        (
            [SECOND, "fusion.main={sources=['targets','other'],policy='relaxed',faults=1}"],
            '[fusion.main] policy: is "relaxed", and banks are intersected; set "intersect"',
        ),
        ([f"model.instances={{{MODEL}}}"], "[model.instances] lower: expected shape (12, 4), one row per instance"),
        (["model.instances={lower=[[0.0]]}"], "[model.instances] lower: lower and upper of the priors come together"),
        (["model.instances={A=[[[1.0]],[[1.0],[1.0]]]}"], "[model.instances] A: the matrices differ in shape"),
        (["model.instances={rho=[[1.0],[2.0,3.0]]}"], "[model.instances] rho: "),
        (["model.instances={file='none.npz'}"], "[model.instances] file: "),
        (["model.instances={colour=1}"], "[model.instances] colour: unknown key"),
    ],
)
def test_what_a_bank_cannot_have(tmp_path: Path, overrides: list[str], words: str) -> None:
    assert words in refusal(tmp_path, *overrides)


@pytest.mark.parametrize(
    ("arrays", "words"),
    [
        ({"lower": np.zeros((12, 4)), "upper": np.full((12, 4), -1.0)}, "lower > upper in row 0"),
        ({"rho": np.full((12, 4), -1.0)}, "rho in own.npz: row 0 has a negative half-width"),
        ({"x1": np.full((12, 4), np.nan)}, "x1 in own.npz: holds a number that is not finite"),
        (
            {"A": np.zeros((11, 4, 4))},
            "A in own.npz: expected shape (12, 4, 4), one row per instance, found (11, 4, 4)",
        ),
        ({"C": np.zeros((12, 4))}, "holds C; expected a NumPy file .npz with arrays of the names lower, upper, A"),
        ({"x1": np.array(["a"])}, "holds x1; expected"),
    ],
)
def test_a_file_of_instances_that_does_not_fit(tmp_path: Path, arrays: dict[str, np.ndarray], words: str) -> None:
    np.savez(tmp_path / "own.npz", **arrays)
    assert words in refusal(tmp_path, "model.instances={file='own.npz'}")


def test_a_file_that_is_no_file_of_arrays(tmp_path: Path) -> None:
    (tmp_path / "own.npz").write_text("lower,upper")
    assert "cannot be read" in refusal(tmp_path, "model.instances={file='own.npz'}")


def test_parts_without_a_bank(tmp_path: Path) -> None:
    text = write(tmp_path).read_text().replace("instances = 12", "")
    (tmp_path / "mesh.toml").write_text(text)
    fault = "sensors.radar.faults=[{kind='lost',instances=[3]}]"
    with pytest.raises(ConfigurationError) as found:
        load(tmp_path / "mesh.toml", [f"model.instances={{{MODEL}}}", fault])
    assert "[model.instances]: has no effect without a bank" in str(found.value)
    assert "[sensors.radar.faults[0]] instances: has no effect: the mesh has no bank" in str(found.value)


def test_a_message_must_have_room_for_all(tmp_path: Path) -> None:
    words = refusal(tmp_path, "filters.targets.instances=100000", "filters.targets.kind=LSUP", *_states(12))
    assert "a message of 12 states has room for" in words


def _states(n: int) -> list[str]:
    """Overrides that make the model one of n states."""
    unit = np.eye(n).tolist()
    prior = f"model.prior={{lower={[-1.0] * n},upper={[1.0] * n}}}"
    return [
        f"model.A={unit}",
        f"model.rho={[0.1] * n}",
        prior,
        f"sensors.radar.C={unit[:2]}",
        f"sensors.lidar.C={unit[:1]}",
    ]
