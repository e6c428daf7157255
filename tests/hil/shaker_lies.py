"""Rows of the fault matrix in which the shaker's controller lies, each with its time limit; what the table does is read from
the simulated rig, which alone knows."""
import re
import time

import rig as r

TRIP_S = 0.5        # an amplitude that disagrees with the command
STUCK_S = 1.0       # an accelerometer that ceases to move
STALE_S = 0.1       # [can] stale_deadline_ms
LOOK_S = 1.0        # between two looks at a register of the controller
ALONE_S = 1.0       # motion that nobody commanded
REST_WINDOW_S = 0.5
STOP_S = 3.0        # [shaker] stop_deadline_s
WATCHDOG_S = 1.5    # three times [shaker] watchdog_period_ms, 500
SOFT_STOP_S = 0.5   # the controller's, when its watchdog fires
ABORT_S = 0.2       # to the answer to an abort
SLACK_S = 0.25      # a tick, a poll of the daemon, one of this script
AT_5_G = 0.99 * 5


def table_g(rig):
    """Peak, in truth."""
    return float(re.search(r"table ([\d.]+) g", rig.order("status"))[1])


def seconds_until(condition, limit_s):
    """None: not within the limit."""
    began = time.monotonic()
    while time.monotonic() - began <= limit_s:
        if condition():
            return time.monotonic() - began
        time.sleep(0.05)
    return None


def lie(rig, *lies):
    for each in lies:
        rig.order("fault " + each)


def tripped_by(rig, names):
    status = rig.status()
    return status is not None and status["campaign"]["state"] == "tripped" and status["interlock"]["tripped"] in names


def found_while_shaking(checks, rig, what, lies, names, limit_s):
    """Begun while the table does 5 g: a trip by one of these names in its time, then rest."""
    shaking, found = rig.shake()
    if not checks.check(shaking, f"{what}: the table shakes before", found + "\n" + rig.logs()):
        return
    lie(rig, *lies)
    took = seconds_until(lambda: tripped_by(rig, names), limit_s + SLACK_S)
    checks.check(took is not None, f"{what}: trips by {' or '.join(names)} within {limit_s} s",
                 f"{r.state_of(rig.status())}\n{rig.logs()}")
    took = seconds_until(lambda: table_g(rig) == 0, STOP_S)
    checks.check(took is not None, f"{what}: the table is at rest within {STOP_S} s of it", f"{table_g(rig)} g")
    answered(checks, rig, what)


def found_on_the_way_up(checks, rig, what, lies, names):
    """Begun before the start: no dwell is ever recorded."""
    rig.rest()
    lie(rig, *lies)
    said = [rig.command(kind) for kind in ("arm", "start")]
    status = rig.wait_for(lambda s: s["campaign"]["state"] in ("recording", "aborted", "tripped"), 60)
    checks.check(status["campaign"]["state"] == "tripped" and status["interlock"]["tripped"] in names,
                 f"{what} from the start: trips by {' or '.join(names)} before anything is recorded",
                 f"{r.state_of(status)} {said}\n{rig.logs()}")
    took = seconds_until(lambda: table_g(rig) == 0, STOP_S)
    checks.check(took is not None, f"{what} from the start: the table is at rest within {STOP_S} s", f"{table_g(rig)} g")


def answered(checks, rig, what, abort=True):
    """An abort is answered in its time, whatever is wrong; every loss balance closes."""
    if abort:
        began = time.monotonic()
        answer = rig.command("abort")
        took = time.monotonic() - began
        checks.check(answer is not None and took < ABORT_S, f"{what}: an abort is answered within {ABORT_S} s", f"{took:.3f} s {answer}")
    r.check_balance(checks, rig, what)


def feeds(rig):
    return r.number(rig.status()["shaker"].get("feeds", 0))


def aborted(checks, rig, what, lies):
    """An abort of a table that does 5 g while its controller lies; the feeds until then."""
    shaking, found = rig.shake()
    if not checks.check(shaking, f"{what}: the table shakes before", found + "\n" + rig.logs()):
        return None
    lie(rig, *lies)
    time.sleep(0.1)
    began = time.monotonic()
    rig.command("abort")
    took = time.monotonic() - began
    checks.check(took < ABORT_S, f"{what}: an abort is answered within {ABORT_S} s", f"{took:.3f} s")
    return feeds(rig)


def disobeyed(checks, rig, what, lies):
    """Nothing helps but the emergency stop, and the daemon says so in time and not before."""
    fed = aborted(checks, rig, what, lies)
    if fed is None:
        return
    took = seconds_until(lambda: tripped_by(rig, ("stop_disobeyed",)), STOP_S + SLACK_S)
    checks.check(took is not None and took > STOP_S - SLACK_S, f"{what}: {STOP_S} s after the abort it is a disobeyed stop",
                 f"{took} s, {rig.status()['shaker']}\n{rig.logs()}")
    checks.check(table_g(rig) > AT_5_G, f"{what}: which it is", f"{table_g(rig)} g")
    checks.check(feeds(rig) <= fed + 1, f"{what}: the watchdog starves", f"{fed} feeds before, {feeds(rig)} after")
    status = rig.status()
    checks.check(status["shaker"].get("stop_pending"), f"{what}: the stop is not confirmed", status["shaker"])
    refused = rig.tool("ack", "trip", "--by", "tester")
    checks.equal(refused.returncode, 1, f"{what}: it cannot be acknowledged")
    rig.order("estop open")
    took = seconds_until(lambda: table_g(rig) == 0, SLACK_S)
    checks.check(took is not None, f"{what}: the emergency stop ends it", f"{table_g(rig)} g")
    rig.order("clear")
    rig.order("estop close")
    status = rig.wait_for(lambda s: not s["shaker"].get("stop_pending"), 10)
    checks.check(not status["shaker"].get("stop_pending"), f"{what}: then rest is measured", status["shaker"])
    answered(checks, rig, what, abort=False)


