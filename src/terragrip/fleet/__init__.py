"""Fleets: estimate any number of logs on Dask into one data set; later calls add what is new (docs/fleet.md)."""
