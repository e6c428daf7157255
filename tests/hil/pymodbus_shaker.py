#!/usr/bin/python3
"""A shaker controller played by pymodbus: the register map of proto/register_map.hpp in an independent implementation,
honest or lying.

usage: pymodbus_shaker.py PORT | rtu [--lie NAME[=VALUE]]... [--table FIFO]

Serves Modbus TCP on 127.0.0.1:PORT, or RTU (unit 1) on a pseudo terminal whose name is the first line it prints. Then prints
one JSON line per change: {"run":1,"amplitude_g":9.0,"level_g":9.0,...}; "level_g" is what the registers believe, "table_g"
what the table does. Lines on standard input: "lie NAME[=VALUE]", "honest". With --table the control FIFO of a vibrig-plant,
whose table then does as this controller's.

Lies, as those of vibrig-plant: ack_without_stop, timeout_ignored, timeout_scaled=FACTOR, amplitude_scaled=FACTOR,
readback_echo, stuck_contactor, slow_ramp=FACTOR, unit_rms, dead_table, timeout_register=MS.
"""
import argparse
import asyncio
import json
import logging
import math
import os
import sys
import time
import tty

from pymodbus.datastore import ModbusSequentialDataBlock, ModbusServerContext, ModbusSlaveContext
from pymodbus.server.async_io import ModbusSerialServer, ModbusTcpServer

FREQUENCY, AMPLITUDE, RAMP, RUN, FEED, TIMEOUT = 0, 2, 4, 5, 6, 7
IDLE, RAMPING, RUNNING, STOPPING, FAULT = range(5)
FLAGS = ("ack_without_stop", "timeout_ignored", "readback_echo", "stuck_contactor", "unit_rms", "dead_table")
NUMBERS = ("timeout_scaled", "amplitude_scaled", "slow_ramp", "timeout_register")


def lie(text):
    """("name", value) of NAME[=VALUE]."""
    name, _, value = text.replace("-", "_").partition("=")
    if name in FLAGS and not value:
        return name, True
    if name in NUMBERS and value:
        return name, float(value)
    raise argparse.ArgumentTypeError(f"found {text!r}, expected one of {', '.join(FLAGS)} or, with =VALUE, {', '.join(NUMBERS)}")


class Holding(ModbusSequentialDataBlock):
    """Knows when run = 0 was written, which acknowledges a fault at rest."""

    def __init__(self):
        super().__init__(0, [0] * 16)
        self.stopped = False

    def setValues(self, address, values):
        super().setValues(address, values)
        count = len(values) if isinstance(values, list) else 1
        if address + count > TIMEOUT + 1:
            print(f"written beyond the map: {address}", flush=True)
        self.stopped = self.stopped or (address <= RUN < address + count and self.values[RUN] == 0)


class Shaker:
    """Amplitude follows the set-point linearly; silence of the feeder beyond the time-out stops it."""

    def __init__(self, lies):
        self.holding = Holding()
        self.inputs = ModbusSequentialDataBlock(0, [0] * 16)
        self.state, self.fault, self.level, self.last_feed, self.fed_at = IDLE, 0, 0.0, 0, time.monotonic()
        self.heard = b""   # of a line that is not whole yet
        self.feeds, self.lies, self.held, self.ordered_to_run = 0, dict(lies), 0.0, False

    def word(self, address):
        return self.holding.values[address]

    def long(self, address):
        return self.word(address) << 16 | self.word(address + 1)

    def set_point(self):
        return self.long(AMPLITUDE) * 1e-4

    def table(self):
        """Peak g, in truth."""
        if self.lies.get("dead_table"):
            return 0.0
        unit = math.sqrt(2) if self.lies.get("unit_rms") else 1.0
        return self.lies.get("amplitude_scaled", 1.0) * unit * max(self.level, self.held)

    def step(self, dt):
        now, lies = time.monotonic(), self.lies
        if "timeout_register" in lies:
            self.holding.values[TIMEOUT] = int(lies["timeout_register"])
        if self.word(FEED) != self.last_feed:
            self.last_feed, self.fed_at, self.feeds = self.word(FEED), now, self.feeds + 1
        if self.word(RUN) and not self.ordered_to_run:
            self.fed_at = now
        ends = self.ordered_to_run and not self.word(RUN) and not lies.get("ack_without_stop")
        self.ordered_to_run = bool(self.word(RUN)) or (self.ordered_to_run and not ends)
        timeout = self.word(TIMEOUT) * 1e-3 * lies.get("timeout_scaled", 1.0)
        if (self.level > 0 or self.ordered_to_run) and 0 < timeout < now - self.fed_at and not lies.get("timeout_ignored"):
            ends, self.ordered_to_run, self.fault = True, False, self.fault | 1
            self.holding.values[RUN] = 0
        if ends and lies.get("stuck_contactor"):
            self.held = max(self.held, self.level)
        if not lies.get("stuck_contactor"):
            self.held = 0.0
        if self.level == 0 and self.holding.stopped:
            self.fault = 0
        self.holding.stopped = False
        wanted = self.set_point() if self.ordered_to_run and not self.fault else 0.0
        rate = max(self.set_point(), self.level, 0.1) / max(self.word(RAMP) * 1e-2, 0.1) / lies.get("slow_ramp", 1.0)
        if self.level < wanted:
            self.level = min(wanted, self.level + rate * dt)
        else:
            self.level = max(wanted, self.level - rate * dt)
        if self.fault:
            self.state = FAULT
        elif self.ordered_to_run:
            self.state = RUNNING if self.level == wanted else RAMPING
        else:
            self.state = STOPPING if self.level > 0 else IDLE
        measured = 0.0 if lies.get("dead_table") else self.level
        if lies.get("readback_echo"):
            measured = self.set_point() if self.word(RUN) else 0.0
        measured = round(measured * 1e4)
        self.inputs.values[0:5] = [self.state, self.fault, 0, measured >> 16, measured & 0xFFFF]

    def report(self):
        return {"run": self.word(RUN), "frequency_hz": self.long(FREQUENCY) * 1e-3,
                "amplitude_g": self.set_point(), "ramp_s": self.word(RAMP) * 1e-2,
                "watchdog_s": self.word(TIMEOUT) * 1e-3, "state": self.state, "fault": self.fault, "lies": sorted(self.lies)}


