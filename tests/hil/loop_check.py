#!/usr/bin/python3
"""The loop check before a campaign, on the seqpacket bus and the rig's clock: in band it lets a campaign be armed, out of
band not and says why; it is its own arming, ends disarmed and at rest, can be aborted, and stands in the journal.

usage: loop_check.py PROGRAMS
"""
import json
import os
import sqlite3
import subprocess
import sys
import tempfile
import time

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import rig as r  # noqa: E402

CAMPAIGN = {"name": "checked", "identify": "what-it-can", "positions_deg": [[0, 0, 0]], "table_g": [9.0],
            "dwell_s": 10.0}
ROWS = ["transmission", "frequency", "distortion", "cross-axis share", "motion in step", "phase"]


def ready(status):
    return status["can"]["link"] == "running" and status["shaker"]["link"] == "running" and \
        status["platform"].get("ready") and status["shaker"].get("state") == 0


def running(status):
    return status["campaign"]["state"] == "checking" and status["shaker"].get("measured_g", 0) > 0.4


def over(status):
    return status["campaign"]["state"] != "checking"


def make(checks, programs, folder, speed, change=None, campaign=None, tables=None, plant=(), **selftest):
    """A rig, its truth changed as given, and a daemon that measures."""
    rig = r.Rig(programs, "seqpacket", "rig", folder, poll_s=0.05)
    truth = os.path.join(folder, "truth.json")
    subprocess.run([rig.program("vibrig-plant"), "run", "--write-truth", truth, "--duration", "0", "--clock", "real", "--can",
                    "seqpacket:" + os.path.join(folder, "none.sock"), "--modbus", "tcp:127.0.0.1:0"],
                   check=True, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, timeout=30)
    with open(truth, encoding="utf-8") as file:
        values = json.load(file)
    for section, keys in (change or {}).items():
        values.setdefault(section, {}).update(keys)
    with open(truth, "w", encoding="utf-8") as file:
        json.dump(values, file)
    rig.start_plant("--seed", "6", "--truth", truth, "--speed", str(speed), *plant)
    rig.configure(campaign or CAMPAIGN, selftest=selftest, **(tables or {}))
    rig.start_daemon()
    status = rig.wait_for(ready, 60)
    checks.check(status is not None and ready(status), "the rig is ready", rig.logs())
    return rig


