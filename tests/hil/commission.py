#!/usr/bin/python3
"""Commissioning by script, on the seqpacket bus and the rig's clock: a simulated rig whose wiring is unknown is moved, named, recorded
and armed; one that hides something ends undecided or refused, with the reason.

usage: commission.py PROGRAMS [--soak]     killed at two steps, some rigs that hide something; at all steps, all of them
"""
import contextlib
import hashlib
import json
import math
import os
import random
import re
import signal
import socket
import sqlite3
import struct
import subprocess
import sys
import tempfile
import threading
import time

import pexpect

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import modbus_proxy  # noqa: E402
import rig as r  # noqa: E402

CAMPAIGN = {"name": "commissioned", "identify": "what-it-can", "positions_deg": [[-90, 0, 0]], "table_g": [5.0], "dwell_s": 10.0}
ANSWERS = {"power": "yes", "permit.hold": "yes", "permit.outer": "yes", "permit.inner": "yes", "permit.azimuth": "yes",
           "permit.torque": "yes", "names": "torquers"}


# Of a controller that is not ours: another scale than 1e-4 g, words the other way round.
FOREIGN = {"frequency": {"address": 100, "type": "f32", "word_order": "little", "scale": 1},
           "amplitude": {"address": 60, "type": "u32", "word_order": "little", "scale": 1e-6},
           "ramp_time": {"address": 70, "type": "u16", "scale": 0.1}, "run": {"address": 71, "type": "u16"},
           "watchdog": {"address": 80, "type": "u16"}, "watchdog_timeout": {"address": 90, "type": "u16", "scale": 1e-3},
           "state": {"address": 20, "type": "u16", "table": "input"}, "fault": {"address": 21, "type": "u16", "table": "input"},
           "emergency_stop": {"address": 22, "type": "bits", "table": "input", "mask": 8},
           "measured_amplitude": {"address": 30, "type": "f32", "word_order": "big", "table": "input", "scale": 1}}


def remainder(degrees):
    return math.remainder(degrees, 360)


def readings(status):
    return {channel["name"]: channel.get("value") for channel in status["sample"]["channels"]}


# A platform that was let go drifts with the Earth and its gyros, 30 deg/h at most here; a slew is 600 times faster.
DRIFTS_DEG_PER_S = 60 / 3600
KNOWN_DEG = 0.05   # of two single readings


def not_moved(before, after):
    """Nothing was commanded between two looks, and no gimbal went anywhere by itself: what it was let go to do is no move, and the
    rig's time may have run for minutes between them."""
    seconds = after["sample"]["time_s"] - before["sample"]["time_s"]
    was, now = readings(before), readings(after)
    return after["platform"]["gimbal_command_echo"] == before["platform"]["gimbal_command_echo"] and \
        all(abs(remainder(now[g] - was[g])) < KNOWN_DEG + DRIFTS_DEG_PER_S * seconds for g in ("outer", "inner", "azimuth"))


def after_slews(rig):
    """A status of when what was commanded before has ended."""
    return rig.wait_for(lambda s: s["platform"].get("slewing") is False, 60)


class Unknown:
    """A rig with a truth of its own, of which the configuration says nothing."""

    def __init__(self, checks, programs, folder, truth, speed="max", foreign=None, proxied=False):
        self.checks, self.truth = checks, truth
        self.registers = {"shaker.registers." + role: keys for role, keys in (foreign or {}).items()}
        self.rig = r.Rig(programs, "seqpacket", "rig", folder, poll_s=0.1)
        if foreign:
            truth.setdefault("shaker", {})["map"] = "map.toml"   # beside the truth file
            with open(os.path.join(folder, "map.toml"), "w", encoding="utf-8") as file:
                file.write(r.toml(self.registers))
        self.record = os.path.join(folder, "commission", "record.json")
        self.rig.start_plant("--seed", "4", "--warm-up", "1", "--start-temperature", "45", "--speed", speed,
                             "--truth", self.rig.truth_file(truth))
        if proxied:
            self.proxy = modbus_proxy.Proxy(self.rig.modbus_port)
            self.rig.modbus_port = self.proxy.port
        self.configure()
        self.start()

    def configure(self, **tables):
        authority = os.path.join(self.rig.folder, "pki", "authority.crt")
        if os.path.exists(authority):
            tables.setdefault("server", {"clients_ca": authority})
        self.rig.configure(CAMPAIGN, commission={"enforce": True, "folder": os.path.dirname(self.record)}, **self.registers, **tables)

    def start(self):
        self.rig.start_daemon()
        ready = self.rig.wait_for(lambda s: r.measuring(s) and s["platform"].get("ready") and s["shaker"].get("state") == 0 and
                                  readings(s).get("outer") is not None, 60)
        self.checks.check(ready and ready["platform"].get("ready"), "the rig is ready", self.rig.logs())
        return ready

    def restart(self):
        self.rig.daemon.end()
        return self.start()

    def registers_are_tried(self):
        """As vibrig commission registers --write leaves it, of the registers that the configuration states (foreign_registers.py does it)."""
        check = subprocess.run([self.rig.program("vibrigd"), "--check", "--config", self.rig.configuration], capture_output=True, text=True, check=True)
        keys = dict(re.findall(r"^(shaker\.registers\.\S+) +=  (.*?)(?:  +\S.*)?$", check.stdout, re.M))
        os.makedirs(os.path.dirname(self.record), exist_ok=True)
        with open(os.path.join(os.path.dirname(self.record), "registers.json"), "w", encoding="utf-8") as file:
            json.dump({"version": 1, "by": "Ada", "keys": keys}, file)
        return keys

    def registers_were_tried(self):
        """With vibrigd stopped, as it has to be."""
        self.rig.daemon.end()
        keys = self.registers_are_tried()
        self.start()
        return keys

    def answers(self, **others):
        """Of people who say what is so."""
        platform, site = self.truth["platform"], self.truth["site"]
        sign, zero = platform["encoder_sign"], platform["encoder_zero_deg"]
        outer = sign[0] * remainder(readings(self.rig.status())["outer"] - zero[0])
        # The nearer of the two ends, of those that the travel from here allows.
        upright = min((90, -90), key=lambda end: abs(remainder(end - outer)) + 1e3 * (not -60 <= sign[0] * remainder(end - outer) <= 130))
        matrix = self.truth["accelerometer"]["matrix"]
        determinant = sum(matrix[0][i] * (matrix[1][(i + 1) % 3] * matrix[2][(i + 2) % 3] - matrix[1][(i + 2) % 3] * matrix[2][(i + 1) % 3])
                          for i in range(3))
        # The reading grows; the angle counts down when the gimbal turns anticlockwise about an upward axis.
        answers = {**ANSWERS, "travel": "-60 130 -30 30 free", "latitude": site["latitude_deg"], "compass": site["azimuth_deg"] + 7, "drawing": "yes" if determinant > 0 else "no",
                "anticlockwise": "yes" if (sign[2] < 0) == (upright > 0) else "no", **others}
        path = os.path.join(self.rig.folder, "answers.json")
        with open(path, "w", encoding="utf-8") as file:
            json.dump(answers, file)
        return path

    def commission(self, **others):
        run = self.rig.tool("commission", "--by", "Ada", "--json", "--answers", self.answers(**others), timeout=300)
        try:
            return run, json.loads(run.stdout)
        except ValueError:
            self.checks.check(False, "the finding is JSON", run.stdout + run.stderr + self.rig.logs())
            return run, {"outcome": "", "why": "", "found": {}}


def drawn(seed):
    """A truth; base level but for what a shim leaves."""
    draw = random.Random(seed)
    order = draw.sample(range(3), 3)
    matrix = [[0.0] * 3 for _ in range(3)]
    for i in range(3):
        matrix[i][order[i]] = draw.choice([-1.0, 1.0])
    return {"site": {"latitude_deg": draw.choice([-1, 1]) * draw.uniform(20, 65), "azimuth_deg": draw.uniform(25, 65),
                     "base_tilt_deg": [0.0, draw.uniform(-0.8, 0.8)]},
            "platform": {"torquer_scale": [1.0, -1.0, 1.0], "encoder_sign": [draw.choice([-1, 1]) for _ in range(3)],
                         "encoder_zero_deg": [draw.uniform(-170, 170), draw.uniform(-8, 8), draw.uniform(-170, 170)],
                         "drift_sign": -1},
            "accelerometer": {"matrix": matrix, "zero_g": [draw.uniform(-0.01, 0.01) for _ in range(3)]}}


