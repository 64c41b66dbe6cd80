"""How well the ground is recognised: changes and soils on simulated drives that nothing was tuned on.

    python benchmarks/bench_ground.py [--seeds 3000 ...] [--write]

A machine a seed, calibrated from its own campaign as `make demo` does it. Three libraries: of *another* machine (the 66 single-soil runs
of seed 2000), of its *own* single-soil runs (other ground than the scored drives), and the other machine's without one soil at a time.
Scored: `multi1` and `multi2` (the campaign's routes over several soils), `accuracy-clean` and `accuracy-faults` (another route, other
sensors, faults), and the single-soil runs of the first two seeds, where every change reported is a false alarm.

A border counts where two soils that differ meet (fine and wet are one); it is found by a change within its transition (some part of
vehicle or tool on a border, or on another soil than the rest) +- 2 s, one change a border. A second change in one transition, or one
anywhere else, is false. Delay: from the soil under the centre of gravity changing to the change being reported. Soils count by rows, all of
them: standstill, transitions and stuck spells too. --write puts the tables and the reliability diagram into docs.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np

from ground_drives import LIBRARY_SEED, ONE, Drive, Matches, score_seed
from ground_scores import ReliabilityBin, calibration_error, confusion, merged, reliability
from marked import put
from terragrip.ground.result import Timeline

SEEDS = tuple(range(3000, 3008))
WAYS = ("offline", "online", "adwin")
ALONE = 2
"""How many seeds also drive the single-soil runs."""
DRAWN = 50
DOCUMENT = Path(__file__).resolve().parents[1] / "docs/ground.md"
PICTURE = DOCUMENT.parent / "images/ground-reliability.svg"
BEGIN = "<!-- made by benchmarks/bench_ground.py --write -->"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--seeds", type=int, nargs="+", default=list(SEEDS))
    parser.add_argument("--write", action="store_true", help="put the tables into docs/ground.md")
    parser.add_argument("--workers", type=int, default=2)
    arguments = parser.parse_args()
    if LIBRARY_SEED in arguments.seeds:
        parser.error(f"the library is of seed {LIBRARY_SEED}: it cannot be scored")
    drives: list[Drive] = []
    jobs = [(seed, k < ALONE) for k, seed in enumerate(arguments.seeds)]
    with ProcessPoolExecutor(arguments.workers) as pool:
        for (seed, _), result in zip(jobs, pool.map(score_seed, jobs), strict=True):
            drives += result
            right = [d.right["another, offline"] for d in result if d.right]
            print(f"seed {seed}: soil right in {100 * np.mean(right):.1f} % of rows", flush=True)
    text = tables(drives, arguments.seeds)
    print("\n" + text)
    if arguments.write:
        put(DOCUMENT, BEGIN, text)
        draw(drives)
        print(f"written to {DOCUMENT} and {PICTURE}")


def tables(drives: Sequence[Drive], seeds: Sequence[int]) -> str:
    """Markdown: changes, soils, unknown, confusion, reliability, targets."""
    parts = [f"Seeds {seeds[0]} to {seeds[-1]}; the other machine's library is of seed {LIBRARY_SEED}.\n"]
    parts += [
        "### Changes\n",
        _changes_table(drives),
        _honesty_table(drives),
        "### Soils\n",
        _soils_table(drives),
    ]
    parts += ["### A soil that the library does not hold\n", _unknown_table(drives)]
    parts += [
        "### Which for which\n",
        _confusion_table(drives),
        "### Probabilities\n",
        _reliability_table(drives),
    ]
    return "\n".join([*parts, "### Targets\n", _targets(drives)])


def _groups(drives: Iterable[Drive]) -> dict[str, list[Drive]]:
    out: dict[str, list[Drive]] = {}
    for drive in drives:
        out.setdefault(drive.group, []).append(drive)
    return out


def _pooled(drives: Iterable[Drive], way: str) -> Matches:
    out = Matches()
    for drive in drives:
        out.add(drive.changes[way])
    return out


def _changes_table(drives: Sequence[Drive]) -> str:
    lines = [
        "| drives | way | borders | recall | precision | false an hour | delay, median s | 90 % s |",
        "|---|---|---:|---:|---:|---:|---:|---:|",
    ]
    for group, some in _groups(drives).items():
        for way in WAYS:
            one = _pooled(some, way)
            scores = f"{one.recall:.3f} | {one.precision:.3f}" if one.borders else " | "
            delay = (
                "|"
                if not one.delays
                else f"{np.median(one.delays):.1f} | {np.percentile(one.delays, 90):.1f}"
            )
            lines.append(
                f"| {group} ({one.hours:.2f} h) | {way} | {one.borders or ''} | {scores} | {one.false_an_hour:.1f} | {delay} |"
            )
    return "\n".join(lines) + "\n"


def _honesty_table(drives: Sequence[Drive]) -> str:
    lines = [
        "| way | stated probability, mean | share right | stated SD, rms s | error in time, SD s | its mean s |",
        "|---|---:|---:|---:|---:|---:|",
    ]
    for way in ("offline", "online"):
        one = _pooled(drives, way)
        error, sd = np.array(one.errors).T
        shares = f"{np.mean(one.stated):.3f} | {np.mean(one.right):.3f}"
        lines.append(
            f"| {way} | {shares} | {np.sqrt(np.mean(sd**2)):.2f} | {error.std():.2f} | {error.mean():+.2f} |"
        )
    return (
        "All drives; errors in time against the soil under the centre of gravity.\n\n"
        + "\n".join(lines)
        + "\n"
    )


def _soils_table(drives: Sequence[Drive]) -> str:
    lines = [
        "| drives | library, way | right, all rows % | right, settled % | named after, median s |",
        "|---|---|---:|---:|---:|",
    ]
    for group, some in _groups(drives).items():
        for key in dict.fromkeys(k for d in some for k in d.right):
            label, way = key.split(", ")
            waits = [w for d in some for w in d.naming.get(label, [])] if way == "online" else []
            after = f"{np.median(waits):.1f}" if waits else ""
            right = [100 * np.mean([getattr(d, n)[key] for d in some]) for n in ("right", "settled")]
            lines.append(f"| {group} | {key} | {right[0]:.1f} | {right[1]:.1f} | {after} |")
    return "Fine and wet taken as one.\n\n" + "\n".join(lines) + "\n"


def _unknown_table(drives: Sequence[Drive]) -> str:
    lines = ["| left out | of it unknown % | of the others unknown % |", "|---|---:|---:|"]
    some = [d for d in drives if d.unknown]
    for key in some[0].unknown:
        a, b, c, d = np.sum([x.unknown[key] for x in some], axis=0)
        lines.append(f"| {key} | {100 * b / max(a, 1):.1f} | {100 * d / max(c, 1):.1f} |")
    return "Settled blocks of all drives, offline, the other machine's library.\n\n" + "\n".join(lines) + "\n"


def _timelines(drives: Sequence[Drive], key: str) -> list[Timeline]:
    return [d.timelines[key] for d in drives if key in d.timelines]


def _confusion_table(drives: Sequence[Drive]) -> str:
    result = confusion(_timelines(drives, "another, offline"))
    lines = ["| label | " + " | ".join(result.soils) + " |", "|---|" + "---:|" * len(result.soils)]
    for name, row in zip(result.labels, result.counts, strict=True):
        lines.append(f"| {name} | " + " | ".join(f"{100 * x / row.sum():.1f}" for x in row) + " |")
    return (
        "Per cent of settled blocks of a label, offline, the other machine's library.\n\n"
        + "\n".join(lines)
        + "\n"
    )


def _bins(drives: Sequence[Drive], key: str, together: bool) -> tuple[ReliabilityBin, ...]:
    some = _timelines(drives, key)
    return reliability([merged(t, ONE) for t in some] if together else some)


KEYS = ("another, offline", "another, online", "own, offline", "own, online")


def _reliability_table(drives: Sequence[Drive]) -> str:
    lines = [
        "| library, way | soils | stated | right | blocks | calibration error |",
        "|---|---|---|---|---|---:|",
    ]
    for key in KEYS:
        for together in (False, True):
            bins = _bins(drives, key, together)
            stated, right = (", ".join(f"{getattr(b, n):.2f}" for b in bins) for n in ("stated", "right"))
            counts = ", ".join(str(b.count) for b in bins)
            soils = "fine and wet as one" if together else "all"
            lines.append(
                f"| {key} | {soils} | {stated} | {right} | {counts} | {calibration_error(bins):.3f} |"
            )
    return "\n".join(lines) + "\n"


def _targets(drives: Sequence[Drive]) -> str:
    several = [d for d in drives if d.group != "single"]
    offline, online = _pooled(several, "offline"), _pooled(several, "online")
    right = 100 * np.mean([d.right["another, offline"] for d in several])
    rows = [
        ("borders found, offline", offline.recall, 0.9, True),
        ("precision of changes, offline", offline.precision, 0.85, True),
        ("borders found, while driving", online.recall, 0.9, True),
        ("precision of changes, while driving", online.precision, 0.85, True),
        ("rows with the right soil, offline, another machine's library, %", right, 88.0, True),
        ("median delay of a change reported while driving, s", float(np.median(online.delays)), 3.0, False),
    ]
    lines = ["| figure, all drives over several soils | reached | target | |", "|---|---:|---:|---|"]
    for name, value, target, least in rows:
        met = value >= target if least else value <= target
        lines.append(
            f"| {name} | {value:.3g} | {'≥' if least else '≤'} {target:g} | {'reached' if met else 'missed'} |"
        )
    return "\n".join(lines) + "\n"


def draw(drives: Sequence[Drive]) -> None:
    """The reliability diagram; bins of fewer than `DRAWN` blocks are left out."""
    from terragrip.figures import BLUE, GREEN, ORANGE, PURPLE, new_figure, styled
    from terragrip.report.style import on_paper, to_svg

    def panel(axes: Any, together: bool) -> None:
        axes.plot([0.3, 1], [0.3, 1], "--", color="0.6", linewidth=1)
        for key, marker, color in zip(KEYS, "osD^", (BLUE, ORANGE, GREEN, PURPLE), strict=True):
            bins = [one for one in _bins(drives, key, together) if one.count >= DRAWN]
            axes.plot(
                [b.stated for b in bins],
                [b.right for b in bins],
                marker=marker,
                markersize=4,
                color=color,
                label=key,
            )
        axes.set(xlabel="stated probability of the soil [–]", xlim=(0.3, 1.03), ylim=(0, 1.02))
        axes.set_title("fine and wet taken as one" if together else "all soils")

    figure = new_figure(8.0, 3.6)
    with styled():
        axes = figure.subplots(1, 2, sharey=True)
        panel(axes[0], False)
        panel(axes[1], True)
        axes[0].set_ylabel("share that was right [–]")
        axes[0].legend(fontsize=8, loc="upper left")
    PICTURE.write_text(on_paper(to_svg(figure)), encoding="utf-8")


if __name__ == "__main__":
    main()
