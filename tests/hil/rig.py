"""The simulated rig and the daemon as processes, for campaigns driven from a test; and the checks, as TAP."""
import contextlib
import ctypes
import glob
import hashlib
import json
import os
import re
import signal
import socket
import sqlite3
import subprocess
import sys
import tempfile
import time
import xml.etree.ElementTree

PR_SET_PDEATHSIG = 1
# On a busy machine real time is late: for tests on the real clock that are not about deadlines.
PATIENT = {"can": {"stale_deadline_ms": 10000}, "gimbal": {"status_deadline_ms": 10000},
           "shaker": {"response_timeout_ms": 5000, "watchdog_period_ms": 1000}}

# In virtual time nobody is late, and a machine of one processor wakes a thread that comes first for every frame instead of every
# sample. With its priorities the daemon runs in package_test.py.
NO_PRIORITY = {"acquisition_priority": 0, "estimator_priority": 0}

# Of a truth: gimbals that slew in a second or two. At 5 deg/s a campaign of short dwells takes most of its time to turn them.
QUICK = {"platform": {"slew_deg_per_s": 60}}


class Checks:
    """Numbers the checks and prints each as it comes: 'ok N - text' or 'not ok N - text'."""

    def __init__(self):
        self.count = self.failed = 0

    def check(self, good, text, found=""):
        self.count += 1
        self.failed += not good
        print(f"{'ok' if good else 'not ok'} {self.count} - {text}", flush=True)
        if not good and found != "":
            self.note(found)
        return bool(good)

    def equal(self, found, expected, text):
        return self.check(found == expected, text, f"found {found!r}, expected {expected!r}")

    def skip(self, text, why):
        self.count += 1
        print(f"ok {self.count} - {text} # SKIP {why}", flush=True)

    def note(self, text):
        for line in str(text).splitlines():
            print(f"# {line}", flush=True)

    def adopt(self, text):
        """The checks of another script, from its output, which has to end with its plan."""
        seen, planned = 0, None
        for line in text.splitlines():
            check = re.match(r"(ok|not ok) \d+ - (.*)", line)
            plan = re.match(r"1\.\.(\d+)$", line)
            if check:
                seen += 1
                self.check(check[1] == "ok", check[2])
            elif plan:
                planned = int(plan[1])
            else:
                self.note(line.removeprefix("# "))
        if planned != seen:
            self.check(False, "a script runs to its end", f"{seen} checks of {planned}")

    def gtest(self, program, timeout, environment=None):
        """One check per test of a GoogleTest program."""
        with tempfile.TemporaryDirectory() as folder:
            report = os.path.join(folder, "report.xml")
            run = subprocess.run([program, f"--gtest_output=xml:{report}"], timeout=timeout, capture_output=True,
                                 text=True, errors="replace", env={**os.environ, **(environment or {})})
            try:
                cases = list(xml.etree.ElementTree.parse(report).getroot().iter("testcase"))
            except (OSError, xml.etree.ElementTree.ParseError) as error:
                self.check(False, f"{os.path.basename(program)} runs to its end", f"{error}\n{run.stdout}{run.stderr}")
                return
        for line in run.stdout.splitlines():
            if line.startswith("# "):
                self.note(line[2:])
        for case in cases:
            name = f"{case.get('classname')}.{case.get('name')}"
            skipped = case.find("skipped")
            if case.get("status") == "notrun" or skipped is not None:
                self.skip(name, skipped.get("message", "").replace("\n", " ") if skipped is not None else "disabled")
            else:
                self.check(case.find("failure") is None, name,
                           "\n".join(failure.get("message", "") for failure in case.iter("failure")))
        self.check(run.returncode == 0 or any(c.find("failure") is not None for c in cases),
                   f"{os.path.basename(program)} exits cleanly", f"status {run.returncode}\n{run.stderr[-2000:]}")

    def end(self):
        print(f"1..{self.count}", flush=True)
        return 1 if self.failed else 0


def toml_value(value):
    if isinstance(value, bool):
        return "true" if value else "false"
    return json.dumps(value)


def toml(tables):
    lines = []
    for table, keys in tables.items():
        lines.append(f"[{table}]")
        lines += [f"{key} = {toml_value(value)}" for key, value in keys.items()]
    return "\n".join(lines) + "\n"


