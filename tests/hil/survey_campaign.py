#!/usr/bin/python3
"""A survey over frequency, unattended: planned by vibrig plan, run by vibrigd over the seqpacket bus on the rig's clock, and its
prediction held against dwells that were not in the fit. And a controller that ignores a new frequency.

usage: survey_campaign.py PROGRAMS [--soak]
"""
import json
import os
import re
import subprocess
import sys
import tempfile

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import loop_check  # noqa: E402
import rig as r  # noqa: E402

# Half elastic, a resonance within the plan.
TRUTH = {**r.QUICK, "isolator": {"hard": True},
         "elastic": {"share": [0.5, 0.5, 0.5], "resonance_hz": [60.0, 60.0, 60.0], "damping": [0.05, 0.05, 0.05]}}
HELD_OUT = [[30.0, 10.0, -20.0], [-50.0, 0.0, 70.0], [100.0, 15.0, 30.0], [20.0, 0.0, 130.0]]
HELD_HZ, HELD_G = 55.1, 3.0
ENDS = ("finished", "aborted", "tripped")
WALL_S = 1800   # a quiet machine takes a tenth of it


def vibrig(programs, *arguments):
    return subprocess.run([os.path.join(programs, "vibrig"), *arguments], stdin=subprocess.DEVNULL, capture_output=True,
                          text=True, timeout=300)


def make_plan(programs, folder):
    """Of 63 dwells, and some between them to try the result on."""
    plan = os.path.join(folder, "plan.json")
    made = vibrig(programs, "plan", "--frequencies", "15,25,35", "--highest", "125", "--mount", "hard", "-o", plan)
    with open(plan, encoding="utf-8") as file:
        root = json.load(file)
    surveyed = len(root["runs"])
    for i, position in enumerate(HELD_OUT):
        root["runs"].insert((i + 1) * surveyed // len(HELD_OUT) + i,
                            {"position": position, "level_g": HELD_G, "table_g": HELD_G, "count": 1,
                             "frequency_hz": HELD_HZ, "role": "verify"})
    with open(plan, "w", encoding="utf-8") as file:
        json.dump(root, file)
    return made.returncode, plan, surveyed, {run.get("frequency_hz", 0) for run in root["runs"]}


def start(rig, plan, dwell_s, checked, *plant):
    """`checked`: after a loop check, so that each dwell is held against it."""
    rig.start_plant("--seed", "3", "--truth", rig.truth_file(TRUTH), *plant)
    rig.configure({"name": "survey", "plan": plan, "dwell_s": dwell_s, "temperature_window_s": 5.0},
                  spectrum={"mount": "hard"})
    rig.start_daemon()
    rig.wait_for(loop_check.ready, 60)
    return [rig.tool(command, "--by", "tester", timeout=120)
            for command in ((("selftest",) if checked else ()) + ("arm", "start"))]


def recording(rig):
    """The campaign's HDF5 file."""
    return next(os.path.join(at, name) for at, _, names in os.walk(rig.results) for name in names if name.endswith(".h5"))


def survey(checks, programs, folder, dwell_s):
    status, plan, surveyed, frequencies = make_plan(programs, folder)
    checks.equal((status, surveyed), (0, 63), "a survey of 63 dwells is planned")
    rig = r.Rig(programs, "seqpacket", "rig", folder)
    try:
        commands = start(rig, plan, dwell_s, True)
        last = rig.wait_for_state(ENDS, WALL_S)
        path, text = rig.result()
        if not checks.check(last and last["campaign"]["state"] == "finished" and text,
                            "the survey runs from arming to its end with nobody there",
                            f"{r.state_of(last)} {[c.stderr for c in commands]}\n{rig.daemon.text()[-4000:]}"):
            return
        result, dwells = json.loads(text), last["campaign"]["dwells"]
        checks.equal([d for d in dwells if d.get("flagged")], [], "no dwell is flagged")
        log = rig.daemon.text()
    finally:
        rig.stop()
    judge(checks, programs, rig, result, path, log, len(dwells), frequencies)
    replayed_again(checks, programs, rig, result)
    identified_again(checks, programs, rig, result)


