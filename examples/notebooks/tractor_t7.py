"""The example notebook on A stock tractor: slip from its bus; examples/notebooks.py makes and checks it."""

# %% [markdown]
# # A stock tractor: slip from its bus
#
# An hour of field work at 1 Hz (CC BY-NC 4.0): wheel-based speed and GNSS speed, no torque. It shows slip, and where, and no more.

# %%
import os
import tempfile
from pathlib import Path

import terragrip as tg
from terragrip.cli import main

HERE = Path.cwd()
DATA = Path(os.environ.get("TERRAGRIP_DATA", HERE.parents[1] / "shared" / "data")) / "tractor_t7"
there = DATA.is_dir()
print("data:", DATA.name if there else f"{DATA.name} is not here, so no cell below does anything")

# %%
if there:
    log = sorted(DATA.glob("*.csv.gz"))[0]
    vehicle = tg.Vehicle.load(HERE / "tractor_t7" / "vehicle.yaml")
    folder = Path(tempfile.mkdtemp())
    words = ["inspect", str(log), "--vehicle", str(HERE / "tractor_t7" / "vehicle.yaml")]
    main([*words, "--write-profile", str(folder / "profile.yaml")])
    recording = tg.read(log, folder / "profile.yaml")
    estimates = tg.estimate(recording, vehicle)
    display(estimates)  # noqa: F821

# %%
if there:
    display(estimates.plot("time"))  # noqa: F821

# %%
if there:
    display(estimates.plot("map"))  # noqa: F821
