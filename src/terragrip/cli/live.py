"""``terragrip live``: estimates while the machine drives."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from terragrip.cli.log import LogForm, LogFormat, log_to_stderr
from terragrip.cli.options import Method, Quiet
from terragrip.errors import InputError
from terragrip.estimation.methods import DEFAULT

if TYPE_CHECKING:
    from collections.abc import Callable

    from terragrip.live.many.service import ManyService
    from terragrip.live.options import Options
    from terragrip.live.service import Service
    from terragrip.soil.library import SoilLibrary


def command(
    source: Annotated[
        list[str],
        typer.Option(
            "--source", metavar="URI", help="udp: mqtt: can: ros2: zenoh: serial: replay: (docs/live.md)."
        ),
    ],
    vehicle: Annotated[
        Path | None,
        typer.Option(
            "--vehicle",
            metavar="FILE",
            help="The vehicle file (YAML); with many vehicles, that of those without one in --index.",
        ),
    ] = None,
    sink: Annotated[
        list[str] | None,
        typer.Option("--sink", metavar="URI", help="udp: mqtt: can: ros2: zenoh: foxglove: studio:."),
    ] = None,
    profile: Annotated[
        str | None, typer.Option("--profile", metavar="FILE", help="What the sources' fields mean (YAML).")
    ] = None,
    record: Annotated[
        Path | None,
        typer.Option(
            "--record", metavar="DIR", help="Keep all inputs and outputs; continues where it stopped."
        ),
    ] = None,
    method: Method = DEFAULT,
    window: Annotated[
        float,
        typer.Option(metavar="MS", min=0.0, max=10_000.0, help="How long a row waits for late samples, ms."),
    ] = 20.0,
    held: Annotated[
        list[str] | None,
        typer.Option(
            "--held",
            metavar="CHANNEL=S",
            help="A channel that repeats its value between updates S seconds apart: ground_speed=0.2.",
        ),
    ] = None,
    settings: Annotated[
        Path | None,
        typer.Option(
            "--settings",
            metavar="FILE",
            help="Estimates of an earlier log of this machine: use their noise and held channels.",
        ),
    ] = None,
    ground: Annotated[bool, typer.Option("--ground", help="Report where the ground changes.")] = False,
    library: Annotated[
        Path | None,
        typer.Option("--library", metavar="FILE", help="Known soils (terragrip soils): also name the soil."),
    ] = None,
    setpoint: Annotated[
        str | None,
        typer.Option(
            "--setpoint",
            metavar="SLIP|FILE",
            help="Publish wheel speeds for this slip (0.11, or advice.json), as advice only; with --speed.",
        ),
    ] = None,
    speed: Annotated[
        float | None, typer.Option(metavar="M/S", help="Desired ground speed, for --setpoint.")
    ] = None,
    index: Annotated[
        Path | None,
        typer.Option(
            "--index",
            metavar="TABLE",
            help="For many vehicles: a CSV with the columns name, vehicle, profile.",
        ),
    ] = None,
    max_vehicles: Annotated[
        int, typer.Option(metavar="COUNT", min=1, help="For many vehicles: the greatest number at once.")
    ] = 256,
    duration: Annotated[
        float | None, typer.Option(metavar="S", min=0.0, help="Stop after this many seconds.")
    ] = None,
    log_format: LogFormat = LogForm.text,
    quiet: Quiet = False,
) -> None:
    """Estimate while the machine drives.

    Receives samples from any number of sources and sends estimates to any number of sinks. Ctrl-C ends it with a complete record.

    Many vehicles in one process: --source 'mqtt://HOST/field/{vehicle}/sample' --sink 'mqtt://HOST/field/{vehicle}', with --index or
    --vehicle; each has its own estimator and its record DIR/NAME.
    """
    import asyncio
    import logging
    import os

    # Before pyarrow loads: its own allocator keeps 5 MB more, for a record that writes once a minute.
    os.environ.setdefault("ARROW_DEFAULT_MEMORY_POOL", "system")
    from terragrip.live.options import Options
    from terragrip.live.status import table, table_of_many
    from terragrip.live.topics import VEHICLE

    if quiet and not sink and record is None:
        raise InputError("estimates would go nowhere", place="--quiet", hint="add --sink or --record")
    as_json = log_format is LogForm.json
    if as_json:
        log_to_stderr(log_format)
    known = _settings(settings)
    options = Options(
        method=method,
        window=window / 1000.0,
        held={**known["held"], **_held(held or [])},
        noise=known["noise"],
        learn=settings is None,
        ground=ground,
        library=_library(library),
        setpoint=_setpoint(setpoint, speed),
        driveline=known["driveline"],
        cycle=known["cycle"],
    )
    many = any(VEHICLE in uri for uri in (*source, *(sink or ()))) or index is not None
    service: Service | ManyService
    screen: Callable[[], Any]
    if not many:
        service = _one(source, sink or [], vehicle, profile, record, options)
        screen = partial(table, service)
    elif settings is not None:
        raise InputError(
            "are those of one machine", place="--settings", hint="put the noise into the vehicle files"
        )
    else:
        service = _many(source, sink or [], vehicle, profile, index, record, options, max_vehicles)
        screen = partial(table_of_many, service)
    from terragrip.log_events import emit

    logger = logging.getLogger("terragrip.live")
    emit(
        logger, "live_started", sources=service.source_names, sinks=[box.uri.name for box in service.outboxes]
    )
    asyncio.run(_run(service, screen, duration, quiet or as_json))
    emit(logger, "live_stopped", **service.totals())
    if not (quiet or as_json):
        print(service.summary())
        if record is not None:
            print(f"Recorded in {record}")


def _one(
    source: list[str],
    sink: list[str],
    vehicle: Path | None,
    profile: str | None,
    record: Path | None,
    options: Options,
) -> Service:
    from terragrip.formats import Profile
    from terragrip.live.service import Service
    from terragrip.vehicle import Vehicle

    if vehicle is None:
        raise InputError("no vehicle is named", place="--vehicle", hint="name a vehicle file")
    read = None if profile is None else Profile.load(profile)
    return Service(Vehicle.load(vehicle), source, sink, profile=read, record=record, options=options)


def _many(
    source: list[str],
    sink: list[str],
    vehicle: Path | None,
    profile: str | None,
    index: Path | None,
    record: Path | None,
    options: Options,
    most: int,
) -> ManyService:
    from terragrip.live.many.roster import Roster
    from terragrip.live.many.service import ManyService

    roster = Roster(vehicle, None if profile is None else Path(profile), index)
    return ManyService(roster, source, sink, record=record, options=options, most=most)


def _settings(path: Path | None) -> dict[str, Any]:
    """Noise, update periods and driveline that estimates were made with; raises InputError where the file does not hold them."""
    if path is None:
        return {"noise": {}, "held": {}, "driveline": None, "cycle": None}
    from terragrip.estimation import Estimates
    from terragrip.estimation.provenance import settings_of

    about = Estimates.read_about(path)
    known = settings_of(about, path, place="--settings")
    driveline = about.get("driveline")
    if driveline is not None and "engine" not in driveline:
        driveline = None  # of an earlier version
    of_it = {name: known.get(name) for name in ("noise", "held", "cycle")}
    return {**of_it, "driveline": driveline}


def _held(pairs: list[str]) -> dict[str, float]:
    """Update periods by channel."""
    from terragrip.recording.schema import is_channel

    result = {}
    for pair in pairs:
        name, _, text = pair.partition("=")
        try:
            period = float(text)
        except ValueError:
            period = 0.0
        if not is_channel(name) or not 0.0 < period < 1e4:
            raise InputError(
                f"{pair!r} is not a channel and a period", place="--held", hint="write ground_speed=0.2"
            )
        result[name] = period
    return result


def _setpoint(text: str | None, speed: float | None) -> tuple[float, float] | None:
    """Slip and ground speed wanted; raises InputError where one of them is missing or no number."""
    if text is None and speed is None:
        return None
    if text is None or speed is None:
        raise InputError(
            "neither works without the other",
            place="--setpoint, --speed",
            hint="--setpoint 0.11 --speed 1.5",
        )
    if text.endswith(".json"):
        from terragrip.advice.result import advised_slip

        return advised_slip(text), speed
    try:
        return (float(text[:-1]) / 100 if text.endswith("%") else float(text)), speed
    except ValueError:
        raise InputError(
            f"{text!r} is neither a slip nor a file of advice",
            place="--setpoint",
            hint="write 0.11, 11% or advice.json",
        ) from None


def _library(path: Path | None) -> SoilLibrary | None:
    if path is None:
        return None
    from terragrip.soil.library import SoilLibrary

    return SoilLibrary.load(path)


async def _run(
    service: Service | ManyService, screen: Callable[[], Any], duration: float | None, quiet: bool
) -> None:
    import asyncio
    import signal

    from terragrip.live.status import shown

    loop = asyncio.get_running_loop()
    for number in (signal.SIGINT, signal.SIGTERM):
        loop.add_signal_handler(number, service.stop)
    if duration is not None:
        loop.call_later(duration, service.stop)
    async with shown(screen, service.listeners, quiet):
        await service.run()
