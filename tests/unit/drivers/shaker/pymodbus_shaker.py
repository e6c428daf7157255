#!/usr/bin/python3
"""A shaker controller by pymodbus, an implementation of Modbus that shares nothing with libmodbus.

Usage: pymodbus_shaker.py tcp|rtu. Prints where it can be reached (a port or a device), then one line per write as it
was understood: "write ADDRESS VALUE...". Ends with its standard input.
"""

import asyncio
import os
import logging
import sys
import tty

from pymodbus.datastore import ModbusSequentialDataBlock, ModbusServerContext, ModbusSlaveContext
from pymodbus.server.async_io import ModbusSerialServer, ModbusTcpServer

RUN, AMPLITUDE = 5, 2
STATE, MEASURED = 0, 3


class Holding(ModbusSequentialDataBlock):
    def __init__(self, inputs):
        super().__init__(0, [0] * 16)
        self.inputs = inputs

    def setValues(self, address, values):
        super().setValues(address, values)
        running = self.getValues(RUN, 1)[0] != 0
        self.inputs.setValues(STATE, [2 if running else 0])
        self.inputs.setValues(MEASURED, self.getValues(AMPLITUDE, 2) if running else [0, 0])
        print("write", address, *self.getValues(address, len(values) if isinstance(values, list) else 1), flush=True)


def line():
    """Two ptys back to back: what the client writes to the one comes out of the other."""
    loop = asyncio.get_running_loop()
    near, near_slave = os.openpty()
    far, far_slave = os.openpty()
    for fd in (near_slave, far_slave):
        tty.setraw(fd)
    loop.add_reader(near, lambda: os.write(far, os.read(near, 512)))
    loop.add_reader(far, lambda: os.write(near, os.read(far, 512)))
    return os.ttyname(near_slave), os.ttyname(far_slave)


async def main(kind):
    loop = asyncio.get_running_loop()
    inputs = ModbusSequentialDataBlock(0, [0] * 16)
    context = ModbusServerContext(
        slaves={1: ModbusSlaveContext(hr=Holding(inputs), ir=inputs, zero_mode=True)}, single=False)
    ended = loop.create_future()
    loop.add_reader(sys.stdin, lambda: sys.stdin.readline() or ended.done() or ended.set_result(None))
    if kind == "tcp":
        server = ModbusTcpServer(context, address=("127.0.0.1", 0))
        serving = asyncio.ensure_future(server.serve_forever())
        await server.serving
        print(server.server.sockets[0].getsockname()[1], flush=True)
    else:
        client_device, device = line()
        server = ModbusSerialServer(context, port=device, baudrate=115200)  # a pty knows no parity
        await server.start()
        serving = asyncio.ensure_future(server.serve_forever())
        print(client_device, flush=True)
    await ended
    serving.cancel()


logging.disable()  # it calls the end of a connection an error
asyncio.run(main(sys.argv[1]))
