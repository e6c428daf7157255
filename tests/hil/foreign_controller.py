#!/usr/bin/python3
"""A shaker's controller that is not ours, played by pymodbus over TCP and over a serial line, and that lies in each of the
eight ways: while the table shakes, at its stop, from the start. It drives the table of the simulated rig, which alone tells
what is so. In real time over the seqpacket bus; how soon is asserted in virtual time (fault_matrix.py).

usage: foreign_controller.py PROGRAMS [--part N]     one of its parts; else all, side by side: they wait most of the time
"""
import json
import math
import os
import re
import socket
import subprocess
import sys
import tempfile
import time

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import rig as r  # noqa: E402

HERE = os.path.dirname(os.path.abspath(__file__))
CAMPAIGN = {"name": "foreign", "identify": "what-it-can", "positions_deg": [[0, 0, 0]], "table_g": [5.0], "dwell_s": 600.0,
            "settle_s": 2.0, "ramp_s": 1.0, "temperature_window_s": 0.0}
SOON = 40   # the machine may be busy
TIMEOUT_S = 3 * r.PATIENT["shaker"]["watchdog_period_ms"] / 1000   # of its watchdog
LATE_S = 0.5
WITNESS = ("amplitude_witness", "over_armed_level", "stuck")
# The lie, begun while the table does 5 g, and what trips.
WHILE_SHAKING = [
    (["amplitude_scaled=2"], WITNESS),
    (["unit_rms"], WITNESS),
    (["dead_table", "readback_echo"], WITNESS),
    (["timeout_register=0"], ("watchdog_changed",)),
]
FROM_THE_START = [(["slow_ramp=10"], WITNESS), (["amplitude_scaled=0.5"], WITNESS)]
AT_THE_STOP = [["ack_without_stop", "timeout_ignored"], ["ack_without_stop", "timeout_scaled=10"], ["stuck_contactor"]]


