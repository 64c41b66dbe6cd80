"""The example notebook on A skid-steer robot on grass; examples/notebooks.py makes and checks it."""

# %% [markdown]
# # A skid-steer robot on grass
#
# Wheel speeds, motor currents, lidar pose, IMU at 20 Hz, most of them held (BSD-3): held values are found and taken as missing.

# %%
import os
from pathlib import Path

import terragrip as tg

HERE = Path.cwd()
DATA = Path(os.environ.get("TERRAGRIP_DATA", HERE.parents[1] / "shared" / "data")) / "drive_warthog"
there = DATA.is_dir()
print("data:", DATA.name if there else f"{DATA.name} is not here, so no cell below does anything")

# %%
if there:
    log = sorted(DATA.glob("raw20hz/*.csv.gz"))[0]
    vehicle = tg.Vehicle.load(HERE / "drive_warthog" / "vehicle.yaml")
    recording = tg.read(log, HERE / "drive_warthog" / "profile.yaml")
    estimates = tg.estimate(recording, vehicle)
    display(estimates)  # noqa: F821

# %%
if there:
    display(estimates.plot("time"))  # noqa: F821

# %%
if there:
    display(estimates.summary(by="event").iloc[:, :6])  # noqa: F821
