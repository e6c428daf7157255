#!/usr/bin/python3
"""What vibrigd records, opened by other programs: while it is written, after SIGKILL, and complete; replayed to the
last bit, exported, reported. On the seqpacket bus and the rig's clock.

usage: recording_campaign.py PROGRAMS
"""
import glob
import json
import math
import os
import re
import subprocess
import sys
import tempfile
import time

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import rig as r  # noqa: E402

CAMPAIGN = {"name": "recorded", "identify": "what-it-can", "positions_deg": [[0, 0, 0], [45, 0, 90], [0, 0, 90]],
            "table_g": [9.0, 7.0], "dwell_s": 20.0}


def h5py():
    import h5py as module   # Debian's
    return module


def offline(rig, *arguments, timeout=120):
    return subprocess.run([rig.program("vibrig"), *arguments], stdin=subprocess.DEVNULL, capture_output=True, text=True,
                          timeout=timeout, cwd=rig.folder)


def begin(checks, rig):
    rig.start_daemon()
    rig.wait_for(lambda s: s["can"]["link"] == "running" and s["shaker"]["link"] == "running" and
                 any(c["quality"] == "good" for c in s["sample"]["channels"]), 60)
    armed, started = rig.tool("arm", "--by", "test"), rig.tool("start", "--by", "test")
    checks.check(armed.returncode == 0 and started.returncode == 0, "a campaign starts",
                 armed.stderr + started.stderr + rig.logs())


def folders(rig):
    return sorted(glob.glob(os.path.join(rig.results, "recorded-*")))


def killed(checks, rig):
    begin(checks, rig)
    rig.wait_for(lambda s: len(s["campaign"].get("dwells", [])) >= 2, 60)
    path = os.path.join(folders(rig)[-1], "campaign.h5")
    with h5py().File(path, "r", swmr=True) as file:
        rows = file["samples/time_ns"].shape[0]
        checks.check(rows > 0, "h5py reads the file while it is written", str(rows))
    rig.daemon.process.kill()
    rig.daemon.process.wait()
    refused = subprocess.run(["h5dump", "-H", path], capture_output=True, text=True)
    checks.check(refused.returncode != 0, "after SIGKILL others need it to be mended")
    mended = offline(rig, "recover", folders(rig)[-1], "--json")
    found = json.loads(mended.stdout or "{}")
    checks.check(mended.returncode == 0 and not found["was_closed"] and found["samples"] >= rows,
                 "recover mends it and counts", mended.stdout + mended.stderr)
    checks.check(subprocess.run(["h5dump", "-H", path], capture_output=True).returncode == 0, "h5dump opens it then")
    with h5py().File(path, "r") as file:
        checks.equal(file["samples/time_ns"].shape[0], found["samples"] + found["samples_from_raw"],
                     "every sample that is told of is there")
        checks.check(file.attrs["state"] == b"recovered" or file.attrs["state"] == "recovered", "its state says so")
    again = offline(rig, "replay", folders(rig)[-1])
    checks.check("as recorded, to the last bit" in again.stderr, "what was done replays to the last bit", again.stderr)


def complete(checks, rig):
    begin(checks, rig)
    status = rig.wait_for_state(("finished",), 120)
    checks.equal(r.state_of(status), "finished", "a campaign finishes")
    status = rig.wait_for(lambda s: not s["recorder"].get("recording", False), 20)
    recorder = status["recorder"]
    checks.check(recorder["good"] and all(r.number(recorder.get(k, 0)) == 0 for k in
                                          ("samples_lost", "frames_lost", "gaps", "frames_dropped")),
                 "nothing is lost on the way to the disk", str(recorder))
    rig.daemon.end()
    folder, path = folders(rig)[-1], os.path.join(folders(rig)[-1], "campaign.h5")
    _, result = rig.result()
    with h5py().File(path, "r") as file:
        checks.equal(file["samples/time_ns"].shape[0], r.number(recorder["samples"]), "samples are as many as counted")
        units = {name: file["samples/" + name].attrs["unit"] for name in ("time_ns", "angle_rad", "force_g")}
        checks.check(all(u in (b"ns", "ns", b"rad", "rad", b"g", "g") for u in units.values()), "with their units",
                     str(units))
        last = file["dwells/value"][-1]
        stored = file["result"][()]
    stored = stored.decode() if isinstance(stored, bytes) else stored
    checks.equal(stored, result.decode().strip(), "the result in the file is result.json")
    for parameter, value in zip(json.loads(result)["parameters"], last):
        if parameter["observable"] and parameter["value"] != value:
            checks.check(False, "estimates after the last dwell are the result's", str(parameter))
            break
    else:
        checks.check(True, "estimates after the last dwell are the result's")
    replayed = offline(rig, "replay", path, "--json")
    checks.equal(replayed.stdout.strip(), result.decode().strip(), "a replay gives result.json to the last bit")
    from_frames = offline(rig, "replay", *sorted(glob.glob(os.path.join(folder, "raw-*"))), "--json")
    checks.equal(from_frames.stdout.strip(), result.decode().strip(), "and so do the frames alone")
    other = os.path.join(rig.folder, "other.toml")
    with open(other, "w", encoding="utf-8") as file:
        file.write("[noise]\nresolver_arcsec = 10.0\n")
    anew = offline(rig, "replay", path, "--config", other, "--json")
    checks.check(json.loads(anew.stdout)["nis"] < json.loads(result)["nis"], "other settings give another result")
    exports(checks, rig, folder, path)
    report(checks, rig, folder)


