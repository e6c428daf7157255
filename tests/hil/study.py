#!/usr/bin/python3
"""Studies in pieces: threads, shards, SIGKILL at random moments, damaged parts, a full disk, too little memory, MPI, Slurm
with two nodes of which one dies. Whatever happened, what is merged in the end is the same file to the last bit.

usage: study.py PROGRAMS [--soak] [--seed N]

One study is killed 20 times and then ended; besides, studies with two threads, three shards, four ranks of MPI and two nodes
of Slurm are killed once each, before their end, and then ended: two studies of each kind, one of the nodes; with --soak 20 of
each. With --soak the studies of tests/studies are whole, else a slice of them.
"""
import argparse
import glob
import json
import os
import random
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import rig as r  # noqa: E402
import study_theory as theory  # noqa: E402

HERE = os.path.dirname(os.path.abspath(__file__))
STUDIES = os.path.join(os.path.dirname(HERE), "studies")
KILLS, LONG = 20, 600
ROUNDS, SOAK_ROUNDS = 2, 20
SLICE_RECORDINGS, RECORDINGS = 2, 10
SHORT = """[study]
name = "short"
kind = "campaigns"
seed = {seed}
runs = {runs}
[campaign]
positions_deg = [[0, 0, 0], [90, 0, 0]]
dwell_s = 2
settle_s = 2
identify = "what-it-can"
[rig]
platform.slew_deg_per_s = 90
"noise.resolver_arcsec" = {{ rectangular = [4, 6] }}
[grid]
"isolator.cross_axis" = [[0, 0], [0.05, 0]]
"""


class Bench:
    def __init__(self, programs, folder, checks, seed):
        self.vibrig = os.path.join(programs, "vibrig")
        self.mpi = os.path.join(programs, "vibrig-study-mpi")
        self.folder, self.checks, self.random = folder, checks, random.Random(seed)
        self.expected, self.long = None, None

    def path(self, name):
        return os.path.join(self.folder, name)

    def study(self, *arguments, **options):
        return subprocess.run([self.vibrig, "study", *arguments], capture_output=True, text=True, timeout=300, **options)

    def plan(self, name, runs=60, seed=1):
        with open(self.path(name + ".toml"), "w", encoding="utf-8") as file:
            file.write(SHORT.format(runs=runs, seed=seed))
        self.study("plan", self.path(name + ".toml"), "-o", self.path(name), check=True)
        return self.path(name)

    def merged(self, folder):
        out = folder + ".json"
        run = self.study("merge", folder, "-o", out)
        if run.returncode != 0:
            return run, b""
        with open(out, "rb") as file:
            return run, file.read()

    def same(self, folder, text, expected=None):
        run, result = self.merged(folder)
        self.checks.check(run.returncode == 0 and result == (expected or self.expected), text, run.stderr or "another result")

    def expected_of_long(self):
        """Of a study of LONG runs that nobody disturbs."""
        if self.long is None:
            folder = self.plan("undisturbed", runs=LONG)
            self.study("run", folder)
            self.long = self.merged(folder)[1]
        return self.long

    def started(self, command):
        return subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)

    def parts(self, folder):
        return sorted(glob.glob(os.path.join(folder, "parts", "*")))


