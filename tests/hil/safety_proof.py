#!/usr/bin/python3
"""The safe-state proof, on the seqpacket bus and the rig's clock, with the simulated rig held to what a real one is held
to: no campaign is armed without one, an honest controller passes, each lying one is found out, and what is proved is kept.

usage: safety_proof.py PROGRAMS
"""
import glob
import json
import math
import os
import sqlite3
import subprocess
import sys
import tempfile

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import modbus_proxy  # noqa: E402
import rig as r  # noqa: E402

CAMPAIGN = {"name": "proved", "identify": "what-it-can", "positions_deg": [[0, 0, 0]], "table_g": [5.0], "dwell_s": 10.0}
TIMEOUT_S, DEADLINE_S, RING_DOWN_S = 1.5, 3.0, 3.0   # defaults: watchdog, stop, allowance for the pads
# Truth of the shaker's controller, and a word that the proof's message has to have.
LIES = [
    ("ack_without_stop", True, "not obeyed"),
    ("stuck_contactor", True, "not obeyed"),
    ("timeout_ignored", True, "watchdog"),
    ("timeout_scaled", 10.0, "watchdog"),
    ("amplitude_scaled", 2.5, "amplitude"),
    ("unit_rms", True, "g rms for g peak"),
    ("readback_echo", True, None),      # alone it hides nothing that moves: found with a dead table
    ("slow_ramp", 10.0, "shaker"),
    ("dead_table", True, "amplitude"),
]


def ready(status):
    return status["can"]["link"] == "running" and status["shaker"]["link"] == "running" and \
        status["platform"].get("ready") and status["shaker"].get("state") == 0


class Proof:
    """A rig with a truth of its own, and a daemon that measures."""

    def __init__(self, checks, programs, folder, shaker=None, proxied=False, **tables):
        self.rig = r.Rig(programs, "seqpacket", "rig", folder, poll_s=0.1)
        self.rig.start_plant("--seed", "4", "--warm-up", "1", "--start-temperature", "45", "--speed", "40",
                             "--truth", self.rig.truth_file({"shaker": shaker or {}}))
        own = self.rig.modbus_port
        if proxied:
            self.proxy = modbus_proxy.Proxy(own)
            self.rig.modbus_port = self.proxy.port
        self.rig.configure(CAMPAIGN, **{"commission": {"enforce": True}, **tables})
        self.rig.modbus_port = own
        self.rig.start_daemon()
        checks.check(ready(self.rig.wait_for(ready, 60) or {"can": {"link": ""}}), "the rig is ready", self.rig.logs())

    def make(self, *more):
        return self.rig.tool("selftest", "--by", "Ada", *more, timeout=120)

    def proof(self):
        return (self.rig.status() or {}).get("proof", {})

    def end(self):
        self.rig.stop()


def recorded(checks, p, proof):
    """A campaign takes its proof along, into recording and report."""
    p.rig.tool("start", "--by", "Ada")
    last = p.rig.wait_for(lambda s: s["campaign"]["state"] in ("finished", "aborted", "tripped") and not s["recorder"].get("recording"), 60)
    checks.equal(r.state_of(last), "finished", "and finishes")
    found = glob.glob(os.path.join(p.rig.results, "proved-*", "campaign.h5"))
    if not checks.check(found, "it is recorded", os.listdir(p.rig.results)):
        return
    dump = subprocess.run(["h5dump", "-d", "/proof", "-o", os.path.join(p.rig.folder, "proof"), "-b", found[0]], capture_output=True,
                          text=True, check=False)
    with open(os.path.join(p.rig.folder, "proof"), encoding="utf-8") as file:
        kept = json.loads(file.read().rstrip("\0"))
    checks.check(kept["newest"]["utc_ns"] == r.number(proof["utc_ns"]) and kept["newest"]["keys_sha256"] == proof["keys_sha256"] and
                 "platform over command" in [row["name"] for row in kept["newest"]["rows"]],
                 "the recording has the proof: when, times, ratios, hash of the keys", dump.stderr + str(kept)[:600])
    page = os.path.join(p.rig.folder, "report.html")
    made = subprocess.run([p.rig.program("vibrig"), "report", os.path.dirname(found[0]), "-o", page], capture_output=True, text=True,
                          check=False)
    with open(page, encoding="utf-8") as file:
        text = file.read()
    checks.check(all(word in text for word in ("Proof of the safe state", "Ada", proof["keys_sha256"], "stop, platform", "platform over command",
                                               "there is no trend")), "and so has the report", made.stderr)


