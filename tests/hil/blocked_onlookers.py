#!/usr/bin/python3
"""The recorder and the status server, each blocked on purpose while the table shakes, on a real vcan0 in virtual time:
measurement and campaign go on, it is reported, what the recorder missed stands in the file as a gap; with rows of the interlock
table that say abort, the shaker is stopped.

usage: blocked_onlookers.py PROGRAMS
       blocked_onlookers.py PROGRAMS --inside          inside the machine in virtual time
"""
import ctypes
import glob
import os
import signal
import subprocess
import sys
import tempfile
import time

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import fault_matrix as m  # noqa: E402
import rig as r  # noqa: E402
import service_manager as s  # noqa: E402

PTRACE_DETACH = 17
RATE_HZ = 40
RING_SAMPLES = 16384      # of the recorder: what waits for it
BLOCKED_S = 450.0         # longer than the ring lasts
SERVER_S = 60.0
RUNNING, REST = 2, (0, 4)   # the shaker's states
ABORT = "".join(f'[[interlock]]\nname = "{name}"\nreaction = "abort"\ndwell_s = 1.0\n'
                for name in ("recording_degraded", "server_stuck"))


class Blocked:
    """One thread stands still, the others go on."""

    def __init__(self, rig, name):
        self.thread = s.thread_named(rig.daemon.process.pid, name)

    def __enter__(self):
        s.block(self.thread)

    def __exit__(self, *_):
        if s.libc.ptrace(PTRACE_DETACH, self.thread, None, None) != 0:
            raise OSError(ctypes.get_errno(), "ptrace")


def raised(status, name):
    return next(row.get("raised", False) for row in status["interlock"]["rows"] if row["name"] == name)


def measured(checks, what, before, after, seconds):
    """Every sample of that time, and none lost. The two looks at the status may be a little later than the clock's."""
    samples = r.number(after["assembler"]["samples"]) - r.number(before["assembler"]["samples"])
    checks.check(samples >= seconds * RATE_HZ - 2 and m.lost(after) == m.lost(before),
                 f"{what}: not a sample is lost to the filter", f"{samples} in {seconds} s, {m.lost(before)} {m.lost(after)}")
    checks.equal(after["campaign"]["state"], "recording", f"{what}: the campaign goes on")


def logged(rig, words):
    return [line for line in rig.tool("events").stdout.splitlines() if words in line]


def slow_recorder(checks, rig):
    before = rig.status()
    checks.check(not raised(before, "recording_degraded") and before["recorder"].get("good"), "the recorder keeps up before",
                 before["recorder"])
    with Blocked(rig, "recorder"):
        time.sleep(5)
        status = rig.status()
        checks.check(not status["recorder"].get("good", False) and "no answer for" in status["recorder"]["note"],
                     "recorder blocked: the status says that it is degraded", status["recorder"])
        checks.check(raised(status, "recording_degraded"), "recorder blocked: an alarm is raised", status["interlock"]["rows"])
        time.sleep(BLOCKED_S)
        measured(checks, "recorder blocked", before, rig.status(), BLOCKED_S)
    status = rig.wait_for(lambda t: t["recorder"].get("good") and not raised(t, "recording_degraded") and
                          r.number(t["recorder"].get("samples_lost", 0)), 30)
    checks.check(status["recorder"].get("good") and not raised(status, "recording_degraded"),
                 "recorder free again: the alarm is over", status["recorder"])
    missed = r.number(status["recorder"].get("samples_lost", 0))
    checks.check(0 < missed <= BLOCKED_S * RATE_HZ + 400 - RING_SAMPLES,
                 "recorder free again: it knows what it has missed", status["recorder"])
    checks.check(len(logged(rig, "recording_degraded")) == 2, "it was reported once, and that it is over",
                 logged(rig, "recording_degraded"))
    return missed


def slow_server(checks, rig):
    before = rig.status()
    with Blocked(rig, "server"):
        time.sleep(SERVER_S)
        checks.equal(s.shaker_state(rig), RUNNING, "server blocked: the table shakes on")
    after = rig.wait_for(lambda t: not raised(t, "server_stuck"), 10)
    measured(checks, "server blocked", before, after, SERVER_S)
    checks.check(len(logged(rig, "server_stuck")) == 2, "server blocked: it was reported once, and that it is over",
                 logged(rig, "server_stuck"))


def gaps_in_file(checks, rig, missed):
    import h5py
    path = glob.glob(os.path.join(rig.results, "faulty-*", "campaign.h5"))[0]
    with h5py.File(path, "r") as file:
        sequence = file["samples/sequence"][:]
        gaps = [(stream.decode().rstrip("\0"), int(n), reason.decode().rstrip("\0")) for stream, n, reason in
                zip(file["gaps/stream"][:], file["gaps/lost"][:], file["gaps/reason"][:])]
    absent = int(sequence[-1]) - int(sequence[0]) + 1 - len(sequence)
    checks.check((("samples", missed, "ring full") in gaps) and absent == missed,
                 "a gap in the recording tells of every sample that is not there", f"{absent} absent, {missed} missed, {gaps}")


def only_degrades(checks, programs):
    with tempfile.TemporaryDirectory() as folder:
        rig = m.FaultRig(programs, folder)
        try:
            rig.start(1, record={"enabled": True, "raw": False}, threads=r.NO_PRIORITY)
            shaking, found = rig.shake()
            checks.check(shaking, "the table shakes", found + rig.logs())
            missed = slow_recorder(checks, rig)
            slow_server(checks, rig)
            r.check_balance(checks, rig, "after both")
            rig.command("abort")
            rig.wait_for(lambda t: not t["recorder"].get("recording"), 30)
            checks.equal(rig.daemon.end(timeout=30), 0, "vibrigd ends cleanly")
            gaps_in_file(checks, rig, missed)
        finally:
            rig.stop()


def stops_if_asked_to(checks, programs):
    with tempfile.TemporaryDirectory() as folder:
        rig = m.FaultRig(programs, folder)
        try:
            rig.start(2, ABORT, record={"enabled": True, "raw": False}, threads=r.NO_PRIORITY)
            for thread, row in (("recorder", "recording_degraded"), ("server", "server_stuck")):
                shaking, found = rig.shake()
                checks.check(shaking, f"{row} says abort: the table shakes before", found + rig.logs())
                with Blocked(rig, thread):
                    time.sleep(20)
                    checks.check(s.shaker_state(rig) in REST, f"{row} says abort: the shaker is stopped", s.shaker_state(rig))
                status = rig.wait_for(lambda t: t["campaign"]["state"] == "tripped", 10)
                checks.equal(status["interlock"]["tripped"], row, f"{row} says abort: it tripped")
                checks.check(rig.tool("ack", row, "--by", "tester").returncode == 0, f"{row}: acknowledged by its name")
            checks.equal(rig.daemon.end(timeout=30), 0, "vibrigd ends cleanly")
        finally:
            rig.stop()


def main():
    programs = r.programs_from_command_line(__doc__)
    if "--inside" in sys.argv:
        checks = r.Checks()
        only_degrades(checks, programs)
        stops_if_asked_to(checks, programs)
        checks.note(f"{time.monotonic():.0f} s of virtual time")
        return checks.end()
    return subprocess.run([os.path.join(m.HERE, "run-in-uml"), "-T", "-t", "20000", "--wall", "1200", "--",
                           os.path.abspath(__file__), programs, "--inside"], stdin=subprocess.DEVNULL, check=False,
                          preexec_fn=lambda: r.die_with_parent(signal.SIGTERM)).returncode


if __name__ == "__main__":
    sys.exit(main())
