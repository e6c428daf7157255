#!/usr/bin/python3
"""Stops that are not obeyed, a watchdog that is not what was written, and two daemons on one rig: in real time on the
seqpacket bus, against a controller that lies.

usage: disobeyed_stop.py PROGRAMS
"""
import os
import re
import signal
import subprocess
import sys
import tempfile
import time

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import guard_campaign as g  # noqa: E402
import modbus_proxy  # noqa: E402
import rig as r  # noqa: E402

CAMPAIGN = {"name": "liar", "identify": "what-it-can", "positions_deg": [[0, 0, 0]], "table_g": [5.0], "dwell_s": 600.0,
            "settle_s": 2.0, "ramp_s": 0.5, "temperature_window_s": 0.0}
DEADLINE_S, RING_DOWN_S, BUSY_S = 3, 3, 5   # what the machine may be late by is not looked at here
# On a busy machine samples come late; what is looked at here are stops.
LATE = {"can": {"stale_deadline_ms": 5000}, "gimbal": {"status_deadline_ms": 5000}, "shaker": {"response_timeout_ms": 5000},
        "record": {"enabled": False}}


class Liar(r.Rig):
    """A rig that shakes at 5 g, and lies from then on."""

    def __init__(self, programs, folder):
        super().__init__(programs, "seqpacket", "real", folder, poll_s=0.1)
        self.start_plant("--seed", "5", "--warm-up", "1", "--start-temperature", "45")
        self.be_punctual()
        self.coils = g.Coils()
        self.write_configuration()
        self.start_daemon()
        self.wait_for(lambda s: s["platform"].get("ready") and s["shaker"].get("rest") == "at rest", 30)

    def write_configuration(self):
        self.configure(CAMPAIGN, **LATE)
        with open(self.configuration, "a", encoding="utf-8") as file:
            file.write(f'[annunciator.modbus]\nhost = "127.0.0.1"\nport = {self.coils.port}\nhorn_coil = 0\nlamp_coil = 1\n')

    def stop(self):
        super().stop()
        self.coils.end()

    def shake(self, checks):
        said = [self.tool(command, "--by", "Ada") for command in ("arm", "start")]
        last = self.wait_for_state(("recording", "aborted", "tripped"), 40)
        checks.check(last is not None and last["campaign"]["state"] == "recording", "the table shakes at 5 g",
                     f"{r.state_of(last)} {[s.stderr for s in said]}\n{self.logs()}")

    def events(self):
        return self.tool("events").stdout

    def feeds(self):
        return r.number(self.status()["shaker"].get("feeds", 0))


def disobeyed(status):
    return status["shaker"].get("rest") == "stop not obeyed"


