#!/usr/bin/python3
"""Campaigns on their way to an archive that is gone, sick, slow, killed, or shared: none is lost, none comes twice, no half
one is seen, and a measurement does not notice. The index in SQLite, and in a PostgreSQL of our own that is killed.

usage: archive.py PROGRAMS [--seed N] [--soak]
"""
import concurrent.futures
import contextlib
import fcntl
import glob
import importlib.machinery
import importlib.util
import json
import os
import random
import shutil
import signal
import sqlite3
import ssl
import subprocess
import sys
import tempfile
import time
import urllib.error
import urllib.request

import h5py

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import recording_faults  # noqa: E402
import rig as r  # noqa: E402
import server_load  # noqa: E402
from archive_parts import (POSTGRES, Archive, Postgres, SickArchive, asked, asked_by_nobody, clone, result_in,  # noqa: E402
                           without_role)

CAMPAIGN = {"name": "unit", "identify": "what-it-can", "dwell_s": 2.0}


def configure(rig, archive_folder, serial):
    rig.configure(CAMPAIGN, unit={"type": "GP-3", "serial": serial}, server={"page": "127.0.0.1:0"},
                  archive={"folder": archive_folder, "rig": "rig-7", "retry_max_s": 1.0})


def measure(checks, rig, seed, archive_folder, disk):
    """A whole campaign on the rig's clock, with an archive that is not there."""
    rig.start_plant("--seed", str(seed), "--truth", rig.truth_file(r.QUICK))
    configure(rig, archive_folder, "0017")
    rig.daemon = r.Child("vibrigd", [rig.program("vibrigd"), "--config", rig.configuration], rig.folder, disk.environment())
    rig.wait_for(r.measuring, 60)
    for command in ("arm", "start"):
        rig.tool(command, "--by", "test")
    status = rig.wait_for_state(("finished", "aborted", "tripped"), 120)
    checks.equal(r.state_of(status), "finished", "a campaign finishes beside an archive that is not there")
    rig.wait_for(lambda s: not s["recorder"].get("recording", False), 20)


def outbox(checks, programs, folder, seed):
    disk = SickArchive(os.path.join(folder, "sick"))
    lab = Archive(programs, os.path.join(disk.folder, "lab"))
    os.rmdir(lab.folder)
    rig = r.Rig(programs, "seqpacket", "rig", os.path.join(folder, "beside"))
    measure(checks, rig, seed, lab.folder, disk)
    status = rig.wait_for(lambda s: number(s, "waiting") == 1 and number(s, "failures") > 1, 20)
    checks.check(number(status, "waiting") == 1 and not status["archive"].get("good", False),
                 "without the archive's folder the campaign waits, and the status says so", status.get("archive"))
    checks.equal(losses(status), [0, 0, 0, 0], "and nothing of the measurement is lost")
    checks.check("cannot be delivered, it is kept" in rig.tool("events").stdout, "and an event")
    return rig, lab, disk


def number(status, name, top=False):
    of = status if top else (status or {}).get("archive", {})
    return int(of.get(name, 0))


def comes_back(checks, rig, lab):
    before = number(rig.status(), "failures")
    os.makedirs(lab.folder)
    status = rig.wait_for(lambda s: number(s, "delivered") == 1, 30)
    checks.check(number(status, "delivered") == 1 and number(status, "waiting") == 0 and number(status, "failures") >= before,
                 "the archive comes back: it is delivered by itself", status.get("archive"))
    checks.equal([(c["rig"], c["unit"]["serial"], c["state"]) for c in lab.campaigns() or []], [("rig-7", "0017", "finished")],
                 "vibrig list shows it")
    run = subprocess.run([lab.program, "archive", "verify", "--config", rig.configuration], capture_output=True, text=True, timeout=60)
    checks.check(run.returncode == 0, "rig and archive have the same", run.stdout + run.stderr)
    rig.daemon.end()
    before = len(rig.daemon.text())
    rig.start_daemon()
    status = rig.wait_for(lambda s: r.measuring(s) and "archive" in s, 60)
    time.sleep(1)
    checks.equal(number(rig.status(), "delivered"), 0, "after a restart it is not delivered again")
    page = rig.page_address(after=before)
    unit, end = {}, time.monotonic() + 30
    while "unit" not in unit and time.monotonic() < end:   # it is asked for when nobody else wants the processor
        time.sleep(0.2)
        with urllib.request.urlopen(page + "api/v1/unit", timeout=10) as answer:
            unit = json.load(answer)
    checks.equal(unit.get("unit", {}).get("serial"), "0017", "the rig's server shows the unit's earlier campaigns")
    with urllib.request.urlopen(page + "metrics", timeout=10) as answer:
        checks.check("vibrig_archive_waiting 0" in answer.read().decode(), "and the metrics that none waits")


