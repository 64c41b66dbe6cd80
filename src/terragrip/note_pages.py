"""The page of the documentation that explains a note: by words that the note's text holds, the first that fit."""

from __future__ import annotations

PAGES = (
    ("is a guess from the vehicle's size", "vehicle#noise-of-the-sensors"),
    ("a vehicle's own lag is", "formats#two-sources-of-one-drive"),
    ("the force that moves", "formats#what-the-motion-contradicts"),
    ("where the vehicle is driven harder", "formats#what-the-motion-contradicts"),
    ("which no ground lets them", "formats#what-the-motion-contradicts"),
    ("the other wheels' torques go with", "formats#what-the-motion-contradicts"),
    ("the two axes may be exchanged", "formats#what-the-motion-contradicts"),
    ("climbs that go with roll", "formats#what-the-motion-contradicts"),
    ("while the vehicle drives: a sensor", "formats#what-the-motion-contradicts"),
    ("does not show which of them is wrong", "formats#what-the-motion-contradicts"),
    ("is not the change of ground speed", "formats#what-the-motion-contradicts"),
    ("where the accelerometer shows a climb", "formats#what-the-motion-contradicts"),
    ("may be in km/h", "formats#in-a-profile"),
    ("taken for km/h", "formats#in-a-profile"),
    ("times the ground speed", "formats#in-a-profile"),
    ("may be in g", "formats#in-a-profile"),
    ("may be in degrees", "formats#in-a-profile"),
    ("must be in degrees", "formats#in-a-profile"),
    ("the axes point the other way", "formats#in-a-profile"),
    ("write 'sign: -1'", "formats#in-a-profile"),
    ("time may not be in seconds", "formats#in-a-profile"),
    ("angular_velocity_z turns with", "formats#in-a-profile"),
    ("Columns that are not used", "formats#in-a-profile"),
    ("the vehicle is taken to tow nothing", "vehicle#signals-that-are-missing"),
    ("No drive torque was found", "vehicle#signals-that-are-missing"),
    ("No acceleration_x was found", "vehicle#signals-that-are-missing"),
    ("No pitch was found", "vehicle#signals-that-are-missing"),
    ("No ground speed was found", "vehicle#signals-that-are-missing"),
    ("No wheel speed was found", "vehicle#signals-that-are-missing"),
    ("There is no drive torque", "formats#a-stock-tractor-slip-from-its-bus"),
    ("nothing says how fast the machine turned", "formats#a-stock-tractor-slip-from-its-bus"),
    ("record 40 s without load too", "formats#a-stock-tractor-slip-from-its-bus"),
    ("too short to tell the zero-slip radius", "formats#a-stock-tractor-slip-from-its-bus"),
    ("The rims read 0 in", "formats#a-stock-tractor-slip-from-its-bus"),
    ("is the engine's through the driveline", "vehicle#engine-torque-in-place-of-wheel-torques"),
    ("what a tool pulls is in soil_resistance", "vehicle#engine-torque-in-place-of-wheel-torques"),
    ("The engine's own friction is not in the log", "vehicle#engine-torque-in-place-of-wheel-torques"),
    ("frames are in no DBC or table", "formats#can-logs"),
    ("of the DBC's messages occurs in the log", "formats#can-logs"),
    ("No time vector stands beside", "formats#matlab-and-simulink"),
    ("What is no series of plain numbers was left out", "formats#matlab-and-simulink"),
    ("The last row is cut off", "formats#damaged-files-and-large-ones"),
    ("are damaged and were left out", "formats#damaged-files-and-large-ones"),
    ("The file ends early, or is damaged", "formats#damaged-files-and-large-ones"),
    ("cannot be read and were left out", "formats#damaged-files-and-large-ones"),
    ("No soil of the library fits", "ground#limits"),
    ("of the drive tells of the ground", "ground#limits"),
    ("too short for vehicle and tool", "ground#limits"),
    ("s behind the wheels and are shifted by it", "maps#what-a-cell-holds"),
    ("of the positions, ", "maps#what-a-cell-holds"),
    ("of the positions cut", "maps#what-a-cell-holds"),
    ("passes over one cell agree better", "maps#what-a-cell-holds"),
    ("Every cell was driven once", "maps#anomalies-and-changes"),
    ("bins of slip gather weak spots", "soils#by-pull-and-by-slip"),
    ("no interval can be determined", "soils#what-is-done"),
    ("they do not hold how much runs differ", "soils#what-is-done"),
)
"""Words of a note, and page#heading as in ``InputError(page=...)``."""


def with_page(note: str) -> str:
    """The note, and the page that explains it where there is one and the note does not name it itself."""
    page = None if "(docs: " in note else next((page for words, page in PAGES if words in note), None)
    return note if page is None else f"{note} (docs: {page})"
