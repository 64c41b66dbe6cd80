"""What `terragrip inspect` proposes of logs whose truth is known, judged leaving one logger out at a time.

    python benchmarks/bench_inspect.py [--write]

Every logger is judged by the vocabulary without the words that it alone contributed: those of its headers that stand in no other
logger's, nor in Terragrip's channels and units, the table of J1939, ISO 11783 and NMEA 2000, or the shipped profiles. ``--write`` puts
the table into docs/inspect.md. Logs: the folder shared/data beside the project, and the headers that made_up_loggers.py makes up.
"""

from __future__ import annotations

import json
import os
import re
import sys
import tempfile
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

import made_up_loggers
from marked import put
from terragrip.errors import InputError
from terragrip.formats.channel_proposal import Proposal
from terragrip.formats.profile import SHIPPED, Profile
from terragrip.formats.reading import read_log
from terragrip.formats.seen import Seen
from terragrip.formats.vocabulary import GENERAL, UNIT_WORDS, Vocabulary, words_of
from terragrip.recording.schema import CHANNELS, TIME, WHEEL_CHANNELS
from terragrip.units import UnitError, parse_unit

ROOT = Path(__file__).parents[1]
DATA = Path(os.environ.get("TERRAGRIP_SHARED") or ROOT.parent / "shared") / "data"
PAGE = ROOT / "docs" / "inspect.md"
ORDER = ("right", "right, with a ?", "left open", "wrong, with a ?", "wrong and sure")
ONE_LOGGER = {
    "01": "robotino",
    "02": "robotino",
    **dict.fromkeys(("03", "04", "05", "06", "07", "08"), "rostopic echo"),
}

# The other folders: file, and which column is which channel in which unit, by their PROVENANCE.md and the examples' profiles.
OTHERS: dict[str, dict[str, tuple[object, str | None]]] = {
    "alostar_4wd/log90-2.txt": {
        "time": ("t", "s"), "roll": ("roll", "deg"), "pitch": ("pitch", "deg"),
        **{f"wheel_speed_{k}": (f"Q{k}", None) for k in range(1, 5)}, **{f"drive_torque_{k}": (f"M{k}", None) for k in range(1, 5)},
        **{f"acceleration_{a}": (f"a{a}", "m/s^2") for a in "xyz"}, **{f"angular_velocity_{a}": (f"w{a}", "deg/s") for a in "xyz"},
        "ground_speed": (["x", "y"], "m"),
    },
    "borealtc_husky/pro/ICE/pro_01.csv": {
        "time": ("time", "s"), "wheel_speed_l": ("velL", "m/s"), "wheel_speed_r": ("velR", "m/s"),
        "drive_torque_l": ("curL", "A"), "drive_torque_r": ("curR", "A"),
    },
    "drive_warthog/raw20hz/warthog_wheels_grass.csv.gz": {
        "time": (["time_s", "unix_ns"], "s"), "wheel_speed_l": ("meas_left_vel", "rad/s"), "wheel_speed_r": ("meas_right_vel", "rad/s"),
        "drive_torque_l": ("left_wheel_current", "A"), "drive_torque_r": ("right_wheel_current", "A"),
        "ground_speed": (["icp_pos_x", "icp_pos_y"], "m"), **{f"acceleration_{a}": (f"imu_acceleration_{a}", "m/s^2") for a in "xyz"},
        **{f"angular_velocity_{a}": (f"imu_{a}", "rad/s") for a in "xyz"},
        "pitch": (["icp_quat_x", "icp_quat_y", "icp_quat_z", "icp_quat_w"], None),
    },
    "pathfinder_rover/test17run_odom_gps_10hz.csv.gz": {
        "time": (["time_s", "unix_s"], "s"), **{f"wheel_speed_{w}": (f"w_{w}", "rad/s") for w in ("fl", "fr", "rl", "rr")},
        "ground_speed": (["gps_e", "gps_n"], "m"), "wheel_based_speed": ("odom_vx", "m/s"), "angular_velocity_z": ("odom_wz", "rad/s"),
        "latitude": ("lat_rad", "rad"), "longitude": ("lon_rad", "rad"), "altitude": ("h_m", "m"),
    },
    "pathfinder_rover/test17run_imu_50hz.csv.gz": {
        "time": ("time_s", "s"), **{f"acceleration_{a}": (f"a{a}", "m/s^2") for a in "xyz"},
        **{f"angular_velocity_{a}": (f"g{a}", "rad/s") for a in "xyz"},
    },
    "tractor_t7/session2_hour.csv.gz": {
        "time": ("timestamps", None), "wheel_based_speed": ("CAN1.CCVS1.WheelBasedVehicleSpeed", "km/h"),
        "ground_speed": ("CAN2.gnss_speed.Speed", "m/s"), "latitude": ("CAN2.gnss_pos.Latitude", "deg"),
        "longitude": ("CAN2.gnss_pos.Longitude", "deg"), "engine_speed": ("CAN1.EEC1.EngineSpeed", "rpm"),
        "engine_torque_share": ("CAN1.EEC1.ActualEnginePercentTorque", "%"),
        "engine_friction_share": ("CAN1.EEC3.NominalFrictionPercentTorque", "%"), "fuel_rate": ("CAN1.LFE1.EngineFuelRate", "l/h"),
    },
}  # fmt: skip