def pads_of_the_rig(p):
    """Natural frequency and damping: |T|^2 = (1 + z x) / ((1 - x)^2 + z x), x = (f/fn)^2, z = (2 damping)^2."""
    with open(os.path.join(p.rig.folder, "truth.json"), encoding="utf-8") as file:
        isolator = json.load(file)["isolator"]
    z, a = 4 * isolator["damping"] ** 2, isolator["transmission"] ** 2
    b = a * (z - 2) - z
    return isolator["frequency_hz"] / math.sqrt((-b + math.sqrt(b * b - 4 * a * (a - 1))) / (2 * a)), isolator["damping"]


def row(proof, name):
    return next((x["value"] for x in proof.get("rows", []) if x["name"] == name), None)


def signed(checks, p, said):
    """The line that a person files with the proof: the journal goes through it, and through no other."""
    lines = [line.removeprefix("signed record: ") for line in said.splitlines() if line.startswith("signed record: ")]
    journal = os.path.join(p.rig.results, "journal.sqlite3")
    ends = []
    for line in [*lines, *(line.replace(line[40:44], "0000") for line in lines)]:
        ends.append(subprocess.run([p.rig.program("vibrig"), "journal", "verify", journal, "--anchor", line],
                                   stdin=subprocess.DEVNULL, capture_output=True, text=True))
    checks.check(len(lines) == 1 and ends[0].returncode == 0 and ends[1].returncode != 0,
                 "its signed record is one of the journal's, a changed one is not", said[-800:] + "".join(e.stdout + e.stderr for e in ends))


def honest(checks, programs, folder):
    p = Proof(checks, programs, folder)
    try:
        refused = p.rig.tool("arm", "--by", "Ada")
        checks.check(refused.returncode == 1 and "there is no proof" in refused.stderr,
                     "nothing is armed without a proof", refused.stderr)
        made = p.make()
        proof = p.proof()
        checks.check(proof.get("passed"), "an honest controller passes", made.stdout + made.stderr + p.rig.logs(60))
        checks.check(0 <= row(proof, "stop, table") <= DEADLINE_S and
                     0 < row(proof, "stop, platform") <= DEADLINE_S + RING_DOWN_S, "the times of the stop are kept", proof)
        checks.check(TIMEOUT_S / 2 <= row(proof, "watchdog, rest") <= TIMEOUT_S + DEADLINE_S,
                     "the starved watchdog stops the table within its time", proof)
        checks.check(0 < row(proof, "noise at rest, platform") < 0.02 / 6, "the noise at rest is a sixth of what is called rest at most", proof)
        checks.check(all(row(proof, name) == 1 for name in ("arming is refused while it moves", "a slew is refused while it moves",
                                                            "another frequency is refused while it moves",
                                                            "watchdog, fault acknowledged")),
                     "what must not be done while the table moves is refused", proof)
        checks.check("emergency stop has never" in proof.get("advice", ""), "the emergency stop is asked for", proof)
        signed(checks, p, made.stdout)
        armed = p.rig.tool("arm", "--by", "Ada")
        checks.equal(armed.returncode, 0, "then a campaign is armed")
        recorded(checks, p, proof)
        database = sqlite3.connect(f"file:{os.path.join(p.rig.results, 'journal.sqlite3')}?mode=ro", uri=True)
        kept = [json.loads(text) for (text,) in database.execute("SELECT record FROM proof ORDER BY id")]
        database.close()
        checks.check(len(kept) == 1 and kept[0]["passed"] and kept[0]["by"].startswith("Ada") and "shaker." in kept[0]["keys"], "the journal keeps who, when, the times and the keys", str(kept)[:500])
        pads = kept[0]["pads"]
        hz, damping = pads_of_the_rig(p)
        rate = damping * 2 * math.pi * hz
        checks.check(abs(pads["rate_per_s"] / rate - 1) < 0.25 and abs(pads["frequency_hz"] / hz - 1) < 0.25,
                     "and how the platform rings down", f"{pads}, expected {hz} Hz, {rate}/s")
        # WHEN the daemon starts anew, with another key that the proof covers
        p.rig.daemon.end()
        p.rig.start_daemon()
        p.rig.wait_for(ready, 60)
        checks.equal(p.rig.arm("Ada").returncode, 0, "a proof outlives the daemon")
        checks.check(p.rig.daemon.says("as the loop check of the newest proof measured it"), "with the transmission that it measured",
                     p.rig.logs())
        p.rig.tool("abort", "--by", "Ada")
        p.rig.daemon.end()
        p.rig.configure(CAMPAIGN, commission={"enforce": True}, shaker={"poll_period_ms": 150})
        p.rig.start_daemon()
        p.rig.wait_for(ready, 60)
        refused = p.rig.tool("arm", "--by", "Ada")
        checks.check(refused.returncode == 1 and "shaker.poll_period_ms is 150" in refused.stderr,
                     "another configuration is not what was proved, and it says what changed", refused.stderr)
    finally:
        p.end()


