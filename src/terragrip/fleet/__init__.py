"""Fleets: any number of logs on Dask, into one data set that grows by what is new (docs/fleet.md)."""
