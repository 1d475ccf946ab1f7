"""What ``lsu-mesh publish`` says of lines that it cannot send."""

from __future__ import annotations

import pytest
from lsu_mesh_services.client import WrongValue
from lsu_mesh_services.commands import publish
from lsu_mesh_services.commands.publish import TOLD, Line, WrongLines


def test_wrong_lines_are_told_each_and_then_one_a_second(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    now = 100.0
    monkeypatch.setattr(publish.time, "monotonic", lambda: now)
    wrong = WrongLines()
    for number in range(1, 31):
        wrong.tell(Line(number, "abc", 0), WrongValue("no number"))
    told = capsys.readouterr().err.splitlines()
    assert told == [f"publish: line {number}: no number" for number in range(1, TOLD + 1)]
    now = 101.0
    wrong.tell(Line(31, "abc", 0), WrongValue("no number"))
    assert capsys.readouterr().err == "publish: line 31: no number (20 wrong line(s) before it are not shown)\n"
    assert wrong.count == 31
