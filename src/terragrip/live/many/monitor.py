"""What a monitoring system asks the service of many vehicles: is it alive, which vehicle gets no data."""

from __future__ import annotations

from collections.abc import Sequence
from urllib.parse import unquote

from terragrip.live.many.links import Router
from terragrip.live.many.vehicles import Vehicles
from terragrip.live.monitor import Answers, Family, Monitor, add_sinks
from terragrip.live.outbox import Outbox
from terragrip.prometheus_text import Metrics


class ManyMonitor(Answers):
    """Of many vehicles, and at ``/health/ready/NAME`` of one."""

    def __init__(self, vehicles: Vehicles, routers: Sequence[Router], outboxes: Sequence[Outbox]) -> None:
        self._vehicles, self._routers, self._outboxes = vehicles, routers, outboxes

    def ready(self, path: str) -> tuple[int, str] | None:
        """503 only where no vehicle gets data or a source has no other side: one vehicle's silence is not the service's."""
        unready, runs = self.unready(), self._vehicles.runs
        if path:
            name = unquote(path.removeprefix("/"))
            if name in unready:
                return 503, f"{unready[name]}\n"
            return (200, "gets data\n") if name in runs else (404, "no such vehicle\n")
        lost = [one for one in self._routers if not one.is_connected]
        count = len(runs.keys() | unready.keys())
        lines = [f"{one.name}: {one.why_lost}" for one in lost]
        lines.append(f"{count - len(unready)} of {count} vehicles get data")
        lines += [f"{name}: {why}" for name, why in sorted(unready.items())]
        return (200 if not lost and count > len(unready) else 503), "\n".join([*lines, ""])

    def unready(self) -> dict[str, str]:
        """The vehicles that get no data, listed ones that never sent among them, each with the reason."""
        vehicles = self._vehicles
        result = dict.fromkeys(vehicles.roster.names, "nothing has come yet")
        result |= {name: f"not estimated: {refusal.why}" for name, refusal in vehicles.refusals.items()}
        for name in vehicles.runs:
            result.pop(name, None)
            why = self._of(name).unready()
            if why is not None:
                result[name] = why
        return result

    def metrics(self) -> str:
        """See `Answers`."""
        page, vehicles = Metrics(), self._vehicles
        unready = self.unready()
        for kind, family, text, value in (
            ("gauge", "vehicles", "Vehicles that are estimated.", len(vehicles.runs)),
            (
                "gauge",
                "vehicles_refused",
                "Vehicles that send but are not estimated.",
                len(vehicles.refusals),
            ),
            ("counter", "vehicle_failures_total", "Vehicles closed after a failure.", vehicles.failures),
            ("counter", "unnamed_messages_total", "Messages whose topic names no vehicle.", vehicles.unnamed),
        ):
            page.add(kind, f"terragrip_live_{family}", text, value)
        listed = vehicles.runs.keys() | unready.keys()
        ready = [({"vehicle": name}, int(name not in unready)) for name in sorted(listed)]
        page.add("gauge", "terragrip_live_ready", "1 if /health/ready/VEHICLE answers 200.", ready)
        alike: dict[str, Family] = {}
        for name in sorted(vehicles.runs):
            for kind, family, text, samples in self._of(name).families(by_channel=False):
                known = alike.setdefault(family, (kind, family, text, []))
                known[3].extend(({"vehicle": name, **labels}, value) for labels, value in samples)
        for kind, family, text, samples in alike.values():
            page.add(kind, family, text, samples)
        add_sinks(page, self._outboxes)
        return str(page)

    def _of(self, name: str) -> Monitor:
        run = self._vehicles.runs[name]
        return Monitor(run.statistics, run.inbox, (), run.pipeline)
