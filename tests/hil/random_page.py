#!/usr/bin/python3
"""What the live page shows of a rig that shakes in several ways, in Chromium: at rest, under a sine and under a random profile
with what is commanded, measured and allowed. Screenshots stay in build/tests/live-page for a person to look at.

usage: random_page.py PROGRAMS     environment: VIBRIG_BROWSER_NPM, the folder with playwright-core's node_modules
"""
import math
import os
import sys
import tempfile

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import live_page  # noqa: E402
import random_campaign as c  # noqa: E402
import rig as r  # noqa: E402

COMMANDED = math.sqrt(2) * 10 ** (c.LEVEL_DB / 20)   # rms of the profile at its level
ROWS = "Object.fromEntries([...document.querySelectorAll('#vibration dt')].map(t => [t.textContent, t.nextSibling.textContent]))"


def shots(checks, page, name):
    os.makedirs(live_page.SHOTS, exist_ok=True)
    for size, width, height, scheme in (("wall", 1920, 1080, "dark"), ("desktop", 1400, 1000, "light"), ("phone", 390, 844, "light")):
        wide = page.ask("shot", file=os.path.join(live_page.SHOTS, f"{name}-{size}.png"), width=width, height=height, scheme=scheme).get("value")
        checks.check(wide is not None and wide <= width, f"{name}, {size}: nothing to scroll sideways", str(wide))
        live_page.check_whole(checks, page, f"{name}, {size}", height if size == "wall" else None)


def rows_of(page):
    return page.ask("evaluate", script=ROWS).get("value") or {}


def under_random(checks, page, rows):
    checks.equal((rows.get("kind"), rows.get("profile")), ("random", f"broad (number {c.NUMBER}), {c.LEVEL_DB:.1f} dB"), "kind, profile and level are shown")
    g = {name: float(rows.get(name, "nan").split()[0]) for name in ("commanded", "controller", "platform", "table")}
    checks.check(abs(g["commanded"] - COMMANDED) < 0.001, "what is commanded is the profile's rms at its level", str(rows))
    # 3 dB are the bands: a mean over 2.9 s is beyond them once in 8e5 looks, and the dwell has settled for longer.
    checks.check(all(abs(20 * math.log10(g[name] / COMMANDED)) < 3 for name in ("controller", "platform", "table")),
                 "controller, platform and table show it", str(rows))
    checks.check(all(text.endswith(" g rms") for name, text in rows.items() if name in g or name == "band"), "rms, and said so", str(rows))
    said = page.ask("evaluate", script="[document.getElementById('command').textContent, document.getElementById('stops').textContent]").get("value")
    checks.check("at random" in said[0] and "Hz" not in said[0], "beside the amplitude, too, there is no frequency", str(said))
    checks.check("run 2, 1.19 g" in said[1], "levels are rounded for people", str(said))
    low, high = (float(x) for x in rows.get("band", "nan to nan").replace(" g rms", "").split(" to "))
    checks.check(abs(low / COMMANDED - 10 ** -0.15) < 0.002 and abs(high / COMMANDED - 10 ** 0.15) < 0.002, "with the bands of 3 dB", str(rows))
    checks.equal(page.ask("evaluate", script="document.querySelectorAll('#c-psd .u-over').length").get("value"), 1, "the profile's PSD is drawn")
    label = page.ask("evaluate", script="document.getElementById('c-psd').getAttribute('aria-label')").get("value") or ""
    checks.check("20 to 120 Hz" in label and "at the table" in label, "and said for whom does not see it", label)
    checks.equal(page.ask("evaluate", script="document.querySelectorAll('#vibration-card button, #vibration-card input').length").get("value"), 0,
                 "nothing there commands")


def look(checks, programs, folder):
    rig, page = r.Rig(programs, "seqpacket", "rig", folder, poll_s=0.1), None
    try:
        planned = c.plan_of(folder, 1)
        c.start(rig, planned, 40.0, "--speed", "10", server={"page": f"127.0.0.1:{live_page.free_port()}"}, begin=False)
        address, page = rig.page_address(), live_page.Page()
        page.ask("open", url=address)

        def until(text, script, timeout_s=120):
            checks.check(page.until(script, timeout_s).get("value"), text, f"{rows_of(page)}\n{rig.logs()}")
        until("at rest the page says so", f"({ROWS}).kind === 'rest'")
        live_page.start_campaign(checks, rig, "a campaign with a sine and random dwells starts")
        recording = "document.getElementById('state').textContent === 'recording'"
        # All of it in the look that finds the sine: asked once more, a page may be in the next dwell.
        until("a sine is shown with its frequency",
              f"(() => {{ const rows = {ROWS}; if (!({recording} && rows.kind === 'sine' && rows.frequency === '15.00 Hz')) return false; "
              "window.sine = [rows.commanded, document.getElementById('c-psd').hidden]; return true; })()")
        commanded, hidden = page.ask("evaluate", script="window.sine").get("value") or ("", None)
        checks.check(commanded.endswith(" g peak"), "and its peak", commanded)
        checks.equal(hidden, True, "a sine has no PSD")
        until("then a random dwell", f"{recording} && ({ROWS}).kind === 'random' && ({ROWS})['controller reports'] === 'at level' && ({ROWS}).table !== 'not known'")
        rig.order("speed 1")   # it stays until all was looked at
        under_random(checks, page, rows_of(page))
        shots(checks, page, "random")
        live_page.check_accessible(checks, page, "under random vibration")
        checks.equal(page.ask("errors").get("value", []), [], "the page has no error to tell")
    finally:
        if page is not None:
            page.end()
        rig.stop()


def main():
    programs = r.programs_from_command_line(__doc__)
    checks = r.Checks()
    with tempfile.TemporaryDirectory() as folder:
        look(checks, programs, folder)
    return checks.end()


if __name__ == "__main__":
    sys.exit(main())
