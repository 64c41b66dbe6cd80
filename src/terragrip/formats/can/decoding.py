"""From the frames of a log to its signals."""

from __future__ import annotations

import numpy as np

from terragrip.formats.can.bits import decode, leaps
from terragrip.formats.can.catalog import EXTENDED, Message, group_of, of_sender, place_of
from terragrip.formats.can.frames import Block, Frames
from terragrip.formats.signals import Signal


def identifier_text(identifier: int) -> str:
    """An identifier as it is written, with its parameter group where it has 29 bits: ``18FEF117 (PGN 65265)``."""
    if not identifier & EXTENDED:
        return f"{identifier:03X}"
    return f"{identifier & ~EXTENDED:08X} (PGN {group_of(identifier)})"


def names_of(frames: Frames) -> tuple[str, ...]:
    """All signals of the messages that occur; those of one of several senders also by ``Name@F0``."""
    frames.flush()
    result: dict[str, None] = {}
    for (_, sender), message in frames.seen.items():
        for f in message.fields:
            name = frames.catalog.name(message, f)
            result[name] = None
            if frames.senders(message) > 1:
                result[of_sender(name, sender)] = None
    return tuple(result)


def signals_of(frames: Frames) -> tuple[dict[str, Signal], list[str]]:
    """The wanted signals by name, and sentences on them.

    Where several senders give a message, a plain name is the signal of the sender with most valid samples, of the
    lowest address among equals.
    """
    frames.flush()
    result: dict[str, Signal] = {}
    # Plain name: valid samples, what prefers low addresses and buses, the sender.
    best: dict[str, tuple[int, int, int]] = {}
    several: set[str] = set()
    for (name, sender), kept in frames.kept.items():
        if not kept:  # its lines could not be read
            continue
        message = frames.seen[name, sender]
        shared = frames.senders(message) > 1
        for plain, signal in _decoded(frames, message, sender, kept).items():
            if shared and frames.wanted(of_sender(plain, sender)):
                result[of_sender(plain, sender)] = signal
            rank = int(np.isfinite(signal.values).sum()), -abs(sender), sender
            if frames.wanted(plain) and rank > best.get(plain, (-1, 0, 0)):
                best[plain], result[plain] = rank, signal
                several |= {plain} if shared else set()
    return result, [*_on_senders(best, several), *_on_missing(result), *_on_frames(frames)]


def _decoded(frames: Frames, message: Message, sender: int, kept: list[Block]) -> dict[str, Signal]:
    names = frames.catalog.names(message, sender)
    wanted = {field for field, every in names.items() if any(map(frames.wanted, every))}
    time, lengths = (np.concatenate([block[k] for block in kept]) for k in (0, 1))
    data = np.zeros((len(time), int(lengths.max())), np.uint8)
    row = 0
    while kept:  # one by one, so that payloads do not stand twice
        part = kept.pop(0)[2]
        data[row : row + len(part), : part.shape[1]] = part
        row += len(part)
    values = decode(message.fields, wanted, data, lengths)
    by_name = {f.name: f for f in message.fields if message.name in frames.catalog.given}
    for name in [n for n in by_name if n in values and leaps(by_name[n], data[np.isfinite(values[n])])]:
        frames.leaping += [names[name][0]] * (names[name][0] not in frames.leaping)
        del values[name]
    time = time if frames.tick == 1.0 else time * frames.tick
    units = {f.name: f.unit for f in message.fields}
    return {names[field][0]: Signal(time, column, units[field]) for field, column in values.items()}


def _on_senders(best: dict[str, tuple[int, int, int]], several: set[str]) -> list[str]:
    return [
        f"{name} has several senders; that of {place_of(best[name][2])} is used, which has the most valid samples."
        for name in sorted(several)
    ]


def _on_missing(result: dict[str, Signal]) -> list[str]:
    """Signals that were sent, but as "not available" or "error" only."""
    silent = [
        n for n, s in result.items() if "@" not in n and len(s.values) and not np.isfinite(s.values).any()
    ]
    if not silent:
        return []
    more = f" and {len(silent) - 8} more" if len(silent) > 8 else ""
    return [f'Sent as "not available" or "error" throughout: {", ".join(silent[:8])}{more}.']


def _on_frames(frames: Frames) -> list[str]:
    notes = []
    given = frames.catalog.given
    if given and not any(name in given for name, _ in frames.seen):
        notes.append(f"None of the DBC's messages occurs in the log ({', '.join(sorted(given)[:6])}).")
    unlike = sorted({m.name for m in frames.seen.values() if (m.by_group, m.key) in frames.catalog.differing})
    if unlike:
        notes.append(
            f"Described by two DBCs in unlike ways; the first one given counts: {', '.join(unlike[:6])}."
        )
    if frames.unknown:
        count, total = len(frames.unknown), sum(frames.unknown.values())
        often = sorted(frames.unknown, key=lambda i: (-frames.unknown[i], i))
        shown = ", ".join(map(identifier_text, often[:6])) + (f" and {count - 6} more" if count > 6 else "")
        what = "identifier" if count == 1 else "identifiers"
        notes.append(f"{total} of {frames.count} frames are in no DBC or table, those of the {what} {shown}.")
    if frames.transport.broken:
        notes.append(
            f"{frames.transport.broken} messages of several frames are incomplete and were left out."
        )
    return notes
