#!/usr/bin/python3
"""vibrigd records on a disk that is read-only, fails with EIO, is full and takes 10 s for an fsync, one after the other
in one campaign on the real clock: measurement goes on, what is lost is reported once and accounted for to the sample.

usage: recording_faults.py PROGRAMS
"""
import glob
import json
import os
import signal
import subprocess
import sys
import tempfile
import time

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import rig as r  # noqa: E402

CAMPAIGN = {"name": "faults", "identify": "what-it-can", "positions_deg": [[0, 0, 0]], "table_g": [0.0],
            "dwell_s": 600.0, "settle_s": 2.0, "ramp_s": 1.0, "temperature_window_s": 0.0}
FSYNC_S = 10


class SickDisk:
    """A small tmpfs, and the library that makes it ill."""

    def __init__(self, folder):
        self.folder, self.control = os.path.join(folder, "disk"), os.path.join(folder, "control")
        self.library = os.path.join(folder, "sick_disk.so")
        os.mkdir(self.folder)
        self.set("-")
        subprocess.run(["c++", "-shared", "-fPIC", "-O1", "-o", self.library,
                        os.path.join(os.path.dirname(os.path.abspath(__file__)), "sick_disk.cpp")], check=True)
        mounted = subprocess.run(["mount", "-t", "tmpfs", "-o", "size=24m,ro", "none", self.folder], capture_output=True,
                                 text=True)
        self.refused = mounted.stderr.strip() if mounted.returncode else ""

    def environment(self):
        return {"LD_PRELOAD": self.library, "SICK_FOLDER": self.folder, "SICK_CONTROL": self.control,
                "SICK_SECONDS": str(FSYNC_S)}

    def set(self, state):
        with open(self.control + ".new", "w", encoding="ascii") as file:
            file.write(state)
        os.replace(self.control + ".new", self.control)

    def remount(self, how):
        subprocess.run(["mount", "-o", "remount," + how, self.folder], check=True)

    def fill(self):
        with open(os.path.join(self.folder, "filler"), "wb", buffering=0) as file:
            try:
                while True:
                    file.write(b"\0" * 4096)
            except OSError:
                pass

    def make_room(self):
        os.remove(os.path.join(self.folder, "filler"))

    def end(self):
        subprocess.run(["umount", "-l", self.folder], check=False, capture_output=True)


def logged(rig, words):
    return [line for line in rig.tool("events").stdout.splitlines() if "recorder" in line and words in line]


def good(status):
    return status["recorder"].get("good", False)


def measuring(checks, rig, what):
    """Whatever the disk does, samples arrive, none is dropped on the way to the filter, and nothing trips."""
    before = rig.status()["sample"]["sequence"]
    status = rig.wait_for(lambda s: s["sample"]["sequence"] > before + 20, 30)
    checks.check(status["sample"]["sequence"] > before + 20 and r.number(status["estimator_ring"].get("dropped", 0)) == 0 and
                 status["campaign"]["state"] not in ("tripped", "aborted"),
                 f"{what}: measurement goes on", f"{before} {status['sample']} {status['estimator_ring']} {r.state_of(status)}")


def ill_and_well(checks, rig, what, say, fall_ill, get_well, next_file):
    before = len(logged(rig, say))
    fall_ill()
    status = rig.wait_for(lambda s: not good(s), 30)
    checks.check(not good(status) and say in status["recorder"]["note"], f"{what}: recording says that it is degraded",
                 str(status["recorder"]))
    time.sleep(1.6)   # it has tried again, and found the same
    measuring(checks, rig, what)
    checks.equal(len(logged(rig, say)) - before, 1, f"{what}: it is reported once")
    get_well()
    status = rig.wait_for(good, 30)
    checks.check(good(status) and status["recorder"]["file"].endswith(next_file) and
                 r.number(status["recorder"]["samples_lost"]) > 0, f"{what}: then it goes on",
                 str(status["recorder"]))


def slow_fsync(checks, rig, disk):
    segments = r.number(rig.status()["recorder"].get("segments", 0))
    before = rig.status()["recorder"]
    disk.set("s")
    status = rig.wait_for(lambda s: not good(s), 30)
    checks.check("no answer for" in status["recorder"]["note"], "fsync of 10 s: recording says that it is degraded",
                 str(status["recorder"]))
    disk.set("-")
    measuring(checks, rig, "fsync of 10 s")
    status = rig.wait_for(lambda s: good(s) and r.number(s["recorder"].get("segments", 0)) > segments, 60)
    checks.check(good(status) and status["recorder"]["samples_lost"] == before["samples_lost"] and
                 status["recorder"]["file"] == before["file"], "fsync of 10 s: then it goes on, nothing is lost",
                 str(status["recorder"]))
    def counts():
        return len(logged(rig, "does not go on")), len(logged(rig, "goes on again"))

    rig.wait_for(lambda s: counts()[0] == counts()[1], 30)
    # A segment takes two of them, and the second may be slow, too.
    checks.check(counts()[0] == counts()[1] in (1, 2), "fsync of 10 s: it is reported once, and that it is over", str(counts()))


