"""Which of the profiles that come with Terragrip fit a log, and by which names one nearly does."""

from __future__ import annotations

from dataclasses import dataclass, replace

from terragrip.errors import InputError
from terragrip.formats.profile import SHIPPED, Profile
from terragrip.formats.profile_parts import Source, matching
from terragrip.formats.proposal import is_ready
from terragrip.formats.signals import SignalLog
from terragrip.formats.table import LogTable


@dataclass(frozen=True)
class Fit:
    """The shipped profiles that fit, the channels that they find, and sentences on those that nearly fit."""

    names: tuple[str, ...] = ()
    channels: frozenset[str] = frozenset()
    nearly: tuple[str, ...] = ()


def fit_of(log: LogTable | SignalLog) -> Fit:
    """Try the profiles that come with Terragrip on a log."""
    names: list[str] = []
    channels: set[str] = set()
    nearly: list[str] = []
    for name in SHIPPED:
        profile = Profile.load(name)
        if isinstance(log, SignalLog):
            own = {n: s for n, s in log.signals.items() if profile.wants(n)}
            table = replace(log, signals=own).table() if own else None
        else:
            table = log
        try:
            recording = None if table is None else profile.apply(table)
        except InputError:
            recording = None
        if recording is not None and is_ready(recording):
            names.append(name)
            channels |= recording.channels.keys()
        elif text := _nearly(name, profile, log.names):
            nearly.append(text)
    return Fit(tuple(names), frozenset(channels), () if names else tuple(nearly))


def _nearly(name: str, profile: Profile, columns: tuple[str, ...]) -> str:
    """A sentence on a profile of which some of the speeds are there; empty if none is, or all are."""
    needed = {c: s for c, s in profile.channels.items() if not s.optional}
    result = {c: near for c, source in needed.items() if (near := _present(source, columns))}
    lacking = [c for c in needed if c not in result]
    if not result or not lacking:
        return ""
    there = ", ".join(f"{channel} <- {column}" for channel, column in result.items())
    away = "; ".join(
        f"{channel} (looked for {', '.join(_wanted(needed[channel])[:3])})" for channel in lacking[:4]
    )
    return f"The profile {name} nearly fits: {there}; but no {away}."


def _present(source: Source, columns: tuple[str, ...]) -> str:
    """The columns that a source or one in its place would read, all of which are there; empty if none is."""
    for one in source.chain:
        if one.candidates:
            hit = next((near for name in one.candidates for near in matching(name, columns)), "")
        else:
            parts = [next(iter(matching(name, columns)), "") for name in one.columns]
            hit = ", ".join(parts) if parts and all(parts) else ""
        if hit:
            return hit
    return ""


def _wanted(source: Source) -> list[str]:
    return [column for one in source.chain for column in one.columns]
