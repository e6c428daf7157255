#!/usr/bin/python3
"""Random dwells among sine ones, unattended, over the seqpacket bus on the rig's clock: chosen at rest, read back, shown by the
accelerometers, recorded and predicted. The same killed in the midst of it, and resumed. And controllers that lie about profile, level and
abort bands.

usage: random_campaign.py PROGRAMS [--soak]     soak: half an hour at level
"""
import csv
import json
import os
import sys
import tempfile

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import loop_check  # noqa: E402
import restart_campaign as again  # noqa: E402
import rig as r  # noqa: E402
import survey_campaign  # noqa: E402

PSD = [[20, 0.02], [120, 0.02]]   # 1.41 g rms
OTHER = [[30, 0.04], [80, 0.04]]  # the same rms
NUMBER, LEVEL_DB = 4, -1.5
TRUTH = {**r.QUICK, "isolator": {"hard": True},
         "shaker": {"profiles": [{"number": NUMBER, "psd": PSD}, {"number": 5, "psd": OTHER}]}}
POSITIONS = [[0, 0, 0], [45, 0, 90], [90, 0, 180], [180, 0, 45], [-45, 0, 90], [270, 0, 0]]
HELD_OUT = [[30, 10, -20], [-50, 0, 70]]
CONFIGURATION = f"""
[[profile]]
name = "broad"
number = {NUMBER}
at = "table"
psd = {json.dumps(PSD)}
"""
REGISTERS = {"mode": {"address": 8}, "profile_number": {"address": 9}, "profile_level_db": {"address": 10},
             "profile_checksum": {"address": 5}, "measured_g_rms": {"address": 7}, "control_state": {"address": 9}}
ENDS = ("finished", "aborted", "tripped", "paused")
WALL_S = 1800


def random_run(position, role):
    return {"position": position, "profile": "broad", "level_db": LEVEL_DB, "role": role}


def plan_of(folder, sines):
    runs = [{"position": position, "table_g": 6.0, "level_g": 6.0, "frequency_hz": 15} for position in POSITIONS[:sines]]
    runs += [random_run(position, "identify") for position in POSITIONS]
    runs += [random_run(position, "verify") for position in HELD_OUT]
    path = os.path.join(folder, "plan.json")
    with open(path, "w", encoding="utf-8") as file:
        json.dump({"runs": runs}, file)
    return path, len(runs)


def csv_plan_of(folder, sines):
    """The same as a table."""
    path, count = plan_of(folder, sines)
    with open(path, encoding="utf-8") as file:
        runs = json.load(file)["runs"]
    path = os.path.join(folder, "plan.csv")
    with open(path, "w", encoding="utf-8") as file:
        file.write("alpha_deg,beta_deg,gamma_deg,table_g,frequency_hz,profile,level_db,role\n")
        for run in runs:
            file.write(",".join(str(x) for x in run["position"] + [run.get(key, "") for key in (
                "table_g", "frequency_hz", "profile", "level_db", "role")]) + "\n")
    return path, count


def start(rig, planned, dwell_s, *plant, truth=TRUTH, begin=True, spectrum=None, registers=None, psd=None, **tables):
    plan, count = planned
    rig.start_plant("--seed", "3", "--truth", rig.truth_file(truth), *plant)
    rig.configure({"name": "random", "plan": plan, "dwell_s": dwell_s, "temperature_window_s": 5.0, "identify": "what-it-can"},
                  spectrum={"mount": "hard", "mode": "mixed", **(spectrum or {})},
                  **{f"shaker.registers.{role}": keys for role, keys in {**REGISTERS, **(registers or {})}.items()}, **tables)
    with open(rig.configuration, "a", encoding="utf-8") as file:
        file.write(CONFIGURATION.replace(json.dumps(PSD), json.dumps(psd or PSD)))
    rig.start_daemon()
    rig.wait_for(r.measuring, 60)
    return count, [rig.tool(command, "--by", "tester") for command in ("arm", "start") if begin]


