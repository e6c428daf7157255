#!/usr/bin/python3
"""An abort is answered within 0.2 s, whatever else is ill: nobody reads the log, the socket is removed or replaced, the
disk is full, slow or dead, hundreds of clients hold the door. The table shakes each time, and comes to rest. In real time.

usage: stop_answered.py PROGRAMS
"""
import contextlib
import fcntl
import json
import os
import shutil
import signal
import socket
import sqlite3
import struct
import subprocess
import sys
import tempfile
import time

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import recording_faults as disks  # noqa: E402
import rig as r  # noqa: E402
import service_manager as s  # noqa: E402

CAMPAIGN = {"name": "stops", "identify": "what-it-can", "positions_deg": [[0, 0, 0]], "table_g": [2.0], "dwell_s": 600.0,
            "settle_s": 2.0, "ramp_s": 0.5, "temperature_window_s": 0.0}
WITHIN_S = 0.2
TRIES = 5           # of a busy machine's: what is held up is held up each time
CLIENTS = 300       # more than the control socket has places
LONGEST = struct.pack("ll", 30, 0)


def ask(path, method, target, body=""):
    """On a connection of its own; the status, the answer, and how long it took."""
    begun = time.monotonic()
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as link:
        # With a timeout Python does not wait where the queue of the door is full, it fails: the system waits, and that counts.
        link.setsockopt(socket.SOL_SOCKET, socket.SO_SNDTIMEO, LONGEST)
        link.connect(path)
        link.settimeout(30)
        link.sendall(f"{method} {target} HTTP/1.1\r\nHost: x\r\nConnection: close\r\nContent-Type: application/json\r\n"
                     f"Content-Length: {len(body)}\r\n\r\n{body}".encode())
        answer = b""
        while more := link.recv(65536):
            answer += more
    took = time.monotonic() - begun
    head, _, text = answer.decode().partition("\r\n\r\n")
    return int(head.split()[1]) if head else 0, text, took


def command(rig, kind):
    return ask(rig.socket, "POST", "/api/v1/commands", json.dumps({"kind": kind, "by": "tester"}))


def shake(checks, rig, what):
    rig.wait_for(lambda t: r.measuring(t) and t["shaker"].get("state") == 0 and not t["shaker"].get("running", True), 30)
    said = []
    end = time.monotonic() + 30
    while command(rig, "arm")[0] != 200 and time.monotonic() < end:   # rest has to be measured first
        time.sleep(0.2)
    for kind in ("start",):
        status, text, _ = command(rig, kind)
        said.append(f"{kind}: {status} {text}")
    status = rig.wait_for_state(("recording", "aborted", "tripped"), 60)
    checks.check(status is not None and status["campaign"]["state"] == "recording", f"{what}: the table shakes",
                 f"{r.state_of(status)} {said} {rig.logs()}")


def stops(checks, rig, what):
    """The first answer counts for what it says, the quickest for how long it takes."""
    first = command(rig, "abort")
    took = [first[2]] + [command(rig, "abort")[2] for _ in range(TRIES - 1)]
    checks.check(first[0] == 200, f"{what}: the abort is taken", first)
    checks.check(min(took) < WITHIN_S, f"{what}: it is answered within {WITHIN_S} s ({min(took) * 1e3:.0f} ms)", took)
    end = time.monotonic() + 20
    while s.shaker_state(rig) not in (0, 4) and time.monotonic() < end:
        time.sleep(0.1)
    checks.check(s.shaker_state(rig) in (0, 4), f"{what}: the table stops", s.shaker_state(rig))
    status = rig.wait_for_state(("aborted",), 30)
    checks.equal(status["campaign"]["state"], "aborted", f"{what}: the campaign has ended")


def start(rig, environment=None):
    rig.start_daemon() if environment is None else setattr(
        rig, "daemon", r.Child("vibrigd", [rig.program("vibrigd"), "--config", rig.configuration], rig.folder, environment))
    rig.wait_for(r.measuring, 30)


def logged(rig, words):
    return [line for line in rig.tool("events").stdout.splitlines() if words in line]


