"""The example notebook on A rover: slip of each wheel; examples/notebooks.py makes and checks it."""

# %% [markdown]
# # A rover: slip of each wheel
#
# Four wheel speeds, GPS and IMU (MIT); no torque. Shown as a picture only.

# %%
import os
from pathlib import Path

import terragrip as tg

HERE = Path.cwd()
DATA = Path(os.environ.get("TERRAGRIP_DATA", HERE.parents[1] / "shared" / "data")) / "pathfinder_rover"
there = DATA.is_dir()
print("data:", DATA.name if there else f"{DATA.name} is not here, so no cell below does anything")

# %%
if there:
    log = sorted(DATA.glob("test17run_odom*.csv.gz"))[0]
    vehicle = tg.Vehicle.load(HERE / "pathfinder_rover" / "vehicle.yaml")
    recording = tg.read(log, HERE / "pathfinder_rover" / "profile.yaml")
    estimates = tg.estimate(recording, vehicle)

# %%
if there:
    display(estimates.plot("time"))  # noqa: F821

# %%
if there:
    display(estimates.plot("map"))  # noqa: F821

# %%
if there:
    display(estimates.summary())  # noqa: F821
