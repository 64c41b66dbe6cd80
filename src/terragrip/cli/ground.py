"""``terragrip ground``: where the ground changes, what it is, and what happened on it."""

from __future__ import annotations

from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from terragrip.cli.options import EstimatesFiles, Quiet
from terragrip.cli.output import check_file, check_folder, files_in
from terragrip.cli.progress import progress
from terragrip.errors import InputError, suggestion
from terragrip.note_pages import with_page
from terragrip.text import aligned

if TYPE_CHECKING:
    from terragrip.ground.result import Ground


def command(
    estimates: EstimatesFiles,
    output: Annotated[Path, typer.Option("--output", "-o", metavar="FILE", help="The result, ground.json.")],
    library: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="The known soils, soils.json; without it no soil is named."),
    ] = None,
    table: Annotated[
        Path | None,
        typer.Option(
            metavar="PATH",
            help="Write the estimates with the columns soil_estimate and soil_probability here (Parquet; with several, a folder).",
        ),
    ] = None,
    online: Annotated[
        bool,
        typer.Option("--online", help="As it would have been reported while driving, without looking ahead."),
    ] = False,
    length: Annotated[float, typer.Option(metavar="M", help="Prior mean distance on one ground.")] = 30.0,
    signal: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME",
            help="Look for changes in this signal (may be repeated; a wrong name lists all). Default: those of the ground alone.",
        ),
    ] = None,
    quiet: Quiet = False,
) -> None:
    """Find changes of the ground, name the soils, list events.

    Changes with time, standard deviation and probability; sections in which vehicle and tool are on one soil, with slip and adhesion; the
    soil of the library with probabilities, or 'unknown' where none fits; events. All drives are written to one file, each entry with
    its run.
    """
    from terragrip.estimation import Estimates
    from terragrip.ground.analysis import Settings, analyse
    from terragrip.ground.result import write
    from terragrip.soil.estimates import repeated
    from terragrip.soil.library import SoilLibrary
    from terragrip.soil.signature import signature_in

    if not 0 < length < float("inf"):
        raise InputError(f"{length:g} is not a length", place="--length", hint="give metres, e.g. 30")
    runs = _names(estimates)
    inputs = [*estimates, library]
    target = check_file(output, inputs, suffixes=(".json",))
    tables = _tables(table, estimates, [*inputs, output])
    known = SoilLibrary.load(library) if library else None
    for soil in known.recognisable.values() if known is not None else ():
        signature_in(soil, library)
    settings, grounds = Settings(online, length, _signals(signal)), []
    with progress("ground", quiet) as step:
        for number, (path, run) in enumerate(zip(estimates, runs, strict=True), 1):
            try:
                ground, enriched = analyse(Estimates.read(path), known, run, settings)
            except InputError as error:
                raise (
                    error
                    if error.file not in (None, run)
                    else InputError(error.problem, file=path, place=error.place, hint=error.hint)
                ) from None
            grounds.append(ground)
            if tables:
                enriched.write(tables[number - 1])
            step(number, len(estimates), run)
    write(grounds, target, {"library": None if library is None else library.name})
    if not quiet:
        print(*repeated(estimates), summary(grounds), sep="\n")
        print(f"Written to {output}" + (f" and {table}" if table else ""))


def _signals(given: list[str] | None) -> tuple[str, ...]:
    from terragrip.ground.signals import GROUND, SIGNALS

    for name in given or ():
        if name not in SIGNALS:
            hint = suggestion(name, SIGNALS, f"choose one of {', '.join(SIGNALS)}")
            raise InputError(f"there is no signal {name!r}", place="--signal", hint=hint)
    return tuple(dict.fromkeys(given)) if given else GROUND


def _names(files: list[Path]) -> list[str]:
    """A name for each drive: its file's; refuses a file given twice and two files of one name."""
    from terragrip.soil.estimates import distinct

    seen: dict[str, Path] = {}
    for path in distinct(files):
        other = seen.get(path.stem)
        if other is not None:
            raise InputError(
                f"has the same name as {other}", file=path, hint="rename one: runs are distinguished by name"
            )
        seen[path.stem] = path
    return list(seen)


def _tables(table: Path | None, estimates: list[Path], inputs: list[Path | None]) -> list[Path]:
    if table is None:
        return []
    if len(estimates) == 1:
        return [check_file(table, inputs, suffixes=(".parquet",), option="--table")]
    for path in estimates:
        if not path.exists():
            raise InputError("no such file", file=path, hint="check the path")
    check_folder(table)
    return [check_file(path, inputs, option="--table") for path in files_in(table, estimates, ".parquet")]


def summary(grounds: list[Ground]) -> str:
    """Lines of text: each drive, its sections, its notes; many drives a line each."""
    lines = []
    for ground in grounds:
        counted = [f"{len(ground.changes)} change{'s' * (len(ground.changes) != 1)}"]
        counted.append(f"{len(ground.sections)} section{'s' * (len(ground.sections) != 1)}")
        counted.append(f"{len(ground.events)} event{'s' * (len(ground.events) != 1)}")
        seen = f"; {', '.join(ground.soils)}" if ground.soils else ""
        lines.append(f"{ground.run}: {', '.join(counted)}{seen}")
        if len(grounds) == 1:
            lines += _sections(ground)
        lines += [f"  {with_page(note)}" for note in ground.notes]
    return "\n".join(lines)


def _sections(ground: Ground) -> list[str]:
    from terragrip.report.clock import Clock

    zero = (ground.about.get("recording") or {}).get("time_zero")
    clock = Clock(datetime.fromisoformat(zero) if zero else None, ground.end - ground.start)
    rows: list[tuple[str, ...]] = [("  from", "to", "soil", "probability", "slip", "adhesion")]
    for one in ground.sections:
        slip = "" if one.slip_mean is None else f"{one.slip_mean:.3f} ± {one.slip_std:.3f}"
        adhesion = "" if one.adhesion_mean is None else f"{one.adhesion_mean:.3f} ± {one.adhesion_std:.3f}"
        chance = f"{one.probabilities[one.soil]:.2f}"
        start, end = clock.text(one.start, 1), clock.text(one.end, 1)
        rows.append((f"  {start}", end, one.soil, chance, slip, adhesion))
    return aligned(rows)
