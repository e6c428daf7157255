#!/usr/bin/python3
"""The Debian package on a booted system, with the shipped unit and its sandbox: installed, started, killed, upgraded,
removed, purged; a campaign over a real vcan0. systemd is PID 1 of a User-Mode Linux.

usage: package_test.py PROGRAMS [--soak]              PROGRAMS: build/PRESET/bin; --soak: the campaign of 2 x 14 dwells
       package_test.py PROGRAMS --inside OLD NEW [--soak]    on the booted system; OLD, NEW: the packages
"""
import glob
import grp
import hashlib
import json
import os
import pwd
import re
import shutil
import signal
import stat
import subprocess
import sys
import tempfile
import time

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import rig as r  # noqa: E402
import service_manager as stages  # noqa: E402

HERE = os.path.dirname(os.path.abspath(__file__))
UNIT = "vibrigd.service"
GUARD = "vibrig-guard.service"
EXAMPLES = "/usr/share/doc/vibrig/examples"
CONFIGURATION, DATA = "/etc/vibrig/vibrigd.toml", "/var/lib/vibrig"
VERSIONS = ("0.1.0", "0.1.1")
LARGEST_EXPOSURE = 2.0
SEED = 11
ATTEMPTS = 4   # of what a machine that stands still ends
SHORT = {"name": "packaged", "identify": "what-it-can", "positions_deg": [[0, 0, 0]], "table_g": [9.0],
         "dwell_s": 4.0, "settle_s": 2.0, "ramp_s": 0.5, "temperature_window_s": 1.0}
WHOLE = {"name": "packaged"}   # the default: 14 positions at 9 g and 7 g, 100 s each


def output(*command, timeout=60):
    run = subprocess.run(command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
                         timeout=timeout, check=False, env={**os.environ, "LC_ALL": "C.UTF-8", "SYSTEMD_COLORS": "0",
                                                            "DEBIAN_FRONTEND": "noninteractive"})
    return run.returncode, run.stdout.strip()


def prop(name, unit=UNIT):
    return output("systemctl", "show", unit, "-P", name)[1]


def wait_until(condition, timeout_s):
    end = time.monotonic() + timeout_s
    while not condition():
        if time.monotonic() > end:
            return False
        time.sleep(0.5)   # what is asked is mostly a program, and each takes the machine's only processor
    return True


def journal():
    return output("journalctl", "-u", UNIT, "-o", "cat", "--no-pager")[1]


def succeeds(checks, text, *command):
    status, said = output(*command, timeout=120)
    return checks.equal(status, 0, text) or bool(checks.note(said[-3000:]))


def owner(path):
    found = os.stat(path)
    return f"{pwd.getpwuid(found.st_uid).pw_name}:{grp.getgrgid(found.st_gid).gr_name} {stat.S_IMODE(found.st_mode):o}"


def boots(checks):
    state = output("systemctl", "is-system-running", "--wait", timeout=90)[1]
    with open("/proc/1/comm", encoding="ascii") as comm:
        checks.equal(comm.read().strip(), "systemd", "PID 1 is systemd")
    checks.check(state in ("running", "degraded"), "the system comes up", state)


def small_database(package):
    """dpkg reads the list of files of every package before it does anything: a minute here. Left are those that the
    package needs."""
    with open("/var/lib/dpkg/status", encoding="utf-8") as file:
        known = file.read().split("\n\n")
    needs = set(re.findall(r"(?:^|, )([a-z0-9.+-]+)", output("dpkg-deb", "-f", package, "Depends")[1]))
    output("mount", "-t", "tmpfs", "tmpfs", "/var/lib/dpkg")
    for folder in ("info", "updates", "triggers"):
        os.mkdir(os.path.join("/var/lib/dpkg", folder))
    named = re.compile(r"^(?:Package|Provides): (.*)$", re.M)
    with open("/var/lib/dpkg/status", "w", encoding="utf-8") as file:
        file.write("".join(one + "\n\n" for one in known
                           if needs & set(re.findall(r"[a-z0-9.+-]+", " ".join(named.findall(one))))))