@dataclass
class Case:
    """A log, who wrote it, and the truth: channel, the columns that may stand for it, unit (None: not judged)."""

    file: str
    logger: str
    truth: dict[str, tuple[list[list[str]], str | None]]
    columns: tuple[str, ...] = ()
    seen: Seen | None = None
    refused: str = ""
    counts: Counter[str] = field(default_factory=Counter)
    lines: list[str] = field(default_factory=list)


def main() -> None:
    """Judge every log, print the table, and what is not right."""
    cases = _cases()
    made_up = made_up_cases()
    table = "\n".join([*_table(cases), *_made_up_table(made_up)])
    cases += made_up
    print(table)
    for case in cases:
        for line in case.lines:
            print(f"{case.file}: {line}")
    if "--write" in sys.argv:
        put(PAGE, "<!-- bench_inspect -->", table)


def judged(*, headers_only: bool = False) -> Counter[str]:
    """How many channels were right, wrong and left open, in all."""
    cases = (case for case in _cases() if case.file.startswith("headers/") or not headers_only)
    return sum((case.counts for case in cases), Counter())


def _cases() -> list[Case]:
    cases = [*_headers(), *_others()]
    for case in cases:
        _open(case)
    for case in cases:
        _judge(case, _vocabulary(case, cases))
    return cases


def made_up_cases() -> list[Case]:
    """The loggers of made_up_loggers.py, judged with all words: nothing in them showed us any."""
    result = []
    with tempfile.TemporaryDirectory() as folder:
        for logger in made_up_loggers.loggers():
            case = Case(logger, logger, made_up_loggers.truth(logger))
            _judge(case, GENERAL, made_up_loggers.write(logger, Path(folder)))
            result.append(case)
    return result


def _headers() -> list[Case]:
    folder = DATA / "headers"
    truth = json.loads((folder / "truth.json").read_text())
    result = []
    for file, channels in truth.items():
        own: dict[str, tuple[list[list[str]], str | None]] = {}
        for channel, entry in channels.items():
            ways = [_list(entry["from"])]
            if "alternative" in entry:
                ways.append([re.sub(r"\s*\(.*", "", entry["alternative"])])
            if channel == TIME:
                ways += [[part] for part in ways[0]] if len(ways[0]) > 1 else []
            own[_plain(channel)] = (ways, entry["unit"])
        result.append(Case(f"headers/{file}", ONE_LOGGER.get(file[:2], file), own))
    return result


def _others() -> list[Case]:
    return [
        Case(
            f,
            f.split("/")[0],
            {
                _plain(c): ([_list(w)] + ([[p] for p in w] if c == TIME and isinstance(w, list) else []), u)
                for c, (w, u) in t.items()
            },
        )
        for f, t in OTHERS.items()
    ]


def _open(case: Case) -> None:
    try:
        log = read_log(DATA / case.file)
    except InputError as error:
        case.refused = str(error)
        return
    case.seen = Seen.of(log)
    case.columns = tuple(case.seen.columns)


def _judge(case: Case, vocabulary: Vocabulary, path: Path | None = None) -> None:
    if path is None and case.seen is None:
        case.counts["left open"] += len(case.truth)
        case.lines.append(f"refused: {case.refused.split(': ', 1)[-1]}")
        return
    seen = Seen.of(read_log(path or DATA / case.file), vocabulary=vocabulary)
    proposals = dict(seen.proposals(vocabulary))
    if seen.stamp is not None:
        proposals[TIME] = Proposal({"from": seen.stamp[0]}, unit=seen.stamp[1])
    proposals.pop("soil", None)
    for channel in sorted(case.truth.keys() | proposals.keys()):
        kind, estimated = _verdict(channel, case.truth, proposals)
        case.counts[kind] += 1
        if kind != "right":
            case.lines.append(f"{channel} {kind}: {estimated}")


