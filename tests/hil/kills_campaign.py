#!/usr/bin/python3
"""SIGKILL at random moments of campaigns, in real time, on four rigs side by side: what was on the bus more than a second
before is in the logs and in the HDF5 file, every file opens, the journal knows what was done, and the shaker stops by its
own watchdog.

usage: kills_campaign.py PROGRAMS [--soak] [--seed N]      20 kills; 200 with --soak
"""
import glob
import os
import random
import re
import socket
import sqlite3
import subprocess
import sys
import tempfile
import threading
import time

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import rig as r  # noqa: E402
import service_manager as stages  # noqa: E402

RIGS = 4
CAMPAIGN = {"name": "killed", "identify": "what-it-can", "positions_deg": [[0, 0, 0], [0, 0, 10], [10, 0, 10]],
            "table_g": [9.0, 7.0], "order": "sequential", "dwell_s": 2.0, "settle_s": 2.0, "ramp_s": 0.5, "temperature_window_s": 0.0}
RECORD = {"segment_s": 2.0}   # logs are closed and compressed meanwhile
LONGEST_S = 7.0               # after the start: some positions are done by then
KEPT_S = 1.0                  # older than that must be there, on a disk and a machine that are not late themselves
SYNC = 0x080
WATCHDOG = 1                  # bit of the shaker's fault register


class Witness(threading.Thread):
    """Another node of the bus: sync counts, and when it heard them."""

    def __init__(self, path):
        super().__init__(daemon=True)
        self.link = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self.link.connect(path)
        self.heard = []
        self.start()

    def run(self):
        while frame := self.link.recv(72):
            if int.from_bytes(frame[:4], "little") == SYNC:
                self.heard.append((time.monotonic(), int.from_bytes(frame[8:12], "little")))

    def between(self, begin, end):
        return {count for when, count in list(self.heard) if begin < when < end}


class Disk(threading.Thread):
    """Writes a little beside the daemons, through to the disk, every 50 ms: how late that is, they are without any fault of theirs."""

    PERIOD_S = 0.05

    def __init__(self, folder):
        super().__init__(daemon=True)
        self.file = os.open(os.path.join(folder, "beside"), os.O_WRONLY | os.O_CREAT)
        self.turns = [time.monotonic()]   # when one began
        self.start()

    def run(self):
        while True:
            os.pwrite(self.file, b"x", 0)
            os.fdatasync(self.file)
            time.sleep(self.PERIOD_S)
            self.turns.append(time.monotonic())

    def late_s(self, begin, end):
        """The longest turn that was going on between the two."""
        turns = [*self.turns, time.monotonic()]
        return max((b - a for a, b in zip(turns, turns[1:]) if b > begin and a < end), default=0.0) - self.PERIOD_S


def lines_of(folder):
    """Of all raw logs, read by other programs. A kill within a write leaves a line without an end: the last of its log, not a line."""
    for path in r.raw_logs(folder):
        if path.endswith(".zst"):
            text = subprocess.run(["zstd", "-dcq", path], capture_output=True, check=True, text=True).stdout
        else:
            with open(path, encoding="ascii") as file:
                text = file.read()
        yield from text.split("\n")[:-1]


def logged(folder):
    """Sync counts in the raw logs; raises on what is no candump line."""
    found = set()
    for line in lines_of(folder):
        if line.startswith("#"):   # where a daemon's life ended
            continue
        match = re.fullmatch(r"\(\d+\.\d{6}\) \S+ ([0-9A-F]{3,8})#([0-9A-F]*) [RT]", line)
        if not match:
            raise ValueError(f"{folder}: no line of candump: {line!r}")
        if int(match[1], 16) == SYNC:
            found.add(int.from_bytes(bytes.fromhex(match[2])[:4], "little"))
    return found


