#!/usr/bin/python3
"""Recordings that lie: copies of a campaign's HDF5 file and raw logs with a few things changed, and whatever reads
recordings run on each. It takes them or refuses them in one clear line that names the file: no signal, no report of a
sanitizer, within limits of time and memory, and nothing is printed that is not a number.

usage: lying_recordings.py PROGRAMS [--seed N] [--count N] [--soak] [--under PROGRAMS]
Lies number N and so on; --under: what reads them, where the programs that record are others (sanitizers).
What a lie broke stays in build/tests/lies.
"""
import contextlib
import glob
import json
import os
import random
import re
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import warnings

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, HERE)
sys.path.insert(0, os.path.join(HERE, "..", "..", "proto", "python"))
import recording_lies as lies   # noqa: E402
import rig as r   # noqa: E402
import vibrig   # noqa: E402

KEPT = os.path.realpath(os.path.join(HERE, "..", "..", "build", "tests", "lies"))
CAMPAIGN = {"name": "lied", "identify": "what-it-can", "positions_deg": [[0, 0, 0], [45, 0, 90]], "table_g": [9.0],
            "order": "sequential", "dwell_s": 10.0, "settle_s": 2.0, "ramp_s": 1.0}
MEMORY, PROCESSOR_S, TIME_S, OUTPUT = 1500 << 20, 20, 40, 256 << 20
PAPER = 'number = "1"\n[laboratory]\nname = "L"\n[customer]\nname = "C"\n'

# What they are given: a folder, its campaign.h5, its raw logs, another folder for output, one that does not lie.
READERS = {
    "identify": lambda c: ("identify", c.file),
    "identify --json": lambda c: ("identify", c.folder, "--json"),
    "uncertainty": lambda c: ("uncertainty", c.file),
    "replay": lambda c: ("replay", c.folder),
    "replay --json": lambda c: ("replay", c.file, "--json"),
    "replay of frames": lambda c: ("replay", *r.raw_logs(c.folder), "--json"),
    "export csv": lambda c: ("export", c.folder, "--to", "csv", "-o", c.out + "/x.csv"),
    "export mat": lambda c: ("export", c.folder, "--to", "mat", "-o", c.out + "/x.mat"),
    "export candump": lambda c: ("export", c.folder, "--to", "candump", "-o", c.out + "/x.log"),
    "export wireshark": lambda c: ("export", c.folder, "--to", "wireshark", "-o", c.out + "/x.log"),
    "report": lambda c: ("report", c.folder, "-o", c.out + "/x.html"),
    "report --compare": lambda c: ("report", c.honest, "--same-unit", "--compare", c.file, "-o", c.out + "/x.html"),
    "compensate": lambda c: ("compensate", c.folder),
    "compensate --json": lambda c: ("compensate", c.folder, "--json"),
    "certificate": lambda c: ("certificate", c.folder, "--paper", c.out + "/paper.toml", "--by", "A", "--no-journal",
                              "-o", c.out + "/certificate"),
    "archive": lambda c: ("archive", "add", c.folder, "--archive", c.out + "/archive", "--rig", "1"),
    "list": lambda c: ("list", "--archive", c.out + "/archive"),
    "recover": lambda c: ("recover", c.folder),
    "recover --json": lambda c: ("recover", c.folder, "--json"),
}
OF_FRAMES = ("replay of frames", "export candump", "export wireshark", "recover")
FOREIGN = re.compile(r"what\(\)|std::|HDF5-DIAG|terminate called|bad_alloc|basic_string|vector::|_M_|map::at|bitset|"
                     r"json\.exception|core dumped|Traceback|stack overflow")
CONTROL = re.compile(r"[\x00-\x08\x0b-\x1f\x7f-\x9f]")
NO_NUMBER = re.compile(r"(?<![\w.\"'])-?(nan|inf)(?![\w\"'])", re.IGNORECASE)


