"""From a log on disk to a Recording, and the content of a log."""

from terragrip.formats.inspect import Inspection, inspect
from terragrip.formats.profile import Profile
from terragrip.formats.reading import read, read_channels, read_table
from terragrip.formats.registry import Format
from terragrip.formats.signals import Signal, SignalLog
from terragrip.formats.table import LogTable

__all__ = [
    "Format",
    "Inspection",
    "LogTable",
    "Profile",
    "Signal",
    "SignalLog",
    "inspect",
    "read",
    "read_channels",
    "read_table",
]