def pieces(b):
    reference = b.plan("reference")
    run = b.study("run", reference, "-j", "1")
    b.checks.equal(run.returncode, 0, "a study of 120 tasks runs")
    run, b.expected = b.merged(reference)
    b.checks.check(b'"done": 120' in b.expected and b'"failed": 0' in b.expected, "and is merged", run.stderr)
    two = b.plan("two")
    b.study("run", two, "-j", "2")
    b.same(two, "two threads give the same to the last bit")
    for count in (3, 7):
        folder = b.plan(f"shards{count}")
        running = [subprocess.Popen([b.vibrig, "study", "run", folder, "-j", "1", "--shard", f"{i}/{count}"],
                                    stdout=subprocess.DEVNULL) for i in range(count)]
        codes = {process.wait() for process in running}
        b.checks.equal(codes, {0}, f"{count} shards at once")
        b.same(folder, f"{count} shards give the same to the last bit")
    status = json.loads(b.study("status", folder, "--json").stdout)
    b.checks.equal((status["done"], status["missing"], status["parts"]), (120, 0, 7), "status counts tasks and parts")
    own = [os.path.join(folder, "study.json"), os.path.join(folder, "STUDY.toml"), os.path.join(folder, "parts", "of-mine")]
    refused = [b.study("merge", folder, option, place) for option in ("-o", "--csv", "--hdf5") for place in own]
    b.checks.check(all(run.returncode == 2 and "found a file of the study that is merged" in run.stderr for run in refused) and
                   b.study("status", folder).returncode == 0, "a merged study is not written over", refused)
    run = b.study("merge", folder, "--compact")
    b.checks.equal((run.returncode, len(b.parts(folder))), (0, 1), "parts are compacted to one")
    b.same(folder, "which gives the same")


def charts(b):
    folder, drawn = b.path("many"), b.path("many-charts")
    with open(folder + ".toml", "w", encoding="utf-8") as file:
        file.write('[study]\nname = "many"\nkind = "campaigns"\n[campaign]\ndwell_s = 5\n[grid]\n'
                   f'"drift.bias_walk_deg_h_rt_h" = {[i / 1000 for i in range(101)]}\n')
    b.study("plan", folder + ".toml", "-o", folder, check=True)
    run = b.study("merge", folder, "--partial", "--plot", drawn)
    b.checks.check(f"{drawn}: nothing to draw, no chart was written" in run.stderr and not os.path.exists(drawn),
                   "where nothing is drawn it is said, and no folder made", run.stderr)
    b.study("run", folder)
    run = b.study("merge", folder, "--plot", drawn)
    b.checks.check("the first 100 of 101 points have charts of their own" in run.stderr, "what has no chart is said", run.stderr)
    for kind, words in (("rms-z", "bars: 95 %"), ("coverage", "bars: 95 %"), ("nees", "expected (95 %)")):
        paths = glob.glob(os.path.join(drawn, kind + "-[0-9]*.svg"))
        texts = [open(path, encoding="utf-8").read() for path in paths]
        b.checks.check(len(texts) == 100 and all(words in text and "SIMULATED: " in text for text in texts),
                       f"{len(texts)} charts: {kind}, with intervals, of simulated campaigns")


def twice_at_once(b):
    folder = b.plan("twice", runs=LONG)
    running = [subprocess.Popen([b.vibrig, "study", "run", folder, "-j", "1", "--chunk", "0.1"],
                                stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)]
    while not b.parts(folder) and running[0].poll() is None:
        time.sleep(0.01)
    running[0].send_signal(signal.SIGSTOP)   # it runs until the second has looked
    running.append(subprocess.Popen(running[0].args, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True))
    second = running[1].communicate()[1]
    running[0].send_signal(signal.SIGCONT)
    running[0].communicate()
    b.checks.check("another run of this shard" in second, "who runs a shard that runs is refused with the reason", second)
    b.checks.equal([process.returncode for process in running], [0, 0], "both go on")
    b.same(folder, "what was done twice is the same", b.expected_of_long())


def kills(b):
    folders, killed, within, left, done = [b.plan("killed", runs=LONG)], 0, 0.12, {"done": 0}, 0
    for _ in range(KILLS):
        process = b.started([b.vibrig, "study", "run", folders[-1], "-j", "2", "--chunk", "0.01"])
        time.sleep(b.random.uniform(0.25 * within, within))
        process.kill()
        killed += process.wait() != 0
        before, left = left, json.loads(b.study("status", folders[-1], "--json").stdout)
        done += left["done"] - before["done"]
        if left["done"] == before["done"]:
            within *= 1.5   # a busy machine had not begun
        elif left["done"] == left["tasks"]:   # nothing is left to be killed
            folders.append(b.plan(f"killed-{len(folders)}", runs=LONG))
            within, left = 0.12, {"done": 0}
    b.checks.check(killed > KILLS / 2 and done > 0, f"{done} tasks done in {KILLS} runs, of which {killed} were killed")
    ended = [b.study("run", folder).returncode for folder in folders]
    b.checks.equal(ended, [0] * len(folders), f"after {KILLS} SIGKILLs it goes on to the end")
    for folder in folders:
        b.same(folder, "and gives the same to the last bit", b.expected_of_long())


