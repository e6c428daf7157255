#!/usr/bin/python3
"""A shaker controller played by pymodbus: the register map of proto/register_map.hpp in an independent implementation.

usage: pymodbus_shaker.py PORT

Serves Modbus TCP on 127.0.0.1:PORT and prints one JSON line per change: {"run":1,"amplitude_g":9.0,...}.
"""
import argparse
import asyncio
import json
import time

from pymodbus.datastore import ModbusSequentialDataBlock, ModbusServerContext, ModbusSlaveContext
from pymodbus.server import StartAsyncTcpServer

FREQUENCY, AMPLITUDE, RAMP, RUN, FEED, TIMEOUT = 0, 2, 4, 5, 6, 7
IDLE, RAMPING, RUNNING, STOPPING, FAULT = range(5)


class Shaker:
    """Amplitude follows the set-point linearly; silence of the feeder beyond the time-out stops it."""

    def __init__(self):
        self.holding = ModbusSequentialDataBlock(0, [0] * 16)
        self.inputs = ModbusSequentialDataBlock(0, [0] * 16)
        self.state, self.fault, self.level, self.last_feed, self.fed_at = IDLE, 0, 0.0, 0, time.monotonic()
        self.feeds = 0

    def word(self, address):
        return self.holding.values[address]

    def long(self, address):
        return self.word(address) << 16 | self.word(address + 1)

    def step(self, dt):
        now = time.monotonic()
        if self.word(FEED) != self.last_feed:
            self.last_feed, self.fed_at, self.feeds = self.word(FEED), now, self.feeds + 1
        wanted = self.long(AMPLITUDE) * 1e-4 if self.word(RUN) else 0.0
        timeout = self.word(TIMEOUT) * 1e-3
        if self.level > 0 and timeout > 0 and now - self.fed_at > timeout:
            self.fault |= 1
        if self.fault:
            wanted = 0.0
            if self.level == 0 and not self.word(RUN):
                self.fault = 0
        rate = max(self.long(AMPLITUDE) * 1e-4, self.level, 0.1) / max(self.word(RAMP) * 1e-2, 0.1)
        if self.level < wanted:
            self.level = min(wanted, self.level + rate * dt)
        else:
            self.level = max(wanted, self.level - rate * dt)
        if self.fault:
            self.state = FAULT
        elif self.word(RUN):
            self.state = RUNNING if self.level == wanted else RAMPING
        else:
            self.state = STOPPING if self.level > 0 else IDLE
        level = round(self.level * 1e4)
        self.inputs.values[0:5] = [self.state, self.fault, 0, level >> 16, level & 0xFFFF]

    def report(self):
        return {"run": self.word(RUN), "frequency_hz": self.long(FREQUENCY) * 1e-3,
                "amplitude_g": self.long(AMPLITUDE) * 1e-4, "ramp_s": self.word(RAMP) * 1e-2,
                "watchdog_s": self.word(TIMEOUT) * 1e-3, "state": self.state, "fault": self.fault}


async def play(shaker):
    said, period = None, 0.05
    while True:
        shaker.step(period)
        if shaker.report() != said:
            said = shaker.report()
            print(json.dumps({**said, "feeds": shaker.feeds, "level_g": round(shaker.level, 4)}), flush=True)
        await asyncio.sleep(period)


async def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("port", type=int)
    arguments = parser.parse_args()
    shaker = Shaker()
    playing = asyncio.ensure_future(play(shaker))
    slave = ModbusSlaveContext(hr=shaker.holding, ir=shaker.inputs, zero_mode=True)
    await StartAsyncTcpServer(context=ModbusServerContext(slaves=slave, single=True),
                              address=("127.0.0.1", arguments.port))
    playing.cancel()


asyncio.run(main())
