#!/usr/bin/python3
"""Each fault of bus and shaker link in turn, while the table shakes, on a real vcan0 and real Modbus in virtual time: what
happens has to be what is expected, by name; a stop is the next write, no set-point follows it, no frame is unaccounted for.
Then all processors kept busy, in real time. With --soak or --faults a random fault every few minutes instead; memory,
descriptors and log have to stay flat.

usage: fault_matrix.py PROGRAMS [--rows PATTERN]       of the matrix, by name; else all and what follows
       fault_matrix.py PROGRAMS --soak HOURS | --faults N [--seed N]
       fault_matrix.py PROGRAMS --inside WHAT          inside the machine in virtual time
"""
import glob
import json
import os
import random
import re
import signal
import statistics
import subprocess
import sys
import tempfile
import time

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import hard_times  # noqa: E402
import modbus_proxy  # noqa: E402
import random_faults  # noqa: E402
import rig as r  # noqa: E402
import shaker_lies  # noqa: E402

HERE = os.path.dirname(os.path.abspath(__file__))
BUS = "vcan0"
CAMPAIGN = {"name": "faulty", "identify": "what-it-can", "positions_deg": [[0, 0, 0]], "table_g": [5.0],
            "dwell_s": 80000.0, "settle_s": 2.0, "ramp_s": 0.5, "temperature_window_s": 0.0}
TIMEOUT_S = 0.5
LONGEST_DWELL_S = 900
EVENTS = 10_000   # that the daemon holds
STALE = {"stale_channel", "stale_platform"}
ON = {None}            # it goes on
LINK = {"link lost"}   # the campaign is aborted for the link's sake, the shaker stops


def run(*words):
    subprocess.run(words, check=True, stdin=subprocess.DEVNULL)


def frames(*each):
    def send(rig):
        for frame in each:
            run("cansend", BUS, frame)
    return send


def plant(*faults):
    return lambda rig: [rig.order("fault " + fault) for fault in faults]


def modbus(spoil, times=None):
    return lambda rig: rig.proxy.break_with(spoil, times)


def link(*words):
    return lambda rig: run("ip", "link", *words)


def remade(rig):
    run("ip", "link", "del", BUS)
    time.sleep(1)
    run("ip", "link", "add", BUS, "type", "vcan")
    run("ip", "link", "set", BUS, "mtu", "72", "up")


def stopped_process(rig):
    rig.plant.process.send_signal(signal.SIGSTOP)


def continued_process(rig):
    rig.plant.process.send_signal(signal.SIGCONT)


def clock_step(seconds):
    """Kernel receive stamps follow the wall clock."""
    return lambda rig: time.clock_settime(time.CLOCK_REALTIME, time.time() + seconds)


def clock_shaken(rig):
    for seconds in (-0.5, 0.7, -0.3, 0.05, -0.05, 0.1) * 5:
        clock_step(seconds)(rig)
        time.sleep(0.037)


def cable(out):
    """What is sent is lost without a word, in both directions."""
    words = ("add", "dev", "lo", "root", "netem", "loss", "100%") if out else ("del", "dev", "lo", "root")
    return lambda rig: run("tc", "qdisc", *words)


def nothing(rig):
    pass