def moves(checks, rig, lab, base):
    """Another unit on the rig, whose history is elsewhere."""
    configure(rig, lab.folder, "0018")
    rig.daemon.end()
    rig.start_daemon()
    rig.wait_for(r.measuring, 60)
    for i in range(12):
        clone(base, os.path.join(rig.folder, "history", f"old-{i}"), -30 + i, serial="0018", shift=-400 + 0.1 * i)
    run = lab.add(os.path.join(rig.folder, "history"), "rig-7")
    checks.check(run.returncode == 0, "twelve earlier campaigns are added", run.stdout + run.stderr)
    for command in ("arm", "start"):
        rig.tool(command, "--by", "test")
    rig.wait_for_state(("preparing", "recording", "levelling", "settling", "slewing", "ramping", "zeroing"), 20)
    rig.wait_for_state(("finished", "aborted", "tripped"), 120)
    rig.wait_for(lambda s: number(s, "delivered") == 1, 30)
    events = rig.tool("events").stdout
    checks.check("has moved by more than its" in events and "D_Fx" in events,
                 "a campaign that moves a coefficient by more than its unit's history allows is an alarm", events[-800:])
    trend = lab.run("trend", "0018", "--simulated", "--json", "--plot", os.path.join(rig.folder, "trend"))
    found = json.loads(trend.stdout or '{"campaigns": [], "coefficients": []}')
    checks.equal(len(found["campaigns"]), 13, "vibrig trend has all its campaigns")
    text = lab.run("trend", "0018", "--simulated").stdout
    with open(os.path.join(rig.folder, "trend", "D_Fx.svg"), encoding="utf-8") as chart:
        checks.check(text.startswith("SIMULATED: ") and "SIMULATED: " in chart.read() and found.get("simulated") is True,
                     "of a simulated rig text, charts and JSON of a trend say so", text[:200])
    checks.equal(lab.run("trend", "0018").stdout, text, "without a real one they are what there is")
    since = lab.run("trend", "0018", "--simulated", "--since", "2099-01-01")
    checks.check(since.returncode == 2 and "found no campaign of unit '0018' since 2099-01-01" in since.stderr, "a day after all of them is named",
                 since.stderr)
    nobody = lab.run("trend", "")
    checks.check(nobody.returncode == 2 and "SERIAL: found nothing, expected a value" in nobody.stderr, "no serial number is no unit", nobody.stdout + nobody.stderr)
    checks.check(any(c["name"] == "D_Fx" and c["shutdown_instability"]["p"] < 1e-6 for c in found["coefficients"]),
                 "and says that D_Fx is not stable over shutdowns")
    checks.equal(len(glob.glob(os.path.join(rig.folder, "trend", "*.svg"))), 31, "and draws a chart of each")


def reported(checks, rig, lab):
    """A report has the unit's earlier campaigns beside its own coefficients: those of its replay, though the recording has no result."""
    def configured(folder):
        with h5py.File(os.path.join(folder, "campaign.h5")) as file:
            return file["configuration"][()]
    campaign = next(path for path in glob.glob(os.path.join(rig.results, "unit-*")) if b'"0018"' in configured(path))
    without = clone(campaign, os.path.join(rig.folder, "without-result"), 0)
    with h5py.File(os.path.join(without, "campaign.h5"), "r+") as file:
        del file["result"]
    tables, page = [], os.path.join(rig.folder, "history.html")
    for folder in (campaign, without):
        run = lab.run("report", folder, "-o", page)
        with open(page, encoding="utf-8") as file:
            text = file.read()
        history = text[text.index('id="history"'):] if 'id="history"' in text else ""
        tables.append(history[:history.find("</table>")])
    checks.check("Unit 0018: 12 earlier campaigns" in tables[0] and '<td>D_Fx</td><td class="bad">' in tables[0],
                 "a report has the earlier campaigns, and marks what has moved", tables[0][:1000] + run.stderr)
    checks.equal(tables[1], tables[0], "and the same of a recording without a result")


def at_another_frequency(checks, rig, lab, base):
    """A campaign of that unit at another frequency, and an index of before it knew of which vibration a coefficient is."""
    def trend(*words):
        run = lab.run("trend", "0018", "--json", *words)
        found = json.loads(run.stdout or '{"coefficients": []}')
        return found, {c["name"]: len(c["points"]) for c in found["coefficients"]}
    before, points = trend()
    other = clone(base, os.path.join(rig.folder, "faster"), -60, serial="0018", shift=-400)
    with h5py.File(os.path.join(other, "campaign.h5"), "r+") as file:
        text = next(line for line in file["configuration"][()].decode().splitlines() if line.startswith("vibration.frequency_hz"))
        r.reconfigure(file, text, "vibration.frequency_hz = 33.0")
    run = lab.add(other, "rig-7")
    found, now = trend()
    checks.check(run.returncode == 0 and before["of_other_vibration"] == 0 and found["of_other_vibration"] == 1 and
                 "those of 1 campaigns of another vibration (at 33 Hz) left out" in found["vibration"] and
                 all(now[name] - points[name] == (len(name) < 5) for name in points) and any(len(name) == 5 for name in points),
                 "at another frequency its quadratic coefficients are left out of the trend, and that is said", run.stderr + str(found)[:500])
    checks.check(found["vibration"] in lab.run("trend", "0018").stdout, "in the table, too")
    checks.equal({len(c["points"]) for c in trend("--at-hz", "33")[0]["coefficients"] if c["unit"] == "deg/h/g^2"}, {1},
                 "asked for, they are there")
    with contextlib.closing(sqlite3.connect(os.path.join(lab.folder, "recordings.sqlite3"))) as index:
        index.execute("UPDATE coefficient SET at_hz = NULL")
        index.commit()
        checks.equal({f["what"] for f in lab.verify()}, {"not in the index"}, "an index that does not know it is no wrong one")
        checks.equal(trend()[0]["vibration"], found["vibration"], "a trend reads it from the recordings")
        known = index.execute("SELECT count(*) FROM coefficient k JOIN result r USING (campaign) WHERE r.unit_serial = '0018' AND at_hz = 33")
        checks.check(known.fetchone()[0] > 0, "and notes it")
    checks.equal((lab.run("archive", "add", lab.folder).returncode, lab.verify()), (0, []), "and archive add of the archive notes all of them")


