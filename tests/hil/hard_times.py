"""Rows of the fault matrix that are no fault of the bus: what is already true at the start and when it is armed again, the
safe-state proof against a controller that lies, and an operating system that makes it hard."""
import ctypes
import json
import mmap
import os
import re
import signal
import socket
import struct
import subprocess
import sys
import threading
import time

import rig as r
import shaker_lies as lies

ARM_S = 10          # for a refusal or a trip after arming and starting
PROOF_S = 120       # "about a minute"
TIMEOUT_S, STOP_S, RING_DOWN_S = lies.WATCHDOG_S, lies.STOP_S, 3.0
JOURNAL_S = 1       # to the trip in the journal
ARMING_S = 600      # [campaign] arming_valid_s
ABORT_S = 0.2       # to the answer to an abort, under every fault


# ---- already true: at the start, and when it is armed again

def orders(*words):
    return lambda rig: [rig.order(word) for word in words]


def link(*words):
    return lambda rig: subprocess.run(["ip", "link", *words], check=True, stdin=subprocess.DEVNULL)


def broken(how):
    return lambda rig: rig.proxy.break_with(how)


def row_of(condition, limit=None):
    limits = "" if limit is None else f"limit = {limit}\n"
    return f'\n[[interlock]]\nname = "tested"\ncondition = "{condition}"\nreaction = "abort"\n{limits}'


class ForeignMaster:
    """Another master on the controller's Modbus port, past the daemon: writes again and again."""
    BUSY = []

    def __init__(self, rig, address, *values):
        body = b"".join(value.to_bytes(2, "big") for value in values)
        pdu = struct.pack(">BHHB", 16, address, len(values), len(body)) + body
        self.words = struct.pack(">HHHB", 1, 0, len(pdu) + 1, 1) + pdu
        self.link = socket.create_connection(("127.0.0.1", rig.modbus_port), timeout=20)
        self.quit = threading.Event()
        self.thread = threading.Thread(target=self.write, daemon=True)
        self.thread.start()
        self.BUSY.append(self)

    def write(self):
        while not self.quit.wait(0.1):
            self.link.sendall(self.words)
            self.link.recv(256)

    def end(self):
        self.quit.set()
        self.thread.join()
        self.link.close()


class FalseGuard:
    """Says for ever that it has stopped the shaker."""
    WORD = struct.pack("<IHHQQd16s", 0x32476256, 0b11110, 3, 1, 7, 0.0, b"")   # unarmed_motion, finding 7

    def __init__(self, path):
        self.listener = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self.listener.bind(path)
        self.listener.listen(4)
        threading.Thread(target=self.accept, daemon=True).start()

    def accept(self):
        try:
            while True:
                threading.Thread(target=self.answer, args=(self.listener.accept()[0],), daemon=True).start()
        except OSError:
            pass   # over

    def answer(self, link_):
        try:
            while word := link_.recv(100):
                link_.send(self.WORD[:8] + word[8:16] + self.WORD[16:])
        except OSError:
            pass

    def end(self):
        self.listener.close()


def foreign(address, *values):
    return lambda rig: ForeignMaster(rig, address, *values)


def no_foreign(_):
    while ForeignMaster.BUSY:
        ForeignMaster.BUSY.pop().end()


GUARDS = "/tmp/hard-times-guard.sock"


def false_guard(rig):
    if os.path.exists(GUARDS):
        os.unlink(GUARDS)
    rig.false_guard = FalseGuard(GUARDS)


def no_false_guard(rig):
    rig.false_guard.end()


def broken_disk(rig):
    """Recordings go to a disk that is full; results and journal do not."""
    os.makedirs(FULL, exist_ok=True)
    subprocess.run(["mount", "-t", "tmpfs", "-o", "size=64k", "none", FULL], check=True, stdin=subprocess.DEVNULL)


def good_disk(_):
    subprocess.run(["umount", "-l", FULL], check=True, stdin=subprocess.DEVNULL)


FULL = "/tmp/hard-times-full"
RAMP, RUN = 4, 5   # registers of the controller