# name, what is done, for how many s, what undoes it, what may come of it
ROWS = [
    ("frame loss 1 %", plant("lose=0.01"), 10, nothing, ON),
    # four of one kind in a row are 100 ms without it: once in some hundred seconds for each of six kinds
    ("frame loss 10 %", plant("lose=0.1"), 10, nothing, ON | STALE),
    ("frame loss 33 %", plant("lose=0.33"), 20, nothing, STALE | {"frame_loss_abort", "amplitude_witness"}),
    ("silence 5 s", plant("bus-silent=5"), 6, nothing, STALE),
    ("duplicates", plant("duplicate=0.3"), 5, nothing, ON),
    ("reordering", plant("reorder=0.1"), 5, nothing, ON | STALE),
    ("wrong DLC", plant("shorten=0.02"), 5, nothing, ON),
    ("frames a tick late", plant("late=25,0.1"), 5, nothing, ON | STALE),
    ("emergency stop", plant("estop"), 2, nothing, {"emergency_stop", "shaker_fault"}),
    ("loop open", plant("loop-open"), 2, nothing, {"loop_open"}),
    ("platform fault", plant("platform-fault"), 2, nothing, {"platform_fault"}),
    ("unknown, extended, FD, remote frames",
     frames("6FF#01", "1FFFFFFF#0102", "101##1010203", "101#R", "7A0##0"), 2, nothing, ON),
    ("sync count jumps", frames("080#FFFFFFFF00000000"), 3, nothing, ON | STALE),
    ("sync count goes backwards", frames("080#0100000000000000", "080#0000000000000000"), 3, nothing, ON | STALE),
    ("error frames", frames("20000002#0000000000000000", "20000080#0000000000000000"), 2, nothing, ON),
    ("error passive", frames("20000004#0030000000000000"), 2, frames("20000004#0040000000000000"), ON),
    ("bus off", frames("20000040#0000000000000000"), 2, frames("20000100#0000000000000000"), {"can_lost"}),
    ("interface down 1 s", link("set", BUS, "down"), 1, link("set", BUS, "up"), {"can_lost"}),
    ("interface down 60 s", link("set", BUS, "down"), 60, link("set", BUS, "up"), {"can_lost"}),
    ("interface deleted and remade", remade, 2, nothing, {"can_lost"}),
    ("wall clock an hour on", clock_step(3600), 3, clock_step(-3600), ON),
    ("wall clock an hour back", clock_step(-3600), 3, clock_step(3600), ON),
    ("time stamps back and forth", clock_shaken, 2, nothing, ON),
    ("Modbus: wrong transaction", modbus("transaction", 1), 3, nothing, ON | LINK),
    ("Modbus: wrong unit", modbus("unit", 1), 3, nothing, ON | LINK),
    ("Modbus: wrong function", modbus("function", 1), 3, nothing, ON | LINK),
    ("Modbus: length too large", modbus("length", 1), 3, nothing, ON | LINK),
    ("Modbus: length too small", modbus("short", 1), 3, nothing, ON | LINK),
    *[(f"Modbus: exception {n}", modbus(("exception", n), 1), 3, nothing, ON | LINK) for n in range(1, 7)],
    ("Modbus: exceptions without end", modbus(("exception", 4)), 6, modbus(None), LINK),
    ("Modbus: reset mid-reply", modbus("reset", 1), 3, nothing, ON | LINK),
    ("Modbus: late by one timeout", modbus(("late", TIMEOUT_S * 1.1), 1), 3, nothing, ON | LINK),
    ("Modbus: late by three timeouts", modbus(("late", TIMEOUT_S * 3.3), 1), 4, nothing, ON | LINK),
    ("Modbus: one byte per 100 ms", modbus("trickle"), 6, modbus(None), LINK),
    ("Modbus: each connection is closed at once", modbus("refuse"), 10, modbus(None), LINK),
    ("Modbus: server killed", lambda rig: rig.proxy.kill(), 10, lambda rig: rig.proxy.revive(), LINK),
    ("Modbus: server stopped for 30 s", modbus("freeze"), 30, modbus(None), LINK),
    ("Modbus: cable out 5 s", cable(True), 5, cable(False), LINK),
    ("Modbus: cable out 1 minute", cable(True), 60, cable(False), LINK),
    ("Modbus: a trip while a request hangs", lambda rig: (modbus("hang")(rig), time.sleep(0.3), plant("bus-silent=2")(rig)),
     1.5, modbus(None), STALE | LINK),
    ("rig stopped for 30 s", stopped_process, 30, continued_process, STALE),
]
SOAKED = [*(row for row in ROWS if not row[0].startswith("wall clock")),
          ("Modbus: cable out 10 minutes", cable(True), 600, cable(False), LINK)]
HOGS = []


def lost(status):
    """On the way from the bus to the filter."""
    return [r.number(status["can"].get("kernel_dropped", 0)), r.number(status["assembler"].get("gaps", 0)),
            r.number(status["assembler"].get("incomplete", 0)), r.number(status["estimator_ring"].get("dropped", 0))]


def hog(rig):
    rig.lost_before = lost(rig.status())
    HOGS.extend(subprocess.Popen(["sh", "-c", "while :; do :; done"], stdin=subprocess.DEVNULL, preexec_fn=r.die_with_parent)
                for _ in range(2 * os.cpu_count()))


def no_hog(rig):
    while HOGS:
        process = HOGS.pop()
        process.kill()
        process.wait()


