"""The example notebook on a wheel in sand; examples/notebooks.py makes and checks it."""

# %% [markdown]
# # A wheel in sand: a curve that does not go through zero
#
# Single-wheel runs of a smooth wheel (MIT-style licence). The sensor sees net traction, so the fit has an intercept.

# %%
import os
import sys
from pathlib import Path

import terragrip as tg

HERE = Path.cwd()
DATA = Path(os.environ.get("TERRAGRIP_DATA", HERE.parents[1] / "shared" / "data")) / "cmu_single_wheel_sand"
there = DATA.is_dir()
print("data:", DATA.name if there else f"{DATA.name} is not here, so no cell below does anything")

# %%
if there:
    sys.path.insert(0, str(HERE / "cmu_single_wheel_sand"))
    from sand_curve import levels

    curve = tg.AdhesionCurve(intercept=True).fit_bins(levels(DATA / "single_wheel_averages.csv"))
    display(curve)  # noqa: F821

# %%
if there:
    display(curve.plot())  # noqa: F821
