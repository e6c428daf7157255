#!/usr/bin/python3
"""The Python package, and the reader for MATLAB in Octave, on a rig that runs and on what it records; the examples of
docs/python.md with their pictures; a certificate. On the seqpacket bus and the rig's clock.

usage: python_package.py PROGRAMS      PROGRAMS: build/PRESET/bin
"""
import contextlib
import hashlib
import json
import math
import os
import random
import re
import shutil
import socket
import sqlite3
import subprocess
import sys
import tempfile
import time
import xml.etree.ElementTree

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import rig as r  # noqa: E402

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
PACKAGE = os.path.join(ROOT, "proto", "python")
MATLAB = os.path.join(ROOT, "proto", "matlab")
PICTURES = os.path.join(ROOT, "build", "tests", "python")
sys.path.insert(0, PACKAGE)
import numpy as np   # noqa: E402  Debian's, as h5py
import h5py   # noqa: E402
import vibrig   # noqa: E402

CAMPAIGN = {"name": "python", "identify": "what-it-can", "table_g": [9.0, 7.0], "dwell_s": 20.0}


def run_pytest(checks, folder):
    report = os.path.join(folder, "pytest.xml")
    run = subprocess.run([sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "--junitxml", report,
                          os.path.join(ROOT, "tests", "python")], capture_output=True, text=True, timeout=300,
                         env={**os.environ, "PYTHONPATH": PACKAGE, "PYTHONDONTWRITEBYTECODE": "1"})
    cases = list(xml.etree.ElementTree.parse(report).getroot().iter("testcase")) if os.path.exists(report) else []
    checks.check(len(cases) >= 24 and run.returncode == 0, "pytest runs to its end", run.stdout[-2000:] + run.stderr[-500:])
    for case in cases:
        checks.check(case.find("failure") is None and case.find("error") is None, "pytest: " + case.get("name"))


def look_live(checks, rig, where, client):
    status = client.status()
    checks.equal(status["campaign"]["name"], "python", f"{where}: status")
    checks.check("site.latitude_deg" in client.configuration() and len(client.plan()["stops"]) == 28, f"{where}: configuration, plan")
    checks.check("vibrig_uptime_seconds" in client.metrics(), f"{where}: metrics")
    curves, end = client.history("temperature_c", "measured_g"), time.monotonic() + 20
    while not len(curves["time_s"]) and time.monotonic() < end:   # its first row comes after a second of the rig
        time.sleep(0.1)
        curves = client.history("temperature_c", "measured_g")
    checks.check(len(curves["time_s"]) == len(curves["temperature_c_max"]) > 0, f"{where}: history", str(curves)[:300])
    events = client.events()
    later = client.events(after=int(events[0]["id"]))
    checks.check(len(events) - 1 == len(later) or len(later) > 0, f"{where}: events from a number on", str(len(events)))
    updates = []
    for update in client.stream(10):
        updates.append(update)
        if len(updates) >= 4:
            break
    times = [float(u.status["time_s"]) for u in updates if u.status]
    checks.check(len(times) >= 2 and times == sorted(times), f"{where}: the stream goes on", str(times))
    try:
        client.history("nothing")
        checks.check(False, f"{where}: a refusal has the daemon's words")
    except vibrig.Answer as answer:
        checks.check(answer.status == 400 and "expected one or more" in answer.detail, f"{where}: a refusal has the daemon's words",
                     str(answer))


def check_live(checks, rig, keys, port):
    page = rig.page_address()
    with vibrig.Client(rig.socket) as client:
        look_live(checks, rig, "socket", client)
    with vibrig.Client(page=page) as client:
        look_live(checks, rig, "page", client)
    with vibrig.Client(host=f"localhost:{port}", identity=os.path.join(keys, "wall")) as client:
        look_live(checks, rig, "TLS", client)
    try:
        vibrig.Client(host=f"127.0.0.1:{port}", identity=os.path.join(keys, "wall"), timeout_s=3).status()
        checks.check(False, "TLS: a rig of another name is refused")
    except OSError as error:
        checks.check("CERTIFICATE_VERIFY_FAILED" in str(error), "TLS: a rig of another name is refused", str(error))


