#!/usr/bin/python3
"""A controller that is not ours, played by pymodbus with a map of its own, exceptions beyond it and a count of what is written to it:
what Vibrig does before anybody has stated its registers is read it, over TCP and over a serial line. Once they are stated each is tried, with the
stop chain open.

usage: foreign_registers.py PROGRAMS
"""
import asyncio
import json
import logging
import os
import re
import signal
import socket
import struct
import subprocess
import sys
import tempfile
import threading
import time

from pymodbus.datastore import ModbusSequentialDataBlock, ModbusServerContext, ModbusSlaveContext
from pymodbus.device import ModbusDeviceIdentification
from pymodbus.server.async_io import ModbusSerialServer, ModbusTcpServer

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import pymodbus_shaker  # noqa: E402
import rig as r  # noqa: E402

FREQUENCY, ACTUAL, AMPLITUDE, HOLDING = 100, 140, 60, 160
RAMP, RUN, FEED, TIMEOUT = 70, 72, 80, 90
STATE, FAULT, CHAIN, MEASURED = 0, 1, 2, 3   # input
IDLE, FAULTY = 0, 4
MOST_G = 13   # that it takes


class Counted(ModbusSequentialDataBlock):
    """Counts what comes over the wire; the panel does not. One reply may be late."""
    written, late_s = 0, 0

    def __init__(self, *arguments):
        super().__init__(*arguments)
        self.places, self.then = set(), lambda: None

    def getValues(self, address, count=1):
        late_s, self.late_s = self.late_s, 0
        time.sleep(late_s)
        return super().getValues(address, count)

    def setValues(self, address, values):
        self.written += 1
        self.places.update(range(address, address + (len(values) if isinstance(values, list) else 1)))
        super().setValues(address, values)
        self.then()

    def panel(self, address, words):
        self.values[address:address + len(words)] = words


class Controller:
    """Frequency as f32, low word first, twice (set-point and actual); amplitude as u32 in 1e-6."""

    def __init__(self, line):
        self.holding = Counted(0, [(37 * i) % 9001 for i in range(HOLDING)])
        self.inputs, self.coils = Counted(0, [7] * 8), Counted(0, [0] * 8)
        self.loop, self.where, ready = asyncio.new_event_loop(), None, threading.Event()
        slave = ModbusSlaveContext(hr=self.holding, ir=self.inputs, co=self.coils, zero_mode=True)
        context = ModbusServerContext(slaves={1: slave}, single=False)

        identity = None if line else ModbusDeviceIdentification(info_name={"VendorName": "ACME", "ProductCode": "VC-3", "MajorMinorRevision": "2.11"})

        async def serve():
            if line:
                self.where, device = pymodbus_shaker.line()
                server = ModbusSerialServer(context, port=device, baudrate=115200, identity=identity)
                await server.start()
            else:
                server = ModbusTcpServer(context, address=("127.0.0.1", 0), allow_reuse_address=True, identity=identity)
                task = asyncio.ensure_future(server.serve_forever())
                await server.serving
                self.where = f"127.0.0.1:{server.server.sockets[0].getsockname()[1]}"
                ready.set()
                await task
            ready.set()
            await server.serve_forever()

        threading.Thread(target=self.loop.run_until_complete, args=(serve(),), daemon=True).start()
        ready.wait(10)

    def frequency(self, hz, actual=None):
        for at, value in ((FREQUENCY, hz), (ACTUAL, hz if actual is None else actual)):
            high, low = struct.unpack(">HH", struct.pack(">f", value))
            self.holding.panel(at, [low, high])

    def amplitude(self, g):
        count = round(g * 1e6)
        self.holding.panel(AMPLITUDE, [count >> 16, count & 0xffff])

    def rest(self):
        """As a rig that its registers were stated of: at rest, the chain closed."""
        self.frequency(15.0, 3.0)
        self.amplitude(0)
        for at, value in ((RAMP, 20), (RUN, 0), (FEED, 0), (TIMEOUT, 1500)):
            self.holding.panel(at, [value])
        self.inputs.panel(0, [0] * 8)
        self.holding.then = self.takes_no_more

    def takes_no_more(self):
        """A set-point beyond what it does is cut to that."""
        if self.holding.values[AMPLITUDE] << 16 | self.holding.values[AMPLITUDE + 1] > round(MOST_G * 1e6):
            self.amplitude(MOST_G)

    def chain(self, is_open):
        self.inputs.panel(CHAIN, [8 if is_open else 0])
        if is_open:
            self.inputs.panel(STATE, [FAULTY])

    def shown(self, role):
        """On its display."""
        if role == "frequency":
            high, low = self.holding.values[FREQUENCY + 1], self.holding.values[FREQUENCY]
            return f"{struct.unpack('>f', struct.pack('>HH', high, low))[0]:.2f}"
        if role == "amplitude":
            return f"{(self.holding.values[AMPLITUDE] << 16 | self.holding.values[AMPLITUDE + 1]) * 1e-6:.3f}"
        return f"{self.holding.values[RAMP] * 0.1:.1f}" if role == "ramp_time" else "-"

    def written(self):
        return self.holding.written + self.inputs.written + self.coils.written