def nobody_reads_the_log(checks, rig):
    """A terminal after Ctrl-S: a pipe that is full from the beginning."""
    reader, writer = os.pipe()
    fcntl.fcntl(writer, fcntl.F_SETFL, os.O_NONBLOCK)
    try:
        while True:
            os.write(writer, b"." * 4096)
    except BlockingIOError:
        fcntl.fcntl(writer, fcntl.F_SETFL, 0)
    process = subprocess.Popen([rig.program("vibrigd"), "--config", rig.configuration], stdin=subprocess.DEVNULL,
                               stdout=subprocess.DEVNULL, stderr=writer, preexec_fn=r.die_with_parent)
    os.close(writer)
    try:
        rig.wait_for(r.measuring, 30)
        shake(checks, rig, "log blocked")
        status = rig.wait_for(lambda t: t["log"]["blocked"], 10)
        log = {key: r.number(value) for key, value in status["log"].items()}
        checks.check(log["blocked"] and log["taken"] == log["written"] + log["dropped"] + log["waiting"],
                     "log blocked: the status says so, every line is accounted for", log)
        command(rig, "pause")
        stops(checks, rig, "log blocked")
        process.send_signal(signal.SIGTERM)
        try:
            checks.equal(process.wait(timeout=30), 0, "log blocked: SIGTERM ends it cleanly")
        except subprocess.TimeoutExpired:
            checks.check(False, "log blocked: SIGTERM ends it cleanly", "it goes on")
    finally:
        process.kill()
        process.wait()
        os.close(reader)


def doors_removed(checks, rig):
    start(rig)
    elsewhere = os.path.join(rig.folder, "elsewhere")

    def by_a_file():
        os.unlink(rig.socket)
        with open(rig.socket, "w", encoding="ascii") as file:
            file.write("not a socket")

    def by_a_dead_socket():
        with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as one:
            one.bind(elsewhere + "-2")
        os.replace(elsewhere + "-2", rig.socket)

    for what, do in (("socket removed", lambda: os.unlink(rig.socket)), ("socket moved away", lambda: os.rename(rig.socket, elsewhere)),
                     ("a file in its place", by_a_file), ("a dead socket in its place", by_a_dead_socket)):
        shake(checks, rig, what)
        before = len(logged(rig, "made anew"))
        do()
        checks.check(rig.wait_for(lambda t: True, 10) is not None, f"{what}: the door is there again")
        stops(checks, rig, what)
        checks.equal(len(logged(rig, "made anew")) - before, 1, f"{what}: it is reported once")
    with open(rig.socket + ".found", encoding="ascii") as file:
        checks.equal(file.read(), "not a socket", "what was there is kept")
    door = rig.status()["server"]["doors"][0]
    checks.check(door["open"] and r.number(door["made_anew"]) == 4, "the status counts them", door)
    # What somebody answers at is not taken from him.
    other = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    try:
        os.unlink(rig.socket)
        other.bind(rig.socket)
        other.listen(1)
        time.sleep(2.5)
        os.unlink(rig.socket)
    finally:
        other.close()
    checks.check(rig.wait_for(lambda t: True, 10) is not None and len(logged(rig, "another vibrigd answers")) == 1,
                 "somebody else's living socket is left alone, and reported", logged(rig, "made anew"))
    checks.equal(rig.daemon.end(timeout=30), 0, "it ends cleanly")
    checks.check(not os.path.exists(rig.socket), "and takes its own socket with it")


def crowd(checks, rig):
    """Whoever may open the socket may fill it: with connections that say nothing."""
    start(rig)
    shake(checks, rig, "crowd")
    held = []
    try:
        for _ in range(CLIENTS):
            one = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
            one.connect(rig.socket)
            held.append(one)
        status, text, _ = ask(rig.socket, "GET", "/api/v1/status")
        checks.equal(status, 503, "crowd: who looks is answered that there is no place")
        first = command(rig, "abort")
        took = [first[2]] + [command(rig, "abort")[2] for _ in range(TRIES - 1)]
        checks.check(first[0] == 200 and min(took) < WITHIN_S, f"crowd: an abort is answered within {WITHIN_S} s ({min(took) * 1e3:.0f} ms)",
                     [first, took])
    finally:
        for one in held:
            one.close()
    status = rig.wait_for_state(("aborted",), 30)
    checks.equal(status["campaign"]["state"], "aborted", "crowd: the campaign has ended")
    checks.equal(rig.daemon.end(timeout=30), 0, "crowd: it ends cleanly")


