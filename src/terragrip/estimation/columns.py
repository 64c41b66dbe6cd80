"""The columns of estimates: the unit and the description that files, tables and figures give each."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import lru_cache
from typing import Any, NamedTuple

from terragrip.recording.schema import REFERENCE, unit_of


class Column(NamedTuple):
    """What a column holds: its ``unit`` (SI or deg; "1" for a ratio or a count, "" for text) and its ``description``."""

    unit: str
    description: str

    @property
    def label(self) -> str:
        """The description with the unit, where it has one."""
        return f"{self.description} [{self.unit}]" if self.unit else self.description


_WHOLE = {
    "time": Column("s", "time on the log's own clock"),
    "distance": Column("m", "distance travelled since the first row, forward and backward alike"),
    "ground_speed": Column("m/s", "forward speed of the vehicle over ground"),
    "soil_resistance": Column("1", "soil rolling resistance: the force that the ground opposes, over the vehicle's weight"),
    "curve_a": Column("1", "scale of the adhesion curve known so far, of the vehicle"),
    "warning": Column("1", "score of the warning of immobilization"),
    "warning_usual_slip": Column("1", "slip that the warning takes as usual"),
    "nis": Column("1", "normalised innovation squared of the row, over all its channels"),
    "channels": Column("1", "channels used in the row's update: the expected value of nis"),
    "supervisor": Column("1", "supervisor gamma: how far the noise is adapted, 0 to 1"),
    "event": Column("", "event of the row: empty, or a name of docs/events.md"),
    "soil": Column("", "the log's soil label, empty where it has none"),
    "log": Column("", "the log of the row, where one table contains several"),
    "latitude": Column("deg", "measured latitude, WGS 84"),
    "longitude": Column("deg", "measured longitude, WGS 84"),
    "altitude": Column("m", "measured altitude"),
    "fuel_rate": Column("m^3/s", "measured fuel rate of the engine"),
    "drawbar_force": Column("N", "measured drawbar force, backward pull positive"),
    "mass": Column("kg", "measured mass of the whole machine"),
    "hitch_load": Column("N", "measured vertical load on the hitch, down positive"),
}  # fmt: skip
_WHOLE |= {
    "wheel_speed_driven": Column("rad/s", "mean angular velocity of the driven wheels"),
    "adhesion_driven": Column(
        "1", "mean adhesion (mu) of the driven wheels together, by the engine's torque"
    ),
    "slip_driven": Column("1", "slip of the driven wheels as one"),
    "net_traction_driven": Column("1", "net traction ratio of the driven wheels together"),
    "efficiency_driven": Column("1", "tractive efficiency of the driven wheels together"),
    "vertical_load_driven": Column("N", "vertical load of the driven axles together"),
}
_BY_WHEEL = {
    "wheel_speed": Column("rad/s", "angular velocity of wheel {}"),
    "adhesion": Column(
        "1",
        "adhesion (mu) of wheel {}: force of the ground along the travel, in reverse too, over the wheel's load",
    ),
    "slip": Column("1", "slip of wheel {}: 1 spins on the spot, -1 is a locked wheel"),
    "net_traction": Column("1", "net traction ratio of wheel {}: adhesion less soil resistance"),
    "efficiency": Column("1", "tractive efficiency of wheel {}: drawbar power over wheel power"),
    "curve_a": Column("1", "scale of the adhesion curve known so far, of wheel {}"),
    "vertical_load": Column("N", "vertical load of axle {}"),
    "wheel_force_x": Column("N", "measured longitudinal force of wheel {}, a reference"),
    "wheel_force_z": Column("N", "measured vertical force of wheel {}, a reference"),
    "adaptation": Column("1", "factor of the adaptation on the process noise of {}"),
    "warning": Column("1", "sign {} of the warning of immobilization, in points"),
}


@lru_cache(1000)
def column_named(name: str) -> Column:
    """Unit and description of a column of estimates; of a foreign one ``Column("", "")``."""
    if name.startswith(REFERENCE):
        inner = column_named(name.removeprefix(REFERENCE))
        return Column(inner.unit, f"true value: {inner.description}".removesuffix(": "))
    known = _WHOLE.get(name) or _of_a_part(name)
    if known is not None:
        return known
    if name.endswith("_std"):
        inner = column_named(name.removesuffix("_std"))
        if inner.description:
            return Column(inner.unit, f"one standard deviation of {name.removesuffix('_std')}")
    return Column(unit_of(name) or "", "")


def _of_a_part(name: str) -> Column | None:
    """Of a column of one wheel, axle, state or sign."""
    if name.endswith("_std"):
        return None
    for quantity, column in _BY_WHEEL.items():
        if name.startswith(f"{quantity}_") and len(name) > len(quantity) + 1:
            part = name.removeprefix(f"{quantity}_").replace(
                "_", " " if quantity in ("warning", "adaptation") else "_"
            )
            return Column(column.unit, column.description.format(part))
    return None


def wheels_with(quantity: str, columns: Iterable[str]) -> tuple[str, ...]:
    """The wheels with a column ``<quantity>_<wheel>`` (other than a ``_std``), in the columns' order."""
    begin = f"{quantity}_"
    return tuple(n.removeprefix(begin) for n in columns if n.startswith(begin) and not n.endswith("_std"))


def driven_of(wheels: Iterable[str], about: Mapping[str, Any]) -> tuple[str, ...]:
    """The wheels without those of axles that the vehicle of estimates (``about``) does not drive; all, where none is left."""
    axles = (about.get("vehicle") or {}).get("axles", {}).values()
    free = {wheel for axle in axles if axle.get("driven") is False for wheel in axle["wheels"]}
    every = tuple(wheels)
    return tuple(wheel for wheel in every if wheel not in free) or every