def installs(checks, package):
    small_database(package)
    succeeds(checks, "the package installs", "dpkg", "-i", package)
    user = pwd.getpwnam("vibrig")
    checks.check(user.pw_uid < 1000 and user.pw_shell.endswith("nologin"), "sysusers makes the user, without a login",
                 str(user))
    checks.check("vibrig" in grp.getgrnam("vibrig-operator").gr_mem and "vibrig" in grp.getgrnam("dialout").gr_mem,
                 "in the groups of the operators and of the serial lines")
    checks.equal([owner("/etc/vibrig"), owner(DATA)], ["root:vibrig 750", "vibrig:vibrig 750"],
                 "tmpfiles makes the folders")
    checks.equal((prop("LoadState"), prop("ActiveState"), prop("UnitFileState")), ("loaded", "inactive", "disabled"),
                 "the unit is there; nothing starts by itself")
    output("systemctl", "start", UNIT)
    wait_until(lambda: prop("ActiveState") == "failed", 20)
    checks.equal((prop("ActiveState"), prop("ExecMainStatus"), prop("NRestarts")), ("failed", "2", "0"),
                 "without a configuration it says so and is not started over and over")
    checks.check(CONFIGURATION in journal(), "the log names the file", journal()[-500:])
    output("systemctl", "reset-failed", UNIT)


def link(name):
    status, said = output("ip", "-j", "-details", "link", "show", name)
    return json.loads(said)[0] if status == 0 else {}


def makes_interfaces(checks):
    for name in ("80-can0.network", "80-vcan0.netdev", "80-vcan0.network"):
        shutil.copy(os.path.join(EXAMPLES, name), "/etc/systemd/network/")
    # A kernel without CAN hardware: another vcan plays can0; its bit rate is read and cannot be set.
    output("ip", "link", "add", "dev", "can0", "type", "vcan")
    output("networkctl", "reload")
    checks.check(wait_until(lambda: "UP" in link("vcan0").get("flags", []), 30), "networkd makes vcan0 and raises it",
                 output("networkctl", "status", "vcan0")[1])
    for name in ("vcan0", "can0"):
        said = ""

        def configured():
            nonlocal said
            said = output("networkctl", "status", name, "--no-pager")[1]
            return f"80-{name}.network" in said and "configured" in said
        checks.check(wait_until(configured, 30), f"{name} is configured by its file", said)
        checks.check(wait_until(lambda: link(name).get("txqlen") == 1000, 20), f"{name} has room for bursts of commands",
                     str(link(name).get("txqlen")))
    said = output("journalctl", "-u", "systemd-networkd", "-o", "cat", "--no-pager")[1]
    checks.equal([line for line in said.splitlines() if re.search("80-v?can0.*(Unknown|ignoring|Failed)", line)], [],
                 "networkd understands every line")


def configure(rig, **more):
    rig.configure(rig.campaign, can={"sample_rate_hz": 40.0, **r.PATIENT["can"]}, gimbal=r.PATIENT["gimbal"],
                  shaker=r.PATIENT["shaker"], server={"operator_group": "vibrig-operator", "status_socket": "/run/vibrig/status.sock",
                          "page": "127.0.0.1:8090"}, threads=rig.threads, **more)
    os.chmod(CONFIGURATION, 0o640)
    shutil.chown(CONFIGURATION, "root", "vibrig")


def starts(checks, rig):
    with open(os.path.join(EXAMPLES, "vibrigd.toml"), encoding="utf-8") as file:
        example = file.read()
    checks.check(f'results = "{DATA}"' in example and "operator_group" in example, "the example is the one installed")
    configure(rig)
    succeeds(checks, "systemctl enable --now", "systemctl", "enable", "--now", UNIT)
    checks.equal((prop("Type"), prop("ActiveState"), prop("SubState")), ("notify", "active", "running"),
                 "started as it has said READY")
    status = rig.wait_for(r.measuring, 30)
    checks.check(status is not None and r.measuring(status), "status answers; it measures", journal()[-1500:])
    # "ready, measuring" and the like: what it tells the service manager
    checks.check(wait_until(lambda: prop("StatusText") != "", 10), f"systemctl status shows: {prop('StatusText')}")


