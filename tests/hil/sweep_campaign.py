#!/usr/bin/python3
"""Sweeps up and down beside dwells at 15 Hz, unattended, over the seqpacket bus on the rig's clock: chosen at rest, read back, followed,
recorded, and the resonance named by them. The same killed in the midst of a sweep, and resumed; aborted in one. And controllers that sweep
otherwise than commanded, or only say so.

usage: sweep_campaign.py PROGRAMS [--soak]     soak: sweeps of 300 s, and more kinds of lies
"""
import csv
import json
import os
import subprocess
import sys
import tempfile

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import restart_campaign as again  # noqa: E402
import rig as r  # noqa: E402
import survey_campaign  # noqa: E402

RESONANCE_HZ, RATE_HZ = 60.0, 200.0
TRUTH = {"isolator": {"hard": True}, "platform": {"sample_rate_hz": RATE_HZ, **r.QUICK["platform"]},
         "elastic": {"share": [0.5, 0.5, 0.5], "resonance_hz": [RESONANCE_HZ] * 3, "damping": [0.05] * 3}}
FROM_HZ, TO_HZ = 20.0, 95.0
SWEPT = [[0, 0, 0], [45, 0, 90], [90, 0, 180]]
STANDING = [[0, 0, 0], [0, 0, 45], [45, 0, 0], [45, 0, 90], [90, 0, 90], [90, 0, 180], [-45, 0, 0], [-45, 0, 90], [180, 0, 45],
            [270, 0, 0]]
REGISTERS = {"mode": {"address": 8}, "sweep_from": {"address": 11, "type": "u32", "scale": 0.001},
             "sweep_to": {"address": 13, "type": "u32", "scale": 0.001}, "sweep_rate": {"address": 15, "scale": 0.01},
             "actual_frequency": {"address": 10, "table": "input", "type": "u32", "scale": 0.001}}
ENDS = ("finished", "aborted", "tripped", "paused")
WALL_S = 1800   # a quiet machine takes a tenth of it


def plan_of(folder, swept, standing, sweep_s):
    runs = [{"position": position, "table_g": 6.0, "sweep": {"from_hz": ends[0], "to_hz": ends[1], "s": sweep_s}}
            for position in swept for ends in ((FROM_HZ, TO_HZ), (TO_HZ, FROM_HZ))]
    runs += [{"position": position, "table_g": g, "frequency_hz": 15.1 if g else 0} for g in (6.0, 0.0) for position in standing]
    path = os.path.join(folder, "plan.json")
    with open(path, "w", encoding="utf-8") as file:
        json.dump({"runs": runs}, file)
    return path, len(runs)


def vibrig_plan(checks, programs, folder, *arguments):
    """A plan file by `vibrig plan` for this rig, and how many of its runs sweep; vibrigd takes it."""
    configuration, positions = os.path.join(folder, "planned.toml"), os.path.join(folder, "positions.csv")
    registers = {f"shaker.registers.{role}": keys for role, keys in REGISTERS.items()}
    tables = {"spectrum": {"mount": "hard", "mode": "mixed"}, "can": {"sample_rate_hz": RATE_HZ},
              "vibration": {"frequency_hz": 15.1}, "commission": {"simulated": True}, **registers}
    with open(configuration, "w", encoding="utf-8") as file:
        file.write(r.toml(tables))
    with open(positions, "w", encoding="utf-8") as file:
        print("alpha_deg,beta_deg,gamma_deg", *(",".join(map(str, p)) for p in STANDING), sep="\n", file=file)
    path = os.path.join(folder, f"plan{len(os.listdir(folder))}.json")
    made = survey_campaign.vibrig(programs, "plan", *arguments, "--positions", positions, "--config", configuration, "-o", path)
    if not checks.equal((made.returncode, made.stderr), (0, ""), f"vibrig plan {arguments[0]} makes a plan"):
        return None, 0, 0, ""
    with open(configuration, "w", encoding="utf-8") as file:
        file.write(r.toml({"campaign": {"plan": path}, **tables}))
    checked = subprocess.run([os.path.join(programs, "vibrigd"), "--config", configuration, "--check"], capture_output=True,
                             text=True, timeout=120, check=False)
    checks.equal((checked.returncode, checked.stderr), (0, ""), f"vibrigd --check takes the plan of vibrig plan {arguments[0]}")
    with open(path, encoding="utf-8") as file:
        runs = [run for run in json.load(file)["runs"] for _ in range(run["count"])]
    return path, len(runs), sum("sweep" in run for run in runs), made.stdout


