#!/usr/bin/python3
"""The journal is what was written into it, or it is said: deleted, edited, set back while the real daemon runs or between two
of its lives; SIGKILL at random moments leaves a whole one. On the seqpacket bus and the rig's clock.

usage: journal_chain.py PROGRAMS [--seed N]
"""
import contextlib
import glob
import hashlib
import json
import os
import random
import re
import shutil
import sqlite3
import subprocess
import sys
import tempfile
import time

import h5py

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import latches  # noqa: E402
import rig as r  # noqa: E402

KILLS = 12
PERIOD_S = 60   # of the rows; the file itself is looked at each second


class Journal:
    """Of a rig, and what vibrig says of it."""

    def __init__(self, rig):
        self.rig, self.path = rig, os.path.join(rig.results, "journal.sqlite3")

    def verify(self, *more):
        run = subprocess.run([self.rig.program("vibrig"), "journal", "verify", self.path, "--json", *more],
                                       capture_output=True, text=True, timeout=60)
        return run.returncode, (json.loads(run.stdout) if run.stdout else {"found": [run.stderr]})

    def by_hand(self, sql):
        with contextlib.closing(sqlite3.connect(self.path, timeout=5)) as database, database:
            database.execute(sql)

    def latch(self, timeout_s=20):
        """Its cause, once the daemon has found something; how long that took."""
        begun, found = time.monotonic(), []

        def there(status):
            found[:] = [latch["cause"] for latch in status["interlock"]["latches"] if latch["name"] == "journal"]
            return found
        self.rig.wait_for(there, timeout_s)
        return (found or [""])[0], time.monotonic() - begun


def says_its_configuration(checks, rig, journal, what):
    """A row of the signed chain has the SHA-256 of the configuration in force, as --check and a recording give it."""
    check = subprocess.run([rig.program("vibrigd"), "--check", "--config", rig.configuration], capture_output=True, text=True, check=True)
    above, digest = re.search(r"(?s)(.*)^# SHA-256 of what stands above: (\w{64})$", check.stdout, re.M).groups()
    checks.equal(hashlib.sha256(above.encode()).hexdigest(), digest, f"{what}: --check gives the SHA-256 of what it prints")
    with contextlib.closing(sqlite3.connect(journal.path, timeout=5)) as database:
        rows = [text for (text,) in database.execute("SELECT text FROM event WHERE source = 'configuration' AND text LIKE 'in force: %'")]
    checks.check(rows and all(f"SHA-256 {digest}, " in row for row in rows), f"{what}: the journal has it of the configuration in force", rows)
    return digest


def whole(checks, rig, journal):
    says_its_configuration(checks, rig, journal, "at the start")
    status = rig.wait_for(lambda s: s["journal"]["verified"], 10)
    code, verdict = journal.verify()
    checks.check(code == 0 and verdict["found"] == [], "a running daemon's journal verifies", str(verdict))
    checks.equal(verdict["public_key"], status["journal"]["public_key"], "with the key that the status names")
    for stated in (verdict["public_key"], verdict["fingerprint"]):
        code, found = journal.verify("--key", stated)
        checks.check(code == 0, "which may be stated in full, or by its fingerprint", str(found))
    another = "SHA256:0123456789abcdef"
    code, found = journal.verify("--key", another)
    checks.check(code == 1 and found["found"] == [f"is signed with {verdict['fingerprint']}, expected {another}"],
                 "another one has not signed it", str(found))
    key = os.stat(journal.path + ".key")
    checks.equal(key.st_mode & 0o777, 0o600, "which the daemon alone can read")
    tested = json.loads(rig.tool("selftest", "--json").stdout)
    checks.check(any(c["name"] == "journal" and c["passed"] and "verified" in c["text"] for c in tested["checks"]),
                 "selftest says that it was verified", str(tested))
    armed = rig.tool("arm", "--by", "Ada")
    checks.check(armed.returncode == 0, "and it arms", armed.stderr)
    rig.tool("abort", "--by", "Ada")


def named_and_acknowledged(checks, rig, journal, what, says, within_s):
    cause, after_s = journal.latch()
    checks.check(says in cause, f"{what}: named while it runs", cause + rig.logs())
    checks.check(after_s < within_s, f"{what}: within {within_s} s", f"{after_s:.1f} s")
    refused = rig.tool("arm", "--by", "Ada")
    checks.check(refused.returncode == 1 and "vibrig ack journal" in refused.stderr, f"{what}: no arming",
                 refused.stdout + refused.stderr)
    trip = rig.tool("ack", "trip", "--by", "Ada")
    checks.check(trip.returncode == 1, f"{what}: a trip's acknowledgement is not the journal's", trip.stdout)
    code, verdict = journal.verify()
    checks.check(code == 0, f"{what}: a new one goes on, and is whole", str(verdict))
    says_its_configuration(checks, rig, journal, what)
    rig.kill()
    rig.start()
    checks.check(journal.latch()[0] != "", f"{what}: SIGKILL does not acknowledge it", str(rig.latches()))
    answer = rig.tool("ack", "journal", "--by", "Grace")
    armed = rig.arm("Ada")
    checks.check(answer.returncode == 0 and armed.returncode == 0, f"{what}: acknowledged by a named person it arms",
                 answer.stderr + armed.stderr)
    rig.tool("abort", "--by", "Ada")