def whole(checks, programs, folder, seed):
    """From nothing known to armed, with a shaker's controller that is not ours."""
    pki = os.path.join(folder, "pki")
    subprocess.run([os.path.join(programs, "vibrig"), "pki", "init", "--folder", pki, "--host", "127.0.0.1", "--operator", "ada", "--operator", "bo"],
                   check=True, capture_output=True)
    u = Unknown(checks, programs, folder, drawn(seed), foreign=FOREIGN)
    try:
        tool = u.rig.tool
        checks.equal(tool("commission", "status").returncode, 1, "nothing is proven")
        refused = tool("arm", "--by", "Ada")
        checks.check("not commissioned: no record of bus, gimbals" in refused.stderr, "nothing is armed without a record", refused.stderr)
        checks.equal(tool("commission", "accept", "--by", "Ada", "--second", "Bo", "--yes").returncode, 1, "nothing is accepted yet")
        run, found = u.commission()
        if not checks.equal(found["outcome"], "decided", f"rig {seed} is named: {found['why']}"):
            checks.note(run.stderr + u.rig.logs())
            return
        keys, truth = found["found"], u.truth
        with open(os.path.join(os.path.dirname(u.record), "found.toml"), encoding="utf-8") as file:
            kept = file.read()
        checks.check(kept.startswith("# SIMULATED: ") and f'encoder_sign = {json.dumps(keys["platform.encoder_sign"])}' in kept and "# SIMULATED: ln LR" in kept,
                     "what was found is in found.toml, each key with its evidence", kept)
        checks.equal(run.returncode, 0, "exit code 0")
        checks.check(found["simulated"] and "SIMULATED: DECIDED" in run.stderr, "that it is simulated is said", run.stderr)
        # Of two ends of the outer axis the one with encoder_sign[0] = 1; the other one is a turn of everything.
        other = truth["platform"]["encoder_sign"][0] < 0
        azimuth = remainder(keys["site.azimuth_deg"] - truth["site"]["azimuth_deg"] - (180 if other else 0))
        checks.check(abs(azimuth) < 1, f"north within 1 deg: {azimuth:.2f}", keys)
        tilt = truth["site"]["base_tilt_deg"][1]
        checks.check(abs(abs(keys["site.elevation_deg"]) - abs(tilt)) < 0.05, f"elevation within 0.05 deg of {tilt:.2f}", keys)
        product = math.prod(truth["platform"]["encoder_sign"])
        checks.equal(math.prod(keys["platform.encoder_sign"]), product, "the product of the signs")
        checks.equal(keys["platform.encoder_sign"][0], 1, "the end of the outer axis is the convention's")
        odds = [witness["ln_odds"] for witness in found["witnesses"]]
        checks.check(all(o * sum(odds) > 0 for o in odds) and len(odds) == 4, "all four witnesses agree", found["witnesses"])
        checks.equal(found["corrections"], [], "the DBC is right")
        # Of one torquer that is wired the wrong way round the product of the signs tells, whatever the platform's axes are called.
        torquers = found["evidence"]["torquers"]
        checks.check(math.prod(keys["levelling.torque_sign"]) == -1 and torquers["axes"] == "x y z" and
                     all(abs(scale - 1) < 0.01 for scale in torquers["scale"]), "each torquer turns its own axis, one the other way", torquers)
        with open(u.rig.configuration, encoding="utf-8") as file:
            before = file.read()
        files = sorted(os.listdir(folder))
        for second, status, why in (("Ada", 1, "another person than Ada"), (" ada", 1, "another person than Ada"),
                                    ("", 2, "--second: found nothing, expected a value: Another person")):
            same = tool("commission", "accept", "--by", "Ada", "--second", second, "--yes")
            checks.check(same.returncode == status and why in same.stderr, f"Ada and {second!r} are not two", same.stderr)
        with open(u.rig.configuration, encoding="utf-8") as file:
            checks.check(file.read() == before and sorted(os.listdir(folder)) == files and not os.path.exists(u.record),
                         "and nothing is written then", os.listdir(folder))
        one_bit_is_proven(u)
        os.chmod(u.rig.configuration, 0o604)
        real = os.path.join(folder, "etc", "rig.toml")
        os.mkdir(os.path.dirname(real))
        os.rename(u.rig.configuration, real)
        os.symlink(real, u.rig.configuration)
        accepted = tool("commission", "accept", "--by", "Ada", "--second", "Bo", "--yes", "--json")
        outcome = json.loads(accepted.stdout or "{}")
        checks.check(accepted.returncode == 0 and os.path.exists(u.record) and outcome["outcome"] == "accepted" and
                     outcome["changed"] and os.path.exists(outcome["as_it_was"]), "accepted by two", accepted.stdout + accepted.stderr)
        with open(u.record, encoding="utf-8") as file:
            known = json.load(file)["parts"]["bus"]["evidence"]["bits"]
        checks.check(known["PlatformStatus.LoopClosed"]["proven"] == "changed once and back" and known["PlatformStatus.LoopClosed"]["by"] == ["Ada"] and
                     known["Resolvers.OuterValid"]["proven"] == "confirmed" and known["Resolvers.OuterValid"]["by"][1] == "Bo",
                     "what is known of each bit is in the record", known)
        bits_are_asked_for(checks, u)
        checks.check(keys["can.signals.accel_x"] == "AccelerometersXY.X" and keys["can.sample_rate_hz"] == 40 and "\nsample_rate_hz = 40.0" in kept and
                     "samples/s by the kernel's stamps" in kept, "and what the bus is called was found, too", kept)
        with open(real + ".1", encoding="utf-8") as file:
            checks.check(os.path.islink(u.rig.configuration) and os.stat(real).st_mode & 0o777 == 0o604 and file.read() == before,
                         "the file keeps its mode, a link stays one, and the old one is beside it", os.listdir(os.path.dirname(real)))
        checks.equal(tool("arm", "--by", "Ada").returncode, 1, "the daemon still runs with the old configuration")
        early = tool("commission", "gyros", "--by", "Ada", "--second", "Bo", "--yes")
        checks.check(early.returncode == 1 and "restart vibrigd first" in early.stderr, "what the daemon has not read is not recorded", early.stderr)
        u.restart()
        gyros = tool("arm", "--by", "Ada")
        checks.check("no record of gyros, registers, watchdog, stop, units, excitation: vibrig commission gyros" in gyros.stderr, "what nothing measures is asked for", gyros.stderr)
        another = tool("commission", "gyros", "--by", "Ada", "--second", "Bo", "--yes", "--identity", os.path.join(pki, "bo"))
        checks.check(another.returncode == 1 and "not signed: it is that of bo" in another.stderr, "another person's certificate signs nothing", another.stderr)
        nobodys = tool("commission", "gyros", "--by", "Ada", "--second", "Bo", "--yes", "--identity", os.path.join(pki, "cy"))
        checks.check(nobodys.returncode == 2 and "cy.crt: " in nobodys.stderr, "nor does one that is not there", nobodys.stderr)
        for typed, code, word in (("1\ndrawing 7\n2\ncertificate\nyes\n", 1, "they differ"), ("2\nd\n2\nd\nyes\n", 1, "expected 1 as both say"),
                                  ("7\n1\n\ndrawing 7\n1\ncertificate\nyes\n", 0, "gyros recorded by Ada")):
            said = subprocess.run([u.rig.program("vibrig"), "commission", "gyros", "--by", "Ada", "--second", "Bo", "--socket", u.rig.socket,
                                   "--identity", os.path.join(pki, "ada")], input=typed, capture_output=True, text=True, check=False)
            checks.check(said.returncode == code and word in said.stdout + said.stderr, f"drift_sign is stated by two apart: {word}", said.stdout + said.stderr)
        signed = tool("commission", "status").stdout.replace("\n   ", " ")
        checks.check(re.search("^gyros .*Bo, 0 days old, until [-0-9]+, signed with the certificate of Ada$", signed, re.M), "the person's certificate has signed it", signed)
        at_rest = tool("selftest", "--by", "Ada", "--rest", timeout=120)
        checks.check(at_rest.returncode == 0 and "the rig is what its configuration says" in at_rest.stdout,
                     "at rest it is checked before its shaker's registers are tried", at_rest.stdout + at_rest.stderr)
        shaker_is_proven(checks, u)
        another_controller(checks, u)
        another_one_while_armed(checks, u)
        proven = tool("commission", "status")
        checks.check(proven.returncode == 0 and "SIMULATED: this record counts on no real rig" in proven.stdout, "all parts are proven, of a simulated rig",
                     proven.stdout)
        checks.equal(tool("arm", "--by", "Ada").returncode, 0, "commissioned and proved it is armed")
        tool("start", "--by", "Ada")
        last = u.rig.wait_for(lambda s: s["campaign"]["state"] in ("finished", "aborted", "tripped", "paused"), 60)
        checks.equal(r.state_of(last), "finished", "and gravity is where the encoders say")
        checks.check(u.rig.daemon.says("opening check: the rig is what its configuration says"), "free drift and gravity agree with it", u.rig.logs())
        with open(u.rig.configuration, encoding="utf-8") as file:
            text = file.read()
        checks.check("# SIMULATED: ln LR" in text, "the configuration's comments say so, too", text)
        signatures_are_missed(checks, u)
        each_key_is_caught_twice(checks, u, text)
        checks.check("commissioning: commissioning:" not in u.rig.daemon.text(), "no event names its source twice", u.rig.logs())
        journal_has_it(checks, u)
    finally:
        u.rig.stop()


def one_bit_is_proven(u):
    """As vibrig commission bus --bits leaves it."""
    dbc = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", "proto", "rig.dbc")
    with open(dbc, "rb") as file:
        text = hashlib.sha256(file.read()).hexdigest()
    with open(os.path.join(os.path.dirname(u.record), "bus_bits.json"), "w", encoding="utf-8") as file:
        json.dump({"version": 1, "dbc_sha256": text,
                   "bits": {"PlatformStatus.LoopClosed": {"proven": "changed once and back", "by": ["Ada"], "rests_at": 1}}}, file)


def bits_are_asked_for(checks, u):
    """Of those that never changed nobody knows whether they say what they are called: not recorded, unless two persons confirm each."""
    with open(u.record, "rb") as file:
        recorded = file.read()
    for confirmed in (None, [], ["Resolvers.OuterValid"], "all"):
        what = {"do": "accept", "second": "Bo", **({} if confirmed is None else {"confirmed_bits": confirmed})}
        body = json.dumps({"kind": "commission", "by": "Ada", "argument": json.dumps(what)})
        answer = raw_command(u.rig, body)
        left = ["Resolvers.InnerValid", "PlatformStatus.Fault", *([] if confirmed == ["Resolvers.OuterValid"] else ["Resolvers.OuterValid"])]
        with open(u.record, "rb") as file:
            same = file.read() == recorded
        checks.check("bus: " in answer and all(name in answer for name in left) and "LoopClosed" not in answer and same,
                     f"bits that never changed refuse the part bus: {confirmed}", answer)


def raw_command(rig, body):
    with socket.socket(socket.AF_UNIX) as line:
        line.connect(rig.socket)
        line.sendall(f"POST /api/v1/commands HTTP/1.1\r\nHost: x\r\nConnection: close\r\nContent-Length: {len(body)}\r\n\r\n{body}".encode())
        answer = b""
        while more := line.recv(65536):
            answer += more
    return answer.decode()


