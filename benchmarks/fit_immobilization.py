"""Fit the score of the warning of immobilization to simulated drives, and write it into the kernel.

    python benchmarks/fit_immobilization.py [--seeds 1000 1199 5000 5699] [--cache DIRECTORY] [--workers 2] [--write]

The signs (terragrip.estimation.reference.immobilization) of drives into soft spots and of rough healthy ones, for each seed
on both curves and at three rates without a drawbar cell; of every third seed also as a vehicle with one driven axle would
show them, without front and rear to compare. Told apart: looks within AHEAD seconds before a full stop in a spot, and looks
of healthy driving, or before the spot. The score is the log odds in drives so weighted, a sum of small trees (scikit-learn's
gradient boosting), monotone in slip, in the asymmetry of the axles and in grip. A cross-validation over seeds is printed first.
--write puts the table into kernel/src/digging_table.h. Needs scikit-learn (extra `ground`).
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sklearn.ensemble import HistGradientBoostingClassifier

from bench_immobilization import KINDS, LATER, Course, Tally, course_of, judge, simulated
from terragrip.estimation import estimate
from terragrip.estimation.engine import EVENTS, watch_limits
from terragrip.estimation.reference.immobilization import (
    HIGH_SLIP,
    LONGEST_STEP,
    NO_SCORE,
    SIGNS,
    SILENT,
    Row,
    Watch,
    rows_of,
)  # fmt: skip
from terragrip.simulation.soft_spots import CURVES

Array = NDArray[np.float64]

SENSORS: dict[str, dict[str, Any]] = {
    "100 Hz": {"drawbar": False},
    "10 Hz": {"rate": 10.0, "drawbar": False},
    "ground speed 2 Hz": {"rate": 50.0, "drawbar": False, "ground_rate": 2.0},
}
AHEAD = 3.0  # s
FOLDS = 2
PEAKING = 8.0
"""Weight of looks before a stop on the curve that peaks, where the time is short."""
THIN = 4
"""Of so many looks of healthy driving, one is learned from, and counts for all."""
RISING = dict.fromkeys(("slip", "slip_calm", "slip_rise", "slip_unusual"), 1)
FALLING = dict.fromkeys(("asymmetry_change", "asymmetry_level", "asymmetry_unusual", "grip_unusual"), -1)
LEAVES = 8  # a tree: as many as a byte has bits
MODEL = {
    "max_iter": 120,
    "max_leaf_nodes": LEAVES,
    "learning_rate": 0.2,
    "min_samples_leaf": 150,
    "l2_regularization": 5.0,
    "monotonic_cst": [(RISING | FALLING).get(name, 0) for name in SIGNS],
    "early_stopping": False,
}
Split = tuple[int, str, int, int]
"""Sign, threshold, tree, and bits of the leaves that stay where the sign is above."""
TABLE = Path(__file__).resolve().parents[1] / "kernel/src/digging_table.h"


@dataclass
class Drive:
    """The looks of one drive: time [s], signs, SD of slip, silence of the ground speed [s], whether it was stuck; looks
    where the motion began anew."""

    seed: int
    curve: str
    sensors: str
    kind: str
    course: Course
    time: Array
    signs: Array
    deviation: Array
    silence: Array
    stuck: NDArray[np.bool_]
    fresh: NDArray[np.bool_]

    def labels(self) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Looks that foretell a stop, and looks that may be learned from."""
        t, course, ahead = self.time, self.course, np.zeros(len(self.time), bool)
        use = ~self.stuck
        if self.kind == "healthy" or course.stop < course.begun:
            return ahead, use & ~(t >= course.stop - LATER)
        if np.isnan(course.stop):
            return ahead, use & (t <= course.begun)
        ahead = (t > course.stop - AHEAD) & (t < course.stop) & (t > course.begun)
        return ahead, use & (t < course.stop) & ((t < course.begun) | (t > course.stop - AHEAD))


def looks(rows: list[Row], stuck: NDArray[np.bool_]) -> dict[str, Array]:
    """What a watch sees, look by look."""
    watch = Watch(watch_limits() | {"stuck_duration": np.inf})
    found: list[list[float]] = []
    fresh, total, count, seen = True, 0.0, 0, -np.inf
    for row, held in zip(rows, stuck.tolist(), strict=True):
        watch.take(row)
        if np.isnan(row.slip):
            fresh, total, count, seen = True, 0.0, 0, -np.inf
            continue
        seen = row.time if row.measured else seen
        total, count = total + row.deviation, count + 1
        if watch.looked:
            signs = watch.signs.features()
            found.append([row.time, total / count, min(row.time - seen, 9.0), held, fresh, *signs])
            fresh, total, count = False, 0.0, 0
    table = np.array(found)
    names = ("time", "deviation", "silence", "stuck", "fresh")
    return {name: table[:, k] for k, name in enumerate(names)} | {"signs": table[:, len(names) :]}