class Child:
    """A process whose output goes to a file; it dies with this one."""

    def __init__(self, name, argv, folder, environment=None):
        self.name, self.log = name, os.path.join(folder, name + ".log")
        with open(self.log, "ab") as log:
            self.process = subprocess.Popen(argv, stdin=subprocess.DEVNULL, stdout=log, stderr=subprocess.STDOUT,
                                            env={**os.environ, **(environment or {})}, preexec_fn=die_with_parent)

    def running(self):
        return self.process.poll() is None

    def end(self, number=signal.SIGTERM, timeout=20):
        """Exit status; None if it had to be killed."""
        if self.running():
            self.process.send_signal(number)
        try:
            return self.process.wait(timeout)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
            return None

    def text(self):
        with open(self.log, encoding="utf-8", errors="replace") as log:
            return log.read()

    def says(self, words, timeout_s=10):
        """Whether it has said so, or does within `timeout_s`: the log is written by a thread of its own, behind what is logged."""
        end = time.monotonic() + timeout_s
        while words not in self.text():
            if time.monotonic() > end:
                return False
            time.sleep(0.05)
        return True


def die_with_parent(number=signal.SIGKILL):
    ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, number)


class Rig:
    """vibrig-plant and vibrigd in one temporary folder. `bus`: "vcan0", or "seqpacket". The plant starts first."""

    def __init__(self, programs, bus, clock, folder, poll_s=0.25):
        self.programs, self.bus, self.clock, self.folder, self.poll_s = programs, bus, clock, folder, poll_s
        self.modbus_port = None
        self.path = os.path.join(folder, "bus.sock")
        self.socket = os.path.join(folder, "vibrigd.sock")
        self.results = os.path.join(folder, "results")
        self.configuration = os.path.join(folder, "vibrigd.toml")
        self.control = os.path.join(folder, "control")
        self.plant = self.daemon = self.tools = None
        os.makedirs(self.results, exist_ok=True)

    def program(self, name):
        return os.path.join(self.tools if self.tools and name == "vibrig" else self.programs, name)

    def configure(self, campaign, **tables):
        can = {"port": "seqpacket", "path": self.path} if self.bus == "seqpacket" else {"interface": self.bus}
        everything = {"campaign": {"results": self.results, **campaign}, "can": can,
                      "clock": {"source": self.clock}, "server": {"socket": self.socket},
                      "shaker": {"host": "127.0.0.1", "port": self.modbus_port}}
        if self.clock == "real":
            everything["commission"] = {"simulated": True}
        for table, keys in tables.items():
            everything.setdefault(table, {}).update(keys)
        with open(self.configuration, "w", encoding="utf-8") as file:
            file.write(toml(everything))

    def truth_file(self, changes):
        """The rig's own truth with some keys changed."""
        path = os.path.join(self.folder, "truth.json")
        subprocess.run([self.program("vibrig-plant"), "run", "--can", "seqpacket:" + os.path.join(self.folder, "t"),
                        "--modbus", "tcp:127.0.0.1:0", "--clock", "real", "--duration", "0", "--write-truth", path],
                       check=True, capture_output=True, timeout=30)
        with open(path, encoding="utf-8") as file:
            truth = json.load(file)
        for section, keys in changes.items():
            truth[section].update(keys)
        with open(path, "w", encoding="utf-8") as file:
            json.dump(truth, file)
        return path

    def start_plant(self, *more):
        bus = "seqpacket:" + self.path if self.bus == "seqpacket" else self.bus
        ready = os.path.join(self.folder, "plant.json")
        self.plant = Child("plant", [self.program("vibrig-plant"), "run", "--can", bus, "--modbus", "tcp:127.0.0.1:0",
                                     "--clock", self.clock, "--control", self.control, "--ready-file", ready, *more], self.folder)
        while self.plant.running() and not os.path.exists(ready):
            time.sleep(0.05)
        if not self.plant.running():
            raise RuntimeError("vibrig-plant did not start: " + self.plant.text())
        with open(ready, encoding="utf-8") as file:
            self.modbus_port = json.load(file)["modbus_port"]

    def arm(self, by="tester", timeout_s=60):
        """On a busy machine the rig catches up, and is too fast for a while, and rest is measured late: that is waited for, and nothing else."""
        end = time.monotonic() + timeout_s
        armed = self.tool("arm", "--by", by)
        while armed.returncode != 0 and re.search("samples/s measured|rest is not measured yet", armed.stderr) and time.monotonic() < end:
            time.sleep(0.5)
            armed = self.tool("arm", "--by", by)
        return armed

    def acknowledge(self, what="trip", by="tester", timeout_s=30):
        """Once rest is measured, by accelerometers that are seen to live after an end while armed: that is waited for."""
        end = time.monotonic() + timeout_s
        said = self.tool("ack", what, "--by", by)
        while said.returncode != 0 and "a stop is under way" in said.stderr and time.monotonic() < end:
            time.sleep(0.2)
            said = self.tool("ack", what, "--by", by)
        return said

    def order(self, line, timeout_s=10):
        """Given to the plant, and done when this returns: its answer."""
        known = len(self.plant.text())
        with open(self.control, "w", encoding="ascii") as control:
            print(line, file=control)
        end = time.monotonic() + timeout_s
        while time.monotonic() < end and self.plant.running():
            # Whole lines; another process may have given an order, too.
            answers = self.plant.text()[known:].split("\n")[:-1]
            for answer in answers:
                if answer == f"ok {line}" or (line == "status" and answer.startswith("ok time ")):
                    return answer
            if any(answer.startswith("error: ") for answer in answers):
                break
            time.sleep(0.005)
        raise RuntimeError(f"vibrig-plant, asked to {line}: {self.plant.text()[known:]}")

    def be_punctual(self):
        """In real time a rig comes first, whatever else the machine does: a late frame would be taken for a fault of the
        rig. Whether this user may do that."""
        return subprocess.run(["chrt", "-a", "-f", "-p", "20", str(self.plant.process.pid)], stdin=subprocess.DEVNULL,
                              capture_output=True, check=False).returncode == 0

    def page_address(self, timeout_s=30, after=0):
        """As the daemon's log says, behind so many characters of it: it is written behind what is logged."""
        end = time.monotonic() + timeout_s
        while time.monotonic() < end:
            said = re.findall(r"live page: (\S+)\s", self.daemon.text()[after:])
            if said:
                return said[-1]
            time.sleep(0.1)
        raise RuntimeError("vibrigd names no page:\n" + self.logs())

    def start_daemon(self):
        self.daemon = Child("vibrigd", [self.program("vibrigd"), "--config", self.configuration], self.folder)

    def tool(self, *arguments, timeout=180, late_disk=True):
        """`late_disk`: an arming that a busy machine's disk has not written in its time is asked for again."""
        for tries_left in reversed(range(5 if late_disk and arguments[0] == "arm" else 1)):
            run = subprocess.run([self.program("vibrig"), *arguments, "--socket", self.socket], stdin=subprocess.DEVNULL,
                                 capture_output=True, text=True, timeout=timeout)
            if run.returncode == 0 or "the disk does not answer" not in run.stderr or not tries_left:
                return run
            time.sleep(1)

    def ask(self, path, body=None):
        """The daemon's own interface; None while it does not answer."""
        text = b"" if body is None else json.dumps(body).encode()
        try:
            with socket.socket(socket.AF_UNIX) as link_:
                link_.settimeout(10)
                link_.connect(self.socket)
                link_.sendall(f"{'GET' if body is None else 'POST'} {path} HTTP/1.1\r\nHost: rig\r\nConnection: close\r\n"
                              f"Content-Type: application/json\r\nContent-Length: {len(text)}\r\n\r\n".encode() + text)
                answer = b""
                while more := link_.recv(65536):
                    answer += more
            return json.loads(answer.partition(b"\r\n\r\n")[2])
        except (OSError, ValueError):
            return None

    def status(self):
        """The status as a dictionary; None while the daemon does not answer. `vibrig status` says the same, and to start it for each
        look takes a fifth of what a campaign takes."""
        status = self.ask("/api/v1/status")
        return status if status is not None and "campaign" in status else None   # or why not

    def wait_for(self, condition, timeout_s):
        """The first status that fulfils the condition; else the last one. The clock is the one all processes see."""
        end, status = time.monotonic() + timeout_s, None
        while time.monotonic() < end:
            if self.daemon is not None and not self.daemon.running():
                return status
            status = self.status() or status
            if status is not None and condition(status):
                return status
            time.sleep(self.poll_s)
        return status

    def wait_for_state(self, wanted, timeout_s):
        return self.wait_for(lambda s: s["campaign"]["state"] in wanted, timeout_s)

    def result(self):
        """result.json of the campaign, wherever below the results folder; its bytes."""
        for folder, _, names in os.walk(self.results):
            if "result.json" in names:
                with open(os.path.join(folder, "result.json"), "rb") as file:
                    return os.path.join(folder, "result.json"), file.read()
        return None, b""

    def positions_done(self):
        """As the journal says, read by another program."""
        path = os.path.join(self.results, "journal.sqlite3")
        with contextlib.closing(sqlite3.connect(f"file:{path}?mode=ro", uri=True, timeout=5)) as database:
            return database.execute("SELECT count(*) FROM dwell").fetchone()[0]

    def stop(self):
        for child in (self.daemon, self.plant):
            if child is not None:
                child.end(timeout=5)

    def logs(self, lines=25):
        found = []
        for child in (self.plant, self.daemon):
            if child is not None:
                ended = "" if child.running() else f", ended with status {child.process.returncode}"
                found.append(f"-- end of {child.name}.log{ended}")
                found += child.text().splitlines()[-lines:]
        return "\n".join(found)


