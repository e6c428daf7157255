"""A running vibrigd, looked at over its socket, its page or TLS. It commands nothing."""
from __future__ import annotations

import http.client
import json
import os
import socket as sockets
import ssl
import urllib.parse
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Iterator, Mapping, Sequence, Union

import numpy as np

from vibrig._coefficients import Coefficients
from vibrig._websocket import WebSocket

DEFAULT_SOCKET = "/run/vibrig/status.sock"
DEFAULT_PORT = 8443
LONGEST_ANSWER = 64 * 1024 * 1024

Event = Mapping[str, Any]


class Answer(Exception):
    """vibrigd refused: `status` (HTTP) and `detail`, its words."""

    def __init__(self, status: int, detail: str) -> None:
        super().__init__(f"{status}: {detail}")
        self.status = status
        self.detail = detail


@dataclass(frozen=True)
class Update:
    """What the stream tells: the whole status as it is now, or events that are new, or both."""

    status: Mapping[str, Any]
    events: Sequence[Event]


class _Connection(http.client.HTTPConnection):
    """HTTP over whatever `dial` gives."""

    def __init__(self, host: str, dial: Any, timeout_s: float) -> None:
        super().__init__(host, timeout=timeout_s)
        self._dial = dial

    def connect(self) -> None:
        self.sock = self._dial()


class Client:
    """A look at a rig. One of
      socket=PATH            a Unix socket of its machine (default: $VIBRIG_SOCKET, or /run/vibrig/status.sock)
      page="http://127.0.0.1:8090/"   the live page's address
      host="rig.lab", identity="vibrig-pki/wall"   TLS with a certificate, as `vibrig pki init` made it; authority.crt
                             lies beside it

    Everything raises OSError when the rig does not answer (within `timeout_s`), Answer when it refuses. Numbers of 64
    bits are texts in its JSON, as protobuf writes them. Not for several threads at a time.
    """

    def __init__(self, socket: Union[str, "os.PathLike[str]", None] = None, *, page: str | None = None,
                 host: str | None = None, identity: Union[str, "os.PathLike[str]", None] = None,
                 timeout_s: float = 10.0) -> None:
        if sum(given is not None for given in (socket, page, host)) > 1:
            raise ValueError("found several of socket, page and host, expected one of them")
        if (host is None) != (identity is None):
            raise ValueError("host and identity: found one of them, expected both or none")
        if not isinstance(timeout_s, (int, float)) or not 0 < timeout_s <= 86400:
            raise ValueError(f"timeout_s: found {timeout_s!r}, expected seconds above 0, 86400 at most")
        self._timeout_s = timeout_s
        self._tls: ssl.SSLContext | None = None
        self._path: str | None = None
        if host is not None:
            self._where = _host_and_port(host)
            self._tls = _mutual_tls(Path(str(identity)))
            self._name = host
        elif page is not None:
            self._where = _where_of_page(page)
            self._name = urllib.parse.urlsplit(page).netloc
        else:
            self._path = os.fspath(socket) if socket is not None else os.environ.get("VIBRIG_SOCKET", DEFAULT_SOCKET)
            self._where = "localhost", 0
            self._name = "localhost"
        self._connection: _Connection | None = None

    def __enter__(self) -> Client:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        if self._connection is not None:
            self._connection.close()
            self._connection = None

    def status(self) -> Mapping[str, Any]:
        """The whole status, as `vibrig status --json`."""
        return self._object("/api/v1/status")

    def campaign(self) -> Mapping[str, Any]:
        return self._object("/api/v1/campaign")

    def parameters(self) -> Mapping[str, Any]:
        """The result so far."""
        return self._object("/api/v1/parameters")

    def coefficients(self) -> Coefficients:
        """Of the result so far, by the filter's noise alone: `u` is NaN, a finished campaign's result has it. Raises
        ValueError while there is none."""
        result = self.parameters()
        if not result.get("parameters"):
            raise ValueError("parameters: found none yet, expected 30")
        return Coefficients.of_result(result)

    def plan(self) -> Mapping[str, Any]:
        return self._object("/api/v1/plan")

    def configuration(self) -> str:
        """In force, as vibrigd --check prints it."""
        text: str = self._object("/api/v1/config")["text"]
        return text

    def selftest(self) -> Mapping[str, Any]:
        """What is looked at before a campaign; makes nothing move."""
        return self._object("/api/v1/selftest")

    def metrics(self) -> str:
        """For Prometheus."""
        return self._get("/metrics").decode()

    def events(self, after: int = 0, limit: int = 1000) -> Sequence[Event]:
        """With a greater id than `after`, oldest first."""
        found: Sequence[Event] = self._object(f"/api/v1/events?after={after:d}&limit={limit:d}").get("events", [])
        return found

    def history(self, *channels: str, from_s: float | None = None) -> dict[str, np.ndarray[Any, Any]]:
        """The campaign so far: "time_s" and, for each channel, its mean, NAME_min and NAME_max; NaN: not known.

        s of the daemon's clock, units as /api/v1/history states them. At most 1200 steps.
        """
        query = {"channel": ",".join(channels), **({} if from_s is None else {"from": repr(float(from_s))})}
        answer = self._object("/api/v1/history?" + urllib.parse.urlencode(query, safe=","))
        try:
            curves = {"time_s": np.array(answer["time_s"], dtype=float)}
            for channel in answer["channels"]:
                for of, name in (("mean", channel["name"]), ("min", channel["name"] + "_min"),
                                 ("max", channel["name"] + "_max")):
                    curves[name] = np.array(channel[of], dtype=float)  # null becomes NaN
            return curves
        except (KeyError, TypeError, ValueError) as error:
            raise Answer(200, f"/api/v1/history: found {str(answer)[:60]}, expected time_s and channels") from error

    def stream(self, rate_hz: float = 1.0, *, after: int = 0, status: bool = True) -> Iterator[Update]:
        """The status as it changes and events as they happen, until the connection ends (OSError).

        `status=False`: events alone. Leave the loop, or close() the generator, to hang up.
        """
        target = "/api/v1/stream?" + urllib.parse.urlencode(
            {"rate_hz": repr(float(rate_hz)), "after": int(after), "status": "true" if status else "false"})
        now: Any = {}
        with WebSocket(self._dial(), self._name, target) as link:
            for text in link.messages():
                message = _message(text)
                kind = message["type"]
                if kind == "status":
                    now = message["status"]
                elif kind == "delta":
                    now = merge_patch(now, message["patch"])
                elif kind != "events":
                    continue
                yield Update(now, message.get("events", []) if kind == "events" else [])

    def _dial(self) -> sockets.socket:
        if self._path is not None:
            plain = sockets.socket(sockets.AF_UNIX)
            plain.settimeout(self._timeout_s)
            try:
                plain.connect(self._path)
            except OSError as error:
                plain.close()
                raise ConnectionError(f"{self._path}: no vibrigd answers there ({error}); is it running?") from error
            return plain
        link = sockets.create_connection(self._where, self._timeout_s)
        if self._tls is None:
            return link
        try:
            return self._tls.wrap_socket(link, server_hostname=self._where[0])
        except OSError:
            link.close()
            raise

    def _get(self, target: str) -> bytes:
        for attempt in (0, 1):
            kept = self._connection is not None
            connection = self._connection = self._connection or _Connection(self._name, self._dial, self._timeout_s)
            try:
                connection.request("GET", target)
                answer = connection.getresponse()
                body = answer.read(LONGEST_ANSWER)
                if answer.will_close:
                    self.close()
                break
            except (OSError, http.client.HTTPException) as error:
                self.close()
                # A connection that was kept may have ended meanwhile.
                if not (kept and attempt == 0):
                    raise error if isinstance(error, OSError) else ConnectionError(repr(error)) from error
        # selftest answers 200, readiness 503 with the same words.
        if answer.status >= 400:
            raise Answer(answer.status, _words(body))
        return body

    def _object(self, target: str) -> Mapping[str, Any]:
        body = self._get(target)
        try:
            value = json.loads(body)
        except ValueError as error:   # another program answers there
            raise Answer(200, f"{target}: found no JSON ({error}), expected an object") from error
        if not isinstance(value, dict):
            raise Answer(200, f"{target}: found {type(value).__name__}, expected an object")
        return value