def is_confined(checks, rig):
    pid = int(prop("MainPID"))
    with open(f"/proc/{pid}/status", encoding="ascii") as file:
        said = dict(line.split(":", 1) for line in file.read().splitlines())
    checks.equal(pwd.getpwuid(int(said["Uid"].split()[1])).pw_name, "vibrig", "it runs as its user")
    checks.equal([said[key].strip() for key in ("CapPrm", "CapEff", "CapBnd", "CapAmb")], ["0" * 16] * 4,
                 "it has no capability")
    checks.equal((said["Seccomp"].strip(), said["NoNewPrivs"].strip()), ("2", "1"), "system calls are filtered")
    thread = stages.thread_named(pid, "acquisition")
    checks.check(thread is not None and os.sched_getscheduler(thread) & ~os.SCHED_RESET_ON_FORK == os.SCHED_FIFO,
                 "acquisition has a real-time priority")
    checks.check(int(said["VmLck"].split()[0]) > 0, "its memory is locked", said["VmLck"])
    real_time = rig.status()["real_time"]
    checks.equal((real_time["memory_locked"], real_time["missing"],
                  {t["name"]: t["fifo_priority"] for t in real_time["threads"]}),
                 (True, [], {"acquisition": 60, "estimator": 50}), "and so it says; nothing of real time is missing")
    checks.note(f"real time: {real_time['threads']}")
    _, said = output("systemd-analyze", "security", UNIT, "--no-pager")
    exposure = re.search(r"Overall exposure level for \S+: ([0-9.]+)", said)
    checks.check(exposure is not None and float(exposure[1]) <= LARGEST_EXPOSURE,
                 f"exposure {exposure and exposure[1]} is at most {LARGEST_EXPOSURE}", said[-600:])
    stranger = ["setpriv", "--reuid=nobody", "--regid=nogroup", "--clear-groups", rig_tool(), "status", "--socket"]
    checks.check(output(*stranger, "/run/vibrig/vibrigd.sock")[0] != 0, "a stranger is not let to the command socket")
    checks.equal(owner("/run/vibrig/vibrigd.sock").split()[0], "vibrig:vibrig-operator", "the operators' group is")
    stranger[2] = "--regid=vibrig"
    checks.equal(output(*stranger, "/run/vibrig/status.sock")[0], 0, "the group vibrig may look")


def rig_tool():
    return shutil.which("vibrig", path="/usr/bin")


def runs_a_campaign(checks, rig, timeout_s):
    for command, done in (("arm", rig.arm()), ("start", rig.tool("start", "--by", "tester"))):
        checks.equal(done.returncode, 0, f"{command} is accepted {done.stderr.strip()}".strip())
    last = rig.wait_for_state(("finished", "aborted", "tripped"), timeout_s)
    checks.equal(r.state_of(last), "finished", "a campaign under the sandbox, over vcan0, finishes")
    status = rig.wait_for(lambda s: not s["recorder"].get("recording", False), 20)
    lost = {key: r.number(status["recorder"].get(key, 0)) for key in ("samples_lost", "frames_lost", "gaps")}
    lost["kernel"] = r.number(status["can"]["kernel_dropped"])
    checks.equal(lost, dict.fromkeys(lost, 0), "nothing is lost")
    path, text = rig.result()
    checks.check(path is not None and len(json.loads(text)["parameters"]) == 30, "result.json is written")
    checks.check(path is not None and owner(path).startswith("vibrig:vibrig"), "it is the daemon's user's")
    recorded = glob.glob(os.path.join(DATA, "packaged-*", "campaign.h5"))
    checks.check(recorded and output("h5dump", "-H", recorded[0])[0] == 0, "the recording opens", str(recorded))


