#!/usr/bin/python3
"""Simulated rigs of which nothing is known, drawn by chance, each commissioned by script on the seqpacket bus and the rig's clock: all
are named, and as they are.

usage: random_plants.py PROGRAMS [--soak | --seed N]     one of some seeds; all hundred; or this one
"""
import json
import math
import os
import random
import sys
import tempfile

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import rig as r  # noqa: E402

GIMBALS = ("outer", "inner", "azimuth")
SIGNALS = ("Resolvers.Outer", "Resolvers.Inner", "ResolverAzimuth.Azimuth")
SLICE, ALL = (1, 2, 3), range(1, 101)
CAMPAIGN = {"name": "random", "identify": "what-it-can", "positions_deg": [[-90, 0, 0]], "table_g": [5.0], "dwell_s": 10.0}
ARCMIN = math.radians(1 / 60)


def product(a, b):
    return [[sum(a[i][k] * b[k][j] for k in range(3)) for j in range(3)] for i in range(3)]


def inverse(m):
    def minor(i, j):
        (a, b), (c, d) = [[m[y][x] for x in range(3) if x != j] for y in range(3) if y != i]
        return a * d - b * c
    cofactors = [[(-1) ** (i + j) * minor(i, j) for j in range(3)] for i in range(3)]
    determinant = sum(m[0][j] * cofactors[0][j] for j in range(3))
    return [[cofactors[j][i] / determinant for j in range(3)] for i in range(3)]


def determinant_of(m):
    return sum(m[0][j] * (m[1][(j + 1) % 3] * m[2][(j + 2) % 3] - m[1][(j + 2) % 3] * m[2][(j + 1) % 3]) for j in range(3))


def torquers_of(seed):
    """Some wired the wrong way round, 3 % off."""
    draw = random.Random(1000 + seed)
    return [draw.choice([-1, 1]) * draw.uniform(0.97, 1.03) for _ in range(3)]


def drawn(seed):
    """The truth of a rig, with the errors of section 10's; 2 in 3 on a level base."""
    draw = random.Random(seed)
    order, wired = draw.sample(range(3), 3), draw.sample(range(3), 3)
    raw = [[0.0] * 3 for _ in range(3)]   # of the platform's force
    for i in range(3):
        way = draw.choice([-1, 1])
        for k in range(3):
            raw[i][k] = way * (1 + draw.gauss(0, 0.01) if k == wired[i] else draw.gauss(0, 10 * ARCMIN))
    names = [GIMBALS[k] for k in order]
    return {"site": {"latitude_deg": draw.choice([-1, 1]) * draw.uniform(15, 70), "azimuth_deg": draw.uniform(-180, 180),
                     "base_tilt_deg": [draw.uniform(-1, 1), draw.uniform(-1, 1)] if draw.random() < 1 / 3 else [0.0, 0.0]},
            "platform": {"channel": names, "command_channel": names, "encoder_sign": [draw.choice([-1, 1]) for _ in range(3)],
                         "encoder_zero_deg": [draw.uniform(-180, 180), draw.uniform(-15, 15), draw.uniform(-180, 180)],
                         "non_orthogonality_arcsec": [draw.gauss(0, 120), draw.gauss(0, 120)], "drift_sign": draw.choice([-1, 1]),
                         "torquer_scale": torquers_of(seed)},
            "accelerometer": {"matrix": inverse(raw), "zero_g": [draw.gauss(0, 0.005) for _ in range(3)]},
            "coefficients": draw.random()}


def coefficients(seed, names):
    draw = random.Random(seed)
    sigma = {"F": 2.0, "I": 1.0, "O": 1.0, "S": 1.0}
    return {name: draw.gauss(0, sigma.get(name.removeprefix("D_")[:-1], 0.03)) for name in names}


def up_at(angles_deg, elevation_deg):
    """The vertical in platform axes (up = +y), docs/theory."""
    (ca, sa), (cb, sb), (cg, sg) = [(math.cos(math.radians(a)), math.sin(math.radians(a))) for a in angles_deg]
    ce, se = math.cos(math.radians(elevation_deg)), math.sin(math.radians(elevation_deg))
    x, y, z = cb * se + sb * sa * ce, ca * ce, -sb * se + cb * sa * ce
    return [cg * x - sg * y, sg * x + cg * y, z]


