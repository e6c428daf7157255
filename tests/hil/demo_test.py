#!/usr/bin/python3
"""daemon/demo as a newcomer types it.

usage: demo_test.py
"""
import os
import re
import signal
import subprocess
import sys
import tempfile
import time

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import rig as r  # noqa: E402

DEMO = os.path.realpath(os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", "daemon", "demo"))


def demo(*arguments, temporary, timeout=1500):
    return subprocess.run([DEMO, *arguments], stdin=subprocess.DEVNULL, capture_output=True, text=True,
                          timeout=timeout, cwd=temporary, env={**os.environ, "TMPDIR": temporary}, preexec_fn=with_us)


def with_us():
    """A demo ends when this test is ended."""
    r.die_with_parent(signal.SIGTERM)


def processes_of(folder):
    """Command lines that name the folder: what a demo there has left running."""
    found = []
    for pid in filter(str.isdigit, os.listdir("/proc")):
        try:
            with open(f"/proc/{pid}/cmdline", "rb") as file:
                command = file.read().replace(b"\0", b" ").decode(errors="replace")
        except OSError:
            continue
        if folder in command and int(pid) != os.getpid():
            found.append(command)
    return found


def begins_on_vcan(checks, folder):
    """The whole takes minutes where the kernel has no vcan; its beginning shows that it goes."""
    running = subprocess.Popen([DEMO, "--vcan"], stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                               stderr=subprocess.STDOUT, text=True, cwd=folder, env={**os.environ, "TMPDIR": folder},
                               preexec_fn=with_us)
    said = []
    for line in running.stdout:
        said.append(line)
        if re.match(r" +\d+\.\d s +(waiting|slewing|ramping|settling|recording) ", line):
            break
    checks.check(any(line.startswith("Campaign:") and "vcan0" in line for line in said) and running.poll() is None,
                 "--vcan: a campaign begins on a real vcan0", "".join(said[-20:]))
    running.send_signal(signal.SIGTERM)
    running.stdout.read()
    checks.equal(running.wait(60), 143, "--vcan: SIGTERM ends it")
    checks.equal(processes_of(folder), [], "--vcan: no process is left")


def main():
    checks = r.Checks()
    with tempfile.TemporaryDirectory(prefix="vibrig demo ") as folder:   # a blank in the path, too
        kept = os.path.join(folder, "kept")
        begin = time.monotonic()
        run = demo("--keep", kept, temporary=folder)
        checks.check(run.returncode == 0, "the demo ends with all 30 coefficients within 4 sigma",
                     f"status {run.returncode}\n{run.stdout[-3000:]}{run.stderr[-2000:]}")
        checks.note(f"{time.monotonic() - begin:.0f} s")
        names = set(re.findall(r"\bD_[FIOS]{1,2}[xyz]\b", run.stdout.split("truth")[-1]))
        checks.equal(len(names), 30, "it prints the table of 30 coefficients")
        found = re.findall(r"gyro ([xyz]), \d+ dwells: N (?:(\S+) \+- (\S+)|not detected, below (\S+)) deg/sqrt\(h\); "
                           r"B not detected", run.stdout)
        checks.equal([gyro for gyro, *_ in found], ["x", "y", "z"], "the monitor tells N of each gyro, and no B")
        # The simulated rig's N is 0.001. A bound is the estimate and two sigma, so that four sigma are two below it; the
        # same dwells of another gyro tell sigma.
        sigmas = [float(sigma) for _, n, sigma, _ in found if n]
        checks.check(len(sigmas) >= 2, "it finds N of two gyros at least", str(found))
        checks.check(all(abs(float(n) - 1e-3) < 4 * float(sigma) if n else float(below) > 1e-3 - 2 * max(sigmas, default=0)
                         for _, n, sigma, below in found), "N is the simulated rig's within 4 sigma", str(found))
        checks.check(os.path.exists(os.path.join(kept, "vibrigd.toml")), "--keep keeps the configuration")
        with open(os.path.join(kept, "report.html"), encoding="utf-8") as file:
            page = file.read()
        checks.check(all(name in page for name in names) and page.count("<svg") > 8 and "http" not in
                     page.replace("http://www.w3.org/2000/svg", ""), "it writes a report that needs nothing else")
        checks.equal(processes_of(kept), [], "no process is left")
        # What people command comes while the rig's clock stands, so that load does not choose its sample.
        with open(os.path.join(kept, "plant.log"), encoding="utf-8") as file:
            transcript = file.read()
        order = [transcript.find(f"ok {word}\n") for word in ("hold 200", "go")]
        stood = transcript.rfind("ok time 200.000 s", 0, order[1])
        checks.check(-1 < transcript.find("ok time 40.000 s") < order[0] < stood < order[1],
                     "proof and campaign are commanded while the clock stands", transcript[-2000:])
        wrong = demo("--seed", "many", temporary=folder)
        checks.check(wrong.returncode == 2 and "many" in wrong.stderr, "a bad seed is refused by name", wrong.stderr)
        # WHEN it is interrupted in the middle of a campaign
        running = subprocess.Popen([DEMO], stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                                   text=True, cwd=folder, env={**os.environ, "TMPDIR": folder}, preexec_fn=with_us)
        for line in running.stdout:
            if line.startswith("Campaign:"):
                break
        time.sleep(0.5)
        running.send_signal(signal.SIGTERM)
        running.stdout.read()
        checks.equal(running.wait(30), 143, "SIGTERM ends it")
        checks.equal(processes_of(folder), [], "an interrupted demo leaves no process")
        begins_on_vcan(checks, folder)
        checks.equal(sorted(os.listdir(folder)), ["kept"], "an interrupted demo leaves no temporary folder")
    return checks.end()


if __name__ == "__main__":
    sys.exit(main())