def judge(checks, programs, rig, result, path, log, dwells, frequencies):
    spectrum = result.get("spectrum") or {}
    checks.equal((len(result.get("dwell_rates", [])), dwells), (63, 63 + len(HELD_OUT)),
                 "the fit rests on the 63 dwells, and not on those held out")
    checks.equal({f["hz"] for f in spectrum.get("frequencies", [])}, frequencies - {0, HELD_HZ},
                 "the result has coefficients at each frequency")
    found = spectrum.get("resonance") or []
    checks.check(spectrum.get("model") == "resonance" and len(found) == 3 and
                 all(odds > 4 and abs(gyro["hz"] - 60) < 2 for odds, gyro in zip(spectrum["log_odds"], found)),
                 "the resonance of every gyro is named, within 2 Hz",
                 [spectrum.get(k) for k in ("model", "log_odds", "resonance")])
    checks.check(all(p["at_hz"] == 0 for p in result["parameters"] if p["unit"] == "deg/h/g^2"),
                 "the quadratic coefficients are static ones")
    checks.check("loop check in band" in log, "a loop check looked at each frequency", log[:2000])
    checks.check("as at the loop check" not in log and "motion_in_step" not in log and "cross_axis_growth" not in log,
                 "what goes in step with the vibration has grown in no dwell", log[-2000:])
    checks.check("stop of the shaker" not in log, "the shaker was never stopped on the way", log[-2000:])
    profile = os.path.join(rig.folder, "sine.json")
    with open(profile, "w", encoding="utf-8") as file:
        json.dump({"name": "held out", "sines": [[HELD_HZ, HELD_G]]}, file)
    recorded = recording(rig)
    proof = vibrig(programs, "predict", path, "--profile", profile, "--verify", recorded, "--json")
    verification = (json.loads(proof.stdout) if proof.stdout else {}).get("prediction", {}).get("verification") or {}
    checks.check(proof.returncode == 0 and verification.get("word", "").startswith("confirmed") and
                 len(verification.get("dwells", [])) == len(HELD_OUT),
                 "the prediction at 55 Hz is confirmed on the dwells held out", proof.stdout + proof.stderr)
    shown = [(round(z, 6) for z in d["z"]) for d in spectrum.get("held_out", [])]
    checks.equal([list(z) for z in shown], [[round(z, 6) for z in d["z"]] for d in verification.get("dwells", [])],
                 "the result has them beside what was predicted")
    page = os.path.join(rig.folder, "report.html")
    made = vibrig(programs, "report", recorded, "-o", page)
    checks.check(made.returncode == 0 and "Dwells held out from the fit" in open(page, encoding="utf-8").read(),
                 "and so has the report", made.stderr)
    whoever_reads_it(checks, programs, rig, result, page)
    # The same coefficients without their elastic part are contradicted: the proof can fail.
    flat = vibrig(programs, "identify", recorded, "--spectrum", "flat", "--json")
    flat_path = os.path.join(rig.folder, "flat.json")
    with open(flat_path, "w", encoding="utf-8") as file:
        file.write(flat.stdout)
    proof = vibrig(programs, "predict", flat_path, "--profile", profile, "--verify", recorded, "--json", "--force")
    checks.check(proof.returncode == 1 and '"contradicted"' in proof.stdout, "without the elastic part it is contradicted",
                 proof.stdout + proof.stderr)