# Name of the condition; what makes it true and ends it; what stands in the configuration besides; what is said then: by
# the refusal, the trip, or the reason that it waits for.
TRUE_ALREADY = [
    ("emergency_stop", orders("estop open"), orders("estop close"), "", "emergency-stop chain (is )?open"),
    ("shaker_fault", orders("fault latched-fault"), orders("clear"), "", "shaker fault"),
    ("platform_fault", orders("fault platform-fault"), orders("clear"), "", "platform fault"),
    ("loop_open", orders("fault loop-open"), orders("clear"), "", "loop open"),
    ("stale_channel", orders("fault flag:x"), orders("clear"), "", "accelerometer|stale"),
    ("stale_platform", orders("fault bus-silent=100000"), orders("clear"), "", "silent"),
    ("can_lost", link("set", "vcan0", "down"), link("set", "vcan0", "up"), "", "vcan0"),
    ("shaker_link_lost", broken("refuse"), broken(None), "", "read-back|stop of the shaker is pending"),
    ("watchdog_changed", orders("fault timeout-register=0"), orders("clear"), "", "watchdog timeout"),
    ("read_back_mismatch", foreign(RAMP, 6000), no_foreign, "", "does not read back"),
    ("uncommanded", foreign(RUN, 1), no_foreign, "", "without being commanded"),
    ("stop_disobeyed", orders("fault stuck-contactor", "table 0.4"), orders("clear", "table own"), "",
     "not measured yet: table|not obeyed"),
    ("amplitude_witness", orders("fault amplitude-scaled=0.5"), orders("clear"), "", "amplitude_witness"),
    ("over_armed_level", orders("fault amplitude-scaled=1.5"), orders("clear"), "", "over_armed_level"),
    ("over_amplitude", orders("fault amplitude-scaled=3"), orders("clear"), "", "over_amplitude|over_armed_level"),
    ("stuck", orders("fault stuck:y"), orders("clear"), "", "stuck: .*accel_y"),
    ("frame_loss", orders("fault lose=0.05"), orders("clear"), row_of("frame_loss", 1), "samples lost"),
    ("gimbal_not_in_position", orders("fault spike=30,1"), orders("clear"), row_of("gimbal_not_in_position", 1),
     "gimbal is not where"),
    ("amplitude_off_command", broken(("measured", 1.02)), broken(None), row_of("amplitude_off_command", 0.1),
     "amplitude off command"),
    ("cross_axis_motion", orders(), orders(), row_of("cross_axis_motion", 0.001), "motion across the vertical"),
    ("filter_divergence", orders(), orders(), row_of("filter_divergence", 1), "innovations of the filter"),
    ("temperature", orders(), orders(), row_of("temperature", 20), "platform temperature: 45"),
    ("disk", orders(), orders(), row_of("disk", 9000000), "free space"),
    ("recording_degraded", broken_disk, good_disk, row_of("recording_degraded"), "disk refuses"),
    ("guard_lost", orders(), orders(), row_of("guard_lost"), "vibrig-guard is not heard"),
    ("guard_stop", false_guard, no_false_guard, "", "vibrig-guard: the table moves"),
    ("annunciator_silent", orders(), orders(), row_of("annunciator_silent"), "horn or lamp"),
]
# The filter believes the resolvers better than they are: innovations are too large from the first on, not only by chance.
OUTSIDE = {"filter_divergence": {"noise": {"resolver_arcsec": 3.0}},
           "guard_lost": {"guard": {"socket": "/tmp/nobody-guards.sock"}},
           "guard_stop": {"guard": {"socket": GUARDS}},
           "recording_degraded": {"record": {"enabled": True, "folder": FULL, "keep_free_mb": 0}},
           "annunciator_silent": {"annunciator": {"modbus": {"host": "127.0.0.1", "port": 9, "horn_coil": 1}}}}
# There is nothing to judge before a dwell has begun.
IN_THE_DWELL = {"cross_axis_motion", "filter_divergence", "recording_degraded"}


