#!/usr/bin/python3
"""Real time on a real vcan0: a short campaign and what may go wrong on a bus. To be run inside run-in-uml.

usage: vcan_campaign.py PROGRAMS      folder of vibrigd, vibrig, vibrig-plant, can_port_hil_test
"""
import json
import os
import random
import signal
import subprocess
import sys
import tempfile
import threading
import time

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import rig as r  # noqa: E402

BUS = "vcan0"
SHORT = {"name": "short", "identify": "what-it-can",
         "positions_deg": [[0, 0, 0], [0, 0, 20]], "table_g": [9.0, 7.0], "dwell_s": 4.0,
         "settle_s": 2.0, "ramp_s": 0.5, "temperature_window_s": 1.0}
SAMPLE_IDS = {0x080, 0x101, 0x102, 0x110, 0x111, 0x112}
STATUS_IDS = {0x210, 0x220, 0x221}
COMMAND_IDS = {0x200}
SEED = 7
ROUNDS = 20  # of garbage
ATTEMPTS = 5   # of a campaign that the machine itself holds up


class Sleeper(threading.Thread):
    """Only sleeps: how late it wakes, everything here does. A real rig does not wait meanwhile, so a campaign may end of it. Nor
    does the simulated one ever stand still by itself: where its time has stepped it was the machine that gave it no time."""

    TURN_S = 0.05
    LONG_S = 0.15    # at once: the samples of six periods come late, and what is asked of the shaker does
    MUCH_S = 1.0     # in all: the machine is too slow for real time

    def __init__(self, status=None):
        super().__init__(daemon=True)
        self.turns, self.steps = [time.monotonic()], self.steps_of(status)
        self.start()

    @staticmethod
    def steps_of(status):
        return r.number(status["assembler"]["resyncs"]) if status else 0

    def run(self):
        while True:
            time.sleep(self.TURN_S)
            self.turns.append(time.monotonic())

    def held_up(self, status):
        """By what the machine would be to blame for a campaign's end; empty: it is not."""
        turns = [*self.turns, time.monotonic()]
        late = [b - a - self.TURN_S for a, b in zip(turns, turns[1:])]
        much, steps = sum(max(each - self.TURN_S, 0.0) for each in late), self.steps_of(status) - self.steps
        if max(late) <= self.LONG_S and much <= self.MUCH_S and steps == 0:
            return ""
        return f"the machine held everything up, {max(late):.2f} s at once, {much:.2f} s in all, the rig {steps} times: {r.state_of(status)}"


def send(*frames):
    for frame in frames:
        subprocess.run(["cansend", BUS, frame], check=True, stdin=subprocess.DEVNULL)