class Person:
    """Sets the panel as asked, and types what it shows."""

    def __init__(self, program, where, line):
        link = ["--device", where, "--baud", "115200"] if line else ["--tcp", where]
        self.tool = subprocess.Popen([program, "commission", "registers", "--by", "Ada", "--plate", "a plate", "--json", "--holding", "200", *link], stdin=subprocess.PIPE,
                                     stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, preexec_fn=r.die_with_parent)
        self.text = ""

    def until_asked(self):
        while True:
            one = self.tool.stderr.read(1)
            self.text += one
            if not one or self.text.endswith("\n> "):
                return bool(one)

    def type(self, text):
        self.tool.stdin.write(text + "\n")
        self.tool.stdin.flush()

    def end(self):
        out, rest = self.tool.communicate(timeout=30)
        return self.tool.returncode, json.loads(out) if out else {}, self.text + rest


def found_by_reading(checks, programs, line):
    name = "RTU" if line else "TCP"
    controller = Controller(line)
    for same in (False,) if line else (True, False):
        person = Person(os.path.join(programs, "vibrig"), controller.where, line)
        for shown in ("fifteen", "15.00", "15.00", "17.50", "21.25"):
            person.until_asked()
            if shown == "17.50":
                controller.holding.late_s = 1.5   # beyond the response timeout, once
            if shown[0].isdigit():
                controller.frequency(float(shown), float(shown) if same else 3.0)
            person.type(shown)
        for shown in ("0.100", "0.250", "0.400"):
            person.until_asked()
            controller.amplitude(float(shown))
            person.type(shown)
        code, found, text = person.end()
        checks.check('found "fifteen", expected a positive number' in text and "another than before" in text, f"{name}: what is no value is asked again", text)
        if not line:
            checks.check(all(word in found.get("device", "") for word in ("ACME", "VC-3", "2.11")), "the device says who it is", found)
        places = found.get("places", {})
        own = [f'frequency = {{ address = {at}, type = "f32", word_order = "little", table = "holding", scale = 1 }}'
               for at in ((FREQUENCY, ACTUAL) if same else (FREQUENCY,))]
        checks.equal(places.get("frequency"), own, f"{name}: the frequency's place, or set-point and actual value")
        amplitude = f'amplitude = {{ address = {AMPLITUDE}, type = "u32", word_order = "big", table = "holding", scale = 1e-06 }}'
        checks.equal(places.get("amplitude"), [amplitude], f"{name}: the amplitude's, beyond 65535 counts")
        checks.check((code, found.get("outcome")) == ((1, "undecided") if same else (0, "decided")), f"{name}: one place is decided, two are not", text)
    person = Person(os.path.join(programs, "vibrig"), controller.where, line)
    for shown in ("77.77", "88.88", "99.99", ""):   # which it keeps nowhere
        person.until_asked()
        person.type(shown)
    code, found, text = person.end()
    checks.check((code, found.get("outcome"), found.get("places")) == (1, "undecided", {"frequency": []}) and
                 "no place shows what was typed: more registers" in text, f"{name}: what is nowhere is not for more counts to tell", text)
    checks.equal(controller.written(), 0, f"{name}: nothing was written")


STATED = {
    "frequency": {"address": FREQUENCY, "type": "f32", "word_order": "little", "scale": 1},
    "amplitude": {"address": AMPLITUDE, "type": "u32", "word_order": "big", "scale": 1e-6},
    "ramp_time": {"address": RAMP, "type": "u16", "scale": 0.1}, "run": {"address": RUN, "type": "u16"},
    "watchdog": {"address": FEED, "type": "u16"}, "watchdog_timeout": {"address": TIMEOUT, "type": "u16", "scale": 1e-3},
    "state": {"address": STATE, "type": "u16", "table": "input"}, "fault": {"address": FAULT, "type": "u16", "table": "input"},
    "emergency_stop": {"address": CHAIN, "type": "bits", "table": "input", "mask": 8},
    "measured_amplitude": {"address": MEASURED, "type": "u32", "word_order": "big", "table": "input", "scale": 1e-6}}