def ended(job):
    """Its status; one that waits for a process that died while it started, as mpirun may, is ordered to end."""
    for last in (job.terminate, job.kill):
        try:
            return job.wait(timeout=60)
        except subprocess.TimeoutExpired:
            last()
    return job.wait(timeout=60)


def rounds(b, what, count, begin, end):
    """Studies that are killed once each at a random moment and then ended, until `count` were killed before their end.
    `begin` starts one and returns the jobs to wait for and, later, the processes to choose a victim from."""
    within, killed, i = 0.5, 0, -1
    while killed < count and (i := i + 1) < 5 * count + 20:   # one may be done before it is killed
        folder = b.plan(f"{what.replace(' ', '-')}-{i}")
        jobs, victims = begin(folder)
        time.sleep(b.random.uniform(0, within))
        alive = [pid for pid in victims() if jobs[0].poll() is None or len(jobs) > 1]
        too_early = not alive and jobs[0].poll() is None   # on a busy machine none has begun
        if alive:
            try:
                os.kill(b.random.choice(alive), signal.SIGKILL)
            except OSError:
                pass   # it was done already
        hit = any([ended(job) != 0 for job in jobs])
        killed += hit
        within *= 1.15 if hit or too_early else 0.75   # half of the moments are before its end, whatever the machine
        code = end(folder)
        run, result = b.merged(folder)
        if code != 0 or run.returncode != 0 or result != b.expected:
            b.checks.check(False, f"{what}, study {i}: killed and ended it is the same", run.stderr or f"exit {code}")
            return
    b.checks.check(killed == count, f"{what}: {killed} of {i + 1} studies were killed before their end, all give the same")


def kill_each(b, count):
    run = [b.vibrig, "study", "run"]

    def threads(folder):
        job = b.started([*run, folder, "-j", "2", "--chunk", "0.02"])
        return [job], lambda: [job.pid]

    def shards(folder):
        jobs = [b.started([*run, folder, "-j", "1", "--chunk", "0.02", "--shard", f"{i}/3"]) for i in range(3)]
        return jobs, lambda: [job.pid for job in jobs if job.poll() is None]

    def end(folder):
        return b.study("run", folder).returncode
    rounds(b, "two threads", count, threads, end)
    rounds(b, "three shards", count, shards, end)


def spoil(path, how):
    with open(path, "rb") as file:
        data = bytearray(file.read())
    with open(path, "wb") as file:
        file.write(how(data))


def flipped(data, at):
    data[at] ^= 4
    return data