def about(checks, programs, folder, result):
    """Fixed frequencies about what the sweeps found."""
    path = os.path.join(folder, "found.json")
    with open(path, "w", encoding="utf-8") as file:
        json.dump(result, file)
    plan, *_, text = vibrig_plan(checks, programs, folder, "--about", path)
    if plan is None:
        return
    with open(plan, encoding="utf-8") as file:
        frequencies = {line["hz"]: line["dwells"] for line in json.load(file)["survey"]["frequencies"]}
    found = [gyro["hz"] for gyro in result["spectrum"]["resonance"]]
    # Damping 0.05: the two extremes of the in-phase response are at 56.9 and 62.9 Hz.
    checks.check(all(any(hz - 6 < f < hz for f in frequencies) and any(hz < f < hz + 6 for f in frequencies) for hz in found) and
                 all(dwells >= 6 for dwells in frequencies.values()),
                 "plan --about has frequencies on both sides of each resonance that the sweeps found", text)


def start(rig, planned, dwell_s, *plant):
    rig.start_plant("--seed", "3", "--truth", rig.truth_file(TRUTH), *plant)
    rig.configure({"name": "sweeps", "plan": planned[0], "dwell_s": dwell_s, "temperature_window_s": 5.0, "identify": "what-it-can"},
                  spectrum={"mount": "hard", "mode": "mixed"}, can={"sample_rate_hz": RATE_HZ}, vibration={"frequency_hz": 15.1},
                  **{f"shaker.registers.{role}": keys for role, keys in REGISTERS.items()})
    rig.start_daemon()
    rig.wait_for(r.measuring, 60)
    return [rig.tool(command, "--by", "tester") for command in ("arm", "start")]


def named(checks, result, count, what):
    spectrum = result.get("spectrum") or {}
    sweeps = spectrum.get("sweeps") or []
    checks.equal(len(sweeps), count, f"{what}: the result has the sweeps")
    checks.check(all(s["used"] > 0.7 * s["seconds"] for s in sweeps), f"{what}: most of their seconds are used", sweeps)
    found = spectrum.get("resonance") or []
    checks.check(spectrum.get("model") == "resonance" and len(found) == 3 and
                 all(odds > 4 for odds in spectrum.get("log_odds", [])),
                 f"{what}: with dwells at one frequency and sweeps the resonance of every gyro is named",
                 [spectrum.get(k) for k in ("model", "log_odds", "resonance")])
    # 0.1 Hz is what 300 s at 6 g know of one coefficient; the interval is 95 %.
    checks.check(all(abs(gyro["hz"] - RESONANCE_HZ) < 1 for gyro in found), f"{what}: within 1 Hz", [g["hz"] for g in found])


def honest(checks, programs, folder, sweep_s):
    rig = r.Rig(programs, "seqpacket", "rig", folder)
    try:
        planned = vibrig_plan(checks, programs, folder, "--sweeps", f"{FROM_HZ:g},{TO_HZ:g}", "--sweep-s", f"{sweep_s:g}",
                              "--frequencies", "15.1", "--order", "list")
        if planned[0] is None:
            return
        commands = start(rig, planned, 20.0)
        shown = rig.wait_for(lambda s: s["campaign"]["state"] == "recording", 120)
        last = rig.wait_for_state(ENDS, WALL_S)
        _, text = rig.result()
        if not checks.check(last and last["campaign"]["state"] == "finished" and text, "sweeps run unattended to the end",
                            f"{r.state_of(last)} {[c.stderr for c in commands]}\n{rig.daemon.text()[-4000:]}"):
            return
        dwells, log = last["campaign"]["dwells"], rig.daemon.text()
    finally:
        rig.stop()
    checks.equal((len(dwells), [d for d in dwells if d.get("flagged")]), (planned[1], []), "all dwells are taken, none is flagged")
    checks.check("stop of the shaker" not in log, "the shaker was never stopped on the way", log[-2000:])
    checks.check(f"sweep from {FROM_HZ:g} to {TO_HZ:g} Hz" in commands[0].stdout, "arming names the sweeps", commands[0].stdout)
    checks.equal((shown or {}).get("vibration", {}).get("kind"), "sweep", "the status says that it sweeps")
    result = json.loads(text)
    checks.equal((planned[2], len(result.get("dwell_rates", []))), (6, planned[1] - 6), "a sweep is no row of the fit")
    named(checks, result, planned[2], "live")
    about(checks, programs, folder, result)
    recorded(checks, programs, rig, result)


