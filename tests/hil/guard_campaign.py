#!/usr/bin/python3
"""vibrig-guard beside a daemon that is well, stopped, hung, killed, and beside one that lies, while the table shakes: in
real time over the seqpacket bus. The shaker's own watchdog is out of order, so that only the guard can stop the table.

usage: guard_campaign.py PROGRAMS [--part N]     one of its parts; else all, side by side: they wait most of the time
"""
import contextlib
import json
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
import random_campaign as rc  # noqa: E402
import rig as r  # noqa: E402
import service_manager as stages  # noqa: E402

HERE = os.path.dirname(os.path.abspath(__file__))
CAMPAIGN = {"name": "guarded", "identify": "what-it-can", "positions_deg": [[0, 0, 0]], "table_g": [5.0],
            "dwell_s": 600.0, "settle_s": 2.0, "ramp_s": 0.5, "temperature_window_s": 0.0}
WARM = ("--warm-up", "0", "--start-temperature", "45", "--seed", "5")
NO_WATCHDOG = ("--fault", "timeout-ignored")
# Nothing here is about how soon: the machine may be busy. How soon is said by the unit tests, on the guard's own clock.
SOON = 30
DAEMON_WORD, GUARD_WORD = "<IIQ4QdQd", "<IHHQQd16s"
DAEMON_KIND, GUARD_KIND = 0x32446256, 0x32476256
CAUSES = ["none", "daemon_silent", "daemon_hangs", "unarmed_motion", "over_level", "stop_disobeyed"]


def wait_until(condition, timeout_s=SOON):
    end = time.monotonic() + timeout_s
    while time.monotonic() < end:
        if condition():
            return True
        time.sleep(0.05)
    return condition()


class Coils:
    """Horn and lamp, by pymodbus."""

    def __init__(self):
        self.process = subprocess.Popen(["/usr/bin/python3", os.path.join(HERE, "../unit/drivers/annunciator/coil_server.py"), "honest"],
                                        stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
                                        preexec_fn=r.die_with_parent)
        self.port = int(self.process.stdout.readline())
        self.writes = []
        threading.Thread(target=self.listen, daemon=True).start()

    def listen(self):
        for line in self.process.stdout:
            self.writes.append(tuple(int(word) for word in line.split()[1:]))

    def on(self, coil):
        return [value for address, value in list(self.writes) if address == coil][-1:] == [1]

    def end(self):
        self.process.kill()
        self.process.wait()