def journal_has_it(checks, u):
    """The table commissioning: each step, question and answer, who said so; chained with the rest."""
    path = os.path.join(u.rig.results, "journal.sqlite3")
    u.rig.daemon.end()
    with contextlib.closing(sqlite3.connect(f"file:{path}?mode=ro", uri=True, timeout=5)) as database:
        rows = database.execute("SELECT part, step, by, identity, what, data_json FROM commissioning ORDER BY id").fetchall()
    whats = {row[4] for row in rows}
    checks.equal(sorted(whats - {"answer"}), ["accept", "begin", "hypothesis", "move", "permission", "question", "reading", "refused arm",
                                              "sign", "torque", "verdict", "void", "write"], "the journal has each kind of step")
    checks.check(all(row[2] == "Ada" for row in rows if row[4] != "void") and
                 any(row[3].startswith("uid ") for row in rows if row[4] == "permission") and all(json.loads(row[5]) for row in rows),
                 "with the person and who the socket says it was", rows[:3])
    writes = [(row[0], row[2], row[3], json.loads(row[5])["old"]) for row in rows if row[4] == "write"]
    checks.equal(writes, [("registers", "Ada", "uid 0, root", {"value": 15})], "what was written to the controller without a daemon is in it, once")
    signed = [json.loads(row[5]).get("signed_with") for row in rows if row[4] == "accept" and row[0] == "gimbals"]
    with open(u.record, encoding="utf-8") as file:
        checks.equal(signed, [json.load(file)["signature"]["public_key"]], "and the key of the record's signature")
    verified = subprocess.run([u.rig.program("vibrig"), "journal", "verify", path], capture_output=True, text=True, check=False)
    checks.equal(verified.returncode, 0, "and its chain holds: " + verified.stdout[-200:] + verified.stderr)


# What a controller does wrong at 0 g, and what is said of it.
AT_ZERO = (("timeout-ignored", "the watchdog was not fed, and did not stop the controller within 2 s: state 2"),
           ("timeout-scaled=3", "the watchdog was not fed, and did not stop the controller"),
           ("timeout-scaled=0.3", "shaker fault"),
           ("timeout-if-unlinked", "the watchdog was not fed, and did not stop the controller"),
           ("timeout-if-linked", "with its link closed the watchdog did not stop the controller within 2 s: state 2"),
           ("ack-without-stop", "the controller is not idle after it ran"))
BUTTON = (("estop-contact-only", "emergency stop, the controller says fault 0"),
          ("estop-unseen", "REFUSED: not completed: shaker fault"),
          ("estop-restarts", "closing the chain starts nothing 0"))


def unwrapped(text):
    return text.replace("\n   ", " ")


def highest_g(rig):
    """Of the table in truth, since there is a rig."""
    return float(re.search(r"highest (\S+) g", rig.order("status")).group(1))


def at_rest_again(rig):
    rig.order("clear")
    rig.wait_for(lambda s: s["shaker"].get("rest") == "at rest" or s["campaign"]["state"] == "tripped", 60)
    for what in ("trip", "stop_disobeyed"):
        rig.tool("ack", what, "--by", "Ada")
    rig.wait_for(lambda s: s["shaker"].get("rest") == "at rest" and s["campaign"]["state"] != "tripped" and s["shaker"].get("state") == 0, 30)


def ended(child):
    for _ in range(600):
        if not child.running():
            break
        time.sleep(0.1)


def with_swapped_words(checks, u):
    """The configuration has the words of the amplitude's register the other way round: it is read back as written, and is anything."""
    rig = u.rig
    with open(rig.configuration, encoding="utf-8") as file:
        right = file.read()
    table = right.index("[shaker.registers.amplitude]")
    wrong = right[:table] + right[table:].replace('"little"', '"big"', 1)
    try:
        with open(rig.configuration, "w", encoding="utf-8") as file:
            file.write(wrong)
        u.restart()
        early = tried_first(rig, "units")
        checks.check('shaker.registers.amplitude.word_order is "big", was "little" when it was tried' in unwrapped(early),
                     "registers that are others than those that were tried are not tried", early)
        u.registers_are_tried()
        # The running daemon has written nothing to them, and goes on so: they are tried with vibrigd stopped.
        held = tried_first(rig, "units")
        checks.check("its registers had not been tried when vibrigd started" in unwrapped(held), "nor are those that are said to be tried while it runs", held)
        u.registers_were_tried()
        refused = in_background(rig, "units")
        checks.check(press(rig, "rack") and press(rig, "door"), "each button comes before it shakes, whatever was asked for", refused.text())
        ended(refused)
        said = unwrapped(refused.text())
        checks.check(wrong != right and refused.process.poll() == 1 and "REFUSED" in said and "ladder" not in said and
                     "a register was refused" in said and rig.daemon.says("amplitude refused: exception 3") and highest_g(rig) == 0, "words the wrong way round: refused before the first rung, and nothing has moved",
                     refused.text() + rig.logs())
    finally:
        with open(rig.configuration, "w", encoding="utf-8") as file:
            file.write(right)
    u.registers_are_tried()
    at_rest_again(rig)
    u.restart()


def tried_first(rig, part):
    refused = rig.tool("commission", part, "--by", "Ada", "--yes", timeout=60)
    return refused.stdout + refused.stderr if refused.returncode == 1 else "accepted"


def shaker_is_proven(checks, u):
    """By proofs of the safe state, one for each button of the emergency stop, which somebody presses and acknowledges."""
    tool, rig = u.rig.tool, u.rig
    lacks = tool("arm", "--by", "Ada")
    checks.check("no record of registers, watchdog, stop, units, excitation: vibrig commission watchdog stop units excitation" in lacks.stderr,
                 "the shaker's parts are asked for", lacks.stderr)
    unknown = tool("commission", "watchdog", "earth", "--by", "Ada")
    checks.equal(unknown.returncode, 2, "parts of platform and shaker are not proven at once")
    for order in (("commission", "watchdog", "--yes"), ("selftest",), ("selftest", "--at-zero")):
        early = tool(*order, "--by", "Ada", timeout=60)
        checks.check(early.returncode == 1 and "registers were not tried one by one, which comes before it runs: vibrig commission registers --write" in
                     unwrapped(early.stdout + early.stderr), f"nothing runs before its registers were tried: {' '.join(order)}", early.stdout + early.stderr)
    checks.check(len(u.registers_were_tried()) > 20, "they are")
    with_swapped_words(checks, u)
    early = tool("selftest", "--by", "Ada", timeout=120)
    checks.check("has not run at 0 g yet" in early.stderr, "nothing shakes before it has run at 0 g", early.stdout + early.stderr)
    for lie, word in AT_ZERO:
        rig.order("fault " + lie)
        refused = tool("commission", "watchdog", "--by", "Ada", "--yes", timeout=120)
        checks.check(refused.returncode == 1 and "REFUSED: at 0 g: not completed: " + word in unwrapped(refused.stdout) and
                     highest_g(rig) == 0, f"it ends at 0 g, and nothing has moved: {lie}", refused.stdout + refused.stderr + rig.logs())
        at_rest_again(rig)
    killed_at_zero(checks, u)
    checks.equal(tool("selftest", "--by", "Ada", "--at-zero", timeout=120).returncode != 2, True, "the run at 0 g")
    early = tool("selftest", "--by", "Ada", timeout=120)
    checks.check('the emergency stop was not pressed at 0 g yet ("rack", "door")' in unwrapped(early.stderr) and highest_g(rig) == 0,
                 "nor before each button was pressed there", early.stdout + early.stderr)
    for lie, word in BUTTON:
        rig.order("fault " + lie)
        with_button = r.Child("stop", [rig.program("vibrig"), "commission", "stop", "--by", "Ada", "--yes", "--socket", rig.socket], rig.folder)
        rig.wait_for(lambda s: "press" in s.get("proof", {}).get("asks", ""), 60)
        rig.order("estop open")
        rig.wait_for(lambda s: "press" not in s.get("proof", {}).get("asks", ""), 60)
        # Who does not see it open does not ask for it to be closed.
        rig.wait_for(lambda s: "close" in s.get("proof", {}).get("asks", ""), 2 if lie == "estop-unseen" else 60)
        rig.order("estop close")
        ended(with_button)
        checks.check(with_button.process.poll() == 1 and word in unwrapped(with_button.text()),
                     f"a button is found out at 0 g: {lie}", with_button.text() + rig.logs())
        at_rest_again(rig)
    killed_in_steps(checks, u)
    for lie, word in (("unit-rms", "g rms for g peak?"), ("unit-mps2", "m/s2 for g?"), ("dead-table readback-echo", "the platform does")):
        for one in lie.split():
            rig.order("fault " + one)
        refused = tool("commission", "units", "--by", "Ada", "--yes", timeout=120)
        checks.check(refused.returncode == 1 and "REFUSED: not completed: ladder: at 0.03 g" in refused.stdout.replace("\n   ", " ") and
                     word in refused.stdout.replace("\n   ", " "), f"the ladder ends at its first rung: {lie}", refused.stdout + refused.stderr + rig.logs())
        rig.order("clear")
    rig.order("fault frequency-ignored")
    refused = tool("commission", "units", "--by", "Ada", "--yes", timeout=120)
    # Whoever is first: the interlock's witness within its window, the loop check at the end of its own, or, where that window
    # has as much of the old frequency as of none, the check's bands.
    found = ("REFUSED: not completed: an accelerometer disagrees", "REFUSED: not completed: 1 Hz above the platform does not do",
             "REFUSED: 16 Hz, table over command")
    checks.check(refused.returncode == 1 and "ladder, 0.3 g, table over command" in refused.stdout and
                 any(words in unwrapped(refused.stdout) for words in found),
                 "a frequency that is not taken is found 1 Hz above", refused.stdout + refused.stderr + rig.logs())
    at_rest_again(rig)
    plain = tool("commission", "watchdog", "units", "excitation", "--by", "Ada", "--json", "--yes", timeout=120)
    found = json.loads(plain.stdout or "{}")
    ladder = {name: value for name, value in found["parts"]["registers"].get("evidence", {}).items() if name.startswith("ladder")}
    checks.check(sorted(ladder) == sorted(f"ladder, {g} g, {what}" for g in (0.03, 0.1, 0.3) for what in ("platform over expected", "table over command")) and
                 all(0.9 < value < 1.1 for value in ladder.values()), "the first proof goes up by 0.03, 0.1 and 0.3 g", ladder)
    checks.check(plain.returncode == 0 and found["outcome"] == "decided" and found["simulated"] and
                 found["parts"]["watchdog"]["evidence"]["watchdog, the controller says fault"] == 1 and
                 0.75 <= found["parts"]["watchdog"]["evidence"]["watchdog at 0 g, not fed"] <= 2 and
                 1.5 <= found["parts"]["watchdog"]["evidence"]["watchdog at 0 g, link closed"] <= 2 and
                 found["parts"]["registers"]["evidence"]["at 0 g, state after"] == 0 and
                 0.75 < found["parts"]["registers"]["evidence"]["f + 1 Hz over f, transmission"] < 0.97 and
                 found["parts"]["registers"]["proven"] and found["parts"]["units"]["evidence"]["hypotheses"][0]["unit"] == "g peak",
                 "a proof shows registers, watchdog, units and excitation", plain.stdout + plain.stderr + rig.logs())
    checks.check(0.49 < highest_g(rig) < 0.51, "the table has never done more than 0.5 g", highest_g(rig))
    checks.check(found["parts"]["stop"]["proven"] and sorted(found["parts"]["stop"]["evidence"]["buttons"]) == ["door", "rack"] and
                 all(button["table_g"] == 0 for button in found["parts"]["stop"]["evidence"]["buttons"].values()),
                 "each button was pressed at 0 g and seen", found["parts"]["stop"])


