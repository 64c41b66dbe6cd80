"""The BorealTC runs (Husky, five grounds; ../shared/data) as tables with recording columns."""

from __future__ import annotations

import os
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import pandas as pd

SHARED = Path(os.environ.get("TERRAGRIP_SHARED") or Path(__file__).resolve().parents[2] / "shared")
FOLDER = SHARED / "data" / "borealtc_husky"
WHEEL_RADIUS = 0.165  # m; any other would only shift what is learnt
WHEELS = {
    "velL": "wheel_speed_left",
    "velR": "wheel_speed_right",
    "curL": "motor_current_left",
    "curR": "motor_current_right",
}
BODY = {
    f"{short}{axis}": f"{name}_{axis}"
    for short, name in (("w", "angular_velocity"), ("a", "acceleration"))
    for axis in "xyz"
}


@dataclass(frozen=True)
class Run:
    """One run: its ground, its number, its table, its length [s], and whether its body sensor's file is there."""

    ground: str
    number: str
    table: pd.DataFrame
    length: float
    with_body: bool


def runs() -> list[Run]:
    """All labelled runs, by ground and number; the wheels' rows (6.5 Hz) and the body's (100 Hz) in one table."""
    return [run(path) for path in sorted(FOLDER.glob("pro/*/pro_*.csv")) if path.parent.name != "MIXED"]


def run(path: Path) -> Run:
    """The run of one pro/<GROUND>/pro_<number>.csv."""
    ground, number = path.parent.name, path.stem.removeprefix("pro_")
    table = pd.read_csv(path).rename(columns=WHEELS).set_index("time")
    table[["wheel_speed_left", "wheel_speed_right"]] /= WHEEL_RADIUS
    length = float(table.index[-1]) + 1 / 6.5
    imu = FOLDER / "imu" / ground / f"imu_{number}.csv.gz"
    if imu.exists():
        body = pd.read_csv(imu).rename(columns=BODY).set_index("time")
        length = float(body.index[-1]) + 0.01
        table = pd.concat([table, body], axis=1).sort_index()
    return Run(ground, number, table.rename_axis("time").reset_index(), length, imu.exists())


def partitions(of: Run, seconds: float = 5.0) -> list[pd.DataFrame]:
    """The run cut into whole stretches of ``seconds``; what remains at its end is dropped, as in the paper."""
    time = of.table["time"].to_numpy()
    count = int((of.length + 1e-6) // seconds)
    cuts = time.searchsorted([k * seconds - 1e-6 for k in range(count + 1)])
    return [of.table.iloc[a:b] for a, b in pairwise(cuts)]
