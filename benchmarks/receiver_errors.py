"""How long the errors of a measured receiver last: comma2k19's receiver against the car's wheels, on a road.

    python benchmarks/receiver_errors.py [--data ../shared/data]

The wheels' mean speed, shifted and scaled to fit best, is the reference: its own errors and changes of slip count as the
receiver's. A line for each speed: rate, lag, standard deviation of the difference, and its correlation with itself some
seconds later. The root of that correlation is the share of the noise's SD that lasts so long (tg_tuned: slow_share).
"""

from __future__ import annotations

import argparse
import os
from pathlib import Path

import numpy as np
import numpy.typing as npt

TOP = Path(__file__).resolve().parents[1]
SHARED = Path(os.environ.get("TERRAGRIP_SHARED") or TOP.parent / "shared")
LAGS = np.arange(-1.0, 1.01, 0.05)  # s
LATER = (0.5, 1.0, 2.0, 5.0, 10.0)  # s
Floats = npt.NDArray[np.float64]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--data", type=Path, default=SHARED / "data")
    folder = parser.parse_args().data / "ingest_samples" / "comma2k19_example"
    load = {path.stem: np.load(path) for path in folder.glob("*.npy")}
    wheel = load["processed_log__CAN__wheel_speed__t"], load["processed_log__CAN__wheel_speed__value"].mean(1)
    receiver = "processed_log__GNSS__live_gnss_ublox__"
    speeds = {
        "receiver": (load[f"{receiver}t"], load[f"{receiver}value"][:, 2]),
        "receiver and camera": (
            load["global_pose__frame_times"],
            np.linalg.norm(load["global_pose__frame_velocities"], axis=1),
        ),
    }
    print("| speed | Hz | lag (s) | SD (m/s) |" + "".join(f" after {s:g} s |" for s in LATER))
    for name, (time, speed) in speeds.items():
        lag, error = min((against(time, speed, *wheel, lag) for lag in LAGS), key=lambda one: one[1].std())
        step = float(np.median(np.diff(time)))
        cells = [f"{1 / step:.0f}", f"{-lag:.2f}", f"{error.std():.3f}"]
        print(
            "| " + " | ".join([name, *cells, *(f"{alike(error, round(s / step)):.2f}" for s in LATER)]) + " |"
        )


def against(time: Floats, speed: Floats, bus: Floats, rim: Floats, lag: float) -> tuple[float, Floats]:
    """The lag, and what is left of a speed (n,), m/s, by the wheels' ``lag`` seconds before and their best scale."""
    rows = (time > bus[0] + 1) & (time < bus[-1] - 1) & np.isfinite(speed)
    rim = np.interp(time[rows] + lag, bus, rim)
    left = speed[rows] - (rim @ speed[rows]) / (rim @ rim) * rim
    return float(lag), left - left.mean()


def alike(error: Floats, rows: int) -> float:
    """The correlation of an error (n,) with itself some rows later."""
    return float(np.mean(error[rows:] * error[:-rows]) / error.var())


if __name__ == "__main__":
    main()