def browsed(checks, lab, folder):
    """As a browser shows it; the door picks its port."""
    server = r.Child("serve", [lab.program, "archive", "serve", *lab.where(), "--page", "127.0.0.1:0", "--json"], folder)
    end = time.monotonic() + 10
    while "}\n" not in server.text() and time.monotonic() < end:
        time.sleep(0.05)
    where = json.loads(server.text())
    page = where["page"]
    checks.check(page.startswith("http://127.0.0.1:") and where["remote"] is None, "it says as JSON where it is", where)

    def shown(path):
        # Nothing of the browser's own may go out, and it is to be alone.
        return subprocess.run(["chromium", "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run",
                               "--disable-background-networking", "--disable-component-update", "--disable-sync",
                               f"--user-data-dir={folder}/chromium", "--dump-dom", page + path],
                              capture_output=True, text=True, timeout=60).stdout
    front = shown("")
    checks.check('href="/unit?serial=0017"' in front and "rig-7" in front, "Chromium shows units and campaigns", front[:500])
    unit = shown("unit?serial=0017")
    checks.check(unit.count("<img") == 30 and 'id="trend"' in unit and "shutdown instability" in unit,
                 "and a unit's trend with its charts", unit[:500])
    key = (lab.campaigns("--serial", "0017") or [{"hash": ""}])[0]
    campaign = shown("campaign?hash=" + key["hash"])
    checks.check("campaign.h5" in campaign and "D_OSz" in campaign, "and a campaign with its files", campaign[:500])
    with urllib.request.urlopen(f"{page}file?hash={key['hash']}&name=campaign.h5", timeout=30) as answer, \
            open(os.path.join(lab.folder, key["campaign"], "campaign.h5"), "rb") as file:
        checks.check(answer.read() == file.read(), "a download is the recording")
    refused = []
    for path, data in (("file?hash=" + key["hash"] + "&name=..%2F..%2Frecordings.sqlite3", None), ("api/v1/commands", b"{}")):
        try:
            urllib.request.urlopen(page + path, data, timeout=10)
        except urllib.error.HTTPError as error:
            refused.append(error.code)
    checks.equal(refused, [404, 405], "what lies elsewhere is not shown, and nothing can be commanded")
    checks.equal(server.end(), 0, "it ends when it is asked to")


def served_remotely(checks, lab, folder, serial="0017"):
    """The archive's door to elsewhere: certificates on both sides, and roles, as at the rig's."""
    pki, other = os.path.join(folder, "pki"), os.path.join(folder, "other-pki")
    for where, names in ((pki, ["--operator", "ada", "--viewer", "wall", "--viewer", "old"]), (other, ["--viewer", "wall"])):
        run = subprocess.run([lab.program, "pki", "init", "--folder", where, "--host", "127.0.0.1", *names], capture_output=True, text=True)
        checks.check(run.returncode == 0, "vibrig pki init makes certificates", run.stderr)
    for end in (".crt", ".key"):   # whoever has it keeps it
        shutil.copy(os.path.join(pki, "old" + end), os.path.join(pki, "gone" + end))
    subprocess.run([lab.program, "pki", "revoke", "--folder", pki, "old"], check=True, capture_output=True)
    without_role(pki)
    door = {"--certificate": "server.crt", "--key": "server.key", "--clients-ca": "authority.crt", "--revoked": "revoked.crl"}
    options = [word for option, name in door.items() for word in (option, os.path.join(pki, name))]
    serve = [lab.program, "archive", "serve", *lab.where(), "--remote", "127.0.0.1:0"]
    for left_out in ("--certificate", "--key", "--clients-ca"):
        at = options.index(left_out)
        run = subprocess.run([*serve, *options[:at], *options[at + 2:]], capture_output=True, text=True, timeout=30)
        checks.check(run.returncode == 2 and len(run.stderr.strip().splitlines()) == 1, f"without {left_out} it does not open that door",
                     f"{run.returncode} {run.stderr}")
    run = subprocess.run([*serve, *options[:-1], os.path.join(pki, "nothing.crl")], capture_output=True, text=True, timeout=30)
    checks.check(run.returncode == 2 and "nothing.crl" in run.stderr, "a list that is not there is named", f"{run.returncode} {run.stderr}")
    server = r.Child("serve-remotely", [*serve, *options], folder)
    end = time.monotonic() + 30
    while "with certificates: " not in server.text() and server.running() and time.monotonic() < end:
        time.sleep(0.05)
    checks.check("with certificates: https://" in server.text(), "archive serve --remote says where it is", server.text())
    port = int(server.text().split("with certificates: ")[-1].strip().rstrip("/").rsplit(":", 1)[1])
    key = (lab.campaigns("--serial", serial) or [{"hash": "", "campaign": ""}])[0]
    with open(os.path.join(lab.folder, key["campaign"], "campaign.h5"), "rb") as file:
        recording = file.read()
    for name in ("ada", "wall"):
        status, page = asked(port, pki, name, "/")
        checks.check(status == 200 and f"/unit?serial={serial}".encode() in page, f"{name} sees the units over TLS", str(status))
        checks.check(asked(port, pki, name, f"/file?hash={key['hash']}&name=campaign.h5") == (200, recording), f"{name} takes a recording")
        checks.equal(asked(port, pki, name, "/api/v1/commands", "POST")[0], 405, f"{name} can command nothing")
    checks.equal(asked(port, pki, "guest", "/")[0], 403, "a certificate without a role sees nothing")
    for what, name, more in (("without a certificate", None, {}), ("with one that is revoked", "gone", {}),
                             ("with one of another authority", os.path.join(other, "wall"), {}),
                             ("in TLS 1.1", "ada", {"version": ssl.TLSVersion.TLSv1_1})):
        status, page = asked(port, pki, name, "/", **more)
        checks.check(not isinstance(status, int) and not page, f"{what} nobody comes in", f"{status} {page[:100]}")
    status, _ = asked(port, pki, "ada", "/", authority=os.path.join(other, "authority.crt"))
    checks.check("SSL" in str(status), "whoever trusts another authority sees that it is not its server", str(status))
    checks.check(server.says("guest"), "who was refused is said", server.text()[-500:])
    checks.equal(server.end(), 0, "it ends when it is asked to")