def try_to_shake(rig, in_the_dwell):
    """Arms and starts whatever it says; what came of it. Acknowledges first what can be."""
    status = rig.status()
    if status is not None and status["campaign"]["state"] == "tripped":
        rig.command("acknowledge", "trip")
    elif status is not None and status["campaign"]["state"] == "waiting":
        rig.command("abort")
        rig.wait_for(lambda s: not s["shaker"].get("stop_pending"), 5)
    said = [rig.command(kind) for kind in ("arm", "start")]
    end = time.monotonic() + ARM_S
    while time.monotonic() < end:
        status = rig.status()
        state = "no answer" if status is None else status["campaign"]["state"]
        if state in ("tripped", "aborted", "idle", "paused") or (state == "recording" and not in_the_dwell):
            break
        time.sleep(0.1)
    return status, said


def accepted(said):
    return said is not None and said.get("accepted", False)


def held_back(checks, rig, text, name, words, most_g):
    status, said = try_to_shake(rig, name in IN_THE_DWELL)
    state = r.state_of(status)
    dwells = [] if status is None else status["campaign"]["dwells"]
    recorded = status is None or status["campaign"]["state"] == "recording" or \
        (name not in IN_THE_DWELL and any(r.number(dwell.get("samples", 0)) for dwell in dwells))
    checks.check(not recorded, f"{text}: nothing is recorded, it is refused or trips", f"{state} {said}\n{rig.logs()}")
    tripped = (status or {}).get("interlock", {}).get("tripped", "")
    events = (rig.ask("/api/v1/events?after=0&limit=1000") or {}).get("events", [])   # of this life, which began with it
    verdict = " | ".join([f"{tripped}: {state}", *(each.get("detail", "") for each in said if each),
                       *(event["text"] for event in events if event["severity"] == "trip")])
    checks.check(re.search(words, verdict), f"{text}: and it says so", f"expected {words}, found: {verdict}\n{(status or {}).get('shaker')}")
    took = lies.seconds_until(lambda: lies.table_g(rig) <= most_g, STOP_S + lies.SLACK_S)
    checks.check(took is not None, f"{text}: the table is at rest within {STOP_S} s", f"{lies.table_g(rig)} g")


def already_true(checks, rig, name, begin, undo, rows, words):
    """True before the daemon starts; then it is armed again and again while it stays true; then it is over."""
    rig.rest()
    rig.daemon.end(timeout=30)
    before = rig.configuration_text
    changed = before + rows
    for table, keys in OUTSIDE.get(name, {}).items():
        changed = re.sub(rf"(?m)^\[{table}\]\n(?:\w.*\n)*", "", changed)
        changed += "\n" + r.toml({table: {k: v for k, v in keys.items() if not isinstance(v, dict)}})
        for key, value in keys.items():
            if isinstance(value, dict):
                changed += f"{key} = {{ {', '.join(f'{k} = {json.dumps(v)}' for k, v in value.items())} }}\n"
    write(rig.configuration, changed)
    # The rig's own table moves by itself only where the condition is just that.
    moves = name == "stop_disobeyed"
    # The stop at the start clears a fault of the controller, which is then latched: tests/hil/latches.py.
    later = name == "shaker_fault"
    if not later:
        begin(rig)
    rig.start_daemon()
    rig.wait_for(lambda s: True, 30)
    if later:
        begin(rig)
    time.sleep(2)
    most_g = 0.41 if moves else 0
    held_back(checks, rig, f"already true at the start: {name}", name, words, most_g)
    rig.wait_for(lambda s: not s["shaker"].get("stop_pending"), 5)
    held_back(checks, rig, f"still true when armed again: {name}", name, words, most_g)
    undo(rig)
    rig.daemon.end(timeout=30)
    write(rig.configuration, before)
    rig.start_daemon()
    rig.wait_for(lambda s: True, 30)
    rested = rig.rest()
    checks.check(rested is not None and rested["campaign"]["state"] in ("idle", "aborted", "finished"),
                 f"over: {name} holds nobody up any more", r.state_of(rested))