def is_guarded(checks, rig):
    """The guard's unit beside the daemon's, for this part only. From here on the priorities, which were seen, cost only time."""
    rig.threads = r.NO_PRIORITY
    configure(rig, guard={"socket": "/run/vibrig-guard/guard.sock"})
    succeeds(checks, "systemctl enable --now vibrig-guard", "systemctl", "enable", "--now", GUARD)
    output("systemctl", "restart", UNIT)

    def watches(status):
        guard = status.get("guard", {})
        return guard.get("heard") and guard.get("sees") and guard.get("reaches_shaker") and guard.get("cause") == "none"
    status = rig.wait_for(watches, 30)
    said = output("journalctl", "-u", GUARD, "-o", "cat", "--no-pager")[1]
    checks.check(status is not None and watches(status), "the guard watches: heard, sees the bus, reaches the shaker",
                 f"{status and status.get('guard')} {said[-800:]}")
    pid = int(prop("MainPID", GUARD))
    with open(f"/proc/{pid}/status", encoding="ascii") as file:
        process = dict(line.split(":", 1) for line in file.read().splitlines())
    checks.equal((pwd.getpwuid(int(process["Uid"].split()[1])).pw_name, process["CapEff"].strip(), process["Seccomp"].strip()),
                 ("vibrig-guard", "0" * 16, "2"), "as a user of its own, without capabilities, its system calls filtered")
    checks.equal(owner("/run/vibrig-guard/guard.sock"), "vibrig-guard:vibrig 660", "its socket is for the daemon's group")
    os.kill(pid, signal.SIGKILL)
    checks.check(wait_until(lambda: int(prop("MainPID", GUARD)) not in (0, pid) and prop("ActiveState", GUARD) == "active", 30),
                 "killed, systemd starts it again", prop("ActiveState", GUARD))
    status = rig.wait_for(watches, 30)
    checks.check(status is not None and watches(status), "and it watches again", status and status.get("guard"))
    output("systemctl", "disable", "--now", GUARD)
    rig.wait_for(lambda s: not s["guard"].get("heard"), 20)
    checks.equal(rig.tool("arm", "--by", "tester").returncode, 1, "without it nothing is armed")
    configure(rig)
    output("systemctl", "restart", UNIT)


def shakes(checks, rig, what):
    """A campaign until the table is at its level."""
    # A daemon back just as the shaker's watchdog ran out has stopped a table not yet at rest: that fault stays until it
    # is stopped again.
    status = rig.wait_for(lambda s: s["shaker"].get("state") in (0, 4) and not s["shaker"].get("running", True), 30)
    if status is not None and status["shaker"].get("state") == 4:
        rig.tool("abort", "--by", "tester")
    status = rig.wait_for(lambda s: r.measuring(s) and s["shaker"].get("state") == 0 and
                          not s["shaker"].get("running", True), 30)
    for tries_left in (1, 0):
        if status["campaign"]["state"] == "tripped":
            rig.acknowledge()
        said = [rig.arm().stderr, rig.tool("start", "--by", "tester").stderr]
        status = rig.wait_for_state(("recording", "tripped", "aborted"), 60)
        # A rig that has to wait for a processor does not shake as it is told to, and the daemon stops it.
        if status is None or status["campaign"]["state"] == "recording" or not tries_left:
            break
        checks.note(f"{what}: once more: {r.state_of(status)}")
        rig.wait_for(lambda s: s["shaker"].get("rest") == "at rest", 30)
    checks.check(status is not None and status["campaign"]["state"] == "recording", f"{what}: the table shakes",
                 f"{r.state_of(status)} {said}")


def at_rest(rig):
    return wait_until(lambda: stages.shaker_state(rig) in (0, 4), 30)


def comes_back(checks, rig, what, restarts, pid, begun):
    checks.check(wait_until(lambda: int(prop("MainPID")) not in (0, pid) and prop("ActiveState") == "active", 60) and
                 prop("NRestarts") == str(restarts), f"{what}: systemd starts it again",
                 f"{prop('NRestarts')} restarts; {journal()[-800:]}")
    ready = time.monotonic()
    status = rig.wait_for(r.measuring, 30)
    checks.check(status is not None and r.measuring(status), f"{what}: it measures again")
    checks.note(f"{what}: READY after {ready - begun:.1f} s, measures and answers after {time.monotonic() - begun:.1f} s")
    checks.check(at_rest(rig), f"{what}: the shaker stops", f"state {stages.shaker_state(rig)}")
    checks.check(status is not None and status["campaign"]["state"] in ("idle", "tripped"), f"{what}: disarmed",
                 r.state_of(status))


def is_killed(checks, rig):
    shakes(checks, rig, "kill -9")
    pid, begun = int(prop("MainPID")), time.monotonic()
    os.kill(pid, signal.SIGKILL)
    comes_back(checks, rig, "kill -9", 1, pid, begun)


