"""From a log on disk to a Recording, and what is in a log."""

from terragrip.formats.csv_blocks import iter_csv
from terragrip.formats.inspect import Inspection, inspect
from terragrip.formats.parquet import iter_parquet
from terragrip.formats.profile import Profile
from terragrip.formats.reading import read, read_channels, read_table

__all__ = [
    "Inspection",
    "Profile",
    "inspect",
    "iter_csv",
    "iter_parquet",
    "read",
    "read_channels",
    "read_table",
]
