#!/usr/bin/python3
"""Devices that lie about what can be measured otherwise, over the seqpacket bus: a controller whose table does something
else than it reads back, an accelerometer that is stuck, wrong keys, a rig that is silent, and clocks that do not fit.

usage: witnesses.py PROGRAMS
"""
import os
import sys
import tempfile

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import rig as r  # noqa: E402

CAMPAIGN = {"name": "witnessed", "identify": "what-it-can", "positions_deg": [[40, 10, 30]], "table_g": [5.0],
            "dwell_s": 120.0, "temperature_window_s": 0.0}
ENDS = ("finished", "aborted", "tripped", "paused")


class Witnessed:
    """A rig with these faults whose campaign has come to its end, or to a pause."""

    def __init__(self, programs, folder, *faults, later="", **tables):
        """`later`: a fault that begins once a dwell is recorded."""
        self.rig = rig = r.Rig(programs, "seqpacket", "rig", folder, poll_s=0.05)
        try:
            options = [word for fault in faults for word in ("--fault", fault)]
            if later:
                options += ["--speed", "40"]
            rig.start_plant("--seed", "5", "--warm-up", "2", *options)
            rig.configure(CAMPAIGN, **tables)
            rig.start_daemon()
            rig.wait_for(r.measuring, 30)
            self.said = [rig.tool(command, "--by", "tester") for command in ("arm", "start")]
            if later:
                rig.wait_for_state(("recording", *ENDS), 60)
                rig.order("fault " + later)
            self.status = rig.wait_for_state(ENDS, 60) if self.said[0].returncode == 0 else rig.status()
            self.text = rig.daemon.text()
        finally:
            rig.stop()

    @property
    def state(self):
        return self.status["campaign"]["state"]


def lying(checks, programs, what, faults, row, says, during=""):
    """Stopped before anything is recorded, or else `during` a dwell by a fault that begins there."""
    with tempfile.TemporaryDirectory() as folder:
        run = Witnessed(programs, folder, *faults, later=during)
        found = f"{r.state_of(run.status)} {[c.stderr for c in run.said]}\n{run.text[-2000:]}"
        checks.check(run.state == "tripped" and run.status["interlock"]["tripped"] == row, f"{what}: trips {row}", found)
        checks.check(says in run.status["campaign"].get("reason", ""), f"{what}: the reason says what was seen", found)
        checks.check(not any(d["used"] for d in run.status["campaign"]["dwells"]) or during, f"{what}: before any dwell", found)


def honest(checks, programs):
    with tempfile.TemporaryDirectory() as folder:
        run = Witnessed(programs, folder)
        checks.check(run.state == "finished", "an honest rig finishes", f"{r.state_of(run.status)}\n{run.text[-2000:]}")
        checks.check("gravity" not in run.text, "and nobody speaks of gravity", run.text[-2000:])


def only_witness(checks, programs):
    """The one accelerometer that sees the table is stuck, and the controller says that it has stopped: nobody knows, which is
    no rest, in this life and in the next. Once the accelerometer lives again, that the table shakes on is seen."""
    with tempfile.TemporaryDirectory() as folder:
        rig = r.Rig(programs, "seqpacket", "rig", folder, poll_s=0.05)
        disobeyed = lambda s: s["shaker"].get("rest") == "stop not obeyed"
        try:
            rig.start_plant("--seed", "5", "--warm-up", "2", "--speed", "40")
            rig.configure({**CAMPAIGN, "positions_deg": [[0, 0, 0]]}, **{"can.signals": {"table_accel": ""}})
            rig.start_daemon()
            rig.wait_for(r.measuring, 30)
            said = [rig.tool(command, "--by", "tester") for command in ("arm", "start")]
            status = rig.wait_for_state(("recording", *ENDS), 60)
            checks.equal(r.state_of(status), "recording", f"one witness only: it shakes {[c.stderr for c in said]}")
            for fault in ("stuck:y", "stuck-contactor"):
                rig.order("fault " + fault)
            for life in ("that life", "the next life"):
                status = rig.wait_for(disobeyed, 60)
                found = f"{status['shaker']}\n{rig.logs()}"
                checks.check(disobeyed(status), f"the only witness is stuck: in {life} no stop is confirmed", found)
                checks.check("is doubted" in rig.tool("events").stdout, f"in {life} the event says why", found)
                if life == "that life":
                    checks.equal(rig.daemon.end(timeout=60), 1, "and it ends with status 1")
                    rig.start_daemon()
            rig.order("clear")
            rig.order("fault stuck-contactor")
            status = rig.wait_for(lambda s: s["shaker"].get("rest") == "at rest", 60)
            checks.check("stop confirmed" in rig.tool("events").stdout, "an accelerometer that lives again confirms it",
                         f"{status['shaker']}\n{rig.logs()}")
        finally:
            rig.stop()