def adaptive_by_type(checks, rig, lab, base, seed):
    """A unit among twelve others of its type, which an adaptive campaign starts from; and without an archive."""
    chance = random.Random(seed)
    others = os.path.join(rig.folder, "others")
    for i in range(12):
        clone(base, os.path.join(others, f"other-{i}"), -100 + i, serial=f"type-{i}", scatter=lambda u: chance.gauss(0, 3 * u))
    run = lab.run("archive", "type", "GP-3", "--simulated")
    checks.check(run.returncode == 1 and "expected at least 10 units" in run.stderr, "of few units nothing is said about their type",
                 run.stdout + run.stderr)
    run = lab.add(others, "rig-7")
    checks.check(run.returncode == 0, "twelve other units are added", run.stderr)
    run = lab.run("archive", "type", "GP-3", "--simulated", "--without", "0019", "--json")
    known = json.loads(run.stdout or '{"units": 0, "coefficients": []}')
    checks.check(known["units"] >= 12 and len(known["coefficients"]) == 30, "vibrig archive type knows them", run.stderr)
    checks.equal(lab.run("archive", "type", "GP-3").returncode, 1, "those on simulated rigs say nothing about real ones")
    u = [p["u"] for p in result_in(base)["parameters"]]
    rig.daemon.end()
    targets = {"bias": 4 * max(u[::10]), "linear": 4 * max(u[1:4]), "quadratic": 4 * max(u[4:10])}
    rig.configure({"name": "typed", "identify": "what-it-can", "dwell_s": 2.0, "adaptive": True, "prior": "type", "table_g": [9.0, 0.0]},
                  **{"campaign.targets": targets}, unit={"type": "GP-3", "serial": "0019"}, server={"page": "127.0.0.1:0"},
                  archive={"folder": lab.folder, "rig": "rig-7", "retry_max_s": 1.0})
    rig.start_daemon()
    rig.wait_for(r.measuring, 60)
    end = time.monotonic() + 60   # it is asked when nobody else wants the processor
    while time.monotonic() < end:
        for command in ("arm", "start"):
            rig.tool(command, "--by", "test")
        rig.wait_for_state(("recording", "slewing", "ramping", "settling", "finished"), 60)
        if "has not answered yet" not in rig.tool("events").stdout:
            break
        rig.tool("abort", "--by", "test")
        rig.wait_for_state(("aborted", "tripped"), 60)
        rig.daemon.end()
        rig.start_daemon()
        rig.wait_for(r.measuring, 60)
        time.sleep(5)
    status = rig.wait_for_state(("finished", "aborted", "tripped"), 240)
    events = rig.tool("events").stdout
    checks.check(r.state_of(status) == "finished", "an adaptive campaign with prior = \"type\" finishes", rig.logs())
    checks.check(f"starts from {known['units']} units of type GP-3" in events, "it says what it starts from", events[-1500:])
    rig.wait_for(lambda s: not s["recorder"].get("recording", False), 20)
    campaign = sorted(glob.glob(os.path.join(rig.results, "typed-*")), key=os.path.getmtime)[-1]
    result = result_in(campaign)
    typed = result.get("type_prior", {"parameters": []})
    checks.check(len(typed["parameters"]) == 30 and typed["units"] == known["units"] and
                 all(with_type["u"] < without["u"] for with_type, without in zip(typed["parameters"], result["parameters"])),
                 "the result is there without and with the type, which makes it narrower", json.dumps(typed)[:500])
    report = os.path.join(rig.folder, "typed.html")
    run = subprocess.run([lab.program, "report", campaign, "-o", report], capture_output=True, text=True, timeout=120)
    with open(report, encoding="utf-8") as file:
        checks.check("With the unit" in file.read(), "and in the report", run.stderr)


def losses(status):
    return [number(status["recorder"], "samples_lost", top=True), number(status["recorder"], "frames_lost", top=True),
            number(status["can"], "kernel_dropped", top=True), number(status["estimator_ring"], "dropped", top=True)]


