"""GroundClassifier on real runs (BorealTC: Husky, five grounds), by the published protocol and on whole runs left out.

Published protocol (LaRocque et al., IROS 2024): runs cut into 5 s partitions, stratified shuffled 5-fold over the
partitions, seed 21, windows of 1.7 s; each window is judged from its own 1.7 s only. Parts of one run stand on both sides,
so whole runs left out (grouped folds) stand beside it. The peer is scikit-learn's extremely randomised trees on plain
features of the same windows. Constants of the classifier were chosen on other splits (seed 7; grouped seeds 0 and 1).

    python benchmarks/bench_ground_classifier.py [--write]
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator
from itertools import islice, pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from sklearn.ensemble import ExtraTreesClassifier
from sklearn.metrics import balanced_accuracy_score, confusion_matrix, roc_auc_score
from sklearn.model_selection import StratifiedGroupKFold, StratifiedKFold

import borealtc
from marked import put
from terragrip import GroundClassifier

DOCUMENT = Path(__file__).resolve().parents[1] / "docs" / "ground-classifier.md"
BEGIN, END = "<!-- figures: begin -->", "<!-- figures: end -->"
WINDOW, STEP, SEED = 1.7, 0.425, 21
WHEELS, BODY = list(borealtc.WHEELS.values()), list(borealtc.BODY.values())
VIEWS = {"all sensors": [], "no current": WHEELS[2:], "wheels only": BODY, "body only": WHEELS}
SPANS = (0.0, 10.0, 60.0)  # s that the unknown is judged over
Split = tuple[np.ndarray, np.ndarray]


class Verdicts:
    """What was said of the held-out windows, fold after fold, from each view of the sensors."""

    def __init__(self) -> None:
        self.kept: dict[str, list[Any]] = {}
        self.classes: np.ndarray = np.empty(0)
        self.fit_seconds: list[float] = []
        self.window_seconds: list[float] = []
        self.peer_seconds: list[float] = []

    def add(self, name: str, *values: Any) -> None:
        self.kept.setdefault(name, []).append(values)

    def of(self, name: str) -> list[np.ndarray]:
        return [np.concatenate(column) for column in zip(*self.kept[name], strict=True)]


def tried(
    tables: list[pd.DataFrame], labels: np.ndarray, splits: Iterator[Split], views: dict[str, list[str]]
) -> Verdicts:
    """Train on each split's first part, judge the second from each view."""
    verdicts = Verdicts()
    for number, (train, test) in enumerate(splits):
        learnt = [tables[k] for k in train]
        begin = time.perf_counter()
        classifier = GroundClassifier(WINDOW, step=STEP).fit(learnt, labels[train])
        verdicts.fit_seconds.append(time.perf_counter() - begin)
        verdicts.classes = classifier.classes_
        shown = [tables[k] for k in test]
        of_window = classifier.windows(shown)["recording"].to_numpy()
        truth = labels[test][of_window]
        for view, without in views.items():
            seen = [t.drop(columns=[c for c in without if c in t]) for t in shown]
            begin = time.perf_counter()
            chances = classifier.predict_proba(seen)
            verdicts.window_seconds.append((time.perf_counter() - begin) / len(truth))
            novelty = np.full(len(truth), np.nan) if without else classifier.novelty(seen)
            forced = classifier.classes_[chances.argmax(axis=1)]
            verdicts.add(view, truth, forced, chances, novelty, test[of_window])
        if "all sensors" in views:
            longer = classifier.set_params(smooth=10.0).predict_proba(shown)
            verdicts.add("smoothed", truth, classifier.classes_[longer.argmax(axis=1)])
            begin = time.perf_counter()
            verdicts.add("peer", truth, peer(learnt, labels[train], shown, classifier))
            verdicts.peer_seconds.append(time.perf_counter() - begin)
        print(f"  fold {number + 1}: fit {verdicts.fit_seconds[-1]:.0f} s", flush=True)
    return verdicts


def peer(
    learnt: list[pd.DataFrame], labels: np.ndarray, shown: list[pd.DataFrame], like: GroundClassifier
) -> np.ndarray:
    """Extremely randomised trees on mean, SD, least, greatest and mean step of each channel."""

    def plain(tables: list[pd.DataFrame]) -> tuple[np.ndarray, np.ndarray]:
        windows = like.windows(tables)
        rows = []
        for table, of_table in zip(tables, (g for _, g in windows.groupby("recording")), strict=True):
            columns = []
            at = table["time"].to_numpy()
            for name in WHEELS + BODY:
                values = table[name].to_numpy() if name in table else np.full(len(at), np.nan)
                known = np.isfinite(values)
                t, v = at[known], values[known]
                a = np.searchsorted(t, of_table["start"].to_numpy() - 1e-6)
                b = np.searchsorted(t, of_table["end"].to_numpy() - 1e-6)
                cuts = [v[i:j] if j > i + 1 else np.full(2, np.nan) for i, j in zip(a, b, strict=True)]
                columns += [[f(c) for c in cuts] for f in (np.mean, np.std, np.min, np.max, step)]
            rows.append(np.array(columns).T)
        return np.concatenate(rows), windows["recording"].to_numpy()

    features, of_window = plain(learnt)
    trees = ExtraTreesClassifier(300, class_weight="balanced", min_samples_leaf=2, n_jobs=2, random_state=0)
    trees.fit(features, labels[of_window])
    return trees.predict(plain(shown)[0])


