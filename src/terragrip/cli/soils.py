"""``terragrip soils``: adhesion-slip curves of soils from estimates."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from terragrip.cli.options import Quiet
from terragrip.cli.output import check_file
from terragrip.cli.progress import progress
from terragrip.note_pages import with_page
from terragrip.text import aligned

if TYPE_CHECKING:
    from terragrip.soil.fit import AdhesionCurve
    from terragrip.soil.library import Soil, SoilLibrary


def command(
    inputs: Annotated[
        list[Path],
        typer.Argument(
            metavar="ESTIMATES",
            help="Files written by 'terragrip estimate'; also libraries (.json) to join and digitised points (.csv).",
        ),
    ],
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="FILE", help="The soil library, soils.json.")
    ],
    model: Annotated[
        str, typer.Option(metavar="NAME", help="Curve model; the paper's is 'exponential'.")
    ] = "exponential",
    free: Annotated[bool, typer.Option("--free", help="Fit all parameters, not the paper's one.")] = False,
    weights: Annotated[bool, typer.Option("--weights", help="Weight bins by their samples.")] = False,
    lower: Annotated[
        float | None, typer.Option(help="Lowest slip of the bins; 0.005 by pull, 0.05 by slip.")
    ] = None,
    upper: Annotated[
        float, typer.Option(help="Highest slip of the bins; on grass 0.40, as in the paper.")
    ] = 0.60,
    width: Annotated[float | None, typer.Option(help="Width of a bin; 0.005 by pull, 0.01 by slip.")] = None,
    by: Annotated[
        str,
        typer.Option(
            metavar="pull|slip",
            help="Sort samples into bins by the vehicle's pull, or by each sample's own slip as in the paper.",
        ),
    ] = "pull",
    metres: Annotated[
        float, typer.Option(help="By pull: least metres of a bin; shorter ones are joined.")
    ] = 4.0,
    runs: Annotated[int, typer.Option(help="By pull: least runs of a bin.")] = 2,
    minimum: Annotated[int, typer.Option(help="By slip: least samples of a bin.")] = 10,
    soil: Annotated[
        str | None,
        typer.Option(
            metavar="NAME", help="The soil of all rows, for logs without labels; of digitised points."
        ),
    ] = None,
    merge: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Add to this library; soils of the same name are replaced."),
    ] = None,
    literature: Annotated[
        bool, typer.Option("--literature", help="Add the soils of the literature.")
    ] = False,
    compare: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Report how far these soils are from those of this library."),
    ] = None,
    quiet: Quiet = False,
) -> None:
    """Learn adhesion-slip curves of soils.

    Collects slip and adhesion where vehicle and tool are on one soil and no event is flagged, in slip bins. Gives each soil's curve with
    intervals, R2, NRMSE, what the data do not determine, and what to drive next. Samples are sorted by the vehicle's pull, since slip
    depends on weak and strong spots; the paper's fit, sorted by slip, is given beside it.
    """
    from terragrip.errors import InputError
    from terragrip.soil.bins import BY_SLIP, chosen_bins
    from terragrip.soil.fit import FREE, AdhesionCurve
    from terragrip.soil.library import SoilLibrary
    from terragrip.soil.literature import literature_soils

    target = check_file(output, [*inputs, merge, compare], suffixes=(".json",))
    base = SoilLibrary.load(merge) if merge else None
    other = SoilLibrary.load(compare) if compare else None
    try:
        bins = chosen_bins(by, width, lower, upper, minimum=minimum, metres=metres, runs=runs)
        of_points = chosen_bins(BY_SLIP, width, lower, upper)  # which have no pull
    except ValueError as error:
        raise InputError(
            str(error), place="--width, --lower, --upper, --by, --metres, --runs", hint="choose other bins"
        ) from None
    curve = AdhesionCurve(model, FREE if free else None, weights="count" if weights else None, bins=bins)
    if soil is not None and all(path.suffix.lower() == ".json" for path in inputs):
        raise InputError(
            "names the soil of rows or points, but only libraries are given",
            place="--soil",
            hint="leave it out",
        )
    estimates = [path for path in inputs if path.suffix.lower() not in (".json", ".csv")]
    library, words = _learned(estimates, curve, soil, quiet)
    for path in inputs:
        if path.suffix.lower() == ".json":
            library = _joined(library, SoilLibrary.load(path), path)
        elif path.suffix.lower() == ".csv":
            points, of_file = _digitised(path, curve.unfitted(bins=of_points), soil)
            library = _joined(library, points, path)
            words += of_file
    if base is not None:
        library = base.merge(library, "replace")
    if literature:
        library = library.merge(literature_soils(), "keep")
    library.write(target)
    if quiet:
        return
    print(table(library))
    for sentence in words:
        print(sentence)
    if other is not None:
        print(comparison(library, other, compare))
    print(f"Written to {output}")


def _learned(
    estimates: list[Path], curve: AdhesionCurve, soil: str | None, quiet: bool
) -> tuple[SoilLibrary, list[str]]:
    """The soils of estimates, and what is to be said of them."""
    from terragrip.soil.bins import chosen_bins
    from terragrip.soil.estimates import soils_of
    from terragrip.soil.library import SoilLibrary

    learning, left = _with_adhesion(estimates)
    words = [f"{path}: left out, it has slip without adhesion." for path in left]
    if not learning:
        return SoilLibrary({}), words
    bins, usual = curve.bins, chosen_bins(curve.bins.by)
    as_usual = (bins.width, bins.lower, bins.upper) == (usual.width, usual.lower, usual.upper)
    with progress("soils", quiet) as step:
        campaign = soils_of(learning, curve, None if as_usual else {}, soil, step)
    return campaign.library({"files": [str(path) for path in learning]}), [*words, *campaign.words]


def _digitised(path: Path, curve: AdhesionCurve, soil: str | None) -> tuple[SoilLibrary, list[str]]:
    """The soils of a file of digitised points, and what is to be said of them."""
    from terragrip.soil.digitised import soils_of_points

    points = soils_of_points(path, curve, soil)
    words = [f"{name}: not fitted, {why}." for name, why in points.not_fitted.items()]
    words += [
        f"{name}: {with_page(note)}" for name, one in points.items() for note in one.fit.get("notes", ())
    ]
    return points, words


def _with_adhesion(estimates: list[Path]) -> tuple[list[Path], list[Path]]:
    """The files that hold adhesion, and those of several that hold slip alone; where none holds any, all, for the reader to name."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    from terragrip.estimation.columns import wheels_with

    def has_adhesion(path: Path) -> bool:
        try:
            return bool(wheels_with("adhesion", pq.read_schema(path).names))
        except (pa.ArrowException, OSError):
            return True  # whoever learns from it says why it is unusable

    left = [path for path in estimates if not has_adhesion(path)]
    learning = [path for path in estimates if path not in left]
    return (learning, left) if learning else (estimates, [])