def acknowledged_without_stop(checks, programs, folder):
    """Run 0 is taken and read back, the table shakes on, the controller's watchdog is dead."""
    rig = Liar(programs, folder)
    try:
        rig.shake(checks)
        rig.order("fault ack-without-stop")
        rig.order("fault timeout-ignored")
        time.sleep(0.5)
        began = time.monotonic()
        checks.equal(rig.tool("abort", "--by", "Ada").returncode, 0, "the abort is taken")
        # It is answered at the latest 0.1 s later, whether the campaign's thread has come to it or not.
        status = rig.wait_for(lambda s: s["shaker"].get("rest") == "stopping" or disobeyed(s), BUSY_S)
        # Whoever looks so late that its time may be over sees that it was not obeyed.
        checks.check(status["shaker"].get("rest") == "stopping" or (disobeyed(status) and time.monotonic() - began >= DEADLINE_S),
                     "until rest is measured the status says stopping", status["shaker"])
        status = rig.wait_for(lambda s: not s["shaker"].get("running"), BUSY_S)
        checks.check(not status["shaker"].get("running"), "though run reads 0", status["shaker"])
        time.sleep(0.6)   # a feed may have been under way
        first = rig.feeds()
        status = rig.wait_for(disobeyed, DEADLINE_S + BUSY_S)
        took = re.findall(r"stop not obeyed within ([\d.]+) s", rig.events())
        checks.check(disobeyed(status) and took and DEADLINE_S <= float(took[-1]) < DEADLINE_S + BUSY_S,
                     f"after {DEADLINE_S} s it is a stop that was not obeyed", f"{took} {status['shaker']}\n{rig.logs()}")
        status = rig.wait_for(lambda s: s["campaign"]["state"] == "tripped", BUSY_S)
        checks.equal(status["interlock"]["tripped"], "stop_disobeyed", "which latches as a trip")
        time.sleep(2)
        horn = [value for coil, value in list(rig.coils.writes) if coil == 0]
        checks.check(g.wait_until(lambda: rig.coils.on(0) and rig.coils.on(1)) and horn[-1:] == [1],
                     "the horn sounds without a pause, the lamp is on", rig.coils.writes)
        events = rig.events()
        checks.check("stop not obeyed" in events and "press the emergency stop" in events and "aborted by Ada" in events,
                     "the event says so, whose stop it was, and what to do", events[-2000:])
        checks.equal(rig.feeds(), first, "the watchdog starves")
        checks.check("stop confirmed" not in events.rsplit("campaign aborted", 1)[-1], "no stop is confirmed", events[-2000:])
        refused = rig.tool("selftest")
        checks.check(refused.returncode == 1 and "press the emergency stop" in refused.stdout, "selftest says no", refused.stdout)
        refused = rig.tool("ack", "trip", "--by", "Ada")
        checks.check(refused.returncode == 1 and "not at rest" in refused.stderr, "nobody acknowledges it while it moves",
                     refused.stderr)
        checks.equal(rig.daemon.end(signal.SIGTERM, timeout=60), 1, "SIGTERM ends vibrigd with status 1")
        log = rig.daemon.text()
        checks.check("stopped cleanly" not in log and "ended without rest measured" in log and "emergency stop" in log,
                     "and it says what it leaves behind", log[-2000:])
        # A daemon that finds it so
        rig.start_daemon()
        status = rig.wait_for(disobeyed, DEADLINE_S + RING_DOWN_S + BUSY_S)
        checks.check(disobeyed(status), "the next daemon finds that its first stop is not obeyed", rig.logs())
        checks.check(rig.tool("arm", "--by", "Ada").returncode == 1, "and is not armed")
        # The emergency stop, pressed
        rig.order("estop open")
        status = rig.wait_for(lambda s: not s["shaker"].get("stop_pending"), 10)
        checks.check(not status["shaker"].get("stop_pending") and "stop confirmed" in rig.events(),
                     "once it is at rest the stop is confirmed", f"{status['shaker']}\n{rig.logs()}")
        rig.order("clear")
        rig.order("estop close")
        rig.wait_for(lambda s: not s["shaker"].get("emergency_stop_open"), 10)
        checks.equal(rig.tool("ack", "trip", "--by", "Ada").returncode, 0, "and can be acknowledged")
        checks.equal(rig.daemon.end(signal.SIGTERM, timeout=30), 0, "a daemon that leaves nothing moving ends with status 0")
    finally:
        rig.stop()


def aborted_in_vain(checks, rig):
    rig.shake(checks)
    rig.order("fault stuck-contactor")
    time.sleep(0.5)
    rig.tool("abort", "--by", "Ada")


def stuck_contactor(checks, programs, folder):
    """Everything the controller says is rest."""
    rig = Liar(programs, folder)
    try:
        aborted_in_vain(checks, rig)
        checks.equal(rig.daemon.end(signal.SIGTERM, timeout=60), 1, "abort, then SIGTERM: status 1 while the table moves")
        log = rig.daemon.text()
        checks.check("stopped cleanly" not in log and "stop not obeyed" in log, "never \"stopped cleanly\"", log[-2000:])
        checks.check("stop confirmed" not in log.rsplit("campaign aborted", 1)[-1], "never \"stop confirmed\"", log[-2000:])
    finally:
        rig.stop()