def comfort_ramp(checks, rig):
    """A campaign that ramps for 60 s trips half-way up: a trip waits for no comfort."""
    rig.daemon.end(timeout=30)
    before = rig.configuration_text
    write(rig.configuration, before.replace("ramp_s = 0.5", "ramp_s = 60.0"))
    rig.start_daemon()
    rig.wait_for(lambda s: True, 30)
    rig.rest()
    said = [rig.command(kind) for kind in ("arm", "start")]
    rig.wait_for(lambda s: s["campaign"]["state"] in ("ramping", "aborted", "tripped"), 60)
    took = lies.seconds_until(lambda: lies.table_g(rig) > 2, 60)
    checks.check(took is not None, "ramp of 60 s: half-way up", f"{said} {r.state_of(rig.status())}\n{rig.logs()}")
    rig.order("fault loop-open")
    took = lies.seconds_until(lambda: lies.table_g(rig) == 0, STOP_S)
    checks.check(took is not None, f"ramp of 60 s: after a trip the table is at rest within {STOP_S} s", f"{lies.table_g(rig)} g")
    checks.equal((rig.status() or {}).get("interlock", {}).get("tripped"), "loop_open", "ramp of 60 s: it has tripped")
    rig.rest()
    rig.daemon.end(timeout=30)
    write(rig.configuration, before)
    rig.start_daemon()
    rig.wait_for(lambda s: True, 30)


def killed_while_shaking(checks, rig):
    shaking, found = rig.shake()
    checks.check(shaking, "SIGKILL: the table shakes before", found + "\n" + rig.logs())
    rig.daemon.process.kill()
    limit_s = TIMEOUT_S + lies.SOFT_STOP_S + lies.SLACK_S
    took = lies.seconds_until(lambda: lies.table_g(rig) == 0, limit_s)
    checks.check(took is not None, f"SIGKILL: starved, the watchdog stops the table within {limit_s} s", f"{lies.table_g(rig)} g")
    rig.daemon.process.wait()
    rig.start_daemon()
    status = rig.wait_for(lambda s: s["campaign"]["state"] == "tripped", 30)
    checks.check(status is not None and "died_armed" in latches(status), "SIGKILL: the next start has latched it",
                 f"{r.state_of(status)} {status and latches(status)}")


def trip_in_the_journal(checks, rig):
    """One second after a trip its cause has been written."""
    shaking, found = rig.shake()
    checks.check(shaking, "killed 1 s after a trip: the table shakes before", found + "\n" + rig.logs())
    rig.order("fault loop-open")
    lies.seconds_until(lambda: lies.tripped_by(rig, ("loop_open",)), 1)
    time.sleep(JOURNAL_S)
    rig.daemon.process.kill()
    rig.daemon.process.wait()
    rig.order("clear")
    rig.start_daemon()
    status = rig.wait_for(lambda s: s["campaign"]["state"] == "tripped", 30)
    checks.check(status is not None and "loop_open" in latches(status), "killed 1 s after a trip: the next start knows its cause",
                 f"{r.state_of(status)} {status and latches(status)}")


def latches(status):
    return [latch["name"] for latch in status["interlock"].get("latches", [])]


def arming_expires(checks, rig):
    rig.rest()
    said = rig.command("arm")
    checks.check(accepted(said), "arming: taken", said)
    time.sleep(ARMING_S - 5)
    checks.equal(r.state_of(rig.status()), "armed", f"arming: holds for {ARMING_S} s")
    time.sleep(6)
    status = rig.status()
    checks.check(status["campaign"]["state"] == "idle" and not accepted(rig.command("start")),
                 f"arming: ends after {ARMING_S} s without a start", r.state_of(status))


def write(path, text):
    with open(path, "w", encoding="utf-8") as file:
        file.write(text)


# ---- the proof against a controller that lies

