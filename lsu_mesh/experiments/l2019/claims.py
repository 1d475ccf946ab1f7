"""What Lainová et al. 2019 say about their figures (section 4.5), beside what is so here."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from lsu_mesh.experiments.comparison import UNEXPLAINED, Row, ours, stated, trend_stated
from lsu_mesh.experiments.effect import Effect
from lsu_mesh.experiments.l2019.criteria import LAST_LENGTH, MEASURED, SETTLED, TRANSIENT, WITHOUT_INPUT
from lsu_mesh.experiments.l2019.overlap import SIGNED
from lsu_mesh.experiments.l2019.surfaces import Surfaces
from lsu_mesh.experiments.l2019.wrong_widening import Losses, over_cells
from lsu_mesh.experiments.outcome import Spread

GROWS = 1.05
"""Factor between the ends of the grid from which something grows."""


def claims(surfaces: Surfaces, wrong: Mapping[str, Sequence[Losses]]) -> list[Row]:
    """All statements, system by system; ``wrong``: what the wrong widening loses, by system over cells."""
    return [
        *_errors(surfaces),
        *_predictions(surfaces),
        *_sizes(surfaces),
        *_outside(surfaces, wrong),
        *_wrong_widening(wrong),
        *_signed_sum(surfaces),
        *_nesting(surfaces),
    ]


def _errors(s: Surfaces) -> Iterator[Row]:
    for system in ("S1", "S3"):
        effect = Effect.of(s.of(system, "T1"))
        grows = min(effect) > GROWS
        yield stated((system, "T1"), "grows with ρ and r", str(effect), holds=grows)
        yield stated((system, "T1"), "ρ matters more than r", str(effect), holds=effect.rho > effect.r)
    position = {name: s.mean["S2", name, MEASURED] for name in ("LSUO", "LSUP")}
    effect, measured = Effect.of(s.of("S2", "T1")), Effect.of(position["LSUO"])
    yield stated(
        ("S2", "T1"), "ρ has no influence, r only", str(effect), holds=effect.rho < GROWS < effect.r,
        why=f"of the measured position alone it is {measured}, see the next row",
    )  # fmt: skip
    yield stated(
        ("S2", "T1 of the measured position alone"), "ρ has no influence, r only", str(measured),
        holds=measured.rho < GROWS < measured.r,
    )  # fmt: skip
    cells, alone = s.of("S2", "T2") / s.of("S2", "T1"), position["LSUP"] / position["LSUO"]
    told = f"from {alone.min():.2f} to {alone.max():.2f} over the grid"
    yield stated(
        ("S2", "T2 ÷ T1"), "slightly below 1", Spread.of(cells), holds=0.5 <= cells.mean() < 1.0,
        why=f"of the measured position alone it is {told}, see the next row",
    )  # fmt: skip
    yield stated(
        ("S2", "T2 ÷ T1 of the measured position alone"), "slightly below 1", Spread.of(alone),
        holds=0.5 <= alone.mean() < 1.0, why=told,
    )  # fmt: skip
    ratio = Spread.of(s.of("S3", "T2") / s.of("S3", "T1"))
    yield stated(("S3", "T2 ÷ T1"), "above 1", ratio, holds=ratio.mean > 1.0)


def _predictions(s: Surfaces) -> Iterator[Row]:
    ratio = Spread.of(s.of("S3", "T3") / s.of("S3", "T4"))
    yield stated(("S3", "T3 ÷ T4"), "very near 1", ratio, holds=abs(ratio.mean - 1.0) < 0.2)
    effect = Effect.of(s.of("S3", "T4"))
    yield stated(("S3", "T4"), "grows with ρ and r", str(effect), holds=min(effect) > GROWS)
    ratio = Spread.of(s.of("S1", "T4") / s.of("S1", "T3"))
    yield stated(
        ("S1", "T4 ÷ T3"), "about 100", ratio, holds=50.0 <= ratio.mean <= 200.0,
        why="it is about 100 where LSUP's predictor leaves out B u, see the next row",
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
            why=f"unexplained; LSUPB has {_volume_of_bundle(s, system):.2g} × LSUO's volume",
        )  # fmt: skip
    for system in ("S1", "S2"):
        share = Spread.of(s.of(system, "P5"))
        yield stated((system, "P5, %"), "the vast majority", share, holds=share.mean > 80.0)
    lengths, last = s.of("S2", "L1") / s.of("S2", "L2"), s.mean["S2", "LSUO", LAST_LENGTH] / s.of("S2", "L2")
    yield trend_stated(
        ("S2", "L1 ÷ L2"), "about 100", Spread.of(lengths), holds=lengths.mean() > 10.0,
        why=f"LSUO's interval grows with the record: over its last tenth the ratio is {last.mean():.3g}",
    )  # fmt: skip
    share = Spread.of(s.of("S2", "P6"))
    yield stated(("S2", "P6, %"), "the absolute majority", share, holds=share.mean > 90.0)


def _volume_of_bundle(s: Surfaces, system: str) -> float:
    return float((s.mean[system, "LSUPB", "V"] / s.of(system, "V1")).mean())


def _outside(s: Surfaces, wrong: Mapping[str, Sequence[Losses]]) -> Iterator[Row]:
    for system in ("S1", "S2", "S3"):
        words = "0" if system == "S2" else "few"
        for name in ("P1", "P3"):
            share = float(s.of(system, name).max())
            yield stated((system, f"{name}, largest cell, %"), words, share, holds=share == 0.0)
        share = float(s.of(system, "P2").max())
        lost, missed = (over_cells(wrong[system], what).mean for what in ("states", "outputs"))
        told = f"{UNEXPLAINED}; the wrong widening would lose {lost:.3g} % of the states"
        told += f" and {missed:.3g} % of the outputs, of which the report loses none" if system == "S2" else ""
        yield stated((system, "P2, largest cell, %"), "above 0", share, holds=share > 0.0, why=told)
        share = float(s.of(system, "P4").max())
        words = "0" if system == "S2" else "above P3"
        holds = share == 0.0 if system == "S2" else share > s.of(system, "P3").max()
        told = f"{UNEXPLAINED}; the wrong widening would lose {missed:.3g} % of the outputs"
        yield stated((system, "P4, largest cell, %"), words, share, holds=holds, why=told)


def _wrong_widening(wrong: Mapping[str, Sequence[Losses]]) -> Iterator[Row]:
    """Whether an error that we suspected explains P2 and P4: LSUP widened by ρ where |M A⁻¹| ρ is meant."""
    for system, cells in wrong.items():
        for what, of in (("states", "P2"), ("outputs", "P4")):
            label = f"{of}, LSUP widened by ρ where abs(M A⁻¹) ρ is meant, %"
            yield ours((system, label), over_cells(cells, what))


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
