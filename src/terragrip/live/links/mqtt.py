"""Topics of an MQTT broker, by paho: reads and writes are made in the event loop, many messages in one turn."""

from __future__ import annotations

import asyncio
import select
import socket
import ssl
from collections import deque
from collections.abc import Callable
from typing import Any, Self

from terragrip.errors import InputError
from terragrip.live.credentials import Credentials
from terragrip.live.feed import Lost, Receiver
from terragrip.live.outbox import Outbox
from terragrip.live.topics import of_vehicle
from terragrip.live.uri import Uri, is_loopback

_PATIENCE = 5.0  # s for the broker to answer, and to take what is left at the end
_AT_ONCE = 64  # messages before others have their turn
_UNACKNOWLEDGED = 20  # messages of quality 1 or 2: of more mosquitto holds some back
_KEEP = 1.0  # s between two looks at whether the broker is alive


class MqttSource:
    """``mqtt://HOST/machine/+``. A field is ``name``, or ``topic/name`` where the profile says so; a bare number is ``topic``.

    Retained messages, which a broker sends again to whoever subscribes, are left out.
    """

    real_time = True

    def __init__(self, uri: Uri, *_: object) -> None:
        self.uri = uri
        self.qos = quality(uri)
        check(uri, wild=True)

    async def run(self, feed: Receiver) -> None:
        """Feed messages; raises Lost where the broker refuses or goes away."""
        async with Connection(self.uri, lambda topic, data: feed.message(data, topic=topic)) as broker:
            await broker.subscribe(self.uri.path, self.qos)
            feed.connected()
            await broker.ended()


class MqttSink:
    """``mqtt://HOST/terragrip``: to ``terragrip/estimate``, ``terragrip/event``, ``/status``, ``/soil``, ``/ground`` and ``/setpoint``.

    ``{vehicle}`` in the topic stands for the name of a message's vehicle.
    """

    def __init__(self, uri: Uri, *_: object) -> None:
        self.uri = uri
        self.qos = quality(uri)
        check(uri)
        self._again: deque[tuple[str, bytes]] = deque()  # what no broker acknowledged

    async def run(self, outbox: Outbox) -> None:
        """Publish messages; raises Lost where the broker refuses or goes away."""
        prefix, sent = self.uri.path.rstrip("/"), 0
        async with Connection(self.uri) as broker:
            outbox.connected()
            try:
                while True:
                    if self._again:
                        topic, data = self._again.popleft()
                    else:
                        message = await outbox.get()
                        topic = f"{of_vehicle(prefix, message.vehicle)}/{message.kind}"
                        data = message.json(outbox.columns)
                    broker.publish(topic, data, self.qos)
                    sent += 1
                    if not broker.has_room or not sent % _AT_ONCE:
                        await broker.room()
            finally:
                self._again.extendleft(reversed(broker.unacknowledged.values()))


def check(uri: Uri, wild: bool = False) -> Credentials:
    """Raise InputError on a missing host or topic, a wild card that is not allowed (``wild``: some are), a CA that cannot be read, or a
    password that would be sent in plain text.
    """
    import paho.mqtt.client  # noqa: F401  # so that a missing package is said at once

    if not uri.host or not uri.path.strip("/"):
        raise InputError("has no broker or no topic", place=uri.text, hint="write mqtt://127.0.0.1/machine/+")
    levels = uri.path.split("/")
    proper = levels.count("+") + (levels[-1] == "#") if wild else 0
    if uri.path.count("+") + uri.path.count("#") > proper:
        hint = "+ stands for one whole level, # for all at the end" if wild else "name one topic"
        raise InputError("has a wild card in the wrong place", place=uri.text, hint=hint)
    credentials = Credentials.find()
    if uri.scheme == "mqtts":
        _tls(uri)
    elif credentials.password and not is_loopback(uri.host):
        raise InputError("the password would be sent unencrypted", place=uri.text, hint="use mqtts:")
    return credentials


