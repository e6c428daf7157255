"""What of RFC 6455 a client needs that only listens."""
from __future__ import annotations

import base64
import hashlib
import os
import socket as sockets
import struct
from typing import Iterator

MAGIC = "258EAFA5-E914-47DA-95CA-C5AB0DC85B11"
LONGEST_MESSAGE = 64 * 1024 * 1024
LONGEST_HEAD = 16 * 1024
# The server pings; who hears nothing for so long has lost it.
SILENCE_S = 40.0
CONTINUATION, TEXT, BINARY, CLOSE, PING, PONG = 0, 1, 2, 8, 9, 10


class WebSocket:
    """Over a connected socket, which it closes. Raises ConnectionError."""

    def __init__(self, link: sockets.socket, host: str, target: str) -> None:
        self._link = link
        self._buffer = b""
        try:
            self._shake_hands(host, target)
            link.settimeout(SILENCE_S)
        except BaseException:
            link.close()
            raise

    def __enter__(self) -> WebSocket:
        return self

    def __exit__(self, *_: object) -> None:
        try:
            self._send(CLOSE, struct.pack("!H", 1000))
        except OSError:
            pass
        self._link.close()

    def messages(self) -> Iterator[str]:
        """Texts until the server hangs up, which is a ConnectionError."""
        parts: list[bytes] = []
        while True:
            final, code, payload = self._frame()
            if code == PING:
                self._send(PONG, payload)
            elif code == CLOSE:
                why = payload[2:].decode("utf-8", "replace")
                raise ConnectionError("vibrigd hung up" + (": " + why if why else ""))
            elif code in (TEXT, BINARY, CONTINUATION):
                parts.append(payload)
                if sum(map(len, parts)) > LONGEST_MESSAGE:
                    raise ConnectionError(f"stream: found a message above {LONGEST_MESSAGE} bytes")
                if final:
                    yield b"".join(parts).decode("utf-8", "replace")
                    parts = []

    def _shake_hands(self, host: str, target: str) -> None:
        key = base64.b64encode(os.urandom(16)).decode()
        self._link.sendall((f"GET {target} HTTP/1.1\r\nHost: {host}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
                            f"Sec-WebSocket-Key: {key}\r\nSec-WebSocket-Version: 13\r\n\r\n").encode("ascii"))
        while b"\r\n\r\n" not in self._buffer:
            if len(self._buffer) > LONGEST_HEAD:
                raise ConnectionError("stream: found no end of the answer's head")
            self._more()
        head, self._buffer = self._buffer.split(b"\r\n\r\n", 1)
        lines = head.decode("latin-1").split("\r\n")
        fields = {name.strip().lower(): value.strip() for name, _, value in (line.partition(":") for line in lines[1:])}
        if " 101 " not in lines[0] + " ":
            raise ConnectionError(f"stream: found \"{lines[0]}\", expected 101")
        accept = base64.b64encode(hashlib.sha1((key + MAGIC).encode()).digest()).decode()
        if fields.get("sec-websocket-accept") != accept:
            raise ConnectionError("stream: found another Sec-WebSocket-Accept than the key's")

    def _more(self) -> None:
        try:
            data = self._link.recv(1 << 16)
        except TimeoutError as error:
            raise ConnectionError(f"stream: found silence for {self._link.gettimeout():g} s") from error
        if not data:
            raise ConnectionError("vibrigd closed the connection")
        self._buffer += data

    def _take(self, count: int) -> bytes:
        while len(self._buffer) < count:
            self._more()
        taken, self._buffer = self._buffer[:count], self._buffer[count:]
        return taken

    def _frame(self) -> tuple[bool, int, bytes]:
        first, second = self._take(2)
        if first & 0x70 or second & 0x80:
            raise ConnectionError("stream: found a frame with reserved bits or a mask, expected none from a server")
        size = second & 0x7F
        if size == 126:
            size = struct.unpack("!H", self._take(2))[0]
        elif size == 127:
            size = struct.unpack("!Q", self._take(8))[0]
        if size > LONGEST_MESSAGE:
            raise ConnectionError(f"stream: found a frame of {size} bytes, expected at most {LONGEST_MESSAGE}")
        return bool(first & 0x80), first & 0x0F, self._take(size)

    def _send(self, code: int, payload: bytes) -> None:
        payload = payload[:125]
        mask = os.urandom(4)
        masked = bytes(byte ^ mask[i % 4] for i, byte in enumerate(payload))
        self._link.sendall(bytes([0x80 | code, 0x80 | len(payload)]) + mask + masked)
