"""The demo: the paper's campaign simulated, every run estimated, scored, drawn, and put on one page."""

from __future__ import annotations

import json
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from terragrip import __version__
from terragrip.files import made_folder
from terragrip.ground.result import write as write_ground
from terragrip.report import (
    advice_sections,
    ground_sections,
    path,
    residuals,
    sections,
    soil_sections,
    summary,
    trust_sections,
    wheels,
    work_sections,
)
from terragrip.report.campaign import BENCHMARKS, EstimatedCampaign, Progress, estimate_campaign
from terragrip.report.campaign_soils import fits_of_truth, soils_of_scenario
from terragrip.report.intervals import pooled
from terragrip.report.page import (
    Headline,
    Page,
    number,
    percent,
    require_drawing,
    write_page,
    write_whole,
)
from terragrip.report.pdf import pdf_possible, write_pdf
from terragrip.report.runs import Run
from terragrip.report.scores import (
    PAPER_NRMSE,
    PAPER_R2_WHOLE,
    PAPER_R2_WITHOUT_STUCK,
    SENSOR_RATIO,
    TRUTH,
    Comparison,
    find,
)

SEED = 0
"""The campaign's seed, as `simulate_campaign` has it: with it the demo's numbers can be repeated."""


@dataclass(frozen=True)
class DemoResult:
    """Where the demo's files lie, what it scored, and how long it took [s]. `pdf` is None where nothing can print it."""

    page: Path
    pdf: Path | None
    soils: Path
    scores: Path
    estimates: tuple[Path, ...]
    comparisons: tuple[Comparison, ...]
    seconds: float


def run_demo(
    output: Path,
    seed: int = SEED,
    workers: int = 2,
    progress: Progress | None = None,
    runs: Sequence[str] | None = None,
) -> DemoResult:
    """Simulate the campaign, calibrate its machine, estimate every run, score, draw; everything under `output`.

    Parameters
    ----------
    output: folder, made if it is not there. It gets index.html, report.pdf (where typst is installed),
        figures/*.svg, scores.json, soils.json, ground.json, vehicle.yaml (calibrated), estimates/<run>.parquet and, of the benchmarks,
        recordings/<run>.parquet; a file is written whole or not at all.
    seed: of the whole campaign. workers: processes.
    progress: called after each run with steps done, steps in all, and what was just done.
    runs: names of the campaign's runs to take; all by default. The benchmarks multi1 and multi2 are always
        among them.

    Raises InputError when the folder cannot be written or matplotlib or Jinja2 is missing.
    KeyboardInterrupt passes through once the workers have stopped.
    """
    begin = time.monotonic()
    require_drawing()
    folder = made_folder(output / "estimates")
    campaign = estimate_campaign(folder, seed, workers, progress, runs)
    campaign.vehicle.save(output / "vehicle.yaml")
    seconds = time.monotonic() - begin
    scores = output / "scores.json"
    write_whole(scores, json.dumps(_scores(campaign, seed), indent=2) + "\n")
    soils = output / "soils.json"
    campaign.soils.library({"simulated": True, "seed": seed}).write(soils)
    write_ground(campaign.grounds, output / "ground.json", {"simulated": True})
    page = _page(campaign, seed, seconds)
    written = write_page(page, output)
    printed = write_pdf(page, output / "report.pdf") if pdf_possible() else None
    paths = tuple(item.path for item in campaign.runs)
    return DemoResult(
        written, printed, soils, scores, paths, tuple(campaign.comparisons), time.monotonic() - begin
    )


def _page(campaign: EstimatedCampaign, seed: int, seconds: float) -> Page:
    """The demo's page."""
    from terragrip.estimation import DEFAULT

    runs, main = campaign.runs, campaign.benchmarks[-1]
    minutes = sum(item.duration for item in runs) / 60
    true_pairs = [part for run in runs for part in run.true_pairs]
    truth = soils_of_scenario(main.name, true_pairs)
    curves = soil_sections.curves_of_all(
        campaign.soils,
        truth=truth,
        true_pairs=fits_of_truth(campaign.soils, true_pairs),
        true_by_slip=fits_of_truth(campaign.soils, true_pairs, by_slip=True),
    )
    tire = campaign.vehicle.tire_rolling_resistance
    scales = {name: soil.parameters["a"] for name, soil in truth.items()}
    return Page(
        "The field campaign, simulated and estimated",
        f"{len(runs)} simulated runs of the robot of Kobelski, Osinenko and Streif (2021), {minutes:.0f} minutes "
        "on five soils. Every number and figure here comes from simulation, save those marked as the paper's, "
        f"which come from its field. The method is {DEFAULT} where none is named.",
        (
            summary.section(
                [summary.Driven(run.name, run.duration, run.distance) for run in runs],
                [run.blocks for run in runs],
                curves,
                tire,
                _warnings(campaign),
                simulated=True,
            ),
            path.section(campaign.benchmarks),
            sections.tracking(main, _sensor_prose(main)),
            sections.slip_and_resistance(main),
            *(one for run in campaign.benchmarks if (one := wheels.section(run)) is not None),
            sections.online_curve(main, scales, "that the soils were made with"),
            soil_sections.both_maxima(curves, tire, campaign.soils.not_fitted),
            soil_sections.fits(curves, campaign.soils.not_fitted),
            trust_sections.trust(curves, campaign.soils.not_fitted),
            trust_sections.what_is_missing(curves, campaign.soils.not_fitted),
            sections.soils(main, campaign.benchmarks),
            campaign.advice,
            advice_sections.control(),
            work_sections.bands([run.blocks for run in runs]),
            ground_sections.recognised(campaign.grounds, simulated=True),
            ground_sections.section_points(campaign.grounds, simulated=True),
            ground_sections.events(campaign.grounds),
            residuals.section(main),
            sections.methods(campaign.comparisons, campaign.truth_scores, DEFAULT, _METHOD_PROSE),
            sections.honesty(main, campaign.coverage),
            sections.calibrated(campaign.calibration),
        ),
        _headlines(campaign, DEFAULT),
        simulated=True,
        facts=(
            ("Made by", f"Terragrip {__version__}, terragrip demo"),
            ("Seed", str(seed)),
            ("Runs", f"{len(runs)}, {sum(item.rows for item in runs)} rows"),
            ("Simulated and estimated in", f"{seconds:.0f} s"),
        ),
    )