class Guarded(r.Rig):
    """A rig with a guard, horn and pager; the pager keeps what it gets."""

    def __init__(self, programs, folder, *faults, clock="real", truth=None):
        super().__init__(programs, "seqpacket", clock, folder, poll_s=0.1)
        self.guard = None
        self.meeting = os.path.join(folder, "guard.sock")
        self.pages = os.path.join(folder, "pages")
        pager = os.path.join(folder, "page-me")
        with open(pager, "w", encoding="utf-8") as file:
            file.write(f"#!/bin/sh\ncat >>{self.pages}\nexec sleep 1000\n")   # it hangs as well
        os.chmod(pager, 0o755)
        self.coils = Coils()
        self.start_plant(*WARM, *faults, *(("--truth", self.truth_file(truth)) if truth else ()))
        self.be_punctual()
        self.pager = pager
        self.arrange()

    def arrange(self, **tables):
        self.configure(CAMPAIGN, **r.PATIENT, guard={"socket": self.meeting},
                       annunciator={"command": self.pager, "command_limit_s": 20}, **tables)
        with open(self.configuration, "a", encoding="utf-8") as file:
            file.write(f'[annunciator.modbus]\nhost = "127.0.0.1"\nport = {self.coils.port}\nlamp_coil = 1\n')

    def start_guard(self):
        self.guard = r.Child("guard", [self.program("vibrig-guard"), "--config", self.configuration], self.folder)

    def paged(self, kind, source="vibrig-guard"):
        if not os.path.exists(self.pages):
            return []
        with open(self.pages, encoding="utf-8") as file:
            pages = [json.loads(line) for line in file.read().splitlines() if line.endswith("}")]
        return [page["text"] for page in pages if page["kind"] == kind and page["source"] == source]

    def measured_g(self):
        with self.modbus() as link:
            return self.controller(link, struct.pack(">BHH", 4, 3, 2), ">I")[0] * 1e-4

    def modbus(self):
        return socket.create_connection(("127.0.0.1", self.modbus_port), timeout=20)

    def controller(self, link, pdu, reply):
        link.sendall(struct.pack(">HHHB", 1, 0, len(pdu) + 1, 1) + pdu)
        head = self.take(link, 7)
        body = self.take(link, struct.unpack(">H", head[4:6])[0] - 1)
        return struct.unpack(reply, body[2:]) if reply else body

    @staticmethod
    def take(link, count):
        data = b""
        while len(data) < count:
            more = link.recv(count - len(data))
            if not more:
                raise ConnectionError("the shaker's controller has gone")
            data += more
        return data

    def drive(self, amplitude_g, run=1):
        """As another master would, past any daemon: 15 Hz, ramp of 0.5 s, run."""
        with self.modbus() as link:
            words = struct.pack(">IIHH", 15000, int(amplitude_g * 1e4), 50, run)
            self.controller(link, struct.pack(">BHHB", 16, 0, 6, len(words)) + words, None)

    def shakes(self):
        return self.measured_g() > 4

    def rests(self):
        return self.measured_g() < 0.05

    def logs(self, lines=25):
        said = super().logs(lines)
        return said + "\n-- end of guard.log\n" + "\n".join((self.guard.text() if self.guard else "").splitlines()[-lines:])

    def stop(self):
        for child in (self.guard, self.daemon, self.plant):
            if child is not None:
                if child.running():
                    child.process.send_signal(signal.SIGCONT)
                child.end(timeout=5)
        self.coils.end()


def ready(status):
    return status["can"]["link"] == "running" and status["shaker"]["link"] == "running" and \
        status["platform"].get("ready") and status["shaker"].get("state") == 0 and not status["shaker"].get("running", True)


def watching(status):
    guard = status.get("guard", {})
    return ready(status) and guard.get("heard") and guard.get("rest") and guard.get("reaches_shaker")


def arms_and_starts(checks, rig, what):
    # Rest has to be measured first.
    checks.check(wait_until(lambda: rig.tool("arm", "--by", "Ada").returncode == 0), f"{what}: arm", rig.logs())
    done = rig.tool("start", "--by", "Ada")
    checks.check(done.returncode == 0, f"{what}: start", done.stderr + rig.logs())


def meet_and_start(checks, rig, what):
    rig.start_guard()
    rig.start_daemon()
    status = rig.wait_for(watching, SOON)
    checks.check(status is not None and watching(status), f"{what}: daemon and guard have found each other", rig.logs())
    arms_and_starts(checks, rig, what)


def starts(checks, rig, what):
    """Daemon and guard; the table shakes at 5 g."""
    meet_and_start(checks, rig, what)
    status = rig.wait_for_state(("recording", "aborted", "tripped"), 2 * SOON)
    checks.check(status is not None and status["campaign"]["state"] == "recording" and rig.shakes(), f"{what}: the table shakes",
                 r.state_of(status) + rig.logs())


def finds(checks, rig, what, cause):
    checks.check(wait_until(lambda: cause + ":" in rig.guard.text()), f"{what}: the guard finds {cause}", rig.logs())
    checks.check(wait_until(rig.rests), f"{what}: the guard stops the shaker", f"{rig.measured_g()} g\n{rig.logs()}")
    checks.check(wait_until(lambda: any(cause in text for text in rig.paged("abort"))), f"{what}: the pager is called",
                 rig.logs())
    checks.check(wait_until(lambda: rig.coils.on(1)), f"{what}: the lamp is on", rig.coils.writes)
    checks.check("stop_disobeyed" not in rig.guard.text() and not rig.paged("disobeyed"), f"{what}: the stop was obeyed",
                 rig.logs())