def drive_of(job: tuple[int, str, str, str, str | None]) -> Drive:
    seed, curve, sensors, kind, cache = job
    kept = Path(cache or ".") / f"{sensors}_{curve}_{kind}_{seed}.npz".replace(" ", "-")
    if cache and kept.exists():
        with np.load(kept) as held:
            found: dict[str, Any] = {name: held[name][()] for name in held.files}
    else:
        result = simulated(kind, seed, curve, SENSORS[sensors])
        table = estimate(result.recording, result.vehicle)
        measured = np.isfinite(result.recording.channels["ground_speed"])
        seen = looks(rows_of(table, measured), table.event_codes == EVENTS.index("stuck"))
        flags = {name: seen.pop(name).astype(bool) for name in ("stuck", "fresh")}
        found = {**seen, **flags, **asdict(course_of(result.truth))}
        if cache:
            Path(cache).mkdir(parents=True, exist_ok=True)
            np.savez(kept, **found)
    course = Course(**{name: float(found.pop(name)) for name in ("stop", "begun", "end")})
    return Drive(seed, curve, sensors, kind, course, **found)


def one_axle(signs: Array) -> Array:
    """Signs as a vehicle with one driven axle has them: front and rear alike."""
    signs = signs.copy()
    signs[:, [k for k, name in enumerate(SIGNS) if name.startswith("asymmetry")]] = 0
    return signs


def fit(drives: list[Drive]) -> HistGradientBoostingClassifier:
    signs, ahead, weight = [], [], []
    for drive in drives:
        label, use = drive.labels()
        counts = np.where(label & (drive.curve == "peaking"), PEAKING, 1.0)
        if drive.kind == "healthy":
            use &= np.arange(len(use)) % THIN == drive.seed % THIN
            counts *= THIN
        seen = drive.signs[use]
        for shown in (seen, one_axle(seen)) if drive.seed % 3 == 0 else (seen,):
            signs.append(shown)
            ahead.append(label[use])
            weight.append(counts[use])
    model = HistGradientBoostingClassifier(**MODEL)
    return model.fit(np.concatenate(signs), np.concatenate(ahead), sample_weight=np.concatenate(weight))


def warnings_of(drive: Drive, scores: Array, limits: dict[str, float]) -> list[float]:
    """Starts of the warnings [s]: the kernel's rule, over the scores of the looks."""
    found, level, on, last = [], NO_SCORE, False, -np.inf
    slip = drive.signs[:, 0]
    high = np.maximum(slip - limits["confidence"] * drive.deviation - limits["high_slip"], 0)
    high = np.where(drive.silence < SILENT, HIGH_SLIP * high, 0)
    stands = slip > 1 - limits["stuck_travel"]  # as far as the looks tell
    step = np.where(drive.fresh, 0.0, np.diff(drive.time, prepend=drive.time[0])).clip(0, LONGEST_STEP)
    columns = (drive.time, np.clip(scores, NO_SCORE, -NO_SCORE), high, stands, step, drive.fresh, drive.stuck)
    for t, score, more, standing, dt, fresh, stuck in zip(*(x.tolist() for x in columns), strict=True):
        if fresh or stuck:
            level, on = NO_SCORE, False
            if stuck:
                continue
        level += dt / (limits["memory"] + dt) * (score - level)
        now = level + more
        begins = now > limits["warn"] and not standing
        was, on = on, begins or (on and now > limits["warn"] - limits["release"])
        if on and not was and t - last > 0.3:
            found.append(t)
        if on:
            last = t
    return found


def cross_validate(drives: list[Drive]) -> None:
    limits = watch_limits()
    vehicles: dict[str, Callable[[Array], Array]] = {
        "all axles driven": np.asarray,
        "one driven axle": one_axle,
    }
    tallies: dict[tuple[str, str, str], Tally] = {}
    for fold in range(FOLDS):
        model = fit([d for d in drives if d.seed % FOLDS != fold])
        left_out = [d for d in drives if d.seed % FOLDS == fold]
        ends = np.cumsum([len(d.time) for d in left_out])[:-1]
        signs = np.concatenate([d.signs for d in left_out])
        for vehicle, seen in vehicles.items():
            scores = np.split(model.decision_function(seen(signs)), ends)
            for drive, score in zip(left_out, scores, strict=True):
                tally = tallies.setdefault((vehicle, drive.sensors, drive.curve), Tally())
                tally.add(judge(drive.kind, drive.course, warnings_of(drive, score, limits)))
    print("Cross-validation over seeds:")
    for names, tally in sorted(tallies.items()):
        row = tally.row()
        print(
            f"  {' '.join(f'{name:18s}' for name in names)} stops {row[0]} missed {row[1]} lead {row[2]} (10 %: {row[3]}) s "
            f"false in 30 min {row[7]}"
        )