def mended(rig, folder):
    """Sync counts in the HDF5 files, one of each daemon's life, after `vibrig recover`, read by h5py."""
    import h5py
    run = subprocess.run([rig.program("vibrig"), "recover", folder, "--json"], capture_output=True, text=True, check=False,
                         timeout=60)
    if run.returncode != 0:
        raise ValueError(f"recover: status {run.returncode}: {run.stdout}{run.stderr}")
    found = set()
    for path in glob.glob(os.path.join(folder, "campaign*.h5")):
        with h5py.File(path, "r") as file:
            found |= {int(s) & 0xFFFFFFFF for s in file["samples/sequence"][:]}
    return found


class Kill:
    """One of them: a campaign started or resumed, the kill, and what is left."""

    def __init__(self, rig, witness, disk, rng):
        self.rig, self.witness, self.disk, self.rng = rig, witness, disk, rng
        self.results = []   # good, text, found
        self.done = []      # when seen, how many positions
        self.text = ""

    def check(self, good, text, found=""):
        self.results.append((bool(good), text, found))
        return bool(good)

    def run(self):
        before = self.files()
        if not self.begins():
            return
        delay = self.rng.uniform(0, LONGEST_S if self.rng.random() < 0.75 else 0.3)
        while (left := self.begun + delay - time.monotonic()) > 0:
            time.sleep(min(left, 0.3))
            asked = time.monotonic()
            status = self.rig.status() if left > 0.3 else None
            if status is not None:
                self.state = status["campaign"]["state"]
                if self.state not in ("tripped", "aborted", "finished"):   # recording ends there
                    self.going_on = asked
                before_this = (status["campaign"]["run"] - 1) * len(CAMPAIGN["positions_deg"]) + status["campaign"]["position"] - 1
                self.done.append((time.monotonic(), before_this))
        self.killed = time.monotonic()
        self.rig.daemon.process.kill()
        self.rig.daemon.process.wait()
        self.kept_s = KEPT_S + max(0.0, self.disk.late_s(self.killed - 3, self.killed))
        self.text = f"killed {self.killed - self.begun:.2f} s after {self.how}, {self.state}"
        # Asked after the kill: before it, the daemon itself may be about to end the level.
        time.sleep(0.1)   # what it sent last arrives
        moved = stages.shaker_state(self.rig) in (1, 2)   # the watchdog takes longer than this
        self.shaker(moved)
        self.journal()
        self.recording(before)

    def files(self):
        return set(glob.glob(os.path.join(self.rig.results, "killed-*", "campaign*.h5")))

    def begins(self):
        self.rig.start_daemon()
        status = self.rig.wait_for(lambda s: r.measuring(s) and s["shaker"].get("state") in (0, 4), 60)
        # The controller's watchdog has tripped; a stop that came before the table was at rest did not clear that.
        end = time.monotonic() + 30
        while status is not None and status["shaker"].get("state") == 4 and time.monotonic() < end:
            self.rig.tool("ack", "shaker", "--by", "test")
            status = self.rig.wait_for(lambda s: s["shaker"].get("state") == 0, 0.5)
        if status is not None and status["campaign"]["state"] == "tripped":
            self.rig.acknowledge(by="test")
        status = self.rig.wait_for(lambda s: s["shaker"].get("state") == 0 and not s["shaker"].get("running", True), 30)
        self.how = "resume" if status and status["campaign"].get("resume_offer") and self.rng.random() < 0.7 else "start"
        self.state = "just begun"
        said = [self.rig.arm("test"), self.rig.tool(self.how, "--by", "test")]
        self.begun = self.going_on = time.monotonic()
        return self.check(all(s.returncode == 0 for s in said), f"{self.how} is accepted",
                          f"{[s.stderr for s in said]}\n{self.rig.logs()}")

    def shaker(self, moved):
        end = time.monotonic() + 30
        while (state := stages.shaker_state(self.rig)) not in (0, 4) and time.monotonic() < end:
            time.sleep(0.05)
        faults = stages.shaker_state(self.rig, 1)
        took = time.monotonic() - self.killed
        good = state in (0, 4) and (not moved or faults & WATCHDOG)
        self.check(good, f"the shaker's watchdog stopped it, {took:.1f} s" if moved else "the shaker was and is at rest",
                   f"state {state}, faults {faults}")

    def journal(self):
        done = max((n for when, n in self.done if when < self.killed - self.kept_s), default=0)
        path = os.path.join(self.rig.results, "journal.sqlite3")
        with sqlite3.connect(f"file:{path}?mode=ro", uri=True, timeout=10) as database:
            sound = database.execute("PRAGMA integrity_check").fetchone()[0]
            dwells = database.execute("SELECT count(*) FROM dwell WHERE campaign = (SELECT max(id) FROM campaign)").fetchone()[0]
            last = database.execute("SELECT kind FROM command ORDER BY id DESC LIMIT 1").fetchone()
        database.close()
        known = last is not None and last[0] == self.how or self.killed - self.begun < self.kept_s
        self.check(sound == "ok" and dwells >= done and known, f"the journal is sound and knows {done} positions done",
                   f"{sound}, {dwells} positions, last command {last}")

    def recording(self, before):
        new = self.files() - before
        # It may have ended after the last look, and recording with it.
        wanted = self.witness.between(self.begun, min(self.going_on, self.killed - self.kept_s))
        if not new and not wanted:
            return
        if not self.check(len(new) == 1, f"the {self.how} has a recording", str(new)):
            return
        folder = os.path.dirname(new.pop())
        try:
            there = logged(folder)
            # The recorder begins a moment after the answer to the command.
            wanted -= self.witness.between(0, self.begun + KEPT_S / 2)
            lost = wanted - there
            self.check(not lost, f"its logs have all {len(wanted)} sync counts older than {self.kept_s:.1f} s",
                       f"lost {len(lost)}: {sorted(lost)[:3]}.. of {min(wanted, default=0)} to {max(wanted, default=0)}")
            lost = wanted - mended(self.rig, folder)
            self.check(not lost, "its HDF5 file opens once it is mended and has them too",
                       f"lost {len(lost)}: {sorted(lost)[:3]}.. of {min(wanted, default=0)} to {max(wanted, default=0)}")
        except (OSError, ValueError, KeyError, subprocess.SubprocessError) as error:
            self.check(False, "every file opens", f"{error}\n{sorted(os.listdir(folder))}")