def turned(v, axis, degrees):
    """About north (0), up (1) or east (2)."""
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    a, b = (axis + 1) % 3, (axis + 2) % 3
    out = list(v)
    out[a], out[b] = c * v[a] - s * v[b], s * v[a] + c * v[b]
    return out


class Expected:
    """What is to be found of a truth: up to the end of the outer axis and, since the platform's axes have no marks, their names."""

    def __init__(self, truth, found):
        platform = truth["platform"]
        self.sign, self.zero = list(platform["encoder_sign"]), list(platform["encoder_zero_deg"])
        self.azimuth = truth["site"]["azimuth_deg"]
        tilt_north, tilt_east = truth["site"]["base_tilt_deg"]
        # Of the rig's axes: the base leans about north, which shifts the outer zero, then about east, the elevation.
        north, up, east = turned(turned([0, 1, 0], 0, -tilt_north), 2, -tilt_east)
        self.elevation = math.degrees(math.asin(north))
        self.zero[0] += self.sign[0] * math.degrees(math.atan2(-east, up))
        self.matrix = truth["accelerometer"]["matrix"]
        self.turns = product(found["accelerometer.matrix"], inverse(self.matrix))
        if self.sign[0] < 0:   # the other end of the outer axis
            self.flip(0, 1)
            self.azimuth, self.elevation = self.azimuth + 180, -self.elevation
        if self.turns[2][2] < 0:   # platform z the other way, and x with it
            self.flip(1, 2)
            self.matrix = product([[-1, 0, 0], [0, 1, 0], [0, 0, -1]], self.matrix)
        for _ in range(4):   # and turned about it
            if sum(product(found["accelerometer.matrix"], inverse(self.matrix))[i][i] for i in range(3)) > 2.5:
                break
            self.matrix = product([[0, 1, 0], [-1, 0, 0], [0, 0, 1]], self.matrix)
            self.zero[2] += 90 * self.sign[2]
        # Accelerometers that are turned alike, by their misalignment, define the azimuth zero (10' each, 1 sigma): one quantity.
        turn = product(found["accelerometer.matrix"], inverse(self.matrix))
        self.turn = (turn[1][0] - turn[0][1]) / 2
        self.matrix = product([[1, -self.turn, 0], [self.turn, 1, 0], [0, 0, 1]], self.matrix)
        self.zero[2] -= math.degrees(self.turn) * self.sign[2]

    def flip(self, *signs):
        for k in signs:
            self.sign[k] = -self.sign[k]
        for k in (0, 2):
            self.zero[k] += 180


def answers_of(truth, start, folder):
    """Of people who say what is so."""
    platform, site = truth["platform"], truth["site"]
    sign, zero = platform["encoder_sign"], platform["encoder_zero_deg"]
    outer = platform["channel"].index("outer")
    lowest, highest = (-60, 130)
    # The free drift with the azimuth axis upright goes to the end that is nearer, of those within the travel.
    at = sign[0] * math.remainder(start[outer] - zero[0], 360)
    ends = sorted((math.remainder(end - at, 360) * sign[0] for end in (90, -90)),
                  key=lambda t: abs(t) + 1e3 * abs(t - min(max(t, lowest), highest)))
    upright = at + sign[0] * ends[0]
    answers = {"power": "yes", "permit.hold": "yes", "permit.torque": "yes", "names": "torquers", "travel": "-60 130 -30 30 free",
            "latitude": site["latitude_deg"], "compass": site["azimuth_deg"] + 7,
            "drawing": "yes" if determinant_of(truth["accelerometer"]["matrix"]) > 0 else "no",
            "anticlockwise": "yes" if (sign[2] < 0) == (math.sin(math.radians(upright)) > 0) else "no"}
    for slot, name in enumerate(platform["channel"]):
        answers["permit." + GIMBALS[slot]], answers["which." + GIMBALS[slot]] = "yes", name
    path = os.path.join(folder, "answers.json")
    with open(path, "w", encoding="utf-8") as file:
        json.dump(answers, file)
    return path


def off(found, expected):
    return max(abs(math.remainder(f - e, 360)) for f, e in zip(found, expected))