def table_of(model: HistGradientBoostingClassifier, drives: int) -> str:
    """The fitted trees as C."""
    splits: list[Split] = []
    leaves: list[str] = []

    def place(nodes: Any, k: int, tree: int) -> int:
        """Puts what lies below node k into the lists, leaves from left to right; returns their bits."""
        node = nodes[k]
        if node["is_leaf"]:
            leaves.append(f"{node['value']:.5g}")
            return 1 << (len(leaves) - 1 - LEAVES * tree)
        below = place(nodes, int(node["left"]), tree)
        splits.append((int(node["feature_idx"]), f"{node['num_threshold']:.6g}", tree, 255 ^ below))
        return below | place(nodes, int(node["right"]), tree)

    for tree, (predictor,) in enumerate(model._predictors):
        place(predictor.nodes, 0, tree)
        leaves += ["0"] * (LEAVES * (tree + 1) - len(leaves))
    return trees_as_c(f"{float(np.ravel(model._baseline_prediction)[0]):.6g}", splits, leaves, drives)


def trees_as_c(base: str, splits: list[Split], leaves: list[str], drives: int) -> str:
    """The header: splits sorted by sign and threshold, as `tg_digging_score` goes through them."""
    splits = sorted(splits, key=lambda split: (split[0], float(split[1])))
    first = [sum(sign < s for sign, *_ in splits) for s in range(len(SIGNS) + 1)]
    count = f"[{len(splits)}]"
    lines = [
        f"/* Made by benchmarks/fit_immobilization.py --write from {drives} simulated drives; not to be edited.",
        " *",
        " * Splits by sign (TG_SIGN_*) and rising threshold: a sign above `at` rules out those leaves of `tree` that `mask` lacks. */",
        "#ifndef TG_DIGGING_TABLE_H", "#define TG_DIGGING_TABLE_H", '#include "estimator.h"', "",
        "#define R(x) ((tg_real)(x))", f"#define TG_DIGGING_BASE ((tg_real)({base}))",
        f"#define TG_DIGGING_TREES {len(leaves) // LEAVES}", f"#define TG_DIGGING_LEAVES {LEAVES} /* a tree */", "",
        "static const int16_t digging_first[TG_SIGNS + 1] = {", *_wrapped([str(k) for k in first]), "};", "",
        f"static const tg_real digging_at{count} = {{", *_wrapped([f"R({at})" for _, at, _, _ in splits]), "};", "",
        f"static const uint8_t digging_tree{count} = {{", *_wrapped([str(tree) for _, _, tree, _ in splits]), "};", "",
        f"static const uint8_t digging_mask{count} = {{", *_wrapped([str(mask) for *_, mask in splits]), "};", "",
        "static const tg_real digging_leaf[TG_DIGGING_TREES * TG_DIGGING_LEAVES] = {",
        *_wrapped([f"R({leaf})" for leaf in leaves]), "};", "#undef R", "#endif", "",
    ]  # fmt: skip
    return "\n".join(lines)


def _wrapped(items: list[str]) -> list[str]:
    lines = [""]
    for item in items:
        if len(lines[-1]) + len(item) > 130:
            lines.append("")
        lines[-1] += f" {item}," if lines[-1] else f"    {item},"
    return lines


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument(
        "--seeds", type=int, nargs="+", default=(1000, 1199, 5000, 5699), metavar="FIRST LAST"
    )
    parser.add_argument("--cache", help="directory that keeps the looks of the drives")
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--write", action="store_true", help="put the table into the kernel")
    arguments = parser.parse_args()
    ends = arguments.seeds
    seeds = [
        seed for first, last in zip(ends[::2], ends[1::2], strict=True) for seed in range(first, last + 1)
    ]
    jobs = [
        (seed, curve, sensors, kind, arguments.cache)
        for sensors in SENSORS
        for curve in CURVES
        for seed in seeds
        for kind in KINDS
    ]
    with ProcessPoolExecutor(arguments.workers) as pool:
        drives = list(pool.map(drive_of, jobs, chunksize=8))
    cross_validate(drives)
    if arguments.write:
        TABLE.write_text(table_of(fit(drives), len(drives)), encoding="utf-8")


if __name__ == "__main__":
    main()
