#!/usr/bin/python3
"""Horn and lamp as coils of pymodbus, an implementation of Modbus that shares nothing with libmodbus.

usage: coil_server.py honest|deaf|refuses|mute
  deaf: acknowledges writes and carries none out; refuses: answers writes with an exception; mute: never answers
Prints its port, then one line per write as it was understood: "coil ADDRESS VALUE". Ends with its standard input.
"""
import asyncio
import logging
import sys

from pymodbus.datastore import ModbusSequentialDataBlock, ModbusServerContext, ModbusSlaveContext
from pymodbus.server.async_io import ModbusTcpServer


class Coils(ModbusSequentialDataBlock):
    def __init__(self, kind):
        super().__init__(0, [False] * 16)
        self.kind = kind

    def setValues(self, address, values):
        print("coil", address, int(values[0]), flush=True)
        if self.kind == "refuses":
            raise ValueError("no")
        if self.kind != "deaf":
            super().setValues(address, values)


async def mute():
    async def take(reader, _writer):
        await reader.read()
    server = await asyncio.start_server(take, "127.0.0.1", 0)
    print(server.sockets[0].getsockname()[1], flush=True)
    return server


async def main(kind):
    loop = asyncio.get_running_loop()
    ended = loop.create_future()
    loop.add_reader(sys.stdin, lambda: sys.stdin.readline() or ended.done() or ended.set_result(None))
    if kind == "mute":
        server = await mute()
    else:
        context = ModbusServerContext(slaves={1: ModbusSlaveContext(co=Coils(kind), zero_mode=True)}, single=False)
        server = ModbusTcpServer(context, address=("127.0.0.1", 0))
        serving = asyncio.ensure_future(server.serve_forever())
        await server.serving
        print(server.server.sockets[0].getsockname()[1], flush=True)
    await ended
    if kind != "mute":
        serving.cancel()


logging.disable()  # it calls the end of a connection an error
asyncio.run(main(sys.argv[1]))
