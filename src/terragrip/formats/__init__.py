"""From a log on disk to a Recording, and the content of a log."""

from typing import TYPE_CHECKING

from terragrip.formats.profile import Profile
from terragrip.formats.reading import read, read_channels, read_table
from terragrip.formats.registry import Format
from terragrip.formats.signals import Signal, SignalLog
from terragrip.formats.table import LogTable
from terragrip.lazy import lazily

if TYPE_CHECKING:
    from terragrip.formats.inspection import Inspection as Inspection
    from terragrip.formats.inspection import inspect as inspect

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

__getattr__ = lazily(__name__, {"Inspection": ".inspection", "inspect": ".inspection"})