def after_another_trip(checks, programs, folder):
    """The first cause is the interlock's; that its stop was not obeyed is a latch beside it, of which a restart knows."""
    rig = Liar(programs, folder)
    try:
        rig.shake(checks)
        rig.order("fault stuck-contactor")
        rig.order("fault loop-open")

        def latched(status):
            return [latch["name"] for latch in status["interlock"]["latches"]]
        status = rig.wait_for(lambda s: "stop_disobeyed" in latched(s), DEADLINE_S + BUSY_S)
        checks.equal((status["interlock"]["tripped"], latched(status)), ("loop_open", ["loop_open", "stop_disobeyed"]),
                     "after another trip, too, a stop that is not obeyed latches")
        checks.equal({latch["armed_by"] for latch in status["interlock"]["latches"]}, {"Ada (uid 0)"}, "of whoever armed it")
        rig.order("estop open")
        rig.wait_for(lambda s: s["shaker"].get("rest") == "at rest" and "emergency_stop" in latched(s), BUSY_S)
        rig.daemon.end(signal.SIGKILL)
        rig.start_daemon()
        status = rig.wait_for(lambda s: latched(s), BUSY_S)
        checks.check("stop_disobeyed" in latched(status) and "not obeyed" in status["campaign"]["reason"],
                     "and after SIGKILL at rest the next start knows it", f"{latched(status)} {r.state_of(status)}")
        rig.order("clear")
        rig.order("estop close")
        rig.wait_for(lambda s: not s["shaker"].get("emergency_stop_open"), BUSY_S)
        said = rig.acknowledge(by="Ada")
        checks.check(said.returncode == 0 and "not obeyed" in said.stdout and not latched(rig.status()), "until it is acknowledged", said.stdout + said.stderr)
    finally:
        rig.stop()


def pressed_in_time(checks, programs, folder):
    """After an abort, while the table still moves: no row of the interlock watches the chain then."""
    rig = Liar(programs, folder)
    try:
        aborted_in_vain(checks, rig)
        rig.order("estop open")
        status = rig.wait_for(lambda s: s["interlock"].get("latches"), 10)
        names = [latch["name"] for latch in status["interlock"].get("latches", [])]
        checks.check(names[:1] == ["emergency_stop"] and status["campaign"]["state"] == "tripped",
                     "an emergency stop pressed while an aborted table moves is a trip and latched", f"{names} {status['campaign']}")
        rig.order("clear")
        rig.order("estop close")
        rig.wait_for(lambda s: not s["shaker"].get("emergency_stop_open") and s["shaker"].get("rest") == "at rest", 30)
        checks.check(rig.tool("arm", "--by", "Ada").returncode == 1, "and keeps the rig disarmed")
        checks.equal(rig.tool("ack", "trip", "--by", "Ada").returncode, 0, "until it is acknowledged")
    finally:
        rig.stop()


def blind(checks, programs, folder):
    """Killed at 5 g, and the next life sees neither bus nor controller: nobody knows, and that is no rest."""
    rig = Liar(programs, folder)
    try:
        rig.daemon.end()
        own, proxy = rig.modbus_port, modbus_proxy.Proxy(rig.modbus_port)
        rig.modbus_port = proxy.port
        rig.write_configuration()
        rig.modbus_port = own
        rig.start_daemon()
        rig.wait_for(lambda s: r.measuring(s) and s["shaker"].get("rest") == "at rest", 30)
        rig.shake(checks)
        rig.order("fault timeout-ignored")
        rig.daemon.process.kill()
        rig.daemon.process.wait()
        rig.order("fault bus-silent=100000")
        proxy.break_with("refuse")
        rig.start_daemon()
        checks.check(g.wait_until(lambda: rig.coils.on(1) and rig.coils.on(0)), "the next life's lamp and horn tell of the trip it has found",
                     rig.coils.writes)
        status = rig.wait_for(disobeyed, DEADLINE_S + RING_DOWN_S + BUSY_S)
        checks.check(disobeyed(status), "blind, it says that its first stop is not obeyed", f"{status['shaker']}\n{rig.logs()}")
        checks.equal(rig.daemon.end(signal.SIGTERM, timeout=60), 1, "blind, it ends with status 1")
        checks.check("stopped cleanly" not in rig.daemon.text().rsplit("not acknowledged", 1)[-1], "and not \"cleanly\"", rig.logs())
        moves = float(re.search(r"table ([\d.]+) g", rig.order("status"))[1])
        checks.check(moves > 4.9, "for the table does 5 g all the time", moves)
    finally:
        rig.stop()