WRITTEN = {FREQUENCY, FREQUENCY + 1, AMPLITUDE, AMPLITUDE + 1, RAMP, RUN, FEED, TIMEOUT}


class Tried:
    """A person who does and types what is asked for, over the controller and its registers as they are stated."""

    def __init__(self, programs, folder, controller, line, buttons, **other):
        rig = r.Rig(programs, "seqpacket", "real", folder)
        rig.modbus_port = 502 if line else int(controller.where.rpartition(":")[2])
        link = {"transport": "rtu", "device": controller.where, "baud": 115200} if line else {}
        stated = {**STATED, **other}
        rig.configure({"name": "foreign"}, shaker={**link, "response_timeout_ms": 500 if line else 1000}, commission={"simulated": False, "folder": os.path.join(folder, "commission"), "buttons": buttons},
                      **{"shaker.registers." + role: keys for role, keys in stated.items()})
        self.controller, self.text, self.instead = controller, "", {}
        self.command = [os.path.join(programs, "vibrig"), "commission", "registers", "--by", "Ada", "--plate", "a plate", "--json", "--write",
                        "--config", rig.configuration]
        self.tool = subprocess.Popen(self.command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
                                     preexec_fn=r.die_with_parent)

    def question(self):
        asked = ""
        while not asked.endswith("\n> "):
            one = self.tool.stderr.read(1)
            asked += one
            self.text += one
            if not one:
                return ""
        return " ".join(asked.split())

    def answer(self, question):
        for words, what in self.instead.items():
            if words in question:
                return what() if callable(what) else what
        if "power stage off? [yes" in question:
            return "yes"
        for words, is_open in (("? Close the", False), ("Release ", False), ("Press the button", True), ("? Open the", True)):
            if words in question:
                self.controller.chain(is_open)
                return ""
        name = re.search(r"\? May (\w+) ", question)
        if name:
            return name[1]
        return self.controller.shown(re.search(r"\? (\w+) is ", question)[1])

    def all(self):
        while True:
            question = self.question()
            if not question:
                break
            text = self.answer(question)
            if text is None:
                break
            self.tool.stdin.write(text + "\n")
            self.tool.stdin.flush()
        out, rest = self.tool.communicate(timeout=60)
        return self.tool.returncode, json.loads(out) if out else {}, self.text + rest


def on_change(checks, programs, folder, name):
    """A platform's status that the DBC does not have come often enough is named before it trips."""
    vibrigd, file, dbc = os.path.join(programs, "vibrigd"), os.path.join(folder, "on_change.toml"), os.path.join(folder, "on_change.dbc")
    shipped = subprocess.run([vibrigd, "--print-dbc"], capture_output=True, text=True, check=True).stdout
    with open(os.path.join(folder, "vibrigd.toml"), encoding="utf-8") as of:
        stated = of.read()
    for cycle, says in (("100", ""), ("1000", "comes each 1000 ms"), ("0", "has no GenMsgCycleTime")):
        with open(dbc, "w", encoding="utf-8") as to:
            to.write(shipped.replace('"GenMsgCycleTime" BO_ 544 100;', f'"GenMsgCycleTime" BO_ 544 {cycle};'))
        with open(file, "w", encoding="utf-8") as to:
            to.write(stated.replace("[can]\n", f'[can]\ndbc = "{dbc}"\n'))
        check = subprocess.run([vibrigd, "--check", "--config", file], capture_output=True, text=True, check=False)
        told = [line for line in check.stderr.splitlines() if "can.signals." in line]
        good = all(f'"PlatformStatus.{flag}", whose message by the DBC {says}' in check.stderr for flag in ("LoopClosed", "Fault")) and len(told) == 2
        checks.check(check.returncode == 0 and (good if says else not told), f"{name}: a status each {cycle} ms by its DBC: "
                     f"{'is warned of' if says else 'is well'}", check.stderr)