# Truth, words of which the verdict has one (with ramps as short as these the unit itself is not distinguished from them; of a slow ramp the shaker's own word
# and the accelerometers' come within a sample of each other); whether nothing but the emergency stop ends it.
PROVED = [
    ("honest", [], (), False),
    ("ack-without-stop", ["ack-without-stop"], ("not obeyed",), False),
    ("timeout-ignored", ["timeout-ignored"], ("watchdog",), False),
    ("timeout-scaled", ["timeout-scaled=10"], ("watchdog",), False),
    ("amplitude-scaled", ["amplitude-scaled=1.8"], ("amplitude",), False),
    ("readback-echo of a dead table", ["dead-table", "readback-echo"], ("amplitude",), False),
    ("stuck-contactor", ["stuck-contactor"], ("not obeyed",), True),
    ("slow-ramp", ["slow-ramp=10"], ("shaker", "amplitude"), False),
    ("unit-rms", ["unit-rms"], ("amplitude",), False),
]


def seconds_of(proof, name):
    return next((row.get("value") for row in proof.get("rows", []) if row["name"] == name), None)


def proved(checks, rig, name, faults, words, by_hand):
    text = f"proof: {name}"
    rig.rest()
    rig.wait_for(lambda s: s["platform"].get("ready"), 60)
    lies.lie(rig, *faults)
    before = (rig.status() or {}).get("proof", {}).get("utc_ns", "0")
    began = time.monotonic()
    said = rig.command("selftest")
    if not checks.check(accepted(said), f"{text}: begins", said):
        return
    end = began + PROOF_S
    highest = 0.0
    while time.monotonic() < end and (status := rig.status())["proof"].get("utc_ns", "0") == before:
        highest = max(highest, lies.table_g(rig))
        time.sleep(0.2)
    proof = status["proof"]
    checks.check(proof.get("utc_ns", "0") != before, f"{text}: over within {PROOF_S} s", r.state_of(status) + rig.logs())
    if not words:
        good = proof.get("passed") and 0 < seconds_of(proof, "stop, table") <= STOP_S and \
            0 < seconds_of(proof, "stop, platform") <= STOP_S + RING_DOWN_S and \
            TIMEOUT_S / 2 <= seconds_of(proof, "watchdog, rest") <= TIMEOUT_S + STOP_S
        checks.check(good, f"{text}: passes, with the times of the table", proof)
    else:
        # Not in what earlier proofs have found.
        rows = proof.get("rows", []) + status["loop_check"].get("rows", [])
        found = " ".join([proof.get("message", ""), *(row["name"] for row in rows if not row["passed"])])
        checks.check(not proof.get("passed") and any(word in found for word in words), f"{text}: does not pass, and says why", proof)
    checks.check(highest <= 1.0, f"{text}: never more than 1 g at the table", f"{highest} g")
    if by_hand:
        took = lies.seconds_until(lambda: lies.tripped_by(rig, ("stop_disobeyed",)), STOP_S + RING_DOWN_S + lies.SLACK_S)
        checks.check(took is not None, f"{text}: a disobeyed stop is said in its time", r.state_of(rig.status()))
        rig.order("estop open")
    took = lies.seconds_until(lambda: lies.table_g(rig) == 0, TIMEOUT_S + STOP_S + lies.SLACK_S)
    checks.check(took is not None, f"{text}: at rest within {TIMEOUT_S + STOP_S} s of its end", f"{lies.table_g(rig)} g")
    if by_hand:
        rig.order("estop close")


# ---- a hard time for the daemon: it goes on, and an abort is answered

class Timex(ctypes.Structure):
    _fields_ = [("modes", ctypes.c_uint), ("offset", ctypes.c_long), ("freq", ctypes.c_long), ("maxerror", ctypes.c_long),
                ("esterror", ctypes.c_long), ("status", ctypes.c_int), ("more", ctypes.c_long * 24)]


