"""Metrics as Prometheus reads them: its text format, version 0.0.4."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

CONTENT_TYPE = "text/plain; version=0.0.4; charset=utf-8"
METRICS = "/metrics"
Labels = Mapping[str, str]


class Metrics:
    """Families in the order they are added; ``str`` of it is the page."""

    def __init__(self) -> None:
        self._lines: list[str] = []

    def add(self, kind: str, name: str, text: str, samples: float | Iterable[tuple[Labels, float]]) -> None:
        """A family of ``kind`` counter or gauge with one sample, or one for each set of labels.

        ``name`` follows Prometheus's conventions: terragrip_WHERE_WHAT_UNIT, base units, a counter's with _total. ``text``: its help.
        """
        self._lines += [f"# HELP {name} {_escaped(text)}", f"# TYPE {name} {kind}"]
        each = [({}, samples)] if isinstance(samples, int | float) else samples
        self._lines += [f"{name}{_labels(labels)} {_number(value)}" for labels, value in each]

    def __str__(self) -> str:
        return "\n".join([*self._lines, ""])


def _labels(labels: Labels) -> str:
    pairs = ",".join(f'{name}="{_escaped(value)}"' for name, value in labels.items())
    return pairs and f"{{{pairs}}}"


def _escaped(text: str) -> str:
    return text.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n")


def _number(value: float) -> str:
    text = repr(float(value)) if isinstance(value, float) else str(value)
    return {"nan": "NaN", "inf": "+Inf", "-inf": "-Inf"}.get(text, text)