def damage(b):
    folder = b.plan("damaged")
    for i in range(4):
        b.study("run", folder, "--shard", f"{i}/4")
    parts = b.parts(folder)
    keep = b.path("kept")
    shutil.copytree(os.path.join(folder, "parts"), keep)
    spoil(parts[0], lambda data: data[:len(data) - 11])
    spoil(parts[1], lambda data: flipped(data, len(data) // 2))
    os.remove(parts[2])
    shutil.copy(parts[3], parts[3].replace(".part", "9.part"))
    run, _ = b.merged(folder)
    b.checks.equal(run.returncode, 1, "truncated, bit-flipped and missing parts are no result")
    b.checks.check("torn after 29 records" in run.stderr and ": damaged after " in run.stderr and
                   "of 120 tasks: 29" in run.stderr, "each is named", run.stderr)
    partial = b.study("merge", folder, "--partial", "--json")
    b.checks.check(partial.returncode == 0 and json.loads(partial.stdout)["partial"], "--partial says that it is", partial.stderr)
    b.study("run", folder)
    run = b.study("merge", folder, "-o", folder + ".json", "--compact")
    with open(folder + ".json", "rb") as file:
        b.checks.check(file.read() == b.expected, "what is lost is computed again, and gives the same")
    b.checks.check(run.returncode == 1 and "remove what is damaged" in run.stderr and f"kept: {os.path.basename(parts[0])}" in
                   run.stderr and f"kept: {os.path.basename(parts[1])}" in run.stderr, "damage is exit 1, named, and not compacted",
                   run.stderr)
    b.checks.equal({path for path in parts[:2] if os.path.exists(path)}, set(parts[:2]), "damaged parts are there yet")
    for path in parts[:2]:
        os.remove(path)
    b.same(folder, "without them nothing is missing")
    other = b.plan("other", seed=2)
    b.study("run", other, "--shard", "0/4")
    shutil.copy(b.parts(other)[0], os.path.join(folder, "parts", "0of4-elsewhere-1-0.part"))
    run = b.study("merge", folder)
    b.checks.check(run.returncode == 1 and "0of4-elsewhere-1-0.part: a part of another study" in run.stderr,
                   "a part of another study is named", run.stderr)
    plan = os.path.join(other, "study.json")
    spoil(plan, lambda data: data.replace(b'"version": "', b'"version": "9'))
    run = b.study("run", other)
    b.checks.check(run.returncode == 2 and "planned with version 9" in run.stderr, "a study of another version is refused",
                   run.stderr)


def full_disk(b):
    folder = b.plan("full")
    limit = 40_000

    def narrow():
        resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))
    run = b.study("run", folder, "-j", "2", "--chunk", "0.1", preexec_fn=narrow)
    b.checks.check(run.returncode == 2 and "cannot be written: File too large" in run.stderr,
                   "a file that may not grow: exit 2 with the reason", run.stderr)
    b.checks.equal(b.study("run", folder).returncode, 0, "with room again it goes on")
    b.same(folder, "and gives the same to the last bit")
    small = b.path("small")
    os.mkdir(small)
    planned = b.plan("disk")
    room = 40 + int(subprocess.run(["du", "-sk", planned], capture_output=True, text=True, check=True).stdout.split()[0])
    script = (f"mount -t tmpfs -o size={room}k none '{small}' && cp -r '{planned}' '{small}/s' || exit 9\n"
              f"'{b.vibrig}' study run '{small}/s' --chunk 0.1; echo code $?\nmount -o remount,size=9m '{small}'\n"
              f"'{b.vibrig}' study run '{small}/s' && '{b.vibrig}' study merge '{small}/s' -o '{b.path('disk.json')}'\n")
    run = subprocess.run(["unshare", "-m", "sh", "-c", script], capture_output=True, text=True, timeout=120)
    if run.returncode == 9 or "unshare" in run.stderr:
        b.checks.skip("a full disk", "no file system can be mounted here")
        return
    b.checks.check("code 2" in run.stdout and "No space left on device" in run.stderr, "a full disk: exit 2 with the reason",
                   run.stdout + run.stderr)
    with open(b.path("disk.json"), "rb") as file:
        b.checks.check(file.read() == b.expected, "with room again it gives the same")


def little_memory(b):
    folder = b.plan("memory")

    def narrow():
        resource.setrlimit(resource.RLIMIT_AS, (1 << 30, 1 << 30))
    run = b.study("run", folder, "-j", "1024", preexec_fn=narrow)
    b.checks.check(run.returncode == 2 and " of 1024 cannot be made: " in run.stderr,
                   "threads that cannot be made: exit 2 with the reason", run.stderr)
    b.checks.equal(b.study("run", folder).returncode, 0, "with fewer it goes on")
    b.same(folder, "and gives the same to the last bit")