def _warnings(campaign: EstimatedCampaign) -> dict[str, int]:
    """Events that a driver acts on, by kind, of all runs."""
    kinds = [kind for run in campaign.runs for kind in run.warnings]
    return {kind: kinds.count(kind) for kind in dict.fromkeys(kinds)}


def _headlines(campaign: EstimatedCampaign, default: str) -> tuple[Headline, ...]:
    """R² and NRMSE of multi2 in the paper's manner, R² against the truth, coverage."""
    main = BENCHMARKS[-1]
    sensor = find(campaign.comparisons, run=main, method=default, quantity=SENSOR_RATIO, against="sensor")
    itself = find(campaign.comparisons, run=main, method=TRUTH, quantity=SENSOR_RATIO, against="sensor")
    truth = find(campaign.comparisons, run=main, method=default, quantity="adhesion", against="truth")
    result = []
    if sensor and sensor.whole and sensor.without_flagged and itself and itself.without_flagged:
        whole, unflagged = sensor.whole, sensor.without_flagged
        result += [
            Headline(
                number(whole.r2),
                f"R² in {main} against the simulated force sensor, all samples",
                f"paper {PAPER_R2_WHOLE}",
            ),
            Headline(
                number(unflagged.r2),
                "the same without the rows that the estimates' own events flag, no window cut by hand",
                f"paper {PAPER_R2_WITHOUT_STUCK}, cut by hand; the truth itself {number(itself.without_flagged.r2)}",
            ),
            Headline(number(unflagged.nrmse), "NRMSE, same rows", f"paper {PAPER_NRMSE}"),
        ]
    if truth and truth.without_outlier:
        value = number(truth.without_outlier.r2)
        result.append(
            Headline(value, f"R² of µ in {main} against the simulated truth", "without the stuck spell")
        )
    mu = next((item for item in pooled(campaign.coverage) if item.quantity == "adhesion µ"), None)
    if mu:
        label = "of rows have the true µ inside the 95 % interval"
        result.append(Headline(percent(mu.share()), label, f"all {len(campaign.runs)} runs"))
    return tuple(result)


def _sensor_prose(run: Run) -> tuple[str, ...]:
    """What the reference sensor reads, and what happens while stuck."""
    notes = [
        "The force sensor sits on the axle of the rear right wheel. It reads the force that reaches the chassis, "
        "from which soil resistance is already taken, over a load that lacks the wheel's own weight. So it "
        "follows κ = µ − ρs and is drawn with it. The paper compares its sensor with µ; the tables below hold "
        "both comparisons."
    ]
    if run.stuck.any():
        notes.append(
            "While the vehicle is stuck its tool slides up and pushes: the force on the axle falls or turns "
            "negative, the torque and with it µ stay high. The paper cuts the longest such spell out by hand; here the "
            "estimates' own events flag all of them, and R² is given with and without the flagged rows."
        )
    return tuple(notes)


_METHOD_PROSE = (
    "The model is affine in its state, so ekf, ukf and kalman are one filter computed in different ways and agree to "
    "rounding; aukf and aukf-fs adapt the process noise (aukf-fs is the paper's method); bank mixes four noise levels; "
    "algebraic solves the equations of motion on low-passed signals.",
    "µ differs from the sensor by ρs, whatever the method: a negative R² of µ against the sensor comes from the sensor's "
    "position, not from the estimate's error, which the table against the truth shows. \"The truth itself\" is the simulation's "
    "own κ or µ against its sensor: the best that the sensor's dynamics and noise allow any estimate. An estimate may be a "
    "little above: the sensor measures bumps under its one wheel, which the true κ counts as slope. NRMSE divides by "
    "the range of the reference, which a sensor's few highest spikes set: compare it between methods, not with the "
    "paper.",
)


def _scores(campaign: EstimatedCampaign, seed: int) -> dict[str, Any]:
    """Everything that was scored, as JSON."""
    return {
        "simulated": True,
        "version": __version__,
        "seed": seed,
        "paper": {
            "r2": PAPER_R2_WHOLE,
            "r2_without_outlier": PAPER_R2_WITHOUT_STUCK,
            "nrmse_without_outlier": PAPER_NRMSE,
        },
        "comparisons": [item.to_dict() for item in campaign.comparisons],
        "truth": [score.to_dict() for score in campaign.truth_scores],
        "coverage_95": {item.quantity: item.share() for item in pooled(campaign.coverage)},
    }