def while_it_runs(checks, rig, journal):
    os.remove(journal.path)
    named_and_acknowledged(checks, rig, journal, "deleted", "was deleted while the daemon ran", PERIOD_S)
    checks.check(rig.paged("was deleted while the daemon ran"), "deleted: somebody is paged, as for each alarm")
    kept = len(glob.glob(journal.path + ".aside.*.head"))
    journal.by_hand("UPDATE event SET text = 'all good' WHERE id = 2")
    named_and_acknowledged(checks, rig, journal, "UPDATE by hand", "event 2 (entry", PERIOD_S)
    checks.check(len(glob.glob(journal.path + ".aside.*.head")) == kept + 1, "UPDATE by hand: the file is put aside",
                 str(os.listdir(rig.results)))


def halved(checks, rig, journal):
    """Between two lives; what to do about it is said wherever it is met."""
    rig.daemon.end()
    os.truncate(journal.path, os.path.getsize(journal.path) // 2)
    code, verdict = journal.verify()
    checks.check(code == 1 and "is damaged: a part of it is missing" in verdict["found"][0], "halved: verify says damaged",
                 str(verdict))
    rig.start()
    cause, _ = journal.latch()
    checks.check("is damaged: a part of it is missing" in cause and "; put aside as " in cause and "cannot write" not in cause,
                 "halved: the next start names it as damaged, and where it is now", cause)
    to_do = "vibrig ack journal --by NAME"
    says = {"arm": rig.tool("arm", "--by", "Ada").stderr, "selftest": rig.tool("selftest").stdout, "log": rig.logs()}
    checks.equal([place for place, text in says.items() if to_do not in text], [], "halved: what to do is said")
    answer = rig.tool("ack", "journal", "--by", "Grace")
    armed = rig.arm("Ada")
    checks.check(answer.returncode == 0 and armed.returncode == 0, "halved: acknowledged it arms", answer.stderr + armed.stderr)
    rig.tool("abort", "--by", "Ada")


def killed_at_random(checks, rig, journal, seed):
    chance, broken, latched = random.Random(seed), [], []
    for number in range(KILLS):
        rig.tool("arm", "--by", "Ada")
        time.sleep(chance.uniform(0, 0.3))
        rig.kill()
        code, verdict = journal.verify()
        if code != 0:
            broken.append((number, verdict["found"]))
        rig.start()
        names = rig.latches()
        if names is None or "journal" in names:
            latched.append((number, names))
        rig.tool("ack", "trip", "--by", "Ada")
    checks.equal(broken, [], f"{KILLS} times SIGKILL (seed {seed}): it verifies each time")
    checks.equal(latched, [], "and the next start finds nothing")


def recorded(checks, rig, journal):
    """A head of it is kept in the recording: by it a journal that was set back is known."""
    rig.arm("Ada")
    rig.tool("start", "--by", "Ada")
    rig.wait_for_state(("recording",), 60)
    rig.daemon.end()
    copy = os.path.join(rig.folder, "copy")
    os.mkdir(copy)
    for part in ("", ".head"):
        shutil.copy(journal.path + part, copy)
    rig.start()
    rig.tool("arm", "--by", "Ada")
    rig.tool("start", "--by", "Ada")
    rig.wait_for_state(("recording",), 60)
    rig.tool("abort", "--by", "Ada")
    rig.wait_for(lambda s: s["campaign"]["state"] == "aborted" and not s["recorder"]["recording"], 60)
    rig.daemon.end()
    recording = max(glob.glob(os.path.join(rig.results, "*", "campaign*.h5")), key=os.path.getmtime)
    code, verdict = journal.verify("--anchor", recording)
    checks.check(code == 0, "the recording's head is in the journal", str(verdict))
    with h5py.File(recording, "r") as file:
        checks.equal(file.attrs["configuration_sha256"].decode(), says_its_configuration(checks, rig, journal, "after a campaign"),
                     "and its configuration is the one that the journal says was in force")
    for part in ("", ".head"):
        shutil.copy(os.path.join(copy, "journal.sqlite3" + part), rig.results)
    checks.equal(journal.verify()[0], 0, "set back to a copy it is whole by itself")
    code, verdict = journal.verify("--anchor", recording)
    checks.check(code == 1 and "ends at entry" in verdict["found"][0], "by the recording's head it is not", str(verdict))
    missing = journal.verify("--anchor", os.path.join(rig.folder, "vibrigd.toml"))
    checks.check(missing[0] == 2 and "no signed head" in missing[1]["found"][0], "an anchor that is none: status 2",
                 str(missing))
    rig.start()
    cause, _ = journal.latch()
    checks.check("ends at entry" in cause and recording in cause, "the next start names it", cause)
    rig.tool("ack", "journal", "--by", "Ada")
    rig.kill()
    rig.start()
    checks.equal(rig.latches(), [], "once")


def main():
    programs = r.programs_from_command_line(__doc__)
    seed = int(sys.argv[sys.argv.index("--seed") + 1]) if "--seed" in sys.argv else 1
    checks = r.Checks()
    with tempfile.TemporaryDirectory() as folder:
        rig = latches.Rig(programs, folder)
        journal = Journal(rig)
        try:
            rig.start()
            whole(checks, rig, journal)
            while_it_runs(checks, rig, journal)
            halved(checks, rig, journal)
            killed_at_random(checks, rig, journal, seed)
            recorded(checks, rig, journal)
        finally:
            rig.stop()
    return checks.end()


if __name__ == "__main__":
    sys.exit(main())