BUSY = ("all processors busy", hog, 10, no_hog, ON)
# In real time the whole machine may be late; that is not what is looked at there.
PATIENT = {"can": {"join_deadline_ms": 2000, "stale_deadline_ms": 5000}, "gimbal": {"status_deadline_ms": 5000},
           "shaker": {"response_timeout_ms": 5000, "watchdog_period_ms": 1000}}


class FaultRig(r.Rig):
    def __init__(self, programs, folder):
        super().__init__(programs, BUS, "real", folder)
        self.looks = []   # of a table that shakes, before each fault

    def start(self, seed, interlock="", campaign=None, truth=None, **tables):
        """`interlock`: rows of its table, as they stand in the configuration."""
        # more than nothing, for the row that looks at it
        truth = self.truth_file(truth or {"isolator": {"cross_axis": [0.01, 0.0]}})
        self.start_plant("--seed", str(seed), "--truth", truth, "--warm-up", "1", "--start-temperature", "45")
        self.proxy = modbus_proxy.Proxy(self.modbus_port)
        plant_port, self.modbus_port = self.modbus_port, self.proxy.port
        shaker = {"host": "127.0.0.1", "port": self.proxy.port, "response_timeout_ms": TIMEOUT_S * 1e3,
                  "backoff_max_ms": 500, **tables.pop("shaker", {})}
        self.configure(campaign or CAMPAIGN, shaker=shaker, **{"record": {"enabled": False}, **tables})
        with open(self.configuration, "a", encoding="utf-8") as file:
            file.write(interlock)
        with open(self.configuration, encoding="utf-8") as file:
            self.configuration_text = file.read()
        self.modbus_port = plant_port
        self.start_daemon()

    def command(self, kind, argument=""):
        return self.ask("/api/v1/commands", {"kind": kind, "by": "tester", "argument": argument})

    def rest(self):
        """Clears what the last fault left, until the rig could be armed; at once where it has left a table that shakes."""
        self.order("clear")
        self.proxy.break_with(None)

        def clear(status):
            if status["campaign"]["state"] == "recording":
                return True
            if status["campaign"]["state"] == "tripped":
                self.command("acknowledge", "trip")
            elif status["shaker"].get("fault") or status["shaker"].get("watchdog_timeout_s") in (0, 60):   # of other masters
                self.command("acknowledge", "shaker")
                return False
            return status["campaign"]["state"] != "tripped" and status["can"]["link"] == "running" and \
                status["shaker"]["link"] == "running" and status["shaker"].get("state") == 0 and \
                not status["shaker"].get("fault") and not status["shaker"].get("running") and \
                not status["shaker"].get("stop_pending") and \
                all(c["quality"] == "good" for c in status["sample"]["channels"])
        return self.wait_for(clear, 60)

    def shake(self):
        """To a table that shakes at its level."""
        self.rest()
        said = [self.command(kind) for kind in ("arm", "start")]
        status = self.wait_for(lambda s: s["campaign"]["state"] in ("recording", "aborted", "tripped"), 60)
        return status is not None and status["campaign"]["state"] == "recording", f"{r.state_of(status)} {said}"


def outcome_of(status):
    """Name of the row that tripped, or that the link was lost, or None."""
    state = status["campaign"]["state"]
    if state == "tripped":
        return status["interlock"]["tripped"]
    if state == "aborted":
        reason = status["campaign"]["reason"]
        return "link lost" if "read-back" in reason or "shaker" in reason else reason
    return None


def is_set_point(write):
    _, address, values = write
    if address == modbus_proxy.RUN - 1 and values == (0,):   # the ramp of a stop that is not taken as one write
        return False
    return not is_stop(write) and (address < modbus_proxy.RUN or (address == modbus_proxy.RUN and values[0] != 0))


def is_stop(write):
    """Run 0, alone or behind a ramp time of 0."""
    _, address, values = write
    return address + len(values) == modbus_proxy.RUN + 1 and len(values) <= 2 and not any(values)


def is_ramp_0(write):
    _, address, values = write
    return address == modbus_proxy.RUN - 1 and tuple(values) == (0,)