def step(values: np.ndarray) -> float:
    return float(np.abs(np.diff(values)).mean())


def partition_protocol(runs: list[borealtc.Run]) -> Verdicts:
    parts = [(p, r.ground) for r in runs if r.with_body for p in borealtc.partitions(r)]
    tables, labels = [p for p, _ in parts], np.array([g for _, g in parts])
    folds = StratifiedKFold(5, shuffle=True, random_state=np.random.RandomState(SEED))
    return tried(tables, labels, folds.split(labels, labels), VIEWS)


def whole_runs(runs: list[borealtc.Run]) -> Verdicts:
    """Five folds over all runs, alike in grounds and minutes (windows), seed 21."""
    labels = np.array([r.ground for r in runs])
    return tried([r.table for r in runs], labels, grouped(runs), VIEWS)


def grouped(runs: list[borealtc.Run]) -> Iterator[Split]:
    """Grouped folds, stratified by the minutes of each ground."""
    size = np.array([max(int(r.length / WINDOW), 1) for r in runs])
    group = np.repeat(np.arange(len(runs)), size)
    ground = np.repeat([r.ground for r in runs], size)
    folds = StratifiedGroupKFold(5, shuffle=True, random_state=SEED)
    for train, test in folds.split(group, ground, group):
        yield np.unique(group[train]), np.unique(group[test])


def unknown_ground(runs: list[borealtc.Run]) -> pd.DataFrame:
    """Each ground left out of training in turn, beside held-out runs of the others; means over three folds."""
    rows = []
    for left_out in sorted({r.ground for r in runs}):
        result = [novelties(runs, left_out, *fold) for fold in islice(grouped(runs), 3)]
        for smooth in SPANS:
            seen = [of_fold[smooth] for of_fold in result]
            area = [roc_auc_score(np.r_[a * 0, b * 0 + 1], -np.r_[a, b]) for a, b in seen]
            row = {"left out": left_out, "judged over s": f"{smooth or WINDOW:g}", "AUROC": np.mean(area)}
            for rate in (0.02, 0.05, 0.2):
                row[f"known called unknown at {rate:g}"] = np.mean([(a < rate).mean() for a, _ in seen])
                row[f"unknown called unknown at {rate:g}"] = np.mean([(b < rate).mean() for _, b in seen])
            rows.append(row)
            print(f"  {left_out}, {smooth:g} s: {row['AUROC']:.3f}", flush=True)
    return pd.DataFrame(rows)


def novelties(
    runs: list[borealtc.Run], left_out: str, train: np.ndarray, test: np.ndarray
) -> dict[float, tuple[np.ndarray, np.ndarray]]:
    """Novelty of windows of held-out known runs and of the ground left out, by the time that they are judged over."""
    learnt = [runs[k] for k in train if runs[k].ground != left_out]
    known = [runs[k].table for k in test if runs[k].ground != left_out]
    strange = [r.table for r in runs if r.ground == left_out]
    classifier = GroundClassifier(WINDOW, max_windows=400).fit(
        [r.table for r in learnt], [r.ground for r in learnt]
    )
    return {s: (classifier.set_params(smooth=s).novelty(known), classifier.novelty(strange)) for s in SPANS}


def accuracy_table(named: dict[str, Verdicts], complete: np.ndarray) -> str:
    """Balanced accuracy and accuracy by protocol and view, without saying unknown."""
    head = [
        "| protocol | sensors | windows | balanced accuracy | accuracy | peer (extra trees) |",
        "|---|---|---|---|---|---|",
    ]
    partition, run = named.values()
    lines = [score_line("5 s partitions", view, *partition.of(view)[:2], partition) for view in VIEWS]
    of_run = run.of("all sensors")[4]
    for view in (*VIEWS, "smoothed"):
        truth, predicted = run.of(view)[:2]
        if view != "wheels only":
            seen = complete[of_run]
            truth, predicted = truth[seen], predicted[seen]
            peer = [column[seen] for column in run.of("peer")]
        else:
            peer = run.of("peer")
        group = "whole runs left out, " + (
            "71 runs" if view == "wheels only" else "68 runs with the body sensor"
        )
        lines.append(score_line(group, view, truth, predicted, run, peer))
    lines.append(
        score_line("whole runs left out, 71 runs", "all sensors there are", *run.of("all sensors")[:2], run)
    )
    lines.append(score_line("whole runs left out, 71 runs", "smoothed", *run.of("smoothed")[:2], run))
    return "\n".join(head + lines)


def score_line(
    protocol: str,
    view: str,
    truth: np.ndarray,
    predicted: np.ndarray,
    verdicts: Verdicts,
    peer: list[np.ndarray] | None = None,
) -> str:
    other = ""
    if view.startswith("all sensors"):
        other = f"{balanced_accuracy_score(*(peer or verdicts.of('peer'))):.3f}"
    name = "all sensors, with 10 s of neighbours (`smooth=10`)" if view == "smoothed" else view
    balanced = balanced_accuracy_score(truth, predicted)
    return f"| {protocol} | {name} | {len(truth)} | **{balanced:.3f}** | {(truth == predicted).mean():.3f} | {other} |"