def recorded(checks, programs, rig, result):
    """The HDF5 file has the frequency, and gives the same; so does what is exported as CSV."""
    path = survey_campaign.recording(rig)
    identified = survey_campaign.vibrig(programs, "identify", path, "--json")
    same = json.loads(identified.stdout) if identified.stdout else {}
    checks.equal((same.get("spectrum") or {}).get("resonance"), result["spectrum"]["resonance"],
                 "identify over the recording gives the live result to the last bit")
    checks.equal([p["value"] for p in same.get("parameters", [])], [p["value"] for p in result["parameters"]],
                 "and so the coefficients")
    survey_campaign.replayed_again(checks, programs, rig, result)
    page = os.path.join(rig.folder, "report.html")
    made = survey_campaign.vibrig(programs, "report", path, "-o", page)
    checks.check(made.returncode == 0 and os.path.getsize(page) > 10000, "and has a report", made.stderr)
    out = os.path.join(rig.folder, "out.csv")
    exported = survey_campaign.vibrig(programs, "export", path, "--to", "csv", "-o", out)
    checks.equal(exported.returncode, 0, "it can be exported as CSV")
    with open(out, encoding="utf-8") as file:
        rows = [row for row in csv.DictReader(line for line in file if not line.startswith("#"))
                if row["run"] == "1" and row["position"] == "1"]
    hz = [float(row["frequency_hz"]) for row in rows]
    checks.check(hz and abs(hz[0] - FROM_HZ) < 0.5 and abs(hz[-1] - TO_HZ) < 0.5 and all(b >= a for a, b in zip(hz, hz[1:])),
                 "its frequency goes from one end to the other", (hz[:1], hz[-1:], len(hz)))
    configuration = os.path.join(rig.folder, "csv.toml")
    with open(configuration, "w", encoding="utf-8") as file:
        file.write('[vibration]\nfrequency_hz = 15.1\ntransmission = 1\n')
    again_csv = survey_campaign.vibrig(programs, "identify", out, "--config", configuration, "--json")
    spectrum = (json.loads(again_csv.stdout) if again_csv.stdout else {}).get("spectrum") or {}
    found = spectrum.get("resonance") or []
    checks.check(len(found) == 3 and all(abs(a["hz"] - b["hz"]) < 0.2 for a, b in zip(found, result["spectrum"]["resonance"])),
                 "identify over the CSV finds the same resonances", again_csv.stderr + str(found))


def resumed(checks, programs, folder):
    """Killed in the midst of the second sweep: the first is kept, the second is done again."""
    rig = r.Rig(programs, "seqpacket", "rig", folder, poll_s=0.05)
    standing = STANDING[:8]
    try:
        planned = plan_of(folder, SWEPT[:2], standing, 60.0)
        start(rig, planned, 20.0, "--speed", "20")
        def in_the_second(status):
            return len(status["campaign"]["dwells"]) >= 1 and status["campaign"]["state"] == "recording"
        status = rig.wait_for(in_the_second, 120)
        if not checks.check(status is not None and in_the_second(status), "killed: in the second sweep", f"{r.state_of(status)}\n{rig.logs()}"):
            return
        again.take_up(checks, rig, "killed in a sweep", planned[1])
        last = rig.wait_for_state(ENDS, 240)
        _, text = rig.result()
        if not checks.check(last and last["campaign"]["state"] == "finished" and text, "the campaign finishes",
                            f"{r.state_of(last)}\n{rig.logs()}"):
            return
    finally:
        rig.stop()
    result = json.loads(text)
    named(checks, result, 4, "resumed")
    identified = survey_campaign.vibrig(programs, "identify", os.path.dirname(survey_campaign.recording(rig)), "--json")
    same = json.loads(identified.stdout) if identified.stdout else {}
    checks.equal((same.get("spectrum") or {}).get("resonance"), result["spectrum"]["resonance"],
                 "identify over both parts of the recording gives the same to the last bit")


