#!/usr/bin/python3
"""Memory of vibrigd within one campaign of many dwells, recorded, its status asked for all the while, on the seqpacket bus
and the rig's clock: what it holds by its own count, and what is resident. Short dwells stand for those of 110 s in what grows with their number; what grows with
the samples of a recording is seen by --soak alone, which has 420 dwells of 100 s: 13 h of the rig.

usage: memory_campaign.py PROGRAMS [--dwells N] [--soak]
"""
import argparse
import os
import re
import sys
import tempfile
import time
import urllib.request

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import rig as r  # noqa: E402

# Of each dwell a result, a status and the disk's library keep 1.2 kB, 40 kB per hour; what a campaign knows beforehand that it
# will need (rows of the filter, curves of the page) is there from its beginning.
HELD_KB_PER_H = 100
# The system counts by pages, and a heap that many threads share has places that an answer or a verdict has left and the next one
# takes again: of each dwell 4.6 kB, 150 kB per hour, and some 200 kB either way, in the short run 10 of such a rate.
RESIDENT_KB_PER_H = 200
DWELLS_PER_H = 3600 / 110   # of 100 s, with ramps, settling and slews
WARM = 140                  # dwells until caches and buffers have their size
TOGETHER = 80               # dwells of which the least is taken: what a verdict has while it is made is not kept
LOOKS = 40                  # or so many looks, where that is more


def resident_kb(rig):
    """By the pages themselves: VmRSS is a sum over CPUs that lags behind by up to 128 kB each."""
    with open(f"/proc/{rig.daemon.process.pid}/smaps_rollup", encoding="ascii") as file:
        return next(int(line.split()[1]) for line in file if line.startswith("Rss:"))


def held_kb(address):
    with urllib.request.urlopen(address + "metrics", timeout=10) as answer:
        return float(re.search(r"^vibrig_heap_used_bytes (\S+)$", answer.read().decode(), re.M).group(1)) / 1024


def growth(looks, what):
    """kB per hour of the rig, of what is in this place of each look."""
    def least(some, together):   # of the first ones: a busy machine is looked at less often, and more often while a verdict is made
        return min(some[:max(together, min(LOOKS, len(some) // 3))], key=lambda look: look[what])
    before = least(looks, sum(look[0] < looks[0][0] + TOGETHER for look in looks))
    after = least(looks[::-1], sum(look[0] > looks[-1][0] - TOGETHER for look in looks))
    return (after[what] - before[what]) / (after[0] - before[0]) * DWELLS_PER_H


def campaign_of(given, checks):
    """One campaign: growth of what it holds and of what is resident, kB per hour of the rig; None: it was not looked at."""
    campaign = {"name": "many", "identify": "what-it-can", "positions_deg": [[0, 0, 0], [0, 0, 2]] * (given.dwells // 4),
                "table_g": [9.0, 7.0], "dwell_s": 100.0 if given.soak else 2.0, "settle_s": 2.0, "ramp_s": 0.5, "temperature_window_s": 0.0}
    looks = []   # dwells, kB held, kB resident
    with tempfile.TemporaryDirectory() as folder:
        rig = r.Rig(given.programs, "seqpacket", "rig", folder)
        try:
            rig.start_plant("--seed", "3", "--warm-up", "1", "--start-temperature", "45")
            rig.configure(campaign, server={"page": "127.0.0.1:0"})
            rig.start_daemon()
            address = rig.page_address()
            rig.wait_for(lambda s: s["can"]["link"] == "running" and s["shaker"].get("rest") == "at rest" and
                         s["platform"].get("ready"), 60)
            said = [rig.tool(command, "--by", "tester").stderr for command in ("arm", "start")]
            end, status = time.monotonic() + (3000 if given.soak else 1500), None
            while time.monotonic() < end:
                status = rig.status()
                if status is None or status["campaign"]["state"] in ("finished", "aborted", "tripped", "idle"):
                    break
                # Not at once: what an answer has while it is made grows with the dwells, too, and is not kept.
                time.sleep(0.5)
                looks.append((len(status["campaign"]["dwells"]), held_kb(address), resident_kb(rig)))
            checks.equal(r.state_of(status), "finished", f"a campaign of {given.dwells} dwells finishes {''.join(said)}")
        finally:
            rig.stop()
    warm = [look for look in looks if WARM <= look[0] < given.dwells - 10]   # with the last one the campaign gives its own back
    if not checks.check(len(warm) >= 10, "it was looked at meanwhile", looks):
        return None
    held, resident = growth(warm, 1), growth(warm, 2)
    checks.note(f"{held:.0f} kB held and {resident:.0f} kB resident per hour of the rig; {looks[::8]}")
    return held, resident


def main():
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("programs")
    options.add_argument("--dwells", type=int)
    options.add_argument("--soak", action="store_true")
    given = options.parse_args()
    given.dwells = given.dwells or (420 if given.soak else 840)
    checks = r.Checks()
    grown = campaign_of(given, checks)
    for kb, limit, what in zip(grown or (None, None), (HELD_KB_PER_H, RESIDENT_KB_PER_H), ("what it holds", "resident memory")):
        checks.check(kb is not None and kb <= limit, f"{what} grows by {limit} kB per hour at most", grown)
    return checks.end()


if __name__ == "__main__":
    sys.exit(main())
