"""Logging to standard error, for ``--verbose`` and ``--log-format json``. The library logs by ``logging`` under ``terragrip``."""

from __future__ import annotations

import json
import logging
import os
import re
import sys
from collections.abc import Callable
from enum import StrEnum
from typing import Annotated, Any

import typer

_SECRET_OPTION = re.compile(r"((?:token|password)=)[^&\s\"\\]+")
_SHORTEST = 4  # a shorter secret would blank out words


class LogForm(StrEnum):
    """How a running service reports events on standard error."""

    text = "text"
    json = "json"


LogFormat = Annotated[
    LogForm,
    typer.Option("--log-format", help="json: one JSON object per line on standard error, nothing elsewhere."),
]


def log_to_stderr(form: LogForm = LogForm.text) -> None:
    """Render every ``terragrip`` log record by structlog on standard error; as JSON also other libraries' warnings."""
    import structlog  # 0.1 s: only who asks for a log waits for it

    as_json = form is LogForm.json
    stages: list[Any] = [
        structlog.stdlib.add_log_level,
        structlog.stdlib.add_logger_name,
        structlog.processors.TimeStamper(fmt="iso" if as_json else "%H:%M:%S"),
    ]
    structlog.configure(
        processors=[*stages, structlog.stdlib.ProcessorFormatter.wrap_for_formatter],
        logger_factory=structlog.stdlib.LoggerFactory(),
        wrapper_class=structlog.stdlib.BoundLogger,
    )
    last: list[Any] = (
        [structlog.processors.format_exc_info, structlog.processors.JSONRenderer()]
        if as_json
        else [structlog.dev.ConsoleRenderer(colors=sys.stderr.isatty())]
    )
    last.append(_redacting())
    handler = logging.StreamHandler(sys.stderr)
    handler.setFormatter(
        structlog.stdlib.ProcessorFormatter(
            processors=[structlog.stdlib.ProcessorFormatter.remove_processors_meta, *last],
            foreign_pre_chain=[*stages, structlog.stdlib.ExtraAdder()],
        )
    )
    logger = logging.getLogger("terragrip")
    logger.handlers[:] = [handler]
    logger.setLevel(logging.INFO)
    logger.propagate = False
    if as_json:
        logging.getLogger().handlers[:] = [handler]


def _redacting() -> Callable[[Any, str, str], str]:
    """Blanks out what is secret in a finished line, wherever it came from."""
    from terragrip.live.credentials import Credentials

    known = Credentials.find()
    secrets = [known.password, known.token, os.environ.get("TERRAGRIP_LIVE_TOKEN")]
    words = [one for one in secrets if one and len(one) >= _SHORTEST]
    words += [json.dumps(word)[1:-1] for word in words]

    def redacted(_: Any, __: str, line: str) -> str:
        for word in words:
            line = line.replace(word, "***")
        return _SECRET_OPTION.sub(r"\1***", line)

    return redacted
