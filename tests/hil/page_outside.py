#!/usr/bin/python3
"""What the live page shows of what goes on beside a campaign: vibrig-guard that watches, is not heard and finds something, a
stop that is not obeyed; commissioning, read-only. In Chromium, real time for the guard, the rig's clock for the rest.

usage: page_outside.py PROGRAMS     environment: VIBRIG_BROWSER_NPM, as live_page.py; screenshots lie beside its own
"""
import json
import os
import socket
import sys
import tempfile

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import commission  # noqa: E402
import guard_campaign as guarding  # noqa: E402
import live_page  # noqa: E402
import rig as r  # noqa: E402

STRIP = "[...document.querySelectorAll('#strip li')]"
SOON = 60


class Guarded(guarding.Guarded):
    """With a page."""

    def configure(self, campaign, **tables):
        super().configure(campaign, server={"page": f"127.0.0.1:{live_page.free_port()}"}, **tables)


def watcher(checks, page, rig):
    def until(what, script):
        answer = page.until(script, SOON)
        checks.check(answer.get("value") is True, what, f"{answer}\n{page.ask('text', selector='#strip')}\n{rig.logs(10)}")
    return until


def shown(words, kind=""):
    """Something of the strip is this, and as bad as that."""
    return f"{STRIP}.some(li => {words}.test(li.textContent) && li.className === '{kind}')"


def check_guard(checks, programs, folder, page):
    rig = Guarded(programs, folder, *guarding.NO_WATCHDOG, "--fault", "ack-without-stop")
    try:
        rig.start_guard()
        rig.start_daemon()
        rig.wait_for(guarding.watching, SOON)
        until = watcher(checks, page, rig)
        page.ask("open", url=rig.page_address())
        until("a guard that watches is shown", shown("/^guard watches$/"))
        until("and the horn, which answers", shown("/^horn ready$/"))
        rig.guard.end()
        until("one that is not heard is red, in words", shown("/^GUARD NOT HEARD: ./", "bad"))
        rig.start_guard()
        until("and watches again", shown("/^guard watches$/"))
        page.ask("click", selector="#sound")
        # Another master drives the table, and the controller does not do what it answers.
        rig.drive(5.0)
        until("what the guard finds is shown with its words", shown("/^guard: ./", "bad"))
        found = [li for li in page.ask("evaluate", script=f"{STRIP}.map(li => li.textContent)").get("value", []) if li.startswith("guard: ")]
        guard = rig.status()["guard"]
        checks.check(found and found[0] == "guard: " + guard["text"] and guard["cause"] != "none", "they are the guard's own",
                     f"{found} {guard}")
        until("a stop that is not obeyed asks for the emergency stop", "!document.getElementById('next').hidden && "
              "/A STOP IS NOT OBEYED/.test(document.getElementById('next-what').textContent) && "
              "/Press the emergency stop/.test(document.getElementById('next-steps').textContent)")
        until("and nobody has closed a chain that is to be opened first", "[...document.querySelectorAll('#next-steps li')].filter(li => "
              "/^(Press|Close)/.test(li.textContent)).map(li => li.className).join() === ','")
        until("with a siren of its own", "/disobeyed/.test(document.getElementById('sound').dataset.played)")
        page.ask("shot", file=os.path.join(live_page.SHOTS, "guard-disobeyed.png"), width=1920, height=1080, scheme="light")
        found = page.ask("axe", width=1920, height=1080, scheme="light").get("value", {})
        checks.check(found.get("violations") == [] and found.get("checked", 0) > 10, "axe-core finds nothing", str(found))
    finally:
        rig.stop()


def post(rig, what):
    """`vibrig commission` says it so."""
    body = json.dumps({"kind": "commission", "by": "Ada", "argument": json.dumps(what)})
    with socket.socket(socket.AF_UNIX) as link:
        link.settimeout(20)
        link.connect(rig.socket)
        link.sendall((f"POST /api/v1/commands HTTP/1.1\r\nHost: x\r\nConnection: close\r\nContent-Type: application/json\r\n"
                      f"Content-Length: {len(body)}\r\n\r\n{body}").encode())
        answer = b"".join(iter(lambda: link.recv(65536), b"")).decode()
    return json.loads(answer.split("\r\n\r\n", 1)[1])


