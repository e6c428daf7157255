"""What theory expects of studies: of so many campaigns, and of a budget that is proved by drawing. A sum of independent inputs
has the product of their characteristic functions, and that gives the ends of its intervals without a draw, from result.json
alone."""
import math
import statistics

# Outside once in a thousand times, on both sides together.
RARE = 1e-3
RARE_Z = 3.2905


def mean_interval(degrees, count):
    """Of the mean of `count` numbers of chi-square with `degrees`; Wilson and Hilferty, good to 1e-4 from 90 degrees on."""
    k = degrees * count
    return tuple(degrees * (1 - 2 / (9 * k) + z * math.sqrt(2 / (9 * k))) ** 3 for z in (-RARE_Z, RARE_Z))


def count_interval(share, count):
    """Of the hits in `count` with probability `share`: tails of at most half of RARE are cut off."""
    def probability(hits):
        if share in (0, 1):
            return float(hits == share * count)
        return math.exp(math.lgamma(count + 1) - math.lgamma(hits + 1) - math.lgamma(count - hits + 1) +
                        hits * math.log(share) + (count - hits) * math.log1p(-share))
    low, high, below, above = 0, count, 0.0, 0.0
    while low < count and below + probability(low) <= RARE / 2:
        below += probability(low)
        low += 1
    while high > 0 and above + probability(high) <= RARE / 2:
        above += probability(high)
        high -= 1
    return low, high


SMALL = 0.02   # parts below so much of u count as normal: that moves an end by less than 1e-7 u
BLOCK = 10_000
# Of a block of draws the ends are the 251st of each side.
TAIL = 251 / (BLOCK + 1)


def bessel(x):
    """J0: the mean of cos(x cos phase), good to 1e-12 up to x = 30."""
    return math.fsum(math.cos(x * math.cos(math.pi * (k + 0.5) / 64)) for k in range(64)) / 64


def sinc(x):
    return math.sin(x) / x if x else 1.0


SHAPES = {"rectangular": (lambda x: sinc(math.sqrt(3) * x), -1.2), "arcsine": (lambda x: bessel(math.sqrt(2) * x), -1.5),
          "triangular": (lambda x: sinc(math.sqrt(1.5) * x) ** 2, -0.6)}


def parts_of(budget):
    """Standard uncertainties with their shapes. Sine and cosine of one harmonic have one phase: together they are one arcsine."""
    parts = {}
    for one in budget:
        element = one["element"] or ""
        if one["shape"] == "arcsine":
            element = element.removesuffix(", sine").removesuffix(", cosine")
        key = (one["input"], element, one["shape"])
        parts[key] = math.hypot(parts.get(key, 0), one["contribution"])
    return [(u, shape) for (_, _, shape), u in parts.items()]


class Drawn:
    """One coefficient about its value."""

    def __init__(self, parameter):
        parts = parts_of(parameter["budget"])
        self.u = math.sqrt(math.fsum(u * u for u, _ in parts))
        other = [(u, *SHAPES[shape]) for u, shape in parts if shape != "normal" and u > SMALL * self.u]
        normal = math.sqrt(self.u ** 2 - math.fsum(u * u for u, _, _ in other))
        self.excess = math.fsum(k * u ** 4 for u, _, k in other) / self.u ** 4
        count = 400
        self.step = 8.5 / normal / count
        self.at = [(i + 0.5) * self.step for i in range(count)]
        self.weight = [math.exp(-(t * normal) ** 2 / 2) * math.prod(of(u * t) for u, of, _ in other) for t in self.at]

    def below(self, x):
        """Gil-Pelaez."""
        return 0.5 + self.step / math.pi * math.fsum(w * math.sin(t * x) / t for t, w in zip(self.at, self.weight))

    def density(self, x):
        return self.step / math.pi * math.fsum(w * math.cos(t * x) for t, w in zip(self.at, self.weight))

    def slope(self, x):
        return -self.step / math.pi * math.fsum(w * t * math.sin(t * x) for t, w in zip(self.at, self.weight))

    def quantile(self, p):
        x = self.u * statistics.NormalDist().inv_cdf(p)
        for _ in range(20):
            x -= (self.below(x) - p) / self.density(x)
        return x

    def expected(self, trials):
        """Mean, u and both ends about the value, each with its standard error in so many trials."""
        low = self.quantile(TAIL)
        density = self.density(low)
        end = math.sqrt(TAIL * (1 - TAIL) / trials) / density
        # The mean of an order statistic, to second order (David and Nagaraja, 4.6).
        low -= TAIL * (1 - TAIL) / (BLOCK + 2) / 2 * self.slope(low) / density ** 3
        return {"mean": (0.0, self.u / math.sqrt(trials)), "u": (self.u, self.u * math.sqrt((2 + self.excess) / trials) / 2),
                "low": (low, end), "high": (-low, end)}


