"""The simulator: the mesh survives a share of the seeds, a seed repeats itself, and planted bugs are found."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from lsu_mesh.mesh.admission import Admission
from lsu_mesh.mesh.messages import Base, Posterior
from lsu_mesh.mesh.nodes.estimator import Estimator
from lsu_mesh.mesh.simulator import run
from lsu_mesh.mesh.simulator.faults import FAULTS, parse_faults
from lsu_mesh.mesh.simulator.run import Outcome, run_seed
from lsu_mesh.supports.support import Support

STEPS = 60
MAX_SEEDS = 100


@pytest.fixture(autouse=True)
def fresh_references() -> Iterator[None]:
    """A run with a planted bug must not leave its fault-free run to others."""
    run.fault_free_widths.cache_clear()
    yield
    run.fault_free_widths.cache_clear()


def seeds_until_found(demo: Path, faults: tuple[str, ...] = FAULTS) -> tuple[int, Outcome]:
    """How many seeds it takes until an invariant is broken."""
    for seed in range(1, MAX_SEEDS + 1):
        outcome = run_seed(demo, seed, STEPS, faults)
        if outcome.broken:
            return seed, outcome
    raise AssertionError(f"not found in {MAX_SEEDS} seeds")


def test_a_stale_set_taken_as_current_is_found(demo: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    begin = Estimator._begin

    def begin_now(self: Estimator, k: int, support: Support, base: Base, *, restarted: bool = True) -> None:
        begin(self, max(k, self.timeline.arrivals.newest), support, base, restarted=restarted)

    monkeypatch.setattr(Estimator, "_begin", begin_now)
    _, outcome = seeds_until_found(demo)
    assert outcome.broken.startswith(("provenance", "containment", "false alarm")), outcome.broken


def test_a_lost_dedupe_is_found(demo: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Admission, "_is_new", lambda self, key, message: True)
    _, outcome = seeds_until_found(demo)
    assert outcome.broken.startswith("dedupe"), outcome.broken


def test_a_missing_rewind_is_found(demo: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Estimator, "_rewind", lambda self, k: None)
    _, outcome = seeds_until_found(demo)
    assert outcome.broken.startswith("late data"), outcome.broken


def test_a_bound_that_is_too_tight_is_found(demo: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    published = Estimator._publish

    def too_tight(self: Estimator, *arguments: object) -> Posterior | None:
        message = published(self, *arguments)  # type: ignore[arg-type]
        if message is not None:
            middle = [0.5 * (low + high) for low, high in zip(message.lower, message.upper, strict=True)]
            message.upper[:] = middle
        return message

    monkeypatch.setattr(Estimator, "_publish", too_tight)
    seed, outcome = seeds_until_found(demo, ())
    assert seed == 1
    assert outcome.broken.startswith("containment"), outcome.broken


def test_a_seed_repeats_itself(demo: Path) -> None:
    one, other = (run_seed(demo, 5, STEPS, FAULTS) for _ in range(2))
    assert one == other
    assert one.sets > STEPS


@pytest.mark.parametrize("seed", [216, 1075, 2106, 4019, 4123, 4589, 6606, 7156])
def test_seeds_that_a_campaign_found_stay_whole(demo: Path, seed: int) -> None:
    assert run_seed(demo, seed, 300, FAULTS).broken == ""


def test_no_invariant_is_broken_in_a_share_of_the_seeds(demo: Path) -> None:
    outcomes = [run_seed(demo, seed, 240, FAULTS) for seed in (1, 3)]
    assert [outcome.broken for outcome in outcomes] == ["", ""]
    assert all(sum(outcome.counts[kind] for outcome in outcomes) for kind in ("kill", "drop", "recovered"))


@pytest.mark.soak
def test_no_invariant_is_broken_in_many_seeds(demo: Path) -> None:
    assert [o for seed in range(1000, 1200) if (o := run_seed(demo, seed, 300, FAULTS)).broken] == []


@pytest.mark.parametrize(
    ("text", "expected"),
    [("all", FAULTS), ("none", ()), ("kill, drop", ("drop", "kill")), ("skew", ("skew",))],
)
def test_faults_are_chosen_by_name(text: str, expected: tuple[str, ...]) -> None:
    assert parse_faults(text) == expected


def test_an_unknown_fault_is_named() -> None:
    with pytest.raises(ValueError, match="no fault 'fire'"):
        parse_faults("drop,fire")


def test_the_simulated_truth_is_that_of_the_plant(demo: Path, mesh_of: Callable[..., object]) -> None:
    mesh = mesh_of("mesh.steps=12")
    mesh.run(0.5)  # type: ignore[attr-defined]
    X = run.true_states(mesh.configuration, 12)  # type: ignore[attr-defined]
    assert {k + 1: row for k, row in enumerate(X.tolist())} == mesh.truth()  # type: ignore[attr-defined]