class Foreign(r.Rig):
    def __init__(self, programs, folder, line):
        super().__init__(programs, "seqpacket", "real", folder, poll_s=0.1)
        self.start_plant("--seed", "5", "--warm-up", "1", "--start-temperature", "45")
        self.be_punctual()
        self.log = open(os.path.join(folder, "controller.log"), "wb")   # pylint: disable=consider-using-with
        where = "rtu" if line else str(free_port())
        self.controller = subprocess.Popen([os.path.join(HERE, "pymodbus_shaker.py"), where, "--table", self.control],
                                           stdin=subprocess.PIPE, stdout=self.log, stderr=self.log, text=True,
                                           preexec_fn=r.die_with_parent)
        own, self.modbus_port = self.modbus_port, self.modbus_port if line else int(where)
        shaker = {"transport": "rtu", "device": self.first_line(), "baud": 115200} if line else {}
        # Whoever plays the controller comes as early as the rig does.
        subprocess.run(["chrt", "-a", "-f", "-p", "20", str(self.controller.pid)], capture_output=True, check=False)
        self.configure(CAMPAIGN, **{**r.PATIENT, "shaker": {**r.PATIENT["shaker"], **shaker}, "record": {"enabled": False}})
        self.modbus_port = own
        self.start_daemon()
        self.wait_for(lambda s: s["platform"].get("ready") and s["shaker"].get("rest") == "at rest", SOON)

    def said(self):
        with open(self.log.name, encoding="utf-8", errors="replace") as log:
            return log.read().splitlines()

    def first_line(self):
        end = time.monotonic() + SOON
        while time.monotonic() < end and not self.said():
            time.sleep(0.05)
        return self.said()[0]

    def table_g(self):
        """As the rig was last commanded, and so moves."""
        commanded = re.findall(r"ok table ([\d.]+)", self.plant.text())
        return float(commanded[-1]) if commanded else 0.0

    def tell(self, *lines):
        for line in lines:
            self.controller.stdin.write(line + "\n")
        self.controller.stdin.flush()

    def lie(self, *lies):
        """Until the controller says that it does."""
        self.tell(*("lie " + each for each in lies))
        end = time.monotonic() + SOON
        while time.monotonic() < end and not set(each.split("=")[0] for each in lies) <= self.lies_told():
            time.sleep(0.05)

    def lies_told(self):
        told = [json.loads(line) for line in self.said() if line.startswith("{")]
        return set(told[-1].get("lies", [])) if told else set()

    def rest(self):
        """Honest, at rest, and nothing latched."""
        self.tell("honest")

        def clear(status):
            if status["campaign"]["state"] == "tripped" or status["shaker"].get("fault"):
                self.tool("ack", "trip" if status["campaign"]["state"] == "tripped" else "shaker", "--by", "Ada")
                return False
            if status["shaker"].get("watchdog_timeout_s") == 0:   # it was not honest yet when the trip was acknowledged
                self.tool("ack", "shaker", "--by", "Ada")
                return False
            return status["shaker"].get("rest") == "at rest" and status["shaker"].get("state") == 0 and \
                status["shaker"]["link"] == "running"
        return self.wait_for(clear, SOON)

    def shake(self):
        """Arms, starts; the state that it ends in."""
        said = [self.tool(word, "--by", "Ada") for word in ("arm", "start")]
        status = self.wait_for_state(("recording", "aborted", "tripped"), 2 * SOON)
        return status, [each.stderr for each in said if each.returncode]

    def shakes(self, checks, what):
        # Whoever plays the controller may be late where the machine is busy: then the ramp is aborted, and tried again.
        for _ in range(3):
            self.rest()
            status, said = self.shake()
            if status is None or status["campaign"]["state"] != "aborted":
                break
        return checks.check(status is not None and status["campaign"]["state"] == "recording" and self.table_g() > 4.9,
                            f"{what}: the table shakes before", f"{r.state_of(status)} {said} {self.table_g()} g\n{self.logs()}")

    def comes_to_rest(self, checks, what):
        end = time.monotonic() + SOON
        while time.monotonic() < end and self.table_g() > 0:
            time.sleep(0.1)
        checks.check(self.table_g() == 0, f"{what}: the table comes to rest", f"{self.table_g()} g\n{self.logs()}")

    def stop(self):
        super().stop()
        self.controller.kill()
        self.controller.wait()
        self.log.close()


def free_port():
    with socket.create_server(("127.0.0.1", 0)) as listener:
        return listener.getsockname()[1]


def trips(checks, rig, what, names):
    status = rig.wait_for_state(("tripped",), SOON)
    checks.check(status["campaign"]["state"] == "tripped" and status["interlock"]["tripped"] in names,
                 f"{what}: trips by {' or '.join(names)}", f"{r.state_of(status)}\n{rig.logs()}")


def while_shaking(checks, rig, name, which=None):
    for lies, names in which or WHILE_SHAKING:
        what = f"{name}: {' + '.join(lies)} while it shakes"
        if rig.shakes(checks, what):
            rig.lie(*lies)
            trips(checks, rig, what, names)
            rig.comes_to_rest(checks, what)


def from_the_start(checks, rig, name):
    for lies, names in FROM_THE_START:
        what = f"{name}: {' + '.join(lies)} from the start"
        for _ in range(3):   # as in shakes()
            rig.rest()
            rig.lie(*lies)
            status, said = rig.shake()
            if status is None or status["campaign"]["state"] != "aborted":
                break
        checks.check(status["campaign"]["state"] == "tripped" and status["interlock"]["tripped"] in names,
                     f"{what}: trips by {' or '.join(names)} before anything is recorded", f"{r.state_of(status)} {said}\n{rig.logs()}")
        rig.comes_to_rest(checks, what)


