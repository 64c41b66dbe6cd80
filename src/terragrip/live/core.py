"""Order and estimator: from what came in and when to rows, estimates and events. No clock, no I/O.

Everything it does follows from the sequence of `process`, `tick`, `note` and `flush` with their arguments; so the record
(terragrip.live.record) needs to hold only those to bring it back bit for bit after a kill.
"""

from __future__ import annotations

import base64
from collections.abc import Collection, Mapping
from dataclasses import asdict, dataclass, field
from typing import TYPE_CHECKING, Any

from terragrip.errors import InputError
from terragrip.estimation.columns import wheels_with
from terragrip.estimation.driveline import by_engine
from terragrip.estimation.engine import estimate_slots
from terragrip.estimation.engine_estimator import EngineEstimator, live_estimator, restored
from terragrip.estimation.estimator import Estimate, TractionEstimator, default_channels
from terragrip.estimation.learning import SettingsLearner
from terragrip.estimation.methods import DEFAULT
from terragrip.estimation.rims import DRIVE, speeds_alone
from terragrip.live.clock import Pace, SourceClock, Stamped
from terragrip.live.counts import Counts
from terragrip.live.outputs import Event, Output, Refusal, Row, Values
from terragrip.live.reorder import Pending, Reorder
from terragrip.recording.checks import NOTHING_TOWED
from terragrip.recording.clock import clock_text
from terragrip.recording.columns import SINCE_1970
from terragrip.recording.plain_units import size_warnings

if TYPE_CHECKING:
    from terragrip.ground.live import LiveGround
    from terragrip.soil.library import SoilLibrary
    from terragrip.vehicle import Vehicle

WINDOW = 0.02  # s
FORMAT = 4  # of `Core.state`
_WARNINGS = {
    "immobilization": "about to dig in",
    "stuck": "stuck",
    "push": "the tool pushes",
}
"""Events of the estimator that concern a driver, in words."""


@dataclass(frozen=True, slots=True)
class Settings:
    """What makes two runs the same: kept with the record, compared on resuming.

    ``window`` [s]: how long a row waits for what is due. ``channels``: columns the samples carry; empty: those seen by the
    first row. ``sources``: their URIs without options. ``held`` [s]: update periods of channels that are repeated between
    updates. ``noise``: SDs [SI] by channel, over the vehicle file's. ``ground``: whether ground changes and soils are followed. ``learn``:
    whether noise and held channels that are not given are learned from the rows as they come (`terragrip.estimation.learning`).
    ``driveline``: what an earlier log showed of a machine with engine torque (`terragrip.estimation.engine_estimator`).
    ``cycle``: see `Reorder`.
    """

    sources: tuple[str, ...] = ()
    method: str = DEFAULT
    window: float = WINDOW
    channels: tuple[str, ...] = ()
    held: Mapping[str, float] = field(default_factory=dict)
    ground: bool = False
    noise: Mapping[str, float] = field(default_factory=dict)
    learn: bool = True
    driveline: Mapping[str, Any] | None = None
    cycle: float | None = None

    def to_dict(self) -> dict[str, Any]:
        """As JSON holds it."""
        return {**asdict(self), "sources": list(self.sources), "channels": list(self.channels)}

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> Settings:
        """The inverse of `to_dict`."""
        return cls(**{**data, "sources": tuple(data["sources"]), "channels": tuple(data["channels"])})