def whoever_reads_it(checks, programs, rig, result, page):
    """Report, compensation and studies have the result over frequency, not that of the first frequency."""
    recorded = recording(rig)
    with open(page, encoding="utf-8") as file:
        text = file.read()
    checks.equal([p["name"] for p in result["parameters"] if f"<td>{p['value']:.6f}</td><td>{p['expanded']:.6f}</td>" not in text], [],
                 "the report has each value with its U")
    checks.check("Of the dwells at rest and at 15 Hz alone" in text, "and says of which dwells the filter's are", text[:500])
    section = text[text.index('id="coefficients"'):]
    cells = [re.findall("<td[^>]*>([^<]*)</td>", row) for row in re.findall("<tr>(.*?)</tr>", section[:section.index("</table>")])]
    found = [float(row[7]) for row in cells if len(row) == 9]
    # What the bound of those dwells allows, the filter reaches; of all dwells it would be smaller.
    checks.check(len(found) == 30 and all(0.97 < efficiency < 1.03 for efficiency in found), "whose bound the filter reaches", str(found))
    run = vibrig(programs, "compensate", recorded, "--json")
    said = json.loads(run.stdout) if run.stdout else {}
    checks.equal([[c["value"], c["sigma"]] for c in said.get("coefficients", [])], [[p["value"], p["u"]] for p in result["parameters"]],
                 "a compensation has the same coefficients")
    checks.check("gyro z static" in (said.get("frequencies") or ""), "and says that they are static", run.stdout[-300:])
    run = vibrig(programs, "compensate", recorded, "--platform-g", "3")
    checks.check(run.returncode == 2 and "depend on the frequency" in run.stderr, "they do not foretell a vibration", run.stdout + run.stderr)
    run = vibrig(programs, "uncertainty", recorded, "--monte-carlo")
    checks.check(run.returncode == 2 and "at several frequencies" in run.stderr and not run.stdout, "nothing is drawn of them", run.stderr)
    study = os.path.join(rig.folder, "again.toml")
    with open(study, "w", encoding="utf-8") as file:
        file.write(f'[study]\nname = "again"\nkind = "recordings"\nfolders = ["{os.path.relpath(rig.results, rig.folder)}"]\n')
    shards = os.path.join(rig.folder, "again")
    for command in (("plan", study, "-o", shards), ("run", shards), ("merge", shards, "--json")):
        run = vibrig(programs, "study", *command)
    found = (json.loads(run.stdout) if run.stdout else {}).get("recordings", [{}])[0]
    old, new = found.get("old", {}), found.get("new", {})
    # Of another instruction set: rounding.
    checks.check(len(old.get("u", [])) == 30 and all(abs(a - b) < 1e-6 * u for a, b, u in zip(old["value"], new["value"], old["u"])) and
                 all(abs(b / a - 1) < 1e-6 for a, b in zip(old["expanded"], new["expanded"])),
                 "a study of recordings identifies it as it was", run.stdout[:3000] + run.stderr)


def replayed_again(checks, programs, rig, result):
    """The whole of the result, from the samples and from the frames alone."""
    recorded = recording(rig)
    for what, files in (("the recording", [recorded]), ("its frames", r.raw_logs(os.path.dirname(recorded)))):
        again = vibrig(programs, "replay", *files, "--json")
        same = json.loads(again.stdout) if again.stdout else {}
        no = result["verdict"]["word"] == "not valid"
        checks.check(again.returncode == no and all(same.get(key) == result[key] for key in ("parameters", "spectrum", "verdict")),
                     f"a replay of {what} gives the result over frequency to the last bit",
                     f"{again.stderr[-500:]} {[key for key in result if same.get(key) != result[key]]}")


def identified_again(checks, programs, rig, result):
    recorded = recording(rig)
    again = vibrig(programs, "identify", recorded, "--json")
    same = json.loads(again.stdout) if again.stdout else {}
    checks.equal(again.returncode, 0, "identify over the recording has no doubts about the rig")
    checks.equal([p["value"] for p in same.get("parameters", [])], [p["value"] for p in result["parameters"]],
                 "identify over the recording gives the live result to the last bit")


def ignored(checks, programs, folder):
    """The controller takes and reads back another frequency, and the table keeps the old one."""
    _, plan, _, _ = make_plan(programs, folder)
    rig = r.Rig(programs, "seqpacket", "rig", folder)
    try:
        start(rig, plan, 20.0, False, "--fault", "frequency-ignored")
        last = rig.wait_for_state(ENDS, 180)
        rows = [d for d in last["campaign"]["dwells"] if d["used"] > 0] if last else []
        checks.check(last and last["campaign"]["state"] == "tripped" and
                     "the accelerometers do not show the vibration" in last["campaign"]["reason"],
                     "frequency_ignored: the daemon trips by wrong_vibration", f"{r.state_of(last)}\n{rig.daemon.text()[-3000:]}")
        checks.equal(rows, [], "frequency_ignored: not a sample is taken at the wrong frequency")
        checks.check(rig.daemon.says("Hz were asked for and read back"), "frequency_ignored: both frequencies are reported",
                     rig.daemon.text()[-2000:])
    finally:
        rig.stop()


def main():
    programs = r.programs_from_command_line(__doc__)
    dwell_s = 100.0 if "--soak" in sys.argv else 20.0
    checks = r.Checks()
    with tempfile.TemporaryDirectory() as folder:
        survey(checks, programs, folder, dwell_s)
    with tempfile.TemporaryDirectory() as folder:
        ignored(checks, programs, folder)
    return checks.end()


if __name__ == "__main__":
    sys.exit(main())