def in_background(rig, *parts):
    return r.Child("vibrig", [rig.program("vibrig"), "commission", *parts, "--by", "Ada", "--yes", "--socket", rig.socket], rig.folder)


def press(rig, button):
    asked = rig.wait_for(lambda s: f'press the emergency stop "{button}" now' in s.get("proof", {}).get("asks", ""), 60)
    rig.order("estop open")
    rig.wait_for(lambda s: "close" in s.get("proof", {}).get("asks", ""), 60)
    rig.order("estop close")
    return asked and button in asked["proof"].get("asks", "")


def stays_at_rest(rig):
    """Nobody has asked for anything: for seconds of the rig's time nothing runs."""
    still = rig.wait_for(lambda s: s["shaker"].get("rest") == "at rest" and s["shaker"].get("state") in (0, None), 60)
    begin = still["sample"]["time_s"]
    moves = []
    rig.wait_for(lambda s: moves.append(s["shaker"].get("state")) or s["sample"]["time_s"] > begin + 20, 60)
    return still["shaker"].get("rest") == "at rest" and set(moves) <= {0, None}


def asks_first(rig, word):
    """With --resume, and nobody who answers: the question comes before anything moves."""
    resumed = rig.tool("commission", "stop", "units", "excitation", "--by", "Ada", "--resume")
    return resumed.returncode == 1 and word in unwrapped(resumed.stdout) and "nobody answers" in resumed.stderr and stays_at_rest(rig)


def killed_at_zero(checks, u):
    """Terminal and daemon are killed while the controller runs at 0 g: it stops, and the run begins anew by a question."""
    rig = u.rig
    rig.order("speed 4")
    for who in ("terminal", "daemon"):
        tool = in_background(rig, "watchdog")
        begun = rig.wait_for(lambda s: s["campaign"]["state"] == "checking" and s["shaker"].get("state") == 2, 60)
        if not checks.check(begun["shaker"].get("state") == 2 and tool.running(), "the run at 0 g is begun", tool.text() + rig.logs()):
            return
        if who == "terminal":
            tool.process.send_signal(signal.SIGKILL)
            ended(tool)
            ends = rig.wait_for(lambda s: s["campaign"]["state"] != "checking", 30)
            checks.check("nobody has been at the tool of Ada" in r.state_of(ends), "at 0 g: without its terminal it ends", r.state_of(ends))
        else:
            rig.daemon.process.send_signal(signal.SIGKILL)
            ended(tool)
            checks.equal(tool.process.poll(), 2, "at 0 g: without a daemon the tool ends")
            u.start()
        checks.check(stays_at_rest(rig) and highest_g(rig) == 0, f"at 0 g: nothing goes on by itself without its {who}", rig.logs())
        for what in ("trip", "stop_disobeyed"):
            rig.tool("ack", what, "--by", "Ada")
        checks.check(asks_first(rig, "will run at 0 g, and its watchdog"), "at 0 g: it is begun anew, by a question", rig.logs())
    rig.order("speed max")


def killed_in_steps(checks, u):
    """Terminal and daemon are killed in each of the shaker's steps: all stops, nothing goes on by itself, and that step begins anew."""
    rig = u.rig
    steps = (("a button", "Stand at the button \"rack\"", lambda s: "press" in s.get("proof", {}).get("asks", "")),
             ("the ladder", "Now the table will shake", lambda s: s["shaker"].get("state") == 2 and s["shaker"].get("measured_g", 0) > 0.02))
    rig.order("speed 4")   # time enough to see who is gone
    for step, word, there in steps:
        for who in ("terminal", "daemon"):
            tool = in_background(rig, "stop", "units", "excitation")
            status = rig.wait_for(there, 60)
            if not checks.check(status is not None and there(status) and tool.running(), f"{step} is begun", tool.text() + rig.logs()):
                return
            if who == "terminal":
                tool.process.send_signal(signal.SIGKILL)
                ended(tool)
                ends = rig.wait_for(lambda s: s["campaign"]["state"] != "checking", 30)
                checks.check("nobody has been at the tool of Ada" in r.state_of(ends), f"{step}: without its terminal it ends", r.state_of(ends))
            else:
                rig.daemon.process.send_signal(signal.SIGKILL)
                ended(tool)
                checks.equal(tool.process.poll(), 2, f"{step}: without a daemon the tool ends")
                u.start()
            checks.check(stays_at_rest(rig), f"{step}: nothing goes on by itself without its {who}", rig.logs())
            for what in ("trip", "stop_disobeyed"):
                rig.tool("ack", what, "--by", "Ada")
            checks.check(asks_first(rig, word), f"{step}: it is begun anew, by a question", rig.logs())
        if step == "a button":
            tool = in_background(rig, "stop", "units", "excitation")
            checks.check(press(rig, "rack") and press(rig, "door"), "both buttons are pressed when they are asked for", tool.text())
            rig.wait_for(steps[1][2], 60)
            tool.process.send_signal(signal.SIGTERM)
            ended(tool)
            rig.wait_for(lambda s: s["campaign"]["state"] != "checking", 30)
            stays_at_rest(rig)
    rig.order("speed max")


def another_controller(checks, u):
    """At the same address: what was proven is that of the one before."""
    rig = u.rig
    rig.order("fault other-device")
    tried = {"utc": "2026-11-23T10:00:00Z", "by": "Ada", "identity": "uid 0, root", "what": "write", "register": "frequency", "address": 100,
             "old": {"value": 15}, "new": {"value": 16}}
    with open(os.path.join(os.path.dirname(u.record), "registers.jsonl"), "w", encoding="utf-8") as file:
        file.write(json.dumps(tried) + "\n")   # as vibrig commission registers --write leaves it
    u.restart()
    refused = rig.tool("arm", "--by", "Ada")
    checks.check("identity of the shaker's controller is \"another controller\", was proven as \"LMB" in refused.stderr and "(registers)" in refused.stderr,
                 "another controller voids the shaker's parts", refused.stderr)
    status = json.loads(rig.tool("commission", "status", "--json").stdout or "{}").get("parts", {})
    checks.equal(sorted(name for name, part in status.items() if not part["proven"]), ["excitation", "registers", "stop", "units", "watchdog"],
                 "and none of the platform's")
    lacking = rig.tool("commission", "units", "--by", "Ada")   # nobody answers
    checks.check("will run at 0 g, and its watchdog will stop it" in unwrapped(lacking.stdout), "it has to run at 0 g first, as any other", lacking.stdout + lacking.stderr)
    checks.check(rig.daemon.says("registers is void: identity of the shaker's controller is"), "and it is reported", rig.logs())
    rig.order("clear other-device")
    u.restart()


def another_one_while_armed(checks, u):
    """A new link, and somebody else answers: what is armed is not armed any longer."""
    rig = u.rig
    rig.order("speed 1")
    reason = ""
    for _ in range(3):   # the link is lost for less than a reading lives, which a busy machine may not keep
        armed = rig.tool("arm", "--by", "Ada")
        if armed.returncode != 0:
            break
        rig.order("fault other-device")
        rig.order("fault modbus-silent=0.7")
        # Whoever waits for an answer on the rig's clock waits in wall time.
        reason = r.state_of(rig.wait_for(lambda s: s["campaign"]["state"] != "armed", 60))
        rig.order("clear other-device")
        if "another" in reason:
            break
        rig.wait_for(lambda s: s["shaker"].get("rest") == "at rest" and r.measuring(s), 20)
    checks.check("another shaker's controller" in reason, "another controller answers while it is armed: it is aborted", reason + armed.stderr + rig.logs())
    checks.check("identity of the shaker's controller is" in rig.tool("arm", "--by", "Ada").stderr, "and not armed again", rig.logs())
    rig.order("clear")
    rig.order("speed max")
    u.restart()


def turned(value, by):
    return round(remainder(value + by), 4)


WRONG = (
    ("platform.encoder_sign", lambda v: [1, -v[1], v[2]]),
    ("platform.encoder_zero_deg", lambda v: [v[0], turned(v[1], 5), v[2]]),
    ("accelerometer.matrix", lambda v: [[row[1], row[0], row[2]] for row in v]),   # two exchanged
    ("accelerometer.matrix", lambda v: [[-x for x in row] for row in v]),
    ("site.latitude_deg", lambda v: -v),
    ("site.azimuth_deg", lambda v: turned(v, 90)),
)


