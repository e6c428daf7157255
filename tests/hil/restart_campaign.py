#!/usr/bin/python3
"""Kills vibrigd with SIGKILL in the midst of a campaign, over and over, and resumes it, on the seqpacket bus and the
rig's clock. What was done stays done, the shaker never starts by itself, and a bad checkpoint is not used.

usage: restart_campaign.py PROGRAMS
"""
import glob
import json
import os
import shutil
import signal
import socket
import sqlite3
import sys
import tempfile
import time

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import rig as r  # noqa: E402

CAMPAIGN = {"name": "restarted", "identify": "what-it-can",
            "positions_deg": [[0, 0, 0], [45, 0, 90], [0, 0, 90]], "table_g": [9.0, 7.0],
            "dwell_s": 20.0}
POSITIONS = 6


def journal(rig):
    return os.path.join(rig.results, "journal.sqlite3")


def kill(rig):
    rig.daemon.process.kill()
    rig.daemon.process.wait()


def events(rig):
    return rig.tool("events").stdout


def restart(checks, rig, what):
    begun = time.monotonic()
    rig.start_daemon()
    status = rig.wait_for(r.measuring, 60)
    checks.check(status is not None and r.measuring(status), f"{what}: the daemon measures again", rig.logs())
    checks.note(f"{what}: measures {time.monotonic() - begun:.1f} s after its start")
    return status


def at_rest(checks, rig, what):
    """Nobody has armed: whatever the shaker did, it comes to rest and stays there."""
    status = rig.wait_for(lambda s: s["shaker"].get("state") == 0 and not s["shaker"].get("running", True), 60)
    checks.check(status is not None and status["shaker"].get("state") == 0, f"{what}: the shaker comes to rest",
                 str(status and status["shaker"]))
    for _ in range(4):
        time.sleep(0.25)
        status = rig.status()
        if not checks_rest(status):
            checks.check(False, f"{what}: the shaker stays at rest", str(status and status["shaker"]))
            return
    checks.check(True, f"{what}: the shaker stays at rest")
    checks.check(status["campaign"]["state"] in ("idle", "tripped"), f"{what}: disarmed", r.state_of(status))


def checks_rest(status):
    return status is not None and status["shaker"].get("state") == 0 and status["shaker"].get("running") is False


def clear(rig):
    """A shaker left running trips the interlock, which latches."""
    if rig.status()["campaign"]["state"] == "tripped":
        rig.acknowledge(by="tester")


def take_up(checks, rig, what, count):
    """Killed, started again and resumed on command: what was done of so many positions is offered, and goes on."""
    time.sleep(1)   # what is older than a second has to be on disk
    kill(rig)
    known = rig.positions_done()
    status = restart(checks, rig, what)
    checks.check(f"{known} of {count} positions done" in status["campaign"]["resume_offer"], f"{what}: it offers to go on from there",
                 status["campaign"]["resume_offer"])
    at_rest(checks, rig, what)
    clear(rig)
    rig.arm("Grace")
    on = rig.tool("resume", "--by", "Grace")
    checks.check(on.returncode == 0 and f"{known} of {count}" in on.stdout, f"{what}: armed, it resumes on command", on.stdout + on.stderr)


def begin(rig):
    rig.start_plant("--seed", "3", "--speed", "20")
    rig.configure(CAMPAIGN)
    rig.start_daemon()
    rig.wait_for(r.measuring, 60)
    for command in ("arm", "start"):
        rig.tool(command, "--by", "Ada")


