"""The example notebook on A car on a road, where slip must be 0; examples/notebooks.py makes and checks it."""

# %% [markdown]
# # A car on a road, where slip must be 0
#
# A minute of comma2k19 (MIT): NumPy arrays with clocks of their own, joined to one table here. A null test: whatever slip is told is error.

# %%
import os
import tempfile
from pathlib import Path

import numpy as np
import pandas as pd

import terragrip as tg

HERE = Path.cwd()
SHARED = Path(os.environ.get("TERRAGRIP_DATA", HERE.parents[1] / "shared" / "data"))
DATA = SHARED / "ingest_samples" / "comma2k19_example"
there = DATA.is_dir()
print("data:", DATA.name if there else f"{DATA.name} is not here, so no cell below does anything")

# %%
if there:
    arrays = {path.stem: np.load(path) for path in DATA.glob("*.npy") if "raw_can" not in path.stem}
    speeds = arrays["processed_log__CAN__wheel_speed__value"]
    wheels = pd.DataFrame(speeds, columns=["fl", "fr", "rl", "rr"])
    wheels["time"] = arrays["processed_log__CAN__wheel_speed__t"]
    pose = pd.DataFrame({"speed": np.linalg.norm(arrays["global_pose__frame_velocities"], axis=1)})
    pose["time"] = arrays["global_pose__frame_times"]
    joined = Path(tempfile.mkdtemp()) / "joined.csv"
    pd.merge(wheels, pose, on="time", how="outer").sort_values("time").to_csv(joined, index=False)
    recording = tg.read(joined, HERE / "comma2k19" / "profile.yaml")
    estimates = tg.estimate(recording, tg.Vehicle.load(HERE / "comma2k19" / "vehicle.yaml"))
    display(estimates)  # noqa: F821

# %%
if there:
    display(estimates.plot("time"))  # noqa: F821

# %%
if there:
    slips = {wheel: float(np.nanmedian(estimates[f"slip_{wheel}"])) for wheel in estimates.wheels}
    print("median slip by wheel:", {wheel: round(slip, 4) for wheel, slip in slips.items()})