class Case:
    """A folder with one lie, and what is made of it."""

    def __init__(self, programs, honest, where):
        self.program, self.honest, self.where = os.path.join(programs, "vibrig"), honest, where
        self.folder, self.out = os.path.join(where, "lied-1"), os.path.join(where, "out")
        self.file = os.path.join(self.folder, "campaign.h5")
        self.sanitized = "asan" in os.path.realpath(programs).split(os.sep)
        shutil.copytree(honest, self.folder)
        os.makedirs(os.path.join(self.out, "archive"))
        with open(os.path.join(self.out, "paper.toml"), "w", encoding="ascii") as file:
            file.write(PAPER)
        with open(os.path.join(self.out, "leaks"), "w", encoding="ascii") as file:
            file.write("leak:libhdf5\n")   # it forgets a hundred bytes of a page with a wrong checksum

    def limit(self):
        r.die_with_parent()
        resource.setrlimit(resource.RLIMIT_CPU, (PROCESSOR_S, PROCESSOR_S + 1))
        resource.setrlimit(resource.RLIMIT_FSIZE, (OUTPUT, OUTPUT))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        if not self.sanitized:   # whose shadow is larger than any memory
            resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))

    def read(self, reader):
        """What is wrong with how it is read; empty: nothing."""
        arguments = READERS[reader](self)
        environment = {**os.environ, "NO_COLOR": "1", "ASAN_OPTIONS": f"hard_rss_limit_mb={MEMORY >> 20}:max_allocation_size_mb={MEMORY >> 20}",
                       "LSAN_OPTIONS": f"suppressions={self.out}/leaks:print_suppressions=0", "UBSAN_OPTIONS": "print_stacktrace=1:halt_on_error=1"}
        try:
            run = subprocess.run([self.program, *arguments], stdin=subprocess.DEVNULL, capture_output=True, cwd=self.out,
                                 timeout=TIME_S, preexec_fn=self.limit, env=environment)
        except subprocess.TimeoutExpired:
            return f"{reader}: longer than {TIME_S} s"
        out, err = (text.decode("utf-8", "surrogateescape") for text in (run.stdout, run.stderr))
        found = self.judged(run.returncode, out, err, "--json" in arguments)
        return found and f"{reader}: status {run.returncode}: {found}\n{err[-1500:]}"

    def judged(self, status, out, err, is_json):
        if r.SANITIZER.search(err):
            return "a sanitizer reports"
        if status not in (0, 1, 2):
            return "expected 0, 1 or 2"
        if said := FOREIGN.search(out + err):
            return f"says {said[0]}"
        if said := CONTROL.search(out + err) or re.search(r"[\ud800-\udfff]", out + err):
            return f"prints {said[0]!r}"
        lines = [line for line in err.splitlines() if not line.startswith("before the run: ")]
        if status == 2:
            good = lines and len(lines[-1]) < 1200 and re.search(r"(lied-1|campaign|raw-\d+|dwells\.csv|archive/)[^:]*:.*\w", lines[-1])
            return "" if good and not out and len(lines) <= 3 else "expected one line that names the file"
        if is_json:
            for line in out.splitlines() if "}\n{" in out else [out]:
                try:
                    json.loads(line, parse_constant=lambda word: 1 / 0)
                except (ValueError, ZeroDivisionError):
                    return f"no JSON: {line[:300]}"
        elif said := NO_NUMBER.search(out):
            return f"prints {said[0]}: {out[max(0, said.start() - 200):][:300]}"
        for made in ("x.csv", "x.html"):
            with contextlib.suppress(OSError), open(os.path.join(self.out, made), encoding="utf-8", errors="replace") as file:
                text = re.sub(r"<pre.*?</pre>", "", file.read(), flags=re.DOTALL)   # the configuration as it is
                os.remove(file.name)
                if said := re.search(r"(?<![\w.])-?(nan|inf)\b(?=[,<\" ]|$)|<script>alert", text):
                    return f"writes {said[0]} into {made}: {text[max(0, said.start() - 200):][:300]}"
        return ""

    def read_in_python(self):
        """Likewise, by the Python package in a process of its own: it says what it cannot take as OSError or ValueError."""
        here, there = os.pipe()
        child = os.fork()
        if child == 0:
            os.close(here)
            self.limit()
            signal.alarm(TIME_S)
            os.write(there, look(self.file).encode("utf-8", "replace")[:4000] or b"ok")
            os._exit(0)
        os.close(there)
        with open(here, encoding="utf-8", errors="replace") as pipe:
            said = pipe.read()
        _, status = os.waitpid(child, 0)
        return "" if said == "ok" and status == 0 else f"Python package: status {status}: {said}"