def killed_and_resumed(checks, programs, folder):
    rig = r.Rig(programs, "seqpacket", "rig", folder, poll_s=0.05)
    try:
        begin(rig)
        for kills in (1, 3):
            status = rig.wait_for(lambda s, n=kills: len(s["campaign"]["dwells"]) >= n and
                                  s["campaign"]["state"] == "recording", 120)
            checks.check(status is not None and status["campaign"]["state"] == "recording",
                         f"recording after {kills} positions", r.state_of(status))
            time.sleep(1)   # what is older than a second has to be on disk
            kill(rig)
            done = rig.positions_done()
            checks.check(done >= kills, f"killed: {kills} finished positions are on disk", f"{done}")
            status = restart(checks, rig, f"killed after {kills}")
            checks.check(f"{done} of {POSITIONS} positions done" in status["campaign"]["resume_offer"],
                         "it offers to resume from the last finished position", status["campaign"]["resume_offer"])
            at_rest(checks, rig, f"killed after {kills}")
            clear(rig)
            refused = rig.tool("resume", "--by", "Grace")
            checks.check(refused.returncode == 1 and "not armed" in refused.stderr, "it does not resume disarmed",
                         refused.stderr)
            armed = rig.arm("Grace")
            checks.check(armed.returncode == 0, "it can be armed", armed.stderr)
            time.sleep(0.5)
            checks.check(checks_rest(rig.status()), "arming moves nothing")
            resumed = rig.tool("resume", "--by", "Grace")
            checks.check(resumed.returncode == 0 and f"{done} of {POSITIONS}" in resumed.stdout,
                         "armed, it resumes on command", resumed.stdout + resumed.stderr)
        last = rig.wait_for_state(("finished", "aborted", "tripped"), 180)
        checks.check(last is not None and last["campaign"]["state"] == "finished", "the campaign finishes",
                     r.state_of(last) + "\n" + rig.logs())
        places = [(d["run"], d["position"]) for d in last["campaign"]["dwells"]]
        checks.equal(places, [(run, position) for run in (1, 2) for position in (1, 2, 3)],
                     "every position was recorded once, in order")
        path, _ = rig.result()
        checks.check(path is not None, "there is a result.json")
        checks.equal(rig.daemon.end(signal.SIGTERM, timeout=30), 0, "SIGTERM ends vibrigd with status 0")
        with sqlite3.connect(f"file:{journal(rig)}?mode=ro", uri=True) as database:
            checks.equal(database.execute("PRAGMA integrity_check").fetchone()[0], "ok", "the journal is sound")
            checks.equal([(state, by.split(" (")[0]) for state, by in
                          database.execute("SELECT state, started_by FROM campaign")],
                         [("finished", "Ada")], "it is one campaign, finished")
            commands = [(kind, person.split(" (")[0]) for kind, person in database.execute(
                "SELECT kind, person FROM command WHERE accepted AND kind <> 'acknowledge' ORDER BY id")]
            checks.equal(commands, [("arm", "Ada"), ("start", "Ada")] + [("arm", "Grace"), ("resume", "Grace")] * 2,
                         "it knows who did what")
    finally:
        rig.stop()


def ended_in_order(checks, programs, folder):
    """SIGTERM, as the service manager's stop, is an abort: the campaign is over, as docs/operating.md says."""
    rig = r.Rig(programs, "seqpacket", "rig", folder, poll_s=0.05)
    try:
        begin(rig)
        rig.wait_for(lambda s: len(s["campaign"]["dwells"]) >= 1 and s["campaign"]["state"] == "recording", 120)
        checks.equal(rig.daemon.end(signal.SIGTERM, timeout=60), 0, "stopped in a dwell: vibrigd ends in order")
        with sqlite3.connect(f"file:{journal(rig)}?mode=ro", uri=True) as database:
            checks.equal(database.execute("SELECT state, reason FROM campaign").fetchall(), [("aborted", "the daemon is shutting down")],
                         "stopped in a dwell: the campaign is aborted, and why")
        checks.check(os.path.exists(os.path.join(rig.results, "result-partial.json")), "stopped in a dwell: there is a partial result")
        status = restart(checks, rig, "stopped in a dwell")
        checks.equal((status["campaign"]["state"], status["campaign"].get("resume_offer", "")), ("idle", ""),
                     "stopped in a dwell: nothing is latched, and nothing is offered")
        rig.arm("Grace")
        refused = rig.tool("resume", "--by", "Grace")
        checks.check(refused.returncode == 1 and "not paused" in refused.stderr, "stopped in a dwell: there is nothing to resume", refused.stderr)
    finally:
        rig.stop()


def noise_in_force(status):
    return [gyro["in_force_deg_per_rt_h"] for gyro in status["noise"]["gyros"]]


def estimates(rig):
    """The result so far: 30 coefficients and their covariance, as many digits as there are, and what is to be believed of them."""
    with socket.socket(socket.AF_UNIX) as link:
        link.settimeout(10)
        link.connect(rig.socket)
        link.sendall(b"GET /api/v1/parameters HTTP/1.1\r\nHost: rig\r\nConnection: close\r\n\r\n")
        answer = b""
        while more := link.recv(65536):
            answer += more
    return json.loads(answer.partition(b"\r\n\r\n")[2])


def judged(rig, dwells):
    """The same, once so many dwells have been judged, which is done beside the campaign."""
    end = time.monotonic() + 30
    while (found := estimates(rig)).get("assessed", {}).get("dwells") != dwells and time.monotonic() < end:
        time.sleep(0.05)
    return found