def honest(checks, programs, folder, dwell_s):
    rig = r.Rig(programs, "seqpacket", "rig", folder)
    try:
        count, commands = start(rig, plan_of(folder, len(POSITIONS)), dwell_s)
        last = rig.wait_for_state(ENDS, WALL_S)
        path, text = rig.result()
        if not checks.check(last and last["campaign"]["state"] == "finished" and text, "random dwells run unattended to the end",
                            f"{r.state_of(last)} {[c.stderr for c in commands]}\n{rig.daemon.text()[-4000:]}"):
            return
        dwells, log = last["campaign"]["dwells"], rig.daemon.text()
    finally:
        rig.stop()
    checks.equal([d for d in dwells if d.get("flagged")], [], "no dwell is flagged")
    checks.equal(len(dwells), count, "all are taken")
    checks.check("stop of the shaker" not in log, "the shaker was never stopped on the way", log[-2000:])
    checks.check("profile 'broad' (number 4, checksum" in commands[0].stdout, "arming names the profile and its checksum",
                 commands[0].stdout)
    result = json.loads(text)
    under = [row for row in result.get("dwell_rates", []) if row.get("profile") == "broad"]
    checks.equal(len(under), len(POSITIONS), "the fit has the random dwells, but for those held out")
    checks.check(all(0.004 < row["r_relative_error"] < 0.02 for row in under), "each with what is not known of its level",
                 [row["r_relative_error"] for row in under])
    recorded = survey_campaign.recording(rig)
    again = survey_campaign.vibrig(programs, "identify", recorded, "--json")
    same = json.loads(again.stdout) if again.stdout else {}
    checks.equal(([p["value"] for p in same.get("parameters", [])], len(same.get("dwell_rates", []))),
                 ([p["value"] for p in result["parameters"]], len(result["dwell_rates"])),
                 "identify over the recording gives the live result to the last bit")
    exported(checks, programs, rig, recorded, result)
    profile = os.path.join(folder, "broad.json")
    with open(profile, "w", encoding="utf-8") as file:
        json.dump({"name": "broad", "psd": PSD}, file)
    proof = survey_campaign.vibrig(programs, "predict", path, "--profile", profile, "--verify", recorded, "--json", "--force")
    verification = (json.loads(proof.stdout) if proof.stdout else {}).get("prediction", {}).get("verification") or {}
    checks.check(verification.get("word", "").startswith("confirmed") and len(verification.get("dwells", [])) == len(HELD_OUT),
                 "the prediction is confirmed on the dwells held out under the profile", proof.stdout + proof.stderr)
    held = [row for row in (result.get("spectrum") or {}).get("held_out", []) if row["profile"] == "broad"]
    checks.equal([[round(z, 4) for z in row["z"]] for row in held],
                 [[round(z, 4) for z in row["z"]] for row in verification.get("dwells", [])],
                 "the result has them beside what was predicted")


def exported(checks, programs, rig, recorded, result):
    """What is exported as CSV gives what the recording gives: profiles, levels and roles are in it."""
    out = os.path.join(rig.folder, "out.csv")
    made = survey_campaign.vibrig(programs, "export", recorded, "--to", "csv", "-o", out)
    checks.equal(made.returncode, 0, "it can be exported as CSV")
    with open(out, encoding="utf-8") as file:
        kinds = {(row["frequency_hz"], row["profile"], row["level_db"], row["role"]) for row in csv.DictReader(file)}
    checks.equal(kinds, {("15", "0", "0", "identify"), ("0", "broad", str(LEVEL_DB), "identify"), ("0", "broad", str(LEVEL_DB), "verify")},
                 "with frequency, profile, level and role")
    again_csv = survey_campaign.vibrig(programs, "identify", out, "--config", rig.configuration, "--json")
    same = json.loads(again_csv.stdout) if again_csv.stdout else {}
    checks.equal([(row["run"], row["position"], row.get("profile")) for row in same.get("dwell_rates", [])],
                 [(row["run"], row["position"], row.get("profile")) for row in result["dwell_rates"]],
                 "identify over the CSV has the same dwells, but for those held out" + again_csv.stderr)
    # Angles lose a last bit on their way through degrees.
    checks.check(same and all(abs(a["value"] - b["value"]) < 1e-6 + 1e-3 * b["sigma"] and abs(a["sigma"] - b["sigma"]) < 1e-3 * b["sigma"]
                              for a, b in zip(same["parameters"], result["parameters"]) if b["value"] is not None and b["sigma"]),
                 "and the same coefficients", [(a["name"], a["value"], b["value"], b["sigma"])
                                               for a, b in zip(same.get("parameters", []), result["parameters"])])
    held = [[[row["run"], row["position"]], row["profile"]] for row in (same.get("spectrum") or {}).get("held_out", [])]
    checks.equal(held, [[[row["run"], row["position"]], row["profile"]] for row in result["spectrum"]["held_out"]],
                 "and holds out the same")


