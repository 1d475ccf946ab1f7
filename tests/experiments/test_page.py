"""The page of all experiments."""

from __future__ import annotations

from lsu_mesh.experiments.comparison import compared, table
from lsu_mesh.experiments.outcome import Check, Column, Outcome, Table
from lsu_mesh.experiments.page import WHOLE, page


def test_a_section_has_everything_in_order() -> None:
    long = Table("long", "Too long", (Column("n"),), [(i,) for i in range(WHOLE + 1)])
    data = Table("data", "Only a file", (Column("n"),), [(1,)], is_for_files=True)
    outcome = Outcome(
        [table("t", "A title", ["filter"], [compared(("a",), 1.0, 1.0)]), long, data],
        [Check("width", 1.0, 2.0)],
        {"t-figure": lambda: None},  # type: ignore[dict-item,return-value]
        title="A paper",
        notes="Its setting.",
        captions={"t-figure": "What it shows"},
        errata=["(1) should be (2)."],
    )
    text = page({"t2018": outcome}, "lsu-mesh reproduce all", "papers")
    assert "| [t2018](#t2018) | A paper | 1 | 0 | 0 | 0 | 0 | 1 of 1 |" in text
    parts = (
        "# The papers, reproduced", "## t2018", "**A paper.**", "Its setting.", "A title", "| reproduced |",
        "![t-figure](papers/t-figure.png)", "*What it shows*", "- met: width = 1 (at most 2)", "- (1) should be (2).",
    )  # fmt: skip
    places = [text.rindex(part) if part.startswith("|") else text.index(part) for part in parts]
    assert places == sorted(places)
    assert "Too long" not in text
    assert "Only a file" not in text
    assert "\n\n\n" not in text