def noise_goes_on(checks, programs, folder):
    """Gyros eight times as noisy as the filter assumes: its N is changed between positions. Killed after that, it goes
    on with what filter and noise monitor had learnt, as if nothing had happened."""
    rig = r.Rig(programs, "seqpacket", "rig", folder, poll_s=0.05)
    try:
        rig.start_plant("--seed", "4", "--speed", "60", "--fault", "gyro-noise=8@0")
        # A reply of a rig whose time stands still is late in real time.
        rig.configure({**CAMPAIGN, "positions_deg": [[0, 0, 15 * k] for k in range(8)], "dwell_s": 30.0}, shaker={"response_timeout_ms": 20000})
        rig.start_daemon()
        rig.wait_for(r.measuring, 60)
        configured = noise_in_force(rig.status())
        for command in ("arm", "start"):
            rig.tool(command, "--by", "Ada")
        changed = rig.wait_for(lambda s: len(s["campaign"]["dwells"]) >= 10 and noise_in_force(s) != configured, 120)
        rig.tool("pause", "--by", "Ada")
        before = rig.wait_for_state(("paused",), 60)
        checks.check(changed is not None and noise_in_force(before) != configured,
                     "noisy gyros: the monitor changes the filter's N (seed 4)", rig.logs())
        dwells = len(before["campaign"]["dwells"])
        learnt = judged(rig, dwells)
        time.sleep(1)
        kill(rig)
        done = rig.positions_done()
        restart(checks, rig, "noisy gyros, killed")
        clear(rig)
        rig.arm("Grace")
        # The rig's time stands still with it: no further dwell is done before the estimates are asked for.
        rig.plant.process.send_signal(signal.SIGSTOP)
        try:
            resumed = rig.tool("resume", "--by", "Grace")
            checks.check(resumed.returncode == 0 and f"{done} of 16" in resumed.stdout,
                         "noisy gyros: it resumes, no cold start", resumed.stderr + events(rig))
            after = rig.wait_for(lambda s: noise_in_force(s) != configured, 10)
            checks.equal(noise_in_force(after), noise_in_force(before), "noisy gyros: with the N that it had come to")
            again = judged(rig, dwells)
            checks.check("assessed" in learnt and learnt == again,
                         "noisy gyros: with the estimates and uncertainties that it had come to, to the last digit", str(again)[-3000:])
        finally:
            rig.plant.process.send_signal(signal.SIGCONT)
        last = rig.wait_for_state(("finished", "aborted", "tripped"), 120)
        checks.check(last is not None and last["campaign"]["state"] == "finished", "noisy gyros: the campaign finishes",
                     r.state_of(last) + rig.logs())
        checks.equal(len(last["campaign"]["dwells"]), 16, "noisy gyros: with all its positions")
    finally:
        rig.stop()


class Kept:
    """The journal as it was, with what lies beside it."""

    def __init__(self, rig, folder):
        self.rig, self.folder = rig, os.path.join(folder, "kept")
        os.mkdir(self.folder)
        for path in glob.glob(journal(rig) + "*"):
            shutil.copy(path, self.folder)

    def put_back(self):
        for path in glob.glob(journal(self.rig) + "*"):
            os.remove(path)
        for name in os.listdir(self.folder):
            shutil.copy(os.path.join(self.folder, name), self.rig.results)


def not_used(checks, programs, folder):
    """Damage to the journal: a cold start, and said so."""
    rig = r.Rig(programs, "seqpacket", "rig", folder, poll_s=0.05)
    try:
        rig.start_plant("--seed", "3", "--speed", "20")
        rig.configure({**CAMPAIGN, "dwell_s": 10.0})
        rig.start_daemon()
        rig.wait_for(r.measuring, 60)
        for command in ("arm", "start"):
            rig.tool(command, "--by", "Ada")
        rig.wait_for(lambda s: len(s["campaign"]["dwells"]) >= 1 and s["campaign"]["state"] == "recording", 120)
        time.sleep(1)
        kill(rig)
        kept = Kept(rig, folder)
        for what, change in (("edited", "UPDATE dwell SET checkpoint = x'00'"), ("a row removed", "DELETE FROM dwell")):
            kept.put_back()
            with sqlite3.connect(journal(rig)) as database:
                database.execute(change)
            database.close()
            status = restart(checks, rig, what)
            said = events(rig)
            checks.check("dwell 1 (entry " in said and "cold start" in said, f"{what}: it says that it starts cold", said)
            checks.equal(status["campaign"].get("resume_offer", ""), "", f"{what}: it offers nothing to resume")
            kill(rig)
        kept.put_back()
        rig.configure({**CAMPAIGN, "dwell_s": 11.0})
        status = restart(checks, rig, "foreign")
        checks.check("of another configuration: cold start" in events(rig), "foreign: it says so", events(rig))
        checks.equal(status["campaign"].get("resume_offer", ""), "", "foreign: it offers nothing to resume")
        kill(rig)
        for beside in ("-wal", "-shm"):   # the first page may stand there too
            if os.path.exists(journal(rig) + beside):
                os.remove(journal(rig) + beside)
        with open(journal(rig), "r+b") as file:
            file.write(b"x" * 4096)
        restart(checks, rig, "no database")
        checks.check("put aside" in events(rig), "no database: put aside, and said so", events(rig))
        at_rest(checks, rig, "no database")
    finally:
        rig.stop()


def main():
    programs = r.programs_from_command_line(__doc__)
    checks = r.Checks()
    for part in (killed_and_resumed, ended_in_order, noise_goes_on, not_used):
        with tempfile.TemporaryDirectory() as folder:
            part(checks, programs, folder)
    return checks.end()


if __name__ == "__main__":
    sys.exit(main())
