#!/usr/bin/python3
"""Load on the status server of a vibrigd that measures in real time: 100 WebSocket clients of which 10 never read, 1 000
status requests and 2 000 connects a second, slow senders, oversized and malformed requests. Nothing of the measurement may
be lost, every loss balance stays closed, memory stays flat. Reports how long frames wait without and with the load.

A rate that is missed is a failure, unless the kernel says that the server or the load had no processor for as much of the
time as is missing: then the check is skipped, with these figures.

usage: server_load.py PROGRAMS [SECONDS]     default: 10 s of load
"""
import http.client
import json
import os
import signal
import socket
import subprocess
import sys
import tempfile
import time
import urllib.parse

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import rig as r  # noqa: E402

STREAMS, DEAF, REQUESTS_PER_S, CONNECTS_PER_S = 100, 10, 1000, 2000
ENOUGH = 0.98           # of a rate; the load ends between two of its steps
QUIET_S = 3
PAGE = os.sysconf("SC_PAGE_SIZE")


class Control(http.client.HTTPConnection):
    """The control socket: asking must not cost what is measured."""

    def __init__(self, path):
        super().__init__("localhost", timeout=30)
        self.path = path

    def connect(self):
        self.sock = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self.sock.settimeout(30)
        self.sock.connect(self.path)

    def get(self, target):
        self.close()   # the server closes one that was idle
        self.request("GET", target)
        answer = self.getresponse()
        return answer.read().decode()

    def status(self):
        return json.loads(self.get("/api/v1/status"))


def memory_kb(process):
    with open(f"/proc/{process.pid}/statm", encoding="ascii") as file:
        return int(file.read().split()[1]) * PAGE // 1024


class Thread:
    """What the kernel knows of one thread: seconds it ran, and seconds it was ready and had no processor."""

    def __init__(self, process, name):
        self.path = None
        for task in os.listdir(f"/proc/{process.pid}/task"):
            folder = f"/proc/{process.pid}/task/{task}"
            with open(folder + "/comm", encoding="ascii") as file:
                if file.read().strip() == name and os.path.exists(folder + "/schedstat"):
                    self.path = folder + "/schedstat"

    def look(self):
        if self.path is None:
            return None
        with open(self.path, encoding="ascii") as file:
            ran, waited, _ = file.read().split()
        return float(ran) / 1e9, float(waited) / 1e9


def processors_taken():
    """Seconds of all processors that were not idle, and that another machine of the same host took."""
    with open("/proc/stat", encoding="ascii") as file:
        user, nice, system, idle, iowait, irq, soft, steal = (float(x) for x in file.readline().split()[1:9])
    tick = os.sysconf("SC_CLK_TCK")
    return (user + nice + system + irq + soft + steal) / tick, steal / tick


def latency(before, after):
    """Mean and, from the classes of the histogram, an upper bound of the 99 % of how long frames waited, ms."""
    a, b = before["acquisition_latency"], after["acquisition_latency"]
    counts = [int(y) - int(x) for x, y in zip(a["counts"], b["counts"])]
    total, seen = sum(counts), 0
    for count, bound in zip(counts, b["bounds_ms"] + [float("inf")]):
        seen += count
        if seen >= 0.99 * total:
            return (b["sum_ms"] - a["sum_ms"]) / max(1, total), bound, total
    return float("nan"), float("nan"), total


def check_rate(checks, what, reached, wanted, seconds, evidence):
    """`evidence`: of server and load, seconds they ran and seconds they waited for a processor; None: the kernel does not say."""
    text = f"{what}: {reached / seconds:.0f} of {wanted / seconds:.0f} a second"
    if reached >= ENOUGH * wanted:
        checks.check(True, text)
        return
    shares = "the kernel does not say who waited for a processor"
    starved = False
    if evidence is not None:
        missing = (1 - reached / wanted) * seconds
        shares = "; ".join(f"{who} ran {ran:.1f} s and waited {waited:.1f} s of {seconds:.0f} s for a processor"
                         for who, (ran, waited) in zip(("server", "load"), evidence))
        # Both would have been fast enough with a processor each, and together waited as long as is missing.
        able = all(reached / ran * seconds >= ENOUGH * wanted for ran, _ in evidence)
        starved = able and sum(waited for _, waited in evidence) >= missing
    if starved:
        checks.skip(text, "processors taken: " + shares)
    else:
        checks.check(False, text, shares)


