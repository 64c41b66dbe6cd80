"""``terragrip new``: files to begin with."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from terragrip.cli.options import EstimatesFile, Quiet
from terragrip.cli.output import check_file
from terragrip.errors import InputError
from terragrip.files import replacing

if TYPE_CHECKING:
    from terragrip.vehicle_maker import Made

app = typer.Typer(help="Make a file to start from.", rich_markup_mode=None, pretty_exceptions_enable=False)


@app.callback()
def _new() -> None:
    """Make a file to start from."""


def _list_classes(wanted: bool) -> None:
    if wanted:
        from terragrip.vehicle_maker import classes, fields

        for machine in classes():
            print(f"{machine.name}: {machine.title}")
            for field in fields(machine, "torque"):
                print(f"    {field.assumption}" + (f" ({field.typical.source})" if field.typical else ""))
        raise typer.Exit


@app.command("vehicle")
def vehicle(
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="FILE", help="The new vehicle file (YAML).")
    ],
    machine: Annotated[
        str | None, typer.Option("--class", metavar="NAME", help="The class of machine; --list names them.")
    ] = None,
    signals: Annotated[
        str | None,
        typer.Option(
            metavar="WHAT",
            help="What its log contains: torque (default; of the engine, too), wheel-speeds or bus-speed (docs/vehicle.md).",
        ),
    ] = None,
    torque_at: Annotated[
        str,
        typer.Option(metavar="WHERE", help="Where torques are measured: motor or wheel (after the gears)."),
    ] = "",
    name: Annotated[str, typer.Option(metavar="TEXT", help="The machine's name.")] = "",
    mass: Annotated[
        str | None, typer.Option(metavar="VALUE", help="Mass, ready to work, e.g. '6.2 t'.")
    ] = None,
    front_mass: Annotated[
        str | None, typer.Option(metavar="VALUE", help="Mass on the front axle, at rest.")
    ] = None,
    wheelbase: Annotated[
        str | None, typer.Option(metavar="VALUE", help="Distance from the first axle to the last.")
    ] = None,
    track: Annotated[
        str | None, typer.Option(metavar="VALUE", help="Distance between left and right wheels.")
    ] = None,
    center_of_gravity_height: Annotated[
        str | None, typer.Option(metavar="VALUE", help="Above ground.")
    ] = None,
    hitch_height: Annotated[str | None, typer.Option(metavar="VALUE", help="Above ground.")] = None,
    wheel_radius: Annotated[
        str | None,
        typer.Option(
            metavar="VALUE", help="Rolling radius; of the rear wheels if the front ones are smaller."
        ),
    ] = None,
    front_wheel_radius: Annotated[
        str | None, typer.Option(metavar="VALUE", help="Rolling radius of a tractor's front wheels.")
    ] = None,
    wheel_inertia: Annotated[
        str | None,
        typer.Option(metavar="VALUE", help="Inertia of a wheel with its geared drive, e.g. '0.2 kg m^2'."),
    ] = None,
    tire_rolling_resistance: Annotated[
        str | None, typer.Option(metavar="VALUE", help="Resistance of the tyres, share of the load.")
    ] = None,
    bearing_resistance: Annotated[str | None, typer.Option(metavar="VALUE", help="In N s/rad.")] = None,
    payload_x: Annotated[
        str | None,
        typer.Option(
            metavar="VALUE",
            help="Centre of gravity of a tank or hopper ahead of the rear axle, for a log with the machine's mass.",
        ),
    ] = None,
    payload_z: Annotated[str | None, typer.Option(metavar="VALUE", help="Its height above ground.")] = None,
    drive_torque_gain: Annotated[
        str | None,
        typer.Option(metavar="VALUE", help="Standard deviation of the torques' scale, e.g. '5 %'."),
    ] = None,
    drive_torque_offset: Annotated[
        str | None,
        typer.Option(metavar="VALUE", help="Standard deviation of the torques' zero, e.g. '2 N m'."),
    ] = None,
    drawbar_offset: Annotated[
        str | None, typer.Option(metavar="VALUE", help="Standard deviation of the drawbar force's zero.")
    ] = None,
    slope: Annotated[
        str | None,
        typer.Option(
            metavar="VALUE", help="Standard deviation of the ground's slope, where no pitch is measured."
        ),
    ] = None,
    acceleration_bias: Annotated[
        str | None,
        typer.Option(
            metavar="VALUE", help="Standard deviation of an accelerometer's zero, mounting included."
        ),
    ] = None,
    known_classes: Annotated[
        bool,
        typer.Option(
            "--list",
            callback=_list_classes,
            is_eager=True,
            help="List the classes with their typical values.",
        ),
    ] = False,
    quiet: Quiet = False,
) -> None:
    """Make a vehicle file.

    Asks on a terminal if no class is given. Unknown numbers get the class's typical values, whose uncertainty widens the intervals; a table
    shows how much each missing number costs.
    """
    given = {
        "mass": mass,
        "front_mass": front_mass,
        "wheelbase": wheelbase,
        "track": track,
        "center_of_gravity_height": center_of_gravity_height,
        "hitch_height": hitch_height,
        "wheel_radius": wheel_radius,
        "front_wheel_radius": front_wheel_radius,
        "wheel_inertia": wheel_inertia,
        "tire_rolling_resistance": tire_rolling_resistance,
        "bearing_resistance": bearing_resistance,
        "payload_x": payload_x,
        "payload_z": payload_z,
        "drive_torque_gain": drive_torque_gain,
        "drive_torque_offset": drive_torque_offset,
        "drawbar_offset": drawbar_offset,
        "slope": slope,
        "acceleration_bias": acceleration_bias,
    }
    from terragrip.vehicle_maker import TORQUE_AT, make

    if output.exists():  # it may be one that the user has worked on
        raise InputError("exists already", file=output, place="--output", hint="name a new file")
    check_file(output, suffixes=(".yaml", ".yml"))
    if machine is None:
        if not sys.stdin.isatty():
            raise InputError(
                "no class of machine is given",
                place="--class",
                hint="name one of those of 'terragrip new vehicle --list', or run it on a terminal to be asked",
            )
        machine, signals = _ask_kind(signals)
        if signals == "torque" and not torque_at:
            torque_at = _choice("Where are its drive torques measured?", TORQUE_AT, or_unknown=True)
        given = _ask_values(machine, signals, given, torque_at)
    made = make(machine, signals or "torque", given, name=name, torque_at=torque_at)  # type: ignore[arg-type]  # make checks it
    made.save(output)
    if not quiet:
        print(_said(made))
        print(f"Written to {output}")


@app.command("controller")
def controller(
    estimates: EstimatesFile,
    output: Annotated[Path, typer.Option("--output", "-o", metavar="FILE", help="The new header (.h).")],
    quiet: Quiet = False,
) -> None:
    """Make a C header for a controller.

    It declares the settings with which the kernel (C99) computes the same estimates there: the vehicle, method, noise and held channels of
    ESTIMATES.
    """
    from terragrip.estimation import Estimates
    from terragrip.estimation.c_header import c_header, estimator_of

    target = check_file(output, [estimates], suffixes=(".h",))
    estimator = estimator_of(Estimates.read_about(estimates), str(estimates))
    with replacing(target) as beside:
        beside.write_text(
            c_header(estimator, f"Of {estimates.name}: {estimator.vehicle.name}."), encoding="utf-8"
        )
    if not quiet:
        print(f"Written to {output}")


def _ask_kind(signals: str | None) -> tuple[str, str]:
    """The class of machine and what its log measures, from the terminal."""
    from terragrip.vehicle_maker import SIGNALS, classes

    machines = {one.name: one.title for one in classes()}
    machine = _choice("Which machine?", machines)
    return machine, signals or _choice("What does its log measure, beside the ground speed?", SIGNALS)


def _choice(question: str, choices: dict[str, str], *, or_unknown: bool = False) -> str:
    """The name of the choice that the user makes; with ``or_unknown`` an empty answer is one, ""."""
    typer.echo(question)
    names = list(choices)
    for number, (name, title) in enumerate(choices.items(), 1):
        typer.echo(f"  {number}  {name}: {title}")
    while True:
        if or_unknown:
            answer = typer.prompt(
                "number or name, or Enter if not known", default="", show_default=False
            ).strip()
        else:
            answer = typer.prompt("number or name").strip()
        if answer in choices or (or_unknown and not answer):
            return str(answer)
        if answer.isdigit() and 1 <= int(answer) <= len(names):
            return names[int(answer) - 1]
        typer.echo(f"  {answer} is not one of them")


def _ask_values(
    machine: str, signals: str, given: dict[str, str | None], torque_at: str
) -> dict[str, str | None]:
    """What the options left open, from the terminal; an empty answer is "not known"."""
    from terragrip.units import quantity
    from terragrip.vehicle_maker import class_named, fields, make, read_values

    chosen = class_named(machine)
    known = {name: value for name, value in given.items() if value is not None}
    read_values(chosen, signals, known)  # type: ignore[arg-type]  # fields checks it
    asked = fields(chosen, signals)  # type: ignore[arg-type]
    if asked:
        typer.echo(
            "A number with its unit, or Enter if not known: then the typical value is used, with its uncertainty."
        )
    for field in asked:
        if field.name in known or (field.name == "payload_z" and "payload_x" not in known):
            continue
        if field.name == "bearing_resistance" and torque_at == "wheel":
            continue
        numbers = {
            name: quantity(value, one.unit)
            for name, value in known.items()
            for one in asked
            if one.name == name
        }
        now = next(one for one in fields(chosen, signals, numbers) if one.name == field.name)  # type: ignore[arg-type]
        left_out = now.assumption.split(": ", 1)[1]
        left_out = f"typical: {left_out}" if now.typical else left_out
        while True:
            important = "; needed for a useful result" if field.needed else ""
            answer = typer.prompt(f"{field.title} [{left_out}{important}]", default="", show_default=False)
            if not answer.strip():
                break
            try:
                make(chosen, signals, known | {field.name: answer})  # type: ignore[arg-type]
            except InputError as error:
                typer.echo(f"  {error}")
                continue
            known[field.name] = answer
            break
    return dict(known)


def _said(made: Made) -> str:
    """What is assumed and what it costs, as text."""
    from terragrip.vehicle_maker import cost_table, fields, interval_costs

    lines = [cost_table(interval_costs(made))]
    lines.append(
        "Computed, not measured: this machine at work, with one uncertainty at a time through the filter (docs/vehicle.md)."
    )
    asked = fields(made.machine, made.signals, made.known)
    lines += [
        f"{field.name} {made.known[field.name]:g} {field.unit} is far from what is typical of the class, "
        f"{field.assumption.partition(': ')[2]}: is the unit right, and the point a decimal point?"
        for field in asked
        if field.is_far(made.known)
    ]
    lacking = [f.name for f in asked if f.needed and f.name not in made.known]
    if made.torque_at == "motor":
        lines.append("Torques at the motor: give each 'scale: RATIO', the gear ratio, in the log's profile.")
        lines.append(
            "With the wheels lifted and turning, their torque is 'drive_friction' in the vehicle file."
        )
    if lacking:
        lines.append(f"Find out first: {', '.join(lacking)}. Then 'terragrip calibrate' on a log.")
    elif made.signals == "bus-speed":
        lines.append(
            "Next: estimate a log that contains 40 s without load (headland, road), or calibrate on one.\n"
            "If the bus has the engine's torque: make the file with --torque-at wheel in place of --signals, and add a 'driveline' "
            "(docs: vehicle#engine-torque-in-place-of-wheel-torques)."
        )
    else:
        lines.append("Next: 'terragrip calibrate' on a log, then 'terragrip estimate'.")
    return "\n".join(lines)
