#!/usr/bin/python3
"""CAN ports under load: two vcan buses at the highest rate the kernel sustains, with vibrigd on one of them, a burst into a
small receive buffer, and 9000 frames/s over a seqpacket socket. Nothing is lost that is not counted.

usage: load_campaign.py PROGRAMS [--seconds N] [--soak]    each load for N seconds (20; 600 with --soak)
       load_campaign.py PROGRAMS --inside N                the vcan half, where vcan0 and vcan1 are
"""
import os
import signal
import subprocess
import sys
import tempfile
import threading

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import rig as r  # noqa: E402

HERE = os.path.dirname(os.path.abspath(__file__))


def load(checks, programs, kind, seconds):
    checks.gtest(os.path.join(programs, "can_load_test"), seconds + 120,
                 {"VIBRIG_LOAD_S": str(seconds), "GTEST_FILTER": kind + ".*"})


def inside(programs, seconds):
    checks = r.Checks()
    with tempfile.TemporaryDirectory() as folder:
        rig = r.Rig(programs, "vcan0", "real", folder)
        rig.modbus_port = 1   # nobody is there
        rig.configure({"name": "loaded"})
        rig.start_daemon()
        try:
            rig.wait_for(lambda s: s["can"]["link"] == "running", 30)
            load(checks, programs, "VcanLoad", seconds)
            status = r.check_balances(checks, rig)
            if status is not None:
                received, dropped = (r.number(status["can"][key]) for key in ("received", "kernel_dropped"))
                checks.check(received > 0 and r.number(status["assembler"]["unknown"]) == received,
                             "vibrigd counts each frame as unknown", str(status["assembler"]))
                checks.note(f"vibrigd beside it: {received} frames, {dropped} dropped by the kernel")
            checks.equal(rig.daemon.end(signal.SIGTERM, timeout=30), 0, "vibrigd ends cleanly")
        finally:
            rig.stop()
    return checks.end()


def main():
    programs = r.programs_from_command_line(__doc__)
    if "--inside" in sys.argv:
        return inside(programs, int(sys.argv[sys.argv.index("--inside") + 1]))
    seconds = 600 if "--soak" in sys.argv else 20
    if "--seconds" in sys.argv:
        seconds = int(sys.argv[sys.argv.index("--seconds") + 1])
    checks = r.Checks()
    vcan = subprocess.Popen([os.path.join(HERE, "run-in-uml"), "-t", str(seconds + 240), "--", os.path.abspath(__file__),
                             programs, "--inside", str(max(seconds - 15, 5))], stdin=subprocess.DEVNULL,
                            stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, errors="replace",
                            preexec_fn=lambda: r.die_with_parent(signal.SIGTERM))
    said = []
    reader = threading.Thread(target=lambda: said.append(vcan.stdout.read()))
    reader.start()
    load(checks, programs, "SeqpacketLoad", seconds)
    reader.join()
    vcan.wait()
    checks.adopt(said[0])
    return checks.end()


if __name__ == "__main__":
    sys.exit(main())