def signatures_are_missed(checks, u):
    """Root forges a record with the daemon's key: a person's signature nobody can make anew, and one that is taken out is missed."""
    with open(u.record, encoding="utf-8") as file:
        recorded = file.read()
    forge(u, None)
    u.restart()
    forged = u.rig.tool("arm", "--by", "Ada")
    checks.check(forged.returncode == 1 and "the signature of Ada, which the journal has, is gone from the record (gyros)" in forged.stderr,
                 "a signature that has vanished is missed", forged.stderr)
    with open(u.record, "w", encoding="utf-8") as file:
        file.write(recorded)
    u.restart()
    checks.equal(u.rig.tool("arm", "--by", "Ada").returncode, 0, "and it is armed with it")
    u.rig.tool("abort", "--by", "Ada")


def unsigned(checks, u):
    """Recorded anew by two persons without a certificate: what follows forges that."""
    stated = u.rig.tool("commission", "gyros", "--by", "Ada", "--second", "Bo", "--yes", "--json")
    checks.check(stated.returncode == 0, "gyros are stated anew, and signed by nobody", stated.stderr)
    outcome = json.loads(stated.stdout or "{}")
    checks.check(outcome.get("outcome") == "decided" and outcome["simulated"] and outcome["parts"]["gyros"]["by"][1] == "Bo" and
                 "platform.drift_sign = -1" in stated.stderr, "as JSON the outcome alone", stated.stdout + stated.stderr)


def each_key_is_caught_twice(checks, u, text):
    """By the record, and where that is forged by the opening check, before the table moves."""
    with open(u.record, encoding="utf-8") as file:
        recorded = file.read()
    for key, change in WRONG:
        name = key.partition(".")[2]
        was = re.search(rf"^{name} = (.*?)(  #.*)?$", text, re.M)
        wrong = json.dumps(change(json.loads(was[1])))
        for path, content in ((u.rig.configuration, text[:was.start(1)] + wrong + text[was.end(1):]), (u.record, recorded)):
            with open(path, "w", encoding="utf-8") as file:
                file.write(content)
        u.restart()
        edited = u.rig.tool("arm", "--by", "Ada")
        checks.check(edited.returncode == 1 and f"{key} is " in edited.stderr and f"was proven as {was[1]} by Ada" in edited.stderr,
                     f"an edited {key} voids its part: {wrong}", edited.stderr)
        if key == WRONG[0][0]:
            forge(u, key, with_its_key=False)
            u.restart()
            forged = u.rig.tool("arm", "--by", "Ada")
            checks.check(forged.returncode == 1 and "record.json: its signature is not that of what it says" in forged.stderr,
                         "a record whose hashes were made anew is none without the key", forged.stderr)
            with open(u.record, "w", encoding="utf-8") as file:
                file.write(recorded)
            u.restart()
        if key == WRONG[0][0]:
            forge(u, key, with_persons=True)
            u.restart()
            forged = u.rig.tool("arm", "--by", "Ada")
            checks.check(forged.returncode == 1 and "the signature of Ada is not that of what the record says" in forged.stderr,
                         "nor is one that the daemon's key has signed, against a person's signature", forged.stderr)
            for path, content in ((u.record, recorded), (u.rig.configuration, text)):
                with open(path, "w", encoding="utf-8") as file:
                    file.write(content)
            u.restart()
            unsigned(checks, u)
            with open(u.record, encoding="utf-8") as file:
                recorded = file.read()
            with open(u.rig.configuration, "w", encoding="utf-8") as file:
                file.write(text[:was.start(1)] + wrong + text[was.end(1):])
            u.restart()
        forge(u, key)
        u.restart()
        u.rig.wait_for(lambda s: s["shaker"].get("rest") == "at rest", 60)
        if u.rig.arm("Ada").returncode:
            proof = u.rig.tool("selftest", "--by", "Ada", timeout=120)   # it stands on some of the keys
            armed = u.rig.arm("Ada")
            checks.check(armed.returncode == 0, f"{key} is wrong and the record forged: it is armed",
                         proof.stdout + proof.stderr + armed.stderr)
        u.rig.tool("start", "--by", "Ada")
        last = u.rig.wait_for(lambda s: s["campaign"]["state"] in ("finished", "aborted", "tripped", "paused"), 60)
        reason = r.state_of(last)
        suspects = reason.partition("suspects: ")[2].rstrip(")")
        checks.check(reason.startswith("aborted (opening check") and any(s.startswith(key) for s in suspects.split("; ")[:3]) and
                     not last["campaign"].get("dwells"), f"and {key} is caught before the table moves", reason)


def forge(unknown, key, with_its_key=True, with_persons=False):
    """The record says of the key what the daemon, which runs with a wrong one, says: all hashes fit, and the signature, too, where the
    forger is root and reads the daemon's key; persons' signatures, which nobody can make anew, are taken out."""
    proven = unknown.rig.tool("commission", "status", "--json")
    now = key and [re.search(re.escape(key) + " is (.*), was proven as ", part["why"]) for part in json.loads(proven.stdout)["parts"].values()]
    value = key and next(found[1] for found in now if found)
    with open(unknown.record, encoding="utf-8") as file:
        record = json.load(file)
    for part in record["parts"].values():
        if key in part["keys"]:
            part["keys"][key] = value
            part["sha256"] = hashlib.sha256("".join(f"{k}={v}\n" for k, v in sorted(part["keys"].items())).encode()).hexdigest()
    signature = record.pop("signature")
    record.pop("sha256")
    if not with_persons:
        record.pop("persons", None)
    whole_text = json.dumps(record, separators=(",", ":"), ensure_ascii=False)
    record["sha256"] = hashlib.sha256(whole_text.encode()).hexdigest()
    record["signature"] = signature
    if with_its_key:
        message = os.path.join(unknown.rig.folder, "message")
        with open(message, "w", encoding="ascii") as file:
            file.write(record["sha256"])
        made = subprocess.run(["openssl", "pkeyutl", "-sign", "-rawin", "-inkey", os.path.join(os.path.dirname(unknown.record), "record.key"),
                               "-in", message], capture_output=True, check=True)
        record["signature"]["value"] = made.stdout.hex()
    with open(unknown.record, "w", encoding="utf-8") as file:
        json.dump(record, file)


def nothing_is_written(checks, programs, folder):
    """The gimbals' parts: a device that counts what is written to it counts nothing, and is read all the time."""
    u = Unknown(checks, programs, folder, drawn(9), speed="40", proxied=True)
    seen = []

    def look(over):
        while not over.wait(0.1):
            before, status = time.monotonic(), u.rig.status()
            if status and status["campaign"]["state"] == "commissioning":
                seen.append((before, time.monotonic()))

    over = threading.Event()
    looker = threading.Thread(target=look, args=(over,), daemon=True)
    try:
        before = len(u.proxy.writes)
        looker.start()
        run, found = u.commission()
        over.set()
        looker.join()
        # A look begins before its status is made and ends after it.
        first, last = (seen[0][1] + 0.3, seen[-1][0]) if seen else (0, 0)
        within = [w for w in u.proxy.writes if first < w[0] < last]
        checks.check(run.returncode == 0 and found["outcome"] == "decided" and before > 0 and last - first > 5,
                     f"a rig is commissioned through it, for {last - first:.0f} s", run.stderr)
        checks.check(not within, "and nothing is written meanwhile", within[:5])
        u.registers_were_tried()
        known = len(u.proxy.writes)
        u.rig.wait_for(lambda s: len(u.proxy.writes) > known, 10)
        checks.check(len(u.proxy.writes) > known, "afterwards, its registers tried, its watchdog is fed")
        # A stop is written whoever commissions it.
        child = r.Child("again", [u.rig.program("vibrig"), "commission", "--by", "Ada", "--answers", u.answers(), "--socket", u.rig.socket], folder)
        u.rig.wait_for(lambda s: s["campaign"]["state"] == "commissioning", 20)
        time.sleep(0.5)
        known = len(u.proxy.writes)
        u.rig.tool("abort", "--by", "Bo")

        def stopped(_):
            return any(w[1] <= modbus_proxy.RUN < w[1] + len(w[2]) and w[2][-1] == 0 for w in u.proxy.writes[known:])

        u.rig.wait_for(stopped, 10)   # it is accepted before it is written
        checks.check(stopped(None), "but a stop is", (u.proxy.writes[known:known + 5], child.text()))
        child.end()
    finally:
        over.set()
        u.rig.stop()


