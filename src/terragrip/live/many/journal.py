"""Events of a service of many vehicles that are no vehicle's own: its links, and vehicles that begin, are refused or fail."""

from __future__ import annotations

import logging
from collections.abc import Callable

from terragrip.live.message import EVENT, Message
from terragrip.log_events import emit

logger = logging.getLogger("terragrip.live")


class Journal:
    """Logs each event and gives it to every listener, none of which is a sink: a sink's topics belong to vehicles."""

    def __init__(self, listeners: list[Callable[[Message], None]]) -> None:
        self.listeners = listeners

    def event(self, kind: str, source: str, text: str, vehicle: str = "") -> None:
        """An event of ``source``: a link's URI, or ``service``."""
        emit(logger, kind, source=source, text=text, **({"vehicle": vehicle} if vehicle else {}))
        message = Message(
            EVENT, float("nan"), data={"kind": kind, "source": source, "text": text}, vehicle=vehicle
        )
        for listener in self.listeners:
            listener(message)
