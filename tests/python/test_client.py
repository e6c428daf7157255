"""vibrig.Client against a server that answers as set; the real one is tests/hil/python_package.py."""
import base64
import contextlib
import hashlib
import http.server
import json
import socket
import struct
import threading

import pytest

import vibrig
from vibrig._client import _host_and_port, merge_patch
from vibrig._websocket import MAGIC

HISTORY = {"step_s": 0.5, "time_s": [1, 2], "channels": [{"name": "temperature_c", "unit": "degC", "min": [1, None],
                                                          "max": [3, None], "mean": [2, None]}]}


def frame(text, code=1, final=True, mask=False):
    payload = text.encode() if isinstance(text, str) else text
    size = len(payload)
    head = bytes([(0x80 if final else 0) | code])
    extra = struct.pack("!H", size) if 126 <= size < 65536 else struct.pack("!Q", size) if size >= 65536 else b""
    return head + bytes([(0x80 if mask else 0) | (size if size < 126 else 126 if size < 65536 else 127)]) + extra + payload


class Handler(http.server.BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"
    frames = b""
    wrong_key = False

    def log_message(self, *_):
        pass

    def do_GET(self):
        if self.path.startswith("/api/v1/stream"):
            key = self.headers["Sec-WebSocket-Key"] + MAGIC + ("x" if self.wrong_key else "")
            self.send_response(101)
            self.send_header("Upgrade", "websocket")
            self.send_header("Connection", "Upgrade")
            self.send_header("Sec-WebSocket-Accept", base64.b64encode(hashlib.sha1(key.encode()).digest()).decode())
            self.end_headers()
            self.wfile.write(self.frames)
            self.close_connection = True
            # What the client says meanwhile is read: else closing would take back what was written.
            self.connection.shutdown(socket.SHUT_WR)
            with contextlib.suppress(OSError):
                while self.connection.recv(4096):
                    pass
            return
        status, body = {"/api/v1/status": (200, {"campaign": {"state": "idle"}}),
                        "/api/v1/plan": (200, [1]),
                        "/api/v1/selftest": (200, b"<html>another program"),
                        "/api/v1/config": (403, {"title": "Forbidden", "detail": "viewers may not"}),
                        "/api/v1/history?channel=deaf": (200, {"time_s": "x"}),
                        }.get(self.path, (200, HISTORY))
        self.server.asked.append(self.path)
        text = body if isinstance(body, bytes) else json.dumps(body).encode()
        self.send_response(status)
        self.send_header("Content-Length", str(len(text)))
        self.end_headers()
        self.wfile.write(text)


@pytest.fixture
def server():
    handler = type("Own", (Handler,), {})
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler) as own:
        own.asked = []
        threading.Thread(target=own.serve_forever, args=(0.02,), daemon=True).start()
        yield own
        own.shutdown()


@pytest.fixture
def client(server):
    with vibrig.Client(page=f"http://127.0.0.1:{server.server_port}/", timeout_s=5) as own:
        yield own


def streamed(client, limit=50):
    updates = []
    with contextlib.suppress(ConnectionError):
        for update in client.stream(5):
            updates.append(update)
            if len(updates) == limit:
                break
    return updates


def test_status_and_history(client, server):
    assert client.status()["campaign"]["state"] == "idle"
    curves = client.history("temperature_c", "measured_g", from_s=2)
    assert list(curves["temperature_c"][:1]) == [2] and curves["temperature_c_max"][1] != curves["temperature_c_max"][1]
    assert server.asked[1] == "/api/v1/history?channel=temperature_c,measured_g&from=2.0"


def test_refusals_have_the_words_of_the_daemon(client):
    with pytest.raises(vibrig.Answer, match="403: viewers may not"):
        client.configuration()
    with pytest.raises(vibrig.Answer, match="found list, expected an object"):
        client.plan()
    with pytest.raises(vibrig.Answer, match="/api/v1/selftest: found no JSON .*, expected an object"):
        client.selftest()
    with pytest.raises(vibrig.Answer, match="/api/v1/history: found {'time_s': 'x'}, expected time_s and channels"):
        client.history("deaf")


