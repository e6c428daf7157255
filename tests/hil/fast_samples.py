#!/usr/bin/python3
"""CAN FD: 10 000 samples a second, four in each frame of 64 bytes, whose multiplexor says whether it carries angles or
specific forces. Nothing is lost or incomplete, memory stays flat, and the daemon takes a quarter of one core at most.

usage: fast_samples.py PROGRAMS [--seconds N] [--soak]     N s over seqpacket (10; 600 with --soak), and on a real vcan0
       fast_samples.py PROGRAMS --inside N                 the vcan half, where vcan0 is
"""
import contextlib
import os
import signal
import socket
import struct
import subprocess
import sys
import tempfile
import threading
import time

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import rig as r  # noqa: E402

HERE = os.path.dirname(os.path.abspath(__file__))
ROOT = os.path.dirname(os.path.dirname(HERE))
PARTS, IDENTIFIER = 4, 800
RATE_HZ, VCAN_RATE_HZ = 10_000, 2_000   # UML has one CPU, and a system call takes 14 us there
CORE = 0.25       # share of one core
FLAT_KB = 1024    # what comes into memory in the second half of a run
BIT_RATE_SWITCH = 1
CHANNELS = {"outer": "Outer", "inner": "Inner", "azimuth": "Azimuth", "accel_x": "X", "accel_y": "Y", "accel_z": "Z",
            "table_accel": "Axial"}
ANGLES, FORCES = ("Outer", "Inner", "Azimuth"), ("X", "Y", "Z", "Axial")
G_PER_BIT, DEG_PER_BIT = 2.0 ** -18, 360 / 2 ** 20


def write_dbc(path):
    """The rig's own messages, and one of 64 bytes besides."""
    lines = [f"BO_ {IDENTIFIER} Motion: 64 Platform", ' SG_ Count : 0|32@1+ (1,0) [0|4294967295] "" Vibrig',
             ' SG_ Kind M : 32|8@1+ (1,0) [0|1] "" Vibrig']
    for kind, (names, bits, form) in enumerate(((ANGLES, 20, f'1+ ({DEG_PER_BIT!r},0) [0|360] "deg"'),
                                                (FORCES, 24, f'1- ({G_PER_BIT!r},0) [-31|31] "g"'))):
        for i in range(PARTS * len(names)):
            part, name = divmod(i, len(names))
            lines.append(f" SG_ {names[name]}{'_%d' % part if part else ''} m{kind} : {40 + i * bits}|{bits}@{form} Vibrig")
    with open(os.path.join(ROOT, "proto", "rig.dbc"), encoding="utf-8") as file:
        head, notes = file.read().split('\nCM_ "', 1)
    with open(path, "w", encoding="utf-8") as file:
        file.write(head + "\n".join(lines) + '\n\nCM_ "' + notes)


STANDSTILL_S = 0.1   # so late, a platform has stood still for the daemon


def payloads():
    """Of both kinds, without the count: a platform at rest, angles of 10, 20 and 30 deg, 1 g along y."""
    angles = forces = 0
    for part in range(PARTS):
        for i, deg in enumerate((10, 20, 30)):
            angles |= round(deg / DEG_PER_BIT) << 40 + (part * 3 + i) * 20
        for i, g in enumerate((0, 1, 0, 0)):
            forces |= round(g / G_PER_BIT) << 40 + (part * 4 + i) * 24
    return angles, forces | 1 << 32


