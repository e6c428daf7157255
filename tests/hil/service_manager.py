#!/usr/bin/python3
"""What vibrigd tells the service manager; and each of its stages blocked on purpose, in turn, while the table shakes:
both watchdogs go hungry, the shaker stops, and after a restart the daemon measures and moves nothing.

usage: service_manager.py PROGRAMS
"""
import ctypes
import os
import signal
import socket
import struct
import subprocess
import sys
import tempfile
import time

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import rig as r  # noqa: E402

PTRACE_SEIZE, PTRACE_INTERRUPT, WALL = 0x4206, 0x4207, 0x40000000
CAMPAIGN = {"name": "blocked", "identify": "what-it-can", "positions_deg": [[0, 0, 0]], "table_g": [5.0], "dwell_s": 600.0, "settle_s": 2.0,
            "ramp_s": 0.5, "temperature_window_s": 0.0}
LINK = {"backoff_max_ms": 500, "response_timeout_ms": 1000}
STAGES = ("acquisition", "estimator", "control", "shaker")
libc = ctypes.CDLL(None, use_errno=True)
libc.ptrace.argtypes = [ctypes.c_long, ctypes.c_long, ctypes.c_void_p, ctypes.c_void_p]


class Manager:
    """The receiving end of sd_notify."""

    def __init__(self, folder):
        self.path = os.path.join(folder, "notify.sock")
        self.socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self.socket.bind(self.path)
        self.said = []   # (when, line)

    def listen(self, seconds, until=None):
        """Lines said within that time, or up to the first that starts with `until`."""
        end, heard = time.monotonic() + seconds, []
        while (left := end - time.monotonic()) > 0:
            self.socket.settimeout(left)
            try:
                message = self.socket.recv(4096).decode()
            except TimeoutError:
                break
            heard += message.splitlines()
            if until is not None and any(line.startswith(until) for line in heard):
                break
        return heard

    def forget(self):
        self.socket.setblocking(False)
        try:
            while True:
                self.socket.recv(4096)
        except BlockingIOError:
            pass


def start_daemon(rig, manager, **more):
    rig.daemon = r.Child("vibrigd", [rig.program("vibrigd"), "--config", rig.configuration], rig.folder,
                         {"NOTIFY_SOCKET": manager.path, "WATCHDOG_USEC": "2000000", **more})


def shaker_state(rig, address=0):
    """State register, or another input register, read past the daemon."""
    with socket.create_connection(("127.0.0.1", rig.modbus_port), timeout=5) as link:
        link.sendall(struct.pack(">HHHBBHH", 1, 0, 6, 1, 4, address, 1))
        reply = b""
        while len(reply) < 11:
            more = link.recv(11 - len(reply))
            if not more:
                return None
            reply += more
    return struct.unpack(">H", reply[9:11])[0]


def thread_named(pid, name):
    for tid in os.listdir(f"/proc/{pid}/task"):
        with open(f"/proc/{pid}/task/{tid}/comm", encoding="ascii") as comm:
            if comm.read().strip() == name:
                return int(tid)
    return None


def block(tid):
    """Stops this one thread and no other."""
    if libc.ptrace(PTRACE_SEIZE, tid, None, None) != 0 or libc.ptrace(PTRACE_INTERRUPT, tid, None, None) != 0:
        raise OSError(ctypes.get_errno(), "ptrace")
    os.waitpid(tid, WALL)


def blocked(checks, rig, manager, stage):
    start_daemon(rig, manager)
    heard = manager.listen(20, "READY=1")
    checks.check("READY=1" in heard, f"{stage}: the daemon says that it is ready", rig.logs())
    rig.wait_for(r.measuring, 20)
    if rig.status()["campaign"]["state"] == "tripped":
        rig.acknowledge(by="tester")
    rig.wait_for(lambda s: s["shaker"].get("state") == 0 and not s["shaker"].get("running", True), 20)
    for command, done in (("arm", rig.arm()), ("start", rig.tool("start", "--by", "tester"))):
        checks.equal(done.returncode, 0, f"{stage}: {command}")
    status = rig.wait_for_state(("recording", "aborted", "tripped"), 60)
    checks.check(status is not None and status["campaign"]["state"] == "recording", f"{stage}: the table shakes",
                 r.state_of(status) + rig.logs())
    manager.forget()
    checks.check("WATCHDOG=1" in manager.listen(5, "WATCHDOG=1"), f"{stage}: the watchdog is fed")
    thread = thread_named(rig.daemon.process.pid, stage)
    block(thread)
    end = time.monotonic() + 20
    while shaker_state(rig) not in (0, 4) and time.monotonic() < end:
        time.sleep(0.1)
    checks.check(shaker_state(rig) in (0, 4), f"{stage} blocked: the shaker stops", f"state {shaker_state(rig)}")
    heard = manager.listen(20, "STATUS=no progress")
    checks.check(any(line.startswith("STATUS=no progress") and stage in line for line in heard),
                 f"{stage} blocked: the service manager hears which stage it is", str(heard[-3:]))
    manager.forget()
    checks.check("WATCHDOG=1" not in manager.listen(3), f"{stage} blocked: its watchdog is not fed")
    rig.daemon.process.kill()   # as the service manager would
    os.waitpid(thread, WALL)    # the tracer's; only then the process can be
    rig.daemon.process.wait()
    start_daemon(rig, manager)
    status = rig.wait_for(r.measuring, 20)
    checks.check(status is not None and r.measuring(status), f"{stage} blocked: restarted, it measures", rig.logs())
    checks.check(status is not None and status["campaign"]["state"] in ("idle", "tripped") and
                 shaker_state(rig) in (0, 4), f"{stage} blocked: restarted, it moves nothing", r.state_of(status))
    checks.equal(rig.daemon.end(signal.SIGTERM, timeout=30), 0, f"{stage} blocked: restarted, it ends cleanly")


