#!/usr/bin/python3
"""Unmodified programs on a real vcan0 in virtual time: the full campaign, then a shorter one twice.

usage: virtual_time_campaign.py PROGRAMS [--only full|twice]        inside run-in-uml -T
"""
import json
import os
import subprocess
import sys
import tempfile
import time

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import rig as r  # noqa: E402

FULL = {"name": "full"}   # 14 positions, 9 g and 7 g at the table, 100 s each: the defaults
SHORT = {"name": "short", "positions_deg": [[0, 0, 0], [45, 0, 90], [270, 0, 0]], "table_g": [9.0, 7.0],
         "dwell_s": 20.0, "temperature_window_s": 5.0}


def run_campaign(checks, programs, folder, campaign, seed, limit_s, text):
    """result.json's path and bytes of a campaign that finished."""
    os.makedirs(folder)
    rig = r.Rig(programs, "vcan0", "real", folder, poll_s=10)   # each look is an event, and events are what costs
    begin = time.monotonic()
    try:
        rig.start_plant("--seed", str(seed))
        rig.configure(campaign)
        rig.start_daemon()
        rig.wait_for(lambda s: s["can"]["link"] == "running" and s["shaker"]["link"] == "running", 60)
        commands = [rig.tool(command, "--by", "tester") for command in ("arm", "start")]
        last = rig.wait_for_state(("finished", "aborted", "tripped"), limit_s)
        finished = checks.check(last is not None and last["campaign"]["state"] == "finished", f"{text} finishes",
                                f"{r.state_of(last)} {[c.stderr for c in commands]}\n{rig.logs()}")
        checks.note(f"{text}: {time.monotonic() - begin:.0f} s of virtual time")
        if not finished:
            return None, b""
        checks.equal(r.number(last["can"]["kernel_dropped"]) + r.number(last["estimator_ring"]["dropped"]), 0,
                     f"{text} loses no frame and no sample")
        checks.equal(r.number(last["assembler"]["gaps"]) + r.number(last["assembler"]["incomplete"]), 0,
                     f"{text} has no incomplete sample")
        checks.equal(rig.daemon.end(), 0, f"{text}: vibrigd ends cleanly")
        return rig.result()
    finally:
        rig.stop()


def full(checks, programs, folder):
    path, text = run_campaign(checks, programs, os.path.join(folder, "full"), FULL, 1, 20000, "2 x 14 x 100 s")
    if path is None:
        return
    judged = subprocess.run([os.path.join(programs, "vibrig-plant"), "judge", path], capture_output=True, text=True)
    checks.note(judged.stdout)
    checks.check(judged.returncode == 0, "all 30 coefficients lie within 4 sigma of the truth", judged.stderr)
    checks.check(2400 * 40 < json.loads(text)["samples"], "all dwells were used", json.loads(text).get("samples"))


def twice(checks, programs, folder):
    results = [run_campaign(checks, programs, os.path.join(folder, name), SHORT, 2, 4000, f"a short campaign, {name}")[1]
               for name in ("once", "again")]
    checks.check(results[0] and results[0] == results[1], "both give byte-equal estimates",
                 f"{len(results[0])} and {len(results[1])} bytes")


def main():
    programs = r.programs_from_command_line(__doc__)
    checks = r.Checks()
    parts = {"full": full, "twice": twice}
    if "--only" in sys.argv:
        parts = {sys.argv[-1]: parts[sys.argv[-1]]}
    with tempfile.TemporaryDirectory() as folder:
        for part in parts.values():
            part(checks, programs, folder)
    return checks.end()


if __name__ == "__main__":
    sys.exit(main())