def well(checks, programs, folder):
    rig = Guarded(programs, folder)
    try:
        rig.start_daemon()
        status = rig.wait_for(ready, SOON)
        checks.check(status is not None and not status["guard"].get("heard"), "without the guard: the status says so",
                     status and status.get("guard"))
        for command in (["arm"], ["selftest"]):
            refused = rig.tool(*command, "--by", "Ada")
            checks.check(refused.returncode == 1 and "vibrig-guard is not heard" in refused.stderr + refused.stdout,
                         f"without the guard: no {command[0]}", refused.stderr + refused.stdout)
        looks = rig.tool("selftest")
        checks.check("NOT   guard" in looks.stdout, "without the guard: the self-test says so", looks.stdout)
        rig.daemon.end()
        starts(checks, rig, "all is well")
        checks.check("watches" in rig.tool("status").stdout, "all is well: the status says that it watches", rig.tool("status").stdout)
        time.sleep(5)
        status = rig.status()
        checks.check(status["campaign"]["state"] == "recording" and status["guard"]["cause"] == "none",
                     "all is well: the guard finds nothing", f"{r.state_of(status)} {status['guard']}\n{rig.logs()}")
        checks.check(abs(status["guard"]["table_g"] - 5) < 0.6, "all is well: it measures 5 g by itself", status["guard"])
        # the guard goes while armed: an alarm, and it is reported when it is back
        rig.guard.process.kill()
        rig.guard.process.wait()

        def lost(s):
            return any(row["name"] == "guard_lost" and row.get("raised") for row in s["interlock"]["rows"])
        status = rig.wait_for(lost, SOON)
        checks.check(status is not None and lost(status) and status["campaign"]["state"] == "recording",
                     "the guard is killed: an alarm, and the campaign goes on", r.state_of(status) + rig.logs())
        checks.check(wait_until(lambda: any("guard_lost" in text for text in rig.paged("alarm", "vibrigd"))),
                     "the guard is killed: the daemon calls the pager", rig.logs())
        rig.start_guard()
        status = rig.wait_for(lambda s: s["guard"].get("heard") and not lost(s), SOON)
        checks.check(status is not None and not lost(status) and status["guard"]["cause"] == "none",
                     "started again in the midst of it, it finds nothing", rig.logs())
        checks.check(rig.shakes(), "and the table shakes on")
        rig.tool("abort", "--by", "Ada")
        checks.check(wait_until(rig.rests), "an abort ends it")
        time.sleep(5)
        status = rig.status()
        checks.check(status["guard"]["cause"] == "none", "an abort that is obeyed is no finding", f"{status['guard']}\n{rig.logs()}")
        checks.equal(rig.daemon.end(timeout=30), 0, "vibrigd ends with status 0")
        time.sleep(3)
        checks.check("alarm:" not in rig.guard.text().split("watching; ")[-1], "a daemon that ends at rest is no finding", rig.logs())
        checks.equal(rig.guard.end(), 0, "vibrig-guard ends with status 0")
    finally:
        rig.stop()


def broken(what, break_it, mend, cause):
    def part(checks, programs, folder):
        rig = Guarded(programs, folder, *NO_WATCHDOG)
        try:
            starts(checks, rig, what)
            broken_thing = break_it(rig)
            finds(checks, rig, what, cause)
            mend(checks, rig, what, broken_thing)
        finally:
            rig.stop()
    return part


def stopped(rig):
    rig.daemon.process.send_signal(signal.SIGSTOP)