def few_bits(checks, programs, folder):
    """Angles of fewer than 12 bits by the DBC are reported at the first look; 12 are enough. A DBC that is gone is an answer."""
    u = Unknown(checks, programs, folder, drawn(4))
    dbc = os.path.join(folder, "narrow.dbc")
    with open(os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", "proto", "rig.dbc"), encoding="utf-8") as file:
        text = file.read()
    try:
        for bits, reported in ((12, False), (11, True)):
            with open(dbc, "w", encoding="utf-8") as file:
                file.write(text.replace("SG_ Azimuth : 0|20@1+", f"SG_ Azimuth : 0|{bits}@1+"))
            u.configure(can={"dbc": dbc})
            u.restart()
            run = u.rig.tool("commission", "--by", "Ada", "--answers", u.answers(**{"permit.hold": "no"}), timeout=60)
            line = f"ResolverAzimuth.Azimuth has {bits} bits, 12 at least expected"
            checks.equal(line in unwrapped(run.stdout), reported, f"an angle of {bits} bits is {'reported' if reported else 'fine'}")
            checks.check("A  40.0 samples/s, 6 channels, |f| = " in unwrapped(run.stdout), "with the rate of the samples", run.stdout + run.stderr)
        os.remove(dbc)
        body = json.dumps({"kind": "commission", "by": "Ada", "argument": '{"do": "read", "bits": true}'})
        answer = raw_command(u.rig, body)
        checks.check("narrow.dbc: cannot be read" in answer and u.rig.status() is not None, "a DBC that is taken away is named, and the daemon goes on",
                     answer + u.rig.logs())
    finally:
        u.rig.stop()


def lying_clock(checks, programs, folder):
    """Other samples a second than the configuration says: refused at the first look at the latest, and nothing has moved."""
    u = Unknown(checks, programs, folder, drawn(4))
    try:
        u.configure(can={"sample_rate_hz": 21})
        u.restart()
        half = u.rig.tool("commission", "--by", "Ada", "--answers", u.answers(), timeout=60)
        checks.check(half.returncode == 1 and "40 samples/s measured, can.sample_rate_hz = 21: expected within 1 %" in unwrapped(half.stderr),
                     "with nearly twice as many it is not even begun", half.stdout + half.stderr)
        u.configure(can={"sample_rate_hz": 38.5})
        u.restart()
        u.rig.wait_for(lambda s: s["shaker"].get("rest") == "at rest", 60)
        before = u.rig.status()
        run, found = u.commission()
        checks.check(run.returncode == 1 and found["outcome"] == "refused" and "can.sample_rate_hz = 38.5: expected within 1 %" in found["why"] and
                     found["suspects"][0] == "can.sample_rate_hz" and not found["found"], "a rate that is not the configured one is refused",
                     run.stdout + run.stderr + u.rig.logs())
        checks.check(not_moved(before, u.rig.status()) and "suspects: can.sample_rate_hz" in unwrapped(run.stderr), "and nothing has moved", run.stderr)
    finally:
        u.rig.stop()


# Of what is kept on disk, by its number: nearly all is still to be done, and nearly nothing. In between the unit test
# Resumed.AtEveryStepNothingMovesWithoutAPermissionAndTheResultIsTheSame ends it at every step.
KILLS, STEPS = (12, 80), 80


def killed(checks, programs, folder, kills):
    """SIGKILL at any step: nothing moves before a new permission, and what is found is the same."""
    u = Unknown(checks, programs, folder, drawn(5))
    library, at = os.path.join(folder, "die_at.so"), os.path.join(folder, "die-at")
    subprocess.run(["c++", "-shared", "-fPIC", "-O1", "-o", library, os.path.join(os.path.dirname(os.path.abspath(__file__)), "die_at.cpp")],
                   check=True)
    progress = os.path.join(os.path.dirname(u.record), "progress.json")
    try:
        _, whole_run = u.commission()
        whole_keys = whole_run["found"]
        with open(progress, encoding="utf-8") as file:
            checks.check(len(json.load(file)["log"]) > 60, "what is done is kept")
        for kill in kills:
            u.rig.daemon.end()
            u.rig.daemon = r.Child("vibrigd", [u.rig.program("vibrigd"), "--config", u.rig.configuration], folder,
                                   {"LD_PRELOAD": library, "DIE_AT": at})
            u.rig.wait_for(lambda s: s["platform"].get("ready") and s["shaker"].get("rest") == "at rest" and readings(s).get("outer") is not None, 60)
            answers = u.answers(**{"permit.resume": "yes"})
            with open(at, "w", encoding="ascii") as file:
                file.write(f"{kill} rename")
            first = u.rig.tool("commission", "--by", "Ada", "--json", "--answers", answers, timeout=300)
            if first.returncode == 2:   # its door closes a little before it has ended
                u.rig.wait_for(lambda s: False, 20)
            dead = not u.rig.daemon.running()
            os.unlink(at)
            if not dead:
                checks.check(kill > STEPS, f"killed at its {kill}th step", first.stderr + u.rig.logs())
                continue
            u.start()
            before = after_slews(u.rig)
            silent = os.path.join(folder, "silent.json")
            with open(silent, "w", encoding="utf-8") as file:
                json.dump({}, file)
            asked = u.rig.tool("commission", "--by", "Ada", "--resume", "--answers", silent)
            after = u.rig.status()
            checks.check(asked.returncode == 2 and ('"permit.resume"' in asked.stderr or '"power"' in asked.stderr) and not_moved(before, after),
                         f"killed at its {kill}th step: without a permission nothing moves",
                         f"{asked.stderr}\n{before['sample']}\n{after['sample']}")
            run = u.rig.tool("commission", "--by", "Ada", "--json", "--resume", "--answers", answers, timeout=300)
            found = json.loads(run.stdout or "{}").get("found", {})
            same = run.returncode == 0 and found.get("platform.encoder_sign") == whole_keys["platform.encoder_sign"] and all(
                abs(remainder(a - b)) < most for a, b, most in zip(found["platform.encoder_zero_deg"], whole_keys["platform.encoder_zero_deg"],
                                                                   (0.1, 0.1, 0.3))) and \
                abs(remainder(found["site.azimuth_deg"] - whole_keys["site.azimuth_deg"])) < 1
            checks.check(same, f"and the same is found: {[l for l in run.stderr.splitlines() if 'Going on' in l or 'anew' in l]}",
                         run.stderr + u.rig.logs())
    finally:
        u.rig.stop()


def hidden(checks, programs, folder, truth, others, outcome, word):
    u = Unknown(checks, programs, folder, truth)
    try:
        run, found = u.commission(**others)
        checks.check(found["outcome"] == outcome and word in found["why"] and run.returncode == 1 and not found["found"] and found["suspects"],
                     f"{outcome}, {word}", found)
    finally:
        u.rig.stop()


def hard_ones(checks, programs, every):
    """What only the rig itself can do, and one that is dead; with `every` the others that unit tests have, too."""
    def rig_with(seed, section, **keys):
        truth = drawn(seed)
        truth[section].update(keys)
        return truth

    south = rig_with(11, "site", latitude_deg=-45.0)
    # A reading in rad commanded as deg: the first command, which is to move nothing, moves it, and is stopped.
    radians = rig_with(15, "platform", angle_unit=["deg", "rad", "deg"])
    radians["platform"]["encoder_zero_deg"][1] = 100.0
    always = (
            (rig_with(13, "accelerometer", dead="+z"), {}, "refused", "accelerometer."),
            (rig_with(14, "platform", command_offset_deg=[0, 6, 0]), {}, "undecided", "by hand"),
            (radians, {}, "undecided", "by hand"))
    of_units = (
            (rig_with(12, "platform", stuck_gimbal="inner"), {}, "undecided", "INNER"),
            (rig_with(18, "platform", soft_stop_deg=[360.0, 18.0, 360.0]), {}, "undecided", "a soft stop?"),
            (rig_with(16, "platform", torquer_scale=[1.0, 1.0, 0.0]), {}, "refused", "torque command Z turns nothing"),
            (rig_with(17, "platform", torquer_scale=[90.0, 1.0, 1.0]), {}, "refused", "torque command X of 60 deg/h"),
            (south, {"latitude": 45.0, "compass": "-"}, "undecided", "latitude"))
    for truth, others, outcome, word in (*always, *(of_units if every else ())):
        with tempfile.TemporaryDirectory() as folder:
            hidden(checks, programs, folder, truth, others, outcome, word)


def against_its_certificate(checks, programs, folder):
    """The maker says another sign than the campaign finds: it is marked."""
    rig = r.Rig(programs, "seqpacket", "rig", folder)
    try:
        rig.start_plant("--seed", "4", "--warm-up", "1", "--start-temperature", "45", "--truth", rig.truth_file(r.QUICK))
        rig.configure({"name": "certified", "table_g": [9.0, 5.0], "dwell_s": 20.0, "settle_s": 2.0})
        with open(rig.configuration, "a", encoding="utf-8") as file:   # the simulated gyros have +1 and +1
            file.write('[commission]\ncertificate = [{ name = "D_Fx", value = 1.2 }, { name = "D_Fz", value = -1.2 }]\n')
        rig.start_daemon()
        rig.wait_for(lambda s: s["platform"].get("ready") and s["shaker"].get("rest") == "at rest", 60)
        rig.tool("arm", "--by", "Ada")
        rig.tool("start", "--by", "Ada")
        last = rig.wait_for(lambda s: s["campaign"]["state"] in ("finished", "aborted", "tripped", "paused"), 120)
        checks.equal(r.state_of(last), "finished", "a campaign")
        rig.daemon.end()
        warnings = json.loads(rig.result()[1] or "{}").get("warnings", [])
        marked = [w for w in warnings if w.startswith("campaign marked: D_Fz is ") and "-1.2 by the certificate: sign of platform.drift_sign" in w]
        checks.check(len(marked) == 1 and "D_Fx" not in marked[0] and rig.daemon.says(marked[0]), "whose sign is against the certificate is marked",
                     warnings + [rig.logs()])
    finally:
        rig.stop()


class Terminal:
    """vibrig commission in a terminal of 80 columns."""

    def __init__(self, rig, *more, **environment):
        self.child = pexpect.spawn(rig.program("vibrig"), ["commission", "--by", "Ada", "--socket", rig.socket, *more], encoding="utf-8",
                                   dimensions=(24, 80), timeout=30, env={**os.environ, **environment},
                                   # A shell starts what runs beside it with Ctrl-C ignored; a person's does not.
                                   preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL))
        self.text = ""

    def until(self, word, timeout_s=30):
        """True: it was shown, and what came before is forgotten for the next one. Lines are broken at blanks."""
        found = self.child.expect([r"\s+".join(re.escape(part) for part in word.split()), pexpect.TIMEOUT, pexpect.EOF], timeout=timeout_s)
        self.seen = (self.child.before if isinstance(self.child.before, str) else "") + (self.child.after if found == 0 else "")
        self.text += self.seen
        return found == 0

    def type(self, line):
        self.child.sendline(line)

    def kill(self):
        self.child.kill(9)
        self.child.wait()
        self.child.close()

    def end(self):
        self.child.expect(pexpect.EOF)
        self.child.wait()
        return self.child.exitstatus