def fault(checks, rig, row):
    name, begin, seconds, undo, expected = row
    shaking, found = rig.shake()
    if not checks.check(shaking, f"{name}: the table shakes before", found + "\n" + rig.logs()):
        return
    rig.looks.append(used(rig))
    trips = len(glob.glob(os.path.join(rig.results, "trips", "*.jsonl")))
    since = time.monotonic()
    first = len(rig.proxy.writes)
    begin(rig)
    time.sleep(seconds)
    during = rig.status() or {}
    back = time.monotonic()
    undo(rig)
    time.sleep(2)
    status = rig.wait_for(lambda s: outcome_of(s) is None or not s["shaker"].get("stop_pending"), 20)
    outcome = outcome_of(status)
    checks.check(outcome in expected, f"{name}: {' or '.join(sorted(str(e or 'it goes on') for e in expected))}",
                 f"found {outcome}\n{rig.logs()}")
    if name == "bus off" or name == "error passive":
        # Frames go on after the one that looks like bus off, so that the controller cannot be.
        now = "active" if name == "bus off" else "passive"
        checks.equal(during.get("can", {}).get("controller"), now, f"{name}: the status says {now}, as the bus does")
    writes = rig.proxy.writes[first:]
    if outcome is None:
        checks.check(not any(is_stop(w) or is_set_point(w) for w in writes), f"{name}: nothing is written but feeds", writes)
    else:
        stops = [i for i, w in enumerate(writes) if is_stop(w)]
        checks.check(stops and not any(is_set_point(w) for w in writes), f"{name}: a stop and no set-point is written",
                     writes)
        late = [c for c in rig.proxy.connections if c > since]
        if late and stops:
            after = [w for w in writes if late[-1] <= w[0] <= late[-1] + 0.1]
            if len(after) > 1 and is_ramp_0(after[0]):   # a part of the stop
                after = after[1:]
            checks.check(not after or is_stop(after[0]) or writes[stops[0]][0] < late[-1],
                         f"{name}: after a reconnection the stop is the first write", after)
        if during.get("shaker", {}).get("stop_pending"):
            check_return(checks, rig, name, back)
        at_rest = rig.wait_for(lambda s: s["shaker"].get("state") in (0, 4) and s["shaker"].get("measured_g", 1) < 0.05, 20)
        checks.check(at_rest["shaker"].get("measured_g", 1) < 0.05, f"{name}: the table comes to rest", at_rest["shaker"])
        checks.check(not at_rest["campaign"]["armed_by"], f"{name}: nobody is armed any more")
    if status["campaign"]["state"] == "tripped":
        check_trip_file(checks, rig, name, trips, outcome)
    r.check_balance(checks, rig, name)


def check_return(checks, rig, name, back):
    """The shaker can be reached again, and is to be stopped: within 100 ms that is the one write."""
    numbers = [n for n, when in enumerate(rig.proxy.connections) if when >= back]
    if not numbers:
        return
    first = rig.proxy.connections[numbers[0]]
    after = [w for w in rig.proxy.writes if first <= w[0] <= first + 0.1]
    if "stopped for" in name:   # it finds waiting whatever was asked in vain, the stops among it
        checks.check(any(map(is_stop, after)), f"{name}: within 100 ms after it there is a stop", after)
        return
    # In one request, or the ramp before it where such a request came to nothing.
    checks.check(after and is_stop(after[-1]) and len(after) <= 2 and all(is_stop(w) or is_ramp_0(w) for w in after),
                 f"{name}: within 100 ms after it the stop is the only write", after)
    time.sleep(5)   # what a kernel has kept it would have sent again by now
    late = [n for n in range(numbers[0]) if rig.proxy.heard[n] > first]
    checks.check(not late, f"{name}: nothing is delivered late on an older connection", late)


def check_trip_file(checks, rig, name, before, outcome):
    """What led to it is on disk: the cause, events, samples in order up to it."""
    end = time.monotonic() + 10
    while len(files := sorted(glob.glob(os.path.join(rig.results, "trips", "*.jsonl")), key=os.path.getmtime)) <= before \
            and time.monotonic() < end:
        time.sleep(0.1)
    if not checks.check(len(files) == before + 1, f"{name}: what led to the trip is saved", f"{before} before, {files}"):
        return
    with open(files[-1], encoding="utf-8") as file:
        lines = [json.loads(line) for line in file]
    times = [line["time_s"] for line in lines if "sequence" in line]
    good = lines[0]["trip"] == outcome and any("stop of the shaker" in line.get("event", "") for line in lines) and \
        len(times) > 50 and times == sorted(times) and lines[0]["time_s"] - 60.001 <= times[0] and lines[0]["samples_lost"] == 0
    checks.check(good, f"{name}: cause, events and samples in it", f"{lines[0]}, {len(times)} samples")


