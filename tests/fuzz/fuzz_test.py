#!/usr/bin/python3
"""Fuzz targets side by side, each from its corpus.

usage: fuzz_test.py PROGRAMS [--seconds N] [--seed N] [--soak]      8 s each; 600 s with --soak
What breaks a target stays in build/tests/fuzz. Once mended it belongs into tests/fuzz/corpus.
"""
import glob
import os
import re
import subprocess
import sys
import tempfile

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, os.path.join(HERE, "..", "hil"))
import rig as r  # noqa: E402

KEPT = os.path.realpath(os.path.join(HERE, "..", "..", "build", "tests", "fuzz"))


def argument(name, default):
    return int(sys.argv[sys.argv.index(name) + 1]) if name in sys.argv else default


def start(program, seconds, seed, folder):
    name = os.path.basename(program).removeprefix("fuzz_")
    found = os.path.join(folder, name)
    os.mkdir(found)
    log = open(os.path.join(folder, name + ".log"), "w+", encoding="utf-8", errors="replace")
    # Children: what one input leaks is reported at the end; a hang is one of 20 s on a busy machine.
    run = subprocess.Popen([program, f"-max_total_time={seconds}", f"-seed={seed}", "-timeout=20", "-rss_limit_mb=1500",
                            "-max_len=8192", "-print_final_stats=1", f"-artifact_prefix={KEPT}/{name}-", found,
                            os.path.join(HERE, "corpus", name)], stdin=subprocess.DEVNULL, stdout=log,
                           stderr=subprocess.STDOUT, preexec_fn=r.die_with_parent)
    return name, run, log


def main():
    programs = r.programs_from_command_line(__doc__)
    seconds, seed = argument("--seconds", 600 if "--soak" in sys.argv else 8), argument("--seed", 1)
    os.makedirs(KEPT, exist_ok=True)
    checks = r.Checks()
    checks.note(f"seed {seed}")
    targets = sorted(glob.glob(os.path.join(programs, "fuzz_*")))
    with tempfile.TemporaryDirectory() as folder:
        for name, run, log in [start(program, seconds, seed, folder) for program in targets]:
            status = run.wait(seconds + 120)
            log.seek(0)
            said = log.read()
            log.close()
            count = re.search(r"number_of_executed_units: *(\d+)", said)
            kept = re.search(r"Test unit written to (\S+)", said)
            checks.check(status == 0, f"{name}: {count[1] if count else 'some'} inputs, none breaks it",
                         f"{kept[1] if kept else ''}\n{said[-4000:]}")
    checks.check(len(targets) == 8, "all targets are there", str(targets))
    return checks.end()


if __name__ == "__main__":
    sys.exit(main())