def at_the_stop(checks, rig, name, which=None):
    for lies in which or AT_THE_STOP:
        what = f"{name}: {' + '.join(lies)} at the stop"
        if not rig.shakes(checks, what):
            continue
        rig.lie(*lies)
        checks.equal(rig.tool("abort", "--by", "Ada").returncode, 0, f"{what}: the abort is taken")
        trips(checks, rig, what, ("stop_disobeyed",))
        status = rig.status()
        checks.check(rig.table_g() > 4.9 and status["shaker"].get("stop_pending"), f"{what}: which it is, and is not confirmed",
                     f"{rig.table_g()} g {status['shaker']}")
        refused = rig.tool("ack", "trip", "--by", "Ada")
        checks.equal(refused.returncode, 1, f"{what}: it cannot be acknowledged")
        rig.tell("honest")
        rig.comes_to_rest(checks, what + ", and obeyed at last")
    # Its watchdog is honest: starved, it ends what the stop did not.
    what = f"{name}: ack_without_stop at the stop"
    if rig.shakes(checks, what):
        rig.lie("ack_without_stop")
        rig.tool("abort", "--by", "Ada")
        rig.comes_to_rest(checks, what + ", starved of feeds")


def at_zero(checks, rig, name):
    """Before anything moves: its watchdog stops it while it is read, and with the link closed; of one that does not it is said."""
    for lie, word in ((None, ""), ("timeout_ignored", "the watchdog was not fed, and did not stop the controller")):
        rig.rest()
        if lie:
            rig.lie(lie)
        said = rig.tool("selftest", "--by", "Ada", "--at-zero", timeout=180)
        proof = (rig.status() or {}).get("proof", {})
        rows = {row["name"]: row["value"] for row in proof.get("rows", [])}
        if lie:
            checks.check(not proof.get("passed") and word in proof.get("message", ""), f"{name}: at 0 g {lie} is found", said.stdout + said.stderr)
        else:
            starved, closed = (rows.get(f"watchdog at 0 g, {how}", math.inf) for how in ("not fed", "link closed"))
            checks.check(proof.get("passed") and TIMEOUT_S / 2 <= starved <= TIMEOUT_S + LATE_S and closed <= TIMEOUT_S + LATE_S,
                         f"{name}: at 0 g its watchdog stops it, with the link closed, too", said.stdout + said.stderr + rig.logs())
    checks.equal(rig.table_g(), 0, f"{name}: and nothing has moved")


def over_tcp(part):
    return lambda checks, programs, folder: played(checks, programs, folder, False, part)


def over_a_line(checks, programs, folder):
    def part(checks, rig, _):
        at_zero(checks, rig, "RTU")
        while_shaking(checks, rig, "RTU", WHILE_SHAKING[::3])
        at_the_stop(checks, rig, "RTU", AT_THE_STOP[:1])
    played(checks, programs, folder, True, part)


def played(checks, programs, folder, line, part):
    rig = Foreign(programs, folder, line)
    try:
        part(checks, rig, "TCP")
        rig.rest()
        checks.equal(rig.daemon.end(timeout=SOON), 0, "vibrigd ends with status 0")
        checks.check(not any("written beyond the map" in line for line in rig.said()), "only registers that were stated were written", rig.said())
    finally:
        rig.stop()


PARTS = [over_tcp(while_shaking), over_tcp(lambda c, rig, n: (at_zero(c, rig, n), from_the_start(c, rig, n), at_the_stop(c, rig, n))), over_a_line]


def main():
    programs = r.programs_from_command_line(__doc__)
    checks = r.Checks()
    if "--part" in sys.argv:
        with tempfile.TemporaryDirectory() as folder:
            PARTS[int(sys.argv[sys.argv.index("--part") + 1])](checks, programs, folder)
        return checks.end()
    parts = [subprocess.Popen([os.path.abspath(__file__), programs, "--part", str(n)], stdin=subprocess.DEVNULL,
                              stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, preexec_fn=r.die_with_parent)
             for n in range(len(PARTS))]
    for part in parts:
        checks.adopt(part.communicate()[0])
    return checks.end()


if __name__ == "__main__":
    sys.exit(main())