def continued(checks, rig, what, _):
    """What the guard found is a trip of the daemon's, and a person ends both."""
    rig.daemon.process.send_signal(signal.SIGCONT)
    status = rig.wait_for(lambda s: s["campaign"]["state"] == "tripped" and s["guard"].get("cause") == "daemon_silent", SOON)
    checks.check(status is not None and status["campaign"]["state"] == "tripped", f"{what}: continued, the daemon is tripped",
                 r.state_of(status) + rig.logs())
    refused = rig.tool("arm", "--by", "Ada")
    checks.check(refused.returncode == 1, f"{what}: nothing is armed before it is acknowledged", refused.stdout)
    checks.check(wait_until(lambda: rig.tool("ack", "trip", "--by", "Ada").returncode == 0), f"{what}: it can be acknowledged",
                 rig.logs())
    status = rig.wait_for(lambda s: s["guard"].get("cause") == "none", SOON)
    checks.check(status is not None and status["guard"]["cause"] == "none" and rig.guard.says("acknowledged, watching"),
                 f"{what}: the guard takes the acknowledgement", rig.logs())
    checks.check(wait_until(lambda: not rig.coils.on(1)), f"{what}: the lamp goes out", rig.coils.writes)
    checks.check(wait_until(lambda: rig.tool("arm", "--by", "Ada").returncode == 0), f"{what}: it can be armed again", rig.logs())


def hung(rig):
    thread = stages.thread_named(rig.daemon.process.pid, "control")
    stages.block(thread)
    return thread


def ended(_checks, rig, _what, thread):
    rig.daemon.process.kill()
    os.waitpid(thread, stages.WALL)
    rig.daemon.process.wait()


def killed(rig):
    rig.daemon.process.kill()
    rig.daemon.process.wait()


def by_hand(checks, rig, what, _):
    def acknowledged():   # not before the platform has come to rest
        rig.guard.process.send_signal(signal.SIGUSR1)
        time.sleep(0.2)
        return "info: acknowledged by hand" in rig.guard.text()
    checks.check(wait_until(acknowledged), f"{what}: acknowledged by hand without a daemon",
                 rig.logs())
    checks.check(wait_until(lambda: not rig.coils.on(1)), f"{what}: the lamp goes out", rig.coils.writes)


class Liar:
    """A daemon that says what it is set to say, and always that all goes on."""

    def __init__(self, rig):
        self.link = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        wait_until(lambda: self.link.connect_ex(rig.meeting) == 0)   # the socket is there a moment before anybody listens
        self.flags, self.level_g, self.sequence, self.heard = 0, 0.0, 0, None
        self.quit = threading.Event()
        self.thread = threading.Thread(target=self.talk, daemon=True)
        self.thread.start()

    def talk(self):
        # Late words are silence, which is another finding: as the daemon's thread, this one comes first.
        with contextlib.suppress(PermissionError):
            os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(20))
        while not self.quit.wait(0.1):
            self.sequence += 1
            self.link.send(struct.pack(DAEMON_WORD, DAEMON_KIND, self.flags, self.sequence, *[self.sequence] * 4, self.level_g, 0, 1.0))
            self.link.settimeout(1)
            try:
                self.heard = struct.unpack(GUARD_WORD, self.link.recv(100))
            except TimeoutError:
                pass

    def cause(self):
        return None if self.heard is None else CAUSES[self.heard[2]]

    def end(self):
        self.quit.set()
        self.thread.join()
        self.link.close()


def lies(what, flags, level_g, drive_g, cause):
    def part(checks, programs, folder):
        rig = Guarded(programs, folder, *NO_WATCHDOG)
        liar = None
        try:
            rig.start_guard()
            checks.check(wait_until(lambda: os.path.exists(rig.meeting)), f"{what}: the guard listens", rig.logs())
            liar = Liar(rig)
            liar.flags, liar.level_g = flags, level_g
            checks.check(wait_until(lambda: liar.heard is not None and liar.heard[1] & 0b1110 == 0b1110),
                         f"{what}: the guard hears it, sees the table at rest and reaches the shaker", f"{liar.heard}\n{rig.logs()}")
            rig.drive(drive_g)
            finds(checks, rig, what, cause)
            checks.check(wait_until(lambda: liar.cause() == cause), f"{what}: the liar gets it", liar.heard)
        finally:
            if liar:
                liar.end()
            rig.stop()
    return part