def submission(b):
    """What is asked of sbatch, by one that only says so."""
    folder = b.plan("50% done")
    fake = b.path("fake")
    os.mkdir(fake)

    def submit(script):
        with open(os.path.join(fake, "sbatch"), "w", encoding="utf-8") as file:
            file.write("#!/bin/sh\n" + script)
        os.chmod(os.path.join(fake, "sbatch"), 0o755)
        return b.study("submit", folder, "--slurm", "--json", env={**os.environ, "PATH": fake + ":" + os.environ["PATH"]})
    run = submit(f"echo 'sbatch: a warning' >&2\nprintf '%s\\n' \"$@\" >'{fake}/asked'\necho '17;lab'\n")
    b.checks.check(run.returncode == 0 and json.loads(run.stdout) == {"job": "17", "shards": 1},
                   "the job is what sbatch writes to its standard output", run.stdout + run.stderr)
    with open(os.path.join(fake, "asked"), encoding="utf-8") as file:
        asked = file.read().splitlines()
    b.checks.check(f"--output={os.path.realpath(folder).replace('%', '%%')}/log/%A_%a.out" in asked, "a % in a name stays one", asked)
    run = submit("echo 'submitted'\n")
    b.checks.check(run.returncode == 2 and "found 'submitted" in run.stderr, "what is no number of a job is none", run.stderr)


def children_of(pid):
    for stat in glob.glob("/proc/[0-9]*/stat"):
        try:
            with open(stat, encoding="utf-8", errors="replace") as file:
                fields = file.read().rsplit(")", 1)[1].split()
        except OSError:
            continue
        if int(fields[1]) == pid:
            yield int(stat.split("/")[2])


def mpi(b, count):
    if not os.path.exists(b.mpi) or not shutil.which("mpirun"):
        b.checks.skip("studies over MPI", "no vibrig-study-mpi (libopenmpi-dev) or no mpirun")
        return
    command = ["mpirun", "--allow-run-as-root", "--oversubscribe", "-np", "4", b.mpi]
    folder = b.plan("mpi")
    run = subprocess.run([*command, folder], stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=120)
    b.checks.equal(run.returncode, 0, "four ranks run a study")
    b.same(folder, "and give the same to the last bit")

    def begin(folder):
        job = b.started([*command, folder, "--chunk", "0.02"])
        return [job], lambda: list(children_of(job.pid)) if job.poll() is None else []

    def end(folder):
        return subprocess.run([*command, folder], stdin=subprocess.DEVNULL, capture_output=True, timeout=120).returncode
    rounds(b, "four ranks", count, begin, end)
    folder = b.plan("ranks stopped", runs=2000)
    job = subprocess.Popen([*command, folder, "--chunk", "0.02"], stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
                           stderr=subprocess.PIPE, text=True)
    while job.poll() is None and not b.parts(folder):
        time.sleep(0.02)
    job.terminate()   # mpirun hands it on
    output = job.communicate(timeout=60)[1]
    b.checks.check(job.returncode != 0 and not [path for path in b.parts(folder) if path.endswith(".tmp")],
                   "ranks that are ordered to stop close their parts", output)
    linked = "".join(subprocess.run(["ldd", os.path.join(os.path.dirname(b.vibrig), program)], capture_output=True,
                                    text=True, check=True).stdout for program in ("vibrig", "vibrigd"))
    b.checks.check("libmpi" not in linked, "vibrig and vibrigd link no MPI")