def frozen_node(checks, programs):
    """The node that sends all readings shows its last ones for ever, with counters that run on, and the contactor is welded:
    neither witness moves, and none is believed."""
    with tempfile.TemporaryDirectory() as folder:
        rig = r.Rig(programs, "seqpacket", "rig", folder, poll_s=0.05)
        try:
            rig.start_plant("--seed", "5", "--warm-up", "2", "--speed", "20")
            rig.configure(CAMPAIGN)
            rig.start_daemon()
            rig.wait_for(r.measuring, 30)
            said = [rig.tool(command, "--by", "tester") for command in ("arm", "start")]
            status = rig.wait_for_state(("recording", *ENDS), 60)
            checks.equal(r.state_of(status), "recording", f"a node that freezes: it shakes before {[c.stderr for c in said]}")
            rig.order("fault stuck-contactor")
            rig.order("fault stuck")
            status = rig.wait_for(lambda s: s["shaker"].get("rest") == "stop not obeyed", 60)
            found = f"{status['shaker']}\n{rig.logs()}"
            checks.check(status["shaker"].get("rest") == "stop not obeyed", "a node that freezes: no stop is confirmed", found)
            rig.tool("ack", "trip", "--by", "tester")
            checks.equal(rig.tool("arm", "--by", "tester").returncode, 1, "a node that freezes: and nothing is armed")
        finally:
            rig.stop()


def died(checks, programs):
    """Killed while it shakes, by which nothing is known but that: the next life believes no accelerometer that is still."""
    with tempfile.TemporaryDirectory() as folder:
        rig = r.Rig(programs, "seqpacket", "rig", folder, poll_s=0.05)
        try:
            rig.start_plant("--seed", "5", "--warm-up", "2", "--speed", "20")
            rig.configure({**CAMPAIGN, "positions_deg": [[0, 0, 0]]}, **{"can.signals": {"table_accel": ""}})
            rig.start_daemon()
            rig.wait_for(r.measuring, 30)
            said = [rig.tool(command, "--by", "tester") for command in ("arm", "start")]
            status = rig.wait_for_state(("recording", *ENDS), 60)
            checks.equal(r.state_of(status), "recording", f"killed while it shakes {[c.stderr for c in said]}")
            rig.order("fault stuck-contactor")
            rig.daemon.process.kill()
            rig.daemon.process.wait()
            rig.order("fault stuck:y")
            rig.start_daemon()
            status = rig.wait_for(lambda s: s["shaker"].get("rest") == "stop not obeyed", 60)
            found = f"{status['shaker']} {status['interlock']}\n{rig.logs()}"
            checks.check(status["shaker"].get("rest") == "stop not obeyed",
                         "killed while it shakes: one that is still proves nothing to the next life", found)
            checks.check("is doubted" in rig.tool("events").stdout, "killed while it shakes: the event says why", found)
            checks.equal(rig.tool("arm", "--by", "tester").returncode, 1, "killed while it shakes: nothing is armed")
            rig.order("clear")
            rig.wait_for(lambda s: rig.tool("ack", "trip", "--by", "tester").returncode == 0, 30)
            armed = rig.tool("arm", "--by", "tester")
            checks.equal((armed.returncode, armed.stderr), (0, ""), "killed while it shakes: one that lives again is believed")
        finally:
            rig.stop()


def wrong_keys(checks, programs):
    for key, value, names in (("encoder_sign", [1, -1, 1], "encoder_sign of the inner"),
                              ("encoder_zero_deg", [0.0, 0.0, 5.0], "encoder_zero_deg of the azimuth")):
        with tempfile.TemporaryDirectory() as folder:
            run = Witnessed(programs, folder, platform={key: value})
            reason = run.status["campaign"].get("reason", "")
            checks.check(run.state == "paused" and "off what the encoders say" in reason and names in reason,
                         f"a wrong {key} pauses before the ramp and is named", f"{r.state_of(run.status)}\n{run.text[-2000:]}")
            checks.check(run.status["shaker"].get("measured_g") == 0, f"a wrong {key}: the table rests", run.status["shaker"])


