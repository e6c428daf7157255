#!/usr/bin/python3
"""Campaigns from a plan file, adaptive ones, and plans that cannot work, over the seqpacket bus on the rig's clock.

usage: plan_campaign.py PROGRAMS
"""
import glob
import json
import os
import subprocess
import sys
import tempfile

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import rig as r  # noqa: E402

TARGETS = {"bias": 0.02, "linear": 0.01, "quadratic": 0.0015}
KINDS = {"bias": ("F",), "linear": ("I", "O", "S"), "quadratic": ("II", "OO", "SS", "IO", "IS", "OS")}


class Run:
    """One campaign from arming to its end; `arm` alone if the daemon does not arm it."""

    def __init__(self, programs, campaign, folder, timeout_s=150, truth=None, **tables):
        rig = r.Rig(programs, "seqpacket", "rig", folder)
        try:
            # The filter's sigma leave out what the bias does between dwells (u has it): over 23 seeds the errors of a plan of 12 runs are
            # 1.05 of them, D_SSy's 1.7. When commands come moves them by tenths, on a busy machine: a seed well within the limit.
            rig.start_plant("--seed", "5", "--truth", rig.truth_file(truth or r.QUICK))
            rig.configure({"name": "planned", **campaign}, **tables)
            rig.start_daemon()
            rig.wait_for(r.measuring, 30)
            self.plan = json.loads(subprocess.run(
                ["curl", "-s", "--unix-socket", rig.socket, "http://localhost/api/v1/plan"], capture_output=True, text=True,
                timeout=30).stdout or "{}")
            self.arm = rig.tool("arm", "--by", "tester")
            self.last = rig.status()
            if self.arm.returncode == 0:
                rig.tool("start", "--by", "tester")
                self.last = rig.wait_for_state(("finished", "aborted", "tripped"), timeout_s)
            self.text, (self.path, result) = rig.daemon.text(), rig.result()
            self.result = json.loads(result) if result else None
            self.judged = subprocess.run([rig.program("vibrig-plant"), "judge", self.path], capture_output=True,
                                         text=True, timeout=30) if result else None
        finally:
            rig.stop()

    def sigma(self):
        return {p["name"]: p["sigma"] for p in self.result["parameters"]}

    def finished(self, checks, text):
        if not checks.check(self.last and self.last["campaign"]["state"] == "finished" and self.result, text,
                            f"{r.state_of(self.last)} {self.arm.stderr}\n{self.text[-3000:]}"):
            return False
        checks.check(self.judged.returncode == 0, f"{text}: all 30 estimates are within 4 sigma of the truth",
                     f"{self.judged.stdout}{self.judged.stderr}{self.last['campaign'].get('dwells')}\n{self.text[-3000:]}")
        return True


def from_a_file(checks, programs, folder):
    plan = os.path.join(folder, "plan.json")
    made = subprocess.run([os.path.join(programs, "vibrig"), "plan", "--levels", "0,6", "--runs", "12", "-o", plan, "--json"],
                          capture_output=True, text=True, timeout=120, check=True)
    expected = json.loads(made.stdout)["standard_errors"]
    run = Run(programs, {"plan": plan}, folder)
    if not run.finished(checks, "a plan file of 12 runs is run to its end"):
        return
    checks.equal(len(run.last["campaign"]["dwells"]), 12, "each of its runs once")
    # The plan's standard errors and the filter's own: within 10 %.
    worst = max(abs(run.sigma()[name] / sigma - 1) for name, sigma in expected.items())
    checks.check(worst <= 0.10, "the filter's sigma are the plan's standard errors within 10 %", f"{100 * worst:.1f} %")


def adaptively(checks, programs, folder):
    run = Run(programs, {"table_g": [9.0, 0.0], "adaptive": True}, folder, **{"campaign.targets": TARGETS})
    if not run.finished(checks, "an adaptive campaign ends by itself"):
        return
    checks.check("every target is met" in run.text, "it says that the targets are met", run.text[-1500:])
    over = {p: s for p, s in run.sigma().items() for kind, names in KINDS.items()
            if p[2:-1] in names and s > TARGETS[kind]}
    checks.equal(over, {}, "every coefficient has reached its target")
    checks.check(len(run.last["campaign"]["dwells"]) < 28, "in fewer dwells than 2 x 14", run.last["campaign"]["dwells"])