def disobeyed(checks, programs, folder):
    """The contactor sticks: the controller says idle, the table shakes on, and only the accelerometers know."""
    what = "a stuck contactor"
    rig = Guarded(programs, folder, *NO_WATCHDOG, "--fault", "stuck-contactor")
    liar = None
    try:
        rig.start_guard()
        wait_until(lambda: os.path.exists(rig.meeting))
        liar = Liar(rig)
        checks.check(wait_until(lambda: liar.heard is not None and liar.heard[1] & 0b1110 == 0b1110), f"{what}: the guard watches",
                     f"{liar.heard}\n{rig.logs()}")
        rig.drive(5.0)
        checks.check(wait_until(lambda: liar.cause() == "unarmed_motion"), f"{what}: the guard finds the motion", rig.logs())
        checks.check(wait_until(lambda: liar.heard[1] & 1), f"{what}: it says that the stop is not obeyed", f"{liar.heard}\n{rig.logs()}")
        checks.check(rig.measured_g() < 0.05, f"{what}: although the controller reads back rest", rig.measured_g())
        checks.check(wait_until(lambda: any("press the emergency stop" in text for text in rig.paged("disobeyed"))),
                     f"{what}: the pager says: press the emergency stop", rig.logs())
        checks.check(wait_until(lambda: rig.coils.on(0)), f"{what}: the horn sounds", rig.coils.writes)
        written = len(rig.coils.writes)
        time.sleep(5)
        checks.check(rig.coils.on(0) and len(rig.coils.writes) == written, f"{what}: without a pause", rig.coils.writes[written:])
    finally:
        if liar:
            liar.end()
        rig.stop()


def stuck_witness(checks, programs, folder):
    """The platform's accelerometers are the only witness and stick with their valid bits, and the controller says idle while
    the table shakes on: nobody measures rest, and the guard does not say so."""
    what = "a stuck witness"
    stuck = [word for axis in "xyz" for word in ("--fault", f"stuck:{axis}")]
    rig = Guarded(programs, folder, *NO_WATCHDOG, "--fault", "stuck-contactor", *stuck)
    liar = None
    try:
        rig.arrange(**{"can.signals": {"table_accel": ""}})
        rig.start_guard()
        wait_until(lambda: os.path.exists(rig.meeting))
        liar = Liar(rig)
        checks.check(wait_until(lambda: liar.heard is not None and liar.heard[1] & 0b1110 == 0b1110),
                     f"{what}: while nobody shakes it is one at rest", f"{liar.heard}\n{rig.logs()}")
        liar.flags, liar.level_g = 3, 5.0
        rig.drive(5.0)
        checks.check(wait_until(lambda: "accelerometer of the platform is stuck" in rig.guard.text()), f"{what}: is named", rig.logs())
        checks.check(wait_until(lambda: liar.heard[1] & 0b0110 == 0), f"{what}: it sees nothing, and no rest", liar.heard)
        checks.equal(liar.cause(), "none", f"{what}: the daemon, alive and armed, goes on")
        rig.drive(0.0, run=0)
        checks.check(wait_until(rig.rests), f"{what}: the controller says that it rests", rig.measured_g())
        liar.flags = 4   # the daemon orders a stop
        checks.check(wait_until(lambda: liar.heard[1] & 1), f"{what}: it says that the stop is not obeyed", f"{liar.heard}\n{rig.logs()}")
        checks.check(wait_until(lambda: any("press the emergency stop" in text for text in rig.paged("disobeyed"))),
                     f"{what}: the pager says: press the emergency stop", rig.logs())
        rig.guard.process.send_signal(signal.SIGUSR1)
        checks.check(wait_until(lambda: "not acknowledged: the table is not measured to be at rest" in rig.guard.text()),
                     f"{what}: nor is it acknowledged by hand", rig.logs())
    finally:
        if liar:
            liar.end()
        rig.stop()