def check_recording(checks, rig, folder):
    campaign = vibrig.open(folder)
    c = campaign.conditions
    checks.check(c.rows > 300 and np.all(np.diff(c["time_ns"]) > 0), "conditions come once a second", str(c.rows))
    checks.check(np.isfinite(c["temperature_c"]).mean() > 0.95 and np.isfinite(c["sensor_c"][10:]).mean() > 0.95,
                 "with temperatures of all sensors")
    dwell = (c["shaker_state"] == 2) & (c["command_g"] > 6.9)
    checks.check(dwell.sum() > 100 and np.allclose(c["set_point_g"][dwell], c["command_g"][dwell], rtol=0.01) and
                 np.median(np.abs(c["measured_g"][dwell] / c["command_g"][dwell] - 1)) < 0.05,
                 "the shaker's read-back follows its command", str(dwell.sum()))
    names = [row["name"] for row in campaign.interlocks]
    checks.check(len(names) > 20 and c["interlock_value"].shape[1] == len(names), "interlocks have names and values", str(names))
    hot = c["interlock_value"][:, names.index("temperature_alarm")]
    checks.check(np.nanmax(np.abs(hot - c["temperature_c"])) < 0.5, "an interlock's value is what it watches")
    checks.check(all(c.units[n] == u for n, u in (("temperature_c", "degC"), ("measured_g", "g"), ("set_point_hz", "Hz"))),
                 "they have units")
    checks.check((c["ready"][-100:] == 1).all() and set(np.unique(c["fault"])) <= {-1, 0}, "the platform's own status is there")
    status_unknown = int(rig_counter(rig, "unknown"))
    received = int(rig_counter(rig, "received"))
    checks.check(status_unknown < 0.002 * received, "of a rig's frames none is unknown", f"{status_unknown} of {received}")
    table = json.loads(tool(rig, "compensate", folder, "--json", "--attitude", "45,10,90", "--table-g", "9").stdout)
    found = campaign.compensation([45, 10, 90], table_g=9)
    gyros = table["prediction"]["gyros"]
    checks.check(np.allclose(found.drift_dph, [g["drift_dph"] for g in gyros], rtol=1e-12) and
                 np.allclose(found.residual_dph, [g["residual_sigma_dph"] for g in gyros], rtol=1e-9), "compensation as vibrig's",
                 f"{found} {gyros}")
    said = np.array([math.nan if p["u"] is None else p["u"] for p in campaign.result["parameters"]])
    checks.check(np.allclose(campaign.coefficients.u, said, rtol=1e-6, equal_nan=True) and np.isfinite(said).any(), "the uncertainty is the result's",
                 f"{campaign.coefficients.u} {said}")
    exported = os.path.join(rig.folder, "x.csv")
    tool(rig, "export", folder, "--to", "csv", "-o", exported)
    with open(exported, encoding="utf-8") as file:
        rows = sum(1 for _ in file) - 1
    counted = sum(s.stop - s.start for s in (campaign.of_dwell(i) for i in range(campaign.dwells.rows)))
    checks.equal(counted, rows, "rows of the dwells as vibrig exports them")
    return campaign


def check_anew(checks, rig, folder):
    """What is identified with other settings says with which, in whatever form, and has their coverage."""
    other = os.path.join(rig.folder, "other.toml")
    with open(rig.configuration, encoding="utf-8") as file:
        text = file.read()
    with open(other, "w", encoding="utf-8") as file:
        file.write(text + "\n[uncertainty]\ncoverage = 0.5\n")
    words = "identified anew with " + other + ", not as recorded"
    for kind in ("text", "csv", "c"):
        anew, recorded = (tool(rig, "compensate", folder, "--to", kind, *more).stdout for more in (("--config", other), ()))
        checks.check(words in anew and "identified anew" not in recorded and "verdict: " in recorded,
                     f"compensate --config says so as {kind}", anew[:1500] + recorded[:1500])
    said = [json.loads(tool(rig, "compensate", folder, "--json", *more).stdout) for more in (("--config", other), ())]
    checks.check([one["identified_anew_with"] for one in said] == [other, None] and said[1]["verdict"]["word"] == "valid" and
                 all(c["u"] == c["sigma"] > 0 for c in said[1]["coefficients"]), "and as JSON, with verdict and u", str(said)[:1500])
    run = tool(rig, "report", folder, "--config", other, "-o", "anew.html", "--json")
    with open(os.path.join(rig.folder, "anew.html"), encoding="utf-8") as file:
        page = file.read()
    checks.check(words in page and "probability of about 50 %" in page and json.loads(run.stdout)["identified_anew_with"] == other,
                 "report --config says so on its page and as JSON, with the coverage of these settings", run.stdout + run.stderr)