def slurm(b, soak):
    """The part below runs inside the cluster."""
    missing = [p for p in ("slurmctld", "slurmd", "sbatch", "munged") if not shutil.which(p, path=os.environ["PATH"] + ":/usr/sbin")]
    if missing or os.geteuid() != 0:
        b.checks.skip("studies on a Slurm of two nodes", f"missing: {', '.join(missing)}" if missing else "needs root")
        return
    calm, storm = b.plan("slurm"), b.plan("storm", runs=LONG)
    storms = [b.plan(f"storm-{i}", runs=LONG) for i in range(SOAK_ROUNDS if soak else 0)]
    run = subprocess.run([os.path.join(HERE, "run-in-slurm"), sys.executable, __file__, os.path.dirname(b.vibrig),
                          "--in-slurm", calm, storm, *storms, "--seed", str(b.random.randrange(1000))],
                         capture_output=True, text=True, timeout=240 + 120 * len(storms))
    if run.returncode == 2 and "did not come up" in run.stderr:
        b.checks.skip("studies on a Slurm of two nodes", "it does not come up here: " + run.stderr.splitlines()[-1])
        return
    b.checks.adopt(run.stdout)
    b.checks.note(run.stderr)
    b.same(calm, "an array over two nodes gives the same to the last bit")
    b.study("run", storm)
    b.same(storm, "after nodes died it goes on to the same result", b.expected_of_long())
    same = 0
    for folder in storms:
        b.study("run", folder)
        same += b.merged(folder)[1] == b.expected_of_long()
    if storms:
        b.checks.equal(same, len(storms), "nodes: studies whose nodes were killed give the same to the last bit")


def waiting_for(job, seconds):
    """States of its tasks, once they are over or the time is up; what squeue cannot say is an error."""
    end = time.monotonic() + seconds
    while True:
        run = subprocess.run(["squeue", "-h", "-j", job, "-o", "%T"], capture_output=True, text=True)
        if run.returncode != 0 and "Invalid job id" not in run.stderr:   # that long over that it is forgotten
            return [f"squeue: {run.stderr}"]
        states = run.stdout.split()
        if not states or time.monotonic() > end:
            return states
        time.sleep(0.3)


def family_of(pid):
    return [pid, *(one for child in children_of(pid) for one in family_of(child))]


def kill_nodes(b, folder, number):
    """One node dies, or both; with what runs there, or without it: an orphan goes on and may write, too. Returns what runs
    in the end, and whether the job was at work when they died."""
    lab = os.environ["SLURM_LAB"]
    job = json.loads(b.study("submit", folder, "--slurm", "--shards", "4", "--json").stdout)["job"]
    begin = time.monotonic()
    while time.monotonic() < begin + 30 and "RUNNING" not in waiting_for(job, 0):
        time.sleep(0.05)
    time.sleep(b.random.uniform(0, 1))
    at_work = "RUNNING" in waiting_for(job, 0)
    nodes = ["n1", "n2"] if number % 2 else [b.random.choice(["n1", "n2"])]
    for node in nodes:
        with open(os.path.join(lab, f"d-{node}.run"), encoding="utf-8") as file:
            pid = int(file.read())
        for one in family_of(pid) if number % 4 < 2 else [pid]:
            try:
                os.kill(one, signal.SIGKILL)
            except OSError:
                pass   # it was done already
    time.sleep(b.random.uniform(0, 7))   # it counts as dead after 5 s
    for node in nodes:
        with open(os.path.join(lab, f"slurmd-{node}.out"), "ab") as out:
            subprocess.Popen(["slurmd", "-D", "-N", node], stdin=subprocess.DEVNULL, stdout=out, stderr=out)
    return waiting_for(job, 90), at_work


def in_slurm(b, calm, storm, *storms):
    began = time.monotonic()
    run = b.study("submit", calm, "--slurm", "--shards", "4", "--", "--wait")
    b.checks.check(run.returncode == 0 and run.stdout.startswith("job "), "sbatch takes an array, and waits if asked to",
                   run.stdout + run.stderr)
    b.checks.note(f"calm array: {time.monotonic() - began:.0f} s")
    job = json.loads(b.study("submit", storm, "--slurm", "--shards", "4", "--json").stdout)["job"]
    begin = time.monotonic()
    while time.monotonic() < begin + 30 and len(b.parts(storm)) < 2:
        time.sleep(0.1)
    time.sleep(b.random.uniform(0.1, 1.0))
    with open(os.path.join(os.environ["SLURM_LAB"], "d-n2.run"), encoding="utf-8") as file:
        os.kill(int(file.read()), signal.SIGKILL)   # its step goes on as an orphan, and may write too
    states = waiting_for(job, 60)
    b.checks.note(f"array with a node that died: {time.monotonic() - begin:.0f} s")
    b.checks.check(not states, "tasks of a node that died are requeued and end", states)
    run = b.study("status", storm)
    b.checks.equal(run.returncode, 0, "a requeued task contradicts nothing")
    b.checks.note(run.stdout)
    if storms:
        with open(os.path.join(os.environ["SLURM_LAB"], "slurmd-n2.out"), "ab") as out:
            subprocess.Popen(["slurmd", "-D", "-N", "n2"], stdin=subprocess.DEVNULL, stdout=out, stderr=out)
    struck = 0
    for number, folder in enumerate(storms):
        states, at_work = kill_nodes(b, folder, number)
        struck += at_work
        b.checks.check(not states, f"nodes, study {number}: its tasks end after nodes were killed", states)
    if storms:
        b.checks.check(struck >= 0.8 * len(storms), f"nodes: {struck} of {len(storms)} studies were at work when nodes died")


