#!/usr/bin/python3
"""The stages with the table at rest, levelling and zeroing, over the seqpacket bus on the rig's clock.

usage: stages_campaign.py PROGRAMS [--seeds N]    N: of the campaigns with both stages; none, for the unit tests LevelledZeros draw them
"""
import argparse
import json
import math
import os
import random
import sys
import tempfile

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import rig as r  # noqa: E402

TABLE1 = [[0, 0, 0], [0, 0, 45], [0, 0, 90], [0, 0, 180], [180, 0, 45], [45, 0, 0], [45, 0, 90], [90, 0, 90],
          [90, 0, 180], [180, 0, 270], [270, 0, 0], [270, 0, 90], [-45, 0, 0], [-45, 0, 90]]
SHORT = {"name": "stages", "identify": "what-it-can", "positions_deg": [[0, 0, 0], [45, 0, 90]], "table_g": [9.0],
         "dwell_s": 10.0}
LEVELLING = {**SHORT, "levelling": True}
TRANSMISSION = 2 / 3
NAMES = ("F", "I", "O", "S", "II", "OO", "SS", "IO", "IS", "OS")


class Run:
    """One campaign from arming to its end."""

    def __init__(self, programs, campaign, truth=None, timeout_s=600, seed=3, **tables):
        with tempfile.TemporaryDirectory() as folder:
            rig = r.Rig(programs, "seqpacket", "rig", folder)
            try:
                rig.start_plant("--seed", str(seed), "--truth", rig.truth_file(truth or {}))
                rig.configure(campaign, **tables)
                rig.start_daemon()
                rig.wait_for(r.measuring, 30)
                self.commands = [rig.tool(command, "--by", "tester") for command in ("arm", "start")]
                self.last = rig.wait_for_state(("finished", "aborted", "tripped"), timeout_s)
                self.text, (_, result) = rig.daemon.text(), rig.result()
                self.result = json.loads(result) if result else None
                self.plant = rig.plant.text()
            finally:
                rig.stop()

    def ended(self, checks, state, text):
        return checks.check(self.last is not None and self.last["campaign"]["state"] == state, text,
                            f"{r.state_of(self.last)} {[c.stderr for c in self.commands]}\n{self.text[-4000:]}")

    def reason(self):
        return self.last["campaign"].get("reason", "") if self.last else ""

    def events(self, word):
        return [line for line in self.text.splitlines() if word in line]

    def kappas(self):
        return [dwell["kappa"] for dwell in self.last["campaign"]["dwells"]]


def failed_once(checks, run, words, text):
    """Aborted, said once, and the table has not moved."""
    run.ended(checks, "aborted", text + ": the campaign is aborted")
    for word in words:
        checks.check(word in run.reason(), f"{text}: the reason names \"{word}\"", run.reason())
    logged = [line for line in run.events("error campaign") if "gravity" not in line]   # which a wrong zero turns as well
    checks.check(len(logged) == 1, f"{text}: one event says so", "\n".join(logged))
    checks.check(not run.last["campaign"]["dwells"], f"{text}: no data were taken")


