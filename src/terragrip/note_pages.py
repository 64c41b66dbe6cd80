"""The page of the documentation that explains a note: by words that the note's text holds, the first that fit."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

PAGES = (
    ("is a guess from the vehicle's size", "vehicle#noise-of-the-sensors"),
    ("a vehicle's own lag is", "formats#two-sources-of-one-drive"),
    ("or left and right wheels, may be exchanged", "formats#what-the-motion-contradicts"),
    ("the slower one pull", "formats#what-the-motion-contradicts"),
    ("of the axle's other wheel rises", "formats#what-the-motion-contradicts"),
    ("Straight ahead", "formats#what-the-motion-contradicts"),
    ("Against the direction of travel", "formats#what-the-motion-contradicts"),
    ("by the force that these require", "formats#what-the-motion-contradicts"),
    ("times the weight on average", "formats#what-the-motion-contradicts"),
    ("times as far as ground_speed does", "formats#what-the-motion-contradicts"),
    ("where the wheels are driven harder", "formats#what-the-motion-contradicts"),
    ("the force that moves", "formats#what-the-motion-contradicts"),
    ("where the vehicle is driven harder", "formats#what-the-motion-contradicts"),
    ("the other wheels' torques vary with", "formats#what-the-motion-contradicts"),
    ("the two axes may be exchanged", "formats#what-the-motion-contradicts"),
    ("climbs that vary with roll", "formats#what-the-motion-contradicts"),
    ("while the vehicle drives: the sensor", "formats#what-the-motion-contradicts"),
    ("does not show which of them is wrong", "formats#what-the-motion-contradicts"),
    ("is not the change of ground speed", "formats#what-the-motion-contradicts"),
    ("where the accelerometer shows a climb", "formats#what-the-motion-contradicts"),
    ("may be in km/h", "formats#in-a-profile"),
    ("converted from km/h", "formats#in-a-profile"),
    ("times the ground speed", "formats#in-a-profile"),
    ("may be in g", "formats#in-a-profile"),
    ("may be in degrees", "formats#in-a-profile"),
    ("must be in degrees", "formats#in-a-profile"),
    ("the axes point the other way", "formats#in-a-profile"),
    ("write 'sign: -1'", "formats#in-a-profile"),
    ("time may not be in seconds", "formats#in-a-profile"),
    ("written as hhmmss", "formats#dates"),
    ("angular_velocity_z turns with", "formats#in-a-profile"),
    ("the sensor is dead", "formats#what-the-motion-contradicts"),
    ("while other ", "formats#what-the-motion-contradicts"),
    ("the wheel is locked, or its sensor", "formats#what-the-motion-contradicts"),
    ("the wheels are locked, or their sensors", "formats#what-the-motion-contradicts"),
    ("all wheels turn: the vehicle is stuck, or its sensor", "formats#what-the-motion-contradicts"),
    ("the vehicle pulls or climbs: no drive", "formats#what-the-motion-contradicts"),
    ("the wheels drive on as hard as before", "formats#what-the-motion-contradicts"),
    ("neither the motion nor another force answers", "formats#what-the-motion-contradicts"),
    (": its scale changed, and", "formats#what-the-motion-contradicts"),
    ("in all rows, which no cell reads", "formats#what-the-motion-contradicts"),
    ("the zero of drawbar_force drifts", "formats#what-the-motion-contradicts"),
    ("is by its name the torque of an axle", "vehicle#signals-that-are-missing"),
    ("pull, which no wheel that pulls does:", "formats#what-the-motion-contradicts"),
    ("its sign is wrong there, ", "formats#what-the-motion-contradicts"),
    ("while all other torques are not", "formats#what-the-motion-contradicts"),
    ("the logger hung, it seems", "formats#what-the-motion-contradicts"),
    ("while it keeps one value", "formats#what-the-motion-contradicts"),
    ("a code for ", "formats#in-a-profile"),
    ("more than any ground allows", "formats#what-the-motion-contradicts"),
    ("where ground and wheels drove", "formats#in-a-profile"),
    ("Give a speed over ground: from", "formats#what-the-motion-contradicts"),
    ("what the drawbar force does", "formats#what-the-motion-contradicts"),
    ("in reverse turns", "formats#what-the-motion-contradicts"),
    ("its sensor is dead", "formats#what-the-motion-contradicts"),
    ("Columns that are not used", "formats#in-a-profile"),
    ("the vehicle is assumed to tow nothing", "vehicle#signals-that-are-missing"),
    ("No drive torque was found", "vehicle#signals-that-are-missing"),
    ("No acceleration_x was found", "vehicle#signals-that-are-missing"),
    ("No pitch was found", "vehicle#signals-that-are-missing"),
    ("No ground speed was found", "vehicle#signals-that-are-missing"),
    ("No wheel speed was found", "vehicle#signals-that-are-missing"),
    ("There is no drive torque", "formats#a-stock-tractor-slip-from-its-bus"),
    ("no signal shows how fast the machine turned", "formats#a-stock-tractor-slip-from-its-bus"),
    ("also record 40 s without load", "formats#a-stock-tractor-slip-from-its-bus"),
    ("too short to determine the zero-slip radius", "formats#a-stock-tractor-slip-from-its-bus"),
    ("The rims read 0 in", "formats#a-stock-tractor-slip-from-its-bus"),
    ("is the engine's through the driveline", "vehicle#engine-torque-in-place-of-wheel-torques"),
    ("the pull of a tool is part of soil_resistance", "vehicle#engine-torque-in-place-of-wheel-torques"),
    ("The engine's own friction is not in the log", "vehicle#engine-torque-in-place-of-wheel-torques"),
    ("frames are in no DBC or table", "formats#can-logs"),
    ("of the DBC's messages occurs in the log", "formats#can-logs"),
    ("There is no time vector beside", "formats#matlab-and-simulink"),
    ("Not series of plain numbers", "formats#matlab-and-simulink"),
    ("The last row is cut off", "formats#damaged-files-and-large-ones"),
    ("are damaged and were left out", "formats#damaged-files-and-large-ones"),
    ("The file ends early, or is damaged", "formats#damaged-files-and-large-ones"),
    ("cannot be read and were left out", "formats#damaged-files-and-large-ones"),
    ("No soil of the library fits", "ground#limits"),
    ("of the drive shows the ground", "ground#limits"),
    ("too short for vehicle and tool", "ground#limits"),
    ("s behind the wheels and are shifted by it", "maps#what-a-cell-holds"),
    ("of the positions, ", "maps#what-a-cell-holds"),
    ("of the positions cut", "maps#what-a-cell-holds"),
    ("passes over one cell agree better", "maps#what-a-cell-holds"),
    ("Every cell was driven once", "maps#anomalies-and-changes"),
    ("bins of slip gather weak spots", "soils#by-pull-and-by-slip"),
    ("no interval can be determined", "soils#what-is-done"),
    ("they do not cover the differences between runs", "soils#what-is-done"),
)
"""Words of a note, and page#heading as in ``InputError(page=...)``."""

_CONTRADICTED = ("formats#what-the-motion-contradicts", "formats#in-a-profile")
_NO_FAULT = "Columns that are not used"
_SHOWN = 5  # runs


def with_page(note: str) -> str:
    """The note, and the page that explains it where there is one and the note does not name it itself."""
    page = None if "(docs: " in note else _page(note)
    return note if page is None else f"{note} (docs: {page})"


def doubts_of(runs: Iterable[tuple[str, Sequence[str]]]) -> list[str]:
    """Of runs, by name, with the notes of their estimates, what the log contradicted: for each of the first five its first such note, and
    the number of the others. What is made of such estimates is as wrong as they are."""
    found = [
        f"{name}: {note}"
        for name, notes in runs
        for note in [one for one in notes if _page(one) in _CONTRADICTED and not one.startswith(_NO_FAULT)][
            :1
        ]
    ]
    more = len(found) - _SHOWN
    words = f"{more} more run{'s have' if more > 1 else ' has'} such notes; 'terragrip report' shows them."
    return found[:_SHOWN] + [words] * (more > 0)


def _page(note: str) -> str | None:
    return next((page for words, page in PAGES if words in note), None)