def unexcited(checks, programs, folder):
    """Armed, and nothing excites: the table moves by itself, its controller reads rest, and the platform's accelerometers are the
    only witness."""
    what = "it moves by itself while armed"
    rig = Guarded(programs, folder, *NO_WATCHDOG)
    liar = None
    try:
        rig.arrange(**{"can.signals": {"table_accel": ""}})
        rig.start_guard()
        wait_until(lambda: os.path.exists(rig.meeting))
        liar = Liar(rig)
        liar.flags, liar.level_g = 1, 5.0
        checks.check(wait_until(lambda: liar.heard is not None and liar.heard[1] & 0b1110 == 0b1110), f"{what}: the guard watches",
                     f"{liar.heard}\n{rig.logs()}")
        time.sleep(8)   # its time to come to rest is over
        checks.equal(liar.cause(), "none", f"{what}: armed at rest is no finding")
        rig.order("table 4.9")
        checks.check(wait_until(lambda: liar.cause() == "unarmed_motion"), f"{what}: the guard finds it", f"{liar.heard}\n{rig.logs()}")
        # It is told the daemon before it is written.
        checks.check(wait_until(lambda: "shaker does not run, vibrigd says armed, no excitation" in rig.guard.text()),
                     f"{what}: and by what", rig.logs())
    finally:
        if liar:
            liar.end()
        rig.stop()


class FalseGuard:
    """Of an earlier version: answers each word of the daemon's with these flags, and has found nothing."""

    def __init__(self, path):
        self.flags, self.listener = 0b11110, socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self.listener.bind(path)
        self.listener.listen(4)
        threading.Thread(target=self.answer, daemon=True).start()

    def answer(self):
        with contextlib.suppress(OSError):   # over
            while True:
                link = self.listener.accept()[0]
                while word := link.recv(100):
                    link.send(struct.pack("<IHH", GUARD_KIND, self.flags, 0) + word[8:16] + struct.pack("<Qd16s", 0, 0.0, b"0.0.9"))


def blind(checks, programs, folder):
    """A guard that is heard, and has lost its bus or the shaker while armed."""
    rig = Guarded(programs, folder)
    guard = FalseGuard(rig.meeting)
    try:
        rig.start_daemon()
        status = rig.wait_for(watching, SOON)
        checks.check(status is not None and watching(status), "a blind guard: at first it watches", rig.logs())
        said = rig.tool("status").stdout
        checks.check(status is not None and status["guard"].get("version") == "0.0.9" and "watches, version 0.0.9, vibrigd is " in said,
                     "a guard of another version: the status says so", said)
        checks.check(wait_until(lambda: rig.tool("arm", "--by", "Ada").returncode == 0), "a blind guard: armed", rig.logs())

        def lost(s):
            return any(row["name"] == "guard_lost" and row.get("raised") for row in s["interlock"]["rows"])
        for flags, lacks in ((0b11100, "vibrig-guard sees no accelerometer"), (0b10110, "vibrig-guard does not reach the shaker")):
            guard.flags = flags
            status = rig.wait_for(lost, SOON)
            checks.check(status is not None and lost(status), f"{lacks}: an alarm", rig.logs())
            checks.check(wait_until(lambda said=lacks: any(said in text for text in rig.paged("alarm", "vibrigd"))),
                         f"{lacks}: the pager gets that", rig.logs())
            checks.equal(rig.status()["campaign"]["state"], "armed", f"{lacks}: and no more")
            guard.flags = 0b11110
            status = rig.wait_for(lambda s: not lost(s), SOON)
            checks.check(status is not None and not lost(status), f"{lacks}: over once it is over", rig.logs())
    finally:
        guard.listener.close()
        rig.stop()


def fast(checks, programs, folder):
    """The rig owns the time and is as fast as it can be: a whole campaign, and nothing is found."""
    what = "the rig owns the time"
    rig = Guarded(programs, folder, clock="rig")
    try:
        rig.configure({**CAMPAIGN, "positions_deg": [[0, 0, 0], [45, 0, 90]], "table_g": [9.0, 5.0], "dwell_s": 60.0},
                      guard={"socket": rig.meeting})
        finishes(checks, rig, what)
    finally:
        rig.stop()


