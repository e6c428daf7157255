#!/usr/bin/python3
"""Resident memory of vibrigd within one campaign of many dwells, each as long as real ones, recorded, its status asked for
all the while, on the seqpacket bus and the rig's clock.

usage: memory_campaign.py PROGRAMS [--dwells N] [--dwell-s S]
"""
import argparse
import os
import statistics
import sys
import tempfile
import time

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import rig as r  # noqa: E402

LIMIT_KB_PER_H = 100   # of the rig's time
WARM = 140             # dwells until caches have their size; of the newest 128 more is kept than of those before
TOGETHER = 70          # dwells of which the least is taken: what a verdict or an answer has while it is made is not kept


def resident_kb(rig):
    with open(f"/proc/{rig.daemon.process.pid}/status", encoding="ascii") as file:
        return next(int(line.split()[1]) for line in file if line.startswith("VmRSS"))


def growth_kb_per_h(looks):
    """Slope of the least of each so many dwells: what the system gives comes in pieces, of which two alone would not do."""
    least = {}
    for dwells, hours, kilobytes in looks:
        group = dwells // TOGETHER
        least[group] = min(least.get(group, (kilobytes, hours)), (kilobytes, hours))
    return statistics.linear_regression([hours for _, hours in least.values()], [kb for kb, _ in least.values()]).slope


def main():
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("programs")
    options.add_argument("--dwells", type=int, default=420)
    options.add_argument("--dwell-s", type=float, default=100.0)
    given = options.parse_args()
    checks = r.Checks()
    campaign = {"name": "many", "identify": "what-it-can", "positions_deg": [[0, 0, 0], [0, 0, 2]] * (given.dwells // 4),
                "table_g": [9.0, 7.0], "dwell_s": given.dwell_s, "settle_s": 2.0, "ramp_s": 0.5, "temperature_window_s": 0.0}
    looks = []   # dwells, h of the rig, kB
    with tempfile.TemporaryDirectory() as folder:
        rig = r.Rig(given.programs, "seqpacket", "rig", folder)
        try:
            rig.start_plant("--seed", "3", "--warm-up", "1", "--start-temperature", "45")
            rig.configure(campaign)
            rig.start_daemon()
            rig.wait_for(lambda s: s["can"]["link"] == "running" and s["shaker"].get("rest") == "at rest" and
                         s["platform"].get("ready"), 60)
            said = [rig.tool(command, "--by", "tester").stderr for command in ("arm", "start")]
            end, status = time.monotonic() + 1500, None
            while time.monotonic() < end:
                status = rig.status()
                if status is None or status["campaign"]["state"] in ("finished", "aborted", "tripped", "idle"):
                    break
                looks.append((len(status["campaign"]["dwells"]), status["uptime_s"] / 3600, resident_kb(rig)))
                time.sleep(0.5)
            checks.equal(r.state_of(status), "finished", f"a campaign of {given.dwells} dwells finishes {''.join(said)}")
        finally:
            rig.stop()
    warm = [look for look in looks if look[0] >= WARM]
    if checks.check(len(warm) >= 20, "it was looked at meanwhile", looks):
        growth = growth_kb_per_h(warm)
        checks.note(f"{warm[0][2]} kB after {warm[0][0]} dwells and {warm[0][1]:.1f} h, {warm[-1][2]} kB after {warm[-1][0]} and "
                    f"{warm[-1][1]:.1f} h: {growth:.0f} kB per hour of the rig")
        checks.check(growth <= LIMIT_KB_PER_H, f"resident memory grows by {LIMIT_KB_PER_H} kB per hour at most",
                     f"{growth:.0f}: {looks[::8]}")
    return checks.end()


if __name__ == "__main__":
    sys.exit(main())