def confusion_text(verdicts: Verdicts) -> str:
    truth, predicted = verdicts.of("all sensors")[:2]
    share = confusion_matrix(truth, predicted, labels=verdicts.classes, normalize="true")
    head = "| driven \\ said | " + " | ".join(verdicts.classes) + " |\n|" + "---|" * (len(share) + 1)
    rows = [
        f"| {c} | " + " | ".join(f"{x:.3f}" for x in row) + " |"
        for c, row in zip(verdicts.classes, share, strict=True)
    ]
    return "\n".join([head, *rows])


def calibration_text(named: dict[str, Verdicts]) -> str:
    """What was said with which probability, against how often it was right; every ground weighs the same."""
    edges = np.array([0.2, 0.4, 0.6, 0.8, 0.9, 0.97, 1.0001])
    lines = [
        "| probability said | " + " | ".join(f"{n}: mean said | right" for n in named) + " |",
        "|---|" + "---|---|" * len(named),
    ]
    for low, high in pairwise(edges):
        cells = []
        for verdicts in named.values():
            truth, predicted, chances = verdicts.of("all sensors")[:3]
            weight = 1 / pd.Series(truth).map(pd.Series(truth).value_counts()).to_numpy()
            top = chances.max(axis=1)
            inside = (top >= low) & (top < high)
            if not inside.any():
                cells += ["", ""]
                continue
            w = weight[inside]
            cells += [
                f"{np.average(top[inside], weights=w):.3f}",
                f"{np.average((truth == predicted)[inside], weights=w):.3f}",
            ]
        lines.append(f"| {low:.2f} to {min(high, 1):.2f} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def rejection_text(named: dict[str, Verdicts]) -> str:
    lines = [
        "| protocol | asked for (`rejection`) | called unknown | of them wrong otherwise | balanced accuracy of the rest |",
        "|---|---|---|---|---|",
    ]
    for protocol, verdicts in named.items():
        truth, predicted, _, novelty, _ = verdicts.of("all sensors")
        weight = 1 / pd.Series(truth).map(pd.Series(truth).value_counts()).to_numpy()
        for rate in (0.01, 0.02, 0.05, 0.1):
            out = novelty < rate
            wrong = (truth != predicted)[out].mean() if out.any() else np.nan
            rest = balanced_accuracy_score(truth[~out], predicted[~out])
            share = np.average(out, weights=weight)
            lines.append(f"| {protocol} | {rate:.2f} | {share:.3f} | {wrong:.2f} | {rest:.3f} |")
    return "\n".join(lines)


def unknown_text(table: pd.DataFrame) -> str:
    head = "| " + " | ".join(table.columns) + " |\n|" + "---|" * len(table.columns)
    rows = [
        "| " + " | ".join(x if isinstance(x, str) else f"{x:.2f}" for x in row) + " |"
        for row in table.to_numpy()
    ]
    return "\n".join([head, *rows])


def main() -> None:
    """Print the tables; with --write put them into docs/ground-classifier.md."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--write", action="store_true", help="put the tables into docs/ground-classifier.md")
    arguments = parser.parse_args()
    begin = time.perf_counter()
    runs = borealtc.runs()
    if not runs:
        raise SystemExit(f"no runs in {borealtc.FOLDER}")
    complete = [r for r in runs if r.with_body]
    named: dict[str, Verdicts] = {}
    print("5 s partitions")
    named["5 s partitions (published protocol)"] = partition_protocol(runs)
    print("whole runs left out")
    named["whole runs left out"] = whole_runs(runs)
    accuracy = accuracy_table(named, np.array([r.with_body for r in runs]))
    print("a ground left out")
    unknown = unknown_ground(complete)
    partition, run = named.values()
    pair = {"partitions": partition, "runs": run}
    cost = np.median(np.array(run.fit_seconds) / np.array(run.peer_seconds))
    text = "\n\n".join(
        [
            accuracy,
            "Confusion, published protocol (rows sum to 1):",
            confusion_text(partition),
            "Confusion, whole runs left out, all 71 runs with the sensors there are:",
            confusion_text(run),
            "Probabilities against how often they were right (every ground weighs the same):",
            calibration_text(pair),
            "Calling unknown what is known (held-out windows of known grounds, every ground weighs the same):",
            rejection_text(pair),
            "A ground never trained on, beside held-out runs of the other four:",
            unknown_text(unknown),
            f"Training all experts takes {cost:.1f} times the peer's training and judging (median over folds, same run).",
        ]
    )
    print(text)
    print(
        f"fit {np.median(run.fit_seconds):.0f} s, a window {1e3 * np.median(run.window_seconds):.2f} ms, "
        f"all {time.perf_counter() - begin:.0f} s"
    )
    if arguments.write:
        put(DOCUMENT, BEGIN, text, END)


if __name__ == "__main__":
    main()