async def play(shaker, fifo):
    said, done, began = None, None, time.monotonic()
    while True:
        now = time.monotonic()
        shaker.step(now - began)
        began = now
        if shaker.report() != said:
            said = shaker.report()
            print(json.dumps({**said, "feeds": shaker.feeds, "level_g": round(shaker.level, 4),
                              "table_g": round(shaker.table(), 4)}), flush=True)
        if fifo is not None and shaker.table() != done:
            done = shaker.table()
            print(f"table {done:.6f}", file=fifo, flush=True)
        await asyncio.sleep(0.05)


def line():
    """Two pseudo terminals back to back: what the client writes to the one comes out of the other."""
    loop = asyncio.get_running_loop()
    near, near_slave = os.openpty()
    far, far_slave = os.openpty()
    for end in (near_slave, far_slave):
        tty.setraw(end)
    loop.add_reader(near, lambda: os.write(far, os.read(near, 512)))
    loop.add_reader(far, lambda: os.write(near, os.read(far, 512)))
    return os.ttyname(near_slave), os.ttyname(far_slave)


def listen(shaker):
    """Whole lines of standard input, however many have come."""
    data = os.read(0, 4096)
    if not data:
        asyncio.get_running_loop().remove_reader(0)
    shaker.heard += data
    *lines, shaker.heard = shaker.heard.split(b"\n")
    for text in lines:
        word, _, rest = text.decode().strip().partition(" ")
        if word == "honest":
            shaker.lies.clear()
        elif word == "lie":
            try:
                shaker.lies.update([lie(rest)])
            except (argparse.ArgumentTypeError, ValueError) as error:
                print(error, file=sys.stderr, flush=True)


async def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("where")
    parser.add_argument("--lie", type=lie, action="append", default=[])
    parser.add_argument("--table")
    arguments = parser.parse_args()
    shaker = Shaker(arguments.lie)
    fifo = open(arguments.table, "w", encoding="ascii") if arguments.table else None
    slave = ModbusSlaveContext(hr=shaker.holding, ir=shaker.inputs, zero_mode=True)
    context = ModbusServerContext(slaves={1: slave}, single=False)
    if arguments.where == "rtu":
        client_device, device = line()
        server = ModbusSerialServer(context, port=device, baudrate=115200)   # a pseudo terminal knows no parity
        await server.start()
        print(client_device, flush=True)
    else:
        server = ModbusTcpServer(context, address=("127.0.0.1", int(arguments.where)), allow_reuse_address=True)
    if not sys.stdin.closed and not os.path.samestat(os.fstat(0), os.stat("/dev/null")):
        asyncio.get_running_loop().add_reader(0, listen, shaker)
    playing = asyncio.ensure_future(play(shaker, fifo))
    await server.serve_forever()
    playing.cancel()


if __name__ == "__main__":
    logging.disable()   # it calls the end of a connection an error
    asyncio.run(main())
