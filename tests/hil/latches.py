#!/usr/bin/python3
"""What stopped the shaker stays until named persons acknowledge it, whatever becomes of the daemon: SIGKILL at random moments
around a trip and before each call after it, a disk that refuses, faults that the controller held before the daemon's start. On the seqpacket bus and the
rig's clock.

usage: latches.py PROGRAMS [--seed N]
"""
import contextlib
import os
import random
import resource
import subprocess
import sys
import tempfile
import time

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import rig as r  # noqa: E402

KILLS = 20
SYNCS = 3
PLACES = 31   # calls after a trip: stop, status, rows of the journal and their sync, the file of what led to it
CAMPAIGN = {"name": "latched", "identify": "what-it-can", "positions_deg": [[0, 0, 0]], "table_g": [5.0],
            "dwell_s": 2000.0, "ramp_s": 0.5, "temperature_window_s": 0.0, "second_person": True}


class Rig(r.Rig):
    """With a hand on the emergency stop."""

    def __init__(self, programs, folder):
        super().__init__(programs, "seqpacket", "rig", folder, poll_s=0.03)
        self.start_plant("--seed", "3", "--speed", "20")
        pager = os.path.join(folder, "pager")
        with open(pager, "w", encoding="ascii") as file:
            file.write(f"#!/bin/sh\ncat >> {folder}/paged\n")
        os.chmod(pager, 0o755)
        self.configure(CAMPAIGN, unit={"type": "IMU-7", "serial": "0042"}, annunciator={"command": pager})

    def paged(self, words, timeout_s=10):
        """Whether somebody was notified of it."""
        end, text = time.monotonic() + timeout_s, ""
        while words not in text and time.monotonic() < end:
            with contextlib.suppress(FileNotFoundError), open(os.path.join(self.folder, "paged"), encoding="utf-8") as file:
                text = file.read()
            time.sleep(0.05)
        return words in text

    def start_daemon(self, environment=None):
        self.daemon = r.Child("vibrigd", [self.program("vibrigd"), "--config", self.configuration], self.folder, environment)

    def start(self, environment=None):
        self.start_daemon(environment)
        return self.wait_for(r.measuring, 60)

    def kill(self):
        self.daemon.process.kill()
        self.daemon.process.wait()

    def latches(self):
        status = self.status()
        return [latch["name"] for latch in status["interlock"]["latches"]] if status else None

    def acknowledge(self):
        """By two persons; once the controller has confirmed it, arming works."""
        return [super(Rig, self).acknowledge("trip", by) for by in ("Ada", "Grace")]


def killed_at_any_moment(checks, rig, seed):
    """The trip is on its way from the controller to the journal while the daemon is killed: there is always a latch."""
    chance = random.Random(seed)
    found = {}
    lost, armed_all_the_same, not_over = [], [], []
    for number in range(KILLS):
        armed = rig.tool("arm", "--by", "Ada")
        if armed.returncode != 0:
            checks.check(False, f"kill {number + 1}: it can be armed before", armed.stderr + rig.logs())
            return
        delay = chance.uniform(0, 0.04)
        rig.order("estop open")
        time.sleep(delay)
        rig.kill()
        rig.order("estop close")
        rig.start()
        status = rig.wait_for_state(("tripped",), 10)
        names = rig.latches()
        for name in names or []:
            found[name] = found.get(name, 0) + 1
        if not names or status["campaign"]["state"] != "tripped":
            lost.append((number, delay, names, r.state_of(status)))
        refused = rig.tool("arm", "--by", "Grace")
        if refused.returncode != 1 or "acknowledge it first" not in refused.stderr:
            armed_all_the_same.append((number, refused.stdout, refused.stderr))
        answers = rig.acknowledge()
        if rig.latches() != []:
            not_over.append((number, names, [a.stdout + a.stderr for a in answers]))
    checks.equal(lost, [], f"{KILLS} times killed around a trip (seed {seed}): each time the next start has latched it")
    checks.equal(armed_all_the_same, [], "none can be armed before it is acknowledged")
    checks.equal(not_over, [], "two persons end each of them")
    checks.note(f"latched: {found}")