def check_cycle_times(checks, campaign):
    """What the DBC says of the rig's messages is what is on its bus."""
    stated = {int(i): int(ms) for i, ms in re.findall(r'BA_ "GenMsgCycleTime" BO_ (\d+) (\d+);', campaign.dbc)}
    text = subprocess.run(["zstdcat", os.path.join(campaign.folder, "raw-0001.log.zst")], capture_output=True, text=True, timeout=60).stdout
    times = {}
    for time_s, number in re.findall(r"^\((\d+\.\d+)\) \S+ ([0-9A-F]+)#", text, re.M):
        times.setdefault(int(number, 16), []).append(float(time_s))
    wrong = {i: found for i, ms in stated.items() if i in times and not 0.9 * ms < (found := 1e3 * np.median(np.diff(times[i]))) < 1.1 * ms}
    # Increments come in a mode of their own.
    checks.check(not wrong and set(stated) - set(times) <= {288, 289}, "the DBC's cycle times are those of the rig", f"{wrong} {set(stated) - set(times)}")


def tool(rig, *arguments, timeout=300):
    return subprocess.run([rig.program("vibrig"), *arguments], stdin=subprocess.DEVNULL, capture_output=True, text=True,
                          timeout=timeout, cwd=rig.folder)


def rig_counter(rig, name):
    return rig.last["assembler"][name]


def check_octave(checks, rig, campaign):
    drift = campaign.compensation([45, 10, 90], table_g=9)
    script = f"""addpath('{MATLAB}'); c = vibrig.open(getenv('RECORDING'));
[d, u, ok] = vibrig.compensation(c, [45 10 90], 'table_g', 9);
printf('%d %d %d %s %s %d\\n', rows(c.samples.force_g), columns(c.samples.force_g), rows(c.dwells.covariance), c.state, ...
       c.units.conditions.temperature_c, numel(c.interlocks));
printf('%.17g ', d, u, c.coefficients.value, c.coefficients.u, mean(c.samples.force_g), c.conditions.temperature_c(end), all(ok));
try, vibrig.open('/nonexistent'); catch e, printf('\\n%s', e.message); end
c.result.spectrum.model = 'resonance'; vibrig.compensation(c, [45 10 90]);
try, vibrig.compensation(c, [45 10 90], 'table_g', 9); catch e, printf('\\n%s', e.message); end
c.coefficients.observable(1) = false; c.coefficients.value(1) = NaN; c.coefficients.covariance(1, :) = NaN; c.coefficients.covariance(:, 1) = NaN;
[d, u, ok] = vibrig.compensation(c, [45 10 90]); printf('\\n%d', isnan(d), isnan(u), ok);"""
    run = subprocess.run(["octave-cli", "--quiet", "--no-init-file", "--eval", script], capture_output=True, text=True, timeout=120,
                         env={**os.environ, "RECORDING": str(campaign.folder)})
    lines = run.stdout.splitlines() + ["", "", "", ""]
    checks.equal(lines[0], f"{campaign.samples.rows} 3 {campaign.dwells.rows} finished degC {len(campaign.interlocks)}",
                 "Octave opens the recording with its reader")
    expected = [*drift.drift_dph, *drift.residual_dph, *campaign.coefficients.value, *campaign.coefficients.u, *campaign.samples["force_g"].mean(axis=0),
                campaign.conditions["temperature_c"][-1], 1]
    found = [float(x) for x in lines[1].split()]
    checks.check(len(found) == len(expected) and np.allclose(found, expected, rtol=1e-9), "with the same numbers", run.stdout + run.stderr)
    checks.check("expected a campaign's HDF5 file or its folder" in lines[2], "and says what it did not find", run.stderr)
    checks.equal(lines[4:10] + lines[10:13], list("100100011"), "what is not determined foretells nothing")
    checks.check("expected a level of 0" in lines[3], "and what its coefficients do not foretell", run.stdout + run.stderr)


CHANNELS = "outer inner azimuth accel_x accel_y accel_z table_accel".split()