def main():
    programs = r.programs_from_command_line(__doc__)
    seconds = float(sys.argv[2]) if len(sys.argv) > 2 else 10.0
    checks = r.Checks()
    with tempfile.TemporaryDirectory(prefix="vibrig-load-") as folder:
        rig = r.Rig(programs, "seqpacket", "real", folder)
        try:
            rig.start_plant()
            punctual = rig.be_punctual()
            rig.configure({"name": "load", "identify": "what-it-can"}, server={"page": "127.0.0.1:0"})
            rig.start_daemon()
            where = urllib.parse.urlparse(rig.page_address())
            rig.wait_for(r.measuring, 30)
            control = Control(rig.socket)
            server = Thread(rig.daemon.process, "server")
            first = control.status()
            time.sleep(QUIET_S)
            before, memory, ran = control.status(), memory_kb(rig.daemon.process), server.look()
            busy = processors_taken()
            output = os.path.join(folder, "load.json")
            with open(output, "wb") as file:
                load = subprocess.Popen([rig.program("load-generator"), where.hostname, str(where.port), str(seconds), str(STREAMS),
                                         str(DEAF), str(REQUESTS_PER_S), str(CONNECTS_PER_S)], stdout=file, preexec_fn=r.die_with_parent)
            time.sleep(seconds / 3)
            early = memory_kb(rig.daemon.process)
            during, metrics = control.status(), control.get("/metrics")
            stopped = rig.tool("abort", "--by", "load test")
            load.wait()
            after, late, end = control.status(), memory_kb(rig.daemon.process), server.look()
            taken = [b - a for a, b in zip(busy, processors_taken())]
            with open(output, encoding="utf-8") as file:
                done = json.load(file)
            evidence = None
            if ran is not None and done["waited_s"] >= 0:
                evidence = ((end[0] - ran[0], end[1] - ran[1]), (done["cpu_s"], done["waited_s"]))
            checks.note(f"load: {done}")
            checks.note(f"server: {end[0] - ran[0]:.1f} s of processor time in {seconds:.0f} s" if ran else "server: no schedstat")
            checks.note(f"machine: {taken[0] / seconds:.2f} of {os.cpu_count()} processors busy, {taken[1] / seconds:.2f} taken by its host")
            check_rate(checks, "status requests", done["answers"], REQUESTS_PER_S * seconds, seconds, evidence)
            check_rate(checks, "connects", done["connects"], CONNECTS_PER_S * seconds, seconds, evidence)
            checks.equal((done["refused"], done["connects_failed"]), (0, 0), "no status request and no connect is refused")
            checks.equal(done["broken"], 0, "no client that behaves is cut off")
            checks.equal(done["streams"], STREAMS, "all streams are open at the end, the deaf ones too or again")
            checks.check(done["stream_bytes"] > 0 and done["rude"] > 0, "the streams flow, the rude are sent away", str(done))
            open_now = next(float(line.split()[1]) for line in metrics.splitlines() if line.startswith("vibrig_server_streams "))
            checks.check(open_now >= STREAMS, "the metrics count the streams", str(open_now))
            quiet, loaded = latency(first, before), latency(before, after)
            checks.check(loaded[2] > 0, "how long frames wait is measured: "
                         f"mean {quiet[0]:.3f} ms quiet, {loaded[0]:.3f} ms loaded ({100 * (loaded[0] / quiet[0] - 1):+.0f} %); "
                         f"99 % within {quiet[1]:g} and {loaded[1]:g} ms")
            n = r.number
            samples = n(after["assembler"]["samples"]) - n(before["assembler"]["samples"])
            elapsed = after["time_s"] - before["time_s"]
            checks.check(abs(samples - 40 * elapsed) < 0.01 * 40 * elapsed + 5, "every sample was taken", f"{samples} in {elapsed:.1f} s")
            lost = {k: n(after[a][k]) - n(before[a][k]) for a, k in
                    (("can", "kernel_dropped"), ("assembler", "gaps"), ("assembler", "incomplete"), ("assembler", "late"),
                     ("estimator_ring", "dropped"))}
            if not punctual:
                checks.note(f"the rig has no real-time priority: what it sent late does not count, {lost}")
                lost = {k: lost[k] for k in ("kernel_dropped", "dropped")}
            checks.check(not any(lost.values()), "nothing was dropped", str(lost))
            r.check_balances(checks, rig)
            checks.check(n(during["assembler"]["samples"]) > n(before["assembler"]["samples"]), "the control socket answers meanwhile")
            checks.check(stopped.returncode in (0, 1), "the stop is heard meanwhile", stopped.stderr)
            checks.check(late < early * 1.1 + 2048, f"memory is flat: {memory} kB before, {early} kB early, {late} kB late")
            checks.check(rig.daemon.running() and rig.daemon.end(signal.SIGTERM) == 0, "it ends in order", rig.logs())
        finally:
            rig.stop()
    return checks.end()


if __name__ == "__main__":
    sys.exit(main())