def deaths(rig):
    """Before which call each was."""
    return [line.split()[-1] for line in rig.daemon.text().splitlines() if line.startswith("killed before")]


def killed_before_each_call(checks, rig):
    """While the table shakes: before the first call to disk or wire that follows the trip, before the second, ..."""
    library, at = os.path.join(rig.folder, "die_at.so"), os.path.join(rig.folder, "die-at")
    subprocess.run(["c++", "-shared", "-fPIC", "-O1", "-o", library,
                    os.path.join(os.path.dirname(os.path.abspath(__file__)), "die_at.cpp")], check=True)
    rig.daemon.end()
    environment = {"LD_PRELOAD": library, "DIE_AT": at}
    rig.start(environment)
    found, lost, lives, not_over = {}, [], [], []
    last = None
    # Which calls these are is chance, but for the sync, before which the rows of the trip are not on the disk yet.
    for place in [str(number) for number in range(1, PLACES + 1)] + [f"{number} sync" for number in range(1, SYNCS + 1)]:
        said = [rig.tool(word, "--by", "Ada") for word in ("arm", "start")]
        status = rig.wait_for_state(("recording", "aborted", "tripped"), 60)
        if status["campaign"]["state"] != "recording":
            checks.check(False, f"place {place}: it shakes before", f"{said} {r.state_of(status)}\n{rig.logs()}")
            return
        rig.order("estop open")
        with open(at + ".new", "w", encoding="ascii") as file:
            file.write(place)
        os.replace(at + ".new", at)
        end = time.monotonic() + 20
        while rig.daemon.running() and time.monotonic() < end:
            time.sleep(0.01)
        if rig.daemon.running():
            lives.append(place)
        rig.kill()
        os.unlink(at)
        rig.order("estop close")
        rig.start(environment)
        status = rig.wait_for_state(("tripped",), 10)
        names = rig.latches()
        for name in names or []:
            found[name] = found.get(name, 0) + 1
        if not names or status["campaign"]["state"] != "tripped" or rig.tool("arm", "--by", "Grace").returncode != 1:
            lost.append((place, names, r.state_of(status)))
        rig.wait_for(lambda s: s["shaker"].get("rest") == "at rest", 30)
        answers = rig.acknowledge()
        if rig.latches() != []:
            not_over.append((place, names, [a.stdout + a.stderr for a in answers]))
        last = place
        if lost or lives:
            break
    before = deaths(rig)
    rig.daemon.end()
    rig.start()
    checks.equal(lives, [], f"killed before calls after a trip while it shakes, up to call {PLACES} and before its first {SYNCS} syncs")
    checks.note(f"the last one: {last}")
    checks.equal(lost, [], "each time the next start has latched it and is not armed")
    checks.equal(not_over, [], "and two persons end each of those, too")
    checks.check("emergency_stop" in found, "and not the arming's entry alone, but the trip's own cause", found)
    checks.check({"send", "pwrite64"} <= set(before), "among these are the stop and the journal", before)
    checks.check(len(before) > SYNCS and all(call in ("fsync", "fdatasync") for call in before[-SYNCS:]), "the last ones were before a sync", before)
    checks.note(f"latched: {found}, killed before {before}")


