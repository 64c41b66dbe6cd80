"""The page of the documentation that explains a note: by words that the note's text holds, the first that fit."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

PAGES = (
    ("is a guess from the vehicle's size", "vehicle#noise-of-the-sensors"),
    ("times what the vehicle file states", "vehicle#noise-of-the-sensors"),
    ("where a machine of its mass and wheels has", "vehicle#all-keys"),
    ("is taken as measured at the antenna", "vehicle#where-the-ground-speed-is-measured"),
    ("the vehicle's own lag is", "formats#two-sources-of-one-drive"),
    ("or left and right wheels, may be exchanged", "checks#signs-exchanged-channels-copies"),
    ("the slower one pull", "checks#signs-exchanged-channels-copies"),
    ("of the axle's other wheel rises", "checks#signs-exchanged-channels-copies"),
    ("Straight ahead", "checks#units-scales-and-zeros"),
    ("Against the direction of travel", "checks#signs-exchanged-channels-copies"),
    ("by the force that these require", "checks#units-scales-and-zeros"),
    ("times the weight on average", "checks#units-scales-and-zeros"),
    ("times as far as ground_speed does", "checks#units-scales-and-zeros"),
    ("where the wheels are driven harder", "checks#signs-exchanged-channels-copies"),
    ("the force that moves", "checks#units-scales-and-zeros"),
    ("where the vehicle is driven harder", "checks#signs-exchanged-channels-copies"),
    ("the other wheels' torques vary with", "checks#signs-exchanged-channels-copies"),
    ("the two axes may be exchanged", "checks#signs-exchanged-channels-copies"),
    ("climbs that vary with roll", "checks#signs-exchanged-channels-copies"),
    ("while the vehicle drives: the sensor", "checks#channels-that-are-dead-held-or-cut"),
    ("does not show which of them is wrong", "checks#a-part-of-the-drive"),
    ("is not the change of ground speed", "checks#units-scales-and-zeros"),
    ("where the accelerometer shows a climb", "checks#units-scales-and-zeros"),
    ("may be in km/h", "formats#in-a-profile"),
    ("converted from km/h", "formats#in-a-profile"),
    ("times the ground speed", "formats#in-a-profile"),
    ("may be in g", "formats#in-a-profile"),
    ("may be in degrees", "formats#in-a-profile"),
    ("must be in degrees", "formats#in-a-profile"),
    ("the axes point the other way", "formats#in-a-profile"),
    ("write 'sign: -1'", "formats#in-a-profile"),
    ("a scale of 1 makes 1 N m", "formats#in-a-profile"),
    ("time may not be in seconds", "formats#in-a-profile"),
    ("written as hhmmss", "formats#dates"),
    ("angular_velocity_z turns with", "formats#in-a-profile"),
    ("the sensor is dead", "checks#channels-that-are-dead-held-or-cut"),
    ("while other ", "checks#channels-that-are-dead-held-or-cut"),
    ("the wheel is locked, or its sensor", "checks#channels-that-are-dead-held-or-cut"),
    ("the wheels are locked, or their sensors", "checks#channels-that-are-dead-held-or-cut"),
    ("all wheels turn: the vehicle is stuck, or its sensor", "checks#channels-that-are-dead-held-or-cut"),
    ("the vehicle pulls or climbs: no drive", "checks#channels-that-are-dead-held-or-cut"),
    ("the wheels drive on as hard as before", "checks#channels-that-are-dead-held-or-cut"),
    ("neither the motion nor another force answers", "checks#a-part-of-the-drive"),
    ("from one sample to the next, and other wheels", "checks#a-part-of-the-drive"),
    (": its scale changed, ", "checks#a-part-of-the-drive"),
    ("in all rows, which no cell reads", "checks#channels-that-are-dead-held-or-cut"),
    ("no ground pushes a vehicle", "checks#units-scales-and-zeros"),
    ("the zero of drawbar_force drifts", "checks#a-part-of-the-drive"),
    ("is by its name the torque of an axle", "vehicle#signals-that-are-missing"),
    ("pull, which no wheel that pulls does:", "checks#a-part-of-the-drive"),
    ("its sign is wrong there, ", "checks#a-part-of-the-drive"),
    ("while all other torques are not", "checks#channels-that-are-dead-held-or-cut"),
    ("the logger hung, it seems", "checks#channels-that-are-dead-held-or-cut"),
    ("for the next pulse", "checks#channels-that-are-dead-held-or-cut"),
    ("as pulses counted in each row", "checks#channels-that-are-dead-held-or-cut"),
    ("while it keeps one value", "checks#channels-that-are-dead-held-or-cut"),
    ("a code for ", "formats#in-a-profile"),
    ("more than any ground allows", "checks#times"),
    ("where ground and wheels drove", "formats#in-a-profile"),
    ("Give a speed over ground: from", "checks#signs-exchanged-channels-copies"),
    ("what the drawbar force does", "checks#units-scales-and-zeros"),
    ("in reverse turns", "checks#signs-exchanged-channels-copies"),
    ("its sensor is dead", "checks#channels-that-are-dead-held-or-cut"),
    ("as wheels that steer do", "checks#signs-exchanged-channels-copies"),
    ("of the driving the joint bends", "vehicle#machines-of-other-layouts"),
    ("if it is a trailer's", "vehicle#machines-of-other-layouts"),
    ("does not drive in crab", "formats#in-a-profile"),
    ("is wrong: check ", "formats#in-a-profile"),
    ("Columns that are not used", "formats#in-a-profile"),
    ("A brake acts in", "vehicle#brakes"),
    ("as by a friction brake", "vehicle#brakes"),
    ("the vehicle is assumed to tow nothing", "vehicle#signals-that-are-missing"),
    ("No drive torque is recognised", "vehicle#signals-that-are-missing"),
    ("No acceleration_x is recognised", "vehicle#signals-that-are-missing"),
    ("No pitch is recognised", "vehicle#signals-that-are-missing"),
    ("No ground speed is recognised", "vehicle#signals-that-are-missing"),
    ("The vehicle file has no wheel", "vehicle#signals-that-are-missing"),
    ("are efforts of joints", "formats#ros-bags-and-mcap"),
    ("a number that overflows", "checks#channels-that-are-dead-held-or-cut"),
    ("No wheel speed is recognised", "vehicle#signals-that-are-missing"),
    ("There is no drive torque", "formats#a-stock-tractor-slip-from-its-bus"),
    ("no signal shows how fast the machine turned", "formats#a-stock-tractor-slip-from-its-bus"),
    ("also record 40 s without load", "formats#a-stock-tractor-slip-from-its-bus"),
    ("too short to determine the zero-slip radius", "formats#a-stock-tractor-slip-from-its-bus"),
    ("The rims read 0 in", "formats#a-stock-tractor-slip-from-its-bus"),
    ("is the engine's through the driveline", "vehicle#engine-torque-in-place-of-wheel-torques"),
    ("with a 'driveline' in the vehicle file", "vehicle#engine-torque-in-place-of-wheel-torques"),
    ("The drive torques read the same in", "checks#units-scales-and-zeros"),
    ("if it is of the load alone", "vehicle#a-mass-that-changes"),
    ("places a payload, but the log has no mass", "vehicle#a-mass-that-changes"),
    ("The engine's own friction is not in the log", "vehicle#engine-torque-in-place-of-wheel-torques"),
    ("frames are in no DBC or table", "formats#can-logs"),
    ("of the DBC's messages occurs in the log", "formats#can-logs"),
    ("There is no time vector beside", "formats#matlab-and-simulink"),
    ("Not series of plain numbers", "formats#matlab-and-simulink"),
    ("The last row is cut off", "formats#damaged-files-and-large-ones"),
    ("are damaged and were left out", "formats#damaged-files-and-large-ones"),
    ("ends early, or is damaged", "formats#damaged-files-and-large-ones"),
    (", and was left out", "formats#damaged-files-and-large-ones"),
    ("what that part of the bag holds", "formats#ros-bags-and-mcap"),
    ("may be one component of a velocity", "checks#units-scales-and-zeros"),
    ("is mixed; cut the log there", "formats#ros-bags-and-mcap"),
    ("The log has several machines", "formats#ros-bags-and-mcap"),
    ("cannot be read and were left out", "formats#damaged-files-and-large-ones"),
    ("No soil of the library fits", "ground#limits"),
    ("of the drive shows the ground", "ground#limits"),
    ("too short for vehicle and tool", "ground#limits"),
    ("may be a tool's, lowered or raised", "ground#a-tools-changes"),
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

_CONTRADICTED = ("checks#", "formats#in-a-profile")
_NO_FAULT = "Columns that are not used"
_OF_SCALE = ("checks#units-scales", "checks#signs", "formats#in-a-profile")
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
        for note in [
            one
            for one in notes
            if (_page(one) or "").startswith(_CONTRADICTED) and not one.startswith(_NO_FAULT)
        ][:1]
    ]
    more = len(found) - _SHOWN
    words = f"{more} more run{'s have' if more > 1 else ' has'} such notes; 'terragrip report' shows them."
    return found[:_SHOWN] + [words] * (more > 0)


def is_of_scale(note: str) -> bool:
    """Whether a note is on a unit, a scale, a zero or a sign: estimates that cannot be follow from it."""
    return (_page(note) or "").startswith(_OF_SCALE) and not note.startswith(_NO_FAULT)


def _page(note: str) -> str | None:
    return next((page for words, page in PAGES if words in note), None)