def matrix(checks, rig, pattern=""):
    for row in ROWS:
        if re.search(pattern, row[0]):
            fault(checks, rig, row)
    if not pattern:
        flat(checks, rig.looks, 8192, "the matrix")   # rings, caches and pre-trip record still fill
    shaker_lies.rows(checks, rig, pattern)
    hard_times.rows(checks, rig, pattern)
    if pattern:
        return
    one_acknowledgement(checks, rig, "emergency stop", plant("estop"), 2, plant_is_well)
    one_acknowledgement(checks, rig, "vibrigd stopped for 5 s", daemon_signal(signal.SIGSTOP), 5, daemon_signal(signal.SIGCONT))


def plant_is_well(rig):
    rig.order("clear")


def daemon_signal(number):
    return lambda rig: rig.daemon.process.send_signal(number)


def one_acknowledgement(checks, rig, name, begin, seconds, undo):
    """The controller latches a fault of its own, too: acknowledged once, it can be armed at once. (A controller that was
    left alone is ordered to stop by the daemon's own trip, and so forgets by itself.)"""
    shaking, found = rig.shake()
    checks.check(shaking, f"{name}: the table shakes before", found)
    begin(rig)
    time.sleep(seconds)
    undo(rig)
    status = rig.wait_for(lambda s: outcome_of(s) is not None and s["shaker"].get("rest") == "at rest" and
                          not s["shaker"].get("stop_pending") and not s["shaker"].get("emergency_stop_open"), 20)
    checks.check(status["campaign"]["state"] == "tripped" and (name != "emergency stop" or status["shaker"].get("fault")),
                 f"{name}: it has tripped", f"{r.state_of(status)} {status['shaker']}")
    wrong = rig.tool("ack", "nothing-of-this-name", "--by", "tester")
    checks.check(wrong.returncode == 1 and status["interlock"]["tripped"] in wrong.stderr,
                 f"{name}: another name acknowledges nothing", wrong.stderr)
    done = rig.tool("ack", "trip", "--by", "tester")   # the chain latches beside another cause that was quicker
    checks.check(done.returncode == 0, f"{name}: then vibrig ack is accepted at once", done.stderr)
    done = rig.arm()
    checks.check(done.returncode == 0, f"{name}: then vibrig arm is, too", done.stderr)
    rig.command("abort")


def used(rig):
    """Resident memory (kB), descriptors (fewest of some looks), bytes of log."""
    pid = rig.daemon.process.pid
    counts = []
    for _ in range(5):
        counts.append(len(os.listdir(f"/proc/{pid}/fd")))
        time.sleep(0.3)
    with open(f"/proc/{pid}/status", encoding="ascii") as file:
        resident = next(int(line.split()[1]) for line in file if line.startswith("VmRSS"))
    return resident, min(counts), os.path.getsize(rig.daemon.log)


def busy(programs):
    checks = r.Checks()
    with tempfile.TemporaryDirectory() as folder:
        rig = FaultRig(programs, folder)
        try:
            rig.start(1, **PATIENT)
            # A rig is not slowed down by what keeps this machine busy.
            run("chrt", "--all-tasks", "--fifo", "--pid", "60", str(rig.plant.process.pid))
            fault(checks, rig, BUSY)
            checks.equal(lost(rig.status()), rig.lost_before, "all processors busy: no frame and no sample is lost")
            checks.equal(rig.daemon.end(timeout=60), 0, "vibrigd ends cleanly")
        finally:
            no_hog(rig)
            rig.stop()
    return checks.end()


def fill_event_log(checks, rig, events):
    """Whoever arms again adds an event; more than 10 commands a second are refused."""
    rig.rest()
    for _ in range(events):
        rig.command("arm")
        time.sleep(0.11)
    full = rig.ask(f"/api/v1/events?after={events - 1}&limit=1")
    checks.check(full and full["events"], "the event log is full", full)
    rig.command("abort")