def judge(b, where, point, wanted, soak):
    """Against the theory for so many runs: NEES of chi-square; the share of valid verdicts where nothing is wrong, one less
    the verdict's false alarms, 0.0043; or at most 0.01 where a walk is there that the verdict saw in 300 of 300 (bound at
    95 %). A deviation that is known stands beside it as a finding, and is on the safe side."""
    runs, nees, valid = point["runs"], point["nees"]["noise"], point["verdicts"]["valid"]
    share = wanted.get("valid", wanted.get("valid_at_most"))
    if share is not None:
        low, high = theory.count_interval(share, runs)
        if "valid_at_most" in wanted:
            low = 0
        b.checks.check(low <= valid <= high, f"{where}: {valid} valid of {runs}, {low} to {high} by theory")
    low, high = theory.mean_interval(wanted["nees"], nees["n"])
    mean = nees["mean"]
    text = f"{where}: NEES {mean:.2f} of {low:.2f} to {high:.2f} by theory"
    known = wanted.get("finding", {}).get("NEES")
    if known is None:
        b.checks.check(low <= mean <= high, text)
        return
    # The finding is a number, too, and held to as strictly.
    low_found, high_found = theory.mean_interval(known["mean"], nees["n"])
    b.checks.check(low_found <= mean <= min(high, high_found),
                   f"{text}; {low_found:.2f} to {min(high, high_found):.2f} by the finding")
    b.checks.note(f"finding: {where}: NEES {known}")
    if soak:
        b.checks.check(mean < low, f"{where}: the finding stands", "theory is met: take the finding away")


def committed(b, soak):
    """The studies that docs rest on."""
    paths = sorted(glob.glob(os.path.join(STUDIES, "*.toml")))
    b.checks.equal([path[:-5] + ".json" for path in paths], sorted(glob.glob(os.path.join(STUDIES, "*.json"))),
                   "each study has what is expected of it")
    for path in paths:
        name = os.path.basename(path)[:-5]
        with open(path, encoding="utf-8") as file:
            text = file.read()
        with open(path[:-5] + ".json", encoding="utf-8") as file:
            expected = json.load(file)
        if "verdict" in expected:
            proved(b, name, text, expected, soak)
            continue
        if not soak:
            text = "\n".join(f"runs = {expected['slice']}" if line.startswith("runs =") else line for line in text.splitlines())
        with open(b.path(name + ".toml"), "w", encoding="utf-8") as file:
            file.write(text)
        folder = b.path("committed-" + name)
        b.study("plan", b.path(name + ".toml"), "-o", folder, check=True)
        run = subprocess.run([b.vibrig, "study", "run", folder], capture_output=True, text=True)
        b.checks.equal(run.returncode, 0, f"{name}: runs")
        run, result = b.merged(folder)
        if not b.checks.equal(run.returncode, 0, f"{name}: is merged"):
            continue
        points = json.loads(result)["points"]
        if not b.checks.equal(len(points), len(expected["points"]), f"{name}: as many points as are expected"):
            continue
        for point, wanted in zip(points, expected["points"]):
            where = ", ".join(f"{k} {v}" for k, v in point["grid"].items()) or "all runs"
            judge(b, f"{name}, {where}", point, wanted, soak)