@contextlib.contextmanager
def recording_on(checks, rig, folder, what, **environment):
    """The daemon, with results and recordings on a disk that can be made ill; None where there is none to be had."""
    os.mkdir(folder)   # not the rig's own, in which its control lies
    disk = disks.SickDisk(folder)
    if disk.refused:
        checks.skip(what, disk.refused)
        yield None
        return
    try:
        disk.remount("rw")
        rig.results = disk.folder
        rig.configure(CAMPAIGN, record={"folder": disk.folder, "segment_s": 3.0, "keep_free_mb": 0, "flush_s": 0.5}, **r.PATIENT)
        start(rig, {**disk.environment(), **environment})
        yield disk
    finally:
        disk.end()


def sick_disks(checks, rig, folder):
    with recording_on(checks, rig, folder, "an abort on a sick disk") as disk:
        if disk is None:
            return
        for what, ill, well in (("disk full", disk.fill, disk.make_room), ("disk slow", lambda: disk.set("s"), lambda: disk.set("-")),
                                ("disk of 1 MB/s", lambda: disk.set("t"), lambda: disk.set("-")),
                                ("disk dead", lambda: disk.set("e"), lambda: disk.set("-"))):
            shake(checks, rig, what)
            ill()
            time.sleep(2)
            if what == "disk of 1 MB/s":
                status = rig.status()
                checks.check(status["recorder"].get("good") and r.number(status["recorder"].get("samples_lost", 0)) == 0,
                             f"{what}: everything is recorded", status["recorder"])
            stops(checks, rig, what)
            well()
        checks.check(rig.daemon.end(timeout=60) in (0, 1), "sick disks: it ends")


def armed_while_the_disk_takes_its_time(checks, rig, folder):
    """What comes between an arming that is asked for and its being on disk counts: armed is who is fit then."""
    # The daemon's patience is 2 s.
    began = os.path.join(folder, "fsync-began")
    with recording_on(checks, rig, folder, "an arming on a slow disk", SICK_SECONDS="1", SICK_BEGAN=began) as disk:
        if disk is None:
            return
        rig.wait_for(lambda t: t["shaker"].get("rest") == "at rest" and t["journal"].get("verified"), 30)
        disk.set("s")
        with subprocess.Popen([rig.program("vibrig"), "arm", "--by", "Ada", "--socket", rig.socket], stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                              text=True) as arming:
            end = time.monotonic() + 20
            while not os.path.exists(began) and time.monotonic() < end:
                time.sleep(0.005)
            rig.order("estop open")
            waits = arming.poll() is None
            said = arming.communicate(timeout=30)[0]
        status = rig.status()
        checks.check(waits and arming.returncode == 1 and "emergency" in said and not status["campaign"].get("armed_by"),
                     "a chain that opens while the arming is being written: it is not armed", f"{waits} {said} {r.state_of(status)}")
        disk.set("-")
        checks.check(rig.daemon.end(timeout=60) in (0, 1), "it ends")
        with contextlib.closing(sqlite3.connect(os.path.join(disk.folder, "journal.sqlite3"))) as database:
            what = [row[0] for row in database.execute("SELECT what FROM safety ORDER BY id")]
        checks.equal([each for each in what if each in ("armed", "disarmed")], ["armed", "disarmed"], "and the journal says so")
        rig.order("estop close")
        rig.order("clear")


def main():
    programs = r.programs_from_command_line(__doc__)
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))   # or the disk would stay mounted
    checks = r.Checks()
    begun = time.monotonic()
    with tempfile.TemporaryDirectory() as folder:
        rig = r.Rig(programs, "seqpacket", "real", folder)
        try:
            rig.start_plant("--seed", "3", "--warm-up", "1", "--start-temperature", "45")
            rig.be_punctual()
            rig.configure(CAMPAIGN, **r.PATIENT)
            for part in (nobody_reads_the_log, doors_removed, crowd):
                part(checks, rig)
                shutil.rmtree(rig.results)
                os.mkdir(rig.results)
            for name, part in (("sick", sick_disks), ("slow", armed_while_the_disk_takes_its_time)):
                part(checks, rig, os.path.join(folder, name))
        finally:
            rig.stop()
    checks.note(f"{time.monotonic() - begun:.0f} s")
    return checks.end()


if __name__ == "__main__":
    sys.exit(main())