def test_the_stream_joins_patches_fragments_and_pings(client, server):
    big = {"type": "delta", "patch": {"a": {"b": None, "c": "x" * 70000}}}
    text = json.dumps({"type": "delta", "patch": {"n": 2}})
    server.RequestHandlerClass.frames = b"".join([
        frame('{"type":"hello","instance":"1","role":"viewer"}'),
        frame('{"type":"status","status":{"n":1,"a":{"b":1}}}'), frame(b"are you there", 9), frame(json.dumps(big)),
        frame(text[:5], final=False), frame(b"", 9), frame(text[5:], 0),
        frame('{"type":"events","events":[{"id":"7","text":"tripped"}]}'), frame(struct.pack("!H", 1000) + b"bye", 8)])
    updates = streamed(client)
    assert [u.status.get("n") for u in updates] == [1, 1, 2, 2]
    assert "b" not in updates[1].status["a"] and len(updates[1].status["a"]["c"]) == 70000
    assert updates[0].status["a"] == {"b": 1}, "what was given out is not changed"
    assert updates[-1].events[0]["text"] == "tripped" and not updates[0].events


@pytest.mark.parametrize("bad, words", [
    (frame("x", mask=True), "expected none from a server"), (b"\x81\x7f" + b"\x00\xff" * 4, "expected at most"),
    (frame("<html>"), "stream: found '<html>', expected a JSON object with a type"), (frame("[1]"), "stream: found '.1.', expected"),
    (frame('{"type":"delta"}'), "stream: found .*delta.*, expected a patch"),
    (b"\x81\x05ab", "closed the connection"), (frame(struct.pack("!H", 1001) + b"too slow", 8), "hung up: too slow")])
def test_a_stream_that_lies_ends(client, server, bad, words):
    server.RequestHandlerClass.frames = bad
    with pytest.raises(ConnectionError, match=words):
        list(client.stream())


def test_an_answer_to_another_key_is_refused(client, server):
    server.RequestHandlerClass.wrong_key = True
    with pytest.raises(ConnectionError, match="Sec-WebSocket-Accept"):
        list(client.stream())


def test_a_rig_that_does_not_answer(tmp_path):
    with pytest.raises(OSError, match="no vibrigd answers there"):
        vibrig.Client(tmp_path / "none.sock").status()
    with socket.socket() as deaf:
        deaf.bind(("127.0.0.1", 0))
        deaf.listen()
        with pytest.raises(OSError):
            vibrig.Client(page=f"http://127.0.0.1:{deaf.getsockname()[1]}", timeout_s=0.2).status()


def test_arguments(tmp_path):
    for arguments in ({"socket": "a", "page": "http://b"}, {"host": "rig"}, {"page": "https://rig"}, {"page": "rig"},
                      {"identity": "x"}):
        with pytest.raises(ValueError, match="expected"):
            vibrig.Client(**arguments)
    with pytest.raises(FileNotFoundError, match="authority.crt: found nothing"):
        vibrig.Client(host="rig", identity=tmp_path / "wall")
    assert _host_and_port("rig.lab") == ("rig.lab", 8443)
    assert _host_and_port("[fe80::1]:9") == ("fe80::1", 9)
    for page in ("http://127.0.0.1:99999/", "http://127.0.0.1:x/", "http://[::1/", "http://127.0.0.1:0/", 5):
        with pytest.raises(ValueError, match="page: found .*, expected an address such as"):
            vibrig.Client(page=page)
    for seconds in (-1, 0, float("nan"), "x", 1e300):
        with pytest.raises(ValueError, match="timeout_s: found .*, expected seconds above 0, 86400 at most"):
            vibrig.Client(timeout_s=seconds)
    for wrong in ("", "rig:port", "rig/x", "rig:0"):
        with pytest.raises(ValueError, match="host: found"):
            _host_and_port(wrong)


def test_merge_patch_of_rfc_7396():
    for target, patch, merged in [({"a": "b"}, {"a": "c"}, {"a": "c"}), ({"a": "b"}, {"a": None}, {}),
                                  ({"a": [1]}, {"a": {"b": None}}, {"a": {}}), ({"a": {"b": 1}}, {"a": 1}, {"a": 1}),
                                  ([1], {"a": {"bb": {"ccc": None}}}, {"a": {"bb": {}}}), ({"a": "b"}, ["c"], ["c"])]:
        assert merge_patch(target, patch) == merged
