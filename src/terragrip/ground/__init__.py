"""The ground along a drive: where it changes, which soil it is, and the events on it.

The names load on first use.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from terragrip.lazy import lazily

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
    "analyse": ".analysis",
    "Settings": ".analysis",
    "Ground": ".result",
    "Timeline": ".result",
    "read": ".result",
    "write": ".result",
    "Change": ".changes",
    "changes_of": ".changes",
    "Section": ".sections",
    "LiveGround": ".live",
    "GroundState": ".live",
}

__all__ = list(_HOME)
__getattr__ = lazily(__name__, _HOME)