def raw_logs(folder):
    """The raw logs in order, each once: one that was being compressed may be there twice, and as a .part."""
    plain = set(glob.glob(os.path.join(folder, "raw-*.log")))
    packed = {path for path in glob.glob(os.path.join(folder, "raw-*.log.zst")) if path.removesuffix(".zst") not in plain}
    return sorted(plain | packed)


def reconfigure(file, old, new):
    """Of an open recording: its configuration is another, and was so when it was recorded."""
    text = file["configuration"][()].replace(old.encode(), new.encode())
    del file["configuration"]
    file.create_dataset("configuration", data=text, dtype=f"S{len(text)}")   # of fixed length, as vibrigd writes it
    file.attrs.create("configuration_sha256", hashlib.sha256(text).hexdigest().encode(), dtype="S64")


def state_of(status):
    return "no answer" if status is None else status["campaign"]["state"] + \
        (f" ({status['campaign']['reason']})" if status["campaign"].get("reason") else "")


def number(value):
    """Protobuf's JSON mapping writes 64-bit counters as strings."""
    return int(value)


def measuring(status):
    """Both links are up and the rate of the samples is known, which an arming asks for: good channels alone come before that."""
    return status["can"]["link"] == "running" and status["shaker"]["link"] == "running" and status["sample"].get("rate_hz", 0) > 0