def levelling(checks, programs):
    run = Run(programs, LEVELLING, {"platform": {"slew_error_deg": 0.2}})
    if run.ended(checks, "finished", "a levelled campaign finishes"):
        checks.equal(len(run.events("level after")), 2, "each position was levelled")
        level = run.last["campaign"]["level"]
        checks.check(level["verdict"] == "settled" and level["done"] == 2, "the status says so", level)
        # Ts + W + 1/sigma + 5 %, sigma = 5.25 / Ts
        checks.check(level["time_s"] <= 1.05 * (100 + 10 + 100 / 5.25), "within Ts + W + 1/sigma + 5 %", level["time_s"])
        drift = run.last["noise"].get("level", {})
        checks.check(drift.get("samples") == 2 and drift["mean_square"] < 5,
                     "the drift that each levelling found has gone to the noise monitor", drift)
        checks.check(max(abs(t) for t in level["tilt_arcmin"]) <= level["tolerance_arcmin"], "within the tolerance", level)
    run = Run(programs, LEVELLING, {"platform": {"slew_error_deg": 0.2, "torquer_scale": [-1, -1, -1]}})
    failed_once(checks, run, ["cannot settle", "sign or axes of the torquers"], "torquers the wrong way round")
    run = Run(programs, {**LEVELLING, "positions_deg": [[0, 0, 0]]}, {"platform": {"torquer_scale": [-1, -1, -1]}},
              levelling={"torque_sign": [-1, -1, -1]})
    run.ended(checks, "finished", "levelling.torque_sign turns them round")
    run = Run(programs, {**LEVELLING, "positions_deg": [[0, 0, 0]]}, {"platform": {"torquer_scale": [0, 0, 0]}})
    failed_once(checks, run, ["not settled within 300 s"], "dead torquers")


def zero_failures(checks, programs):
    zeroing = {**SHORT, "zeroing": True}
    run = Run(programs, zeroing, {"platform": {"slew_deg_per_s": 4}})
    failed_once(checks, run, ["azimuth turns at", "commanded 5 deg/s"], "a slow azimuth")
    run = Run(programs, zeroing, {"platform": {"increment_sign": [-1, -1, -1]}})
    failed_once(checks, run, ["zeroing"], "gyro increments of the wrong sign")
    run = Run(programs, zeroing, {"accelerometer": {"zero_g": [0.02, 0, 0]}})
    failed_once(checks, run, ["outside the small-error range"], "a zero of 20 mg")


def both_ways(checks, programs):
    """Levelled first, then z up and z down: zeros, misalignments and scale of z apart."""
    zero_g, scale, cross = [0.004, -0.003, 0.002], 2e-4, [100, -50]
    matrix = [[1 / (1 + scale) if i == k else 0 for k in range(3)] for i in range(3)]  # raw to platform axes
    for i, arcsec in enumerate(cross):
        matrix[i][2] = -math.radians(arcsec / 3600)
    run = Run(programs, {**LEVELLING, "zeroing": True, "positions_deg": [[0, 0, 0]]},
              {"platform": {"slew_error_deg": 0.2}, "accelerometer": {"zero_g": zero_g, "matrix": matrix}},
              zeroing={"scale_factor": 1e-3})
    if not run.ended(checks, "finished", "a campaign with both stages, z up and z down, finishes"):
        return
    story = [word for line in run.text.splitlines() for word in ("level", "zeros") if word + " after" in line]
    checks.equal(story, ["level", "level", "zeros", "level", "level", "level", "zeros"],
                 "each run of the zeros is levelled first, before and after the position")
    zeros = run.last["campaign"]["zeros"]
    off = [abs(z - 1e3 * b) / s for z, b, s in zip(zeros["zero_mg"], zero_g, zeros["sigma_mg"])]
    checks.check(max(off) <= 5 and max(zeros["sigma_mg"]) <= 0.02, "the zeros come out, without misalignment and scale", zeros)
    checks.check(abs(zeros["scale_z_ppm"] - 1e6 * scale) <= 5 * zeros["scale_z_sigma_ppm"] <= 100,
                 "the scale of z comes out beside it", zeros)
    found = zip(zeros["misalignment_arcsec"], cross, zeros["misalignment_sigma_arcsec"])
    checks.check(all(abs(m - c) <= 5 * s <= 10 for m, c, s in found), "and the misalignments of x and y", zeros)
    checks.check(zeros["repeated_at_end"] and not zeros.get("mark"), "nothing has moved at the end", zeros)


