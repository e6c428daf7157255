#!/usr/bin/python3
"""Unmodified programs on a real vcan0 in virtual time: the full campaign, and a shorter one twice with equal estimates.

usage: virtual_time_campaign.py PROGRAMS [--soak]            boots two machines at a time; dwells of 20 s, with --soak of 100 s
       virtual_time_campaign.py PROGRAMS --inside NAME DIR   one campaign, inside; its result.json goes to DIR
"""
import ctypes
import glob
import json
import os
import re
import signal
import subprocess
import sys
import tempfile
import threading
import time

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import rig as r  # noqa: E402

HERE = os.path.dirname(os.path.abspath(__file__))
# A Modbus request is an event, and events are what virtual time costs.
SHAKER = {"poll_period_ms": 500, "watchdog_period_ms": 1000}
SETTLED_S = 5.0123
START_S = 0.0037
POLL_S = 10
CAMPAIGNS = {
    # 14 positions, 9 g and 7 g at the table: the defaults
    "full": {"name": "full", "dwell_s": 20.0},
    "whole": {"name": "full"},   # dwells of 100 s
    "short": {"name": "short", "identify": "what-it-can",
              "positions_deg": [[0, 0, 0], [45, 0, 90], [270, 0, 0]], "table_g": [9.0, 7.0],
              "dwell_s": 20.0, "temperature_window_s": 5.0},
}
WALL_S = 2400  # a thread that spins would stop the clock for ever


def wait_until_monotonic(seconds):
    """Booting takes a little more or less time; from here on both runs have the same."""
    wake = (ctypes.c_long * 2)(seconds, 0)
    if ctypes.CDLL(None).clock_nanosleep(time.CLOCK_MONOTONIC, 1, wake, None) != 0:   # 1: TIMER_ABSTIME
        raise OSError("clock_nanosleep failed")


def inside(programs, name, results):
    checks = r.Checks()
    wait_until_monotonic(10)
    with tempfile.TemporaryDirectory() as folder:
        rig = r.Rig(programs, "vcan0", "real", folder)
        rig.results = results
        begin = time.monotonic()
        try:
            # Its ticks are where nothing else happens, however long its program takes to begin.
            time.sleep(START_S)
            rig.start_plant("--seed", "1", *(() if name == "whole" else ("--truth", rig.truth_file(r.QUICK))))
            rig.configure(CAMPAIGNS[name], shaker=SHAKER, threads=r.NO_PRIORITY)
            rig.start_daemon()
            # Between the rig's ticks, and no looks at the daemon until its result is there: whoever asks at the moment
            # of a tick moves its stamp.
            time.sleep(SETTLED_S)
            commands = [rig.tool(command, "--by", "tester") for command in ("arm", "start")]
            end = time.monotonic() + 20000
            while not os.path.exists(os.path.join(results, "result.json")) and rig.daemon.running() and \
                    time.monotonic() < end:
                time.sleep(POLL_S)
            last = rig.wait_for_state(("finished", "aborted", "tripped"), 60)
            if checks.check(last is not None and last["campaign"]["state"] == "finished", f"{name} campaign finishes",
                            f"{r.state_of(last)} {[c.stderr for c in commands]}\n{rig.logs()}"):
                lost = {"kernel": r.number(last["can"]["kernel_dropped"]),
                        "ring": r.number(last["estimator_ring"]["dropped"]),
                        **{key: r.number(last["assembler"][key]) for key in ("gaps", "incomplete", "late")}}
                checks.equal(lost, dict.fromkeys(lost, 0), f"{name} campaign loses no frame and no sample")
            checks.equal(rig.daemon.end(), 0, f"{name} campaign: vibrigd ends cleanly")
        finally:
            rig.stop()
        checks.note(f"{name} campaign: {time.monotonic() - begin:.0f} s of virtual time")
    return checks.end()


class Boot(threading.Thread):
    """One machine in virtual time that runs one campaign."""

    def __init__(self, programs, name, folder):
        super().__init__()
        self.folder = folder
        os.makedirs(folder)
        self.argv = [os.path.join(HERE, "run-in-uml"), "-T", "-t", "40000", "--wall", str(WALL_S), "-w", folder, "--",
                     os.path.abspath(__file__), programs, "--inside", name, folder]
        self.start()

    def run(self):
        begin = time.monotonic()
        self.ended = subprocess.run(self.argv, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                                    stderr=subprocess.STDOUT, text=True, errors="replace", check=False,
                                    preexec_fn=lambda: r.die_with_parent(signal.SIGTERM))
        self.took_s = time.monotonic() - begin

    def result(self, checks):
        """Path and bytes of result.json; b"" if there is none."""
        self.join()
        checks.adopt(self.ended.stdout)
        checks.note(f"{self.took_s:.0f} s on this machine's clock")
        path = os.path.join(self.folder, "result.json")
        if not os.path.exists(path):
            checks.check(False, "a result.json was written", f"status {self.ended.returncode}")
            return path, b""
        with open(path, "rb") as file:
            return path, file.read()


def same_samples(checks, folders):
    """The recordings of two campaigns, sample for sample."""
    import h5py
    import numpy
    files = [h5py.File(glob.glob(os.path.join(folder, "short-*", "campaign.h5"))[0], "r") for folder in folders]
    one, two = ({name: file["samples/" + name][:] for name in file["samples"]} for file in files)
    different = [name for name in one if not numpy.array_equal(one[name], two[name])]
    checks.check(len(one) > 5 and not different, "its samples and their times are the same to the last bit", str(different))


def judge(checks, programs, path, text, dwell_s):
    judged = subprocess.run([os.path.join(programs, "vibrig-plant"), "judge", path], capture_output=True, text=True,
                            check=False)
    checks.note(judged.stdout)
    checks.check(judged.returncode == 0, "all 30 coefficients lie within 4 sigma of the truth", judged.stderr)
    samples = json.loads(text)["samples"]
    checks.check(samples >= 2 * 14 * dwell_s * 40 * 0.99, "all dwells were used", f"{samples} samples")


def main():
    programs = r.programs_from_command_line(__doc__)
    if "--inside" in sys.argv:
        return inside(programs, *sys.argv[-2:])
    checks = r.Checks()
    with tempfile.TemporaryDirectory() as folder:
        name = "whole" if "--soak" in sys.argv else "full"
        full = Boot(programs, name, os.path.join(folder, "full"))
        folders = [os.path.join(folder, name) for name in ("once", "again")]
        results = [Boot(programs, "short", place).result(checks)[1] for place in folders]
        if all(results):
            same_samples(checks, folders)
            # All but when it was: virtual time begins on the day that it is.
            once, again = (re.sub(rb'"ended":"[^"]*"', b'"ended":""', text) for text in results)
            checks.check(once == again, "the short campaign gives equal estimates twice, byte for byte",
                         f"{once[-3000:]}\n{again[-3000:]}")
        path, text = full.result(checks)
        if text:
            judge(checks, programs, path, text, CAMPAIGNS[name].get("dwell_s", 100))
    return checks.end()


if __name__ == "__main__":
    sys.exit(main())