def obeyed(checks, programs, folder):
    """A controller that obeys; its watchdog's timeout; a second daemon."""
    rig = Liar(programs, folder)
    try:
        second = subprocess.run([rig.program("vibrigd"), "--config", rig.configuration], stdin=subprocess.DEVNULL,
                                capture_output=True, text=True, timeout=30)
        checks.equal(second.returncode, 2, "a second daemon on the same rig exits with status 2")
        checks.check(f"pid {rig.daemon.process.pid}" in second.stderr and rig.configuration in second.stderr and
                     "since 20" in second.stderr, "and names the first", second.stderr)
        rig.order("fault timeout-register=60000")
        status = rig.wait_for(lambda s: s["shaker"].get("watchdog_timeout_s") == 60, 10)
        checks.equal(status["shaker"].get("watchdog_timeout_s"), 60, "another master's watchdog timeout is seen")
        refused = rig.tool("arm", "--by", "Ada")
        checks.check(refused.returncode == 1 and "watchdog timeout" in refused.stderr, "nobody arms with it", refused.stderr)
        checks.check(rig.tool("selftest").returncode == 1, "selftest says no")
        checks.check("watchdog timeout reads" in rig.events(), "there is an alarm", rig.events())
        rig.order("clear")
        checks.equal(rig.tool("ack", "shaker", "--by", "Ada").returncode, 0, "acknowledged, it is written again")
        rig.wait_for(lambda s: s["shaker"].get("watchdog_timeout_s") == 1.5, 10)
        rig.shake(checks)
        rig.order("fault timeout-register=0")
        status = rig.wait_for(lambda s: s["campaign"]["state"] == "tripped", 10)
        checks.equal(status["interlock"].get("tripped"), "watchdog_changed", "while it shakes a change trips")
        rig.order("clear")
        status = rig.wait_for(lambda s: s["shaker"].get("rest") == "at rest", DEADLINE_S + BUSY_S)
        checks.equal(status["shaker"].get("rest"), "at rest", "and it comes to rest")
        checks.check("stop confirmed: rest measured" in rig.events(), "which is a measurement", rig.events()[-2000:])
        checks.equal(rig.tool("ack", "trip", "--by", "Ada").returncode, 0, "the trip is acknowledged")
        rig.shake(checks)
        rig.tool("abort", "--by", "Ada")
        checks.equal(rig.daemon.end(signal.SIGTERM, timeout=30), 0, "abort, then SIGTERM: status 0 when the stop is obeyed")
        log = rig.daemon.text()
        checks.check("stopped cleanly" in log and log.rindex("stop confirmed") > log.rindex("campaign aborted"),
                     "after rest was measured", log[-2000:])
    finally:
        rig.stop()


def main():
    programs = r.programs_from_command_line(__doc__)
    checks = r.Checks()
    for part in (acknowledged_without_stop, stuck_contactor, after_another_trip, pressed_in_time, blind, obeyed):
        with tempfile.TemporaryDirectory() as folder:
            part(checks, programs, folder)
    return checks.end()


if __name__ == "__main__":
    sys.exit(main())