def recorded(b, dwell_s, drift_model):
    """A campaign of the simulated rig on its own clock, as vibrigd records it. Returns its parameters; none: it failed."""
    with tempfile.TemporaryDirectory(prefix="vibrig-study-rig-") as folder:
        rig = r.Rig(os.path.dirname(b.vibrig), "seqpacket", "rig", folder, poll_s=1)
        try:
            rig.start_plant("--seed", str(b.random.randrange(1, 1000)), "--truth", rig.truth_file(r.QUICK))
            rig.configure({"name": "proof", "dwell_s": dwell_s, "table_g": [9.0, 7.0]}, drift={"model": drift_model}, **r.PATIENT)
            rig.start_daemon()
            rig.wait_for(r.measuring, 60)
            for command in ("arm", "start"):
                rig.tool(command, "--by", "test")
            status = rig.wait_for_state(("finished", "aborted", "tripped"), 600)
            rig.wait_for(lambda s: not s["recorder"].get("recording", False), 30)
            rig.daemon.end()
            found = glob.glob(os.path.join(rig.results, "proof-*"))
            if not b.checks.check(r.state_of(status) == "finished" and len(found) == 1,
                                  f"a campaign of 28 dwells of {dwell_s} s is recorded", rig.logs()):
                return None
            shutil.move(found[0], b.path("recording"))
            return json.loads(rig.result()[1])["parameters"]
        finally:
            rig.stop()


def proved(b, name, text, expected, soak):
    """The budget of a recorded campaign, by drawing and by theory; of another one as long as the claim is not about it."""
    with open(b.path(name + ".toml"), "w", encoding="utf-8") as file:
        file.write(text)
    for number in range(RECORDINGS if soak else SLICE_RECORDINGS):
        kind = expected["whole" if soak else "slice"]
        parameters = recorded(b, float(kind["dwell_s"]), kind["drift_model"])
        if parameters is None:
            return
        folder = b.path(f"committed-{name}-{number}")
        for command in (("plan", b.path(name + ".toml"), "-o", folder), ("run", folder)):
            b.checks.equal(b.study(*command).returncode, 0, f"{name}: {command[0]}")
        run, result = b.merged(folder)
        if not b.checks.equal(run.returncode, 0, f"{name}: is merged"):
            return
        b.checks.note(run.stdout)
        about = theory.claimed(parameters, expected)
        theory.judge(b.checks, name, json.loads(result), parameters, expected["verdict"] if about else None)
        shutil.rmtree(b.path("recording"))
        if about:
            return
        b.checks.note(f"finding: {name}: {expected['finding']}")
    b.checks.skip(f"{name}: the budget is {expected['verdict']}", f"no recording had {expected['nu_eff_from']} degrees of freedom")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("programs")
    parser.add_argument("--soak", action="store_true")
    parser.add_argument("--seed", type=int, default=random.randrange(1_000_000))
    parser.add_argument("--in-slurm", nargs="+", metavar="STUDY", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    checks = r.Checks()
    checks.note(f"seed {arguments.seed}")
    with tempfile.TemporaryDirectory(prefix="vibrig-study-") as folder:
        os.chmod(folder, 0o755)
        b = Bench(os.path.abspath(arguments.programs), folder, checks, arguments.seed)
        if arguments.in_slurm:
            in_slurm(b, *arguments.in_slurm)
        else:
            count = SOAK_ROUNDS if arguments.soak else ROUNDS
            for part, *how in ((pieces,), (charts,), (twice_at_once,), (kills,), (kill_each, count), (damage,), (full_disk,),
                               (little_memory,), (submission,), (mpi, count), (slurm, arguments.soak), (committed, arguments.soak)):
                begin = time.monotonic()
                part(b, *how)
                checks.note(f"{part.__name__}: {time.monotonic() - begin:.0f} s")
    print(f"1..{checks.count}")
    return 1 if checks.failed else 0


sys.exit(main())
