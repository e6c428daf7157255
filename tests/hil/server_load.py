#!/usr/bin/python3
"""Load on the status server of a vibrigd that measures in real time: 100 WebSocket clients of which 10 never read, 1 000
status requests a second, slow senders, oversized and malformed requests, connects without end. Nothing of the measurement
may be lost, every loss balance stays closed, memory stays flat. Reports how late samples come without and with the load.

usage: server_load.py PROGRAMS [SECONDS]     default: 60 s of load
"""
import asyncio
import json
import os
import random
import sys
import tempfile
import time
import urllib.parse

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import live_page  # noqa: E402
import rig as r  # noqa: E402

STREAMS, DEAF, REQUESTS_PER_S, CONNECTS_PER_S = 100, 10, 1000, 2000
WORKERS = 20
SEED = 20090401
UPGRADE = ("GET /api/v1/stream?rate_hz=5 HTTP/1.1\r\nHost: {host}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
           "Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n")


class Load:
    def __init__(self, address, seconds):
        where = urllib.parse.urlparse(address)
        self.host, self.port = where.hostname, where.port
        self.name, self.end = where.netloc, time.monotonic() + seconds
        self.answers = self.bytes = self.connects = self.refused = 0

    def going(self):
        return time.monotonic() < self.end

    async def stream(self, reads):
        try:
            reader, writer = await asyncio.open_connection(self.host, self.port, limit=4096)
            writer.write(UPGRADE.format(host=self.name).encode())
            while self.going():
                if reads:
                    block = await asyncio.wait_for(reader.read(65536), 5)
                    if not block:
                        break
                    self.bytes += len(block)
                else:
                    writer.transport.pause_reading()
                    await asyncio.sleep(0.5)
            writer.close()
        except (OSError, asyncio.TimeoutError, RuntimeError):
            pass

    async def ask(self):
        request = f"GET /api/v1/status HTTP/1.1\r\nHost: {self.name}\r\n\r\n".encode()
        reader, writer = await asyncio.open_connection(self.host, self.port)
        due = time.monotonic()
        while self.going():
            due += WORKERS / REQUESTS_PER_S
            await asyncio.sleep(max(0, due - time.monotonic()))
            writer.write(request)
            head = await asyncio.wait_for(reader.readuntil(b"\r\n\r\n"), 10)
            size = int(head.lower().split(b"content-length: ")[1].split(b"\r\n")[0])
            await asyncio.wait_for(reader.readexactly(size), 10)
            self.answers += head.startswith(b"HTTP/1.1 200")
        writer.close()

    async def bad(self, generator):
        """Drips, floods and noise."""
        while self.going():
            try:
                reader, writer = await asyncio.open_connection(self.host, self.port)
                kind = generator.randrange(4)
                if kind == 0:
                    for _ in range(20):
                        writer.write(b"G")
                        await asyncio.sleep(0.2)
                elif kind == 1:
                    writer.write(b"GET / HTTP/1.1\r\nX: " + b"a" * 100_000)
                elif kind == 2:
                    writer.write(b"POST /api/v1/commands HTTP/1.1\r\nHost: x\r\nContent-Length: 99999999\r\n\r\n" + b"[" * 50_000)
                else:
                    writer.write(generator.randbytes(2000))
                await asyncio.wait_for(reader.read(4096), 2)
                writer.close()
            except (OSError, asyncio.TimeoutError):
                self.refused += 1

    async def connect(self):
        due = time.monotonic()
        while self.going():
            due += 10 / CONNECTS_PER_S
            await asyncio.sleep(max(0, due - time.monotonic()))
            try:
                _, writer = await asyncio.open_connection(self.host, self.port)
                self.connects += 1
                writer.transport.abort()
            except OSError:
                self.refused += 1

    async def run(self):
        jobs = [self.stream(i >= DEAF) for i in range(STREAMS)] + [self.ask() for _ in range(WORKERS)]
        jobs += [self.bad(random.Random(SEED + i)) for i in range(5)] + [self.connect() for _ in range(10)]
        return await asyncio.gather(*jobs, return_exceptions=True)


