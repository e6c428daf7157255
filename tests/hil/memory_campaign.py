#!/usr/bin/python3
"""Resident memory of vibrigd within one campaign of many dwells, recorded, its status asked for all the while, on the
seqpacket bus and the rig's clock. Short dwells stand for those of 110 s in what grows with their number; what grows with
the samples of a recording is seen by --soak alone, which has 420 dwells of 100 s: 13 h of the rig.

usage: memory_campaign.py PROGRAMS [--dwells N] [--soak]
"""
import argparse
import os
import sys
import tempfile
import time

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import rig as r  # noqa: E402

LIMIT_KB_PER_H = 100
# Of each dwell a result, a status and the disk's library keep 1.2 kB, 40 kB per hour; what a campaign knows beforehand that it
# will need (rows of the filter, curves of the page) is there from its beginning. The system counts by pages, and a heap that many
# threads share has some free places more as those of a moment meet: some 200 kB either way, whatever the machine is busy with. In
# the short run that is 10 of such a rate.
DWELLS_PER_H = 3600 / 110   # of 100 s, with ramps, settling and slews
WARM = 140                  # dwells until caches and buffers have their size
TOGETHER = 80               # dwells of which the least is taken: what a verdict has while it is made is not kept
LOOKS = 40                  # or so many looks, where that is more


def resident_kb(rig):
    """By the pages themselves: VmRSS is a sum over CPUs that lags behind by up to 128 kB each."""
    with open(f"/proc/{rig.daemon.process.pid}/smaps_rollup", encoding="ascii") as file:
        return next(int(line.split()[1]) for line in file if line.startswith("Rss:"))


def least(looks, together):
    """Of the first ones: a busy machine is looked at less often, and more often while a verdict is made."""
    return min(looks[:max(together, min(LOOKS, len(looks) // 3))], key=lambda look: look[1])


def campaign_of(given, checks):
    """One campaign: growth in kB per hour of the rig; None: it was not looked at."""
    campaign = {"name": "many", "identify": "what-it-can", "positions_deg": [[0, 0, 0], [0, 0, 2]] * (given.dwells // 4),
                "table_g": [9.0, 7.0], "dwell_s": 100.0 if given.soak else 2.0, "settle_s": 2.0, "ramp_s": 0.5, "temperature_window_s": 0.0}
    looks = []   # dwells, kB
    with tempfile.TemporaryDirectory() as folder:
        rig = r.Rig(given.programs, "seqpacket", "rig", folder)
        try:
            rig.start_plant("--seed", "3", "--warm-up", "1", "--start-temperature", "45")
            rig.configure(campaign)
            rig.start_daemon()
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
                looks.append((len(status["campaign"]["dwells"]), resident_kb(rig)))
            checks.equal(r.state_of(status), "finished", f"a campaign of {given.dwells} dwells finishes {''.join(said)}")
        finally:
            rig.stop()
    warm = [look for look in looks if look[0] >= WARM]
    if not checks.check(len(warm) >= 10, "it was looked at meanwhile", looks):
        return None
    first, before = least(warm, sum(look[0] < warm[0][0] + TOGETHER for look in warm))
    last, after = least(warm[::-1], sum(look[0] > warm[-1][0] - TOGETHER for look in warm))
    growth = (after - before) / (last - first) * DWELLS_PER_H
    checks.note(f"{before} kB after {first} dwells, {after} kB after {last}: {growth:.0f} kB per hour of the rig; {looks[::8]}")
    return growth


def main():
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("programs")
    options.add_argument("--dwells", type=int)
    options.add_argument("--soak", action="store_true")
    given = options.parse_args()
    given.dwells = given.dwells or (420 if given.soak else 840)
    checks = r.Checks()
    # What a campaign keeps it keeps each time; free places that a busy machine scattered in the heap are of one.
    growths = []
    while len(growths) < 3 and (not growths or (growths[-1] or 0) > LIMIT_KB_PER_H):
        growths.append(campaign_of(given, checks))
    known = [growth for growth in growths if growth is not None]
    checks.check(known and min(known) <= LIMIT_KB_PER_H, f"resident memory grows by {LIMIT_KB_PER_H} kB per hour at most", growths)
    return checks.end()


if __name__ == "__main__":
    sys.exit(main())
