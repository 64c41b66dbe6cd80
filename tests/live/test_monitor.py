"""What a monitoring system is told, over HTTP, by a real service with a real source."""

from __future__ import annotations

import asyncio
import http.client
import re

import pytest

from machine import messages, running, until
from terragrip.formats import Profile
from terragrip.live.core import Core, Settings
from terragrip.live.decode import Decoder
from terragrip.live.feed import Feed
from terragrip.live.inbox import Inbox
from terragrip.live.payload import unpacker
from terragrip.live.service import Service
from terragrip.live.statistics import Statistics

pytestmark = pytest.mark.asyncio


async def get(port: int, path: str, **headers: str) -> tuple[int, str]:
    """Status and text of an HTTP request from another thread, as a monitoring system makes it."""

    def ask() -> tuple[int, str]:
        connection = http.client.HTTPConnection("127.0.0.1", port, timeout=60)
        connection.request("GET", path, headers=headers)
        answer = connection.getresponse()
        text = answer.read().decode()
        connection.close()
        return answer.status, text

    return await asyncio.to_thread(ask)


async def test_alive_is_not_getting_data(vehicle, short, port, sender):
    """Before the first message and after the last: alive, not ready, with the source's name; while they come: ready."""
    service = Service(vehicle, [f"udp://127.0.0.1:{port}"], [f"studio://127.0.0.1:{port}"])
    good = messages(short.recording, 200)
    silence, began, clock = 0.0, service.inbox.clock(), service.inbox.clock
    # A hundredth as fast as time: no busy machine makes a source silent, only `silence` does.
    service.inbox.clock = lambda: began + silence + 0.01 * (clock() - began)
    async with running(service):
        assert await get(port, "/health/live") == (200, "alive\n")
        status, why = await get(port, "/health/ready")
        assert (status, why) == (503, f"nothing has come from udp://127.0.0.1:{port} yet\n")
        sender.send(*good)
        await until(lambda: service.core.rows == 200)
        assert await get(port, "/health/ready") == (200, "getting data\n")
        silence = 0.8  # 0.5 s, and predictions go on meanwhile
        status, why = await get(port, "/health/ready")
        assert status == 503
        assert why.startswith(f"nothing came from udp://127.0.0.1:{port} for ")
        assert why.count("\n") == 1
        assert await get(port, "/health/live") == (200, "alive\n")
        sender.send(*messages(short.recording, 300)[200:])
        await until(lambda: service.core.rows == 300)
        assert (await get(port, "/health/ready"))[0] == 200


async def test_messages_that_give_no_row_are_no_data(vehicle, port, sender):
    service = Service(vehicle, [f"udp://127.0.0.1:{port}"], [f"studio://127.0.0.1:{port}"])
    async with running(service):
        sender.send(b"nonsense")
        await until(lambda: service.feeds[0].unreadable)
        assert await get(port, "/health/ready") == (503, "no row has been estimated yet\n")


async def test_where_a_token_is_set_nothing_is_told_without_it(vehicle, port, monkeypatch):
    monkeypatch.setenv("TERRAGRIP_TOKEN", "a-token-of-many-characters")
    service = Service(vehicle, [f"udp://127.0.0.1:{port}"], [f"studio://0.0.0.0:{port}"])
    async with running(service):
        assert (await get(port, "/health/live"))[0] == 401
        assert (await get(port, "/health/live", Authorization="Bearer wrong"))[0] == 401
        mine = {"Authorization": "Bearer a-token-of-many-characters"}
        assert (await get(port, "/health/live", **mine))[0] == 200
        assert (await get(port, "/health/live", Origin="https://elsewhere.example", **mine))[0] == 403


LABEL = r'[a-z_]+="(?:[^"\\\\\n]|\\\\["\\\\n])*"'
SAMPLE = re.compile(rf"([a-z_]+)(?:\{{({LABEL}(?:,{LABEL})*)\}})? (\S+)")


def parsed(page: str) -> dict[str, float]:
    """Samples by name and labels; fails on what is not Prometheus's text format, or against its rules of naming."""
    assert page.endswith("\n")
    kinds, result = {}, {}
    for line in page.splitlines():
        if line.startswith("# TYPE "):
            _, _, name, kind = line.split(" ")
            assert name not in kinds
            assert name.endswith("_total") == (kind == "counter"), name
            kinds[name] = kind
        elif not line.startswith("# HELP "):
            sample = SAMPLE.fullmatch(line)
            assert sample, line
            assert sample[1] in kinds, line
            key = sample[1] + (f"{{{sample[2]}}}" if sample[2] else "")
            assert key not in result
            result[key] = float(sample[3])
    return result


@pytest.mark.parametrize(
    "name",
    [
        {"Host": "evil.example"},
        {"Host": "127.0.0.1.evil.example:8766"},
        {"Origin": "http://127.evil.example"},
        {"Origin": "http://[::"},
    ],
)
async def test_a_site_whose_name_leads_here_is_told_nothing(vehicle, port, name):
    service = Service(vehicle, [f"udp://127.0.0.1:{port}"], [f"studio://127.0.0.1:{port}"])
    async with running(service):
        assert (await get(port, "/metrics", **name))[0] == 403
        assert (await get(port, "/metrics", Host=f"localhost:{port}"))[0] == 200