def _verdict(
    channel: str, truth: dict[str, tuple[list[list[str]], str | None]], proposals: dict[str, Proposal]
) -> tuple[str, str]:
    made = proposals.get(channel)
    if channel not in truth and channel == "wheel_based_speed" and "wheel_speed_wheel" in truth:
        return "right" if not made.doubt else "right, with a ?", "of the only wheel"  # type: ignore[union-attr]
    if channel == "wheel_speed_wheel" and "wheel_based_speed" in proposals:
        return _verdict("wheel_based_speed", {"wheel_based_speed": truth[channel]}, proposals)
    if made is None:
        return "left open", f"was {truth[channel][0][0]}"
    columns = sorted(_bare(c) for c in made.columns)
    ways, unit = truth.get(channel, ([], None))
    as_read = sorted(made.columns)  # the reader has the unit off: Speed (OBD) of Speed (OBD)(km/h)
    same = any(sorted(_bare(c) for c in way) in (columns, as_read) for way in ways)
    right = same and (unit is None or channel == TIME or _alike(made.unit, unit))
    sentence = (
        f"{made.columns} in {made.unit}"
        + (f", was {ways[0]} in {unit}" if ways else ", was none")
        + (f" ({made.doubt})" if made.doubt else "")
    )
    if right:
        return ("right, with a ?" if made.doubt else "right"), sentence
    return ("wrong, with a ?" if made.doubt else "wrong and sure"), sentence


def _alike(made: str | None, true: str) -> bool:
    if true in ("A", "10 mA") and made is None:
        return True  # a current, whose scale the user gives
    if made is None:
        return False
    if true.startswith("arc minutes"):
        return made == "deg"  # as the reader gives them
    try:
        return parse_unit(made.replace("²", "^2")) == parse_unit(true) or made == true
    except UnitError:
        return made == true


def _vocabulary(case: Case, cases: list[Case]) -> Vocabulary:
    """The vocabulary without the words that this logger alone contributed."""
    own = _words(c for one in cases if one.logger == case.logger for c in one.columns)
    others = _words(c for one in cases if one.logger != case.logger for c in one.columns)
    return GENERAL.without(
        word for word in own - others - _standard() if len(word) > 1
    )  # letters are no words


def _words(columns: Iterable[str]) -> frozenset[str]:
    result: set[str] = set()
    for column in columns:
        for word in words_of(column):
            result |= {word, *_whole(word)}
    return frozenset(result)


@cache
def _whole(word: str) -> frozenset[str]:
    """What a word is read by; nothing of one cut short, which shows the rule of cutting, not the whole word."""
    read = GENERAL.known_in(word)
    return frozenset() if all(len(known) > len(word) for known in read) else read


@cache
def _standard() -> frozenset[str]:
    """Words that stand outside all loggers: our channels, the bus tables, the shipped profiles."""
    names = [*CHANNELS, *WHEEL_CHANNELS, TIME]
    for name in SHIPPED:
        for source in Profile.load(name).channels.values():
            names += [column for one in source.chain for column in one.columns]
    table = (ROOT / "src/terragrip/formats/can/j1939.yaml").read_text()
    names += re.findall(r"^ +(?:name: )?([A-Z]\w+)", table, re.MULTILINE)
    return _words(names) | {unit.replace(" ", "").lower() for unit in UNIT_WORDS.values()}


def _plain(channel: str) -> str:
    return re.sub(r"_(left|right)$", lambda match: f"_{match[1][0]}", channel)


def _list(value: object) -> list[str]:
    return [str(v) for v in value] if isinstance(value, list) else [str(value)]


def _bare(column: str) -> str:
    return (
        re.sub(r"\s*[\[(][^()\[\]]*[\])]?$", "", column).strip(" #")
        if not column.endswith(")") or "(GT" not in column
        else column
    )


def _made_up_table(cases: list[Case]) -> list[str]:
    lines = []
    for held in (False, True):
        chosen = [c for c in cases if made_up_loggers.is_held_out(c.file) == held]
        title = "made up, looked at once" if held else "made up, looked at while repairing"
        lines += _total(f"{len(chosen)} headers {title}", chosen)
    return lines


def _total(title: str, cases: list[Case]) -> list[str]:
    total = sum((c.counts for c in cases), Counter())
    channels = sum(len(c.truth) for c in cases)
    share = (total["right"] + total["right, with a ?"]) / channels
    counts = " | ".join(f"**{total[k]}**" for k in ORDER)
    return [
        f"| **{title}: {channels} channels** | {counts} |",
        f"| right of {channels}: {100 * share:.0f} %, without a ? {100 * total['right'] / channels:.0f} % |"
        + " |" * len(ORDER),
    ]


def _table(cases: list[Case]) -> list[str]:
    lines = ["| log | " + " | ".join(ORDER) + " |", "|---|" + "---:|" * len(ORDER)]
    for folder in ("headers", ""):
        chosen = [c for c in cases if c.file.startswith("headers/") == bool(folder)]
        for case in chosen:
            name = case.file.removeprefix("headers/") + (" (refused)" if case.refused else "")
            lines.append(f"| {name} | " + " | ".join(str(case.counts[k] or "") for k in ORDER) + " |")
        lines += _total("24 headers" if folder else "the other folders", chosen)
    return lines


if __name__ == "__main__":
    main()