def _message(text: str) -> Mapping[str, Any]:
    """Of the stream. Raises ConnectionError: who sends another is no vibrigd."""
    try:
        message = json.loads(text)
    except ValueError:
        message = None
    if not isinstance(message, dict) or "type" not in message:
        raise ConnectionError(f"stream: found {text[:60]!r}, expected a JSON object with a type")
    for kind, name in (("status", "status"), ("delta", "patch")):
        if message["type"] == kind and name not in message:
            raise ConnectionError(f"stream: found {text[:60]!r}, expected a {name} in it")
    return message


def merge_patch(target: Any, patch: Any) -> Any:
    """RFC 7396; neither argument is changed."""
    if not isinstance(patch, dict):
        return patch
    merged = dict(target) if isinstance(target, dict) else {}
    for name, value in patch.items():
        if value is None:
            merged.pop(name, None)
        else:
            merged[name] = merge_patch(merged.get(name), value)
    return merged


def _words(body: bytes) -> str:
    text = body.decode("utf-8", "replace")
    try:
        problem = json.loads(text)
        return str(problem.get("detail") or problem.get("title") or text)
    except (ValueError, AttributeError):
        return text.strip()[:500]


def _where_of_page(page: str) -> tuple[str, int]:
    try:
        address = urllib.parse.urlsplit(page)
        if address.scheme != "http" or not address.hostname or address.port == 0:
            raise ValueError
        return address.hostname, address.port or 80
    except (AttributeError, TypeError, ValueError):
        raise ValueError(f"page: found {page!r}, expected an address such as http://127.0.0.1:8090/") from None


def _host_and_port(host: str) -> tuple[str, int]:
    """rig.lab, rig.lab:8443, [fe80::1]:8443"""
    try:
        parts = urllib.parse.urlsplit("//" + host)
        if not parts.hostname or parts.path or parts.port == 0:
            raise ValueError
        return parts.hostname, parts.port or DEFAULT_PORT
    except ValueError:
        raise ValueError(f"host: found {host!r}, expected a name or address, with :PORT if not {DEFAULT_PORT}") from None


def _mutual_tls(identity: Path) -> ssl.SSLContext:
    files = [identity.parent / "authority.crt", Path(f"{identity}.crt"), Path(f"{identity}.key")]
    for file in files:
        if not file.is_file():
            raise FileNotFoundError(f"{file}: found nothing, expected it as `vibrig pki init` makes it")
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    context.minimum_version = ssl.TLSVersion.TLSv1_2
    context.load_verify_locations(files[0])
    context.load_cert_chain(files[1], files[2])
    return context