def check_parts_in_octave(checks, folder):
    """Of parts made for the purpose: as Python joins them, so does Octave."""
    sys.path.insert(0, os.path.join(ROOT, "tests", "python"))
    import pathlib
    import conftest
    made = conftest.Recording(pathlib.Path(folder) / "parts" / "test-1")
    second = conftest.SECOND
    for part, arguments in ((1, dict(start=5000 * second, orders=[1, 2], done=2, state="running")),
                            (2, dict(start=second, orders=[2, 3], done=1, restart=True, before=1, offset_s=1_700_009_000)),
                            (3, dict(start=second + 400 * conftest.STEP, orders=[3, 4], done=2, offset_s=1_700_009_000))):
        path = made.part(part, **arguments)
        channels = CHANNELS[:6] if part == 1 else CHANNELS[::-1] if part == 2 else CHANNELS   # an older build's, another's
        with h5py.File(path, "r+") as file:
            quality = np.tile([CHANNELS.index(name) % 5 for name in channels], (400, 1)).astype(np.uint8)
            file["samples"].create_dataset("quality", data=quality).attrs["names"] = np.bytes_(" ".join(channels))
            file["head"] = np.bytes_(json.dumps({
                "channels": channels,
                "name": "test", "campaign": "test-1", "part": part, "restart": bool(arguments.get("restart")), "units": {},
                "dwells_before": arguments.get("before", 0), "utc_offset_ns": str(file.attrs["utc_offset_ns"])}))
    joined = vibrig.open(made.folder)
    script = f"""addpath('{MATLAB}'); c = vibrig.open('{made.folder}');
printf('%d %d %s %s', rows(c.samples.force_g), all(diff(double(c.samples.time_ns)) > 0), mat2str(double(c.dwells.position')), ...
       num2str(c.samples.time_ns(end), '%d'));
printf(' %d', c.samples.quality(1, :), c.samples.quality(end, :));"""
    run = subprocess.run(["octave-cli", "--quiet", "--no-init-file", "--eval", script], capture_output=True, text=True, timeout=60)
    positions = "[" + " ".join(str(p) for p in joined.dwells["position"]) + "]"
    quality = " ".join(str(q) for q in (*joined.samples["quality"][0], *joined.samples["quality"][-1]))
    checks.equal(run.stdout, f"{joined.samples.rows} 1 {positions} {joined.samples['time_ns'][-1]} {quality}",
                 "Octave joins parts as Python does, of more and fewer channels, too")
    checks.equal(quality, "0 1 2 3 4 0 5 0 1 2 3 4 0 1", "and a channel that a part lacks is unbound in it")
    with h5py.File(path, "r+") as file:
        file["ended"] = np.bytes_(json.dumps({"state": "continued", "reason": "", "mark": "", "ended_utc_ns": "0"}))
    run = subprocess.run(["octave-cli", "--quiet", "--no-init-file", "--eval",
                          f"addpath('{MATLAB}'); try, vibrig.open('{made.folder}'); catch e, printf('%s', e.message); end"],
                         capture_output=True, text=True, timeout=60)
    checks.equal(run.stdout, f"{made.folder}: missing campaign-4.h5, in which campaign-3.h5 says that the campaign goes on",
                 "and names a last part that is missing")
    checks.note(run.stderr[-500:])


def check_examples(checks, campaign):
    """The code of docs/python.md, as it stands there."""
    with open(os.path.join(ROOT, "docs", "python.md"), encoding="utf-8") as file:
        blocks = re.findall(r"```python\n(# example: (\S+)\n.*?)```", file.read(), re.S)
    checks.equal(len(blocks), 3, "docs/python.md has three examples")
    os.makedirs(PICTURES, exist_ok=True)
    for code, picture in blocks:
        path = os.path.join(PICTURES, picture)
        if os.path.exists(path):
            os.remove(path)
        run = subprocess.run([sys.executable, "-c", code, str(campaign.folder)], capture_output=True, text=True, timeout=120, cwd=PICTURES,
                             env={**os.environ, "PYTHONPATH": PACKAGE, "MPLBACKEND": "agg", "PYTHONDONTWRITEBYTECODE": "1"})
        checks.check(run.returncode == 0 and os.path.exists(path) and os.path.getsize(path) > 5000, f"its example makes {picture}",
                     run.stderr[-1500:])


