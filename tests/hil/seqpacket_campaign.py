#!/usr/bin/python3
"""Campaigns over the seqpacket bus on the rig's clock, with programs built under a sanitizer.

usage: seqpacket_campaign.py PROGRAMS [--tool FOLDER]      where vibrig is, if not there
"""
import json
import os
import signal
import sys
import tempfile

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import rig as r  # noqa: E402

SHORT = {"name": "sanitized", "identify": "what-it-can",
         "positions_deg": [[0, 0, 0], [45, 0, 90]], "table_g": [9.0, 7.0], "dwell_s": 10.0}


def campaign(checks, programs, folder):
    """A whole one, and the ends of both programs."""
    rig = r.Rig(programs, "seqpacket", "rig", folder)
    try:
        commands = start(rig)
        last = rig.wait_for_state(("finished", "aborted", "tripped"), 300)
        checks.check(last is not None and last["campaign"]["state"] == "finished", "the campaign finishes",
                     f"{r.state_of(last)} {[c.stderr for c in commands]}\n{rig.logs()}")
        r.check_balances(checks, rig)
        answer = rig.tool("status", "--json")
        checks.equal(sorted(json.loads(answer.stdout or "{}")), sorted(rig.status() or {"no": "answer"}),
                     "vibrig status --json has what the daemon's own interface has")
        path, _ = rig.result()
        checks.check(path is not None, "there is a result.json")
        checks.equal(rig.daemon.end(signal.SIGTERM, timeout=30), 0, "SIGTERM ends vibrigd with status 0")
        checks.equal(rig.plant.end(signal.SIGTERM, timeout=30), 0, "SIGTERM ends vibrig-plant with status 0")
        for child in (rig.daemon, rig.plant):
            checks.check(not r.SANITIZER.search(child.text()), f"the sanitizer has nothing on {child.name}",
                         child.text()[-4000:])
    finally:
        rig.stop()


def end_without_rig(checks, programs, folder):
    """The rig dies, its clock with it, at the moment the daemon is ordered to end while the table shakes."""
    rig = r.Rig(programs, "seqpacket", "rig", folder)
    try:
        start(rig, dwell_s=7200.0)   # still shaking when the rig dies, however fast its clock
        last = rig.wait_for_state(("recording",), 60)
        checks.check(last is not None and last["campaign"]["state"] == "recording", "another campaign records",
                     r.state_of(last))
        rig.plant.process.kill()
        checks.equal(rig.daemon.end(signal.SIGTERM, timeout=60), 1,
                     "SIGTERM ends vibrigd by itself with status 1 when the rig is dead: the stop was not read back")
        checks.check(rig.daemon.says("its watchdog stops it"), "and it says so", rig.logs())
        checks.check(not r.SANITIZER.search(rig.daemon.text()), "the sanitizer has nothing on that end",
                     rig.daemon.text()[-4000:])
    finally:
        rig.stop()


def start(rig, **other):
    if "--tool" in sys.argv:
        rig.tools = os.path.realpath(sys.argv[sys.argv.index("--tool") + 1])
    rig.start_plant("--seed", "3", "--truth", rig.truth_file(r.QUICK))
    rig.configure({**SHORT, **other})
    rig.start_daemon()
    rig.wait_for(r.measuring, 30)
    return [rig.tool(command, "--by", "tester") for command in ("arm", "start")]


def main():
    programs = r.programs_from_command_line(__doc__)
    checks = r.Checks()
    for part in (campaign, end_without_rig):
        with tempfile.TemporaryDirectory() as folder:
            part(checks, programs, folder)
    return checks.end()


if __name__ == "__main__":
    sys.exit(main())