def soak(checks, rig, seed, faults, longest_pause_s, events):
    rng = random.Random(seed)
    checks.note(f"soak: seed {seed}, {faults} faults")
    if events:
        fill_event_log(checks, rig, events)   # what grows after that is something else
    looks, began = [], time.monotonic()
    for n in range(faults):
        row = rng.choice(SOAKED)
        checks.note(f"{time.monotonic():.0f} s: fault {n + 1}: {row[0]}")
        fault(checks, rig, row)
        # What a dwell was fed is kept until it is done (64 bytes a sample), and no real one lasts for hours.
        if time.monotonic() - began > LONGEST_DWELL_S:
            rig.command("abort")
            began = time.monotonic()
        shaking, found = rig.shake()
        checks.check(shaking, f"fault {n + 1}: the table shakes again after it", found)
        time.sleep(rng.uniform(longest_pause_s / 5, longest_pause_s))
        looks.append(used(rig))
        checks.note(f"resident {looks[-1][0]} kB, descriptors {looks[-1][1]}, log {looks[-1][2]} bytes")
    # In a short run rings, caches and the pre-trip record still fill.
    flat(checks, looks, 1024 if events else 8192, f"seed {seed}")


def flat(checks, looks, room, what):
    """After the first third; a single look may find the large blocks of a campaign and of the one before it."""
    thirds = [looks[len(looks) * k // 3:len(looks) * (k + 1) // 3] for k in range(3)]
    before, after = (statistics.median(look[0] for look in third) for third in thirds[1:])
    checks.check(after <= before + room, f"memory stays flat within {room} kB ({what})", looks)
    checks.note(f"median resident memory of the thirds from the second on: {before:.0f} and {after:.0f} kB")
    settled, last = looks[len(looks) // 3], looks[-1]
    checks.equal(last[1], settled[1], f"descriptors stay flat ({what})")
    checks.check(last[2] / len(looks) < 20_000, f"a fault leaves less than 20 kB of log ({what})", last)


def at_random(checks, programs, pattern):
    """The rows under random vibration, with a rig and a daemon of their own once the others are gone."""
    rows = [row for row in random_faults.rows_of(sys.modules[__name__]) if re.search(pattern, row[0])]
    if not rows:
        return
    with tempfile.TemporaryDirectory() as folder:
        rig = FaultRig(programs, folder)
        try:
            random_faults.start(rig, 1)
            for row in rows:
                fault(checks, rig, row)
            checks.equal(rig.daemon.end(timeout=30), 0, "random: vibrigd ends cleanly")
        finally:
            rig.stop()


def inside(programs, what):
    checks = r.Checks()
    with tempfile.TemporaryDirectory() as folder:
        rig = FaultRig(programs, folder)
        try:
            rig.start(1, threads=r.NO_PRIORITY)
            rig.wait_for(r.measuring, 60)
            if what.startswith("matrix"):
                matrix(checks, rig, what.removeprefix("matrix"))
            else:
                _, *numbers = what.split(":")
                soak(checks, rig, *map(int, numbers))
            checks.equal(rig.daemon.end(timeout=30), 0, "vibrigd ends cleanly")
        finally:
            rig.stop()
    if what.startswith("matrix") and what != "matrix":   # a run of their own: their rig takes longer for a second
        at_random(checks, programs, what.removeprefix("matrix"))
    checks.note(f"{time.monotonic():.0f} s of virtual time")
    return checks.end()


def option(name, default):
    return sys.argv[sys.argv.index(name) + 1] if name in sys.argv else default


def main():
    programs = r.programs_from_command_line(__doc__)
    if "--inside" in sys.argv:
        what = option("--inside", "")
        return busy(programs) if what == "busy" else inside(programs, what)
    what = "matrix" + option("--rows", "")
    if "--soak" in sys.argv or "--faults" in sys.argv:
        # a fault, its aftermath and the pause take four minutes on average; a few faults need no long pauses
        faults, pause_s, events = option("--faults", None), 100, 0
        if faults is None:
            faults, pause_s, events = int(float(option("--soak", "1")) * 15), 300, EVENTS
        what = f"soak:{option('--seed', random.randrange(1 << 30))}:{faults}:{pause_s}:{events}"
    virtual = in_machine(programs, what, "-T", "-t", "200000", "--wall", str(4800 if "--soak" not in sys.argv else 36000))
    real = in_machine(programs, "busy", "-t", "120") if what == "matrix" else 0   # a hog would stop the virtual clock
    return virtual or real


def in_machine(programs, what, *options):
    return subprocess.run([os.path.join(HERE, "run-in-uml"), *options, "--", os.path.abspath(__file__), programs, "--inside",
                           what], stdin=subprocess.DEVNULL, check=False,
                          preexec_fn=lambda: r.die_with_parent(signal.SIGTERM)).returncode


if __name__ == "__main__":
    sys.exit(main())