def garbage(rng, rounds):
    """cangen at random, and by cansend what cangen does not make: error frames, known ids with wrong length or DLC."""
    generators = [subprocess.Popen(["cangen", BUS, "-g", "5", "-I", "r", "-L", "r", "-D", "r", *more],
                                   stdin=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
                  for more in (["-m"], ["-e", "-R"], ["-f"])]
    known = sorted(SAMPLE_IDS | STATUS_IDS)
    for _ in range(rounds):
        identifier = rng.choice(known)
        data = bytes(rng.randrange(256) for _ in range(rng.randrange(8))).hex()
        send(f"{identifier:03X}#{data}",                       # too short
             f"{identifier:03X}##1{data}",                     # FD with a known id
             f"{identifier:03X}#R",                            # remote
             f"{0x20000000 | 1 << rng.randrange(9):08X}#0000000000000000",  # error frame
             f"{rng.randrange(0x300, 0x7FF):03X}#{data}", f"{rng.randrange(1 << 29):08X}#{data}")
        time.sleep(0.1)
    for generator in generators:
        generator.terminate()
        generator.wait()
    # What looked like a command of the torquers was one, and a dwell needs free drift: taken back.
    send("201#" + "00" * 8)


def counts_of(candump_log):
    counts, syncs = {}, []
    with open(candump_log, encoding="ascii", errors="replace") as log:
        for line in log:
            identifier, _, data = line.split()[2].partition("#")
            if len(identifier) == 3:
                counts[int(identifier, 16)] = counts.get(int(identifier, 16), 0) + 1
                if identifier == "080" and len(data) >= 8:
                    syncs.append(int.from_bytes(bytes.fromhex(data[:8]), "little"))
    return counts, syncs


def campaign(checks, rig, folder, may_repeat):
    """arm, start, finished; candump looks on. False: the machine was to blame that it did not finish, and it may be repeated."""
    log, sleeper = os.path.join(folder, "candump.log"), Sleeper()
    with open(log, "wb") as file:
        candump = subprocess.Popen(["candump", "-r", "4000000", "-L", BUS], stdin=subprocess.DEVNULL, stdout=file)
    first = rig.wait_for(lambda s: r.measuring(s) and
                         r.number(s["assembler"]["samples"]) > 20, 20)
    checks.check(first is not None and first["can"]["link"] == "running", "vibrigd hears the rig on vcan0",
                 r.state_of(first))
    # Strangers on the bus all along. Extended identifiers only: a random frame of a known kind would be believed.
    strangers = subprocess.Popen(["cangen", BUS, "-g", "20", "-e", "-I", "r", "-L", "r", "-D", "r"],
                                 stdin=subprocess.DEVNULL)
    refused = rig.tool("start", "--by", "tester")
    checks.check(refused.returncode == 1, "start is refused while nobody has armed the shaker",
                 f"status {refused.returncode}: {refused.stdout}{refused.stderr}")
    armed = rig.arm()
    checks.check(armed.returncode == 0, "a named person arms the shaker", armed.stderr)
    started = rig.tool("start", "--by", "tester")   # not while samples come at another rate

    seen, problems = [], []

    def watch(status):
        state = status["campaign"]["state"]
        if not seen or seen[-1] != state:
            seen.append(state)
        if state == "recording" and r.number(status["assembler"]["samples"]) <= 0:
            problems.append("recording without samples")
        return state in ("finished", "aborted", "tripped")

    last = rig.wait_for(watch, 150) if started.returncode == 0 else rig.status()
    for process in (strangers, candump):
        process.terminate()
        process.wait()
    finished = last is not None and last["campaign"]["state"] == "finished"
    if not finished and may_repeat and (why := sleeper.held_up(last)):
        checks.note(f"{why}; once more")
        return False
    checks.check(started.returncode == 0, "the campaign starts", started.stderr)
    checks.check(finished, "the campaign finishes",
                 f"{r.state_of(last)}\nstates seen: {' '.join(seen)}\n{rig.logs()}")
    checks.check("recording" in seen and not problems, "status answers while it records", f"{seen} {problems}")
    status = r.check_balances(checks, rig)
    if status is not None:
        checks.equal(len(status["campaign"]["dwells"]), 4, "four dwells are reported")
        checks.equal(r.number(status["can"]["kernel_dropped"]), 0, "the kernel dropped no frame")
        checks.equal(r.number(status["estimator_ring"]["dropped"]), 0, "the ring dropped no sample")
        lost = {k: r.number(status["assembler"][k]) for k in ("gaps", "resyncs")}
        checks.equal(lost, {"gaps": 0, "resyncs": 0}, "no sample was lost among strangers' frames")
        checks.check(r.number(status["assembler"]["unknown"]) > 200, "strangers' frames are counted as unknown",
                     status["assembler"])
    counts, syncs = counts_of(log)
    for wanted, text in ((SAMPLE_IDS, "every message of a sample"), (STATUS_IDS, "every status message"),
                         (COMMAND_IDS, "the gimbal commands")):
        checks.check(wanted <= counts.keys(), f"candump saw {text}",
                     f"missing: {sorted(hex(i) for i in wanted - counts.keys())}")
    gaps = sum(b != a + 1 for a, b in zip(syncs, syncs[1:]))
    checks.check(len(syncs) > 400 and gaps == 0, "candump saw every sync count", f"{len(syncs)} counts, {gaps} gaps")
    uneven = {hex(i): counts.get(i, 0) for i in SAMPLE_IDS if abs(counts.get(i, 0) - len(syncs)) > 1}
    checks.check(not uneven, "one frame of each kind came per sync count", uneven)
    path, text = rig.result()
    result = json.loads(text) if text else {}
    checks.equal(len(result.get("parameters", [])), 30, "result.json holds 30 parameters")
    checks.check(path is None or "NaN" not in text.decode(), "result.json holds no NaN")
    return True


def survives_garbage(checks, rig):
    rng = random.Random(SEED)
    before = rig.status()
    garbage(rng, ROUNDS)
    sent_errors = r.number(before["can"]["error_frames"]) + ROUNDS if before else 0
    after = rig.wait_for(lambda s: r.number(s["can"]["error_frames"]) >= sent_errors, 20)
    checks.check(rig.daemon.running() and after is not None, f"vibrigd survives garbage (seed {SEED})", rig.logs())
    if before is None or after is None:
        return

    def risen(room, key):
        return r.number(after[room][key]) - r.number(before[room][key])

    checks.equal(risen("can", "error_frames"), ROUNDS, "error frames are counted")
    checks.check(risen("assembler", "unknown") >= 2 * ROUNDS, "unknown frames are counted",
                 risen("assembler", "unknown"))
    checks.check(risen("assembler", "wrong_length") >= ROUNDS, "frames of a wrong length are counted",
                 risen("assembler", "wrong_length"))
    r.check_balances(checks, rig)
    wanted = r.number(after["assembler"]["samples"]) + 40
    later = rig.wait_for(lambda s: r.number(s["assembler"]["samples"]) > wanted, 20)
    good = [c["quality"] for c in later["sample"]["channels"]]
    checks.check(all(quality in ("good", "unbound") for quality in good), "samples are good again afterwards", good)


def recovers_from_interface_down(checks, rig):
    before = rig.status()
    subprocess.run(["ip", "link", "set", BUS, "down"], check=True)
    down = rig.wait_for(lambda s: s["can"]["link"] != "running", 20)
    checks.check(down is not None and down["can"]["link"] != "running", "a lowered interface is noticed",
                 down and down["can"])
    time.sleep(1)
    subprocess.run(["ip", "link", "set", BUS, "up"], check=True)
    up = rig.wait_for(lambda s: s["can"]["link"] == "running" and
                      r.number(s["assembler"]["samples"]) > r.number(before["assembler"]["samples"]) + 40, 20)
    checks.check(up["can"]["link"] == "running", "it recovers alone when the interface is raised", up["can"])
    checks.check(r.number(up["assembler"]["samples"]) > r.number(before["assembler"]["samples"]) + 40,
                 "samples come again", f"{before['assembler']} then {up['assembler']}")


def shaker_registers(port):
    from pymodbus.client import ModbusTcpClient
    client = ModbusTcpClient("127.0.0.1", port=port)
    client.connect()
    reply = client.read_input_registers(0, 5, slave=1)
    client.close()
    return {"state": reply.registers[0], "fault": reply.registers[1],
            "measured_g": (reply.registers[3] << 16 | reply.registers[4]) * 1e-4}


def run_up(checks, rig, text):
    """A campaign until the shaker runs at its level."""
    def runs(status):
        return status["shaker"].get("measured_g", 0) > 5 and status["campaign"]["state"] in ("settling", "recording")
    for attempt in range(1, ATTEMPTS + 1):
        sleeper = Sleeper(rig.status())
        accepted = [rig.arm(), rig.tool("start", "--by", "tester")]
        status = rig.wait_for(lambda s: runs(s) or s["campaign"]["state"] in ("aborted", "tripped"), 60)
        if status is None or runs(status) or attempt == ATTEMPTS or not (why := sleeper.held_up(status)):
            break
        checks.note(f"{why}; once more")
        rig.acknowledge()
    return checks.check(status is not None and runs(status), text, f"{r.state_of(status)} {[a.stderr for a in accepted]}\n{rig.logs()}")


def stops_on_sigterm(checks, rig):
    if not run_up(checks, rig, "a second campaign brings the shaker to its level"):
        return
    code = rig.daemon.end(signal.SIGTERM, timeout=20)
    checks.equal(code, 0, "SIGTERM ends vibrigd with status 0")
    registers = shaker_registers(rig.modbus_port)
    checks.check(registers["state"] == 0 and registers["fault"] == 0 and registers["measured_g"] < 0.05,
                 "SIGTERM leaves the shaker ramped down and idle", registers)


def dies_safely(checks, rig):
    rig.start_daemon()
    rig.wait_for(r.measuring, 20)
    checks.equal(r.state_of(rig.status()), "idle", "after a restart the shaker is disarmed")
    if not run_up(checks, rig, "after a restart, armed anew, the shaker runs"):
        return
    rig.daemon.end(signal.SIGKILL)
    end, registers = time.monotonic() + 30, {}
    while time.monotonic() < end:
        registers = shaker_registers(rig.modbus_port)
        if registers["measured_g"] < 0.05:
            break
        time.sleep(0.2)
    checks.check(registers["measured_g"] < 0.05 and registers["fault"] & 1,
                 "a killed daemon means a stopped shaker: its watchdog expires", registers)


def with_pymodbus(checks, programs, folder):
    """The daemon's Modbus side against an independent implementation, which drives the table of the simulated rig."""
    rig = r.Rig(programs, BUS, "real", folder)
    rig.modbus_port = 1502
    rig.configure(SHORT, threads=r.NO_PRIORITY, **{**r.PATIENT, "shaker": {"response_timeout_ms": 5000}})   # its feeds are counted
    platform = r.Rig(programs, BUS, "real", folder)
    played = None
    try:
        platform.start_plant("--seed", str(SEED), "--warm-up", "1", "--start-temperature", "45")
        played = r.Child("shaker", [os.path.join(os.path.dirname(os.path.abspath(__file__)), "pymodbus_shaker.py"),
                                    str(rig.modbus_port), "--table", platform.control], folder)
        rig.start_daemon()
        rig.wait_for(r.measuring, 30)
        run_up(checks, rig, "pymodbus plays the shaker: it reaches its level")
        rig.tool("abort", "--by", "tester")
        stopped = rig.wait_for(lambda s: s["campaign"]["state"] in ("aborted", "tripped") and
                               not s["shaker"].get("running", True), 20)
        checks.check(stopped is not None and not stopped["shaker"].get("running", True),
                     "pymodbus plays the shaker: abort stops it", f"{r.state_of(stopped)}\n{rig.logs()}")
        said = [json.loads(line) for line in played.text().splitlines() if line.startswith("{")]
        running = [s for s in said if s["run"] and s["state"] == 2]
        checks.check(running and all(abs(s["frequency_hz"] - 15) < 1e-3 and abs(s["amplitude_g"] - 9) < 1e-3
                                     for s in running), "pymodbus read 15 Hz and 9 g from the registers", said[-5:])
        checks.check(said and said[-1]["feeds"] > 3, "pymodbus saw the watchdog fed", said[-1:])
        checks.check(all(s["watchdog_s"] > 0 for s in running), "pymodbus saw a watchdog time-out", said[-5:])
    finally:
        rig.stop()
        if played is not None:
            played.end(timeout=5)
        platform.stop()


def sane_log(checks, rig):
    lines = rig.daemon.text().splitlines()
    bad = [line for line in lines if r.SANITIZER.search(line) or "nan" in line.lower().split() or "terminate" in line]
    checks.check(lines and not bad, "the log holds sane lines", bad[:5] or "it is empty")


def life(timed, checks, programs, folder, may_repeat):
    """Of one daemon, from its first campaign to its end. False: to be repeated."""
    rig = r.Rig(programs, BUS, "real", folder)
    try:
        rig.start_plant("--seed", str(SEED), "--warm-up", "1", "--start-temperature", "45")
        rig.configure(SHORT, threads=r.NO_PRIORITY, **r.PATIENT)
        rig.start_daemon()
        if not timed(campaign, checks, rig, folder, may_repeat):
            return False
        timed(survives_garbage, checks, rig)
        timed(recovers_from_interface_down, checks, rig)
        timed(stops_on_sigterm, checks, rig)
        sane_log(checks, rig)
        timed(dies_safely, checks, rig)
        return True
    finally:
        rig.stop()


def main():
    programs = r.programs_from_command_line(__doc__)
    checks = r.Checks()
    start = time.monotonic()

    def timed(function, *arguments):
        begin = time.monotonic()
        returned = function(*arguments)
        checks.note(f"{function.__name__}: {time.monotonic() - begin:.1f} s")
        return returned

    port_test = os.path.join(programs, "can_port_hil_test")
    if os.path.exists(port_test):
        timed(checks.gtest, port_test, 60)
    for attempt in range(1, ATTEMPTS + 1):
        with tempfile.TemporaryDirectory() as folder:
            if life(timed, checks, programs, folder, attempt < ATTEMPTS):
                break
    with tempfile.TemporaryDirectory() as folder:
        timed(with_pymodbus, checks, programs, folder)
    checks.note(f"{time.monotonic() - start:.0f} s in {os.environ.get('RUN_IN_UML', 'this kernel')}")
    return checks.end()


if __name__ == "__main__":
    sys.exit(main())