class Core:
    """Samples in, rows with estimates, events and refusals out."""

    def __init__(self, vehicle: Vehicle, settings: Settings, library: SoilLibrary | None = None) -> None:
        self.vehicle = vehicle
        self.library = library
        self.ground: LiveGround | None = None
        self.settings = settings
        self.counts = Counts()
        self.reorder = Reorder(settings.window, self.counts, settings.cycle)
        align = len(settings.sources) > 1
        self.clocks = [SourceClock(align) for _ in settings.sources]
        self._paces = [Pace() for _ in settings.sources]
        self.estimator: TractionEstimator | None = None
        self.learner: SettingsLearner | None = None
        self.rows = 0
        self.event = ""  # the last row's
        if settings.channels:
            self._begin(settings.channels)

    def _begin(self, channels: Collection[str]) -> TractionEstimator:
        method, held, noise = self.settings.method, self.settings.held, self.settings.noise
        estimator = live_estimator(
            self.vehicle, method, channels, held=held, sensors=noise, driveline=self.settings.driveline
        )
        self.estimator = estimator
        self.learner = self._learner(estimator)
        if self.settings.ground and not estimator.rims:
            from terragrip.ground.live import LiveGround

            self.ground = LiveGround(estimator, self.library)
        return estimator

    def _learner(self, estimator: TractionEstimator) -> SettingsLearner:
        """What learns; where nothing is to be learned it still finds what never came and what contradicts itself."""
        inputs = estimator.engine.inputs
        return SettingsLearner(estimator.vehicle, inputs, self.settings.noise, self.settings.held)

    @property
    def columns(self) -> tuple[str, ...]:
        """Columns of the estimates to come; where the channels are not known yet, those that torques give."""
        return tuple(estimate_slots(self.vehicle)) if self.estimator is None else self.estimator.columns

    @property
    def time(self) -> float:
        """Instant [s] of the last row; -inf before the first."""
        return self.reorder.released

    @property
    def when(self) -> str:
        """`time` in words: a date where it counts from 1970."""
        return clock_text(round(self.time, 3)) if self.time > SINCE_1970 else f"{self.time:.6g} s"

    def handle(self, kind: str, content: Any) -> list[Output]:
        """An input as the record holds it: ``S`` a sample, ``T`` a tick, ``N`` a note, ``F`` a flush; another is none."""
        if kind == "S":
            return self.process(*content)
        if kind == "T":
            return self.tick(content)
        if kind == "N":
            return self.note(content)
        return self.flush() if kind == "F" else []

    def process(self, arrival: float, source: int, stamp: float, values: Values) -> list[Output]:
        """A sample of ``source`` (its place in the settings), stamped by its own clock [s]; SI values by column."""
        self.counts.add("received", values)
        out: list[Output] = []
        pace = self._paces[source].wrong(arrival, stamp)
        if pace is not None:
            text = f"time advances by {pace:.3g} s in a second: state its unit in a profile, 'time: {{from: ..., unit: ms}}'"
            out.append(Event(self.time, "units", self.settings.sources[source], text))
        clock, name = self.clocks[source], self.settings.sources[source]
        accepted, refused, jump = clock.place(arrival, stamp, values)
        if clock.news:
            out.append(Event(self.time, "clock_corrected", name, clock.news))
            clock.news = ""
        if refused:
            self._refuse_stamps(source, refused, out)
        if jump:
            text = f"the clock jumped by {jump:+.5g} s; time continues without the jump"
            out.append(Event(self.time, "clock_jump", name, text))
        for when, time, one in accepted:
            unused = self.reorder.add(when, source, time, one)
            if unused:
                out.append(Refusal(when, time, source, "late or doubled", unused))
            if clock.is_behind(when, len(unused) == len(one) and time < self.time):
                out.append(self._all_late(clock, name, self.time - time))
        return self._release(self.reorder.ready(arrival), out)

    def _all_late(self, clock: SourceClock, name: str, behind: float) -> Event:
        """The event of a source all of whose samples were refused for a while; its clock is set, where that is the reason."""
        if step := clock.set_by_arrivals(self.settings.window / 2):
            text = f"its clock is {step:.2g} s behind this machine's, or its samples travel for so long: corrected by the arrivals"
            return Event(
                self.time, "clock_corrected", name, text + "; if they travel, give a longer --window"
            )
        text = f"all that comes is stamped {behind:.2g} s behind rows already estimated, and refused"
        return Event(self.time, "late", name, text + ": set the sources' clocks, or give a longer --window")

    def _refuse_stamps(self, source: int, refused: list[Stamped], out: list[Output]) -> None:
        for arrival, stamp, values in refused:
            self.counts.add("clock", values)
            out.append(Refusal(arrival, stamp, source, "clock", values))

    def tick(self, now: float) -> list[Output]:
        """Nothing came up to ``now``: rows that have waited for a window go on."""
        return self._release(self.reorder.ready(now), [])

    def flush(self) -> list[Output]:
        """The sources have ended: all rows go on, and no sample waits any longer for another to confirm its stamp."""
        out: list[Output] = []
        for source, clock in enumerate(self.clocks):
            self._refuse_stamps(source, clock.give_up(), out)
        return self._release(self.reorder.flush(), out)

    def note(self, note: Mapping[str, Any]) -> list[Output]:
        """What the service saw beside samples: counts (``fate``, ``channels``, ``number``) and an ``event``.

        Dropped samples of a ``source`` explain a hole in its stamps behind ``arrival``.
        """
        if "fate" in note:
            self.counts.add(note["fate"], note["channels"], note["number"])
            if note["fate"] == "dropped" and note["source"] is not None:
                self.clocks[note["source"]].dropped(note["arrival"])
        return [Event(**{**note["event"], "time": self.time})] if "event" in note else []

    def _release(self, rows: list[Pending], out: list[Output]) -> list[Output]:
        for row in rows:
            estimator = self.estimator
            if estimator is None:
                estimator = self._begin(self._seen(row))
                out += self._lacking(row)
            try:
                estimate = estimator.update_at(row.time, row.values)
            except InputError as error:
                source = row.parts[0][0]
                out.append(Refusal(row.arrival, row.time, source, str(error), row.values))
                out.append(Event(row.time, "refused", self.settings.sources[source], str(error)))
                continue
            if not self.rows:
                out += [Event(row.time, "contradiction", "vehicle", n) for n in size_warnings(self.vehicle)]
                if isinstance(estimator, EngineEstimator):
                    out += [Event(row.time, "schema", "estimator", note) for note in estimator.machine.notes]
            self.rows += 1
            out.append(Row(row.arrival, row.values, estimate))
            self._watch(estimate, out)
            if self.ground is not None:
                state = self.ground.update(estimate)
                if state is not None:
                    out.append(state)
                    if (change := state.change) is not None:
                        text = f"{change.subject} changed at {change.time:.1f} ± {change.std:.1f} s, probability {change.probability:.2f}"
                        out.append(Event(state.time, "ground_change", "ground", text))
            if self.learner is not None:
                self._learn(estimator, self.learner, row, out)
        out += [
            Event(self.time, kind, self.settings.sources[n], text) for kind, n, text in self.reorder.changes
        ]
        self.reorder.changes.clear()
        return out

    def _learn(
        self, estimator: TractionEstimator, learner: SettingsLearner, row: Pending, out: list[Output]
    ) -> None:
        """Noise and held channels by the rows so far, from the next row on, with an event."""
        taken = estimator.converted if isinstance(estimator, EngineEstimator) else row.values
        learned = learner.add(row.time, taken)
        if learned is not None:
            for name, notes in learned.doubts.items():
                kind = "units" if name == "rims" else "contradiction"
                out += [Event(row.time, kind, "estimator", note) for note in notes]
            out += self._absent(row.time, learned.absent)
        if learned is None or not self.settings.learn or not (changes := learned.changes(estimator)):
            return
        learned.apply(estimator)
        text = f"from {learned.seconds:.0f} s of the drive: {'; '.join(changes)}"
        out.append(Event(row.time, "learned", "estimator", text))

    def _absent(self, time: float, absent: Collection[str]) -> list[Event]:
        """An event where channels without which nothing is estimated have not come since the start."""
        needed = [name for name in default_channels(self.vehicle) if name in absent]
        if not needed:
            known = "drawbar_force" not in absent or self.vehicle.uncertainty.drawbar_force is not None
            return [] if known else [Event(time, "schema", "estimator", NOTHING_TOWED)]
        torques = [name for name in needed if name.startswith("drive_torque_")]
        text = f"{', '.join(needed)} never came: without that every row is a gap"
        if len(torques) == int(self.vehicle.driven.sum()):
            speed = torques[0].replace("drive_torque", "wheel_speed")
            text += f"; for slip alone give a profile of the speeds, without torques: 'channels: {{{speed}: {speed}, ...}}'"
        elif torques:
            text += "; name it in the profile, or write 'driven: false' in the vehicle file if its axle has no drive"
        return [Event(time, "schema", "estimator", text)]

    def _watch(self, estimate: Estimate, out: list[Output]) -> None:
        """An event where a warning begins."""
        if estimate.event != self.event:
            self.event = estimate.event
            if estimate.event in _WARNINGS:
                out.append(self._warning(estimate))

    def _warning(self, estimate: Estimate) -> Event:
        """The estimator's event as one of ours, with what the machine did."""
        slips = {w: estimate[f"slip_{w}"] for w in wheels_with("slip", estimate.places)}
        known = {wheel: slip for wheel, slip in slips.items() if slip == slip}
        most = max(known, key=lambda wheel: abs(known[wheel]), default=None)
        text = f"{_WARNINGS[estimate.event]}: ground speed {estimate.ground_speed:.2f} m/s"
        if most is not None:
            text += f", slip up to {100 * known[most]:.0f} % ({most})"
        return Event(estimate.time, estimate.event, "estimator", text)

    def _lacking(self, first: Pending) -> list[Output]:
        """An event where the first rows lack a wheel's speed, or have wheels that the vehicle lacks."""
        if isinstance(self.estimator, EngineEstimator):
            return []
        seen = {name for row in (first, *self.reorder.pending) for name in row.values}
        wheels = [name.removeprefix("wheel_speed_") for name in seen if name.startswith("wheel_speed_")]
        absent = [w for w in self.vehicle.wheels if w not in (*wheels, *self.vehicle.free_wheels)]
        if self.estimator is not None and [rim.wheel for rim in self.estimator.rims] == [DRIVE]:
            return []
        strange = sorted(wheel for wheel in wheels if wheel not in self.vehicle.wheels)
        if not absent:
            return []
        text = f"no speed of the wheel {', '.join(absent)} yet"
        if strange:
            text += f"; the vehicle has no wheel {', '.join(strange[:4])}"
        elif not wheels:
            text += f"; what comes is {', '.join(sorted(seen))}: a profile maps other names"
        return [Event(first.time, "schema", self.settings.sources[first.parts[0][0]], text)]

    def _seen(self, first: Pending) -> Collection[str]:
        pending = [name for row in self.reorder.pending for name in row.values]
        seen = dict.fromkeys([*first.values, *pending])
        drive = "wheel_based_speed" in seen and speeds_alone(seen, self.vehicle)
        if drive or by_engine(seen, self.vehicle):
            return tuple(seen)
        return tuple(dict.fromkeys([*default_channels(self.vehicle), *seen]))

    def state(self) -> dict[str, Any]:
        """Everything, as JSON holds it, to the last bit."""
        snapshot = self.estimator.snapshot() if self.estimator else b""
        return {
            "format": FORMAT,
            "settings": self.settings.to_dict(),
            "vehicle": self.vehicle.to_dict(),
            "estimator": base64.b64encode(snapshot).decode(),
            "clocks": [clock.state() for clock in self.clocks],
            "reorder": self.reorder.state(),
            "counts": self.counts.state(),
            "learner": None if self.learner is None else self.learner.state(),
            "rows": self.rows,
            "event": self.event,
            "ground": base64.b64encode(self.ground.snapshot()).decode() if self.ground else "",
        }

    @classmethod
    def from_state(cls, state: Mapping[str, Any], library: SoilLibrary | None = None) -> Core:
        """The inverse of `state`, with the same library; raises InputError where a snapshot in it is damaged.

        Raises ValueError or LookupError where it is another version's.
        """
        from terragrip.vehicle import Vehicle

        if state["format"] != FORMAT:
            raise ValueError(f"a state of format {state['format']}, not {FORMAT}")
        result = cls(Vehicle.from_dict(state["vehicle"]), Settings.from_dict(state["settings"]), library)
        snapshot = base64.b64decode(state["estimator"])
        result.estimator = restored(snapshot) if snapshot else None
        if result.estimator is not None and state["learner"] is not None:
            result.learner = result._learner(result.estimator)
            result.learner.restore(state["learner"])
        result.clocks = [SourceClock.from_state(one) for one in state["clocks"]]
        result.counts = Counts.from_state(state["counts"])
        result.reorder.counts = result.counts
        result.reorder.restore(state["reorder"])
        result.rows, result.event = state["rows"], state["event"]
        if state["ground"] and result.estimator is not None:
            from terragrip.ground.live import LiveGround

            result.ground = LiveGround.restore(base64.b64decode(state["ground"]), result.estimator, library)
        return result