def talks(checks, rig, manager):
    start_daemon(rig, manager)
    checks.check("READY=1" in manager.listen(20, "READY=1"), "it says READY")
    rig.wait_for(r.measuring, 20)
    heard = manager.listen(3)
    checks.check("WATCHDOG=1" in heard, "it feeds the watchdog", str(heard))
    rig.daemon.process.send_signal(signal.SIGHUP)
    heard = manager.listen(10, "READY=1")
    checks.check("RELOADING=1" in heard and "READY=1" in heard, "a reload is announced and ended", str(heard))
    checks.check(rig.daemon.says("takes effect with the next start"), "a reload checks the configuration", rig.logs())
    rig.daemon.process.send_signal(signal.SIGTERM)
    heard = manager.listen(10, "EXTEND_TIMEOUT_USEC=")
    checks.check("STOPPING=1" in heard, "it says STOPPING", str(heard))
    asked_s = [float(line.partition("=")[2]) / 1e6 for line in heard if line.startswith("EXTEND_TIMEOUT_USEC=")]
    checks.check(bool(asked_s) and asked_s[0] > CAMPAIGN["ramp_s"] + 30, "and how long that may take", str(heard))
    checks.equal(rig.daemon.end(timeout=30), 0, "and ends with status 0")


def restarts_at_rest(checks, rig, manager):
    """An upgrade leaves a file in the service's folder."""
    request = os.path.join(rig.folder, "restart-when-at-rest")
    start_daemon(rig, manager, RUNTIME_DIRECTORY=rig.folder)
    rig.wait_for(lambda s: r.measuring(s) and s["shaker"].get("state") == 0, 20)
    if rig.status()["campaign"]["state"] == "tripped":
        rig.acknowledge(by="tester")
    rig.wait_for(lambda s: s["shaker"].get("state") == 0 and not s["shaker"].get("running", True), 20)
    checks.equal(rig.arm().returncode, 0, "upgrade: armed")
    with open(request, "w", encoding="ascii"):
        pass
    checks.check(rig.daemon.says("restart waits for rest: the campaign is armed") and rig.daemon.running(), "upgrade: while it is armed the restart waits, and says for what", rig.logs())
    rig.tool("start", "--by", "tester")
    status = rig.wait_for_state(("recording", "aborted", "tripped"), 60)
    checks.equal(status["campaign"]["state"], "recording", "upgrade: the campaign goes on")
    checks.check(rig.daemon.running() and os.path.exists(request), "upgrade: nor does it restart while the table shakes")
    rig.tool("abort", "--by", "tester")
    try:
        checks.equal(rig.daemon.process.wait(timeout=30), 75, "upgrade: at rest it ends, to be started again")
    except subprocess.TimeoutExpired:
        checks.check(False, "upgrade: at rest it ends, to be started again", rig.logs())
    checks.check(shaker_state(rig) in (0, 4) and not os.path.exists(request), "upgrade: the table rests, the request is gone")
    with open(request, "w", encoding="ascii"):
        pass
    start_daemon(rig, manager, RUNTIME_DIRECTORY=rig.folder)
    status = rig.wait_for(r.measuring, 20)
    checks.check(status is not None and r.measuring(status) and not os.path.exists(request),
                 "upgrade: what was asked of the one before does not restart this one", rig.logs())
    checks.equal(rig.daemon.end(signal.SIGTERM, timeout=30), 0, "upgrade: it ends cleanly")


def main():
    programs = r.programs_from_command_line(__doc__)
    checks = r.Checks()
    with tempfile.TemporaryDirectory() as folder:
        rig = r.Rig(programs, "seqpacket", "real", folder)
        manager = Manager(folder)
        try:
            rig.start_plant("--seed", "5")
            rig.be_punctual()
            rig.configure(CAMPAIGN, **{**r.PATIENT, "shaker": LINK})
            talks(checks, rig, manager)
            restarts_at_rest(checks, rig, manager)
            for stage in STAGES:
                blocked(checks, rig, manager, stage)
        finally:
            rig.stop()
    return checks.end()


if __name__ == "__main__":
    sys.exit(main())