def accounts(checks, rig, disk):
    """After SIGKILL: what is there and what the gaps say is everything between the first and the last."""
    rig.daemon.process.kill()
    rig.daemon.process.wait()
    folder = glob.glob(os.path.join(disk.folder, "faults-*"))[0]
    run = subprocess.run([rig.program("vibrig"), "recover", folder, "--json"], capture_output=True, text=True)
    found = json.loads(run.stdout or "{}")
    parts = [name for name in ("campaign.h5", "campaign-2.h5", "campaign-3.h5") if os.path.exists(os.path.join(folder, name))]
    checks.check(run.returncode == 0 and found["parts"] == len(parts) >= 2 and not found["was_closed"] and
                 found["dwell_in_progress"].startswith("run 1 position 1: "), "recover says what was in progress",
                 run.stdout + run.stderr)
    import h5py
    sequence, gaps = [], []
    for name in parts:
        with h5py.File(os.path.join(folder, name), "r") as file:
            sequence += list(file["samples/sequence"][:])
            gaps += [(stream.decode().rstrip("\0"), int(lost), reason.decode().rstrip("\0")) for stream, lost, reason in
                     zip(file["gaps/stream"][:], file["gaps/lost"][:], file["gaps/reason"][:])]
    lost = [g for g in gaps if g[0] == "samples"]
    missing = sequence[-1] - sequence[0] + 1 - len(set(sequence))
    # The first gap is of what came before the first sample.
    checks.check(len(lost) == len(parts) and sum(g[1] for g in lost[1:]) >= missing > 0, "gaps tell of every sample that is not there",
                 f"missing {missing}, gaps {gaps}")
    checks.check(all(any(words in g[2] for g in gaps) for words in ("Read-only", "Input/output", "No space")),
                 "and why", str(lost))
    checks.equal(found["samples_missing"], missing, "recover counts them")
    dump = subprocess.run(["h5dump", "-H", os.path.join(folder, "campaign-2.h5")], capture_output=True)
    checks.equal(dump.returncode, 0, "others can read a file that was given up")
    text = subprocess.run([rig.program("vibrig"), "recover", folder], capture_output=True, text=True).stdout
    checks.check("mended before: nothing to mend" in text and "Read-only" in text, "a second time there is nothing to mend", text)


def main():
    programs = r.programs_from_command_line(__doc__)
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))   # or the disk would stay mounted
    checks = r.Checks()
    begun = time.monotonic()
    with tempfile.TemporaryDirectory() as folder:
        disk = SickDisk(folder)
        if disk.refused:
            checks.skip("recording on a sick disk", disk.refused)
            return checks.end()
        rig = r.Rig(programs, "seqpacket", "real", folder)
        try:
            rig.start_plant("--seed", "1", "--warm-up", "1", "--start-temperature", "45")
            rig.be_punctual()
            rig.configure(CAMPAIGN, record={"folder": disk.folder, "segment_s": 3.0, "keep_free_mb": 0, "flush_s": 0.5},
                          **r.PATIENT)
            rig.daemon = r.Child("vibrigd", [rig.program("vibrigd"), "--config", rig.configuration], folder,
                                 disk.environment())
            rig.wait_for(r.measuring, 60)

            checks.check(rig.status() is not None, "vibrigd measures", rig.logs())

            def start():
                rig.wait_for(lambda s: s["platform"].get("ready") and s["shaker"].get("rest") == "at rest", 60)
                end = time.monotonic() + 60   # a busy machine may be late with samples, and so with their rate
                for command in ("arm", "start"):
                    while (run := rig.tool(command, "--by", "test")).returncode != 0 and time.monotonic() < end:
                        time.sleep(0.5)
                    checks.check(run.returncode == 0, f"{command}: accepted", run.stderr)

            ill_and_well(checks, rig, "read-only", "Read-only file system", start, lambda: disk.remount("rw"),
                         "/campaign.h5")
            rig.wait_for_state(("recording",), 60)
            ill_and_well(checks, rig, "EIO", "Input/output error", lambda: disk.set("e"), lambda: disk.set("-"),
                         "/campaign-2.h5")
            ill_and_well(checks, rig, "full disk", "No space left", disk.fill, disk.make_room,
                         ("/campaign-2.h5", "/campaign-3.h5"))   # the file may have had room for what came
            slow_fsync(checks, rig, disk)
            accounts(checks, rig, disk)
        finally:
            rig.stop()
            disk.end()
    checks.note(f"{time.monotonic() - begun:.0f} s")
    return checks.end()


if __name__ == "__main__":
    sys.exit(main())