def hangs(checks, rig):
    shakes(checks, rig, "a stage hangs")
    pid = int(prop("MainPID"))
    thread = stages.thread_named(pid, "estimator")
    begun = time.monotonic()
    stages.block(thread)
    checks.check(at_rest(rig), "a stage hangs: the shaker's watchdog stops it")
    checks.note(f"the shaker is at rest {time.monotonic() - begun:.1f} s after")
    os.waitpid(thread, stages.WALL)   # systemd's watchdog, after WatchdogSec; the tracer has to let go
    begun = time.monotonic()
    comes_back(checks, rig, "a stage hangs", 2, pid, begun)
    checks.check("Watchdog timeout" in journal(), "a stage hangs: systemd's watchdog ended it", journal()[-800:])


def digest(*patterns):
    found = {}
    for path in sorted(p for pattern in patterns for p in glob.glob(pattern, recursive=True) if os.path.isfile(p)):
        with open(path, "rb") as file:
            found[path] = hashlib.sha256(file.read()).hexdigest()
    return found


class Tried(r.Checks):
    """Checks that are told once it is known whether the machine held the rig up meanwhile."""

    def __init__(self):
        super().__init__()
        self.made = []

    def check(self, good, text, found=""):
        self.made.append((good, text, found))
        return bool(good)


def stays(checks, rig, pid, states):
    """What is armed or moves is not removed. False: it is neither, and nobody tried."""
    of = "armed" if states == ["armed"] else "shaking"
    text = f"the package is not removed while it is {of}, and says what to do first"
    if not wait_until(lambda: any(state in prop("StatusText") for state in states), 5):
        return checks.check(False, text, prop("StatusText"))
    status, said = output("dpkg", "-r", "vibrig", timeout=120)
    found = (rig.status() or {"campaign": {"state": "no answer"}})["campaign"]["state"]
    checks.check(status != 0 and "vibrigd is not removed" in said and "vibrig abort" in said, text, said)
    checks.equal(output("dpkg-query", "-W", "-f", "${db:Status-Status}", "vibrig")[1], "installed", "and it stays installed")
    return checks.check(int(prop("MainPID")) == pid and found in states, "nothing has stopped", f"{prop('MainPID')} {found}")


def upgrades_armed(checks, rig, package):
    """The new package, while it is armed and while it shakes. Ends where something is not as it should be."""
    rig.wait_for(lambda s: r.measuring(s) and s["campaign"]["state"] in ("idle", "finished", "aborted", "tripped"), 30)
    rig.acknowledge()   # what was killed and hung has latched
    rig.wait_for(lambda s: s["campaign"]["state"] != "tripped" and not s["shaker"].get("stop_pending"), 30)
    pid, armed = int(prop("MainPID")), rig.arm()
    if not checks.check(armed.returncode == 0, "armed again", armed.stderr) or not stays(checks, rig, pid, ["armed"]):
        return
    status, said = output("dpkg", "-i", package, timeout=120)
    checks.check(status == 0 and "takes the new one at its next rest" in said,
                 "the package upgrades while the daemon is armed, and says that it is not restarted", journal()[-2500:] + said[-1000:])
    still = rig.wait_for(lambda s: s["campaign"]["state"] == "armed", 10)
    if not checks.check(int(prop("MainPID")) == pid and still is not None and still["campaign"]["state"] == "armed", "it goes on, armed",
                        f"{prop('MainPID')} {r.state_of(still)}"):
        return
    rig.tool("start", "--by", "tester")
    moves = ["slewing", "ramping", "settling", "recording", "resting"]
    status = rig.wait_for(lambda s: s["campaign"]["state"] == "recording", 60)
    if not checks.check(status is not None and status["campaign"]["state"] == "recording",
                        "what is installed anew while armed waits while it shakes, too", r.state_of(status)):
        return
    stays(checks, rig, pid, moves)
    checks.check(int(prop("MainPID")) == pid and (rig.status() or {"campaign": {"state": ""}})["campaign"]["state"] in moves,
                 "and the campaign goes on", r.state_of(rig.status()))