def pressed(checks, programs, folder):
    p = Proof(checks, programs, folder)
    try:
        rig = p.rig
        child = r.Child("selftest", [rig.program("vibrig"), "selftest", "--by", "Ada", "--emergency-stop", "--socket", rig.socket],
                        folder)
        asked = rig.wait_for(lambda s: s.get("proof", {}).get("asks"), 60)
        checks.check(asked and "press" in asked["proof"].get("asks", ""), "a person is asked for the emergency stop", child.text())
        p.rig.order("estop open")
        asked = rig.wait_for(lambda s: "close" in s.get("proof", {}).get("asks", ""), 60)
        checks.check(asked and "close" in asked["proof"].get("asks", ""), "then to close its chain again", child.text())
        p.rig.order("estop close")
        status = rig.wait_for(lambda s: s.get("proof", {}).get("by"), 60)
        child.end()
        proof = (status or {}).get("proof", {})
        checks.check(proof.get("passed") and row(proof, "emergency stop, latched") == 1 and
                     0 <= row(proof, "emergency stop, seen") <= 0.5 and row(proof, "closing the chain starts nothing") == 1 and
                     row(proof, "emergency stop, the controller says fault") == 1,
                     "pressed, it stops the table, is seen within 0.5 s and latches; closing it starts nothing", proof)
        later = rig.wait_for(lambda s: not s["shaker"].get("emergency_stop_open"), 30)
        checks.check(later["campaign"]["state"] == "tripped" and later["shaker"].get("measured_g", 0) == 0,
                     "closing the chain alone starts nothing", r.state_of(later))
    finally:
        p.end()


def lies(checks, programs, folder):
    for name, value, word in LIES:
        shaker = {name: value}
        if name == "readback_echo":
            shaker["dead_table"], word = True, "amplitude"
        with tempfile.TemporaryDirectory() as place:
            p = Proof(checks, programs, place, shaker)
            try:
                made = p.make()
                proof = p.proof()
                checks.check(made.returncode == 1 and proof.get("by") and not proof.get("passed") and
                             (word in proof.get("message", "") or word in made.stdout),
                             f"{name} does not pass, and the message says why",
                             f"{proof.get('message')}\n{made.stdout}{made.stderr}\n{p.rig.logs(30)}")
                refused = p.rig.tool("arm", "--by", "Ada")
                checks.equal(refused.returncode, 1, f"{name}: nothing is armed")
            finally:
                p.end()


def contact_alone(checks, programs, folder):
    """The button's contact is seen, and nothing is cut: the table stands because the daemon's own stop goes there."""
    p = Proof(checks, programs, folder, proxied=True)
    try:
        rig = p.rig
        child = r.Child("selftest", [rig.program("vibrig"), "selftest", "--by", "Ada", "--emergency-stop", "--socket", rig.socket],
                        folder)
        rig.wait_for(lambda s: "press" in s.get("proof", {}).get("asks", ""), 60)
        p.proxy.break_with(("contact", 1))
        rig.wait_for(lambda s: "close" in s.get("proof", {}).get("asks", ""), 60)
        p.proxy.break_with(None)
        status = rig.wait_for(lambda s: s.get("proof", {}).get("by"), 60)
        child.end()
        proof = (status or {}).get("proof", {})
        checks.check(proof.get("passed") is False and row(proof, "emergency stop, the controller says fault") == 0,
                     "an emergency stop that is a contact alone does not pass", f"{proof}\n{rig.logs()}")
    finally:
        p.end()


def main():
    programs = r.programs_from_command_line(__doc__)
    checks = r.Checks()
    for part in (honest, pressed, contact_alone, lies):
        with tempfile.TemporaryDirectory() as folder:
            part(checks, programs, folder)
    return checks.end()


if __name__ == "__main__":
    sys.exit(main())