def post(client_socket, command):
    """A command as it would be typed: the package commands nothing."""
    body = json.dumps(command)
    with socket.socket(socket.AF_UNIX) as link:
        link.settimeout(20)
        link.connect(client_socket)
        link.sendall((f"POST /api/v1/commands HTTP/1.1\r\nHost: x\r\nConnection: close\r\nContent-Type: application/json\r\n"
                      f"Content-Length: {len(body)}\r\n\r\n{body}").encode())
        answer = b"".join(iter(lambda: link.recv(65536), b"")).decode()
    return int(answer.split()[1]), answer


def check_certificate(checks, rig, campaign):
    paper = os.path.join(rig.folder, "C-17.toml")
    text = """number = "C-17"
[laboratory]
name = "Rig Lab"
[customer]
name = "Customer & Sons"
[[limit]]
coefficient = "D_Fx"
low = 0.0
high = 2.0
"""
    with open(paper, "w", encoding="utf-8") as file:
        file.write(text)
    issue = ["--paper", paper, "--by", "A. Person", "-o", "C-17"]
    made = tool(rig, "certificate", str(campaign.folder), *issue, "--socket", rig.socket, "--json")
    checks.check(made.returncode == 0, "a certificate is issued", made.stderr)
    pdf, page = os.path.join(rig.folder, "C-17.pdf"), os.path.join(rig.folder, "C-17.html")
    certificate = json.load(open(os.path.join(rig.folder, "C-17.json"), encoding="utf-8"))
    checks.check(certificate["statements"][0]["statement"] == "passes" and len(certificate["results"]) == 30 and certificate["simulated"],
                 "with the results and a statement", str(certificate)[:500])
    content = open(page, encoding="utf-8").read()
    checks.check("Customer &amp; Sons" in content and ">SIMULATED<" in content and "last bit" in content, "and on its page")
    digest = hashlib.sha256(open(pdf, "rb").read()).hexdigest()
    whole = json.loads(tool(rig, "journal", "verify", os.path.join(rig.results, "journal.sqlite3"), "--json").stdout)
    with contextlib.closing(sqlite3.connect(os.path.join(rig.results, "journal.sqlite3"))) as journal:
        rows = journal.execute("SELECT person, argument, accepted FROM command WHERE kind = 'certificate'").fetchall()
    entry = json.loads(rows[0][1]) if rows else {}
    checks.check(len(rows) == 1 and rows[0][0].startswith("A. Person (") and rows[0][2] == 1 and entry.get("number") == "C-17" and
                 entry.get("pdf_sha256") == digest and whole["whole"], "the rig's signed journal has the PDF's SHA-256", f"{rows} {whole}")
    issued = json.loads(made.stdout or "{}")
    checks.check(issued.get("pdf_sha256") == digest and issued.get("json_sha256") == entry.get("json_sha256") and
                 (issued.get("number"), issued.get("in_journal")) == ("C-17", True) and not [name for name in os.listdir(rig.folder) if "unfinished" in name], "which is said, too", made.stdout)
    printed = len(re.findall(rb"/Type */Page\b", open(pdf, "rb").read()))
    checks.check(1 < printed <= 5, "it is a few pages, its budget among them", f"{printed} pages")
    over = tool(rig, "certificate", str(campaign.folder), *issue, "--no-journal")
    checks.check(over.returncode == 2 and "found it there already" in over.stderr, "one that was issued is not written over", over.stderr)
    elsewhere = ["--paper", paper, "--by", "A. Person", "-o", "elsewhere"]
    again = tool(rig, "certificate", str(campaign.folder), *elsewhere, "--socket", rig.socket, "--json")
    checks.check(again.returncode == 1 and "issued already" in again.stderr and "issued already" in json.loads(again.stdout)["refused"], "a number is given once", again.stderr)
    checks.equal(hashlib.sha256(open(pdf, "rb").read()).hexdigest(), digest, "and the one that has it stays as it is")
    checks.equal([name for name in os.listdir(rig.folder) if "elsewhere" in name], [], "and of what is refused nothing is left")
    nobody = tool(rig, "certificate", str(campaign.folder), *elsewhere, "--socket", os.path.join(rig.folder, "nobody"))
    checks.check(nobody.returncode == 2 and "--no-journal" in nobody.stderr, "without its daemon none is issued", nobody.stderr)
    for wrong in ("{}", "text", json.dumps({**entry, "number": "C-18", "pdf_sha256": digest.upper()}), json.dumps({**entry, "number": ""})):
        said = post(rig.socket, {"kind": "certificate", "by": "A", "argument": wrong})
        checks.check(said[0] == 409 and "expected" in said[1] or "no JSON object" in said[1], f"no entry: {wrong[:40]}", str(said))
    certificate_in_the_way(checks, rig, campaign, paper, text)
    certificate_of_lies(checks, rig, campaign, paper)
    for wrong, words in ((text.replace("C-17", ""), "number"), (text.replace("C-17", "  "), "number"), (text.replace("D_Fx", "D_t"), "expected one such as D_Fx"),
                         (text + "colour = 1\n", "unknown key colour"), (text.replace("high = 2.0", "high = -1"), "low not below high"),
                         (text + text[text.index("[[limit]]"):], '"D_Fx" a second time'), (text + "[item]\nreceived = 9999-11-20\n", "day of issue"),
                         ("number = ", "C-17.toml:1"), (text.replace("[customer]", "[costumer]"), "unknown key costumer")):
        with open(paper, "w", encoding="utf-8") as file:
            file.write(wrong)
        bad = tool(rig, "certificate", str(campaign.folder), *elsewhere, "--no-journal")
        checks.check(bad.returncode == 2 and words in bad.stderr, f"a paper that is wrong is named: {words}", bad.stderr)