def one_rig(programs, folder, name, kills, rng, disk, report):
    rig = r.Rig(programs, "seqpacket", "real", folder, poll_s=0.1)
    try:
        rig.start_plant("--seed", str(rng.randrange(1000)), "--warm-up", "1", "--start-temperature", "45")
        rig.be_punctual()
        rig.configure(CAMPAIGN, record=RECORD, **r.PATIENT)
        witness = Witness(rig.path)
        for number in range(kills):
            kill = Kill(rig, witness, disk, rng)
            try:
                kill.run()
            except Exception as error:   # of a thread: it has to be reported
                kill.check(False, "runs to its end", repr(error) + "\n" + rig.logs())
            rig.daemon.end()
            report(f"rig {name}, kill {number + 1}, {kill.text}", kill.results)
    finally:
        rig.stop()


def main():
    programs = r.programs_from_command_line(__doc__)
    seed = int(sys.argv[sys.argv.index("--seed") + 1]) if "--seed" in sys.argv else 1
    kills = 200 if "--soak" in sys.argv else 20
    checks, lock, begun = r.Checks(), threading.Lock(), time.monotonic()
    checks.note(f"seed {seed}")

    def report(what, results):
        with lock:
            for good, text, found in results:
                checks.check(good, f"{what}: {text}", "" if good else found)

    with tempfile.TemporaryDirectory() as folder:
        disk = Disk(folder)
        threads = [threading.Thread(target=one_rig, args=(programs, os.path.join(folder, str(n)), n, kills // RIGS,
                                                          random.Random(f"{seed}/{n}"), disk, report)) for n in range(1, RIGS + 1)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    checks.check(checks.count >= 3 * kills, f"{kills} kills were made", f"{checks.count} checks")
    checks.note(f"{kills} kills, {time.monotonic() - begun:.0f} s")
    return checks.end()


if __name__ == "__main__":
    sys.exit(main())
