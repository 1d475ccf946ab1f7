"""The page of all experiments: settings, tables with verdicts, figures, checks and errata, as Markdown."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from lsu_mesh.experiments.comparison import FAR, NEAR, SHARE, VERDICTS, count
from lsu_mesh.experiments.outcome import Outcome

WHOLE = 90
"""Rows up to which a table stands on the page; a longer one is only written as a file."""


def page(outcomes: Mapping[str, Outcome], command: str, folder: str) -> str:
    """The page; ``outcomes`` by what was run, in order; figures stand in ``folder``, relative to the page."""
    blocks = [_opening(command), _summary(outcomes)]
    for what, outcome in outcomes.items():
        blocks += _section(what, outcome, folder)
    return "\n\n".join(block.strip("\n") for block in blocks) + "\n"


def _opening(command: str) -> str:
    return (
        "# The papers, reproduced\n\n"
        f"Written by `{command}`; of the numbers only the column *paper* is typed in. Each part can be run alone, such "
        "as `lsu-mesh reproduce l2019`; `--quick` is a small version, `--out DIR` writes tables and figures as CSV, "
        "Markdown and PNG files. Two runs with one seed give the same numbers, but for measured times.\n\n"
        "**Verdicts** come from a rule. *Here* is mean ± standard deviation over runs, and z is the distance to the "
        "paper's number in standard deviations of a single run.\n\n"
        f"- A number is *reproduced* if |z| ≤ {NEAR:.0f}, or if it differs by at most {100 * SHARE:.0f} %. It is "
        f"*undecided* up to |z| = {FAR:.0f}. Beyond that, or where one run gives no z, it is a *deviation*.\n"
        "- A statement in words is *reproduced* if it is true here. It is *same trend* if its direction is true and "
        "its size is not. It is *undecided* if the answer depends on what the paper leaves open. Else it is *not "
        "reproduced*.\n"
        "- A deviation, and what is not reproduced, ends with a reason. The reason was computed by the run that wrote "
        "this page, or it says *unexplained*. A deviation can come from an error here as well as from one there.\n\n"
        "Rows without a number of the paper are filters, options or tests that it did not have."
    )


def _summary(outcomes: Mapping[str, Outcome]) -> str:
    titles = ["", "what", *VERDICTS, "checks met"]
    rules = [":--", ":--", *["--:"] * (len(titles) - 2)]
    lines = [f"| {' | '.join(cells)} |" for cells in (titles, rules)]
    for what, outcome in outcomes.items():
        counts = count(outcome.tables)
        numbers = (
            " | ".join(str(counts[verdict]) for verdict in VERDICTS)
            if sum(counts.values())
            else " | ".join("–" * len(VERDICTS))
        )
        met = f"{sum(check.is_met for check in outcome.checks)} of {len(outcome.checks)}"
        lines.append(f"| [{what}](#{what}) | {outcome.title or what} | {numbers} | {met} |")
    return "\n".join(lines)


def _section(what: str, outcome: Outcome, folder: str) -> Iterator[str]:
    yield f"## {what}" + (f"\n**{outcome.title.rstrip('.')}.**" if outcome.title else "")
    if outcome.notes:
        yield outcome.notes
    for table in outcome.tables:
        if not table.is_for_files and len(table.rows) <= WHOLE:
            yield table.markdown()
    for stem in outcome.figures:
        caption = outcome.captions.get(stem, stem)
        yield f"![{stem}]({folder}/{stem}.png)\n\n*{caption}*"
    if outcome.checks:
        yield "Checks:\n" + "\n".join(f"- {check}" for check in outcome.checks)
    if outcome.errata:
        yield "Errata and readings of the paper:\n" + "\n".join(f"- {line}" for line in outcome.errata)