def second_axis(checks, programs):
    """An outer gimbal that cannot turn z down: y is taken up and down instead, and the zeros are as pure."""
    zero_g, cross = [0.004, -0.003, 0.002], [100, -50]
    matrix = [[1.0 if i == k else 0.0 for k in range(3)] for i in range(3)]
    for i, arcsec in enumerate(cross):
        matrix[i][2] = -math.radians(arcsec / 3600)
    run = Run(programs, {**LEVELLING, "zeroing": True, "positions_deg": [[0, 0, 0]]},
              {"platform": {"slew_error_deg": 0.2}, "accelerometer": {"zero_g": zero_g, "matrix": matrix}},
              gimbal={"travel_deg": [[-80.0, 95.0], [-65.0, 65.0], [-180.0, 180.0]]})
    if not run.ended(checks, "finished", "a campaign with z up, y up and y down finishes"):
        return
    # each run levelled first, at the start and at the end, and the position
    checks.equal(len(run.events("level after")), 7, "each of the three runs was levelled")
    zeros = run.last["campaign"]["zeros"]
    off = [abs(z - 1e3 * b) / s for z, b, s in zip(zeros["zero_mg"], zero_g, zeros["sigma_mg"])]
    checks.check(max(off) <= 5 and max(zeros["sigma_mg"]) <= 0.02, "the zeros come out, without misalignment", zeros)
    found = zip(zeros["misalignment_arcsec"], cross, zeros["misalignment_sigma_arcsec"])
    checks.check(all(abs(m - c) <= 5 * s <= 10 for m, c, s in found), "and the misalignments of x and y", zeros)
    checks.check(zeros["repeated_at_end"] and not zeros.get("mark"), "nothing has moved at the end", zeros)


def seeds(checks, programs, count):
    """Whatever the slews end at and however the accelerometers are mounted, campaigns with both stages finish, and the
    zeros are as sure as they say."""
    squares = 0
    for seed in range(1, count + 1):
        draw = random.Random(seed)
        zero_g = [draw.uniform(-0.005, 0.005) for _ in range(3)]
        slew_error_deg = (0.02, 0.2)[seed % 2]
        accelerometer = {"zero_g": zero_g}
        # z up only, all axes exact and said to be so: half the time, and the sigmas are the filter's.
        zeroing, uncertainty = {"both_ways": False, "scale_factor": 0.0}, {"accelerometer_cross": 0.0}
        both = seed % 4 >= 2
        if both:   # misaligned by 50 arcsec, 1 sigma, as declared by default
            matrix = [[1.0 if i == k else 0.0 for k in range(3)] for i in range(3)]
            for i in range(2):
                matrix[i][2] = math.radians(draw.gauss(0, 50) / 3600)
            accelerometer["matrix"], zeroing, uncertainty = matrix, {"scale_factor": 1e-3}, {}
        run = Run(programs, {**LEVELLING, "zeroing": True, "positions_deg": [[0, 0, 0]], "dwell_s": 5.0},
                  {"platform": {"slew_error_deg": slew_error_deg}, "accelerometer": accelerometer}, seed=seed,
                  levelling={"settling_s": 60.0}, zeroing=zeroing, **({"uncertainty": uncertainty} if uncertainty else {}))
        ways = "both ways, misaligned" if both else "one way"
        if not run.ended(checks, "finished", f"seed {seed}, slews off by {slew_error_deg} deg, {ways}: finished"):
            continue
        zeros = run.last["campaign"]["zeros"]
        checks.check(not zeros.get("mark"), f"seed {seed}: not marked", zeros)
        squares += sum(((z - 1e3 * b) / s) ** 2 for z, b, s in
                       zip(zeros["zero_mg"], zero_g, zeros["sigma_mg"]))
    # chi-square of 3 per campaign, 99.9 % point (Wilson and Hilferty); the stillness of the platform is a bound
    n = 3 * count
    limit = n * (1 - 2 / (9 * n) + 3.09 * math.sqrt(2 / (9 * n))) ** 3
    checks.check(squares <= limit, f"zeros of {count} campaigns within their sigma", f"{squares:.1f}, limit {limit:.1f}")
    print(f"# z-rms {math.sqrt(squares / n):.3f} over {count} campaigns")