def check_commissioning(checks, programs, folder, page):
    truth = commission.drawn(1)
    rig = r.Rig(programs, "seqpacket", "rig", folder, poll_s=0.1)
    try:
        # What waits for the browser need not run as fast as it can meanwhile.
        rig.start_plant("--seed", "4", "--warm-up", "1", "--start-temperature", "45", "--speed", "5", "--truth", rig.truth_file(truth))
        rig.configure(commission.CAMPAIGN, commission={"enforce": True, "folder": os.path.join(folder, "commission")},
                      server={"page": f"127.0.0.1:{live_page.free_port()}"})
        rig.start_daemon()
        rig.wait_for(lambda s: s["platform"].get("ready") and s["shaker"].get("state") == 0, SOON)
        until = watcher(checks, page, rig)
        page.ask("open", url=rig.page_address())
        begun = post(rig, {"do": "begin"})
        checks.check(begun.get("accepted") is True, "commissioning begins", str(begun) + rig.logs())

        def seen():
            return json.loads(post(rig, {"do": "read"})["message"])["procedure"]
        until("the page says that a rig is being commissioned, and by whom", "document.getElementById('state').textContent === 'commissioning' && "
              "/^Ada[ ,(:]/.test(document.getElementById('reason').textContent)")
        asked = []
        for value in ("yes", "-60 130 -30 30 free"):
            question = rig.wait_for(lambda _: seen()["question"], SOON) and seen()["question"]
            if not checks.check(question is not None, "a person is asked something", str(seen())):
                return
            words = json.dumps("asked: " + question["text"])
            until(f"what is asked is on the page: {question['id']}", f"document.getElementById('reason').textContent.includes({words})")
            asked.append(question["id"])
            checks.check(post(rig, {"do": "answer", "id": question["id"], "value": value}).get("accepted") is True,
                         f"{question['id']} is answered", value)
        checks.check(len(set(asked)) == 2, "the page has followed from one question to the next", str(asked))
        lines = rig.wait_for(lambda _: len(seen()["lines"]) > 0, SOON) and seen()["lines"]
        until("each line of the dialogue is among the events", f"{json.dumps(lines)}.every(line => document.getElementById('events').textContent.includes(line))")
        free = page.ask("evaluate", script="[...document.querySelectorAll('button, input, select, a')].filter(e => !e.disabled).map(e => e.id || e.className)")
        checks.equal(free.get("value"), ["skip", "sound"], "nobody can answer, move or stop anything there")
        page.ask("shot", file=os.path.join(live_page.SHOTS, "commissioning.png"), width=1920, height=1080, scheme="light")
        wide = page.ask("shot", file=os.path.join(live_page.SHOTS, "commissioning-phone.png"), width=390, height=844, scheme="dark").get("value", 10**6)
        checks.check(wide <= 390, "it fits a phone", str(wide))
        post(rig, {"do": "end"})
        until("its end is shown", "document.getElementById('state').textContent !== 'commissioning'")
    finally:
        rig.stop()


def main():
    programs = r.programs_from_command_line(__doc__)
    checks = r.Checks()
    os.makedirs(live_page.SHOTS, exist_ok=True)
    page = live_page.Page()
    try:
        for part in (check_guard, check_commissioning):
            with tempfile.TemporaryDirectory(prefix="vibrig-outside-") as folder:
                part(checks, programs, folder, page)
        # What the browser says of a connection that was cut is no error of the page's.
        errors = [e for e in page.ask("errors").get("value", ["?"]) if not any(known in e for known in ("WebSocket", "ERR_"))]
        checks.check(errors == [], "no error in the browser's console", str(errors))
    finally:
        page.end()
    return checks.end()


if __name__ == "__main__":
    sys.exit(main())
