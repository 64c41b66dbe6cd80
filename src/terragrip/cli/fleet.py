"""``terragrip fleet``: many logs, on many processors, into one data set."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from terragrip.cli.drives import logs_in
from terragrip.cli.log import LogForm, LogFormat, log_to_stderr
from terragrip.cli.options import DbcFiles, Method, ProfileFile, Quiet
from terragrip.cli.output import check_file
from terragrip.cli.progress import progress
from terragrip.errors import InputError
from terragrip.estimation.methods import DEFAULT

if TYPE_CHECKING:
    from collections.abc import Sequence

    from terragrip.fleet.run import FleetResult


def command(
    patterns: Annotated[
        list[str],
        typer.Argument(
            metavar="PATTERN", help="Logs, folders or patterns ('DIR/**/*.mcap'), also in a store (s3://...)."
        ),
    ],
    output: Annotated[
        str,
        typer.Option(
            "--output", "-o", metavar="OUT", help="Folder of the data set, also in a store (s3://...)."
        ),
    ],
    vehicle: Annotated[
        Path | None,
        typer.Option(
            "--vehicle", metavar="FILE", help="The vehicle file (YAML) of every log without one in --index."
        ),
    ] = None,
    profile: ProfileFile = None,
    index: Annotated[
        Path | None,
        typer.Option(
            "--index",
            metavar="TABLE",
            help="A CSV with the columns log, vehicle, profile, name and a row per log; all but log may be empty.",
        ),
    ] = None,
    dbc: DbcFiles = None,
    method: Method = DEFAULT,
    smooth: Annotated[bool, typer.Option("--smooth", help="Also smooth each log backwards.")] = False,
    scheduler: Annotated[
        str | None,
        typer.Option(
            metavar="ADDRESS", help="A Dask scheduler (tcp://host:8786) in place of workers on this machine."
        ),
    ] = None,
    workers: Annotated[
        int | None,
        typer.Option(metavar="COUNT", min=1, help="Workers on this machine; by default one per processor."),
    ] = None,
    memory: Annotated[
        str | None,
        typer.Option(
            metavar="AMOUNT",
            help="Memory limit of each worker on this machine, e.g. 2GB; by default an equal share.",
        ),
    ] = None,
    maps: Annotated[
        bool, typer.Option("--map", help="Also map each log that has positions: OUT/cells.")
    ] = False,
    ground: Annotated[
        bool,
        typer.Option(
            "--ground", help="Also find each log's sections of ground and its events, with reasons."
        ),
    ] = False,
    metrics: Annotated[
        Path | None,
        typer.Option(metavar="FILE.prom", help="Write the run's numbers for Prometheus's node exporter."),
    ] = None,
    log_format: LogFormat = LogForm.text,
    quiet: Quiet = False,
) -> None:
    """Estimate any number of logs into one data set.

    A second call estimates only what is new or changed. Every log is then in the data set or, with the reason, in failures.parquet.
    """
    import time

    from terragrip.estimation.methods import method_named
    from terragrip.fleet.extra import require_maps
    from terragrip.fleet.logs import fleet_logs, matching, on_disk
    from terragrip.fleet.store import is_remote
    from terragrip.report.page import require_drawing

    began = time.monotonic()
    as_json = log_format is LogForm.json
    if as_json:
        log_to_stderr(log_format)
    method_named(method, smooth=smooth)
    if metrics is not None:
        check_file(
            metrics, suffixes=(".prom",), option="--metrics"
        )  # it is overwritten: no log, no vehicle file
    if scheduler is not None and (workers or memory):
        raise InputError(
            "applies to workers on this machine only",
            place="--workers" if workers else "--memory",
            hint="leave it out with --scheduler",
        )
    require_drawing()
    if maps:
        require_maps()
    here = [Path(one) for one in patterns if not is_remote(one)]
    files = on_disk(logs_in(here), output) if here else []
    files += [file for one in patterns if is_remote(one) for file in matching(one)]
    logs = fleet_logs(files, vehicle, profile, index)
    from terragrip.fleet.run import run_fleet

    with progress("fleet", quiet or as_json) as step:
        done = run_fleet(
            logs,
            output,
            method,
            smooth=smooth,
            dbc=dbc or (),
            scheduler=scheduler,
            workers=workers,
            memory=memory,
            maps=maps,
            ground=ground,
            progress=step,
        )
    if metrics is not None:
        _write_metrics(metrics, done, time.monotonic() - began)
    if done.unwritten:
        raise InputError(
            f"the disk had no room for {done.unwritten} of {len(logs)} logs",
            file=output,
            place="--output",
            hint="free space and run again; finished logs are kept",
        )
    if not (quiet or as_json):
        print("\n".join(_lines(done, output)))


def _write_metrics(path: Path, done: FleetResult, seconds: float) -> None:
    """For the node exporter's textfile collector. It shows the last call only, so all metrics are gauges."""
    import time

    from terragrip.files import replacing
    from terragrip.prometheus_text import Metrics

    page = Metrics()
    states = {"estimated": done.estimated, "unchanged": done.unchanged, "failed": len(done.failed)}
    logs = [({"state": state}, number) for state, number in {**states, "kept": done.kept}.items()]
    page.add("gauge", "terragrip_fleet_logs", "Logs of the last call by outcome.", logs)
    page.add("gauge", "terragrip_fleet_rows", "Rows estimated by it.", done.rows)
    page.add(
        "gauge",
        "terragrip_fleet_filter_restarts",
        "Filter restarts in these rows.",
        done.restarts,
    )
    for name, text, values in (
        (
            "nis",
            "NIS over its expected value (1: the noise settings are right), over the logs estimated.",
            done.nis,
        ),
        ("log_seconds", "Worker time of a log, over the logs estimated.", done.seconds),
    ):
        page.add("gauge", f"terragrip_fleet_{name}", text, _quantiles(values))
    page.add("gauge", "terragrip_fleet_duration_seconds", "Duration of the last call.", seconds)
    page.add("gauge", "terragrip_fleet_ended_timestamp_seconds", "End of the last call.", time.time())
    with replacing(path) as temporary:
        temporary.write_text(str(page), encoding="utf-8")


def _quantiles(values: Sequence[float]) -> list[tuple[dict[str, str], float]]:
    """Minimum, median, 90 % quantile and maximum over logs; empty without logs."""
    import numpy as np

    if not values:
        return []
    return [({"quantile": str(q)}, float(np.quantile(values, q))) for q in (0, 0.5, 0.9, 1)]


def _lines(done: FleetResult, output: str) -> list[str]:
    lines = [f"Logs: {done.estimated} estimated, {done.unchanged} unchanged, {len(done.failed)} failed."]
    odd = "{} is unlike the other vehicles: {}; other ground or work, or its vehicle file is wrong"
    for said, listed, rest in (
        ("{}: {}", done.failed, "in failures.parquet"),
        ("{}: left out of means and curves: {}", done.left_out, "left out, in summary.parquet"),
        (odd, done.unlike, "unlike the others, in the report"),
    ):
        lines += [f"  {said.format(*one)}" for one in list(listed.items())[:10]]
        lines += [f"  and {len(listed) - 10} more {rest}"] * (len(listed) > 10)
    if done.kept:
        kept = "1 log of earlier calls is" if done.kept == 1 else f"{done.kept} logs of earlier calls are"
        lines.append(f"{kept} kept.")
    if done.noted:
        which = "1 log has notes" if done.noted == 1 else f"{done.noted} logs have notes"
        lines.append(f"{which}, in the report and in summary.parquet: what seems wrong, or was assumed.")
    return [*lines, f"Written to {output}; read {output}/report.html"]