def vertical(position):
    """In platform axes: outer about x, then azimuth about z (the inner gimbal at zero), up = +y."""
    a, g = math.radians(position[0]), math.radians(position[2])
    return [-math.sin(g) * math.cos(a), math.cos(g) * math.cos(a), math.sin(a)]


def regressor(u, gyro, kappa):
    """Tang et al. 2009, averaged model; order F I O S II OO SS IO IS OS, axes input, output, spin in turn."""
    i, o, s = (u[(gyro + k) % 3] for k in range(3))
    return [1, i, o, s, kappa * i * i, kappa * o * o, kappa * s * s, kappa * i * o, kappa * i * s, kappa * o * s]


def solve(a, b):
    n = len(b)
    m = [row[:] + [value] for row, value in zip(a, b)]
    for k in range(n):
        pivot = max(range(k, n), key=lambda row: abs(m[row][k]))
        m[k], m[pivot] = m[pivot], m[k]
        for row in range(k + 1, n):
            factor = m[row][k] / m[k][k]
            m[row] = [x - factor * y for x, y in zip(m[row], m[k])]
    x = [0.0] * n
    for k in reversed(range(n)):
        x[k] = (m[k][n] - sum(m[k][j] * x[j] for j in range(k + 1, n))) / m[k][k]
    return x


def level_error(position, table_g, zero_g):
    """dk/k = 2 delta a0^2 / (a0^2 + 2), delta = u.b. The projection on the vertical divides by the mean, so
    that the zero makes the amplitude too small by what eq. 12-13 of Tang et al. 2009 make it too large."""
    square = (TRANSMISSION * table_g) ** 2
    return -2 * sum(x * y for x, y in zip(vertical(position), zero_g)) * square / (square + 2)


def predicted_bias(gyro, truth, dwells, zero_g):
    """Least squares over the dwells' rates with wrong levels minus truth."""
    normal, right = [[0.0] * 10 for _ in range(10)], [0.0] * 10
    for position, table_g in dwells:
        kappa = 1 + (TRANSMISSION * table_g) ** 2 / 2
        u = vertical(position)
        rate = sum(h * d for h, d in zip(regressor(u, gyro, kappa), truth))
        h = regressor(u, gyro, kappa * (1 + level_error(position, table_g, zero_g)))
        for j in range(10):
            right[j] += h[j] * rate
            for k in range(10):
                normal[j][k] += h[j] * h[k]
    return [x - d for x, d in zip(solve(normal, right), truth)]