def restarted(checks, programs, folder):
    """Killed after three dwells: what was chosen, and the time that it took, survive."""
    campaign = {"name": "planned", "table_g": [9.0, 0.0], "adaptive": True, "dwell_s": 40.0, "time_limit_s": 1000.0}
    targets = {"bias": 1e-4, "linear": 1e-4, "quadratic": 1e-5}   # out of reach: the time limit ends it
    rig = r.Rig(programs, "seqpacket", "rig", folder, poll_s=0.05)
    try:
        rig.start_plant("--seed", "2", "--speed", "60", "--truth", rig.truth_file(r.QUICK))
        rig.configure(campaign, **{"campaign.targets": targets})
        rig.start_daemon()
        rig.wait_for(r.measuring, 30)
        for command in ("arm", "start"):
            rig.tool(command, "--by", "tester")
        rig.wait_for(lambda s: len(s["campaign"]["dwells"]) >= 3, 120)
        rig.daemon.process.kill()
        rig.daemon.process.wait()
        done = rig.positions_done()   # the journal is written behind
        rig.start_daemon()
        status = rig.wait_for(lambda s: r.measuring(s) and s["campaign"].get("resume_offer"), 60)
        if not checks.check(status and status["campaign"]["resume_offer"].startswith(f"{done} positions done"),
                            "a killed adaptive campaign offers to go on after its last dwell", rig.logs()):
            return
        rig.wait_for(lambda s: s["shaker"].get("state") == 0 and r.measuring(s), 30)
        rig.tool("ack", "trip", "--by", "tester")
        commands = [rig.tool(command, "--by", "tester") for command in ("arm", "resume")]
        last = rig.wait_for_state(("finished", "aborted", "tripped"), 150)
        checks.check(last and last["campaign"]["state"] == "finished" and rig.daemon.says("time limit has come"),
                     "resumed, it ends when its time limit comes", f"{r.state_of(last)} {commands}\n{rig.daemon.text()[-3000:]}")
        dwells = last["campaign"]["dwells"]
        # 40 s of dwell, 7 s of ramps and settling, slews: 21 dwells in 1000 s at most, and not the whole limit anew.
        checks.check(2 <= done < len(dwells) <= 1000 / 47, "the time before the restart counts", f"{done} and {len(dwells)}")
        checks.equal([d["position"] for d in dwells], list(range(1, len(dwells) + 1)), "its dwells go on counting")
    finally:
        rig.stop()


def comes_out_again(checks, programs, run, text):
    recorded = glob.glob(os.path.join(os.path.dirname(run.path), "planned-*"))[0]
    for how, arguments in (("replayed", ("replay", recorded)), ("identified", ("identify", recorded)),
                           ("from the frames alone", ("replay", *r.raw_logs(recorded)))):
        again = subprocess.run([os.path.join(programs, "vibrig"), *arguments, "--json"], stdin=subprocess.DEVNULL, capture_output=True,
                               text=True, timeout=300)
        checks.check(again.stdout and json.loads(again.stdout) == run.result, f"{text}: {how}, the result comes out to the last bit",
                     f"{again.stderr}\n{again.stdout[:1000]}")


def at_other_rates(checks, programs, folder):
    """The rig samples at 100 Hz and at 1 kHz: what is promised before, and kept, is right there as it is at 40 Hz,
    and comes out of the recording again."""
    plan = os.path.join(folder, "plan.json")   # of 28 dwells they know no more
    subprocess.run([os.path.join(programs, "vibrig"), "plan", "--levels", "0,6", "--runs", "12", "-o", plan],
                   capture_output=True, timeout=120, check=True)
    for rate, campaign, truth in ((100, {"dwell_s": 10.0, "zeroing": True}, {}), (1000, {"dwell_s": 3.0}, r.QUICK["platform"])):
        text = f"at {rate} samples a second"
        with tempfile.TemporaryDirectory() as place:
            run = Run(programs, {"plan": plan, **campaign}, place, 300, {"platform": {"sample_rate_hz": rate, **truth}},
                      can={"sample_rate_hz": float(rate)})
            if run.result:
                comes_out_again(checks, programs, run, text)
        if not run.finished(checks, f"a campaign {text} finishes"):
            continue
        promised = {c["name"]: c["sigma"] for c in run.plan.get("expected", [])}
        worst = max((abs(run.sigma()[name] / sigma - 1) for name, sigma in promised.items()), default=9)
        checks.check(len(promised) == 30 and worst <= 0.10, f"{text} sigma is what was promised before, within 10 %",
                     f"{100 * worst:.1f} %")
        if campaign.get("zeroing"):
            zeros = run.last["campaign"]["zeros"]
            ratio = max(abs(z) / s for z, s in zip(zeros["zero_mg"], zeros["sigma_mg"]))
            checks.check(ratio < 4, f"{text} the zeros, which are none, are found within 4 sigma", zeros)