def latencies(rig, looks=5, look_s=2):
    """How long frames wait: of some looks the class that holds 99 %, ms, and the mean. A machine that is busy for one look is not
    for all of them; what hangs, hangs in each."""
    found = []
    control = server_load.Control(rig.socket)
    before = control.status()
    for _ in range(looks):
        time.sleep(look_s)
        after = control.status()
        mean, bound, count = server_load.latency(before, after)
        found += [(bound, mean)] if count > 0 else []
        before = after
    return min(found), before["acquisition_latency"]["bounds_ms"]


def felt(checks, programs, folder, server, lab, recorded):
    """On the real clock: the same rig beside no archive, and beside one that hangs while it delivers to it."""
    found = {}
    for what in ("without an archive", "beside one that hangs"):
        rig = r.Rig(programs, "seqpacket", "real", os.path.join(folder, "felt-" + what.split()[0]))
        rig.start_plant()
        rig.be_punctual()
        archive = {"folder": lab.folder, "index": server.url, "rig": "rig-9", "retry_max_s": 1.0}
        rig.configure({"name": "felt", "identify": "what-it-can"}, **({"archive": archive} if "hangs" in what else {}))
        if "hangs" in what:
            shutil.copytree(recorded, os.path.join(rig.results, "waits"))
        rig.start_daemon()
        rig.wait_for(r.measuring, 60)
        if "hangs" in what:
            status = rig.wait_for(lambda s: s["archive"].get("delivering") or number(s, "failures") > 0, 60)
            checks.check(status["archive"].get("delivering") or number(status, "failures") > 0, "a delivery hangs", status["archive"])
        found[what], classes = latencies(rig)
        checks.equal(losses(rig.status()), [0, 0, 0, 0], f"{what}, in real time: nothing is lost")
        r.check_balance(checks, rig, what)
        if "hangs" in what:
            checks.equal(number(rig.status(), "delivered"), 0, "and nothing was delivered meanwhile")
        rig.stop()
    quiet, beside = found.values()
    # A class more is chance: where the classes' border lies in the midst of what is usual.
    allowed = min([bound for bound in classes if bound > quiet[0]], default=float("inf"))
    checks.check(beside[0] <= allowed, f"99 % of the frames wait {beside[0]:g} ms at most (mean {beside[1]:.3f}), without an archive "
                 f"{quiet[0]:g} ms (mean {quiet[1]:.3f})")


def hanging(checks, programs, folder, seed):
    """A server that stands still: a campaign is measured beside a delivery that hangs on it, and is delivered once it goes on."""
    server = Postgres(os.path.join(folder, "standing"))
    server.start()
    lab = Archive(programs, os.path.join(folder, "standing-lab"), server.url)
    rig = r.Rig(programs, "seqpacket", "rig", os.path.join(folder, "beside-standing"))
    rig.start_plant("--seed", str(seed), "--truth", rig.truth_file(r.QUICK))
    rig.configure(CAMPAIGN, unit={"type": "GP-3", "serial": "0020"},
                  archive={"folder": lab.folder, "index": server.url, "rig": "rig-8", "retry_max_s": 1.0})
    server.process.send_signal(signal.SIGSTOP)
    rig.start_daemon()
    rig.wait_for(r.measuring, 60)
    for round_ in range(2):   # the second beside the delivery of the first
        for command in ("arm", "start"):
            rig.tool(command, "--by", "test")
        rig.wait_for_state(("recording", "slewing", "ramping", "settling"), 30)
        status = rig.wait_for_state(("finished", "aborted", "tripped"), 180)
        checks.equal(r.state_of(status), "finished", f"campaign {round_ + 1} finishes beside a server that stands")
        status = rig.wait_for(lambda s: not s["recorder"].get("recording", False) and number(s, "waiting") >= 1, 30)
        checks.check(number(status, "waiting") >= 1 and number(status, "delivered") == 0, "meanwhile nothing could be delivered",
                     status["archive"])
    checks.equal(losses(status), [0, 0, 0, 0], "and nothing of the measurement is lost")
    r.check_balance(checks, rig, "beside a server that stands")
    if "--soak" in sys.argv:   # what waits for real time wants the machine for itself
        felt(checks, programs, folder, server, lab, glob.glob(os.path.join(rig.results, "unit-*"))[0])
    server.process.send_signal(signal.SIGCONT)
    # It takes what nobody else wants of the processors.
    status = rig.wait_for(lambda s: number(s, "delivered") >= 2 and number(s, "waiting") == 0, 600)
    checks.equal(number(status, "waiting"), 0, "the server goes on: all is delivered")
    checks.equal((len(lab.campaigns("--rig", "rig-8") or []), [f for f in lab.verify() if "rig-8" in f["campaign"]]), (2, []),
                 "whole, each once")
    rig.stop()
    server.kill(signal.SIGQUIT)


