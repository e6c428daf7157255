#!/usr/bin/python3
"""The opening check alone, vibrig selftest --rest: on the seqpacket bus and the rig's clock. A right configuration passes, a wrong key is
among the suspects, and where the tool or the daemon is killed nothing goes on.

usage: rest_check.py PROGRAMS
"""
import json
import os
import signal
import sys
import tempfile

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import rig as r  # noqa: E402

CAMPAIGN = {"name": "rest", "identify": "what-it-can", "positions_deg": [[0, 0, 0]], "table_g": [2.0], "dwell_s": 10.0}


def start(rig, **tables):
    rig.configure(CAMPAIGN, **tables)
    rig.start_daemon()
    return rig.wait_for(lambda s: r.measuring(s) and s["platform"].get("ready") and s["shaker"].get("rest") == "at rest", 60)


def rest(rig, *more):
    return rig.tool("selftest", "--rest", "--by", "Ada", *more, timeout=300)


def unwrapped(text):
    return text.replace("\n   ", " ")


def in_background(rig):
    child = r.Child("rest", [rig.program("vibrig"), "selftest", "--rest", "--by", "Ada", "--socket", rig.socket], rig.folder)
    begun = rig.wait_for(lambda s: "opening check, position 2 of 5" in s["campaign"].get("reason", ""), 60)
    return child, begun["campaign"]["state"] == "checking" and child.running()


def nothing_slews(rig):
    """For a minute of the rig's time no gimbal is commanded anywhere."""
    first = rig.wait_for(lambda s: s["campaign"]["state"] != "checking" and s["platform"].get("slewing") is False, 60)
    rig.order("speed max")
    slews = []
    last = rig.wait_for(lambda s: slews.append(s["platform"].get("slewing")) or s["sample"]["time_s"] > first["sample"]["time_s"] + 60, 60)
    return first["campaign"]["state"] != "checking" and True not in slews and \
        first["platform"]["gimbal_command_echo"] == last["platform"]["gimbal_command_echo"]


def right_and_wrong(checks, rig):
    start(rig)
    good = rest(rig)
    checks.check(good.returncode == 0 and "the rig is what its configuration says" in good.stdout and "SIMULATED: " in good.stdout and
                 "opening check, position " in good.stdout, "a right configuration: exit code 0", good.stdout + good.stderr + rig.logs())
    found = json.loads(rest(rig, "--json").stdout or "{}")
    checks.check(found.get("outcome") == "right" and found["suspects"] == [] and found["simulated"] is True and found["by"].startswith("Ada"),
                 "and as JSON", found)
    status = rig.status()
    checks.check(status["campaign"]["state"] == "idle" and status["shaker"]["state"] == 0 and status["rest_check"]["verdict"] == "right" and
                 status["loop_check"]["verdict"] == "none" and status["proof"]["by"] == "", "it is no loop check and no proof", status["rest_check"])
    rig.tool("arm", "--by", "Ada")
    refused = rest(rig)
    checks.check(refused.returncode == 1 and "armed for a campaign: abort that first" in refused.stderr, "not while it is armed", refused.stderr)
    rig.tool("abort", "--by", "Ada")
    for bad in (("--at-zero",), ("--emergency-stop",), ("--host", "rig.lab")):
        usage = rest(rig, *bad)
        checks.equal(usage.returncode, 2, f"bad usage with {bad[0]}: {usage.stderr.strip()[:80]}")
    alone = rig.tool("abort", "--by", "Ada")   # at rest, and heard
    checks.equal(alone.returncode, 0, "an abort is taken at any time")
    rig.daemon.end()
    gone = rest(rig)
    checks.check(gone.returncode == 2 and gone.stdout == "", "without a daemon: exit code 2", gone.stdout + gone.stderr)
    start(rig, platform={"encoder_sign": [1, -1, 1]})
    wrong = rest(rig)
    text = unwrapped(wrong.stdout)
    checks.check(wrong.returncode == 1 and "REFUSED: " in text and "suspect: platform.encoder_sign: 1 instead of -1 of the inner" in text,
                 "a wrong sign: exit code 1, the key among the suspects", wrong.stdout + wrong.stderr + rig.logs())
    found = json.loads(rest(rig, "--json").stdout or "{}")
    checks.check(found.get("outcome") == "refused" and len(found["suspects"]) <= 3 and
                 any(s.startswith("platform.encoder_sign") for s in found["suspects"]), "and as JSON", found)
    checks.check(rig.daemon.says("suspects: ") and rig.status()["shaker"]["state"] == 0, "it is an event, and nothing has shaken", rig.logs())
    rig.daemon.end()


def killed(checks, rig):
    rig.order("speed 4")   # time enough to see who is gone
    start(rig)
    child, begun = in_background(rig)
    other = rig.tool("selftest", "--rest", "--by", "Bo")
    checks.check(begun and other.returncode == 1 and "an opening check is running" in other.stderr, "one at a time", other.stderr + rig.logs())
    child.end(signal.SIGKILL)
    checks.check(rig.daemon.says("nobody has been at the tool of Ada") and nothing_slews(rig), "the tool killed: it ends, and nothing moves", rig.logs())
    checks.check(rig.status()["rest_check"]["verdict"] == "not completed", "and it says so", rig.status()["rest_check"])
    rig.order("speed 4")
    child, begun = in_background(rig)
    rig.daemon.end(signal.SIGKILL)
    code = child.process.wait(20)
    checks.check(begun and code == 2, f"the daemon killed: exit code {code}", child.text())
    start(rig)
    checks.check(nothing_slews(rig) and r.state_of(rig.status()) == "idle" and rig.status()["rest_check"]["verdict"] == "none",
                 "the next one does not go on with it", rig.logs())
    again = rest(rig)
    checks.equal(again.returncode, 0, "and makes it anew")


def main():
    programs = r.programs_from_command_line(__doc__)
    checks = r.Checks()
    with tempfile.TemporaryDirectory() as folder:
        rig = r.Rig(programs, "seqpacket", "rig", folder, poll_s=0.1)
        try:
            rig.start_plant("--seed", "4", "--warm-up", "1", "--start-temperature", "45", "--speed", "max")
            right_and_wrong(checks, rig)
            killed(checks, rig)
        finally:
            rig.stop()
    return checks.end()


if __name__ == "__main__":
    sys.exit(main())