def refused(checks, programs, folder):
    path = os.path.join(folder, "one.toml")
    for what, more in (("one level only", "table_g = [9.0]"), ("a plan file with one level", "plan = \"one.csv\"")):
        with open(path, "w", encoding="utf-8") as file:
            file.write(f"[commission]\nsimulated = true\n[campaign]\n{more}\n[server]\nsocket = \"{folder}/s\"\n[can]\nport = \"seqpacket\"\npath = \"{folder}/c\"\n")
        with open(os.path.join(folder, "one.csv"), "w", encoding="utf-8") as file:
            file.write("alpha_deg,beta_deg,gamma_deg,table_g\n" + "".join(f"{a},0,{g},9\n" for a in (0, 45, 90, 180)
                                                                          for g in (0, 45, 90, 180)))
        run = subprocess.run([os.path.join(programs, "vibrigd"), "--config", path], capture_output=True, text=True,
                             timeout=30)
        checks.equal(run.returncode, 2, f"{what}: vibrigd does not start")
        table, _, reason = run.stderr.rpartition("vibrigd: ")
        checks.check("expected standard errors" in table, f"{what}: the standard errors are printed before", run.stderr)
        missing = [name for name in ("D_Fx", "D_IIx", "D_OOx", "D_SSx", "rank 9 of 10", "cheapest remedy", "what-it-can")
                   if name not in reason]
        checks.equal(missing, [], f"{what}: the reason names coefficients, remedy and the way round it")
        check = subprocess.run([os.path.join(programs, "vibrigd"), "--config", path, "--check"], capture_output=True,
                               text=True, timeout=30)
        checks.check(check.returncode == 2 and "campaign.table_g" in check.stdout and "rank 9 of 10" in check.stderr,
                     f"{what}: --check prints the configuration and says the same", check.stdout + check.stderr)


