"""The example notebook on A robot with four driven wheels; examples/notebooks.py makes and checks it."""

# %% [markdown]
# # A robot with four driven wheels
#
# 95 kg, indoors: speed and torque of each wheel, a pose (MIT). From a log to slip and adhesion.

# %%
import os
from pathlib import Path

import terragrip as tg

HERE = Path.cwd()
DATA = Path(os.environ.get("TERRAGRIP_DATA", HERE.parents[1] / "shared" / "data")) / "alostar_4wd"
there = DATA.is_dir()
print("data:", DATA.name if there else f"{DATA.name} is not here, so no cell below does anything")

# %%
if there:
    log = sorted(DATA.glob("*.txt"))[0]
    vehicle = tg.Vehicle.load(HERE / "alostar_4wd" / "vehicle.yaml")
    recording = tg.read(log, HERE / "alostar_4wd" / "profile.yaml")
    estimates = tg.estimate(recording, vehicle)
    display(estimates)  # noqa: F821

# %%
if there:
    display(estimates.plot("time"))  # noqa: F821

# %%
if there:
    display(estimates.plot("plane"))  # noqa: F821