def memory_kb(rig):
    with open(f"/proc/{rig.daemon.process.pid}/status", encoding="ascii") as file:
        return next(int(line.split()[1]) for line in file if line.startswith("VmRSS"))


def lateness_ms(rig, seconds):
    """Ages of the newest sample, 50 a second, at the control socket; their median and 99 %."""
    ages, end = [], time.monotonic() + seconds
    while time.monotonic() < end:
        status = rig.status()
        if status is not None:
            ages.append(1e3 * (status["time_s"] - status["sample"]["time_s"]))
        time.sleep(0.02)
    ages.sort()
    return (ages[len(ages) // 2], ages[int(len(ages) * 0.99)]) if ages else (float("nan"),) * 2


def main():
    programs = r.programs_from_command_line(__doc__)
    seconds = float(sys.argv[2]) if len(sys.argv) > 2 else 60.0
    checks = r.Checks()
    with tempfile.TemporaryDirectory(prefix="vibrig-load-") as folder:
        rig = r.Rig(programs, "seqpacket", "real", folder)
        try:
            rig.start_plant()
            rig.configure({"name": "load", "identify": "what-it-can"}, server={"page": f"127.0.0.1:{live_page.free_port()}"})
            rig.start_daemon()
            address = live_page.page_address(rig)
            rig.wait_for(lambda s: s["can"]["link"] == "running" and s["shaker"]["link"] == "running", 30)
            quiet = lateness_ms(rig, 5)
            before, memory = rig.status(), memory_kb(rig)
            load = Load(address, seconds)
            child = os.fork()
            if child == 0:
                asyncio.run(load.run())
                with open(os.path.join(folder, "load.json"), "w", encoding="utf-8") as file:
                    json.dump({k: v for k, v in vars(load).items() if isinstance(v, (int, float))}, file)
                os._exit(0)
            time.sleep(seconds / 4)
            early = memory_kb(rig)
            loaded = lateness_ms(rig, seconds / 2)
            os.waitpid(child, 0)
            late = memory_kb(rig)
            with open(os.path.join(folder, "load.json"), encoding="utf-8") as file:
                done = json.load(file)
            after = rig.status()
            checks.note(f"load: {done['answers'] / seconds:.0f} status answers/s, {done['connects'] / seconds:.0f} connects/s, "
                        f"{done['bytes'] / seconds / 1e3:.0f} kB/s of streams")
            checks.note(f"age of the newest sample, median and 99 %: {quiet[0]:.2f} and {quiet[1]:.2f} ms quiet, "
                        f"{loaded[0]:.2f} and {loaded[1]:.2f} ms loaded; memory {memory} kB before, {early} kB early, {late} kB late")
            checks.check(done["answers"] > 0 and done["connects"] > 0, "the load was there", str(done))
            n = r.number
            taken = n(after["assembler"]["samples"]) - n(before["assembler"]["samples"])
            elapsed = after["time_s"] - before["time_s"]
            checks.check(abs(taken - 40 * elapsed) < 0.01 * 40 * elapsed + 5, "every sample was taken", f"{taken} in {elapsed:.1f} s")
            lost = {k: n(after[a][k]) - n(before[a][k]) for a, k in
                    (("can", "kernel_dropped"), ("assembler", "gaps"), ("assembler", "incomplete"), ("estimator_ring", "dropped"))}
            checks.check(not any(lost.values()), "nothing was dropped", str(lost))
            r.check_balances(checks, rig)
            checks.check(late < early * 1.2 + 4096, "memory is flat", f"{early} kB to {late} kB")
            checks.check(rig.daemon.running() and rig.tool("abort", "--by", "load").returncode in (0, 1), "the stop is heard", rig.logs())
        finally:
            rig.stop()
    return checks.end()


if __name__ == "__main__":
    sys.exit(main())