def rescued_by_watchdog(checks, rig, what, lies):
    fed = aborted(checks, rig, what, lies)
    if fed is None:
        return
    limit_s = WATCHDOG_S + SOFT_STOP_S + SLACK_S
    took = seconds_until(lambda: table_g(rig) == 0, limit_s)
    checks.check(took is not None and took > 0.5, f"{what}: starved, the watchdog stops the table within {limit_s} s",
                 f"{took} s, {table_g(rig)} g, {fed} feeds before, {feeds(rig)} after\n{rig.logs()}")
    status = rig.wait_for(lambda s: not s["shaker"].get("stop_pending"), STOP_S)
    checks.check(status["campaign"]["state"] == "aborted", f"{what}: an abort it remains", f"{r.state_of(status)}\n{rig.logs()}")
    answered(checks, rig, what, abort=False)


def unseen(checks, rig, what, lies):
    """Shows only when the watchdog is needed: nothing trips, and a stop is obeyed."""
    fed = aborted(checks, rig, what, lies)
    if fed is None:
        return
    took = seconds_until(lambda: table_g(rig) == 0, STOP_S)
    checks.check(took is not None, f"{what}: a stop is obeyed", f"{table_g(rig)} g")
    status = rig.wait_for(lambda s: not s["shaker"].get("stop_pending"), STOP_S + SLACK_S)
    checks.check(status["campaign"]["state"] == "aborted", f"{what}: no trip", f"{r.state_of(status)}\n{rig.logs()}")


def moves_alone(checks, rig, what):
    """The table moves, every register says rest, nobody is armed: shown by the accelerometers."""
    rig.rest()
    requests = rig.status()["shaker"]["running"]
    rig.order("table 0.4")
    limit_s = REST_WINDOW_S + ALONE_S
    took = seconds_until(lambda: tripped_by(rig, ("uncommanded",)), limit_s + SLACK_S)
    checks.check(took is not None and not requests, f"{what}: trips by uncommanded within {limit_s} s",
                 f"{r.state_of(rig.status())}\n{rig.logs()}")
    rig.order("table own")
    status = rig.wait_for(lambda s: not s["shaker"].get("stop_pending"), 10)
    checks.check(not status["shaker"].get("stop_pending"), f"{what}: then rest is measured", status["shaker"])
    answered(checks, rig, what, abort=False)


WITNESS = ("amplitude_witness", "over_armed_level", "stuck")
ROWS = [
    ("lie: amplitude scaled by 2", found_while_shaking, ["amplitude-scaled=2"], WITNESS, TRIP_S),
    ("lie: amplitude scaled by 0.5", found_while_shaking, ["amplitude-scaled=0.5"], WITNESS, TRIP_S),
    ("lie: amplitude as rms", found_while_shaking, ["unit-rms"], WITNESS, TRIP_S),
    ("lie: dead table, amplitude echoed", found_while_shaking, ["dead-table", "readback-echo"], WITNESS, TRIP_S),
    ("lie: amplitude as m/s2", found_while_shaking, ["unit-mps2"], WITNESS, TRIP_S),
    ("lie: amplitude as m/s2", found_on_the_way_up, ["unit-mps2"], WITNESS),
    ("lie: amplitude scaled by 2", found_on_the_way_up, ["amplitude-scaled=2"], WITNESS),
    ("lie: amplitude as rms", found_on_the_way_up, ["unit-rms"], WITNESS),
    ("lie: dead table, amplitude echoed", found_on_the_way_up, ["dead-table", "readback-echo"], WITNESS),
    ("lie: ramp ten times slower", found_on_the_way_up, ["slow-ramp=10"], WITNESS),
    ("lie: an accelerometer sticks", found_while_shaking, ["stuck:y"], ("stuck",), STUCK_S),
    ("silence", found_while_shaking, ["bus-silent=100000"], ("stale_channel", "stale_platform"), STALE_S),
    ("lie: watchdog's timeout off", found_while_shaking, ["timeout-register=0"], ("watchdog_changed",), LOOK_S),
    ("lie: watchdog's timeout 60 s", found_while_shaking, ["timeout-register=60000"], ("watchdog_changed",), LOOK_S),
    ("lie: stop acknowledged, not done", rescued_by_watchdog, ["ack-without-stop"]),
    ("lie: the same, watchdog dead", disobeyed, ["ack-without-stop", "timeout-ignored"]),
    ("lie: the same, watchdog ten times late", disobeyed, ["ack-without-stop", "timeout-scaled=10"]),
    ("lie: contactor stuck", disobeyed, ["stuck-contactor"]),
    ("alone: registers at rest, the table moves", moves_alone),
    ("lie: watchdog dead", unseen, ["timeout-ignored"]),
    ("lie: watchdog ten times late", unseen, ["timeout-scaled=10"]),
    ("lie: ramp ten times slower from now on", unseen, ["slow-ramp=10"]),
]


def rows(checks, rig, pattern=""):
    for name, check, *more in ROWS:
        if re.search(pattern, name):
            check(checks, rig, name, *more)