async def test_metrics_are_what_went_in_and_what_came_out(tmp_path, vehicle, short, port, sender):
    """Against what the test itself sent: 200 messages of which 5 are left out, one is doubled, and one is nonsense."""
    service = Service(
        vehicle, [f"udp://127.0.0.1:{port}"], [f"studio://127.0.0.1:{port}"], record=tmp_path / "r"
    )
    good = messages(short.recording, 200)
    sent = [*good[:100], *good[105:], good[-1], b"nonsense"]
    async with running(service):
        before = parsed((await get(port, "/metrics"))[1])
        assert (before["terragrip_live_rows_total"], before["terragrip_live_ready"]) == (0, 0)
        sender.send(*sent)
        await until(lambda: service.core.rows == 195 and service.feeds[0].unreadable == 1)
        await until(lambda: service.core.counts.total("unreadable") == 1)
        page = parsed((await get(port, "/metrics"))[1])
    assert page["terragrip_live_ready"] == 1
    assert page["terragrip_live_samples_total"] == 196
    assert page["terragrip_live_rows_total"] == 195
    assert page["terragrip_live_recorded_rows_total"] == 195
    assert page["terragrip_live_filter_restarts_total"] == 0
    assert page["terragrip_live_queue_samples"] == 0
    of_speed = 'terragrip_live_values_total{channel="ground_speed",fate="%s"}'
    fates = {
        "received": 196,
        "missing": 5,
        "doubled": 1,
        "late": 0,
        "dropped": 0,
        "unreadable": 0,
        "clock": 0,
    }
    assert {fate: page[of_speed % fate] for fate in fates} == fates
    assert page['terragrip_live_events_total{event="unreadable"}'] == 1
    assert 0 < page["terragrip_live_delay_seconds_total"] < 195 * 5
    nis = [m.row.estimate for m in service.seen if m.kind == "estimate" and not m.row.predicted]
    measured = [one["nis"] for one in nis if one["nis"] == one["nis"]]
    assert page["terragrip_live_nis_total"] == pytest.approx(sum(measured))
    assert page["terragrip_live_nis_expected_total"] == sum(
        one["channels"] for one in nis if one["nis"] == one["nis"]
    )


def source() -> Feed:
    profile = Profile.from_dict({"time": {"from": "t"}, "channels": {"ground_speed": "v"}})
    return Feed(0, "serial:x", Decoder(profile), unpacker(None), Inbox(), after=float("-inf"))


async def test_the_period_of_a_source_is_its_own_and_no_silence_becomes_it():
    feed = source()
    for now in (1.0, 2.1, 3.0, 4.0, 5.1, 6.0):
        feed.sample(now, {"ground_speed": 1.0})
        assert feed.silence(now) == 0.0  # there is a message, though nobody has looked yet
        feed.watch(now, 0.01)
    assert feed.period == pytest.approx(1.0, abs=0.11)
    feed.sample(66.0, {"ground_speed": 1.0})
    feed.watch(66.0, 0.01)
    assert feed.period == pytest.approx(1.0, abs=0.11)
    assert feed.silence(67.5) == 1.5


async def test_a_receiver_without_a_fix_that_falls_silent_has_no_excuse_any_more():
    """The page of its health said "its sentences have no fix" long after its cable was cut."""
    feed = source()
    now = 100.0
    feed.inbox.clock = lambda: now
    feed.sample(now, {"ground_speed": 1.0})
    feed.watch(now, 0.01)
    now = 110.0
    feed.excuse("its sentences have no fix")
    assert feed.excuse_at(110.5) == "its sentences have no fix"
    assert (feed.why_old(110.5) or "").endswith(": its sentences have no fix")
    assert feed.why_old(130.0) == "nothing came from serial:x for 30.0 s"


async def test_a_slow_source_beside_a_fast_one_is_not_lost_between_its_messages(vehicle, short, port, sender):
    """A receiver that sends every 0.8 to 1.3 s beside wheels at 100 Hz: its rhythm is no loss once it is known."""
    service = Service(vehicle, ["udp://127.0.0.1:1", "udp://127.0.0.1:2"])
    now = 1000.0
    service.inbox.clock = lambda: now
    service.statistics = type(service.statistics)(
        service.core, service.inbox, service.feeds, service.outboxes, True
    )
    due, gaps = now, [0.8, 1.3, 0.9, 1.2, 1.1, 1.3, 0.8, 1.3]
    lost = []
    for _ in range(100):
        now += 0.1
        service.feeds[0].sample(now, {"ground_speed": 1.0})
        if now >= due and gaps:
            service.feeds[1].sample(now, {"latitude": 50.0})
            due = now + gaps.pop(0)
        service.statistics.watch(now)
        lost += [note for note in service.inbox.notes() if "event" in note]
    kinds = [(note["event"]["kind"], note["event"]["source"]) for note in lost]
    assert kinds.count(("source_lost", "udp://127.0.0.1:2")) == 1, kinds  # once the messages have ended


async def test_a_source_of_one_message_a_second_is_not_lost_before_its_period_is_known(vehicle):
    now, lost = [1000.0], []
    box = Inbox(clock=lambda: now[0])
    feed = Feed(0, "udp://a", Decoder(None), unpacker(None), box, after=0.0)
    statistics = Statistics(Core(vehicle, Settings(("udp://a",))), box, [feed], [], True)
    for tick in range(100):
        now[0] = 1000.0 + 0.1 * tick
        if tick in (5, 16, 26):
            feed.fields({"time": now[0], "ground_speed": 1.0})
            box.pop(1)
        statistics.watch(now[0])
        lost += [tick for note in box.notes() if "event" in note]
    assert lost == [49]  # more than two periods after the last
    assert statistics.to_dict()["silent"] == ["nothing came from udp://a for 7.3 s"]
