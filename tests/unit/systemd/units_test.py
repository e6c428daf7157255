#!/usr/bin/python3
"""The unit is clean for systemd-analyze, its exposure is at most 2.0, and what goes with it can be read.

usage: units_test.py UNIT FOLDER
"""
import os
import re
import shutil
import subprocess
import sys
import tempfile

LARGEST_EXPOSURE = 2.0
SKIPPED = 77


def output(*command):
    run = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False,
                         env={**os.environ, "LC_ALL": "C.UTF-8", "SYSTEMD_COLORS": "0", "SYSTEMD_PAGER": "cat"})
    return run.returncode, run.stdout


# Without one of them it goes on, and says at most that something is missing: real time, the operators' group at the
# socket, the last place in the queue for processor and disk of what delivers to the archive.
NEEDED = {"vibrigd.service": {"sched_setscheduler", "sched_setaffinity", "mlockall", "chown", "setpriority", "ioprio_set"},
          "vibrig-guard.service": set()}


def calls_of(name):
    """Of a set of systemd's, or the call itself."""
    if not name.startswith("@"):
        return {name}
    calls = set()
    for line in output("systemd-analyze", "syscall-filter", name)[1].splitlines()[1:]:
        if line.strip() and not line.strip().startswith("#"):
            calls |= calls_of(line.strip())
    return calls


def permitted(unit):
    """By its lines SystemCallFilter=, the first of which begins with nothing."""
    calls = set()
    for line in re.findall(r"^SystemCallFilter=(.*)$", unit, re.M):
        named = set().union(*map(calls_of, line.removeprefix("~").split()))
        calls = calls - named if line.startswith("~") else calls | named
    return calls


def main():
    unit, folder = (os.path.abspath(path) for path in sys.argv[1:3])
    if shutil.which("systemd-analyze") is None:
        print("systemd-analyze is not here")
        return SKIPPED
    failed = []
    with tempfile.TemporaryDirectory() as place:
        # Installed or not: the program has to be there for the check.
        with open(unit, encoding="utf-8") as file:
            text = file.read()
        program = re.search(r"^ExecStart=(\S+)", text, re.M)[1]
        copy = os.path.join(place, os.path.basename(unit))
        with open(copy, "w", encoding="utf-8") as file:
            file.write(text.replace(program, shutil.which("true")))
        # Its manual pages are looked at in tests/docs: here they are not installed.
        status, said = output("systemd-analyze", "verify", "--man=no", copy)
        mine = [line for line in said.splitlines() if "vibrig" in line]
        if status != 0 or mine:
            failed.append(f"systemd-analyze verify: status {status}: {said}")
        status, said = output("systemd-analyze", "security", "--offline=true", "--threshold=20", "--no-pager", copy)
        exposure = re.search(r"Overall exposure level for \S+: ([0-9.]+)", said)
        if exposure is None or float(exposure[1]) > LARGEST_EXPOSURE or status != 0:
            failed.append(f"systemd-analyze security: expected {LARGEST_EXPOSURE} at most: {said[-400:]}")
        else:
            print(f"exposure {exposure[1]}")
        refused = NEEDED[os.path.basename(unit)] - permitted(text)
        if refused:
            failed.append(f"{unit}: SystemCallFilter refuses {', '.join(sorted(refused))}")
        for line in ("Type=notify", "WatchdogSec=", "User=vibrig", "CapabilityBoundingSet=\n", "StartLimit",
                     "RestartPreventExitStatus=2", *(["RestartForceExitStatus=75"] if unit.endswith("vibrigd.service") else [])):
            if "\n" + line not in text:
                failed.append(f"{unit}: {line.strip()} is missing")
        for tool, arguments, name in (("systemd-sysusers", ["--dry-run"], "vibrig.sysusers"),
                                      ("systemd-tmpfiles", ["--create", f"--root={place}"], "vibrig.tmpfiles")):
            if shutil.which(tool) is None:
                continue
            path = os.path.join(folder, name)
            if tool == "systemd-tmpfiles":   # owners that do not exist below the root
                with open(path, encoding="utf-8") as file:
                    text = re.sub(r" (root|vibrig) (vibrig) ", " - - ", file.read())
                path = os.path.join(place, name)
                with open(path, "w", encoding="utf-8") as file:
                    file.write(text)
            status, said = output(tool, *arguments, path)
            if status != 0:
                failed.append(f"{tool} {name}: status {status}: {said}")
    print("\n".join(failed))
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
