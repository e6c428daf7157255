#!/usr/bin/python3
"""Random dwells whose PSD the shaker's controller tells after each of them: read at rest, recorded, in the fit; the same killed and resumed,
and identified from the recording. And controllers that tell nonsense, the same each time, too much, or nothing. Over the seqpacket bus, on
the rig's clock.

usage: psd_campaign.py PROGRAMS
"""
import json
import os
import sys
import tempfile

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import random_campaign as random  # noqa: E402
import restart_campaign as again  # noqa: E402
import rig as r  # noqa: E402
import survey_campaign  # noqa: E402

BLOCK = {"psd_block": {"address": 16, "pairs": 200}}
REPORTED = {"spectrum": {"controller_psd": "registers"}, "registers": BLOCK}
# Elastic at 60 Hz: it matters where the power lies. 3 dB more with each octave take half of the profile's power there.
TRUTH = {**random.TRUTH, "elastic": {"share": [0.5] * 3, "resonance_hz": [60.0] * 3, "damping": [0.05] * 3}}
TILTED = ("--fault", "profile-tilted=3")
REFUSED = "the controller's PSD contradicts itself or the dwell: dwell rejected"
UNREAD = "the controller's PSD could not be read: its profile's stands in its place"


def under(result):
    return [row for row in result.get("dwell_rates", []) if row.get("profile") == "broad"]


def same_again(checks, programs, path, result, what):
    identified = survey_campaign.vibrig(programs, "identify", path, "--json")
    same = json.loads(identified.stdout) if identified.stdout else {}
    checks.equal(([p["value"] for p in same.get("parameters", [])], under(same), (same.get("spectrum") or {}).get("groups"),
                  (same.get("spectrum") or {}).get("log_odds"), (same.get("spectrum") or {}).get("held_out")),
                 ([p["value"] for p in result["parameters"]], under(result), result["spectrum"].get("groups"),
                  result["spectrum"].get("log_odds"), result["spectrum"].get("held_out")),
                 f"{what}: identify over the recording gives the live result to the last bit")


def honest(checks, programs, folder):
    rig = r.Rig(programs, "seqpacket", "rig", folder)
    try:
        count, commands = random.start(rig, random.plan_of(folder, len(random.POSITIONS)), 60.0, *TILTED, truth=TRUTH, **REPORTED)
        last = rig.wait_for_state(random.ENDS, random.WALL_S)
        _, text = rig.result()
        if not checks.check(last and last["campaign"]["state"] == "finished" and text, "with what is played reported, it runs to the end",
                            f"{r.state_of(last)} {[c.stderr for c in commands]}\n{rig.daemon.text()[-4000:]}"):
            return
        dwells, log = last["campaign"]["dwells"], rig.daemon.text()
    finally:
        rig.stop()
    checks.equal((len(dwells), [d for d in dwells if d.get("flagged")]), (count, []), "all dwells are taken, none is flagged")
    checks.check("the controller's PSD" not in log, "no PSD is refused or missed", log[-2000:])
    result = json.loads(text)
    checks.equal(len(under(result)), len(random.POSITIONS), "the fit has the random dwells, but for those held out")
    recorded = survey_campaign.recording(rig)
    same_again(checks, programs, recorded, result, "live")
    replayed = survey_campaign.vibrig(programs, "replay", recorded, "--speed", "max")
    checks.check("as recorded, to the last bit" in replayed.stdout + replayed.stderr, "it replays to the last bit", replayed.stdout + replayed.stderr)
    survey_campaign.replayed_again(checks, programs, rig, result)
    held = [row for row in result["spectrum"]["held_out"] if row["profile"] == "broad"]
    # Six rates; four sigma once in 2600 such tests.
    checks.check(len(held) == len(random.HELD_OUT) and all(abs(z) < 4 for row in held for z in row["z"]),
                 "what was held out is as predicted", [row["z"] for row in held])


def resumed(checks, programs, folder):
    rig = r.Rig(programs, "seqpacket", "rig", folder, poll_s=0.05)
    sines = 2
    try:
        count, _ = random.start(rig, random.plan_of(folder, sines), 40.0, "--speed", "20", *TILTED, truth=TRUTH, **REPORTED)
        status = rig.wait_for(lambda s: len(s["campaign"]["dwells"]) >= sines + 2 and s["campaign"]["state"] == "recording", 120)
        if not checks.check(status is not None and status["campaign"]["state"] == "recording", "killed: in a random dwell",
                            f"{r.state_of(status)}\n{rig.logs()}"):
            return
        again.take_up(checks, rig, "killed", count)
        last = rig.wait_for_state(random.ENDS, 240)
        _, text = rig.result()
        if not checks.check(last and last["campaign"]["state"] == "finished" and text, "resumed, it finishes",
                            f"{r.state_of(last)}\n{rig.logs()}"):
            return
        dwells = last["campaign"]["dwells"]
    finally:
        rig.stop()
    checks.equal((len(dwells), [d for d in dwells if d.get("flagged")]), (count, []), "each dwell is there once, none is flagged")
    same_again(checks, programs, os.path.dirname(survey_campaign.recording(rig)), json.loads(text), "resumed")


def lies(checks, programs, folder, fault, expected, says):
    """What a dwell is of which the controller lies: `expected` of the random ones, in their order."""
    rig = r.Rig(programs, "seqpacket", "rig", folder)
    name = fault.split("=", maxsplit=1)[0].replace("-", "_")
    try:
        random.start(rig, random.plan_of(folder, 2), 20.0, "--fault", fault, **REPORTED)
        last = rig.wait_for_state(random.ENDS, 240)
        log = rig.daemon.text()
        reasons = [d["reason"] for d in (last or {"campaign": {"dwells": []}})["campaign"]["dwells"]][2:]
        checks.equal(reasons[:len(expected)], expected, f"{name}: the dwells say so {r.state_of(last)}")
        checks.check(rig.daemon.says(says), f"{name}: what is wrong is reported, and where", log[-3000:])
        checks.check("stop of the shaker" not in log, f"{name}: nothing trips of it", log[-3000:])
    finally:
        rig.stop()


def main():
    programs = r.programs_from_command_line(__doc__)
    checks = r.Checks()
    with tempfile.TemporaryDirectory() as folder:
        honest(checks, programs, folder)
    with tempfile.TemporaryDirectory() as folder:
        resumed(checks, programs, folder)
    for fault, expected, says in (
            ("psd-nan", [REFUSED] * 2, "g^2/Hz at"),
            ("psd-stale", ["", REFUSED], "to the last bit what it was after the random dwell before"),
            ("psd-scaled=1.5", [REFUSED] * 2, "of measured_g_rms within"),
            ("psd-refused", [UNREAD] * 8, "exception")):
        with tempfile.TemporaryDirectory() as folder:
            lies(checks, programs, folder, fault, expected, says)
    return checks.end()


if __name__ == "__main__":
    sys.exit(main())