class Connection:
    """A connection by ``mqtt://HOST[:1883]/TOPIC`` or, with TLS, ``mqtts://HOST[:8883]/TOPIC?ca=FILE``, while an ``async with`` lasts.

    ``take`` gets topic and bytes of each message that comes, but retained ones, in the loop; what it raises ends the connection. Lost
    is raised where the broker cannot be reached, refuses or goes away; InputError as by `check`. Needs a running loop.
    """

    def __init__(self, uri: Uri, take: Callable[[str, bytes], None] | None = None) -> None:
        from paho.mqtt.client import Client
        from paho.mqtt.enums import CallbackAPIVersion

        self.unacknowledged: dict[int, tuple[str, bytes]] = {}  # published with quality 1 or 2, in order
        credentials, self._secure = check(uri, wild=True), uri.scheme == "mqtts"
        self._where = uri.host, uri.port or (8883 if self._secure else 1883)
        self._loop = asyncio.get_running_loop()
        self._progress = asyncio.Event()  # set where anything that may be waited for has changed
        self._failure: Exception | None = None
        self._is_accepted = self._is_subscribed = False
        self._poller = select.poll()
        client = self._client = Client(
            CallbackAPIVersion.VERSION2, uri.options.get("client"), reconnect_on_failure=False
        )
        client.username_pw_set(credentials.username, credentials.password)
        if self._secure:
            client.tls_set_context(_tls(uri))
        client.connect_timeout = _PATIENCE
        client.max_inflight_messages = _UNACKNOWLEDGED
        client.on_connect, client.on_disconnect = self._accepted, self._disconnected
        client.on_subscribe = self._subscribed
        if take is not None:
            client.on_message = lambda _, __, message: (
                # What a broker retained for new subscribers is of any age: as a first sample it would set the clock.
                None if message.retain else take(message.topic, bytes(message.payload))
            )

    async def __aenter__(self) -> Self:
        client = self._client
        try:
            await asyncio.to_thread(client.connect, *self._where)
        except (OSError, UnicodeError) as error:  # a host's name may be no text that DNS knows
            raise Lost(f"the broker: {getattr(error, 'strerror', None) or error}") from error
        link: Any = client.socket()
        if link is None:
            raise Lost("the broker: closed the connection")
        # Or a message waits up to 40 ms for the broker to acknowledge the one before (Nagle's algorithm).
        link.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._number = link.fileno()
        client.on_socket_close = lambda *_: self._forget()
        self._poller.register(self._number, select.POLLIN)
        self._loop.add_reader(self._number, self._read)
        self._timer = self._loop.call_later(_KEEP, self._keep_alive)
        try:
            async with asyncio.timeout(_PATIENCE):
                await self._until(lambda: self._is_accepted)
        except TimeoutError:
            self._close()
            raise Lost(f"the broker: no answer for {_PATIENCE:.0f} s") from None
        except BaseException:
            self._close()
            raise
        return self

    async def __aexit__(self, *_: object) -> None:
        try:
            if self._failure is None:
                async with asyncio.timeout(_PATIENCE):
                    await self._until(lambda: not self.unacknowledged)
                    self._client.disconnect()  # behind what is still to be written
                    self._await_room()
                    await self.ended()
        except (TimeoutError, Lost):
            pass
        finally:
            self._close()

    async def subscribe(self, topic: str, qos: int) -> None:
        """Have the messages of a topic; they come while `ended` is awaited, and before."""
        self._client.subscribe(topic, qos)
        self._await_room()
        await self._until(lambda: self._is_subscribed)

    async def ended(self) -> None:
        """Wait until the connection is lost, and raise why."""
        await self._until(lambda: False)

    def publish(self, topic: str, data: bytes, qos: int) -> None:
        """Send a message, as far as there is room before the broker; `room` waits for that."""
        if qos and self._client.on_publish is None:  # a call that costs as much as the message
            self._client.on_publish = self._acknowledged
        info = self._client.publish(topic, data, qos)
        if qos:
            self.unacknowledged[info.mid] = topic, data
        if self._failure is not None:
            raise self._failure
        self._await_room()

    @property
    def has_room(self) -> bool:
        """Whether all was written, and the broker has few left to acknowledge."""
        return not self._client.want_write() and len(self.unacknowledged) < _UNACKNOWLEDGED

    async def room(self) -> None:
        """Wait until there is room; lets others have their turn in any case."""
        await asyncio.sleep(0)
        await self._until(lambda: self.has_room)

    async def _until(self, condition: Callable[[], bool]) -> None:
        while not condition():
            if self._failure is not None:
                raise self._failure
            self._progress.clear()
            await self._progress.wait()

    def _read(self) -> None:
        """Take what has come, up to some messages; the loop calls again where there are more."""
        try:
            for _ in range(_AT_ONCE):
                self._client.loop_read()  # a packet
                if self._failure is not None or not (self._is_decrypted() or self._poller.poll(0)):
                    break
        except Exception as error:  # noqa: BLE001 - whatever `take` raised: to whom waits, not to the loop
            self._fail(error)
        self._await_room()
        if self._is_decrypted():
            self._loop.call_soon(self._read)

    def _is_decrypted(self) -> bool:
        """Whether TLS holds bytes that the loop does not see."""
        link: Any = self._client.socket() if self._secure else None
        return link is not None and link.pending() > 0

    def _await_room(self) -> None:
        if self._failure is None and self._client.want_write():
            self._loop.add_writer(self._number, self._write)

    def _write(self) -> None:
        self._client.loop_write()
        if self._failure is None and not self._client.want_write():
            self._loop.remove_writer(self._number)
            self._progress.set()

    def _keep_alive(self) -> None:
        self._client.loop_misc()
        if self._failure is None:
            self._await_room()
            self._timer = self._loop.call_later(_KEEP, self._keep_alive)

    def _accepted(self, _: object, __: object, ___: object, reason: Any, *____: object) -> None:
        if reason.is_failure:
            self._fail(Lost(f"the broker: {reason}"))
            return
        self._is_accepted = True
        self._progress.set()

    def _subscribed(self, _: object, __: object, ___: object, reasons: Any, *____: object) -> None:
        if reasons[0].is_failure:
            self._fail(Lost(f"the broker refuses the topic: {reasons[0]}"))
            return
        self._is_subscribed = True
        self._progress.set()

    def _acknowledged(self, _: object, __: object, mid: int, *___: object) -> None:
        self.unacknowledged.pop(mid, None)
        self._progress.set()

    def _disconnected(self, _: object, __: object, ___: object, reason: Any, *____: object) -> None:
        self._fail(Lost(f"the broker: the connection is lost ({reason})"))

    def _fail(self, why: Exception) -> None:
        if self._failure is None:
            self._failure = why
        self._progress.set()

    def _forget(self) -> None:
        self._loop.remove_reader(self._number)
        self._loop.remove_writer(self._number)
        self._timer.cancel()

    def _close(self) -> None:
        link: Any = self._client.socket()
        if link is not None:
            self._forget()
            link.close()


def _tls(uri: Uri) -> ssl.SSLContext:
    try:
        return ssl.create_default_context(cafile=uri.options.get("ca"))
    except (OSError, ssl.SSLError) as error:
        raise InputError(
            f"the CA cannot be read ({error.strerror or error})", file=uri.options.get("ca"), place=uri.text,
            hint="name a PEM file",
        ) from error  # fmt: skip


def quality(uri: Uri) -> int:
    """The quality of service asked for; raises InputError unless it is 0, 1 or 2."""
    return int(uri.choice("qos", ("0", "1", "2")))