def resumed(checks, programs, folder):
    """Killed in the midst of a random dwell, twice; from a CSV plan, and with accelerometers that do not see all, as declared."""
    sines, narrow = 2, 150.0
    rig = r.Rig(programs, "seqpacket", "rig", folder, poll_s=0.05)
    try:
        count, _ = start(rig, csv_plan_of(folder, sines), 40.0, "--speed", "20", truth={**TRUTH, "accelerometer": {"bandwidth_hz": narrow}},
                         accelerometer={"bandwidth_hz": narrow})
        for done in (sines + 1, sines + 3):
            status = rig.wait_for(lambda s, n=done: len(s["campaign"]["dwells"]) >= n and s["campaign"]["state"] == "recording", 120)
            if not checks.check(status is not None and status["campaign"]["state"] == "recording",
                                f"killed after {done}: in a random dwell", f"{r.state_of(status)}\n{rig.logs()}"):
                return
            again.take_up(checks, rig, f"killed after {done}", count)
        last = rig.wait_for_state(ENDS, 240)
        path, text = rig.result()
        if not checks.check(last and last["campaign"]["state"] == "finished" and text, "the random campaign finishes",
                            f"{r.state_of(last)}\n{rig.logs()}"):
            return
        dwells = last["campaign"]["dwells"]
    finally:
        rig.stop()
    checks.equal((len(dwells), [d for d in dwells if d.get("flagged")]), (count, []), "each dwell is there once, none is flagged")
    result = json.loads(text)
    under = [row for row in result.get("dwell_rates", []) if row.get("profile") == "broad"]
    checks.equal(len(under), len(POSITIONS), "the fit has the random dwells of all three lives")
    checks.check(all(0.004 < row["r_relative_error"] < 0.02 for row in under), "what is not known of their level survived, too",
                 [row["r_relative_error"] for row in under])
    held = [row for row in (result.get("spectrum") or {}).get("held_out", []) if row["profile"] == "broad"]
    checks.equal(len(held), len(HELD_OUT), "and so did those held out")
    # Six rates; four sigma once in 2600 such tests.
    checks.check(all(abs(z) < 4 for row in held for z in row["z"]), "they are as predicted", [row["z"] for row in held])


def through(hz, ratio_at_15, damping=0.2):
    """Power that isolators let through, of which the ratio at 15 Hz is known."""
    def power(f, natural):
        r, damped = f / natural, 2 * damping * f / natural
        return (1 + damped ** 2) / ((1 - r ** 2) ** 2 + damped ** 2)
    low, high = 1.0, 15 / 2 ** 0.5
    for _ in range(60):
        natural = (low + high) / 2
        low, high = (low, natural) if power(15, natural) > ratio_at_15 ** 2 else (natural, high)
    return power(hz, low)


