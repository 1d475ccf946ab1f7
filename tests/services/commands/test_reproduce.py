"""``lsu-mesh reproduce``: tables and checks on stdout, files in a folder, exit codes."""

from __future__ import annotations

import importlib
import json
from pathlib import Path

import pytest
from lsu_mesh_services import cli, exit_codes
from lsu_mesh_services.commands import reproduce
from lsu_mesh_services.options.reproduce import REPRODUCIBLE, Experiment

from lsu_mesh.errors import ModelError
from lsu_mesh.experiments import fusion, transfer
from lsu_mesh.experiments.outcome import Check, Column, Outcome, Table


def made(limit: float) -> Outcome:
    def draw() -> object:
        from lsu_mesh.experiments.transfer_figure import draw_transfer

        return draw_transfer(
            [
                transfer.Result("S2", "LSUPB", "predictor", r, 0.5, 0.6, 0.7, 3.0, 0.8, 0.9, 1.1, 1.0, 0.0, 0.0)
                for r in (1, 2)
            ]
        )

    table = Table("t", "A title", (Column("name"), Column("width")), [("a", 1.5)])
    return Outcome([table], [Check("width", 1.5, limit)], {"f": draw})  # type: ignore[dict-item]


@pytest.fixture
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    """Experiments that take no time: the first meets its check."""
    monkeypatch.setattr(fusion, "run", lambda quick, seed, watch: made(2.0))
    monkeypatch.setattr(transfer, "run", lambda quick, seed, watch: made(2.0 if quick else 1.0))


def test_every_choice_has_its_experiments() -> None:
    for experiment in REPRODUCIBLE.values():
        for name in experiment.modules:
            assert callable(importlib.import_module(f"lsu_mesh.experiments.{name}").run)


@pytest.mark.usefixtures("small")
def test_tables_and_checks_are_printed(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["reproduce", "fusion", "--quick"]) == exit_codes.OK
    shown = capsys.readouterr().out
    assert "A title" in shown
    assert shown.count("met: width = 1.5 (at most 2)") == 2


@pytest.mark.usefixtures("small")
def test_a_check_that_is_not_met_is_the_exit_code(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["reproduce", "fusion"]) == exit_codes.NOT_MET
    assert "NOT MET: width = 1.5 (at most 1)" in capsys.readouterr().out


@pytest.mark.usefixtures("small")
def test_json_lines(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["reproduce", "fusion", "--quick", "--json"]) == exit_codes.OK
    row, check, *_ = map(json.loads, capsys.readouterr().out.splitlines())
    assert row == {"type": "row", "table": "t", "name": "a", "width": 1.5}
    assert check == {"type": "check", "what": "width", "measured": 1.5, "limit": 2.0, "sense": "at most", "met": True}


SHORT = {
    "p2006.experiment": {"QUICK_STEPS": 30, "QUICK_RUNS": 1},
    "p2014.experiment": {"QUICK_STEPS": 60, "QUICK_RUNS": 1},
    "p2018.experiment": {"QUICK_RUNS": 1},
    "l2019.experiment": {"QUICK_STEPS": 60, "QUICK_RUNS": 1},
    "p2023.experiment": {"QUICK_STEPS": 30, "QUICK_RUNS": 1},
    "fusion": {},
}
"""What makes a part of ``reproduce all --quick`` as short as it can be."""
LONG = ("p2014.experiment", "p2018.experiment", "l2019.experiment", "fusion")
"""Half a minute or more even so."""


@pytest.mark.parametrize(
    "module", [pytest.param(one, marks=[pytest.mark.soak] if one in LONG else []) for one in SHORT]
)
def test_every_line_of_a_part_is_json(
    module: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    what = module.split(".")[0]
    for name, value in SHORT[module].items():
        monkeypatch.setattr(f"lsu_mesh.experiments.{module}.{name}", value)
    assert cli.main(["reproduce", what, "--quick", "--json"]) in (exit_codes.OK, exit_codes.NOT_MET)
    records = [json.loads(line, parse_constant=pytest.fail) for line in capsys.readouterr().out.splitlines()]
    assert {record["type"] for record in records} <= {"row", "check"}
    assert len(records) > 5


@pytest.mark.usefixtures("small")
def test_files_are_written(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["reproduce", "fusion", "--quick", "--out", str(tmp_path / "new" / "folder")]) == exit_codes.OK
    folder = tmp_path / "new" / "folder"
    assert sorted(path.name for path in folder.iterdir()) == ["f.png", "t.csv", "t.md"]
    assert (folder / "f.png").read_bytes().startswith(b"\x89PNG")
    assert f"wrote {folder / 't.csv'}" in capsys.readouterr().err


@pytest.mark.usefixtures("small")
def test_a_folder_that_cannot_be_made_is_said(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "file").write_text("")
    assert cli.main(["reproduce", "fusion", "--out", str(tmp_path / "file")]) == exit_codes.USAGE
    assert "cannot be made" in capsys.readouterr().err


@pytest.mark.usefixtures("small")
def test_all_writes_a_page_beside_the_folder_of_its_files(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(reproduce, "REPRODUCIBLE", {"fusion": REPRODUCIBLE["fusion"]})
    assert cli.main(["reproduce", "all", "--quick", "--out", str(tmp_path)]) == exit_codes.OK
    assert sorted(path.name for path in tmp_path.iterdir()) == ["papers", "papers.md"]
    text = (tmp_path / "papers.md").read_text(encoding="utf-8")
    assert f"`lsu-mesh reproduce all --quick --out {tmp_path.name}`" in text
    assert "![f](papers/f.png)" in text
    assert f"wrote {tmp_path / 'papers.md'}" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["fusion", "--benchmarks", "x"], "--benchmarks: only cora and all read published systems, fusion does not"),
        (["all", "--benchmarks", "no-such-folder"], "--benchmarks no-such-folder: there is no such folder"),
    ],
)
def test_options_that_do_not_fit_are_refused(
    arguments: list[str], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.main(["reproduce", *arguments]) == exit_codes.USAGE
    assert said in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "said"), [(["fusion", "--seed", "-1"], "0 or more"), (["p1999"], "invalid choice: 'p1999'")]
)
def test_wrong_arguments_are_refused(arguments: list[str], said: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit, match="2"):
        cli.main(["reproduce", *arguments])
    assert said in capsys.readouterr().err


def test_an_experiment_that_fails_does_not_stop_the_others(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def fail(quick: bool, seed: int, watch: object) -> Outcome:
        raise ModelError("no such thing")

    monkeypatch.setattr(reproduce, "REPRODUCIBLE", {name: Experiment("", (name,)) for name in ("transfer", "fusion")})
    monkeypatch.setattr(transfer, "run", fail)
    monkeypatch.setattr(fusion, "run", lambda quick, seed, watch: made(2.0))
    assert cli.main(["reproduce", "all", "--quick"]) == exit_codes.FAILURE
    shown = capsys.readouterr()
    assert "met: width = 1.5" in shown.out
    assert "transfer: no such thing" in shown.err
    assert "not done: transfer" in shown.err
