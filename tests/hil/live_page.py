#!/usr/bin/python3
"""The status server of a whole vibrigd during a simulated campaign, by programs that are not ours: Chromium shows the
live page, Prometheus scrapes, jsonschema compares every answer with the OpenAPI description, promtool checks metrics,
alert rules and dashboard. Screenshots stay in build/tests/live-page for a person to look at.

usage: live_page.py PROGRAMS     environment: VIBRIG_BROWSER_NPM, the folder with playwright-core's node_modules
"""
import contextlib
import http.client
import json
import os
import random
import re
import shutil
import signal
import socket
import sqlite3
import ssl
import subprocess
import sys
import tempfile
import time
import urllib.parse

import jsonschema

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import rig as r  # noqa: E402

ROOT = os.path.realpath(os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", ".."))
SHOTS = os.path.join(ROOT, "build", "tests", "live-page")
# Table 1 of Tang et al. 2009.
POSITIONS = [[0, 0, 0], [0, 0, 45], [0, 0, 90], [0, 0, 180], [180, 0, 45], [45, 0, 0], [45, 0, 90], [90, 0, 90],
             [90, 0, 180], [180, 0, 270], [270, 0, 0], [270, 0, 90], [-45, 0, 0], [-45, 0, 90]]
CAMPAIGN = {"name": "live", "identify": "what-it-can", "positions_deg": POSITIONS,
            "table_g": [9.0, 7.0], "order": "sequential", "dwell_s": 20.0}
# Encoders that count the other way and from elsewhere, accelerometers that are off: the page has to know.
PLATFORM = {"encoder_sign": [1, -1, -1], "encoder_zero_deg": [10.0, 0.0, -25.0]}
ZERO_G = [0.02, -0.03, 0.01]
LARGEST_PAGE = 200_000  # bytes, all files together


class Page:
    """Chromium, driven line by line."""

    def __init__(self):
        driver = os.path.join(ROOT, "tests", "browser", "page_driver.mjs")
        self.process = subprocess.Popen(["node", driver], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
                                        preexec_fn=r.die_with_parent)

    def ask(self, command, **arguments):
        self.process.stdin.write(json.dumps({"command": command, **arguments}) + "\n")
        self.process.stdin.flush()
        line = self.process.stdout.readline()
        return json.loads(line) if line else {"error": "the browser is gone"}

    def until(self, script, timeout_s=20):
        return self.ask("until", script=script, timeout=1000 * timeout_s)

    def end(self):
        self.process.stdin.close()
        try:
            self.process.wait(10)
        except subprocess.TimeoutExpired:
            self.process.kill()


def get(address, path, headers=None, method="GET", body=None):
    where = urllib.parse.urlparse(address)
    connection = http.client.HTTPConnection(where.hostname, where.port, timeout=10)
    connection.request(method, path, body=body, headers=headers or {})
    answer = connection.getresponse()
    return answer.status, answer.getheader("Content-Type"), answer.read().decode()


def free_port():
    """For a program that cannot choose one itself: below those that the kernel gives out meanwhile."""
    while True:
        with socket.socket() as probe, contextlib.suppress(OSError):
            probe.bind(("127.0.0.1", random.randrange(20000, 32000)))
            return probe.getsockname()[1]


def check_accessible(checks, page, when):
    """WCAG 2.2 AA, contrast among it, by axe-core."""
    for name, width, height, scheme in (("wall", 1920, 1080, "dark"), ("desktop", 1400, 1000, "light"),
                                        ("phone", 390, 844, "light"), ("phone", 390, 844, "dark")):
        found = page.ask("axe", width=width, height=height, scheme=scheme)
        value = found.get("value") or {}
        checks.check(value.get("checked", 0) >= 10 and not value["violations"],
                     f"{when}, {name}, {scheme}: axe-core finds no breach of WCAG AA", "\n".join(value.get("violations", [str(found)])))


def check_whole(checks, page, what, height=None):
    """Nothing is cut off, and on the wall, `height` high, nothing below it."""
    cut = page.ask("evaluate", script="[...document.querySelectorAll('section, .scroll')].filter(e => e.scrollWidth > e.clientWidth + 2 || "
                   "(innerWidth > 1900 && e.scrollHeight > e.clientHeight + 2)).map(e => e.getAttribute('aria-labelledby'))").get("value")
    checks.equal(cut, [], f"{what}: nothing is cut off")
    if height is not None:
        tall = page.ask("evaluate", script="document.documentElement.scrollHeight").get("value", 10**6)
        checks.check(tall <= height, f"{what}: one screen, without scrolling", f"{tall} of {height} pixels")


def check_charts(checks, page, until):
    """Values under the pointer, and a part that is looked at stays while data come in."""
    page.ask("drag", selector="#c-amplitude .u-over", **{"from": .5})
    until("the pointer over a chart tells the values", "/min: .*measured [0-9.e-]+ g/.test(document.querySelector('#c-amplitude .read').textContent)")
    until("and those of the same moment beside it", "!document.querySelector('#c-temperature .read').hidden")
    ticks = "document.getElementById('c-amplitude').dataset.from"
    before = page.ask("evaluate", script=ticks).get("value")
    page.ask("drag", selector="#c-amplitude .u-over", **{"from": .5, "to": .8})
    until("a drag zooms", f"Number({ticks}) > Number('{before}') + 1")
    zoomed = page.ask("evaluate", script=ticks).get("value")
    time.sleep(2)
    checks.equal(page.ask("evaluate", script=ticks).get("value"), zoomed, "and stays while data come in")
    page.ask("evaluate", script="document.querySelector('#c-amplitude .u-over').dispatchEvent(new MouseEvent('dblclick', {bubbles: true}))")
    until("a double click shows all again", f"Number({ticks}) < 1")


def check_description(checks, rig, address):
    """Every path of the OpenAPI description answers as it says."""
    status, _, text = get(address, "/api/v1/openapi.json")
    checks.check(status == 200, "the OpenAPI description is served")
    api = json.loads(text)
    checks.check(api["openapi"].startswith("3.1"), "it is OpenAPI 3.1")

    def wrong(schema, value):
        validator = jsonschema.Draft202012Validator({**schema, "components": api["components"]})
        return "; ".join(f"{list(e.absolute_path)}: {e.message[:200]}" for e in validator.iter_errors(value))

    for path, methods in api["paths"].items():
        if "get" not in methods or "101" in methods["get"]["responses"]:
            continue
        status, kind, text = get(address, path)
        kinds = methods["get"]["responses"]["200" if status == 200 else "default"]["content"]
        found = next((s for k, s in kinds.items() if kind.startswith(k)), None)
        value = json.loads(text) if "json" in kind else text
        said = f"{status} {kind}" if found is None else wrong(found["schema"], value)
        checks.check(found is not None and not said, f"{path} answers as described ({status})", said)
    problem = api["components"]["schemas"]["Problem"]
    for path, method, headers, body, expected in [
            ("/nothing", "GET", {}, None, 404), ("/api/v1/status", "DELETE", {}, None, 405),
            ("/api/v1/events?after=x", "GET", {}, None, 400), ("/api/v1/history?chanel=measured_g", "GET", {}, None, 400),
            ("/api/v1/stream", "GET", {}, None, 426),
            ("/api/v1/status", "GET", {"Host": "evil.example:80"}, None, 421),
            ("/api/v1/status", "GET", {"Origin": "http://evil.example"}, None, 403),
            ("/api/v1/commands", "POST", {"Content-Type": "text/plain"}, "{}", 415),
            ("/api/v1/commands", "POST", {"Content-Type": "application/json"}, "[" * 5000, 400),
            ("/api/v1/commands", "POST", {"Content-Type": "application/json"}, '{"kind":"abort","by":"x"}', 403)]:
        status, kind, text = get(address, path, headers, method, body)
        good = status == expected and kind == "application/problem+json" and not wrong(problem, json.loads(text))
        checks.check(good, f"{method} {path} {json.dumps(headers)} is refused as a problem ({expected})", f"{status} {text[:300]}")


    with contextlib.closing(http.client.HTTPConnection("localhost", timeout=10)) as control:
        control.sock = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        control.sock.settimeout(10)
        control.sock.connect(rig.socket)
        control.request("POST", "/api/v1/commands", '{"kind":"abort","by":"x"}', {"Content-Type": "application/json"})
        answer = control.getresponse()
        text = answer.read().decode()
        said = wrong(api["paths"]["/api/v1/commands"]["post"]["responses"]["200"]["content"]["application/json"]["schema"], json.loads(text))
        checks.check(answer.status == 200 and not said, "a command that is taken is answered as described", f"{answer.status} {text} {said}")


def check_injection(checks, rig, address):
    """What a refused body says stays one line of the log and the events."""
    body = b'{"kind":"explode\n2026-01-01 faked \x1b[31m\xff","by":"x"}'
    status, _, _ = get(address, "/api/v1/commands", {"Content-Type": "application/json"}, "POST", body)
    checks.equal(status, 400, "a command with control characters is refused")
    # What protobuf says of a name quotes it.
    body = '{"kind":"start","by":"x","\\n2026-01-01 faked \\u001b[31m":1}'
    status, _, _ = get(address, "/api/v1/commands", {"Content-Type": "application/json"}, "POST", body)
    checks.equal(status, 400, "in a key, too")
    rig.wait_for(lambda s: rig.daemon.text().count("refused a command") >= 2, 10)
    logged = [line for line in rig.daemon.text().split("\n") if "refused a command" in line]
    logged += [line for line in rig.tool("events").stdout.split("\n") if "refused a command" in line]
    checks.check(len(logged) >= 4 and all(c.isprintable() for line in logged for c in line), "and logged in one clean line", str(logged))
    checks.check(not any(line.startswith("2026-01-01") for line in rig.daemon.text().split("\n")), "no line is faked", rig.logs())


def check_dashboards(checks, folder):
    """Against the schema that Grafana itself is built with."""
    def faults(*files):
        run = subprocess.run(["node", os.path.join(ROOT, "tests", "browser", "grafana_schema.mjs"), *files], capture_output=True, text=True)
        return run.returncode, run.stdout + run.stderr
    shipped = [os.path.join(ROOT, "systemd", "prometheus", name) for name in ("vibrig-dashboard.json", "vibrig-fleet-dashboard.json")]
    code, said = faults(*shipped)
    checks.check(code == 0 and said.startswith("2 dashboards"), "Grafana's own schema has nothing against the dashboards", said)
    with open(shipped[0], encoding="utf-8") as file:
        good = file.read()
    spoilt = []
    for what, spoil in {"absolutely": lambda d: d["panels"][1]["fieldConfig"]["defaults"].update(thresholds={"mode": "absolutely", "steps": []}),
                        "gridpos": lambda d: d["panels"][0].update(gridpos={}),
                        "graphmode": lambda d: d["panels"][2].setdefault("options", {}).update(graphmode="none"),
                        "graphh": lambda d: d["panels"][0].update(type="graphh"),
                        "schemaVersion": lambda d: d.update(schemaVersion="39")}.items():
        dashboard = json.loads(good)
        spoil(dashboard)
        spoilt.append((what, os.path.join(folder, what + "-dashboard.json")))
        with open(spoilt[-1][1], "w", encoding="utf-8") as file:
            json.dump(dashboard, file)
    code, said = faults(*(file for _, file in spoilt))
    for what, file in spoilt:
        checks.check(code == 1 and any(line.startswith(file) and what in line for line in said.splitlines()), f"a wrong one is found: {what}", said)


def check_prometheus(checks, address, folder, seen):
    """`seen`: the metrics while a campaign was recording."""
    _, _, text = get(address, "/metrics")
    run = subprocess.run(["promtool", "check", "metrics"], input=text, capture_output=True, text=True)
    checks.check(run.returncode == 0 and not run.stderr.strip(), "promtool check metrics has nothing to say", run.stderr + run.stdout)
    rules = os.path.join(ROOT, "systemd", "prometheus", "vibrig-alerts.yml")
    run = subprocess.run(["promtool", "check", "rules", rules], capture_output=True, text=True)
    checks.check(run.returncode == 0, "promtool check rules", run.stdout + run.stderr)
    tests = os.path.join(ROOT, "systemd", "prometheus", "vibrig-alerts-test.yml")
    run = subprocess.run(["promtool", "test", "rules", tests], capture_output=True, text=True)
    checks.check(run.returncode == 0, "promtool test rules", run.stdout + run.stderr)
    port = free_port()
    configuration = os.path.join(folder, "prometheus.yml")
    with open(configuration, "w", encoding="utf-8") as file:
        file.write(f"global: {{scrape_interval: 1s, evaluation_interval: 1s}}\nrule_files: ['{rules}']\nscrape_configs:\n"
                   f"  - job_name: vibrig\n    static_configs: [{{targets: ['{urllib.parse.urlparse(address).netloc}']}}]\n")
    server = r.Child("prometheus", ["prometheus", "--config.file=" + configuration, "--storage.tsdb.path=" + os.path.join(folder, "tsdb"),
                                    f"--web.listen-address=127.0.0.1:{port}"], folder)

    def query(expression):
        try:
            _, _, said = get(f"http://127.0.0.1:{port}", "/api/v1/query?" + urllib.parse.urlencode({"query": expression}))
            return json.loads(said)["data"]["result"]
        except (OSError, ValueError, KeyError):
            return []
    end = time.monotonic() + 30
    while time.monotonic() < end and len(query("rate(vibrig_samples_total[10s]) > 0")) == 0:
        time.sleep(0.5)
    checks.check(query("up{job='vibrig'} == 1"), "a real Prometheus scrapes it", server.text()[-2000:])
    checks.check(query("rate(vibrig_samples_total[10s]) > 0"), "and sees samples come in")
    panels = []
    for name in ("vibrig-dashboard.json", "vibrig-fleet-dashboard.json"):
        with open(os.path.join(ROOT, "systemd", "prometheus", name), encoding="utf-8") as file:
            panels += json.load(file)["panels"]
    known = {line.split()[2] for line in seen.splitlines() if line.startswith("# TYPE")}
    known |= {name + part for name in known for part in ("_bucket", "_sum", "_count")}
    used = [target["expr"] for panel in panels for target in panel.get("targets", [])]
    with open(rules, encoding="utf-8") as file:
        used += re.findall(r"expr: (.*)", file.read())
    # That one is there with a broker only: tests/hil/mqtt.py.
    missing = {name for text in used for name in re.findall(r"\bvibrig_\w+", text)} - known - {"vibrig_mqtt_up", "vibrig_annunciator_confirms", "vibrig_guard_up", "vibrig_guard_finding"}
    checks.check(used and not missing, "every metric of the Grafana dashboard and the alert rules is there", str(sorted(missing)))
    server.end()


def check_remote(checks, rig, address, folder):
    """Every command with every certificate, by the tool that people use."""
    pki = os.path.join(folder, "pki")
    follower = r.Child("follower", [rig.program("vibrig"), "events", "--follow", "--host", urllib.parse.urlparse(address).netloc,
                                    "--identity", os.path.join(pki, "bob")], folder)
    expected = {"ada": 1, "wall": 1}  # resume without a campaign: refused by the campaign, by the role
    for name, code in expected.items():
        tool = rig.program("vibrig")
        host = urllib.parse.urlparse(address).netloc
        run = subprocess.run([tool, "status", "--json", "--host", host, "--identity", os.path.join(pki, name)],
                             capture_output=True, text=True, timeout=30)
        checks.check(run.returncode == 0 and '"version"' in run.stdout, f"{name} reads the status over TLS", run.stderr)
        run = subprocess.run([tool, "resume", "--by", name, "--host", host, "--identity", os.path.join(pki, name)],
                             capture_output=True, text=True, timeout=30)
        checks.check(run.returncode == code, f"{name} commands over TLS: exit code {code}", f"{run.returncode} {run.stderr}")
    # Python's own TLS: no certificate, and a version that is too old.
    port = int(address.rsplit(":", 1)[1])
    for what, version, certificate in (("without a certificate", None, None), ("in TLS 1.1", ssl.TLSVersion.TLSv1_1, "ada"),
                                       ("in TLS 1.2 with one", ssl.TLSVersion.TLSv1_2, "ada")):
        context = ssl.create_default_context(cafile=os.path.join(pki, "authority.crt"))
        if version is not None:
            context.set_ciphers("ALL:@SECLEVEL=0")
            context.minimum_version = context.maximum_version = version
        if certificate:
            context.load_cert_chain(os.path.join(pki, certificate + ".crt"), os.path.join(pki, certificate + ".key"))
        try:
            connection = http.client.HTTPSConnection("127.0.0.1", port, context=context, timeout=10)
            connection.request("GET", "/api/v1/status")
            said = connection.getresponse().status
        except (OSError, http.client.HTTPException) as error:
            said = type(error).__name__
        checks.check((said == 200) == (what == "in TLS 1.2 with one"), f"{what}: {'answered' if said == 200 else 'refused'}", str(said))
    checks.check(follower.says("certificate wall, viewer", 20), "events are followed over TLS", follower.text())
    follower.end()
    checks.check("certificate wall, viewer" in rig.tool("events").stdout, "a refused command is in the events with its certificate")


def start_campaign(checks, rig, what):
    rig.wait_for(lambda s: r.measuring(s) and s["shaker"].get("state") == 0 and
                 s["platform"].get("ready") and not s["shaker"].get("emergency_stop_open"), 60)
    for _ in range(100):   # the daemon waits for its first readings
        armed = rig.tool("arm", "--by", "page test")
        # At sixty times a rig's speed 20 ms of a busy machine are a stop that was not obeyed in time.
        if "acknowledge it first" in armed.stderr:
            rig.tool("ack", "trip", "--by", "page test")
        if armed.returncode == 0:
            break
        time.sleep(0.2)
    started = rig.tool("start", "--by", "page test")
    checks.check(started.returncode == 0, what, armed.stderr + started.stderr + rig.logs())


def check_second_cause(checks, rig, page, until):
    """Tripped, and then somebody presses the emergency stop: two latches, one acknowledgement, still one screen."""
    acknowledge(rig)
    start_campaign(checks, rig, "a campaign starts that will have two causes")
    page.until("document.getElementById('state').textContent === 'recording'", 60)
    rig.order("fault amplitude-scaled=0.5")
    until("the first cause is shown", "document.getElementById('state').textContent === 'tripped'", 30)
    rig.order("clear amplitude-scaled")
    rig.order("estop open")
    until("a trip with two causes says both", "/commanded.*; emergency-stop chain open/.test(document.getElementById('next-what').textContent)", 30)
    until("and one acknowledgement for them", "/Mend the causes.*Close the emergency-stop chain.*vibrig ack trip/.test(document.getElementById('next-steps').textContent)")
    page.ask("shot", file=os.path.join(SHOTS, "two-causes-wall.png"), width=1920, height=1080, scheme="dark")
    check_whole(checks, page, "wall, two causes", 1080)
    rig.order("estop close")
    rig.wait_for(lambda s: s["shaker"].get("emergency_stop_open") is False, 30)


def acknowledge(rig):
    for _ in range(100):
        if rig.tool("ack", "trip", "--by", "page test").returncode == 0:
            break
        time.sleep(0.2)
    rig.tool("abort", "--by", "page test")   # a stop written at rest clears the controller's fault


def check_stop(checks, rig, page, until, remote, pki):
    """The stop over TLS: not for a viewer, at once for an operator, not for one whose certificate is revoked."""
    state = "document.getElementById('state').textContent"
    acknowledge(rig)
    start_campaign(checks, rig, "one more campaign starts")
    rig.order("speed 5")   # it is stopped before it ends

    def come_as(name):
        page.ask("as", origin=remote, certPath=os.path.join(pki, name + ".crt"), keyPath=os.path.join(pki, name + ".key"))
        page.ask("open", url=remote)
        until(f"{name} sees the page over TLS", "!document.body.classList.contains('waiting')", 30)
    come_as("wall")
    until("a viewer's stop is off", "document.getElementById('stop').disabled && /Read-only/.test(document.getElementById('stop-note').textContent)")
    said = page.ask("evaluate", script="fetch('/api/v1/commands', {method: 'POST', headers: {'Content-Type': 'application/json'}, "
                    "body: JSON.stringify({kind: 'abort', by: 'wall'})}).then(r => r.status)").get("value")
    checks.equal(said, 403, "and refused by the daemon")
    checks.check(rig.status()["campaign"]["state"] not in ("aborted", "idle"), "the campaign goes on", r.state_of(rig.status()))
    come_as("ada")
    until("an operator's stop is on", "!document.getElementById('stop').disabled")
    page.ask("shot", file=os.path.join(SHOTS, "operator.png"), width=1400, height=1000, scheme="light")
    answer = page.ask("click", selector="#stop")
    checks.check("error" not in answer, "it takes a click", str(answer))
    until("and no more: the campaign is aborted", state + " === 'aborted'")
    until("nothing complains", "!/NOT ACCEPTED/.test(document.getElementById('stop-note').textContent)")
    rig.order("speed 60")
    events = rig.tool("events").stdout
    checks.check("live page (certificate ada, operator, from 127.0.0.1)" in events, "who stopped it is in the events", events[-1500:])
    with contextlib.closing(sqlite3.connect(os.path.join(rig.results, "journal.sqlite3"))) as journal:
        for what, query, words in (
                ("what an operator commanded", "SELECT * FROM command", "live page (certificate ada, operator, from 127.0.0.1)"),
                ("what a viewer was refused", "SELECT * FROM event", "refused abort by wall (certificate wall, viewer, from 127.0.0.1)")):
            end = time.monotonic() + 10
            rows = []
            while not rows and time.monotonic() < end:   # the journal is written behind
                rows = [row for row in journal.execute(query) if any(words in str(cell) for cell in row)]
                time.sleep(0.1)
            checks.check(rows, f"{what} is in the journal, with who, when and outcome: {rows[-1] if rows else ''}")
    shutil.copy(os.path.join(pki, "ada.crt"), os.path.join(pki, "gone.crt"))
    shutil.copy(os.path.join(pki, "ada.key"), os.path.join(pki, "gone.key"))
    run = subprocess.run([rig.program("vibrig"), "pki", "revoke", "--folder", pki, "ada"], capture_output=True, text=True)
    checks.check(run.returncode == 0, "vibrig pki revoke", run.stderr)
    # Its text stays when it is hidden, from before the page was connected.
    until("her page is cut off at once", "!document.getElementById('alert').hidden && "
          "document.getElementById('alert').textContent.startsWith('LINK LOST')", 30)
    host = urllib.parse.urlparse(remote).netloc
    for name, code in (("gone", 2), ("bob", 1)):
        run = subprocess.run([rig.program("vibrig"), "resume", "--by", name, "--host", host, "--identity", os.path.join(pki, name)],
                             capture_output=True, text=True, timeout=30)
        checks.equal(run.returncode, code, f"revoked: {name} {'is not let in' if code == 2 else 'still is let in'}")
    for arguments, words in ((["nobody"], "nobody"), (["gone"], "revoked already"), (["authority"], "cannot revoke itself")):
        run = subprocess.run([rig.program("vibrig"), "pki", "revoke", "--folder", pki, *arguments], capture_output=True, text=True)
        checks.check(run.returncode == 2 and words in run.stderr, f"vibrig pki revoke {arguments[0]} is refused", run.stderr)
    run = subprocess.run([rig.program("vibrig"), "pki", "init", "--folder", pki, "--operator", "ada"], capture_output=True, text=True)
    checks.check(run.returncode == 0, "the same name gets a new certificate", run.stderr)
    run = subprocess.run([rig.program("vibrig"), "status", "--host", host, "--identity", os.path.join(pki, "ada")],
                         capture_output=True, text=True, timeout=30)
    checks.equal(run.returncode, 0, "and is let in with it")


def check_page(checks, rig, page, address, remote, pki):
    def until(what, script, timeout_s=20):
        answer = page.until(script, timeout_s)
        checks.check(answer.get("value") is True, what, str(answer) + "\n" + rig.logs(8))
    state = "document.getElementById('state').textContent"
    page.ask("open", url=address)
    until("the page loads and shows a state", state + " === 'idle'")
    size = page.ask("evaluate", script="performance.getEntriesByType('resource').concat(performance.getEntriesByType('navigation'))"
                    ".filter(e => !e.name.includes('/api/')).reduce((n, e) => n + e.decodedBodySize, 0)").get("value", 0)
    checks.check(0 < size < LARGEST_PAGE, f"it is smaller than {LARGEST_PAGE} bytes", f"{size} bytes")
    until("single values stand in the lines of their table", "['samples', 'dropped', 'vibration'].every((line, i) => "
          "[...document.querySelectorAll('#links dt')].some(e => e.textContent === line && "
          "[/^\\d+ taken/, /kernel \\d+, .*ring \\d+/, /newest dwell [0-9.–]+ g, [0-9.–]+ Hz/][i].test(e.nextSibling.textContent)))")
    checks.check(page.ask("evaluate", script="document.getElementById('stop').disabled").get("value") is True,
                 "on plain HTTP nobody can stop the rig")
    checks.check("Not the emergency stop" in page.ask("text", selector="#stop-note").get("value", ""),
                 "the stop says that it is not the emergency stop")
    start_campaign(checks, rig, "the campaign starts")
    until("the page follows the campaign live", state + " === 'recording'", 60)
    until("its progress grows", "document.getElementById('progress').value > 20", 60)
    until("coefficients with sigma are shown", "document.querySelectorAll('#coefficients td small').length >= 10")
    until("positions done are marked", "document.querySelectorAll('#stops li.done').length >= 1")
    until("charts are drawn", "document.querySelectorAll('.chart canvas').length === 6")
    until("events are listed", "document.querySelectorAll('#events li').length > 3")
    checks.check(page.ask("names").get("value") == [], "everything has a name for a screen reader", str(page.ask("names")))
    page.ask("press", key="Tab")
    checks.check(page.ask("evaluate", script="document.activeElement.className").get("value") == "skip",
                 "the keyboard reaches the page's first link")
    page.ask("evaluate", script="document.activeElement.blur()")
    until("measured points are in the Allan plot", "document.getElementById('c-allan').dataset.points >= 6", 60)
    until("and the classical deviation beside them", "Number(document.getElementById('c-allan').dataset.classical) >= 6", 60)
    until("the dynamic surface has a column for each dwell judged", "Number(document.getElementById('surface').dataset.dwells) === "
          "document.getElementById('surface').width && document.getElementById('surface').width >= 3", 60)
    until("and what is above the expected is red, below it blue", "(() => { const c = document.getElementById('surface'), "
          "d = c.getContext('2d').getImageData(0, 0, c.width, c.height).data; let red = 0, blue = 0; for (let i = 0; i < d.length; i += 4) "
          "{ red += d[i + 3] && d[i] > d[i + 2]; blue += d[i + 3] && d[i + 2] > d[i]; } return red > 5 && blue > 5; })()")
    until("the picture knows the encoders' signs and zeros: force and vertical are one line",
          "/off the vertical0\\.[0-9] °/.test(document.getElementById('angles').textContent.replace('-', ''))")
    until("interlocks show a value and a limit", "[...document.querySelectorAll('#interlock li')].some(li => /^[0-9.]+ \\/ [0-9.]+ dB$/.test(li.children[1].textContent))")
    checks.check("accelerometer x" in page.ask("text", selector="#channels").get("value", ""), "names are for people")
    checks.check(page.ask("evaluate", script="document.getElementById('simulated').offsetWidth > 0").get("value") is True,
                 "a simulated rig is called one")
    for _ in range(20):   # whatever the campaign has come to on a busy machine
        page.ask("open", url=address)
        if page.until("document.getElementById('c-amplitude').dataset.past > 20", 3).get("value"):
            break
    until("a page that is loaded again shows the campaign from its beginning", "document.getElementById('c-amplitude').dataset.past > 20")
    for name, width, height in (("wall", 1920, 1080), ("desktop", 1400, 1000), ("phone", 390, 844)):
        for scheme in ("light", "dark"):
            file = os.path.join(SHOTS, f"recording-{name}-{scheme}.png")
            wide = page.ask("shot", file=file, width=width, height=height, scheme=scheme).get("value", 10**6)
            checks.check(wide <= width, f"{name}, {scheme}: no wider than the screen", f"{wide} of {width} pixels")
            check_whole(checks, page, f"{name}, {scheme}", height if name == "wall" else None)
    check_charts(checks, page, until)
    until("the dwells' residual drift is drawn", "document.getElementById('c-residuals').dataset.points >= 12", 60)
    check_accessible(checks, page, "while it records")
    seen = get(address, "/metrics")[2]
    rig.daemon.process.send_signal(signal.SIGSTOP)
    until("data that no longer come are said to be stale", "document.getElementById('alert').textContent.startsWith('STALE')")
    page.ask("shot", file=os.path.join(SHOTS, "stale.png"), width=1400, height=1000, scheme="dark")
    rig.daemon.process.send_signal(signal.SIGCONT)
    until("and fresh again when they come again", "document.getElementById('alert').hidden")
    rig.daemon.end()
    until("a lost link is said loudly", "!document.getElementById('alert').hidden && document.getElementById('alert').textContent.startsWith('LINK LOST')")
    page.ask("shot", file=os.path.join(SHOTS, "link-lost.png"), width=1400, height=1000, scheme="light")
    coloured = page.ask("evaluate", script="['main', '#strip', '.where', '.doing'].filter(e => "
                        "getComputedStyle(document.querySelector(e)).filter !== 'grayscale(1)')").get("value")
    checks.equal(coloured, [], "and nothing old has the colours that judge it")
    check_accessible(checks, page, "while the link is lost")
    rig.start_daemon()
    until("the page finds the restarted daemon by itself", "document.getElementById('alert').hidden && " + state + " !== 'recording'", 40)
    start_campaign(checks, rig, "another campaign starts")
    until("the page follows it", "['ramping', 'settling', 'recording'].includes(" + state + ")", 60)
    page.ask("click", selector="#sound")
    until("a click makes it audible", "document.getElementById('sound').dataset.played === 'alarm'")
    rig.order("estop open")
    until("a trip is shown", state + " === 'tripped' && document.querySelector('header').className === 'bad'", 30)
    until("with its reason", "/emergency/i.test(document.getElementById('reason').textContent)")
    until("a trip has a sound of its own", "/abort/.test(document.getElementById('sound').dataset.played)")
    until("it says what to do next", "!document.getElementById('next').hidden && /Close the emergency-stop chain.*vibrig ack.*selftest.*vibrig arm/"
          ".test(document.getElementById('next-steps').textContent)")
    until("the position that was interrupted is not done, and no time is left", "document.querySelectorAll('#stops li.cut.now').length === 1 && "
          "!document.querySelector('#stops li.cut').classList.contains('done') && /interrupted$/.test(document.getElementById('left').textContent)")
    checks.equal(rig.status()["campaign"].get("remaining_s", 0), 0, "nor in the status")
    check_accessible(checks, page, "after a trip")
    page.ask("shot", file=os.path.join(SHOTS, "tripped-wall.png"), width=1920, height=1080, scheme="dark")
    check_whole(checks, page, "wall, after a trip", 1080)
    room = page.ask("evaluate", script="document.getElementById('events').clientHeight").get("value", 0)
    checks.check(room > 150, "and the events have room", f"{room} pixels")
    page.ask("shot", file=os.path.join(SHOTS, "tripped-desktop.png"), width=1400, height=1000, scheme="light")
    page.ask("shot", file=os.path.join(SHOTS, "tripped-phone.png"), width=390, height=844, scheme="dark")
    rig.order("estop close")
    rig.wait_for(lambda s: s["shaker"].get("emergency_stop_open") is False, 30)
    check_second_cause(checks, rig, page, until)
    check_stop(checks, rig, page, until, remote, pki)
    # What the browser says of a connection that was cut, and of a command refused, is no error of the page's.
    errors = [e for e in page.ask("errors").get("value", ["?"]) if not any(known in e for known in ("WebSocket", "ERR_", "403"))]
    checks.check(errors == [], "no error in the browser's console", str(errors))
    return seen


def check_commissioning(checks, programs, folder):
    """Somebody commissions a rig: the page shows what `vibrig commission status` says, read-only."""
    rig, page = r.Rig(programs, "seqpacket", "rig", folder, poll_s=0.1), None
    try:
        rig.start_plant("--warm-up", "1", "--start-temperature", "45", "--speed", "5")
        rig.configure(CAMPAIGN, server={"page": f"127.0.0.1:{free_port()}"})
        rig.start_daemon()
        rig.wait_for(lambda s: s["platform"].get("ready") and s["shaker"].get("rest") == "at rest", 60)
        address, page = rig.page_address(), Page()
        page.ask("open", url=address)
        dialogue = subprocess.Popen([rig.program("vibrig"), "commission", "--by", "Ada", "--socket", rig.socket], stdin=subprocess.PIPE,
                                    stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, preexec_fn=r.die_with_parent)
        shown = page.until("document.getElementById('state').textContent === 'commissioning' && "
                           "document.getElementById('reason').textContent.includes('power stage off?')")
        checks.check(shown.get("value") is True, "the page shows that a rig is commissioned, and what is asked", str(shown) + rig.logs(8))
        page.ask("shot", file=os.path.join(SHOTS, "commissioning.png"), width=1400, height=1000, scheme="light")
        check_whole(checks, page, "a rig that is commissioned")
        reason = page.ask("text", selector="#reason").get("value", "")
        said = rig.tool("commission", "status").stdout.replace("\n   ", " ").splitlines()
        checks.check(reason.startswith("Ada") and ", step A, 0 positions, 0 free drifts; asked: " in reason and "now: " + reason in said,
                     "the same as `vibrig commission status` says", [reason, said])
        checks.equal(page.ask("text", selector="#position").get("value"), "step A, 0 positions, 0 free drifts", "its step stands where positions do")
        checks.check(page.ask("text", selector="#left").get("value") == "" and page.ask("text", selector="#stops").get("value") == "",
                     "no share of a campaign and no plan of it are shown")
        for body in ({"do": "answer", "id": "power", "value": "yes"}, {"do": "end"}):
            status, _, _ = get(address, "/api/v1/commands", {"Content-Type": "application/json"}, "POST",
                               json.dumps({"kind": "commission", "by": "Ada", "argument": json.dumps(body)}))
            checks.check(status >= 400, f"the page's door takes no {body['do']}", status)
        checks.equal(rig.status()["campaign"]["state"], "commissioning", "and nothing has changed by it")
        checks.equal(page.ask("errors").get("value"), [], "the page has no errors")
        dialogue.communicate(timeout=20)   # nobody answers any more: it ends
    finally:
        if page is not None:
            page.end()
        rig.stop()


def main():
    programs = r.programs_from_command_line(__doc__)
    checks = r.Checks()
    os.makedirs(SHOTS, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix="vibrig-page-") as folder:
        rig = r.Rig(programs, "seqpacket", "rig", folder, poll_s=0.1)
        pki = os.path.join(folder, "pki")
        run = subprocess.run([rig.program("vibrig"), "pki", "init", "--folder", pki, "--host", "127.0.0.1", "--operator", "ada", "--operator", "bob",
                              "--operator", "old", "--viewer", "wall"], capture_output=True, text=True)
        checks.check(run.returncode == 0, "vibrig pki init makes certificates", run.stderr)
        run = subprocess.run([rig.program("vibrig"), "pki", "revoke", "--folder", pki, "old"], capture_output=True, text=True)
        checks.check(run.returncode == 0, "vibrig pki revoke makes a list", run.stderr)
        truth = rig.truth_file({"platform": PLATFORM, "accelerometer": {"zero_g": ZERO_G}})
        page = None
        try:
            rig.start_plant("--truth", truth, "--speed", "60", "--warm-up", "1")
            remote = f"127.0.0.1:{free_port()}"
            rig.configure(CAMPAIGN, server={"page": f"127.0.0.1:{free_port()}", "remote": remote,
                                            "status_socket": os.path.join(folder, "status.sock"),
                                            "certificate": os.path.join(pki, "server.crt"), "key": os.path.join(pki, "server.key"),
                                            "clients_ca": os.path.join(pki, "authority.crt"),
                                            "revoked": os.path.join(pki, "revoked.crl")},
                          platform=PLATFORM, accelerometer={"zero_g": ZERO_G})
            rig.start_daemon()
            address = rig.page_address()
            rig.wait_for(r.measuring, 30)
            check_description(checks, rig, address)
            check_injection(checks, rig, address)
            check_remote(checks, rig, "https://" + remote, folder)
            page = Page()
            seen = check_page(checks, rig, page, address, "https://" + remote, pki)
            check_prometheus(checks, address, folder, seen)
            check_dashboards(checks, folder)
        finally:
            if page is not None:
                page.end()
            rig.stop()
    with tempfile.TemporaryDirectory(prefix="vibrig-page-") as folder:
        check_commissioning(checks, programs, folder)
    return checks.end()


if __name__ == "__main__":
    sys.exit(main())
