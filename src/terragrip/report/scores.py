"""Scores of estimates against a reference force sensor and, in simulation, against the truth."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from terragrip.arrays import Floats
from terragrip.errors import InputError
from terragrip.estimation.consistency import Agreement, agreement, coverage, mean_absolute_error
from terragrip.report.page import Table, number, percent
from terragrip.report.runs import AFTER_STUCK, BEFORE_STUCK, FLAGGED, Run

PAPER_R2_WHOLE, PAPER_R2_WITHOUT_STUCK, PAPER_NRMSE = 0.445, 0.848, 0.09
"""The paper's figures for its field run `multi2`: R² whole, R² and NRMSE without 245-255 s."""


QUANTITIES = ("net_traction", "adhesion")
SENSOR_RATIO = "sensor_ratio"
"""What the sensor reads if estimate or truth is right (physics.md 2): kappa over the load without the wheel, less its inertia."""
TRUTH = "the truth itself"
"""Takes the place of a method's name where the simulated truth is compared with the sensor."""
PARTS = ("whole", "without_outlier", "without_stuck", "without_flagged")
"""Which rows of a run are compared."""


@dataclass(frozen=True)
class Comparison:
    """One estimated quantity of one run against one reference.

    `quantity` is ``adhesion`` (mu, as the paper compares), ``net_traction`` (kappa) or ``sensor_ratio``; `against` is
    ``sensor`` or ``truth``. `whole` holds every row; `without_outlier` leaves out the longest stuck spell,
    as the paper does; `without_stuck` leaves out all of them; `without_flagged` what :attr:`Run.flagged` flags, no window
    chosen by hand. None where it cannot be scored.
    """

    run: str
    method: str
    quantity: str
    against: str
    whole: Agreement | None
    without_outlier: Agreement | None
    without_stuck: Agreement | None
    without_flagged: Agreement | None

    def to_dict(self) -> dict[str, Any]:
        """Plain values, ready for JSON."""
        return {
            "run": self.run,
            "method": self.method,
            "quantity": self.quantity,
            "against": self.against,
            **{part: result.to_dict() if (result := getattr(self, part)) else None for part in PARTS},
        }


@dataclass(frozen=True)
class TruthScore:
    """Errors and 95 % coverage against the truth where :attr:`Run.judged`. mu, slip: the shown wheel."""

    run: str
    method: str
    mu_r2: float
    mu_mae: float
    slip_mae: float
    rho_s_mae: float
    mu_coverage: float
    slip_coverage: float
    rho_s_coverage: float

    def to_dict(self) -> dict[str, Any]:
        """Plain values, ready for JSON."""
        return dict(vars(self))


def compare(run: Run) -> list[Comparison]:
    """Every comparison that `run` allows: mu and kappa of the sensor's wheel, against sensor and truth, and SENSOR_RATIO."""
    wheel, sensor = run.shown_wheel, run.measured_ratio()
    result = []
    expected = run.sensor_ratio()
    if sensor is not None and expected is not None:
        parts = _parts(run, sensor, expected)
        result.append(Comparison(run.name, run.method, SENSOR_RATIO, "sensor", *parts))
    for quantity in QUANTITIES:
        name = f"{quantity}_{wheel}"
        for against, reference in (("sensor", sensor), ("truth", run.true(name))):
            if reference is not None:
                parts = _parts(run, reference, run.estimated(name))
                result.append(Comparison(run.name, run.method, quantity, against, *parts))
    return result


def compare_truth(run: Run) -> list[Comparison]:
    """The truth itself against the sensor: what no estimate can be expected to exceed by much. Empty without both."""
    sensor, result = run.measured_ratio(), []
    for quantity in (SENSOR_RATIO, *QUANTITIES):
        whole = quantity == SENSOR_RATIO
        truth = run.true_sensor_ratio() if whole else run.true(f"{quantity}_{run.shown_wheel}")
        if sensor is not None and truth is not None:
            parts = _parts(run, sensor, truth)
            result.append(Comparison(run.name, TRUTH, quantity, "sensor", *parts))
    return result


def truth_score(run: Run) -> TruthScore | None:
    """Errors and coverage of `run` against its truth, None without one."""
    if run.truth is None:
        return None
    wheel, rows = run.shown_wheel, run.judged
    columns = (f"adhesion_{wheel}", f"slip_{wheel}", "soil_resistance")
    errors, covered = [], []
    for name in columns:
        truth, estimate, std = run.true(name), run.estimated(name), run.estimated(f"{name}_std")
        if truth is None:
            return None
        errors.append(mean_absolute_error(truth, estimate, rows))
        covered.append(coverage(truth, estimate, std, mask=rows))
    mu = agreement(_present(run.true(columns[0])), run.estimated(columns[0]), rows)
    return TruthScore(run.name, run.method, mu.r2, *errors, *covered)