def look(path):
    warnings.simplefilter("ignore")   # of numpy, about numbers that are none
    try:
        campaign = vibrig.open(path)
        for table in campaign.tables.values():
            for column in table:
                len(table[column])
            if table.rows:
                table.utc()
        with contextlib.suppress(IndexError):   # as it says: no order is of that dwell
            for i in range(campaign.dwells.rows):
                campaign.of_dwell(i)
        campaign.coefficients
        campaign.compensation([0, 0, 0], table_g=1)
        return ""
    except (OSError, ValueError) as error:
        return "" if "campaign" in str(error) or "level: " in str(error) else f"names no file: {error!r}"
    except BaseException as error:   # noqa: B902  a fault of the package
        import traceback
        return f"{error!r}\n{traceback.format_exc()[-1500:]}"


def recorded(checks, programs, folder):
    """A short campaign's folder."""
    rig = r.Rig(programs, "seqpacket", "rig", folder)
    try:
        rig.start_plant("--seed", "1", "--speed", "max")
        rig.configure(CAMPAIGN, record={"segment_s": 15.0})
        rig.start_daemon()
        rig.wait_for(r.measuring, 60)
        for command in ("arm", "start"):
            rig.tool(command, "--by", "test")
        status = rig.wait_for_state(("finished", "aborted", "tripped"), 120)
        checks.equal(r.state_of(status), "finished", "a campaign is recorded")
        rig.wait_for(lambda s: not s["recorder"].get("recording", False), 20)
    finally:
        rig.stop()
    return glob.glob(os.path.join(rig.results, "lied-*"))[0]


def one_lie(programs, honest, seed, where):
    """What it says, what was run, and what was wrong with that."""
    choose = random.Random(seed)
    case = Case(programs, honest, where)
    words, of_frames = lies.tell(case.folder, choose)
    readers = choose.sample(sorted(READERS), 3)
    if of_frames:
        readers = choose.sample(OF_FRAMES, 3)
    if "list" in readers:
        readers = ["archive", *readers]
    wrong = [found for reader in sorted(readers, key=lambda name: name.startswith("recover")) if (found := case.read(reader))]
    if not of_frames and (found := case.read_in_python()):
        wrong.append(found)
    return words, len(readers) + (not of_frames), wrong


def argument(name, default):
    return type(default)(sys.argv[sys.argv.index(name) + 1]) if name in sys.argv else default


def main():
    programs = r.programs_from_command_line(__doc__)
    seed, count = argument("--seed", 1), argument("--count", 2000 if "--soak" in sys.argv else 40)
    readers = argument("--under", programs)
    checks, runs, broken = r.Checks(), 0, 0
    checks.note(f"seed {seed}, {count} lies")
    with tempfile.TemporaryDirectory() as folder:
        honest = recorded(checks, programs, folder)
        for number in range(seed, seed + count):
            where = os.path.join(folder, f"lie-{number}")
            os.mkdir(where)
            words, done, wrong = one_lie(readers, honest, number, where)
            runs += done
            if wrong:
                broken += 1
                checks.note(f"seed {number}: {'; '.join(words)}\n" + "\n".join(wrong))
                kept = os.path.join(KEPT, str(number))
                shutil.rmtree(kept, ignore_errors=True)
                shutil.copytree(where, kept, symlinks=True)
            shutil.rmtree(where)
    checks.equal(broken, 0, f"{count} recordings that lie are read or refused in one clear line, {runs} times")
    spent = resource.getrusage(resource.RUSAGE_CHILDREN)
    checks.note(f"{spent.ru_utime + spent.ru_stime:.0f} s of processor time")
    return checks.end()


if __name__ == "__main__":
    sys.exit(main())