def upgrades(checks, rig, package):
    kept = (CONFIGURATION, os.path.join(DATA, "**", "result.json"), os.path.join(DATA, "**", "raw-*"),
            os.path.join(DATA, "**", "campaign.h5"))
    rig.campaign = {**SHORT, "dwell_s": 300.0}   # longer than dpkg takes
    configure(rig)
    rig.wait_for(lambda s: r.measuring(s) and s["shaker"].get("rest") == "at rest", 30)
    output("systemctl", "restart", UNIT)
    before = digest(*kept)
    # A machine that stands still for two seconds holds the rig up in it, and with that the shaker: what is armed ends then.
    held_up = lambda: journal().count("no valid read-back from the shaker")  # noqa: E731
    for left in reversed(range(ATTEMPTS)):
        tried, earlier = Tried(), held_up()
        upgrades_armed(tried, rig, package)
        if all(good for good, _, _ in tried.made) or held_up() == earlier or left == 0:
            break
        checks.note("the machine has held the rig up: once more")
    for made in tried.made:
        checks.check(*made)
    pid = int(prop("MainPID"))
    rig.tool("abort", "--by", "tester")
    checks.equal(output("dpkg-query", "-W", "-f", "${Version}", "vibrig")[1], VERSIONS[1], "to the new version")
    checks.check(wait_until(lambda: int(prop("MainPID")) not in (0, pid) and prop("ActiveState") == "active", 60),
                 "at rest the new program takes over", prop("ActiveState"))
    checks.equal(prop("UnitFileState"), "enabled", "it stays enabled")
    after = digest(*kept)
    lost = [path for path in before if after.get(path) != before[path]]   # the new campaign's are there beside them
    checks.check(len(before) > 3 and not lost, "configuration and recordings are kept", str(lost))
    at_rest = lambda s: r.measuring(s) and s["shaker"].get("rest") == "at rest"  # noqa: E731
    status = rig.wait_for(at_rest, 30)
    checks.check(status is not None and at_rest(status), "it measures, the table at rest")


def is_removed(checks, rig):
    # On a busy machine rest may be in doubt for a moment; then dpkg is answered so, and asked again.
    said = []
    checks.check(wait_until(lambda: said.append(output("dpkg", "-r", "vibrig")) or said[-1][0] == 0, 30),
                 "the package is removed", said[-1][1])
    checks.equal((prop("ActiveState"), prop("LoadState")), ("inactive", "not-found"), "daemon and unit are gone")
    checks.check(rig_tool() is None and not glob.glob("/etc/systemd/system/*/vibrig*.service"), "programs too")
    checks.check(os.path.exists(CONFIGURATION) and glob.glob(DATA + "/*/campaign.h5"),
                 "configuration and recordings stay")
    succeeds(checks, "the package is purged", "dpkg", "-P", "vibrig")
    checks.equal([path for path in ("/etc/vibrig", DATA, "/run/vibrig", "/usr/share/doc/vibrig") if
                  os.path.exists(path)], [], "nothing of it is left")


def inside(programs, old, new, soak):
    checks = r.Checks()

    def timed(function, *arguments):
        begun = time.monotonic()
        function(checks, *arguments)
        checks.note(f"{function.__name__}: {time.monotonic() - begun:.1f} s")

    with tempfile.TemporaryDirectory() as folder:
        timed(boots)
        timed(installs, old)
        timed(makes_interfaces)
        rig = r.Rig("/usr/bin", "vcan0", "real", folder)
        rig.configuration, rig.results, rig.socket = CONFIGURATION, DATA, "/run/vibrig/vibrigd.sock"
        rig.campaign, rig.threads = WHOLE if soak else SHORT, {}
        rig.programs = programs   # the rig is there when the package is not
        rig.start_plant("--seed", str(SEED), *(() if soak else ("--warm-up", "1", "--start-temperature", "45")))
        rig.programs = "/usr/bin"
        try:
            timed(starts, rig)
            timed(is_confined, rig)
            timed(runs_a_campaign, rig, 12000 if soak else 120)
            timed(is_guarded, rig)
            timed(is_killed, rig)
            timed(hangs, rig)
            timed(upgrades, rig, new)
            timed(is_removed, rig)
        finally:
            rig.stop()
    return checks.end()