def tolerance(u, digits):
    """JCGM 101, 7.9.2."""
    return 0.5 * 10 ** (math.floor(math.log10(u)) + 1 - digits)


def claimed(parameters, wanted):
    """Whether k is the normal distribution's, as theory here has it."""
    return all(p["nu_eff"] is None or p["nu_eff"] >= wanted["nu_eff_from"] for p in parameters)


def judge(checks, where, result, parameters, wanted):
    """`wanted`: the verdict that is claimed, None where nothing is. All numbers of all coefficients together are outside once in 1 / RARE times."""
    proofs = [c for c in result["coefficients"] if "value" in c]
    known = {p["name"]: p for p in parameters if p["u"]}
    if not checks.check([c["name"] for c in proofs] == list(known) and len(known) == 30,
                        f"{where}: all 30 coefficients are drawn", [c["name"] for c in proofs]):
        return
    z = -statistics.NormalDist().inv_cdf(RARE / (2 * 4 * len(proofs)))
    wrong, worst, verdicts, margin = [], 0.0, [], 0.0
    for one in proofs:
        parameter = known[one["name"]]
        theory = Drawn(parameter)
        expected = theory.expected(result["trials"])
        found = {"mean": one["mean"] - one["value"], "u": one["u"], "low": one["symmetric"][0] - one["value"],
                 "high": one["symmetric"][1] - one["value"]}
        for what, number in found.items():
            mean, error = expected[what]
            worst = max(worst, abs(number - mean) / error)
            if not abs(number - mean) <= z * error:
                wrong.append(f"{one['name']}: {what} {number:.6g}, {mean - z * error:.6g} to {mean + z * error:.6g} by theory")
        delta = tolerance(parameter["u"], result["digits"])
        same = {"u": (one["gum"]["u"], parameter["u"]), "low": (one["value"] - one["gum"]["low"], parameter["expanded"]),
                "tolerance": (one["tolerance"], delta), "sum of the budget": (theory.u, parameter["u"])}
        wrong += [f"{one['name']}: {what} {a:.9g}, {b:.9g} of the recording" for what, (a, b) in same.items()
                  if not math.isclose(a, b, rel_tol=1e-6)]
        off = abs(parameter["expanded"] + expected["low"][0])
        margin = max(margin, (off + z * expected["low"][1]) / delta)
        verdicts.append(True if off + z * expected["low"][1] <= delta else False if off - z * expected["low"][1] > delta else None)
        if verdicts[-1] not in (None, one["validated"]):
            wrong.append(f"{one['name']}: validated {one['validated']}, {verdicts[-1]} by theory")
    checks.check(not wrong, f"{where}: mean, u and both ends of 30 coefficients are what theory says of {result['trials']} trials: "
                 f"off by {worst:.1f} of {z:.1f} standard errors at most", "\n".join(wrong))
    by_theory = "not validated" if False in verdicts else "validated" if all(verdicts) else "open"
    text = f"{by_theory} by theory, {margin:.2f} of the tolerance at most"
    if wanted is None:
        checks.check(by_theory in ("open", result["verdict"]), f"{where}: the budget is {result['verdict']}; {text}")
    else:
        checks.equal((by_theory, result["verdict"]), (wanted,) * 2, f"{where}: the budget is {wanted}; {text}")