def sensor_table(run: Run) -> Table | None:
    """R² against the reference sensor with all samples and with the flagged ones left out, beside the paper's two figures and,
    in simulation, the truth's own. None without a sensor."""
    estimated = {c.quantity: c for c in compare(run) if c.against == "sensor"}
    true = {c.quantity: c for c in compare_truth(run)}
    named = {
        SENSOR_RATIO: "what the sensor should read, from κ",
        "net_traction": "κ as it is",
        "adhesion": "µ, as the paper compares",
    }
    rows = [
        (what, *_two_r2(estimated[quantity]), *(_two_r2(true.get(quantity)) if true else ()))
        for quantity, what in named.items()
        if quantity in estimated
    ]
    if not rows:
        return None
    own = ("the truth's own, all", "the truth's own, flagged left out") if true else ()
    paper = (number(PAPER_R2_WHOLE), f"{number(PAPER_R2_WITHOUT_STUCK)} (cut by hand)")
    rows.append(("the paper's µ in its field", *paper, *("–" for _ in own)))
    return Table(
        f"R² of {run.name}, {run.method}, against the force sensor of wheel {run.sensor_wheel}. Left out is what the estimates' own "
        f"events flag, no window cut by hand: {percent(float(run.flagged.mean()))} of the rows ({', '.join(FLAGGED)}, and from "
        f"{BEFORE_STUCK:g} s before to {AFTER_STUCK:g} s after each stuck or push). The load that the sensor carries lacks the "
        "wheel's weight" + (", which the first row allows for." if SENSOR_RATIO in estimated else "."),
        ("compared", "all samples", "flagged left out", *own),
        tuple(rows),
        frozenset({0}),
    )


def _two_r2(c: Comparison | None) -> tuple[str, str]:
    """R² with all samples and with the flagged ones left out."""
    whole, unflagged = (c.whole, c.without_flagged) if c else (None, None)
    return number(whole.r2 if whole else None), number(unflagged.r2 if unflagged else None)


def method_tables(comparisons: Sequence[Comparison], default: str) -> list[Table]:
    """Methods against the sensor and against the truth, a table each; the default method's rows set off."""
    titles = {"sensor": "the reference force sensor's F_x/F_z", "truth": "the simulated truth"}
    tables = []
    for against, what in titles.items():
        rows = [c for c in comparisons if c.against == against]
        if rows:
            tables.append(_table(rows, f"Estimated κ and µ against {what}", default))
    return tables


def truth_table(scores: Iterable[TruthScore], default: str) -> Table:
    """Mean absolute errors and 95 % coverage of every method and run."""
    listed = list(scores)
    return Table(
        "Errors against the simulated truth and share of rows whose 95 % interval covers it, while the "
        "vehicle moves by itself, neither stuck nor pushed.",
        ("run, method", "R² of µ", "MAE µ", "MAE slip", "MAE ρs", "95 % µ", "95 % slip", "95 % ρs"),
        tuple(
            (
                f"{s.run}, {s.method}",
                number(s.mu_r2),
                number(s.mu_mae, 4),
                number(s.slip_mae, 4),
                number(s.rho_s_mae, 4),
                percent(s.mu_coverage),
                percent(s.slip_coverage),
                percent(s.rho_s_coverage),
            )
            for s in listed
        ),
        frozenset(i for i, s in enumerate(listed) if s.method == default),
    )


def find(
    comparisons: Iterable[Comparison], *, run: str, method: str, quantity: str, against: str
) -> Comparison | None:
    """The one comparison with these four names, None where there is none."""
    wanted = (run, method, quantity, against)
    return next((c for c in comparisons if (c.run, c.method, c.quantity, c.against) == wanted), None)


def _table(rows: list[Comparison], caption: str, default: str) -> Table:
    """A row a run and method: kappa's four figures, then mu's."""
    pairs = list(dict.fromkeys((c.run, c.method) for c in rows))
    cells: list[tuple[str, ...]] = []
    for run, method in pairs:
        row = [f"{run}, {method}"]
        for quantity in QUANTITIES:
            c = find(rows, run=run, method=method, quantity=quantity, against=rows[0].against)
            row += _figures(c)
        cells.append(tuple(row))
    strong = {i for i, (_, method) in enumerate(pairs) if method == default}
    if rows[0].against == "sensor":
        paper = (number(PAPER_R2_WHOLE), number(PAPER_R2_WITHOUT_STUCK), number(PAPER_NRMSE), "–", "–")
        cells.append(("multi2, paper (field), aukf-fs", "–", "–", "–", "–", "–", *paper))
    columns = ("R² whole", "R² without spell", "NRMSE without spell", "R² never stuck", "R² unflagged")
    return Table(
        caption + ": over every row; without the longest stuck spell, as the paper does; without any row in "
        "which the vehicle is stuck; without the rows that the estimates' own events flag.",
        ("run, method", *(f"{symbol}: {column}" for symbol in ("κ", "µ") for column in columns)),
        tuple(cells),
        frozenset(strong),
    )


def _figures(c: Comparison | None) -> list[str]:
    if c is None:
        return ["–"] * 5
    whole, cut, free, unflagged = c.whole, c.without_outlier, c.without_stuck, c.without_flagged
    return [
        number(whole.r2 if whole else None),
        number(cut.r2 if cut else None),
        number(cut.nrmse if cut else None),
        number(free.r2 if free else None),
        number(unflagged.r2 if unflagged else None),
    ]


def _parts(run: Run, reference: Floats, estimate: Floats) -> list[Agreement | None]:
    """Agreement over the rows of each of PARTS."""
    every = np.ones(len(estimate), dtype=np.bool_)
    return [_agreement(reference, estimate, rows) for rows in (every, ~run.outlier, ~run.stuck, ~run.flagged)]


def _agreement(reference: Floats, estimate: Floats, rows: Any) -> Agreement | None:
    try:
        return agreement(reference, estimate, rows)
    except InputError:
        return None


def _present(values: Floats | None) -> Floats:
    assert values is not None
    return values