def effect(checks, programs, coefficients):
    """5 mg zeros: what they do to the coefficients, and what is left of it with zeroing."""
    # The bias is in proportion to the coefficients: large ones, so that it stands out of the noise of short dwells,
    # and every sample counts, so that the filter is the least squares of the prediction.
    truth = [[d * (30 if k >= 4 else 1) for k, d in enumerate(gyro)] for gyro in coefficients]
    large = {f"D_{name}{'xyz'[gyro]}": truth[gyro][k] for gyro in range(3) for k, name in enumerate(NAMES)}
    campaign = {"name": "effect", "positions_deg": TABLE1, "table_g": [9.0, 7.0], "dwell_s": 20.0, "order": "sequential"}
    zero_g = [0.005, 0.005, 0.005]
    noise = {"resolver_arcsec": 0.3, "gyro_random_walk_deg_per_rt_h": 1e-5, "accelerometer_g": 1e-4}
    ideal = {"noise": noise, "coefficients": large}
    quick = {**ideal, **r.QUICK}   # zeroing wants the azimuth at its own rate
    zeros = {**ideal, "accelerometer": {"zero_g": zero_g}}
    tables = {"noise": noise, "estimator": {"gate_nis": 1e6},
              "estimator.prior_sigma": {"bias": 10.0, "linear": 10.0, "quadratic": 100.0}}
    exact = Run(programs, campaign, quick, **tables)
    wrong = Run(programs, campaign, {**zeros, **r.QUICK}, **tables)
    right = Run(programs, {**campaign, "zeroing": True}, zeros, **tables)
    if not all([exact.ended(checks, "finished", "a campaign with exact accelerometers finishes"),
                wrong.ended(checks, "finished", "one with 5 mg zeros and no zeroing finishes"),
                right.ended(checks, "finished", "one with 5 mg zeros and zeroing finishes")]):
        return
    dwells = [(position, g) for g in campaign["table_g"] for position in TABLE1]
    worst = seen = 0
    for (position, g), a, b in zip(dwells, exact.kappas(), wrong.kappas()):
        expected = level_error(position, g, zero_g)
        if abs(expected) > 2e-3:
            seen += 1
            worst = max(worst, abs((b / a - 1) / expected - 1))
    checks.check(seen >= 14 and worst <= 0.1, f"the level of {seen} dwells is wrong as predicted, within 10 %", worst)

    found = {run: {p["name"]: p for p in run.result["parameters"]} for run in (exact, wrong, right)}
    significant, biased, left = 0, [], []
    for gyro in range(3):
        bias = predicted_bias(gyro, truth[gyro], dwells, zero_g)
        for k, kind in enumerate(NAMES):
            name = f"D_{kind}{'xyz'[gyro]}"
            moved = found[wrong][name]["value_constant"] - found[exact][name]["value_constant"]
            noise = 5 * math.hypot(found[wrong][name]["sigma"], found[exact][name]["sigma"])
            significant += k >= 4 and abs(bias[k]) > noise
            if abs(moved - bias[k]) > 0.1 * abs(bias[k]) + noise:
                biased.append(f"{name} moved by {moved:.3g}, predicted {bias[k]:.3g}, noise {noise:.2g}")
            error, sigma = found[right][name]["value_constant"] - truth[gyro][k], found[right][name]["sigma"]
            if abs(error) > 5 * sigma:
                left.append(f"{name} off by {error:.3g}, sigma {sigma:.2g}")
    checks.check(significant >= 10, "the biases of at least 10 quadratic coefficients stand out of the noise (5 sigma)",
                 significant)
    checks.check(not biased, "each coefficient is biased as predicted, within 10 % of its bias and its noise", biased)
    checks.check(not left, "with zeroing no coefficient is off by more than 5 sigma of the noise", left)

    zeros = right.last["campaign"]["zeros"]
    off = [abs(z - 1e3 * b) for z, b in zip(zeros["zero_mg"], zero_g)]
    checks.check(max(off[:2]) <= 0.02 and off[2] <= 0.01, "the zeros are found to 0.02 mg (x, y) and 0.01 mg (z)", zeros)
    checks.check(zeros["repeated_at_end"] and not zeros.get("mark"), "and again at the end: the campaign is not marked", zeros)
    worst = max(abs(b / a - 1) for a, b in zip(exact.kappas(), right.kappas()))
    checks.check(worst <= 1e-4, "with zeroing the level of every dwell is right to 1e-4", worst)


def coefficients(programs):
    """Of the simulated rig, by gyro."""
    with tempfile.TemporaryDirectory() as folder:
        with open(r.Rig(programs, "seqpacket", "rig", folder).truth_file({}), encoding="utf-8") as file:
            truth = json.load(file)["coefficients"]
    return [[truth[f"D_{name}{axis}"] for name in NAMES] for axis in "xyz"]


def main():
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("programs")
    options.add_argument("--seeds", type=int, default=0)
    given = options.parse_args()
    programs = given.programs
    checks = r.Checks()
    levelling(checks, programs)
    zero_failures(checks, programs)
    both_ways(checks, programs)
    second_axis(checks, programs)
    if given.seeds:
        seeds(checks, programs, given.seeds)
    effect(checks, programs, coefficients(programs))
    return checks.end()


if __name__ == "__main__":
    sys.exit(main())