class Bus:
    """The platform's end: of a Unix socket, which the daemon connects to, or of vcan0."""

    def __init__(self, rig):
        self.sent = 0   # samples
        self.standstills = 0   # times that it was STANDSTILL_S behind its schedule
        self.payloads = payloads()
        self.end = threading.Event()
        self.listener = self.bus = self.began = None
        if rig.bus == "seqpacket":
            self.listener = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
            self.listener.bind(rig.path)
            self.listener.listen(1)
            self.listener.settimeout(30)   # a daemon that has ended does not come
        else:
            self.bus = socket.socket(socket.PF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
            self.bus.setsockopt(socket.SOL_CAN_RAW, socket.CAN_RAW_FD_FRAMES, 1)
            self.bus.bind((rig.bus,))

    @contextlib.contextmanager
    def running(self, rate_hz):
        """In a thread, meanwhile."""
        self.end.clear()
        thread = threading.Thread(target=self.stream, args=(rate_hz, 3600))
        thread.start()
        try:
            yield
        finally:
            self.end.set()
            thread.join()
            self.end.clear()

    def stream(self, rate_hz, seconds, meanwhile=lambda: None):
        if self.bus is None:
            self.bus, _ = self.listener.accept()
            self.bus.settimeout(30)
        # One schedule from the first sample on: between two streams, and where the machine holds this up, the platform is late
        # and makes up for it. One that stood still would be counted.
        begin, looked = time.monotonic(), 0.0
        self.began = self.began or begin
        while (now := time.monotonic() - begin) < seconds and not self.end.is_set():
            self.standstills += begin + now - self.began - self.sent / rate_hz > STANDSTILL_S
            while self.sent < (begin + now - self.began) * rate_hz:
                for payload in self.payloads:
                    data = (payload | self.sent & 0xffffffff).to_bytes(64, "little")
                    self.bus.send(struct.pack("<IBBxx", IDENTIFIER, 64, BIT_RATE_SWITCH) + data)
                self.sent += PARTS
            if now > looked + 1:
                looked = now
                meanwhile()
            time.sleep(PARTS / rate_hz)


def processor_s(pid):
    with open(f"/proc/{pid}/stat", encoding="ascii") as file:
        user, system = file.read().rsplit(")", 1)[1].split()[11:13]
    return (int(user) + int(system)) / os.sysconf("SC_CLK_TCK")


def memory_kb(pid):
    with open(f"/proc/{pid}/statm", encoding="ascii") as file:
        return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE") // 1024


def configured(programs, bus, rate_hz, folder, **tables):
    """A rig without a shaker on this bus, and the platform's end of it."""
    rig = r.Rig(programs, bus, "real", folder)
    rig.modbus_port = 1   # nobody is there
    write_dbc(os.path.join(folder, "fd.dbc"))
    # Whatever else the machine does may come between the two frames of a sample: nobody is late here.
    rig.configure({"name": "fast", "identify": "what-it-can"},
                  can={"dbc": os.path.join(folder, "fd.dbc"), "samples_per_frame": PARTS, "sample_rate_hz": float(rate_hz),
                       "join_deadline_ms": 5000.0, "stale_deadline_ms": 10_000.0},
                  **{"can.signals": {"sync_count": "Motion.Count",
                                     **{key: "Motion." + name for key, name in CHANNELS.items()},
                                     **{key + "_valid": "" for key in CHANNELS if key != "table_accel"}}, **tables})
    return rig, Bus(rig)


def as_sent(status):
    shown = {c["name"]: c.get("value", 0) for c in status["sample"]["channels"]}
    return abs(shown["outer"] - 10) < 1e-3 and abs(shown["azimuth"] - 30) < 1e-3 and abs(shown["accel_y"] - 1) < 1e-5


def stream(checks, programs, bus, rate_hz, seconds):
    with tempfile.TemporaryDirectory() as folder:
        rig, platform = configured(programs, bus, rate_hz, folder)
        rig.start_daemon()
        try:
            running = rig.wait_for(lambda s: s["can"]["link"] == "running", 30)
            checks.check(running is not None, f"{bus}: the daemon listens", rig.logs())
            if running is None:
                return
            with platform.running(rate_hz):
                status = rig.wait_for(as_sent, 30)
            checks.check(status is not None and as_sent(status), f"{bus}: samples are as they were sent", rig.logs())
            pid, memory = rig.daemon.process.pid, []
            before, sent, begin = processor_s(pid), platform.sent, time.monotonic()
            platform.stream(rate_hz, seconds, lambda: memory.append(memory_kb(pid)))
            took = processor_s(pid) - before
            share = took / (time.monotonic() - begin)
            status = r.check_balances(checks, rig)
            got = status["assembler"]
            n = {key: r.number(got[key]) for key in got}
            checks.note(f"{bus}: {platform.sent} samples at {rate_hz} Hz, {share:.1%} of a core, "
                        f"{1e6 * took / (platform.sent - sent):.1f} us a sample")
            checks.equal(n["samples"], platform.sent, f"{bus}: each sample that was sent is given out")
            checks.equal([n[key] for key in ("incomplete", "gaps", "late", "duplicate", "unknown", "wrong_length")],
                         [0] * 6, f"{bus}: complete and in order")
            checks.check(n["resyncs"] <= platform.standstills, f"{bus}: no standstill but those of the platform",
                         f"{n['resyncs']} of a platform that the machine held up {platform.standstills} times")
            checks.equal(r.number(status["estimator_ring"]["dropped"]), 0, f"{bus}: the estimator's ring loses none")
            checks.equal(r.number(status["can"]["kernel_dropped"]), 0, f"{bus}: the kernel drops none")
            if bus == "seqpacket":
                checks.check(share <= CORE, f"{bus}: at most {CORE:.0%} of one core", f"{share:.1%}")
                grown = memory[-1] - memory[len(memory) // 2]
                checks.check(grown <= FLAT_KB, f"{bus}: memory is flat", f"{grown} kB more in the second half")
            checks.equal(rig.daemon.end(signal.SIGTERM, timeout=30), 0, f"{bus}: ends cleanly")
        finally:
            rig.stop()


def cost(programs, rate_hz, seconds):
    return cost_beside(programs, rate_hz, seconds, lambda rig: None)[0]


def cost_beside(programs, rate_hz, seconds, begin_other):
    """Processor time of the daemon for a second of samples, s, and its memory, MB; for tests/bench/growth. What the program
    said that was begun beside it."""
    with tempfile.TemporaryDirectory() as folder:
        rig, platform = configured(programs, "seqpacket", rate_hz, folder, server={"page": "127.0.0.1:0"})
        rig.start_daemon()
        try:
            if rig.wait_for(lambda s: s["can"]["link"] == "running", 30) is None:
                raise RuntimeError("vibrigd does not answer: " + rig.daemon.text())
            other = begin_other(rig)
            platform.stream(rate_hz, 1)
            pid = rig.daemon.process.pid
            before, begin = processor_s(pid), time.monotonic()
            platform.stream(rate_hz, seconds)
            used = {"cpu_s": (processor_s(pid) - before) / (time.monotonic() - begin), "memory_mb": memory_kb(pid) / 1024}
            return used, other.communicate(timeout=60)[0] if other else ""
        finally:
            rig.stop()


def main():
    programs = r.programs_from_command_line(__doc__)
    checks = r.Checks()
    if "--inside" in sys.argv:
        stream(checks, programs, "vcan0", VCAN_RATE_HZ, int(sys.argv[sys.argv.index("--inside") + 1]))
        return checks.end()
    seconds = 600 if "--soak" in sys.argv else 10
    if "--seconds" in sys.argv:
        seconds = int(sys.argv[sys.argv.index("--seconds") + 1])
    stream(checks, programs, "seqpacket", RATE_HZ, seconds)
    inside = min(seconds, 60)
    vcan = subprocess.run([os.path.join(HERE, "run-in-uml"), "-t", str(inside + 180), "--", os.path.abspath(__file__), programs,
                           "--inside", str(inside)], stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                          stderr=subprocess.STDOUT, text=True, errors="replace", check=False)
    checks.adopt(vcan.stdout)
    return checks.end()


if __name__ == "__main__":
    sys.exit(main())