def aborted(checks, programs, folder):
    rig = r.Rig(programs, "seqpacket", "rig", folder)
    try:
        start(rig, plan_of(folder, SWEPT[:1], STANDING[:2], 60.0), 20.0, "--speed", "20")
        rig.wait_for(lambda s: s["campaign"]["state"] == "recording", 120)
        rig.tool("abort", "--by", "tester")
        last = rig.wait_for_state(("aborted", "tripped"), 60)
        rest = rig.wait_for(lambda s: s["shaker"]["measured_g"] == 0 and not s["shaker"]["running"], 60)
        checks.check(last and last["campaign"]["state"] == "aborted" and rest, "aborted in a sweep, the table comes to rest",
                     f"{r.state_of(last)}\n{rig.daemon.text()[-2000:]}")
        last = rig.wait_for(lambda s: s["campaign"]["dwells"], 20)   # closed a moment after the state has changed
        checks.equal([(d["used"], d["reason"]) for d in (last or rig.status())["campaign"]["dwells"]],
                     [(0, "a sweep that was cut short: not used")], "and the status says that the sweep is not used, and why")
    finally:
        rig.stop()


def lies(checks, programs, folder, name, faults, trip, says):
    rig = r.Rig(programs, "seqpacket", "rig", folder)
    try:
        start(rig, plan_of(folder, SWEPT[:1], STANDING[:2], 60.0), 20.0, *[word for fault in faults for word in ("--fault", fault)])
        last = rig.wait_for_state(ENDS, 180)
        log = rig.daemon.text()
        trips = {"wrong_vibration": "the accelerometers do not show the vibration",
                 "amplitude_witness": "an accelerometer disagrees with the commanded amplitude"}
        checks.check(last and last["campaign"]["state"] == "tripped" and trips[trip] in last["campaign"]["reason"],
                     f"{name}: the daemon trips by {trip}", f"{r.state_of(last)}\n{log[-3000:]}")
        checks.check(rig.daemon.says(says), f"{name}: what is wrong is reported", log[-3000:])
        _, text = rig.result()
        checks.equal(((json.loads(text) if text else {}).get("spectrum") or {}).get("sweeps", []), [],
                     f"{name}: nothing of it is in a result")
        dwells = last["campaign"]["dwells"] if last else []
        checks.equal([d["used"] for d in dwells], [0] * len(dwells), f"{name}: nor is it used by what the status says")
        checks.check(all("not used" in d["reason"] or d["samples"] == 0 for d in dwells), f"{name}: which says why", dwells)
    finally:
        rig.stop()


def main():
    programs = r.programs_from_command_line(__doc__)
    checks = r.Checks()
    with tempfile.TemporaryDirectory() as folder:
        honest(checks, programs, folder, 300.0 if "--soak" in sys.argv else 60.0)
    with tempfile.TemporaryDirectory() as folder:
        resumed(checks, programs, folder)
    with tempfile.TemporaryDirectory() as folder:
        aborted(checks, programs, folder)
    # A lock-in at the frequency that was commanded, or reported, sees little of another: the amplitude's witness is the first to know.
    wrong, amplitude = "wrong_vibration", "amplitude_witness"
    always = (("frequency_ignored", ("frequency-ignored",), amplitude, "6 g commanded"),
              ("other_way", ("sweep-rate-scaled=-1",), wrong, "goes the other way"),
              ("rate_lies_and_is_not_said", ("sweep-rate-scaled=1.5", "actual-as-told"), amplitude, "6 g commanded"))
    # Distinguished by the unit tests of SweepWatch.
    of_units = (("frequency_ignored_and_not_said", ("frequency-ignored", "actual-as-told"), amplitude, "6 g commanded"),
                ("stands_still", ("sweep-rate-scaled=0",), wrong, "stands still"),
                ("rate_lies", ("sweep-rate-scaled=1.5",), wrong, "after it began"))
    for name, faults, trip, says in (*always, *(of_units if "--soak" in sys.argv else ())):
        with tempfile.TemporaryDirectory() as folder:
            lies(checks, programs, folder, name, faults, trip, says)
    return checks.end()


if __name__ == "__main__":
    sys.exit(main())