def while_shaking(checks, rig):
    """Killed while the table shakes: the arming had no end."""
    armed = rig.tool("arm", "--by", "Ada")
    checks.check("IMU-7 0042" in armed.stdout and "up to 5 g" in armed.stdout, "arming names unit and level", armed.stdout)
    started = rig.tool("start", "--by", "Grace")
    checks.check("armed by Ada" in started.stdout, "start by another says by whom it was armed",
                 started.stdout + started.stderr)
    again = rig.tool("start", "--by", "Ada")
    checks.check(again.returncode == 1 and "a campaign is running, started by Grace" in again.stderr,
                 "a second start is refused: it runs", again.stderr)
    status = rig.wait_for_state(("recording", "aborted", "tripped"), 60)
    checks.check(status["campaign"]["state"] == "recording", "it shakes", r.state_of(status))
    rig.kill()
    rig.start()
    status = rig.wait_for(lambda s: s["campaign"]["state"] == "tripped", 10)
    checks.check("died_armed" in (rig.latches() or []) and "while armed by Ada" in status["campaign"]["reason"],
                 "killed while it shook: died_armed, and who had armed", str(status["campaign"]))
    rig.wait_for(lambda s: s["shaker"].get("running") is False and s["shaker"].get("measured_g", 1) < 0.05, 30)
    rig.kill()   # nobody has acknowledged anything
    rig.start()
    checks.check("died_armed" in (rig.latches() or []), "and so after another SIGKILL", str(rig.latches()))
    rig.acknowledge()
    checks.equal(rig.latches(), [], "acknowledged by name it is over")
    rig.kill()
    rig.start()
    checks.equal((rig.latches(), rig.status()["campaign"]["state"]), ([], "idle"), "also after the next start")


def an_orderly_end_is_one(checks, rig):
    rig.tool("arm", "--by", "Ada")
    checks.equal(rig.daemon.end(), 0, "SIGTERM while armed ends it in order")
    rig.start()
    checks.equal(rig.latches(), [], "which leaves no latch")


def two_persons(checks, rig):
    rig.tool("arm", "--by", "Ada")
    rig.order("estop open")
    rig.wait_for_state(("tripped",), 20)
    open_ = rig.tool("ack", "trip", "--by", "Grace")
    checks.check(open_.returncode == 1 and "close it first" in open_.stderr, "with the chain open nobody acknowledges it",
                 open_.stdout + open_.stderr)
    rig.order("estop close")
    rig.wait_for(lambda s: s["shaker"].get("emergency_stop_open") is False, 20)
    checks.equal(rig.daemon.end(), 0, "SIGTERM after a trip, at rest: it ends in order")
    rig.start()
    refused = rig.tool("arm", "--by", "Ada")
    checks.check(rig.latches() == ["emergency_stop"] and refused.returncode == 1 and "acknowledge it first" in refused.stderr,
                 "which is nobody's acknowledgement: the next start has the trip, and is not armed",
                 f"{rig.latches()} {refused.stdout}{refused.stderr}")
    rig.tool("ack", "trip", "--by", "Ada")
    rig.kill()   # between the two persons
    rig.start()
    same = rig.tool("ack", "trip", "--by", "ADA")
    checks.check(same.returncode == 1 and "another person than Ada" in same.stderr,
                 "who armed is not the second person, also after a restart", same.stdout + same.stderr)
    other = rig.tool("ack", "trip", "--by", "Grace")
    checks.check(other.returncode == 0 and rig.latches() == [], "another one is", other.stdout + other.stderr)


def held_by_the_controller(checks, rig):
    """The stop at the daemon's start makes the controller forget its fault."""
    rig.daemon.end()
    rig.order("estop open")
    rig.order("estop close")
    rig.start()
    status = rig.wait_for_state(("tripped",), 10)
    checks.check(status["campaign"]["state"] == "tripped" and "held fault" in status["campaign"]["reason"],
                 "a fault that the controller held at the start is latched", r.state_of(status))
    checks.check(rig.tool("arm", "--by", "Ada").returncode == 1, "and keeps it disarmed")
    checks.check(rig.paged("held fault"), "and somebody is paged")
    rig.kill()
    rig.start()
    checks.check(rig.paged("not acknowledged"), "a start that finds it so pages, too")
    rig.acknowledge()
    checks.check(rig.tool("arm", "--by", "Ada").returncode == 0, "until acknowledged")
    rig.tool("abort", "--by", "Ada")


