"""The ground along a drive: where it changes, what it is, and what happened on it.

The names load on first use.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from terragrip.ground.analysis import Settings as Settings
    from terragrip.ground.analysis import analyse as analyse
    from terragrip.ground.changes import Change as Change
    from terragrip.ground.changes import changes_of as changes_of
    from terragrip.ground.live import GroundState as GroundState
    from terragrip.ground.live import LiveGround as LiveGround
    from terragrip.ground.result import Ground as Ground
    from terragrip.ground.result import Timeline as Timeline
    from terragrip.ground.result import read as read
    from terragrip.ground.result import write as write
    from terragrip.ground.sections import Section as Section

_HOME = {
    "analyse": "analysis",
    "Settings": "analysis",
    "Ground": "result",
    "Timeline": "result",
    "read": "result",
    "write": "result",
    "Change": "changes",
    "changes_of": "changes",
    "Section": "sections",
    "LiveGround": "live",
    "GroundState": "live",
}

__all__ = list(_HOME)


def __getattr__(name: str) -> Any:
    """Load a public name from its home (PEP 562)."""
    if name not in _HOME:
        raise AttributeError(f"module 'terragrip.ground' has no attribute {name!r}")
    from importlib import import_module

    value = getattr(import_module(f"terragrip.ground.{_HOME[name]}"), name)
    globals()[name] = value
    return value