def wrong_rate(checks, programs):
    with tempfile.TemporaryDirectory() as folder:
        run = Witnessed(programs, folder, can={"sample_rate_hz": 80.0})
        said = run.said[0].stderr
        checks.check(run.said[0].returncode == 1 and "40" in said and "can.sample_rate_hz = 80" in said,
                     "a wrong sample rate: no arming, and both rates are named", said + run.text[-1000:])


def silent(checks, programs):
    """On the real clock: never before it comes, silent after it goes, never all good."""
    with tempfile.TemporaryDirectory() as folder:
        rig = r.Rig(programs, "seqpacket", "real", folder)
        qualities = lambda s: {c["quality"] for c in s["sample"]["channels"]}
        try:
            rig.start_plant("--seed", "5")
            rig.configure(CAMPAIGN, can={"stale_deadline_ms": 2000}, gimbal={"status_deadline_ms": 2000})
            rig.start_daemon()
            status = rig.wait_for(lambda s: qualities(s) == {"good"}, 30)
            checks.equal(qualities(status), {"good"}, "a rig that speaks is good")
            rig.plant.process.kill()
            status = rig.wait_for(lambda s: qualities(s) == {"silent"}, 30)
            checks.equal(qualities(status), {"silent"}, "a rig that has fallen silent is silent")
            checks.check("value" not in status["sample"]["channels"][0], "and has no values", status["sample"])
            looks = rig.tool("selftest")
            checks.check(looks.returncode == 1 and "silent" in looks.stdout and "all good" not in looks.stdout,
                         "selftest says so", looks.stdout)
            checks.equal(rig.tool("arm", "--by", "tester").returncode, 1, "and nothing is armed")
            rig.daemon.end(timeout=30)
            rig.start_daemon()
            status = rig.wait_for(lambda s: qualities(s) == {"never"}, 30)
            checks.equal(qualities(status), {"never"}, "of one that has said nothing since the start that is said")
        finally:
            rig.stop()


def clocks(checks, programs):
    for plant, daemon, says in (("rig", "real", "simulated rig that owns the time"),
                                ("real", "rig", "no simulated rig sends its time")):
        with tempfile.TemporaryDirectory() as folder:
            rig = r.Rig(programs, "seqpacket", plant, folder)
            try:
                rig.start_plant("--seed", "5")
                rig.clock = daemon
                rig.configure(CAMPAIGN)
                rig.start_daemon()
                status = rig.wait_for(lambda s: s.get("clock_misfit"), 30)
                checks.check(says in status.get("clock_misfit", ""), f"{plant} against {daemon}: the status names it", str(status)[:300])
                looks = rig.tool("selftest")
                checks.check(looks.returncode == 1 and says in looks.stdout and "all good" not in looks.stdout,
                             f"{plant} against {daemon}: selftest names it", looks.stdout)
                refused = rig.tool("arm", "--by", "tester")
                checks.check(refused.returncode == 1 and says in refused.stderr, f"{plant} against {daemon}: no arming",
                             refused.stderr + rig.logs())
            finally:
                rig.stop()


def main():
    programs = r.programs_from_command_line(__doc__)
    checks = r.Checks()
    honest(checks, programs)
    lying(checks, programs, "10 g for 5 g", ["amplitude-scaled=2", "readback-echo"], "over_armed_level", "5 g armed")
    lying(checks, programs, "half of what is ordered", ["amplitude-scaled=0.45", "readback-echo"], "amplitude_witness",
          "5 g commanded")
    lying(checks, programs, "a dead table read back as 5 g", ["dead-table", "readback-echo"], "amplitude_witness",
          "5 g commanded")
    for channel in "xyz":
        lying(checks, programs, f"accelerometer {channel} stuck while it shakes", [], "stuck",
              f"accel_{channel}", during=f"stuck:{channel}")
    only_witness(checks, programs)
    frozen_node(checks, programs)
    died(checks, programs)
    wrong_keys(checks, programs)
    wrong_rate(checks, programs)
    silent(checks, programs)
    clocks(checks, programs)
    return checks.end()


if __name__ == "__main__":
    sys.exit(main())
