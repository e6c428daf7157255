#!/usr/bin/python3
"""A controller that is not ours, played by pymodbus with a map of its own, exceptions beyond it and a count of what is written to it:
what Vibrig does before anybody has stated its registers is read it, over TCP and over a serial line.

usage: foreign_registers.py PROGRAMS
"""
import asyncio
import json
import logging
import os
import struct
import subprocess
import sys
import tempfile
import threading

from pymodbus.datastore import ModbusSequentialDataBlock, ModbusServerContext, ModbusSlaveContext
from pymodbus.device import ModbusDeviceIdentification
from pymodbus.server.async_io import ModbusSerialServer, ModbusTcpServer

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import pymodbus_shaker  # noqa: E402
import rig as r  # noqa: E402

FREQUENCY, ACTUAL, AMPLITUDE, HOLDING = 100, 140, 60, 160


class Counted(ModbusSequentialDataBlock):
    """Counts what comes over the wire; the panel does not."""
    written = 0

    def setValues(self, address, values):
        self.written += 1
        super().setValues(address, values)

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
    checks.equal(controller.written(), 0, f"{name}: nothing was written")


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


def main():
    programs = r.programs_from_command_line(__doc__)
    checks = r.Checks()
    for line in (False, True):
        found_by_reading(checks, programs, line)
    not_stated(checks, programs)
    nobody = subprocess.run([os.path.join(programs, "vibrig"), "commission", "registers", "--by", "Ada", "--tcp", "127.0.0.1:1"], capture_output=True,
                            text=True, check=False, timeout=30)
    checks.check(nobody.returncode == 2 and "127.0.0.1:1" in nobody.stderr, "where nothing answers: exit code 2 and the address", nobody.stderr)
    return checks.end()


if __name__ == "__main__":
    logging.disable()   # pymodbus calls the end of a connection an error
    sys.exit(main())