def tried(checks, programs, line):
    """Each register that is stated is written, read back and put back; nothing else is."""
    name = "RTU" if line else "TCP"
    controller = Controller(line)
    controller.rest()
    before = list(controller.holding.values)
    with tempfile.TemporaryDirectory() as folder:
        code, found, text = Tried(programs, folder, controller, line, ["rack"]).all()
        if not checks.check(code == 0, f"{name}: all of them pass", [code, found, text]):
            return
        log = os.path.join(folder, "commission", "registers.jsonl")
        with open(log, encoding="utf-8") as file:
            lines = [json.loads(one) for one in file]
        kept = os.path.join(folder, "commission", "registers.json")
        with open(kept, encoding="utf-8") as file:
            proof = json.load(file)
        check = subprocess.run([os.path.join(programs, "vibrigd"), "--check", "--config", os.path.join(folder, "vibrigd.toml")], capture_output=True,
                               text=True, check=False)
        stated = dict(re.findall(r"^(shaker\.registers\.\S+) +=  (.*?)(?:  +\S.*)?$", check.stdout, re.M))
        on_change(checks, programs, folder, name)
    checks.check(proof["by"] == "Ada" and len(stated) > 20 and proof["keys"] == stated, f"{name}: it is kept what was tried, by which a daemon lets it run",
                 [proof, stated, check.stderr])
    writes = [one for one in lines if one["what"] == "write"]
    first = writes[1] if len(writes) > 1 else {}
    checks.check(len(writes) == sum(one["what"] == "answer" for one in lines) and all(one["by"] == "Ada" and one["identity"].startswith("uid ") and one["utc_ns"] > 0 for one in lines) and
                 {one["address"] for one in writes} == {FREQUENCY, AMPLITUDE, RAMP, RUN, FEED, TIMEOUT}, f"{name}: each write is kept with who and when", lines)
    checks.check(first.get("register") == "frequency" and first["old"]["value"] == 15 and first["new"]["value"] == 16,
                 f"{name}: with old and new value", first)
    checks.check(lines[0]["what"] == "begin" and lines[-1]["what"] == "verdict" and lines[-1]["outcome"] == "decided", f"{name}: and what came of it", lines[-1])
    rows = {row["name"]: row for row in found.get("rows", [])}
    checks.check(code == 0 and found["outcome"] == "decided" and not found["simulated"] and
                 list(rows)[:8] == ["stop chain, rack", "closing after rack", "frequency", "amplitude", "ramp_time", "watchdog_timeout", "watchdog", "run"],
                 f"{name}: each of its registers passes", text)
    checks.equal(controller.holding.places, WRITTEN, f"{name}: only the stated registers were written")
    checks.equal(controller.holding.values, before, f"{name}: and all is as it was")
    limits = [rows.get(f"limit, {each}", {}).get("found", "") for each in ("acceleration_g", "velocity_mps", "displacement_mm")]
    checks.check("does not limit, Vibrig alone does" in limits[0] and limits[1].endswith(f"g is held to {MOST_G}"),
                 f"{name}: what the controller does not limit is reported, and what it does", limits)


def not_as_stated(checks, programs):
    """What contradicts the map ends it, with what was written taken back."""
    for what, other, word in (("a scale that is not the display's", {"ramp_time": {"address": RAMP, "type": "u16", "scale": 0.01}}, "on the display"),
                              ("another place", {"watchdog_timeout": {"address": HOLDING + 5, "type": "u16", "scale": 1e-3}}, "cannot be read"),
                              ("swapped words", {"frequency": {"address": FREQUENCY, "type": "f32", "word_order": "big", "scale": 1}}, "shaker.registers.frequency")):
        controller = Controller(False)
        controller.rest()
        before = list(controller.holding.values)
        with tempfile.TemporaryDirectory() as folder:
            code, found, text = Tried(programs, folder, controller, False, ["rack"], **other).all()
        checks.check(code == 1 and found.get("outcome") == "refused" and word in found["why"], f"{what} is refused: {found.get('why')}", text)
        checks.check(controller.holding.values == before and controller.holding.places <= WRITTEN, f"{what}: all is as it was", controller.holding.places)


