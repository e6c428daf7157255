#!/usr/bin/python3
"""Campaigns from a plan file, adaptive ones, and plans that cannot work, over the seqpacket bus on the rig's clock.

usage: plan_campaign.py PROGRAMS
"""
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

    def __init__(self, programs, campaign, folder, timeout_s=150, **tables):
        rig = r.Rig(programs, "seqpacket", "rig", folder)
        try:
            rig.start_plant("--seed", "2")
            rig.configure({"name": "planned", **campaign}, **tables)
            rig.start_daemon()
            rig.wait_for(lambda s: s["can"]["link"] == "running" and s["shaker"]["link"] == "running", 30)
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
        checks.equal(self.judged.returncode, 0, f"{text}: all 30 estimates are within 4 sigma of the truth")
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


def time_limit(checks, programs, folder):
    run = Run(programs, {"table_g": [9.0, 0.0], "adaptive": True, "time_limit_s": 700.0, "dwell_s": 40.0}, folder,
              **{"campaign.targets": {"bias": 1e-4, "linear": 1e-4, "quadratic": 1e-5}})
    checks.check(run.last and run.last["campaign"]["state"] == "finished", "targets out of reach: it ends all the same",
                 r.state_of(run.last) + run.text[-1500:])
    checks.check("time limit" in run.text, "and says that the time limit came", run.text[-1500:])


def refused(checks, programs, folder):
    run = Run(programs, {"table_g": [9.0]}, folder)
    checks.check(run.arm.returncode != 0, "one level only: the campaign is not armed")
    for name in ("D_Fx", "D_IIx", "D_OOx", "D_SSx"):
        checks.check(name in run.arm.stderr + run.arm.stdout, f"the reason names {name}", run.arm.stderr)


def main():
    programs = r.programs_from_command_line(__doc__)
    checks = r.Checks()
    for part in (from_a_file, adaptively, time_limit, refused):
        with tempfile.TemporaryDirectory() as folder:
            part(checks, programs, folder)
    return checks.end()


if __name__ == "__main__":
    sys.exit(main())
