"""Between vibrigd and the shaker's Modbus server: notes every write with its time, and spoils replies as set."""
import select
import socket
import struct
import threading
import time

RUN = 5   # register: 1 run, 0 stop
WATCHDOG = 6
INPUTS = 5   # state, fault, emergency stop, measured amplitude: read in one request


class Proxy:
    """`spoil` is one of None, "refuse", "hang", "freeze" (as a server that is stopped), "reset", "trickle", "transaction",
    "unit", "function", "length", "short", ("exception", N), ("late", seconds), ("measured", factor) of the measured amplitude, ("contact", 1) of the
    emergency stop, which reads open; `times` replies are spoilt, then it is None
    again (None: until set)."""

    def __init__(self, target):
        self.target = target
        self.writes = []        # (monotonic, address, values)
        self.connections = []   # monotonic
        self.heard = []         # monotonic, by connection: when it last asked for anything
        self.ends = set()       # sockets in use
        self.spoil, self.times = None, None
        self.port = 0
        self.revive()

    def break_with(self, spoil, times=None):
        self.times, self.spoil = times, spoil

    def revive(self):
        self.listener = socket.create_server(("127.0.0.1", self.port))
        self.port = self.listener.getsockname()[1]
        threading.Thread(target=self.serve, args=(self.listener,), daemon=True).start()

    def kill(self):
        """As the kernel does for a killed server: nobody listens, connections are reset."""
        for end in [self.listener, *self.ends]:
            try:
                end.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
                end.shutdown(socket.SHUT_RDWR)
            except OSError:
                pass   # it has just ended by itself
        self.listener.close()

    def serve(self, listener):
        while True:
            try:
                client, _ = listener.accept()
            except OSError:
                return   # killed
            self.thaw()
            self.connections.append(time.monotonic())
            self.heard.append(0.0)
            threading.Thread(target=self.relay, args=(client, len(self.heard) - 1), daemon=True).start()

    def thaw(self):
        while self.spoil == "freeze":
            time.sleep(0.01)

    def relay(self, client, number):
        server = None
        self.ends.add(client)
        try:
            if self.spoil == "refuse":
                return
            server = socket.create_connection(("127.0.0.1", self.target), timeout=5)
            # Nothing may be sent on in pieces: each side's frames are small and come whole.
            while True:
                ready, _, _ = select.select([client, server], [], [])
                self.thaw()
                if client in ready:
                    request = client.recv(512)
                    if not request:
                        return
                    self.heard[number] = time.monotonic()
                    self.note(request)
                    server.sendall(request)
                if server in ready:
                    reply = server.recv(512)
                    if not reply or not self.answer(client, reply):
                        return
        except OSError:
            pass
        finally:
            self.ends.discard(client)
            for end in (client, server):
                if end is not None:
                    end.close()

    def note(self, request):
        if len(request) < 12:
            return
        function, address, value = struct.unpack(">BHH", request[7:12])
        if function == 6:
            self.writes.append((time.monotonic(), address, (value,)))
        elif function == 16:
            self.writes.append((time.monotonic(), address, struct.unpack(f">{value}H", request[13:13 + 2 * value])))

    def answer(self, client, reply):
        """False: the connection is over."""
        spoil = self.spoil
        if spoil is not None and self.times is not None:
            self.times -= 1
            if self.times <= 0:
                self.spoil = self.times = None
        transaction, protocol, length, unit, function = struct.unpack(">HHHBB", reply[:8])
        body = reply[8:]
        kind, value = spoil if isinstance(spoil, tuple) else (spoil, 0)
        if kind in ("refuse", "reset"):
            client.sendall(reply[:5])
            client.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
            return False
        if kind == "hang":
            return True
        if kind == "late":
            time.sleep(value)
        if kind == "transaction":
            transaction ^= 0x55
        elif kind == "unit":
            unit ^= 3
        elif kind == "function":
            function ^= 1
        elif kind == "length":
            length += 7
        elif kind == "short":
            length, body = 3, body[:1]
        elif kind == "measured" and function == 4 and len(body) == 1 + 2 * INPUTS:
            measured = struct.unpack(">I", body[-4:])[0]
            body = body[:-4] + struct.pack(">I", round(measured * value))
        elif kind == "contact" and function == 4 and len(body) == 1 + 2 * INPUTS:
            body = body[:5] + struct.pack(">H", value) + body[7:]
        elif kind == "exception":
            function, body, length = function | 0x80, bytes([value]), 3
        reply = struct.pack(">HHHBB", transaction, protocol, length, unit, function) + body
        if kind == "trickle":
            for byte in reply:
                client.sendall(bytes([byte]))
                time.sleep(0.1)
        else:
            client.sendall(reply)
        return True