def exports(checks, rig, folder, path):
    direct = json.loads(offline(rig, "identify", path, "--json").stdout)
    exported = offline(rig, "export", folder, "--to", "csv", "-o", "x.csv")
    from_csv = json.loads(offline(rig, "identify", "x.csv", "--json").stdout or "{}")
    # Degrees and back move an angle by 1e-16 of itself: nothing beside sigma.
    close = all(a["value"] is None and b["value"] is None or math.isclose(a["value"], b["value"], abs_tol=1e-6 * a["sigma"])
                for a, b in zip(direct["parameters"], from_csv.get("parameters", [{}] * 30)))
    checks.check(close and direct["samples"] == from_csv["samples"], "the CSV identifies as the HDF5 does",
                 exported.stderr)
    offline(rig, "export", folder, "--to", "mat", "-o", "x.mat")
    with open(os.path.join(rig.folder, "x.mat"), "rb") as file:
        checks.check(file.read(19) == b"MATLAB 5.0 MAT-file", "a MATLAB file is written")
    offline(rig, "export", folder, "--to", "candump", "-o", "x.log")
    log = os.path.join(rig.folder, "x.log")
    with open(log, encoding="ascii") as file:
        lines = file.read().splitlines()
    form = re.compile(r"\(\d{10}\.\d{6}\) vcan0 [0-9A-F]{3}#([0-9A-F]{2}){0,8} [RT]")
    checks.check(all(map(form.fullmatch, lines)), "the log has candump's form", str(lines[:2]))
    checks.check(any(line.endswith(" T") and " 200#" in line for line in lines), "and the commands that were sent")
    ascii_log = subprocess.run(["log2asc", "-I", log, "vcan0"], capture_output=True, text=True)
    frames = sum(" vcan0 " not in line and " d " in line for line in ascii_log.stdout.splitlines())
    checks.equal(frames, len(lines), "can-utils read every line of it")


def report(checks, rig, folder):
    made = offline(rig, "report", folder, "-o", "x.html", "--compare", folder)
    checks.equal(made.returncode, 0, "a report is written", )
    with open(os.path.join(rig.folder, "x.html"), encoding="utf-8") as file:
        page = file.read()
    foreign = re.findall(r"(?:src|href)=\"(?!#)[^\"]*\"|https?://(?!www.w3.org/2000/svg)\S+", page)
    checks.equal(foreign, [], "it needs nothing else")
    table = json.loads(offline(rig, "compensate", folder, "--json", "--attitude", "0,0,0").stdout)
    checks.equal(len(table["coefficients"]), 30, "compensate gives the table of coefficients")
    for arguments in (("replay", "nowhere"), ("export", folder, "--to", "pdf"), ("report", "/dev/null"),
                      ("compensate", folder, "--attitude", "nan,0,0"), ("replay", folder, "--speed", "-1")):
        run = offline(rig, *arguments)
        checks.check(run.returncode == 2 and run.stderr.strip(), "refused: " + arguments[0] + " " + arguments[-1],
                     f"status {run.returncode} {run.stderr}")


def main():
    programs = r.programs_from_command_line(__doc__)
    checks = r.Checks()
    begun = time.monotonic()
    for part in (killed, complete):
        with tempfile.TemporaryDirectory() as folder:
            rig = r.Rig(programs, "seqpacket", "rig", folder)
            try:
                rig.start_plant("--seed", "1", "--speed", "max")
                rig.configure(CAMPAIGN, record={"segment_s": 60.0})
                part(checks, rig)
            finally:
                rig.stop()
    checks.note(f"{time.monotonic() - begun:.0f} s")
    return checks.end()


if __name__ == "__main__":
    sys.exit(main())
