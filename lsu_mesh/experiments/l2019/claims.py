"""What Lainová et al. 2019 say about their figures (section 4.5), beside what is so here."""

from __future__ import annotations

from collections.abc import Iterator

from lsu_mesh.experiments.comparison import Row, ours, stated, trend_stated
from lsu_mesh.experiments.effect import Effect
from lsu_mesh.experiments.l2019.criteria import SETTLED, TRANSIENT, WITHOUT_INPUT
from lsu_mesh.experiments.l2019.overlap import SIGNED
from lsu_mesh.experiments.l2019.surfaces import Surfaces
from lsu_mesh.experiments.outcome import Spread

LOSSES = "a guaranteed filter loses nothing; losses come from widening by rho where abs(M A⁻¹) rho is meant"
GROWS = 1.05
"""Factor between the ends of the grid from which something grows."""


def claims(surfaces: Surfaces) -> list[Row]:
    """All statements, system by system."""
    return [
        *_errors(surfaces),
        *_predictions(surfaces),
        *_sizes(surfaces),
        *_outside(surfaces),
        *_signed_sum(surfaces),
        *_nesting(surfaces),
    ]


def _errors(s: Surfaces) -> Iterator[Row]:
    for system in ("S1", "S3"):
        effect = Effect.of(s.of(system, "T1"))
        grows = min(effect) > GROWS
        yield stated((system, "T1"), "grows with ρ and r", str(effect), holds=grows)
        yield stated((system, "T1"), "ρ matters more than r", str(effect), holds=effect.rho > effect.r)
    effect = Effect.of(s.of("S2", "T1"))
    yield stated(
        ("S2", "T1"), "ρ has no influence, r only", str(effect), holds=effect.rho < GROWS < effect.r,
        why="LSUO never measures the velocity of S2: its error is the velocity's random walk, which grows with ρ",
    )  # fmt: skip
    ratio = Spread.of(s.of("S2", "T2") / s.of("S2", "T1"))
    yield stated(
        ("S2", "T2 ÷ T1"), "slightly below 1", ratio, holds=0.5 <= ratio.mean < 1.0,
        why="far below 1: a parallelotope keeps what positions say of the velocity, a box cannot",
    )  # fmt: skip
    ratio = Spread.of(s.of("S3", "T2") / s.of("S3", "T1"))
    yield stated(("S3", "T2 ÷ T1"), "above 1", ratio, holds=ratio.mean > 1.0)


def _predictions(s: Surfaces) -> Iterator[Row]:
    ratio = Spread.of(s.of("S3", "T3") / s.of("S3", "T4"))
    yield stated(("S3", "T3 ÷ T4"), "very near 1", ratio, holds=abs(ratio.mean - 1.0) < 0.2)
    effect = Effect.of(s.of("S3", "T4"))
    yield stated(("S3", "T4"), "grows with ρ and r", str(effect), holds=min(effect) > GROWS)
    ratio = Spread.of(s.of("S2", "T3") / s.of("S2", "T4"))
    yield stated(("S2", "T3 ÷ T4"), "about 100", ratio, holds=50.0 <= ratio.mean <= 200.0)
    ratio = Spread.of(s.of("S1", "T4") / s.of("S1", "T3"))
    yield stated(
        ("S1", "T4 ÷ T3"), "about 100", ratio, holds=50.0 <= ratio.mean <= 200.0,
        why="LSUP predicts as well as LSUO; see the next row",
    )  # fmt: skip
    ratios = s.mean["S1", "LSUP", WITHOUT_INPUT] / s.mean["S1", "LSUO", SETTLED]
    yield trend_stated(
        ("S1", f"T4 ÷ T3 after step {TRANSIENT}, where LSUP's predictor leaves out B u"), "about 100",
        Spread.of(ratios), holds=ratios.max() > 50.0,
        why=f"from {ratios.min():.3g} to {ratios.max():.3g} over the grid",
    )  # fmt: skip


def _sizes(s: Surfaces) -> Iterator[Row]:
    ratios = s.of("S1", "V1") / s.of("S1", "V2")
    yield trend_stated(
        ("S1", "V1 ÷ V2"), "about 1000", Spread.of(ratios), holds=ratios.mean() > 100.0,
        why=f"from {ratios.min():.3g} to {ratios.max():.3g} over the grid",
    )  # fmt: skip
    for system in ("S2", "S3"):
        ratio = Spread.of(s.of(system, "V1") / s.of(system, "V2"))
        yield stated(
            (system, "V1 ÷ V2"), "above 1", ratio, holds=ratio.mean > 1.0,
            why=f"the image elongates; LSUPB has {_volume_of_bundle(s, system):.2g} × LSUO's volume",
        )  # fmt: skip
    for system in ("S1", "S2"):
        share = Spread.of(s.of(system, "P5"))
        yield stated((system, "P5, %"), "the vast majority", share, holds=share.mean > 80.0)
    ratio = Spread.of(s.of("S2", "L1") / s.of("S2", "L2"))
    yield trend_stated(
        ("S2", "L1 ÷ L2"), "about 100", ratio, holds=ratio.mean > 10.0,
        why="LSUO's velocity interval grows by 2 ρ a step, so the factor is that of the record's length and the prior",
    )  # fmt: skip
    share = Spread.of(s.of("S2", "P6"))
    yield stated(("S2", "P6, %"), "the absolute majority", share, holds=share.mean > 90.0)


def _volume_of_bundle(s: Surfaces, system: str) -> float:
    return float((s.mean[system, "LSUPB", "V"] / s.of(system, "V1")).mean())


def _outside(s: Surfaces) -> Iterator[Row]:
    for system in ("S1", "S2", "S3"):
        words = "0" if system == "S2" else "few"
        for name in ("P1", "P3"):
            share = float(s.of(system, name).max())
            yield stated((system, f"{name}, largest cell, %"), words, share, holds=share == 0.0)
        share = float(s.of(system, "P2").max())
        yield stated((system, "P2, largest cell, %"), "above 0", share, holds=share > 0.0, why=LOSSES)
        share = float(s.of(system, "P4").max())
        words = "0" if system == "S2" else "above P3"
        holds = share == 0.0 if system == "S2" else share > s.of(system, "P3").max()
        yield stated((system, "P4, largest cell, %"), words, share, holds=holds, why="no output leaves its bounds")


def _signed_sum(s: Surfaces) -> Iterator[Row]:
    """What (43), (44) do as they are printed."""
    for system in s.systems():
        yield ours((system, "outputs outside with the signed sum of (43), (44), %"), s.over_cells((system, "", SIGNED)))


def _nesting(s: Surfaces) -> Iterator[Row]:
    for system, words in (("S1", "slightly above 0"), ("S2", "slightly above 0"), ("S3", "below 0")):
        difference = Spread.of(s.of(system, "P7") - s.of(system, "P8"))
        holds = difference.mean < 0 if system == "S3" else difference.mean >= 0
        means = f"P7 is {s.of(system, 'P7').mean():.3g} %, P8 {s.of(system, 'P8').mean():.3g} % on average"
        yield stated((system, "P7 − P8, % points"), words, difference, holds=holds, why=means)
    for system in ("S1", "S2", "S3"):
        for part, nested in (("P9", "P7"), ("P10", "P8")):
            difference = Spread.of(s.of(system, part) - s.of(system, nested))
            yield stated(
                (system, f"{part} − {nested}, % points"), "well above 0", difference, holds=difference.mean > 5.0,
                why=f"almost all are nested already: {nested} is {s.of(system, nested).mean():.4g} % on average",
            )  # fmt: skip