def in_band(checks, programs, folder):
    # Slow and long, so that what is tried meanwhile comes in time.
    rig = make(checks, programs, folder, 10, required=True, measure_s=20.0)
    try:
        refused = rig.tool("arm", "--by", "Ada")
        checks.check(refused.returncode == 1 and "no loop check" in refused.stderr,
                     "required and not made: nothing is armed", refused.stderr)
        only_looks = rig.tool("selftest")
        checks.check(rig.status()["loop_check"]["verdict"] == "none", "without a name it only looks", only_looks.stdout)
        begun = subprocess.Popen([rig.program("vibrig"), "selftest", "--by", "Ada", "--socket", rig.socket],
                                 stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
        status = rig.wait_for(running, 60)
        checks.check(status is not None and running(status), "it shakes at the small level", r.state_of(status))
        checks.check(status["shaker"]["measured_g"] < 0.55, "and no more than that", status["shaker"])
        for command in ("arm", "start"):
            refused = rig.tool(command, "--by", "Ada")
            checks.equal(refused.returncode, 1, f"meanwhile no {command}")
        said, _ = begun.communicate(timeout=60)
        checks.equal(begun.returncode, 0, "it ends with exit code 0")
        checks.check(all(f"ok    {row}" in said for row in ROWS), "it prints what it looked at", said)
        status = rig.status()
        rows = {row["name"]: row["value"] for row in status["loop_check"]["rows"]}
        # 20 s of samples with 1e-4 g of noise, 1e-3 g at the table: a per mille of 0.5 g is ten standard deviations
        checks.check(abs(rows["transmission"] - 2 / 3) < 1e-3, "transmission as the rig has it", rows)
        checks.check(abs(rows["frequency"] - 15) < 1e-3, "frequency as the rig has it", rows)
        checks.check(abs(rows["phase"] + 125.5) < 1, "phase as the rig has it", rows)
        checks.check(status["campaign"]["state"] == "idle" and not status["campaign"]["armed_by"] and
                     status["shaker"].get("state") == 0, "it leaves the rig disarmed and at rest", r.state_of(status))
        checks.equal(rig.tool("start", "--by", "Ada").returncode, 1, "it is no arming for a campaign")
        checks.equal(rig.tool("arm", "--by", "Ada").returncode, 0, "the campaign can be armed")
        rig.tool("abort", "--by", "Ada")
        rig.wait_for(lambda s: s["campaign"]["state"] == "aborted" and not s["shaker"].get("running"), 60)
        # aborted in the midst of it
        rig.acknowledge(by="Ada")
        begun = subprocess.Popen([rig.program("vibrig"), "selftest", "--by", "Grace", "--socket", rig.socket],
                                 stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
        status = rig.wait_for(running, 60)
        checks.check(status is not None and running(status), "it can be made again", r.state_of(status))
        rig.tool("abort", "--by", "Ada")
        stopped = rig.wait_for(lambda s: over(s) and s["shaker"].get("state") == 0 and
                               not s["shaker"].get("running", True), 60)
        checks.check(stopped is not None and over(stopped) and stopped["shaker"].get("state") == 0,
                     "an abort ends it at rest", r.state_of(stopped))
        begun.communicate(timeout=60)
        checks.equal(stopped["loop_check"]["verdict"], "not completed", "and it counts as not completed")
        checks.equal(rig.daemon.end(timeout=30), 0, "vibrigd ends with status 0")
        with sqlite3.connect(f"file:{rig.results}/journal.sqlite3?mode=ro", uri=True) as database:
            who = [person.split(" (")[0] for person, in database.execute(
                "SELECT person FROM command WHERE kind = 'selftest' AND accepted ORDER BY id")]
            logged = [text for text, in database.execute("SELECT text FROM event WHERE text LIKE 'loop check%'")]
        checks.equal(who, ["Ada", "Grace"], "the journal knows who ordered it")
        checks.check("loop check in band" in logged and any("transmission" in text for text in logged),
                     "and what came out", logged)
    finally:
        rig.stop()


def out_of_band(checks, programs, folder, what, change, says):
    rig = make(checks, programs, folder, 40, change)
    try:
        tested = rig.tool("selftest", "--by", "Ada", timeout=90)
        checks.check(tested.returncode == 1 and f"NOT   {says}" in tested.stdout, f"{what}: out of band",
                     tested.stdout + tested.stderr)
        refused = rig.tool("arm", "--by", "Ada")
        checks.check(refused.returncode == 1 and "out of band" in refused.stderr and says in refused.stderr,
                     f"{what}: arming is refused with the reason", refused.stderr)
        status = rig.status()
        checks.check(status["shaker"].get("state") == 0 and status["campaign"]["state"] == "idle",
                     f"{what}: it leaves the rig disarmed and at rest", r.state_of(status))
        checks.equal(rig.daemon.end(timeout=30), 0, f"{what}: vibrigd ends with status 0")
        rig.start_daemon()
        rig.wait_for(ready, 60)
        refused = rig.tool("arm", "--by", "Ada")
        checks.check(refused.returncode == 1 and "out of band" in refused.stderr and says in refused.stderr,
                     f"{what}: a restart changes nothing", refused.stderr + rig.logs())
    finally:
        rig.stop()


def each_frequency(checks, programs, folder, what, says=None, change=None, plant=()):
    """Of a survey: every frequency of its plan is looked at, from rest."""
    plan = os.path.join(folder, "plan.json")
    with open(plan, "w", encoding="utf-8") as file:
        json.dump({"runs": [{"position": [0, 0, 0], "level_g": 3, "table_g": 3, "count": 1, "frequency_hz": hz}
                            for hz in (15.0, 65.1, 25.1, 65.1)]}, file)
    rig = make(checks, programs, folder, 40, {"isolator": {"hard": True, **(change or {})}},
               {"name": "survey", "plan": plan, "identify": "what-it-can", "dwell_s": 10.0},
               {"spectrum": {"mount": "hard"}}, plant)
    try:
        tested = rig.tool("selftest", "--by", "Ada", timeout=120)
        status = rig.status()
        rows = {row["name"]: row["value"] for row in status["proof"].get("rows", [])}
        refused = rig.tool("arm", "--by", "Ada")
        if says is None:
            checks.check(tested.returncode == 0, f"{what}: in band", tested.stdout + tested.stderr)
            # 5 s of samples with 1e-4 g of noise, 1e-3 g at the table: a per cent of 0.5 g is far beyond doubt.
            checks.check(all(abs(rows.get(f"{hz} Hz, transmission", 0) - 1) < 0.01 and
                             abs(rows.get(f"{hz} Hz, frequency", 0) - hz) < 0.01 for hz in (25.1, 65.1)),
                         f"{what}: transmission and frequency as the rig has them, at each frequency of the plan", rows)
            checks.check(status["shaker"].get("state") == 0, f"{what}: it ends at rest", r.state_of(status))
            checks.equal(refused.returncode, 0, f"{what}: the campaign can be armed")
            return
        checks.check(tested.returncode == 1, f"{what}: it is found", tested.stdout + tested.stderr)
        checks.check(refused.returncode == 1 and (says in refused.stderr + tested.stdout or rig.daemon.says(says)),
                     f"{what}: nothing is armed, and the frequency is named", tested.stdout + refused.stderr + rig.logs())
    finally:
        rig.stop()


def grown(checks, programs, folder, what, fault=None, row=None, says=()):
    """Motion in step and across that a rig had at its loop check, and what it has in its dwells."""
    plan = os.path.join(folder, "plan.json")
    with open(plan, "w", encoding="utf-8") as file:
        json.dump({"runs": [{"position": position, "level_g": 1, "table_g": 1, "count": 1, "frequency_hz": hz}
                            for hz, position in ((15.0, [0, 0, 0]), (25.1, [45, 0, 90]))]}, file)
    truth = {"isolator": {"hard": True, "cross_axis": [0.03, 0]}, "platform": {"rocking_arcsec_g": [0, 40, 0]}}
    rig = make(checks, programs, folder, 20, truth,
               {"name": "survey", "plan": plan, "identify": "what-it-can", "dwell_s": 20.0}, {"spectrum": {"mount": "hard"}})
    try:
        tested = rig.tool("selftest", "--by", "Ada", timeout=120)
        checks.equal(tested.returncode, 0, f"{what}: in band")
        rows = {row["name"]: row["value"] for row in rig.status()["proof"].get("rows", [])}
        # 5 s of encoders with 5 arcsec at 0.5 g: 1.2 arcsec/g for each of six parts
        checks.check(abs(rows.get("motion in step", 0) - 40) < 6 and abs(rows.get("25.1 Hz, motion in step", 0) - 40) < 6 and
                     abs(rows.get("25.1 Hz, cross-axis share", 0) - 0.03) < 1e-3,
                     f"{what}: motion in step and across as the rig has them, at each frequency", rows)
        if fault:
            rig.order(f"fault {fault}")
        checks.equal(rig.tool("arm", "--by", "Ada").returncode, 0, f"{what}: it is armed")
        rig.tool("start", "--by", "Ada")
        raised, present = [set(), set()], {"motion_in_step": [], "cross_axis_growth": []}

        def ended(status):
            recording = status["campaign"]["state"] == "recording"
            for one in status["interlock"]["rows"]:
                if one.get("raised"):
                    raised[recording].add(one["name"])
                if one["name"] in present and "present" in one:
                    present[one["name"]].append(one["present"])
            return status["campaign"]["state"] in ("finished", "aborted", "tripped")

        rig.poll_s = 0.01
        status = rig.wait_for(ended, 90)
        checks.check(status is not None and status["campaign"]["state"] == "finished", f"{what}: the campaign goes on to its end",
                     r.state_of(status) + rig.logs())
        seen = {name for name in raised[1] if name in ("motion_in_step", "cross_axis_growth")}
        checks.equal(seen, {row} if row else set(), f"{what}: raised while it records")
        checks.check(all(times and (max(times) < 3) == (name != row) for name, times in present.items()),
                     f"{what}: how many times it is shows in the status", present)
        if row is None:
            checks.check("as at the loop check" not in rig.daemon.text(), f"{what}: nothing is said", rig.logs())
            return
        checks.check(rig.daemon.says(says[0]) and all(rig.daemon.says(word) for word in says) and
                     rig.daemon.text().count("as at the loop check") == 1, f"{what}: said once, with its frequency and values",
                     rig.logs())
        checks.check(rig.daemon.says(f"{row}: over"), f"{what}: over with the dwell", rig.logs())
        end, logged = time.monotonic() + 20, []   # it is written after it is said
        while not logged and time.monotonic() < end:
            time.sleep(0.2)
            with sqlite3.connect(f"file:{rig.results}/journal.sqlite3?mode=ro", uri=True) as database:
                logged = [text for text, in database.execute("SELECT text FROM event WHERE text LIKE '%as at the loop check%'")]
        checks.check(len(logged) == 1 and logged[0].startswith("at 25.1 Hz"), f"{what}: the journal has it", logged)
    finally:
        rig.stop()


def main():
    programs = r.programs_from_command_line(__doc__)
    checks = r.Checks()
    with tempfile.TemporaryDirectory() as folder:
        in_band(checks, programs, folder)
    for what, change, says in (("a distorted table", {"shaker": {"second_harmonic": 0.3}}, "distortion"),
                               ("soft isolators", {"isolator": {"transmission": 0.5}}, "transmission")):
        with tempfile.TemporaryDirectory() as folder:
            out_of_band(checks, programs, folder, what, change, says)
    for what, says, plant in (("frequencies of a plan", None, ()),
                              ("frequency_ignored", "at 25.1 Hz frequency", ("--fault", "frequency-ignored")),
                              ("distorted at one", "at 25.1 Hz distortion", ("--fault", "distorted=0.2,25.1"))):
        with tempfile.TemporaryDirectory() as folder:
            each_frequency(checks, programs, folder, what, says, plant=plant)
    with tempfile.TemporaryDirectory() as folder:
        each_frequency(checks, programs, folder, "across at one", "at 65.1 Hz cross-axis share", {"cross_axis": [0.05, 0]},
                       ("--fault", "cross-growth=4,65.1"))
    for what, fault, row, says in (
            ("honest", None, None, ()),
            ("sync_growth", "sync-growth=4,25.1", "motion_in_step",
             ("at 25.1 Hz the platform moves in step", " gimbal most", "expected ", "limit ")),
            ("cross_growth", "cross-growth=4,25.1", "cross_axis_growth", ("at 25.1 Hz 0.12", "goes across it, expected 0.03"))):
        with tempfile.TemporaryDirectory() as folder:
            grown(checks, programs, folder, what, fault, row, says)
    return checks.end()


if __name__ == "__main__":
    sys.exit(main())