def kills(checks, programs, folder, base, seed):
    """SIGKILL before the n-th call that writes; each into an archive of its own, and then on from where it was."""
    library, at = os.path.join(folder, "die_at.so"), os.path.join(folder, "die-at")
    subprocess.run(["c++", "-shared", "-fPIC", "-O1", "-o", library,
                    os.path.join(os.path.dirname(os.path.abspath(__file__)), "die_at.cpp")], check=True)
    environment = {"LD_PRELOAD": library, "DIE_AT": at}
    chance, n, killed, wrong = random.Random(seed), 1, 0, []
    lab = Archive(programs, os.path.join(folder, "kills"))
    while True:
        with open(at, "w", encoding="ascii") as file:
            print(n, file=file)
        run = lab.add(base, "rig-7", environment=environment)
        seen = lab.campaigns() or []
        wrong += lab.half()
        if run.returncode != -signal.SIGKILL:
            wrong += [] if run.returncode == 0 else [f"{n}: {run.returncode} {run.stderr}"]
            break
        killed += 1
        if seen and lab.verify():
            wrong.append(f"{n}: listed and not whole")
        again = lab.add(base, "rig-7")
        if again.returncode != 0 or len(lab.campaigns() or []) != 1 or lab.verify():
            wrong.append(f"{n}: {again.stderr} {lab.verify()}")
        shutil.rmtree(lab.folder)
        os.makedirs(lab.folder)
        n += 1 + chance.randrange(max(1, n // 3))
    checks.check(killed >= 10 and not wrong,
                 f"killed before any of {n} calls that write, {killed} of them tried: no half campaign is seen, the next try delivers",
                 "\n".join(wrong[:10]))


def grows(checks, programs, folder):
    """What is asked of many campaigns costs by what is said of them, not by how many there are. As ratios of processor time; the
    figures are tests/bench/archive's."""
    path = os.path.join(os.path.dirname(os.path.dirname(os.path.abspath(__file__))), "bench", "archive")
    loader = importlib.machinery.SourceFileLoader("bench_archive", path)
    bench = importlib.util.module_from_spec(importlib.util.spec_from_loader(loader.name, loader))
    loader.exec_module(bench)
    vibrig, cost = os.path.join(programs, "vibrig"), {}
    for n in (1000, 10_000):
        lab = os.path.join(folder, f"of-{n}")
        os.makedirs(lab)
        bench.make_sqlite(vibrig, lab, n)
        for words in (("list", "--newest", "20"), ("list", "--serial", "unit-1"), ("trend", "unit-1", "--json"), ("list", "--json")):
            cost[(n, *words)] = bench.look([vibrig, *words, "--archive", lab])
    for words in (("list", "--newest", "20"), ("list", "--serial", "unit-1"), ("trend", "unit-1", "--json")):
        few, many = cost[(1000, *words)][0], cost[(10_000, *words)][0]
        checks.check(many < 3 * few, f"vibrig {' '.join(words)}: {many / few:.1f} times the processor time of ten times the campaigns",
                     f"{few:.3f} s, {many:.3f} s")
    few, many = cost[(1000, "list", "--json")], cost[(10_000, "list", "--json")]
    checks.check(many[0] < 15 * few[0] and many[2] > 9 * few[2],
                 f"vibrig list --json of 10 000: {many[0] / few[0]:.1f} times the processor time of 1000", f"{few}, {many}")


def once(checks, programs, folder, base):
    """The same recording is there once, whoever brings it; and nothing half stays."""
    lab = Archive(programs, os.path.join(folder, "once"))
    for rig in ("one", "two"):
        run = lab.add(base, rig)
        checks.check(run.returncode == 0, f"a campaign is added for rig {rig}", run.stderr)
    checks.check("of rig 'one', nothing was copied" in run.stdout and not os.path.exists(os.path.join(lab.folder, "two")),
                 "the second time it says under which rig it is there", run.stdout)
    checks.equal(lab.verify(), [], "and the archive is whole")
    there = glob.glob(os.path.join(lab.folder, "one", "*", "campaign.h5"))[0]
    os.truncate(there, 1000)
    run = lab.add(base, "two")
    checks.check(run.returncode == 0 and "mended, one/" in run.stdout and lab.verify() == [], "damaged, it is mended where it is", run.stdout)
    for name in (b"\xff", "a\nb", "x" * 65):
        run = lab.add(base, name)
        checks.check(run.returncode == 2 and run.stderr.count("\n") == 1 and "--rig: found '" in run.stderr, "a rig has no such name",
                     run.stderr)
    left = os.path.join(lab.folder, ".incoming", "one-left-0")
    os.mkdir(left)
    with open(os.path.join(lab.folder, ".incoming", ".underway"), "rb") as other:
        fcntl.flock(other, fcntl.LOCK_SH)
        checks.check(lab.add(base, "one").returncode == 0 and lab.incoming() == [left], "what another add is at stays")
    checks.check(lab.add(base, "one").returncode == 0 and lab.incoming() == [], "what one left that was killed does not")
    for where in ("loop", "one/loop", os.path.relpath(os.path.dirname(there), lab.folder) + "/loop"):
        os.symlink("loop", os.path.join(lab.folder, where))
    checks.equal(sorted((f["what"], f["campaign"]) for f in lab.verify()),
                 [("does not belong there", "loop"), ("does not belong there", "one/loop")], "links in a circle are named and passed by")
    for port in ("99999", "65536", "-1", "x", ""):
        run = subprocess.run([lab.program, "archive", "serve", *lab.where(), "--page", "127.0.0.1:" + port], capture_output=True, text=True,
                             timeout=20)
        checks.check(run.returncode == 2 and "from 0 to 65535" in run.stderr, f"'{port}' is no port", run.stderr)


def only_read(checks, programs, folder, results, serial):
    """A rig's recordings, asked by somebody who may only read them, while a recorder has the index and after it; and an index that is
    damaged."""
    rec = Archive(programs, os.path.join(folder, "read"))
    shutil.copytree(results, rec.folder, dirs_exist_ok=True, ignore=shutil.ignore_patterns("journal*", "*.sqlite3*", ".outbox"))
    subprocess.run(["chmod", "-R", "u=rwX,go=rX", rec.folder], check=True)
    index = os.path.join(rec.folder, "recordings.sqlite3")
    campaigns = [os.path.basename(os.path.dirname(path)) for path in glob.glob(os.path.join(rec.folder, "*", "campaign.h5"))]
    # As the recorder makes it: its own tables alone, and a log.
    with contextlib.closing(sqlite3.connect(index)) as recorder:
        recorder.execute("PRAGMA journal_mode = WAL")
        recorder.execute("CREATE TABLE campaign (key TEXT PRIMARY KEY, name TEXT NOT NULL, started_by TEXT NOT NULL, "
                         "started_utc_ns INTEGER NOT NULL, state TEXT NOT NULL)")
        recorder.execute("CREATE TABLE file (campaign TEXT NOT NULL, name TEXT NOT NULL, part INTEGER NOT NULL, closed INTEGER NOT NULL, "
                         "from_utc_ns INTEGER NOT NULL, to_utc_ns INTEGER NOT NULL, rows INTEGER NOT NULL, bytes INTEGER NOT NULL, "
                         "sha256 TEXT NOT NULL, PRIMARY KEY (campaign, name))")
        for i, key in enumerate(campaigns):
            recorder.execute("INSERT INTO campaign VALUES (?, 'unit', 'test', ?, 'finished')", (key, 10**18 + i))
        recorder.execute("INSERT INTO file VALUES (?, 'raw-0009.log.zst', 0, 1, 0, 0, 7, 7, 'gone')", (campaigns[0],))
        recorder.commit()
        asked_by_nobody(checks, rec, campaigns, serial, "while a recorder has it")
    asked_by_nobody(checks, rec, campaigns, serial, "after it")
    before = sorted(os.listdir(rec.folder))
    checks.check(rec.run("list").returncode == 0, "whoever may write notes the results")
    asked_by_nobody(checks, rec, campaigns, serial, "with results")
    checks.equal(sorted(os.listdir(rec.folder)), before, "nothing was made beside it")
    with open(index, "rb") as file:
        whole = file.read()
    for what, bytes_ in (("overwritten", b"no index" * 1000), ("cut", whole[:5000]), ("empty", b"")):
        with open(index, "wb") as file:
            file.write(bytes_)
        for words in (("list",), ("trend", serial), ("archive", "verify")):
            for run in (rec.run(*words), rec.as_nobody(*words)):
                checks.check(run.returncode == 2 and run.stderr.count("\n") == 1 and index in run.stderr and "makes it anew" in run.stderr,
                             f"an index that is {what}: vibrig {words[0]} says so and what to do", run.stdout + run.stderr)
    os.remove(index)
    run = rec.run("archive", "add", rec.folder)
    checks.equal(sorted(c["campaign"] for c in rec.campaigns() or []), sorted(campaigns), "which does make it anew: " + run.stderr)


def rivals(checks, programs, folder, base):
    """A copy of a campaign that is not whole, or says something else, takes no place in the archive."""
    lab = Archive(programs, os.path.join(folder, "rivals"))
    checks.check(lab.add(base, "rig-1").returncode == 0, "a campaign is archived")
    before = lab.campaigns()
    lied, cut = (os.path.join(folder, name, os.path.basename(base)) for name in ("lied", "cut"))
    clone(base, lied, 0, shift=100)
    with h5py.File(os.path.join(lied, "campaign.h5"), "r+") as file:   # a clone's own name is its folder's
        checks.equal(file.attrs["campaign"].decode(), os.path.basename(base), "its copy is of the same name")
    shutil.copytree(base, cut)
    os.remove(os.path.join(cut, "dwells.csv"))
    for what, copy in (("with another result", lied), ("with a file less", cut)):
        run = lab.add(copy, "rig-1")
        there = os.path.join(lab.folder, before[0]["campaign"])
        checks.check(run.returncode == 2 and copy in run.stderr and there in run.stderr, f"a copy {what} is refused, both are named",
                     run.stdout + run.stderr)
    checks.equal(lab.campaigns(), before, "and the genuine one stays what the archive has")
    checks.equal(lab.verify(), [], "whole")
    checks.check(lab.add(base, "rig-1").returncode == 0 and lab.campaigns() == before, "delivered again it changes nothing")


def full_archive(checks, programs, folder, base):
    disk = recording_faults.SickDisk(folder)
    if disk.refused:
        return checks.skip("a full archive takes nothing of a campaign", "no tmpfs here: " + disk.refused)
    try:
        disk.remount("rw")
        lab = Archive(programs, os.path.join(disk.folder, "lab"))
        disk.fill()
        run = lab.add(base, "rig-1")
        checks.check(run.returncode == 2 and "No space" in run.stderr and not lab.half(), "a full archive takes nothing of a campaign",
                     run.stderr)
        disk.make_room()
        run = lab.add(base, "rig-1")
        checks.check(run.returncode == 0 and lab.verify() == [], "with room it takes it", run.stderr)
    finally:
        subprocess.run(["umount", disk.folder], check=False)


def sick_archive(checks, lab, disk, base):
    """A disk that refuses while it is written."""
    disk.set("e")
    run = lab.add(base, "rig-9", environment=disk.environment())
    checks.check(run.returncode == 2 and "cannot" in run.stderr, "an archive that refuses is reported with why", run.stderr)
    checks.equal(lab.campaigns("--rig", "rig-9") or [], [], "and shows nothing of it")
    disk.set("-")
    run = lab.add(base, "rig-9", environment=disk.environment())
    checks.check(run.returncode == 0 and not lab.half(), "healthy again it takes it", run.stderr)


def until_delivered(lab, folder, rig, delivered=None):
    """As the outbox does: again and again. How often it took; `delivered` gets what came of each attempt."""
    delivered = [] if delivered is None else delivered
    for attempt in range(1, 60):
        delivered.append(lab.add(folder, rig).returncode == 0)
        if delivered[-1]:
            return attempt
        time.sleep(0.2)
    return 0


def shared(checks, programs, folder, base):
    server = Postgres(os.path.join(folder, "postgres"))
    lab = Archive(programs, os.path.join(folder, "shared"), server.url)
    early = lab.add(base, "rig-1")
    checks.check(early.returncode == 2 and server.folder in early.stderr, "a server that is not there is named", early.stderr)
    server.start()
    checks.check(until_delivered(lab, base, "rig-1") == 1 and len(lab.campaigns() or []) == 1, "what could not be registered then is now")
    campaigns = [(base, "rig-1")] + [(clone(base, os.path.join(folder, "many", f"{rig}-{i}"), i + 1, serial=f"{rig}-{i % 2}"), rig)
                 for i in range(8) for rig in ("rig-1", "rig-2")]
    delivered = []   # of both rigs
    with concurrent.futures.ThreadPoolExecutor(2) as pool:
        rigs = [pool.submit(lambda mine: [until_delivered(lab, f, rig, delivered) for f, rig in mine], [c for c in campaigns if c[1] == rig])
                for rig in ("rig-1", "rig-2")]

        def until(come, good):
            """One more attempt that went well, or did not, than `come`; or there are no more."""
            while delivered.count(good) <= come and not all(rig.done() for rig in rigs):
                time.sleep(0.02)

        for _ in range(3):
            until(delivered.count(True), True)
            server.kill()
            until(delivered.count(False), False)
            server.start()
        attempts = [n for future in rigs for n in future.result()]
    checks.check(all(attempts) and max(attempts) > 1, "two rigs deliver at once, the server is killed three times under it",
                 str(attempts))
    found = lab.campaigns() or []
    checks.equal(sorted(c["campaign"] for c in found), sorted(f"{rig}/{os.path.basename(f)}" for f, rig in campaigns),
                 "each campaign is there once")
    checks.equal(lab.verify(), [], "archive and index agree")
    checks.equal(len(lab.campaigns("--serial", "rig-2-1") or []), 4, "filters work there as in SQLite")
    trend = lab.run("trend", "rig-1-0", "--simulated", "--json")
    checks.check(trend.returncode == 0 and len(json.loads(trend.stdout)["campaigns"]) == 4, "and the trend", trend.stderr)
    server.process.send_signal(signal.SIGSTOP)
    begun = time.monotonic()
    stopped = lab.run("list", timeout=60)
    checks.check(stopped.returncode == 2 and time.monotonic() - begun < 20, "a server that does not answer is given up in time",
                 f"{time.monotonic() - begun:.1f} s, {stopped.stderr}")
    server.process.send_signal(signal.SIGCONT)
    server.kill(signal.SIGQUIT)


def main():
    programs = os.path.abspath(sys.argv[1])
    seed = int(sys.argv[sys.argv.index("--seed") + 1]) if "--seed" in sys.argv else 1
    checks = r.Checks()
    checks.note(f"seed {seed}")
    with tempfile.TemporaryDirectory() as folder:
        os.chmod(folder, 0o755)
        rig, lab, disk = outbox(checks, programs, folder, seed)
        comes_back(checks, rig, lab)
        base = glob.glob(os.path.join(rig.results, "unit-*"))[0]
        small = clone(base, os.path.join(folder, "small"), 0)
        moves(checks, rig, lab, base)
        reported(checks, rig, lab)
        at_another_frequency(checks, rig, lab, base)
        adaptive_by_type(checks, rig, lab, base, seed)
        rig.daemon.end()
        rig.plant.end()
        browsed(checks, lab, folder)
        served_remotely(checks, lab, folder)
        sick_archive(checks, lab, disk, clone(base, os.path.join(folder, "another"), 3))
        os.mkdir(os.path.join(folder, "full"))
        full_archive(checks, programs, os.path.join(folder, "full"), small)
        once(checks, programs, folder, small)
        rivals(checks, programs, folder, small)
        only_read(checks, programs, folder, rig.results, "0017")
        kills(checks, programs, folder, small, seed)
        grows(checks, programs, folder)
        if POSTGRES:
            shared(checks, programs, folder, small)
            hanging(checks, programs, folder, seed)
        else:
            checks.check(False, "there is a PostgreSQL (tests/packages test)")
    return checks.end()


if __name__ == "__main__":
    sys.exit(main())