def dialogue(checks, programs, folder):
    """A person types; the terminal is lost while a gimbal moves, and comes back."""
    u = Unknown(checks, programs, folder, drawn(3), speed="5")
    try:
        t = Terminal(u.rig, NO_COLOR="1", TERM="dumb")
        checks.check(t.until("power stage off?"), "it asks", t.text)
        t.type("perhaps")
        checks.check(t.until("expected yes or no"), "what is no answer is asked again with what was expected", t.text)
        for question, answer in (("power stage off?", "yes"), ("or free", ""), ("hold where it is", "h"), ("present readings", "y"),
                                 ("OUTER", "y")):
            checks.check(t.until(question) and t.until("> "), f"it asks: {question}", t.text)
            t.type(answer)
        wide = [line for line in t.text.splitlines() if len(line) > 80]
        checks.check(not wide and "\x1b" not in t.text, "in 80 columns and without colours", wide or t.text)
        time.sleep(0.5)
        checks.equal(u.rig.status()["campaign"]["state"], "commissioning", "the status says so")
        seen = u.rig.status()["campaign"]["reason"]
        checks.check(seen.startswith("Ada") and ", step B, 0 positions, 0 free drifts; " in seen, "and who is at what", seen)
        u.rig.order("speed 1")   # it asks nothing before the terminal is gone
        for command in ("arm", "selftest", "commission"):
            refused = u.rig.tool(command, "--by", "Bo")
            checks.check(refused.returncode == 1, f"meanwhile no {command}", refused.stderr)
        checks.check("commissioned by Ada" in refused.stderr, "another person takes no dialogue over", refused.stderr)
        refused = u.rig.tool("commission", "gyros", "--by", "Bo", "--second", "Cy", "--yes")
        checks.check(refused.returncode == 1 and "found the campaign commissioning" in refused.stderr, "meanwhile nothing is recorded", refused.stderr)
        t.kill()
        checks.check(u.rig.daemon.says("nobody has been at the tool", 20), "a lost terminal stops it", u.rig.logs(60))
        u.rig.order("speed 5")
        # Three kinds of terminal, one after the other: Ctrl-C interrupts, the next one takes it up, in 80 columns and without a colour.
        for kind in ({"NO_COLOR": "1"}, {"TERM": "dumb"}, {"TERM": "xterm-256color", "NO_COLOR": "1"}):
            t = Terminal(u.rig, **kind)
            asked = t.until("Going on with what Ada") and t.until("Go on?") and t.until("> ")
            wide = [line for line in t.text.splitlines() if len(line) > 80]
            checks.check(asked and not wide and "\x1b" not in t.text, f"{kind}: taken up, in 80 columns, without an escape", wide or t.text)
            t.child.sendintr()
            ended = t.child.expect([pexpect.EOF, pexpect.TIMEOUT], timeout=10)
            checks.check(ended == 0 and "\x1b" not in str(t.child.before), f"{kind}: interrupted", t.child.before)
            t.child.close()
            checks.equal(u.rig.status()["campaign"]["state"], "commissioning", "and nothing of it is lost")
        t = Terminal(u.rig)
        checks.check(t.until("Going on with what Ada") and t.until("Go on?"), "it is taken up where it was, by a new permission", t.text)
        t.type("no")
        checks.check(t.until("UNFINISHED"), "a no ends it", t.text)
        checks.equal(t.end(), 1, "exit code 1")
        for what in ("nothing", "[]", '{"do": 1}', '{"do": "read", "after": "x"}', '{"do": "answer", "id": 7}', '{"do": "begin", "by_hand": []}'):
            body = json.dumps({"kind": "commission", "by": "Ada", "argument": what})
            with socket.socket(socket.AF_UNIX) as line:
                line.connect(u.rig.socket)
                line.sendall(f"POST /api/v1/commands HTTP/1.1\r\nHost: x\r\nContent-Length: {len(body)}\r\n\r\n{body}".encode())
                checks.check(line.recv(4096).startswith(b"HTTP/1.1 "), f"{what} is answered")
        checks.check(u.rig.daemon.running(), "what makes no sense harms nobody", u.rig.logs())
        other = subprocess.run([u.rig.program("vibrig"), "commission", "units", "--by", "Ada", "--json", "--socket", u.rig.socket],
                               capture_output=True, text=True, check=False)
        checks.check(other.returncode == 1 and "the platform's parts first: bus: no record" in other.stderr and
                     json.loads(other.stdout or "{}").get("outcome") == "refused", "nothing shakes before the platform is known",
                     other.stderr)
        u.configure(platform={"gyro_y_axes": ["+x", "+y", "+z"], "gyro_z_axes": ["+z", "+y", "+x"]})
        check = subprocess.run([u.rig.program("vibrigd"), "--check", "--config", u.rig.configuration], capture_output=True, text=True, check=False)
        u.restart()
        warned = ('platform.gyro_y_axes[0]: found "+x", the input axis of gyro x too', 'platform.gyro_z_axes: found ["+z", "+y", "+x"], left-handed')
        checks.check(check.returncode == 0 and all(f": {each}" in check.stderr and u.rig.daemon.says(each) for each in warned),
                     "gyro axes that are hardly meant are reported by --check and at the start", check.stderr + u.rig.logs())
    finally:
        u.rig.stop()


def bits(checks, rig, dbc, folder):
    """Bits that never change: one is changed by hand, one confirmed by two persons, the others are left out."""
    asked, text = [], ""
    with subprocess.Popen([rig.program("vibrig"), "commission", "bus", "--seqpacket", rig.path, "--for", "3", "--dbc", dbc, "--bits", "--by", "Ada", "--folder", folder],
                          stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, preexec_fn=r.die_with_parent) as tool:
        def type_in(line):
            tool.stdin.write(line + "\n")
            tool.stdin.flush()
        while True:
            one = tool.stderr.read(1)
            text += one
            if not one:
                break
            if not text.endswith("\n> "):
                continue
            name = re.findall(r"\? (\S+) reads [01]", text)[-1]
            asked.append(name)
            if name.endswith(".LoopClosed"):
                type_in("")
                if asked.count(name) == 2:   # the first time nobody does it
                    time.sleep(0.7)
                    rig.order("fault loop-open")
                    time.sleep(0.7)
                    rig.order("clear loop-open")
            elif name.endswith(".Fault"):
                type_in("Ada" if asked.count(name) == 1 else "Ada, ada" if asked.count(name) == 2 else "Ada, Bo")
            else:
                type_in("-")
        code = tool.wait()
    with open(os.path.join(folder, "bus_bits.json"), encoding="utf-8") as file:
        kept = json.load(file)["bits"]
    loop, fault = (next((v for k, v in kept.items() if k.endswith(word)), {}) for word in (".LoopClosed", ".Fault"))
    checks.check("it did not change and come back" in unwrapped(text) and (loop.get("proven"), loop.get("by"), loop.get("rests_at")) == ("changed once and back", ["Ada"], 1),
                 "a bit is proven by changing it once, and back", text)
    checks.check('found "Ada", expected nothing, two names or -' in unwrapped(text) and 'found "Ada, ada"' in unwrapped(text) and (fault.get("proven"), fault.get("by")) == ("confirmed", ["Ada", "Bo"]),
                 "or confirmed by two persons", text)
    checks.check(code == 1 and len(kept) == 2 and any(name.endswith(".OuterValid") for name in asked), "what is left out is not proven", kept)


class Hand:
    """Turns a gimbal to and fro, as nothing on the rig's own side does: commands on the bus, of which the tool knows nothing."""

    def __init__(self, path):
        self.line = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self.line.connect(path)
        self.counter = 0
        threading.Thread(target=self.listen, daemon=True).start()

    def listen(self):
        try:
            while self.line.recv(256):   # or the hub's queue fills
                pass
        except OSError:
            pass

    def slew(self, angles):
        self.counter = (self.counter + 1) % 256
        self.line.send(struct.pack("<IB3x3hBB", 0x200, 8, *(round(100 * remainder(a)) for a in angles), 1, self.counter))

    def close(self):
        self.line.close()


class Torque(Hand):
    """Whether the platform says that it is torqued."""

    def __init__(self, path):
        self.torquing = None
        super().__init__(path)

    def listen(self):
        try:
            while frame := self.line.recv(256):
                if struct.unpack_from("<I", frame)[0] == 0x210:
                    self.torquing = bool(frame[8] & 4)
        except OSError:
            pass

    def becomes(self, torquing, timeout_s):
        end = time.monotonic() + timeout_s
        while self.torquing != torquing and time.monotonic() < end:
            time.sleep(0.002)
        return self.torquing == torquing


def killed_while_torqued(checks, programs, folder):
    """SIGKILL under a torque: nothing was armed, and the next daemon ends it all the same."""
    u = Unknown(checks, programs, folder, drawn(5), speed="40")
    platform = Torque(u.rig.path)
    try:
        argv = ["commission", "--by", "Ada", "--answers", u.answers(**{"permit.resume": "yes"}), "--socket", u.rig.socket]
        tool = r.Child("vibrig", [u.rig.program("vibrig"), *argv], folder)
        if not checks.check(platform.becomes(True, 120), "commissioning torques the platform", tool.text() + u.rig.logs()):
            return
        u.rig.daemon.end(signal.SIGKILL)
        time.sleep(1)
        checks.equal(platform.torquing, True, "a daemon that is killed leaves it torqued")
        ended(tool)
        ready = u.start()
        checks.check(platform.becomes(False, 10) and r.state_of(ready) == "idle", "the next one ends that, and nobody has to acknowledge it", u.rig.logs())
        checks.check(u.rig.daemon.says("let it torque the platform (vibrig commission): zero is commanded"), "and says why", u.rig.logs())
        time.sleep(2)   # the platform confirms it for a second
        u.restart()
        checks.equal(u.rig.daemon.text().count("zero is commanded"), 1, "once: a later one has nothing to end")
        run = u.rig.tool(*argv[:-2], "--resume", "--json", timeout=300)
        checks.check(run.returncode == 0 and platform.becomes(False, 10), "commissioning goes on to its end", run.stdout + run.stderr + u.rig.logs())
        u.restart()
        checks.equal(u.rig.daemon.text().count("zero is commanded"), 1, "and is no reason any more")
    finally:
        platform.close()
        u.rig.stop()