def pressed_later(checks, rig):
    """The emergency stop after a trip, and where nothing is guarded: it is no interlock's then."""
    for what, before in (("after a trip", "fault loop-open"), ("while idle", None)):
        if before:
            rig.tool("arm", "--by", "Ada")
            rig.order(before)
            rig.wait_for_state(("tripped",), 20)
        rig.order("estop open")
        rig.wait_for(lambda s: "emergency_stop" in [latch["name"] for latch in s["interlock"]["latches"]], 10)
        checks.check("emergency_stop" in rig.latches(), f"pressed {what} the emergency stop is a latch of its own", rig.latches())
        rig.kill()
        rig.start()
        rig.order("clear")
        rig.order("estop close")
        rig.wait_for(lambda s: s["shaker"].get("emergency_stop_open") is False and s["shaker"].get("rest") == "at rest", 20)
        rig.tool("ack", "trip", "--by", "Ada")
        checks.equal(rig.latches(), ["emergency_stop"], f"{what}: which one person does not end, nor a restart")
        checks.equal(rig.tool("arm", "--by", "Ada").returncode, 1, f"{what}: nor is it armed")
        status = rig.status()
        checks.equal(status["campaign"]["reason"], status["interlock"]["latches"][0]["cause"], f"{what}: and what is over is no reason any more")
        last = rig.tool("ack", "trip", "--by", "Grace")
        checks.equal((rig.latches(), "loop" in last.stdout), ([], False), f"{what}: another one does, and acknowledges nothing else")
    checks.check(rig.tool("arm", "--by", "Ada").returncode == 0, "then it can be armed")
    rig.tool("abort", "--by", "Ada")


def disk_refuses(checks, rig):
    pid = rig.daemon.process.pid
    was = resource.prlimit(pid, resource.RLIMIT_FSIZE)
    rig.tool("arm", "--by", "Ada")
    resource.prlimit(pid, resource.RLIMIT_FSIZE, (4096, was[1]))
    rig.order("estop open")
    status = rig.wait_for_state(("tripped",), 20)
    checks.check(status["campaign"]["state"] == "tripped" and rig.latches() == ["emergency_stop"],
                 "a disk that refuses: it trips all the same", r.state_of(status))
    rig.order("estop close")
    rig.wait_for(lambda s: s["shaker"].get("emergency_stop_open") is False, 20)
    said = [answer.stdout for answer in rig.acknowledge()]
    checks.check(len(said) == 2 and all("may have to be said again" in words for words in said),
                 "who acknowledges it is warned that a restart may forget that", str(said))
    refused = rig.tool("arm", "--by", "Ada")
    checks.check(refused.returncode == 1 and "journal has not written" in refused.stderr,
                 "it is not armed while that cannot be written", refused.stdout + refused.stderr)
    resource.prlimit(pid, resource.RLIMIT_FSIZE, was)
    rig.wait_for(lambda s: s["journal"]["running"], 20)
    checks.check(rig.tool("arm", "--by", "Ada").returncode == 0, "once there is room again it is")
    rig.daemon.end()
    rig.start()
    checks.equal(rig.latches(), [], "and nothing of that is left over")


def main():
    programs = r.programs_from_command_line(__doc__)
    seed = int(sys.argv[sys.argv.index("--seed") + 1]) if "--seed" in sys.argv else 1
    checks = r.Checks()
    with tempfile.TemporaryDirectory() as folder:
        rig = Rig(programs, folder)
        try:
            rig.start()
            killed_at_any_moment(checks, rig, seed)
            killed_before_each_call(checks, rig)
            for part in (while_shaking, an_orderly_end_is_one, two_persons, held_by_the_controller, pressed_later, disk_refuses):
                part(checks, rig)
        finally:
            rig.stop()
    return checks.end()


if __name__ == "__main__":
    sys.exit(main())
