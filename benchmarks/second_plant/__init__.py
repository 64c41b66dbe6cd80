"""A second plant that shares no formula with terragrip's own: MuJoCo's rigid bodies on soil by Wong, Reece, Bekker and Janosi.

A development dependency (PyPI `mujoco`), for benchmarks and tests. The whole plant is held out: docs/families.md.
"""