def _joined(library: SoilLibrary, other: SoilLibrary, path: Path) -> SoilLibrary:
    """Both libraries; a soil of one name in both is refused, with the file that brings the second."""
    from terragrip.errors import InputError

    twins = sorted(set(library.soils) & set(other.soils))
    if twins:
        raise InputError(
            f"the soil {twins[0]!r} is in another of these inputs too",
            file=path,
            hint="rename one, or give one library with --merge, whose soils of that name are replaced",
        )
    return library.merge(other)


def comparison(library: SoilLibrary, other: SoilLibrary, path: Path | None) -> str:
    """Lines of text: each soil in both, the differences of adhesion where both have data, and whether the intervals meet."""
    rows = library.compare(other)
    if not rows:
        return f"None of these soils is in {path}."
    lines = [f"Compared with {path}, adhesion over the slips that both have data of:"]
    for row in rows:
        meet = row["intervals_meet"]
        sentence = "; ".join(
            f"intervals of {k} {'overlap' if v else 'do not overlap'}" for k, v in meet.items()
        )
        lines.append(
            f"  {row['soil']}: {round(-row['mean'], 3) + 0.0:+.3f} in the mean, {row['largest']:.3f} at most, to {row['to']:.0%} of slip"
            + (f"; {sentence}" if sentence else "")
        )
    return "\n".join(lines)


def table(library: Mapping[str, Soil]) -> str:
    """The library as lines of text: soil, model, free parameters with intervals, R2, NRMSE, bins and what sorted them, the paper's way
    (a and R2 with bins by slip), the badge."""
    from terragrip.soil.identifiability import Identifiability

    head = (
        "soil",
        "model",
        "parameters (95 % interval)",
        "R2",
        "NRMSE",
        "bins",
        "sorted by slip",
        "data fix it",
    )
    rows: list[tuple[str, ...]] = [head]
    for name, one in library.items():
        free = one.fit.get("free", list(one.parameters))
        words = []
        for key in free:
            interval = one.interval.get(key)
            words.append(
                f"{key} {one.parameters[key]:.3g}"
                + (f" ({interval[0]:.3g} to {interval[1]:.3g})" if interval else "")
            )
        score = ["" if value is None else f"{value:.3f}" for value in (one.r2, one.nrmse)]
        badge, settings = one.fit.get("identifiability"), one.fit.get("settings") or {}
        fixed = "" if not badge else Identifiability.from_dict(badge).short(one.r2)
        bins = f"{len(one.bins)} by {settings.get('by', 'slip')}" if one.bins else ""
        rows.append((name, one.model, ", ".join(words), *score, bins, _by_slip(one), fixed))
    return "\n".join(aligned(rows))


def _by_slip(soil: Soil) -> str:
    """The paper's way, each sample sorted by its own slip, where another stands first: the free parameters and R2."""
    paper = soil.fit.get("by_slip")
    if not paper:
        return ""
    free = soil.fit.get("free", list(soil.parameters))
    return ", ".join(f"{key} {paper['parameters'][key]:.3g}" for key in free) + f", R2 {paper['r2']:.3f}"