def leap_second(rig):
    """Inserted by the kernel at midnight: 23:59:59 comes twice."""
    day = 86400
    time.clock_settime(time.CLOCK_REALTIME, (int(time.time()) // day + 1) * day - 3)
    order = Timex(modes=0x10, status=0x10)   # ADJ_STATUS, STA_INS
    if ctypes.CDLL(None, use_errno=True).adjtimex(ctypes.byref(order)) < 0:
        raise OSError(ctypes.get_errno(), "adjtimex")
    before, steady = time.time(), time.monotonic()
    time.sleep(8)
    rig.leapt_s = (time.monotonic() - steady) - (time.time() - before)


def no_leap_second(_):
    order = Timex(modes=0x10, status=0)
    ctypes.CDLL(None).adjtimex(ctypes.byref(order))


def interrupted(rig):
    """Stopped and continued 2000 times: epoll_wait(), sigtimedwait(), ppoll() of every thread come back with EINTR."""
    pid = rig.daemon.process.pid
    for _ in range(2000):
        os.kill(pid, signal.SIGSTOP)
        os.kill(pid, signal.SIGCONT)
        time.sleep(0.002)


def memory_short(rig):
    """All but 24 MB of the machine's memory is somebody else's, touched and locked."""
    with open("/proc/meminfo", encoding="ascii") as file:
        free_kb = int(re.search(r"MemAvailable: +(\d+)", file.read())[1])
    rig.memory_hog = subprocess.Popen([sys.executable, os.path.abspath(__file__), "hog", str(max(0, free_kb - 24 * 1024))],
                                      stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, preexec_fn=r.die_with_parent)
    rig.memory_hog.stdout.readline()


def memory_free(rig):
    rig.memory_hog.kill()
    rig.memory_hog.wait()


def hog(kilobytes):
    write("/proc/self/oom_score_adj", "1000")
    held = mmap.mmap(-1, kilobytes * 1024 or 1, flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS | mmap.MAP_POPULATE)
    print("holds", flush=True)
    while True:
        for at in range(0, len(held), 4096):
            held[at] = held[at] + 1 & 0xFF
        time.sleep(0.1)


def nothing(_):
    pass


HARD = [
    ("EINTR storm", interrupted, nothing),
    ("memory short", memory_short, memory_free),
    ("leap second", leap_second, no_leap_second),
]


def gone_through(checks, rig, name, begin, undo):
    shaking, found = rig.shake()
    if not checks.check(shaking, f"{name}: the table shakes before", found + "\n" + rig.logs()):
        return
    first, state = len(rig.proxy.writes), None
    begin(rig)
    time.sleep(3)
    state = rig.status()
    checks.check(state is not None and state["campaign"]["state"] == "recording", f"{name}: it goes on",
                 r.state_of(state) + "\n" + rig.logs())
    writes = rig.proxy.writes[first:]
    checks.check(not any(address < 5 for _, address, _ in writes), f"{name}: nothing is written but feeds", writes[:20])
    if name == "leap second":
        checks.check(0.9 < rig.leapt_s < 1.1, "leap second: the wall clock showed a second twice", rig.leapt_s)
    r.check_balance(checks, rig, name)
    began = time.monotonic()
    answer = rig.command("abort")
    took = time.monotonic() - began
    checks.check(accepted(answer) and took < ABORT_S, f"{name}: an abort is answered within {ABORT_S} s", f"{took:.3f} s {answer}")
    undo(rig)
    rested = rig.wait_for(lambda s: s["shaker"].get("rest") == "at rest", 20)
    checks.check(rested["shaker"].get("rest") == "at rest", f"{name}: and ends at rest", rested["shaker"])


def rows(checks, rig, pattern=""):
    for name, check in (("ramp of 60 s", comfort_ramp), ("SIGKILL", killed_while_shaking),
                        ("killed 1 s after a trip", trip_in_the_journal), ("arming", arming_expires)):
        if re.search(pattern, name):
            check(checks, rig)
    for name, *more in HARD:
        if re.search(pattern, name):
            gone_through(checks, rig, name, *more)
    for name, *more in PROVED:
        if re.search(pattern, "proof: " + name):
            proved(checks, rig, name, *more)
    for name, *more in TRUE_ALREADY:
        if re.search(pattern, "already true: " + name):
            already_true(checks, rig, name, *more)


if __name__ == "__main__":
    hog(int(sys.argv[2]))