def compare(checks, seed, truth, result, minutes):
    found, expected = result["found"], Expected(truth, result["found"])
    named = [found.get("can.signals." + g, SIGNALS[k]) for k, g in enumerate(GIMBALS)]
    right = [SIGNALS[truth["platform"]["channel"].index(g)] for g in GIMBALS]
    zeros = [found["accelerometer.zero_g"][i] - truth["accelerometer"]["zero_g"][i] for i in range(3)]
    matrix = [found["accelerometer.matrix"][i][k] - expected.matrix[i][k] for i in range(3) for k in range(3)]
    zero = found["platform.encoder_zero_deg"]
    # Named as the torquers are, an axis is the truth's or counts the other way.
    torquers, scale = truth["platform"]["torquer_scale"], result["evidence"]["torquers"]["scale"]
    senses = [math.copysign(1, torquers[k] * expected.turns[k][k]) for k in range(3)]
    good = {
        f"torquers {found.get('levelling.torque_sign')}, are {senses}": found.get("levelling.torque_sign") == senses,
        f"scales {scale} of {torquers}": all(abs(s - abs(t)) < 0.01 for s, t in zip(scale, torquers)),
        f"axes {expected.turns}": min(abs(expected.turns[k][k]) for k in range(3)) > 0.9,
        f"channels {named}, are {right}": named == right,
        f"signs {found['platform.encoder_sign']}, are {expected.sign}": found["platform.encoder_sign"] == expected.sign,
        f"encoder zeros {zero}, are {expected.zero}": off(zero[:2], expected.zero[:2]) < 0.1 and off(zero[2:], expected.zero[2:]) < 0.3,
        f"accelerometer zeros off by {zeros} g": max(map(abs, zeros)) < 2e-3,
        f"matrix off by {matrix}": max(map(abs, matrix)) < 5e-3,
        f"azimuth {found['site.azimuth_deg']}, is {expected.azimuth}": off([found["site.azimuth_deg"]], [expected.azimuth]) < 1,
        f"elevation {found['site.elevation_deg']}, is {expected.elevation}": abs(found["site.elevation_deg"] - expected.elevation) < 0.05,
        f"accelerometers turned by {expected.turn:.4f}": abs(expected.turn) < 4 * 10 / math.sqrt(2) * ARCMIN,
        f"{minutes:.1f} minutes": minutes < 15,
    }
    wrong = [what for what, so in good.items() if not so]
    checks.check(not wrong, f"rig {seed} is named as it is, in {minutes:.1f} minutes of the rig's time", "\n".join(wrong))


def rig_time_s(rig):
    return float(rig.order("status").split()[2])


def commission(checks, programs, folder, seed):
    truth = drawn(seed)
    rig = r.Rig(programs, "seqpacket", "rig", folder, poll_s=0.1)
    try:
        draw = truth.pop("coefficients")
        path = rig.truth_file(truth)
        with open(path, encoding="utf-8") as file:
            whole = json.load(file)
        whole["coefficients"] = coefficients(draw, whole["coefficients"])
        with open(path, "w", encoding="utf-8") as file:
            json.dump(whole, file)
        rig.start_plant("--seed", str(seed), "--warm-up", "1", "--start-temperature", "45", "--truth", path)
        rig.configure(CAMPAIGN)
        rig.start_daemon()
        rig.wait_for(lambda s: s["platform"].get("ready") and s["shaker"].get("rest") == "at rest" and
                     all(c.get("value") is not None for c in s["sample"]["channels"][:6]), 60)
        start = [c["value"] for c in rig.status()["sample"]["channels"][:3]]
        # What this dialogue needs to answer passes on the rig's clock as well: not at the 400 times of a rig nobody waits for.
        rig.order("speed 100")
        began = rig_time_s(rig)
        run = rig.tool("commission", "--by", "Ada", "--json", "--answers", answers_of(truth, start, folder), timeout=300)
        minutes = (rig_time_s(rig) - began) / 60
        try:
            result = json.loads(run.stdout)
        except ValueError:
            result = {"outcome": "", "why": run.stderr}
        if checks.equal(result["outcome"], "decided", f"rig {seed} is decided"):
            compare(checks, seed, truth, result, minutes)
        else:
            checks.note(f"{result['why']}\n{truth}\n{rig.logs()}")
    finally:
        rig.stop()


def main():
    programs = r.programs_from_command_line(__doc__)
    seeds = SLICE
    if "--soak" in sys.argv:
        seeds = ALL
    if "--seed" in sys.argv:
        seeds = [int(sys.argv[sys.argv.index("--seed") + 1])]
    checks = r.Checks()
    for seed in seeds:
        with tempfile.TemporaryDirectory() as folder:
            commission(checks, programs, folder, seed)
    return checks.end()


if __name__ == "__main__":
    sys.exit(main())