def certificate_in_the_way(checks, rig, campaign, paper, text):
    """A name that cannot be had is refused before the journal knows the number, and a number is one with blanks as well."""
    with open(paper, "w", encoding="utf-8") as file:
        file.write(text.replace("C-17", " C-18  "))
    os.mkdir(os.path.join(rig.folder, "C-18.pdf"))
    issue = ["certificate", str(campaign.folder), "--paper", paper, "--by", "A. Person", "-o", "C-18", "--socket", rig.socket, "--json"]
    run = tool(rig, *issue)
    checks.check(run.returncode == 2 and "C-18.pdf: found it there already" in run.stderr, "a folder of its name is named", run.stderr)
    os.rmdir(os.path.join(rig.folder, "C-18.pdf"))
    run = tool(rig, *issue)
    checks.check(run.returncode == 0 and json.loads(run.stdout)["number"] == "C-18", "and the number is still to be had", run.stderr)
    with open(paper, "w", encoding="utf-8") as file:
        file.write(text.replace("C-17", "C-18 "))
    run = tool(rig, *issue[:-5], "-o", "other", *issue[-3:])
    checks.check(run.returncode == 1 and "issued already" in run.stderr, "with a blank more it is the same number", run.stderr)
    with open(paper, "w", encoding="utf-8") as file:
        file.write(text)