def disturbed(checks, programs):
    """Another master, a person who goes, a daemon that has the rig."""
    controller = Controller(False)
    controller.rest()
    with tempfile.TemporaryDirectory() as folder:
        one = Tried(programs, folder, controller, False, ["rack"])
        one.instead["? May amplitude "] = lambda: controller.frequency(40.0, 3.0) or "amplitude"
        code, found, text = one.all()
    checks.check(code == 1 and "shaker.registers.frequency (holding 100) was 15, is 40" in found.get("why", "") and "another master" in found["why"],
                 "another master is named by its register", text)
    checks.check(not controller.holding.places & {AMPLITUDE, RAMP}, "and nothing more is written", controller.holding.places)
    for how in ("ended by a signal", "nobody answers"):
        controller.rest()
        controller.holding.places.clear()
        before = list(controller.holding.values)
        with tempfile.TemporaryDirectory() as folder:
            one = Tried(programs, folder, controller, False, ["rack"])
            one.instead["? frequency is 16 now"] = lambda one=one, how=how: one.tool.send_signal(signal.SIGINT) if "signal" in how else None
            code, found, text = one.all()
        checks.check(code == 2 and FREQUENCY in controller.holding.places and controller.holding.values == before,
                     f"{how}: what was written is taken back", text)
    with tempfile.TemporaryDirectory() as folder, socket.socket(socket.AF_UNIX) as daemon:
        daemon.bind("\0vibrig-rig/modbus:" + controller.where)
        daemon.listen()
        written = controller.written()
        code, found, text = Tried(programs, folder, controller, False, ["rack"]).all()
        checks.check(code == 2 and f"pid {os.getpid()}" in text and controller.written() == written, "a rig that a daemon has is left alone", text)


def not_stated(checks, programs):
    """Without its registers a real rig's daemon does not start, and writes nothing."""
    controller = Controller(False)
    with tempfile.TemporaryDirectory() as folder:
        rig = r.Rig(programs, "seqpacket", "real", folder)
        rig.modbus_port = int(controller.where.rpartition(":")[2])
        rig.configure({"name": "foreign"}, commission={"simulated": False, "folder": os.path.join(folder, "commission")})
        for more in (["--check"], []):
            run = subprocess.run([rig.program("vibrigd"), *more, "--config", rig.configuration], capture_output=True, text=True, check=False, timeout=30)
            checks.check(run.returncode == 2 and "shaker.registers.amplitude" in run.stderr, f"vibrigd {' '.join(more)}: not stated, exit code 2", run.stderr)
    checks.equal(controller.written(), 0, "and nothing is written to it")


def not_tried(checks, programs):
    """Stated, and nobody has tried whether they are that: a daemon writes nothing but a stop into them."""
    controller = Controller(False)
    controller.rest()
    with tempfile.TemporaryDirectory() as folder:
        rig = r.Rig(programs, "seqpacket", "real", folder)
        rig.modbus_port = int(controller.where.rpartition(":")[2])
        rig.configure({"name": "foreign"}, commission={"simulated": False, "folder": os.path.join(folder, "commission")},
                      **{"shaker.registers." + role: keys for role, keys in STATED.items()})
        daemon = rig.daemon = r.Child("vibrigd", [rig.program("vibrigd"), "--config", rig.configuration], folder)
        try:
            status = rig.wait_for(lambda s: s["shaker"]["link"] == "running" and not s["shaker"].get("stop_pending"), 30)
            checks.check(status is not None, "not tried: the daemon reads it, and its stop is written", rig.logs())
            time.sleep(2)   # four periods of the watchdog
        finally:
            code = daemon.end()
        log = daemon.text()
    checks.equal(controller.holding.places, {RAMP, RUN}, "not tried: a stop is written, no feed and no timeout")
    checks.check(code == 0 and "nothing but a stop is written to the controller, its watchdog is not fed: " in log, "not tried: which it says", log)


def main():
    programs = r.programs_from_command_line(__doc__)
    checks = r.Checks()
    for line in (False, True):
        found_by_reading(checks, programs, line)
    not_stated(checks, programs)
    not_tried(checks, programs)
    for line in (False, True):
        tried(checks, programs, line)
    not_as_stated(checks, programs)
    disturbed(checks, programs)
    nobody = subprocess.run([os.path.join(programs, "vibrig"), "commission", "registers", "--by", "Ada", "--tcp", "127.0.0.1:1"], capture_output=True,
                            text=True, check=False, timeout=30)
    checks.check(nobody.returncode == 2 and "127.0.0.1:1" in nobody.stderr, "where nothing answers: exit code 2 and the address", nobody.stderr)
    return checks.end()


if __name__ == "__main__":
    logging.disable()   # pymodbus calls the end of a connection an error
    sys.exit(main())