IMBALANCE = "received is not handled"   # of the daemon's alarm


def balances(status):
    """Every stage with its loss balance: name, received, accounted for."""
    can, assembler, ring = status["can"], status["assembler"], status["estimator_ring"]
    n = number
    rows = [
        ("CAN port", n(can["received"]),
         n(can["delivered"]) + n(can["own"]) + n(can["error_frames"]) + n(can["malformed"])),
        ("assembler", n(assembler["received"]),
         sum(n(assembler[k]) for k in ("used", "unknown", "duplicate", "late", "wrong_length"))),
        ("assembler to ring", n(assembler["samples"]), n(ring["pushed"]) + n(ring["dropped"])),
    ]
    if status["clock"] == "real":   # the rig's clock never rests: one sample more is on its way, and time has frames
        rows += [("CAN port to assembler", n(can["delivered"]), n(assembler["received"])),
                 ("ring", n(ring["pushed"]), n(ring["popped"]))]
    else:   # there the filter takes what has come when a dwell ends or a display is due, each 0.2 s
        waiting = n(ring["pushed"]) - n(ring["popped"])
        rows += [("ring", True, 0 <= waiting <= 2 + 0.2 * status["sample"].get("rate_hz", 0))]
    return rows


def settled_balances(rig):
    """The balances once each closes, or those of the last of some looks: a stage may hold something for the moment."""
    status, rows = None, []
    for _ in range(20):
        status = rig.status()
        rows = balances(status) if status is not None else []
        if rows and all(left == right for _, left, right in rows):
            break
        time.sleep(0.1)
    return status, rows


def check_balances(checks, rig):
    status, rows = settled_balances(rig)
    checks.check(rows, "status answers")
    for name, left, right in rows:
        checks.check(left == right, f"loss balance closes: {name}", f"received {left}, accounted for {right}")
    # It looks at its stages every second, the lines of the log among them.
    checks.check(IMBALANCE not in rig.daemon.text(), "the daemon itself has found no stage that does not balance", rig.logs())
    return status


def check_balance(checks, rig, what):
    """All of them as one check."""
    _, rows = settled_balances(rig)
    checks.check(rows and all(left == right for _, left, right in rows) and IMBALANCE not in rig.daemon.text(),
                 f"{what}: the loss balance closes", f"{rows}\n{rig.logs()}")


SANITIZER = re.compile(r"(AddressSanitizer|LeakSanitizer|ThreadSanitizer|UndefinedBehaviorSanitizer|runtime error:)")


def programs_from_command_line(usage):
    if len(sys.argv) < 2 or sys.argv[1].startswith("-"):
        print(usage, file=sys.stderr)
        sys.exit(0 if sys.argv[1:] in (["-h"], ["--help"]) else 2)
    return os.path.realpath(sys.argv[1])
