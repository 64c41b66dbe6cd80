"""``terragrip ground-classifier``: learn grounds from labelled drives, and tell them window by window."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from terragrip.cli.options import DbcFiles, Logs, OtherSources, ProfileFile, Quiet
from terragrip.cli.output import check_file
from terragrip.cli.progress import progress
from terragrip.errors import InputError

if TYPE_CHECKING:
    import pandas as pd

    from terragrip.ground.classification.classifier import GroundClassifier

app = typer.Typer(
    help="Recognise grounds from wheels and body sensors alone: train, then predict.", rich_markup_mode=None
)


@app.command("train")
def train(
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="FILE", help="The classifier, grounds.npz.")
    ],
    logs: Annotated[
        list[Path] | None,
        typer.Argument(
            metavar="LOG", help="Logs of any known format (docs/formats.md); or those of --labels."
        ),
    ] = None,
    labels: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="A CSV table with the columns file,label[,with], one row per drive; 'with' names another log of it. "
            "Without it, the logs' own column names the ground.",
        ),
    ] = None,
    column: Annotated[
        str, typer.Option(metavar="NAME", help="The logs' column with labels, without --labels.")
    ] = "soil",
    profile: ProfileFile = None,
    dbc: DbcFiles = None,
    window: Annotated[float, typer.Option(metavar="S", help="Length of a window.")] = 1.7,
    seed: Annotated[int, typer.Option(metavar="N", help="Random seed of the training.")] = 0,
    quiet: Quiet = False,
) -> None:
    """Learn grounds from labelled drives.

    Uses wheel speeds, torques or motor currents, accelerations and angular velocities, as far as logged. Give several drives of each
    ground.
    """
    from terragrip.ground.classification.classifier import GroundClassifier

    target = check_file(output, [*(logs or ()), labels, profile, *(dbc or ())], suffixes=(".npz",))
    classifier = GroundClassifier(window, random_state=seed)
    classifier.check_parameters()
    tables, grounds, sources = _labelled(logs or [], labels, column, profile, dbc or [], window, quiet)
    with progress("train", quiet) as step:
        step(0, 1)
        try:
            classifier.fit(tables, grounds)
        except InputError as error:
            raise _of_log(error, sources) from None
    classifier.save(target)
    if not quiet:
        counts = {ground: grounds.count(ground) for ground in map(str, classifier.classes_)}
        print("Learnt " + ", ".join(f"{g} ({n} drive{'s' * (n != 1)})" for g, n in counts.items()))
        print(f"from {'; '.join(' + '.join(s) for s in classifier.sensors_[:1])}, or less")
        for note in classifier.notes_:
            print(note)
        print(f"Written to {output}")


@app.command("predict")
def predict(
    logs: Logs,
    classifier: Annotated[
        Path, typer.Option("--classifier", "-c", metavar="FILE", help="What 'train' wrote, grounds.npz.")
    ],
    output: Annotated[
        Path,
        typer.Option("--output", "-o", metavar="FILE", help="The table of windows (CSV or Parquet)."),
    ],
    profile: ProfileFile = None,
    dbc: DbcFiles = None,
    others: OtherSources = None,
    step: Annotated[
        float | None, typer.Option(metavar="S", help="From one window to the next; default: one window.")
    ] = None,
    smooth: Annotated[
        float, typer.Option(metavar="S", help="Time over which neighbouring windows share their evidence.")
    ] = 0.0,
    rejection: Annotated[
        float | None,
        typer.Option(
            metavar="SHARE",
            help="Share of windows on known grounds that may be called unknown; default: as trained, 0.02.",
        ),
    ] = None,
    quiet: Quiet = False,
) -> None:
    """Recognise the ground of every window.

    A table with a row for each window: file, start, end, ground (or 'unknown'), novelty, and the probability of every ground.
    """
    from terragrip.formats import read_channels
    from terragrip.ground.classification.channels import CURRENT
    from terragrip.ground.classification.classifier import GroundClassifier

    if others and len(logs) > 1:
        raise InputError("there are several logs", place="--with", hint="predict one drive at a time")
    beside = [classifier, profile, *(dbc or ()), *(others or ())]
    target = check_file(output, [*logs, *beside], suffixes=(".csv", ".parquet"))
    known = GroundClassifier.load(classifier)
    known.set_params(step=step, smooth=smooth)
    if rejection is not None:
        known.set_params(rejection=rejection)
    known.check_parameters()
    tables: list[pd.DataFrame] = []
    slow: list[list[str]] = []
    with progress("ground-classifier", quiet) as show:
        for number, log in enumerate(logs, 1):
            columns = read_channels([log, *(others or ())], profile, dbc=dbc or (), also=CURRENT)
            tables.append(_judged(known, columns, log))
            slow.append(known.too_slow(columns))
            show(number, len(logs), log.name)
    _write(tables, target)
    if not quiet:
        for log, table, notes in zip(logs, tables, slow, strict=True):
            shares = table["ground"].value_counts(normalize=True)
            print(
                f"{log.name}: {len(table)} windows; " + ", ".join(f"{g} {s:.0%}" for g, s in shares.items())
            )
            for note in notes:
                print(f"  {note}")
        print(f"Written to {output}")


def _labelled(
    logs: list[Path],
    labels: Path | None,
    column: str,
    profile: Path | None,
    dbc: list[Path],
    window: float,
    quiet: bool,
) -> tuple[list[Any], list[str], list[Path]]:
    """Tables of drives, or of stretches on one ground, the label of each and the log it is of."""
    from terragrip.formats import read_channels
    from terragrip.ground.classification.channels import CURRENT
    from terragrip.ground.classification.labelled import LabelledDrive, read_labels, stretches

    if labels is None and not logs:
        raise InputError("there is no log", hint="give labelled logs, or --labels with a table file,label")
    drives = read_labels(labels, logs) if labels else [LabelledDrive("", (log,)) for log in logs]
    tables: list[Any] = []
    grounds: list[str] = []
    sources: list[Path] = []
    with progress("read", quiet) as step:
        for number, drive in enumerate(drives, 1):
            log = drive.logs[0]
            columns = read_channels(drive.logs, profile, dbc=dbc, also=(*CURRENT, column))
            if labels is not None:
                tables.append(columns)
                grounds.append(drive.label)
            elif column not in columns:
                hint = "name the column with --column, or give --labels with a table file,label"
                raise InputError("is missing", file=log, place=f"column {column}", hint=hint)
            else:
                for part, label in stretches(columns, columns[column], window):
                    tables.append(part)
                    grounds.append(label)
            sources += [log] * (len(tables) - len(sources))
            step(number, len(drives), log.name)
    if not tables:
        hint = f"label longer stretches, or take a shorter --window than {window:g} s"
        raise InputError(f"no log has a labelled stretch as long as a window ({window:g} s)", hint=hint)
    return tables, grounds, sources


def _of_log(error: InputError, sources: list[Path]) -> InputError:
    """The same error, with the log's name in place of a recording's number."""
    number = re.fullmatch(r"recordings\[(\d+)\]", error.file or "")
    file = sources[int(number.group(1))] if number else error.file
    place = None if error.place in ("recordings", "labels") else error.place
    return InputError(error.problem, file=file, place=place, hint=error.hint)


def _judged(known: GroundClassifier, columns: Any, log: Path) -> pd.DataFrame:
    """The windows of one drive, as they are written."""
    try:
        table = known.judge([columns])
    except InputError as error:
        raise _of_log(error, [log]) from None
    if not table["novelty"].notna().any():
        length, window = columns["time"][-1] - columns["time"][0], table["end"][0] - table["start"][0]
        if length < window:
            problem = f"lasts {length:.3g} s, too short for a window of {window:.3g} s"
            raise InputError(problem, file=log, hint="give a longer log")
        if slow := known.too_slow(columns):
            raise InputError(" ".join(slow), file=log, hint="log faster, or train on logs of this rate")
        wanted = "; ".join(" + ".join(s) for s in known.sensors_[-3:])
        raise InputError("has none of the learned sensors", file=log, hint=f"give e.g. {wanted}")
    table = table.drop(columns="recording")
    table.insert(0, "file", log.name)
    return table


def _write(tables: list[pd.DataFrame], target: Path) -> None:
    import pandas as pd

    from terragrip.files import replacing

    table = pd.concat(tables, ignore_index=True)
    with replacing(target) as temporary:
        if target.suffix.lower() == ".parquet":
            table.to_parquet(temporary, index=False)
        else:
            table.to_csv(temporary, index=False, float_format="%.6g")