def unwritable(checks, programs, folder):
    """What only the start would show is found before: results that cannot be kept (root is stopped by no permission) and
    certificates that are not there or are none; a group, a broker's files and folders that this machine does not have."""
    path, nowhere = os.path.join(folder, "unwritable.toml"), os.path.join(folder, "file")
    with open(nowhere, "w", encoding="utf-8"):
        pass

    def checked(**tables):
        with open(path, "w", encoding="utf-8") as file:
            file.write(r.toml({**tables, "clock": {"source": "rig"}, "shaker": {"host": "127.0.0.1"},
                               "can": {"port": "seqpacket", "path": os.path.join(folder, "bus.sock")}}))
        return subprocess.run([os.path.join(programs, "vibrigd"), "--config", path, "--check"], capture_output=True,
                              text=True, timeout=30)
    keys = {"remote": "127.0.0.1:0", "certificate": nowhere, "key": nowhere, "clients_ca": nowhere}
    for server, expected in (({**keys, "clients_ca": "gone.crt"}, f'unwritable.toml:5: server.clients_ca: found "{folder}/gone.crt", expected'),
                         (keys, f"unwritable.toml:2: server.remote: certificate: found '{nowhere}': expected it in PEM")):
        check = checked(server=server)
        checks.check(check.returncode == 2 and expected in check.stderr, "--check finds certificates that are not there or are none",
                     check.stderr)
    for tables, expected in (({"mqtt": {"host": "localhost", "ca": "gone.crt"}}, f'mqtt.ca: found "{folder}/gone.crt", expected a file that can be read: No such file'),
                             ({"mqtt": {"host": "localhost", "username": "rig", "password_file": "gone.txt"}},
                              f'mqtt.password_file: found "{folder}/gone.txt", expected a file that can be read: No such file'),
                             ({"journal": {"file": "gone/j.sqlite3"}}, f'journal.file: found "{folder}/gone/j.sqlite3", expected a file in a folder that is there'),
                             ({"log": {"file": f"{nowhere}/rig.log"}}, f'log.file: found "{nowhere}/rig.log", expected a file in a folder that is there: Not a dir')):
        check = checked(**tables)
        key = expected.partition(":")[0]
        checks.check(check.returncode == 2 and f"{path}:" in check.stderr and expected in check.stderr, f"--check finds what {key} names and this machine has not",
                     check.stderr)
        started = subprocess.run([os.path.join(programs, "vibrigd"), "--config", path], capture_output=True, text=True, timeout=30)
        checks.equal((started.returncode, started.stderr), (2, check.stderr), f"{key}: and the start the same")
    check = checked(server={"operator_group": "no-such-group"})
    missing = 'server.operator_group: found "no-such-group", expected a group of this machine'
    checks.check(check.returncode == 0 and f"{missing}; a start on this machine is refused" in check.stderr,
                 "--check warns of a group that this machine has not: a file may be checked on a desk", check.stderr)
    started = subprocess.run([os.path.join(programs, "vibrigd"), "--config", path], capture_output=True, text=True, timeout=30)
    checks.check(started.returncode == 2 and missing in started.stderr, "and the start is refused", started.stderr)
    made = os.path.join(folder, "made")
    check = checked(campaign={"results": made}, journal={"file": os.path.join(made, "journal.sqlite3")})
    checks.equal((check.returncode, os.path.exists(made)), (0, False), "--check knows that the start makes the folder of the results")
    with open(path, encoding="utf-8") as file:
        beside = file.read().replace(f'"{made}/journal.sqlite3"', '"journal.sqlite3"')
    with open(path, "w", encoding="utf-8") as file:
        file.write(beside)
    check = subprocess.run([os.path.join(programs, "vibrigd"), "--config", "unwritable.toml", "--check"], capture_output=True, text=True, timeout=30,
                           cwd=folder)
    checks.equal((check.returncode, check.stderr), (0, ""), "--check takes files beside the configuration, from wherever")
    # A DBC of another rig: all that it does not have in one run, each with the line where it is mended.
    dbc = os.path.join(folder, "another.dbc")
    text = subprocess.run([os.path.join(programs, "vibrigd"), "--print-dbc"], capture_output=True, text=True, check=True).stdout
    with open(dbc, "w", encoding="utf-8") as file:
        file.write(text.replace("TableAccelerometer", "TableAcc").replace("GyrosAtSpeed", "AtSpeed"))
    signals = {"can.signals": {"temperature": "Nobody.T"}}
    with open(path, "w", encoding="utf-8") as file:
        file.write(r.toml({"clock": {"source": "rig"}, "shaker": {"host": "127.0.0.1"},
                           "can": {"port": "seqpacket", "path": os.path.join(folder, "bus.sock"), "dbc": dbc}, **signals}))
    check = subprocess.run([os.path.join(programs, "vibrigd"), "--config", path, "--check"], capture_output=True, text=True, timeout=30)
    expected = ['unwritable.toml:8: can.signals.table_accel: found "TableAccelerometer.Axial" (default), expected',
            'unwritable.toml:8: can.signals.gyros_at_speed: found "PlatformStatus.GyrosAtSpeed" (default), expected',
            'unwritable.toml:10: can.signals.temperature: found "Nobody.T", expected']
    checks.check(check.returncode == 2 and all(line in check.stderr for line in expected),
                 "--check finds all signals that a DBC does not have, each with its line", check.stderr)
    for results in ("/proc/nowhere", "/proc", nowhere, os.path.join(nowhere, "below")):
        check = checked(campaign={"results": results})
        expected = f'unwritable.toml:2: campaign.results: found "{results}", expected a folder that can be written: '
        checks.check(check.returncode == 2 and expected in check.stderr, f"--check finds that results cannot be kept in {results.replace(folder, '...')}",
                     check.stderr)


def main():
    programs = r.programs_from_command_line(__doc__)
    checks = r.Checks()
    for part in (from_a_file, adaptively, restarted, at_other_rates, refused, unwritable):
        with tempfile.TemporaryDirectory() as folder:
            part(checks, programs, folder)
    return checks.end()


if __name__ == "__main__":
    sys.exit(main())