def installs_below_a_prefix(checks, build, folder):
    """cmake --install below a prefix of its own: the unit names the program there."""
    prefix = os.path.join(folder, "prefix")
    succeeds(checks, "cmake --install", "cmake", "--install", build, "--prefix", prefix)
    with open(os.path.join(prefix, "lib/systemd/system/vibrigd.service"), encoding="utf-8") as file:
        program = re.search(r"^ExecStart=(\S+)", file.read(), re.M)[1]
    checks.equal(program, os.path.join(prefix, "bin/vibrigd"), "its unit starts the program installed")
    example = os.path.join(prefix, "share/doc/vibrig/examples/vibrigd.toml")
    status, said = output(program, "--check", "--config", example)
    checks.check(status == 2 and said.count("shaker.registers.") >= 10 and said.count("found") == said.count("found nothing"),
                 "which refuses the example configuration for the registers of a shaker that nobody has stated, and nothing else", said)
    simulated = os.path.join(folder, "simulated.toml")
    with open(example, encoding="utf-8") as file, open(simulated, "w", encoding="utf-8") as copy:
        copy.write(file.read() + "\n[commission]\nsimulated = true\n")
    checks.equal(output(program, "--check", "--config", simulated)[0], 0, "and accepts it for a simulated rig")


def package(checks, build, folder, version):
    status, said = output("cpack", "--config", os.path.join(build, "CPackConfig.cmake"), "-R", version, "-B", folder,
                          timeout=120)
    path = os.path.join(folder, f"vibrig_{version}_amd64.deb")
    checks.check(status == 0 and os.path.exists(path), f"cpack makes the package {version}", said[-1500:])
    desk = os.path.join(folder, f"python3-vibrig_{version}_all.deb")
    checks.check(os.path.exists(desk) and "./usr/lib/python3/dist-packages/vibrig/__init__.py" in output("dpkg-deb", "-c", desk)[1],
                 "and python3-vibrig beside it", str(os.listdir(folder)))
    status, said = output("lintian", "--allow-root", "--fail-on", "error,warning", desk)
    checks.check(status == 0, "lintian finds neither errors nor warnings in it", said[-2000:])
    return path


def is_complete(checks, package_file):
    status, said = output("lintian", "--allow-root", "--fail-on", "error,warning", package_file)
    checks.check(status == 0, "lintian finds neither errors nor warnings", said[-2000:])
    files = output("dpkg-deb", "-c", package_file)[1]
    missing = [name for name in ("man/man1/vibrig.1.gz", "man/man1/vibrig-plant.1.gz", "man/man5/vibrigd.toml.5.gz",
                                 "man/man8/vibrigd.8.gz", "man/man8/vibrig-guard.8.gz", "vibrig/rig.dbc", "vibrig/vibrig.proto",
                                 "vibrig/vibrigd.schema.json", "bash-completion/completions/vibrig",
                                 "zsh/vendor-completions/_vibrig", "fish/vendor_completions.d/vibrig.fish",
                                 "doc/vibrig/operating.md", "doc/vibrig/reference/keys.md", "doc/vibrig/changelog.gz")
               if f"./usr/share/{name}\n" not in files + "\n"]
    checks.equal(missing, [], "manual pages, completion, pages, rig.dbc, vibrig.proto and the schema are in the package")
    checks.equal(output("dpkg-deb", "-f", package_file, "Suggests")[1], "chromium, python3-vibrig", "chromium is suggested")


def main():
    programs = r.programs_from_command_line(__doc__)
    soak = "--soak" in sys.argv
    if "--inside" in sys.argv:
        at = sys.argv.index("--inside")
        return inside(programs, sys.argv[at + 1], sys.argv[at + 2], soak)
    checks = r.Checks()
    build = os.path.dirname(programs)
    with tempfile.TemporaryDirectory(dir=build) as folder:
        installs_below_a_prefix(checks, build, folder)
        packages = [package(checks, build, folder, version) for version in VERSIONS]
        is_complete(checks, packages[0])
        limit = 14000 if soak else 1200   # a slow machine takes more than 400
        run = subprocess.run([os.path.join(HERE, "run-in-uml"), "--systemd", "-t", str(limit), "--", os.path.abspath(__file__),
                              programs, "--inside", *packages, *(["--soak"] if soak else [])], stdin=subprocess.DEVNULL,
                             stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, errors="replace", check=False,
                             preexec_fn=lambda: r.die_with_parent(signal.SIGTERM))
        checks.adopt(run.stdout)
    return checks.end()


if __name__ == "__main__":
    sys.exit(main())
