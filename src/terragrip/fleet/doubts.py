"""What shows only where logs stand beside each other: copies, one machine in two drives at once, a machine unlike the others."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime
from typing import Any

import numpy as np

from terragrip.fleet.tally import MEANS, impossible, weighted

Note = dict[str, Any]

LEAST_OVERLAP = 1.0
"""Seconds; a logger that starts its next file before it has closed the last is no second drive."""
UNLIKE = 5.0
"""Robust SDs beyond which a machine is unlike the others: of 10 machines that differ by a Gaussian law one is so in 3.5 % of fleets, of
40 in .4 % (at the usual 3.5 of Iglewicz and Hoaglin 1993 in 12 and 9 %)."""
LEAST_SPREAD = 0.02
"""Of the median, the SD between machines at least: less than a tenth apart, no machine is odd to a user."""
LEAST_MACHINES = 10
"""Machines that a median needs to be what is usual."""


def compared(notes: Sequence[Note]) -> list[Note]:
    """The notes, each with the reason ``left_out`` in its summary ("": counted), and a sentence where logs of a machine overlap.

    A copy of a log before and a log with a mean that no machine can have count in no mean and no curve: they have no means, no
    rows by soil and no sample.
    """
    first: dict[str, str] = {}
    result = []
    for note in notes:
        content, summary = note.get("content"), dict(note["summary"])  # earlier calls kept no content
        copied = bool(content) and first.setdefault(str(content), note["log"]) != note["log"]
        why = f"a copy of {first[str(content)]}" if copied else impossible(summary)
        summary["left_out"] = why
        note = {**note, "summary": summary}
        if why:
            summary.update(dict.fromkeys(MEANS))
            note |= {"sample": False, "soils": []}
        result.append(note)
    said = _overlaps(result)
    for note in result:
        if note["log"] in said:
            note["summary"]["notes"] = f"{note['summary']['notes']} {said[note['log']]}".lstrip()
    return result


def _overlaps(notes: Sequence[Note]) -> dict[str, str]:
    """A sentence for each counted log that begins before an earlier one of its machine has ended."""
    spans = [
        (one["vehicle"], datetime.fromisoformat(one["start"]).timestamp(), one["duration"], note["log"])
        for note in notes
        if (one := note["summary"])["start"] and not one["left_out"]
    ]
    said: dict[str, str] = {}
    machine, ends, longest = "", -np.inf, ""
    for vehicle, start, seconds, log in sorted(spans):
        if vehicle != machine:
            machine, ends = vehicle, -np.inf
        both = min(ends, start + seconds) - start
        if both > LEAST_OVERLAP:
            said[log] = (
                f"It overlaps {longest} by {both:.0f} s, which count twice: leave one out; two machines need two names."
            )
        if start + seconds > ends:
            ends, longest = start + seconds, log
    return said


def unlike(rows: Sequence[dict[str, Any]]) -> dict[str, str]:
    """The machines of which a mean is far from those of the others, with the means, by `UNLIKE` robust SDs between machines (1.4826 times
    the median distance from the median). ``rows``: of the summary. Empty for fewer than `LEAST_MACHINES`."""
    machines: dict[str, list[dict[str, Any]]] = {}
    for row in rows:
        if not row["left_out"]:
            machines.setdefault(str(row["vehicle"]), []).append(row)
    found: dict[str, list[str]] = {}
    for name in MEANS[1:]:  # the first is the speed, which is the work's
        means = {machine: weighted(some, name)[0] for machine, some in machines.items()}
        values = np.array([mean for mean in means.values() if np.isfinite(mean)])
        if len(values) < LEAST_MACHINES:
            continue
        middle = float(np.median(values))
        spread = max(1.4826 * float(np.median(np.abs(values - middle))), LEAST_SPREAD * abs(middle))
        for machine, mean in means.items():
            if abs(mean - middle) > UNLIKE * spread:
                found.setdefault(machine, []).append(
                    f"{name.replace('_', ' ')} {mean:.3g} (others {middle:.3g})"
                )
    return {machine: ", ".join(found[machine]) for machine in sorted(found)}