def finishes(checks, rig, what):
    meet_and_start(checks, rig, what)
    status = rig.wait_for_state(("finished", "aborted", "tripped"), 4 * SOON)
    checks.check(status is not None and status["campaign"]["state"] == "finished", f"{what}: the campaign finishes",
                 r.state_of(status) + rig.logs())
    checks.check("alarm:" not in rig.guard.text() and "frozen" not in rig.guard.text(), f"{what}: the guard finds nothing", rig.logs())


def handled(checks, programs, folder):
    """Slews, levelling and zeroing move the platform between the excitations, and nothing is on the table: no finding."""
    what = "slewed, levelled, zeroed"
    rig = Guarded(programs, folder, clock="rig", truth={"platform": {"slew_error_deg": 0.2}})
    try:
        rig.configure({**CAMPAIGN, "positions_deg": [[0, 0, 0], [45, 0, 90]], "dwell_s": 20.0, "levelling": True, "zeroing": True},
                      guard={"socket": rig.meeting}, **{"can.signals": {"table_accel": ""}})
        finishes(checks, rig, what)
    finally:
        rig.stop()


def mixed(checks, programs, folder):
    """Random vibration beside a lower sine, on a hard mount whose transmission nobody states: what was armed is what is seen."""
    what = "random on a hard mount"
    rig = Guarded(programs, folder, clock="rig", truth=rc.TRUTH)
    try:
        plan, count = rc.plan_of(folder, 1)
        with open(plan, encoding="utf-8") as file:
            runs = json.load(file)["runs"]
        runs[0].update(table_g=1.0, level_g=1.0)
        with open(plan, "w", encoding="utf-8") as file:
            json.dump({"runs": runs}, file)
        rig.configure({"name": "mixed", "plan": plan, "dwell_s": 20.0, "temperature_window_s": 5.0, "identify": "what-it-can"},
                      spectrum={"mount": "hard", "mode": "mixed"}, guard={"socket": rig.meeting},
                      **{f"shaker.registers.{role}": keys for role, keys in rc.REGISTERS.items()})
        with open(rig.configuration, "a", encoding="utf-8") as file:
            file.write(rc.CONFIGURATION)
        rig.start_guard()
        rig.start_daemon()
        status = rig.wait_for(watching, SOON)
        checks.check(status is not None and watching(status), f"{what}: daemon and guard have found each other", rig.logs())
        arms_and_starts(checks, rig, what)
        status = rig.wait_for_state(rc.ENDS, 8 * SOON)
        checks.check(status is not None and status["campaign"]["state"] == "finished" and len(status["campaign"]["dwells"]) == count,
                     f"{what}: the campaign finishes", r.state_of(status) + rig.logs())
        checks.check("alarm:" not in rig.guard.text(), f"{what}: the guard finds nothing", rig.logs())
    finally:
        rig.stop()


def main():
    programs = r.programs_from_command_line(__doc__)
    checks = r.Checks()
    parts = (well, broken("SIGSTOP", stopped, continued, "daemon_silent"), broken("a stage hangs", hung, ended, "daemon_hangs"),
                 broken("SIGKILL", killed, by_hand, "daemon_silent"),
                 lies("it says idle, all well", 0, 0.0, 5.0, "unarmed_motion"),
                 lies("armed for 2 g, it does 5 g", 3, 2.0, 5.0, "over_level"), disobeyed, stuck_witness,
             unexcited, blind, fast, handled, mixed)
    if "--part" in sys.argv:
        with tempfile.TemporaryDirectory() as folder:
            parts[int(sys.argv[sys.argv.index("--part") + 1])](checks, programs, folder)
        return checks.end()
    running = [subprocess.Popen([sys.executable, os.path.abspath(__file__), programs, "--part", str(n)], stdin=subprocess.DEVNULL,
                                stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, preexec_fn=r.die_with_parent)
               for n in range(len(parts))]
    for one in running:
        checks.adopt(one.communicate()[0])
    return checks.end()


if __name__ == "__main__":
    sys.exit(main())
