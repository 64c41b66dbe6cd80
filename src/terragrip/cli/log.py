"""Logging to standard error, for ``--verbose``. The library logs by the standard ``logging`` under ``terragrip``."""

from __future__ import annotations

import logging
import sys
from typing import Any


def log_to_stderr() -> None:
    """Render every ``terragrip`` log record by structlog on standard error."""
    import structlog  # 0.1 s: only who asks for a log waits for it

    stages: list[Any] = [
        structlog.stdlib.add_log_level,
        structlog.stdlib.add_logger_name,
        structlog.processors.TimeStamper(fmt="%H:%M:%S"),
    ]
    structlog.configure(
        processors=[*stages, structlog.stdlib.ProcessorFormatter.wrap_for_formatter],
        logger_factory=structlog.stdlib.LoggerFactory(),
        wrapper_class=structlog.stdlib.BoundLogger,
    )
    handler = logging.StreamHandler(sys.stderr)
    handler.setFormatter(
        structlog.stdlib.ProcessorFormatter(
            processor=structlog.dev.ConsoleRenderer(colors=sys.stderr.isatty()),
            foreign_pre_chain=[*stages, structlog.stdlib.ExtraAdder()],
        )
    )
    logger = logging.getLogger("terragrip")
    logger.handlers[:] = [handler]
    logger.setLevel(logging.INFO)
    logger.propagate = False