def certificate_of_lies(checks, rig, campaign, paper):
    """What the recording says of itself has to come out of it again."""
    command = ["--paper", paper, "--by", "A", "--no-journal", "-o", "no"]
    path = str(campaign.parts[0])
    shutil.copy(path, path + ".kept")
    value = campaign.result["parameters"][0]["value"]
    with open(path, "r+b") as file:
        content = file.read()
        at = content.index(b'"value":', content.index(b'{"parameters":[{"name":"D_Fx"')) + len(b'"value":')
        digit = content.index(b".", at) + 1
        file.seek(digit)
        file.write(b"5" if content[digit:digit + 1] != b"5" else b"6")
    run = tool(rig, "certificate", str(campaign.folder), *command)
    checks.check(run.returncode == 1 and "campaign.h5: found SHA-256" in run.stderr and "changed since" in run.stderr,
                 "a byte that was changed since is seen by the index", run.stderr)
    away = os.path.join(rig.folder, "away", "lied")
    shutil.copytree(str(campaign.folder), away)
    shutil.move(path + ".kept", path)

    def lied(what, change):
        """One more lie in the result of the copy, of which there is no index."""
        with h5py.File(os.path.join(away, "campaign.h5"), "r+") as file:
            result = json.loads(file["result"][()]) if change else None
            if change:
                change(result)
                del file["result"]
                file["result"] = np.bytes_(json.dumps(result))
        run = tool(rig, "certificate", away, *command)
        checks.check(run.returncode == 1 and f"{away}/campaign.h5: found a result that does not come out of the recording again" in run.stderr and
                     "json.exception" not in run.stderr, f"no certificate of {what}", run.stderr)
        run = tool(rig, "replay", away)
        checks.check(run.returncode == 1 and "the recording's result is not that of its dwells (/result: " in run.stderr and
                     "last bit" not in run.stderr, f"and a replay says so of {what}", run.stderr)
        run = tool(rig, "report", away, "-o", "lied.html")
        with open(os.path.join(rig.folder, "lied.html"), encoding="utf-8") as file:
            page = file.read()
        checks.check("result is not that of its dwells (/result: " in run.stderr and "result is not that of its dwells: /result: " in page and
                     "last bit" not in page, f"and so does a report of {what}", run.stderr)
    lied("one digit of a coefficient", None)
    honest = campaign.result
    for what, change in (("u / 10", lambda r: r["parameters"][3].update(u=honest["parameters"][3]["u"] / 10)),
                         ("another name", lambda r: r["parameters"][4].update(name="D_Fx")),
                         ("another unit", lambda r: r["parameters"][4].update(unit="<script>")),
                         ("another verdict", lambda r: r.update(verdict={"word": "splendid", "reasons": 5})),
                         ("numbers for coefficients", lambda r: r.update(parameters=[5] * 30)),
                         ("another spectrum", lambda r: r.update(spectrum={"frequencies": [5], "sweeps": 3}))):
        lied(what, lambda r, change=change: (r.clear(), r.update(json.loads(json.dumps(honest))), change(r)))
    with h5py.File(os.path.join(away, "campaign.h5"), "r+") as file:
        file.attrs.modify("started_utc_ns", np.int64(1772352000 * 10**9))
    with open(paper, encoding="utf-8") as file:
        text = file.read()
    with open(paper, "w", encoding="utf-8") as file:
        file.write(text + "[item]\nreceived = 2026-03-02\n")
    run = tool(rig, "certificate", away, *command)
    checks.check(run.returncode == 2 and "received: found 2026-03-02, expected none after the day on which the campaign began (UTC), 2026-03-01" in run.stderr,
                 "an item is not calibrated before it was received", run.stderr)
    with open(paper, "w", encoding="utf-8") as file:
        file.write(text)
    checks.equal([name for name in os.listdir(rig.folder) if name.startswith("no.")], [], "and nothing is left of them")
    checks.check(value is not None, "the coefficient is determined")


def check_contradiction(checks, programs, folder):
    """An accelerometer's zero of 0.015 g that the configuration does not know: whoever looks at the recording says the same."""
    rig = r.Rig(programs, "seqpacket", "rig", folder)
    try:
        rig.start_plant("--seed", "1", "--truth", rig.truth_file({"accelerometer": {"zero_g": [0.015, 0.0, 0.0]}, **r.QUICK}), "--speed", "max")
        rig.configure({**CAMPAIGN, "name": "crooked", "table_g": [9.0, 0.0], "on_not_valid": "pause"}, unit={"type": "GP-3", "serial": "0017"})
        yesterday = os.path.join(rig.results, "result.json")
        os.makedirs(rig.results, exist_ok=True)
        with open(yesterday, "w", encoding="utf-8") as file:
            file.write("yesterday's")
        os.utime(yesterday, (1772352000, 1772352000))
        rig.start_daemon()
        rig.wait_for(r.measuring, 30)
        for command in ("arm", "start"):
            rig.tool(command, "--by", "A. Person")
        checks.equal([name for name in os.listdir(rig.results) if name.startswith("result")], ["result-20260301T080000Z.json"],
                     "a campaign that begins puts aside the result of the one before")
        paused = rig.wait_for_state(("paused", "finished", "aborted", "tripped"), 120)
        said = rig.tool("events").stdout
        checks.check(r.state_of(paused).startswith("paused") and "the configuration does not fit the recording" in r.state_of(paused) and
                     rig.positions_done() < 20 and "suspects, best first: accelerometer.zero_g: about [0.01" in said,
                     "a configuration that does not fit is told of while the campaign runs, and it pauses", r.state_of(paused) + said[-3000:])
        rig.tool("resume", "--by", "A. Person")
        rig.wait_for_state(("finished", "aborted", "tripped"), 120)
        rig.wait_for(lambda s: not s["recorder"].get("recording"), 30)
        with open(yesterday, encoding="utf-8") as file:
            written = file.read().strip()
        status = rig.status()
    finally:
        rig.stop()
    recording = next(os.path.join(rig.results, name) for name in os.listdir(rig.results) if name.startswith("crooked-"))
    result = json.loads(written)
    checks.check(result["verdict"]["word"] == "not valid" and result["verdict"]["reasons"][0]["code"] == "configuration" and
                 any(w.startswith("suspects, best first: accelerometer.zero_g: about [0.01") for w in result["warnings"]),
                 "the daemon's own result says that the configuration does not fit", f"{result['verdict']} {result['warnings']}")
    checks.check(status["verdict"]["word"] == "not valid", "and so does its status", str(status.get("verdict")))
    for command in ("replay", "identify"):
        checks.equal(tool(rig, command, recording, "--json").stdout.strip(), written, f"{command} gives that result to the last bit")
    with open(os.path.join(folder, "paper.toml"), "w", encoding="utf-8") as file:
        file.write('number = "1"\n[laboratory]\nname = "L"\n[customer]\nname = "C"\n')
    for command in (("identify", recording), ("replay", recording), ("report", recording, "-o", "r.html"),
                    *(("compensate", recording, "--to", kind) for kind in ("text", "json", "csv", "c")),
                    ("certificate", recording, "--paper", "paper.toml", "--by", "A", "--no-journal")):
        run = tool(rig, *command)
        checks.check(run.returncode == 1 and "the configuration does not fit the recording: " in run.stdout + run.stderr and
                     "not valid" in run.stdout + run.stderr, f"vibrig {command[0]}: a configuration that does not fit is no result", f"status {run.returncode} {(run.stdout + run.stderr)[-600:]}")
        if command[0] == "compensate":
            checks.check("not valid" in run.stdout and "verdict: not valid" in run.stderr, f"and what compensates says so itself: {command[-1]}",
                         run.stdout[:1500])
    study = os.path.join(folder, "again")
    with open(study + ".toml", "w", encoding="utf-8") as file:
        file.write(f'[study]\nname = "again"\nkind = "recordings"\nfolders = ["{recording}"]\n')
    for command in (("plan", study + ".toml", "-o", study), ("run", study), ("merge", study, "-o", study + ".json")):
        run = tool(rig, "study", *command)
        checks.check(run.returncode == 0, f"of the recording a study: {command[0]}", run.stderr)
    with open(study + ".json", encoding="utf-8") as file:
        again = json.load(file)["recordings"][0]
    checks.equal((again["old"]["verdict"], again["new"]["verdict"]), ("not valid", "not valid"), "a study of recordings says so, too")