def soft_isolators(checks, programs, folder):
    """Isolators let 4 % more through than is configured: the loop check measures it, and levels of random dwells go by that. Of the mean
    square it is 8 %, where slow samples know it to 2.2 % and the controller, through what is configured, says 1 %."""
    stated, is_so, density = 0.667, 0.694, 0.02
    psd = [[15, density], [45, density * 3 ** 4]]  # behind the isolators nearly flat
    rig = r.Rig(programs, "seqpacket", "rig", folder)
    try:
        truth = {**r.QUICK, "isolator": {"transmission": is_so}, "shaker": {"profiles": [{"number": NUMBER, "psd": psd}]}}
        start(rig, csv_plan_of(folder, len(POSITIONS)), 100.0, truth=truth, begin=False, psd=psd, spectrum={"mount": "isolated"},
                         selftest={"required": True}, vibration={"transmission": stated})
        rig.wait_for(loop_check.ready, 60)
        tested = rig.tool("selftest", "--by", "tester", timeout=200)
        if not checks.equal(tested.returncode, 0, "isolators within the loop check's tolerance pass it"):
            checks.note(tested.stdout + tested.stderr)
            return
        commands = [rig.tool(command, "--by", "tester") for command in ("arm", "start")]
        last = rig.wait_for_state(ENDS, 240)
        _, text = rig.result()
        if not checks.check(last and last["campaign"]["state"] == "finished" and text, "the campaign on soft isolators finishes",
                            f"{r.state_of(last)} {[c.stderr for c in commands]}\n{rig.logs()}"):
            return
    finally:
        rig.stop()
    steps = 3000
    lines = [15 + (k + 0.5) * 30 / steps for k in range(steps)]
    power = sum(through(f, is_so) * density * (f / 15) ** 4 for f in lines) * 30 / steps * 10 ** (LEVEL_DB / 10)
    rows = [row for row in json.loads(text).get("dwell_rates", []) if row.get("profile") == "broad"]
    found = [row["level"] ** 2 / 2 / power - 1 for row in rows]
    # 100 s at 40/s: 2.2 % by samples; the profile 1 % and, of some 28 Hz, 1.9 % that the realisation strays. Four of the mean's.
    allowed = 4 * sum(row["r_relative_error"] for row in rows) / max(len(rows), 1) ** 1.5
    checks.check(len(rows) == len(POSITIONS) and abs(sum(found)) / len(rows) < allowed,
                 f"levels of random dwells go by the measured transmission, within {allowed:.3f}", found)


def lies(checks, programs, folder, fault, trips, says):
    rig = r.Rig(programs, "seqpacket", "rig", folder)
    try:
        start(rig, plan_of(folder, 1), 20.0, "--fault", fault)
        last = rig.wait_for_state(ENDS, 180)
        taken = [d for d in last["campaign"]["dwells"] if d["used"] > 0] if last else []
        name = fault.split("=", maxsplit=1)[0].replace("-", "_")
        log = rig.daemon.text()
        checks.check(last and last["campaign"]["state"] == "tripped" and any(trip in log or rig.daemon.says(trip) for trip in trips),
                     f"{name}: the daemon trips", f"{r.state_of(last)}\n{log[-3000:]}")
        checks.equal(len(taken), 1, f"{name}: not a sample is taken under it")
        checks.check(rig.daemon.says(says), f"{name}: what is wrong is reported", log[-3000:])
    finally:
        rig.stop()


def main():
    programs = r.programs_from_command_line(__doc__)
    checks = r.Checks()
    with tempfile.TemporaryDirectory() as folder:
        honest(checks, programs, folder, 1800.0 if "--soak" in sys.argv else 60.0)
    with tempfile.TemporaryDirectory() as folder:
        resumed(checks, programs, folder)
    with tempfile.TemporaryDirectory() as folder:
        soft_isolators(checks, programs, folder)
    for fault, trips, says in (
            ("wrong-profile=5", ("read_back_mismatch",), "profile checksum reads back as"),
            ("profile-level-wrong=6", ("wrong_vibration", "amplitude_witness", "over_amplitude"), "g rms"),
            ("no-abort-bands", ("abort_bands",), "without abort bands of its own")):
        with tempfile.TemporaryDirectory() as folder:
            lies(checks, programs, folder, fault, trips, says)
    return checks.end()


if __name__ == "__main__":
    sys.exit(main())