def named_by_hand(checks, rig, dbc, folder):
    """Each gimbal is turned in turn: its angle, accelerometers, counter and rate go into found.toml, and by two persons into a configuration."""
    stands = [10.0, 5.0, 20.0]
    hand = Hand(rig.path)
    hand.slew(stands)
    time.sleep(8)
    argv = [rig.program("vibrig"), "commission", "bus", "--seqpacket", rig.path, "--for", "6", "--dbc", dbc, "--find", "--by", "Ada", "--folder", folder]
    text, turns = "", []
    with subprocess.Popen(argv, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, preexec_fn=r.die_with_parent) as tool:
        while True:
            one = tool.stderr.read(1)
            text += one
            if not one:
                break
            if text.endswith("\n> "):   # while it listens at rest nothing moves
                hand.slew(stands)
                time.sleep(4)
                tool.stdin.write("\n")
                tool.stdin.flush()
            which = re.search(r"Now turn the (OUTER|INNER|AZIMUTH) gimbal by hand[^\n]*\n$", text)
            if which:
                g = ("OUTER", "INNER", "AZIMUTH").index(which[1])
                turns.append(which[1])
                if len(turns) > 8:
                    tool.kill()
                hand.slew([a + (12 if i == g and turns.count(which[1]) > (1 if g == 1 else 0) else 0) for i, a in enumerate(stands)])
        out = tool.stdout.read()
        code = tool.wait()
    hand.close()
    checks.check(turns == ["OUTER", "INNER", "INNER", "AZIMUTH"] and "INNER: no signal follows the gimbal alone: none" in unwrapped(text),
                 "each gimbal is asked for, and again where nobody turned it", text)
    found = os.path.join(folder, "found.toml")
    said = ("[can]", f'dbc = "{os.path.abspath(dbc)}"', "sample_rate_hz = 40", "[can.signals]", 'outer = "Resolvers.Outer"', 'inner = "Resolvers.Inner"',
            'azimuth = "ResolverAzimuth.Azimuth"', 'accel_x = "AccelerometersXY.X"', 'accel_z = "AccelerometerZ.Z"', "# SIMULATED: ")
    checks.check(code == 0 and os.path.exists(found) and all(line in out for line in said), "angles, accelerometers and rate are named", out + text)
    file = os.path.join(folder, "new.toml")
    with open(file, "w", encoding="utf-8") as new:
        new.write(f'[can]\ninterface = "can0"\nsample_rate_hz = 20\n[can.signals]\nouter = "Resolvers.Inner"\n[commission]\nfolder = "{folder}"\n')
    accept = [rig.program("vibrig"), "commission", "accept", "--bus", "--config", file, "--by", "Ada"]
    one = subprocess.run([*accept, "--second", "ada"], input="yes\n", capture_output=True, text=True, check=False)
    no = subprocess.run([*accept, "--second", "Bo"], input="no\n", capture_output=True, text=True, check=False)
    checks.check(one.returncode == 1 and no.returncode == 1 and "nothing is written" in no.stderr and not os.path.exists(file + ".1"), "it takes two, and a yes",
                 one.stderr + no.stdout + no.stderr)
    two = subprocess.run([*accept, "--second", "Bo"], input="yes\n", capture_output=True, text=True, check=False)
    with open(file, encoding="utf-8") as new:
        text = new.read()
    checks.check(two.returncode == 0 and '+ can.signals.outer = "Resolvers.Outer"' in two.stdout and 'outer = "Resolvers.Outer"' in text and
                 "sample_rate_hz = 40" in text and os.path.exists(file + ".1"), "then it is in the configuration", two.stdout + two.stderr + text)
    with open(file, "w", encoding="utf-8") as new:
        new.write("[can]\nsample_rate_hz = 20\n")
    lies = subprocess.run([*argv, "--config", file, "--json"], input="-\n-\n-\n", capture_output=True, text=True, check=False)
    checks.check(lies.returncode == 1 and json.loads(lies.stdout)["outcome"] == "undecided" and json.loads(lies.stdout)["suspects"] == ["can.signals.outer"],
                 "what is left out is not written", lies.stdout + lies.stderr)


def real(checks, programs, folder):
    """A configuration that does not say that its rig is simulated: persons answer, and its gimbals are moved with their permission."""
    rig = r.Rig(programs, "seqpacket", "real", folder)
    try:
        rig.start_plant("--seed", "4", "--warm-up", "1", "--start-temperature", "45")
        rig.be_punctual()
        bus = subprocess.run([rig.program("vibrig"), "commission", "bus", "--seqpacket", rig.path, "--for", "2", "--json"],
                             capture_output=True, text=True, check=False)
        heard = {message["id"]: message for message in json.loads(bus.stdout)["messages"]} if bus.returncode == 0 else {}
        checks.check(0x80 in heard and 20 < heard[0x80]["period_ms"] < 30 and 0 in heard[0x80]["counters"] and 4 in heard[0x101]["at_rest"],
                     "without a daemon and a DBC the bus is listed", bus.stdout + bus.stderr)
        dbc = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", "proto", "rig.dbc")
        bus = subprocess.run([rig.program("vibrig"), "commission", "bus", "--seqpacket", rig.path, "--for", "1", "--turn", "--dbc", dbc, "--json"],
                             capture_output=True, text=True, check=False)
        signals = json.loads(bus.stdout or "{}")
        checks.check(bus.returncode == 1 and signals["outcome"] == "undecided" and signals["answers"] == [] and
                     "Sync.SyncCount" in signals["counters"] and "Resolvers.OuterValid" in signals["unproven"] and signals["unknown"] == [],
                     "with a DBC its signals are, and nobody has turned any", bus.stdout + bus.stderr)
        bits(checks, rig, dbc, os.path.join(folder, "bits"))
        named_by_hand(checks, rig, dbc, os.path.join(folder, "bits"))
        rig.configure(CAMPAIGN, **r.PATIENT)
        check = subprocess.run([rig.program("vibrigd"), "--check", "--config", rig.configuration], capture_output=True, text=True, check=True)
        stated = {}
        for role, key, value in re.findall(r"^shaker\.registers\.(\w+)\.(type|address|table|word_order|scale|mask) +=  (\S+)", check.stdout, re.M):
            stated.setdefault("shaker.registers." + role, {})[key] = json.loads(value)
        late = {"can": {"stale_deadline_ms": 1000}, "gimbal": {"status_deadline_ms": 1000}, "shaker": {"response_timeout_ms": 1000}}   # as a real rig may be
        rig.configure(CAMPAIGN, **late, **stated, commission={"simulated": False, "folder": os.path.join(folder, "commission")})
        rig.start_daemon()
        ready = rig.wait_for(lambda s: s["platform"].get("ready") and s["shaker"].get("state") == 0, 60)
        checks.check(ready and ready["platform"].get("ready") and not ready.get("simulated"), "a rig that counts as real is ready", rig.logs())
        for _ in range(40):   # until the stop at the daemon's start is confirmed
            hand = rig.tool("commission", "--by", "Ada", "--by-hand")   # nobody answers
            if "at rest only" not in hand.stderr:
                break
            time.sleep(0.5)
        checks.check("power stage off?" in hand.stdout and hand.returncode == 1, "by hand it begins", hand.stdout + hand.stderr)
        answers = os.path.join(folder, "answers.json")
        with open(answers, "w", encoding="utf-8") as file:
            json.dump(ANSWERS, file)
        scripted = rig.tool("commission", "--by", "Ada", "--by-hand", "--answers", answers)
        checks.check(scripted.returncode == 2 and "persons answer on a real rig" in scripted.stderr, "and no script answers", scripted.stderr)
        rig.wait_for(lambda s: r.state_of(s) == "idle", 20)
        before = after_slews(rig)
        unasked = rig.tool("commission", "--by", "Ada")   # nobody answers
        after = rig.wait_for(lambda s: r.state_of(s) == "idle", 20) or rig.status()   # a status is shown for a moment
        checks.check("power stage off?" in unasked.stdout and unasked.returncode == 1 and not_moved(before, after) and r.state_of(after) == "idle",
                     "by command, too; without a permission nothing moves",
                     (unasked.stdout + unasked.stderr, unasked.returncode, r.state_of(after), readings(before), readings(after)))
        t = Terminal(rig)
        for question, answer in (("power stage off?", "yes"), ("count in", "yes"), ("or free", ""), ("hold where it is", "h"),
                                 ("present readings", "y"), ("OUTER", "y"), ("Which gimbal turned?", "outer"), ("INNER", "no")):
            checks.check(t.until(question, 120) and t.until("> "), f"of a real rig it asks: {question}", t.text + rig.logs())
            t.type(answer)
        checks.check(t.until("UNFINISHED") and t.end() == 1, "a no ends it", t.text)
        stands = after_slews(rig)
        outer = [readings(s)["outer"] for s in (before, stands)]
        checks.check(abs(remainder(outer[1] - outer[0])) < 0.1 and not_moved(stands, rig.status()), "the gimbal is back where it was", outer)
        stated = rig.tool("commission", "gyros", "--by", "Ada", "--second", "Bo", "--yes")
        checks.check(stated.returncode == 2 and "--yes: persons answer on a real rig" in stated.stderr, "nor states", stated.stderr)
    finally:
        rig.stop()


def main():
    programs = r.programs_from_command_line(__doc__)
    checks = r.Checks()
    with tempfile.TemporaryDirectory() as folder:
        whole(checks, programs, folder, 2)
    with tempfile.TemporaryDirectory() as folder:
        killed(checks, programs, folder, range(1, 112) if "--soak" in sys.argv else KILLS)
    with tempfile.TemporaryDirectory() as folder:
        dialogue(checks, programs, folder)
    hard_ones(checks, programs, "--soak" in sys.argv)
    for one in (killed_while_torqued, nothing_is_written, few_bits, lying_clock):
        with tempfile.TemporaryDirectory() as folder:
            one(checks, programs, folder)
    with tempfile.TemporaryDirectory() as folder:
        against_its_certificate(checks, programs, folder)
    with tempfile.TemporaryDirectory() as folder:
        real(checks, programs, folder)
    return checks.end()


if __name__ == "__main__":
    sys.exit(main())