def main():
    programs = r.programs_from_command_line(__doc__)
    checks = r.Checks()
    with tempfile.TemporaryDirectory(prefix="vibrig-python.") as folder:
        run_pytest(checks, folder)
        check_parts_in_octave(checks, folder)
        rig = r.Rig(programs, "seqpacket", "rig", folder)
        try:
            keys = os.path.join(folder, "vibrig-pki")
            port = random.randrange(20000, 32000)   # below those that the kernel gives out
            tool(rig, "pki", "init", "--host", "localhost", "--viewer", "wall")
            rig.start_plant("--seed", "3")
            rig.configure(CAMPAIGN, unit={"type": "GP-3", "serial": "0017"},
                          server={"page": "127.0.0.1:0", "remote": f"127.0.0.1:{port}", "certificate": os.path.join(keys, "server.crt"),
                                  "key": os.path.join(keys, "server.key"), "clients_ca": os.path.join(keys, "authority.crt")})
            rig.start_daemon()
            rig.wait_for(r.measuring, 30)
            for command in ("arm", "start"):
                rig.tool(command, "--by", "A. Person")
            check_live(checks, rig, keys, port)
            rig.last = rig.wait_for_state(("finished", "aborted", "tripped"), 300)
            checks.check(rig.last is not None and rig.last["campaign"]["state"] == "finished", "the campaign finishes",
                         r.state_of(rig.last) + rig.logs())
            rig.wait_for(lambda s: not s["recorder"].get("recording"), 60)
            recording = next(os.path.join(rig.results, name) for name in os.listdir(rig.results) if name.startswith("python-"))
            check_certificate(checks, rig, vibrig.open(recording))
            rig.stop()
            campaign = check_recording(checks, rig, recording)
            check_anew(checks, rig, recording)
            check_cycle_times(checks, campaign)
            check_octave(checks, rig, campaign)
            check_examples(checks, campaign)
        finally:
            rig.stop()
        crooked = os.path.join(folder, "crooked")
        os.mkdir(crooked)
        check_contradiction(checks, programs, crooked)
    return checks.end()


if __name__ == "__main__":
    sys.exit(main())
