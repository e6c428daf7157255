"""The 30 coefficients with their covariance, and the drift that they predict."""
from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Iterator, Mapping, Sequence

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

TERMS = ("F", "I", "O", "S", "II", "OO", "SS", "IO", "IS", "OS")
GYROS = ("x", "y", "z")
NAMES: tuple[str, ...] = tuple(f"D_{term}{gyro}" for gyro in GYROS for term in TERMS)
UNITS: tuple[str, ...] = tuple("deg/h" if term == "F" else "deg/h/g" if len(term) == 1 else "deg/h/g^2"
                               for _ in GYROS for term in TERMS)


@dataclass(frozen=True)
class Coefficient:
    """One coefficient; `value`, `sigma` and `u` in `unit`, NaN if the data do not determine it.

    `u`: its standard uncertainty, by the result's combined covariance, NaN where there is none (a campaign that runs, an
    interrupted one); `sigma`: the filter's noise alone, over frequency that of the reference frequency's fit, which may be
    the larger one.
    """

    name: str
    value: float
    sigma: float
    unit: str
    observable: bool
    u: float = math.nan


@dataclass(frozen=True)
class Drift:
    """Of the three gyros (x, y, z) about their input axes, deg/h."""

    drift_dph: Array
    """Without compensation."""
    residual_dph: Array
    """1 sigma of what is left after compensation, by the coefficients' covariance.

    Drift and residual are NaN where not determined."""
    determined: npt.NDArray[np.bool_]
    """False: it rests on coefficients that the data do not determine."""


class Coefficients(Mapping[str, Coefficient]):
    """By name, in the order of `names` (F I O S II OO SS IO IS OS of gyro x, then y, z; IEEE Std 517).

    `value`, `sigma` (the filter's noise alone), `u` (standard uncertainty, NaN also where the covariance is not a result's
    combined one): (30,), NaN where not observable; `covariance`: (30, 30) in products of `units`, NaN there too;
    `observable`: (30,) bool.
    """

    names = NAMES
    units = UNITS

    def __init__(self, value: Array, sigma: Array, covariance: Array, observable: npt.NDArray[np.bool_],
                 combined: bool = False) -> None:
        """`combined`: `covariance` is of noise, drift states and declared inputs; else of noise alone."""
        for what, array, shape in (("value", value, (30,)), ("sigma", sigma, (30,)),
                                   ("covariance", covariance, (30, 30)), ("observable", observable, (30,))):
            if array.shape != shape:
                raise ValueError(f"{what}: found shape {array.shape}, expected {shape}")
        self.observable = observable.astype(bool)
        both = self.observable[:, None] & self.observable[None, :]
        self.value: Array = np.where(self.observable, value, np.nan)
        self.sigma: Array = np.where(self.observable, sigma, np.nan)
        self.covariance: Array = np.where(both, covariance, np.nan)
        self._spread: Array = np.sqrt(np.diag(self.covariance))
        self.u: Array = self._spread if combined else np.full(30, np.nan)

    @classmethod
    def of_result(cls, result: Mapping[str, Any]) -> Coefficients:
        """Of result.json, `vibrig identify --json`, or /api/v1/parameters. Raises KeyError, ValueError.

        `covariance` is the combined one (noise, drift states, declared inputs) where the result has it, else of noise
        alone, as in all of /api/v1/parameters; then `u` is NaN.
        """
        parameters = result["parameters"]
        names = tuple(p["name"] for p in parameters)
        if names != NAMES:
            raise ValueError(f"parameters: found {len(names)} from {names[:1]}, expected the 30 from {NAMES[0]} on")

        def number(value: Any) -> float:
            return math.nan if value is None else float(value)
        covariance = [[number(v) for v in row] for row in result.get("covariance_combined") or result.get("covariance") or []]
        return cls(np.array([number(p.get("value")) for p in parameters]),
                   np.array([number(p.get("sigma")) for p in parameters]),
                   np.array(covariance) if covariance else np.full((30, 30), np.nan),
                   np.array([bool(p.get("observable")) for p in parameters]), bool(result.get("covariance_combined")))

    def __getitem__(self, name: str) -> Coefficient:
        if name not in NAMES:
            raise KeyError(f"{name}: expected one of {', '.join(NAMES)}")
        i = NAMES.index(name)
        return Coefficient(name, float(self.value[i]), float(self.sigma[i]), UNITS[i], bool(self.observable[i]),
                           float(self.u[i]))

    def __iter__(self) -> Iterator[str]:
        return iter(NAMES)

    def __len__(self) -> int:
        return len(NAMES)

    @property
    def correlation(self) -> Array:
        """(30, 30), NaN where not observable."""
        correlation: Array = self.covariance / np.outer(self._spread, self._spread)
        return correlation

    def frame(self) -> Any:
        """A pandas.DataFrame by name: value, sigma, u, unit, observable."""
        import pandas

        return pandas.DataFrame({"value": self.value, "sigma": self.sigma, "u": self.u, "unit": UNITS,
                                 "observable": self.observable}, index=pandas.Index(NAMES, name="coefficient"))

    def drift(self, up: Array, kappa: float, axes: Sequence[Sequence[str]]) -> Drift:
        """h . D and sqrt(h' P h) (Tang et al. 2009, eqs 8-9 with k1 = 1, k2 = kappa).

        `up`: (3,) specific force at rest in platform axes, g; `kappa` = 1 + a^2 / 2 with a in g at the platform;
        `axes`: input, output, spin of each gyro as signed platform axes ("+x").
        """
        drift, residual, determined = np.zeros(3), np.zeros(3), np.ones(3, dtype=bool)
        for gyro, names in enumerate(axes):
            a_i, a_o, a_s = (signed_axis(name) @ up for name in names)
            h = np.array([1, a_i, a_o, a_s, *(kappa * q for q in (a_i**2, a_o**2, a_s**2, a_i * a_o, a_i * a_s,
                                                                  a_o * a_s))])
            own = slice(10 * gyro, 10 * gyro + 10)
            observable = self.observable[own]
            counts = np.abs(h) > 1e-9
            determined[gyro] = bool(np.all(observable[counts]))
            if not determined[gyro]:
                drift[gyro] = residual[gyro] = math.nan
                continue
            # The others may be NaN, and 0 times NaN is none.
            h = h[counts]
            drift[gyro] = h @ self.value[own][counts]
            residual[gyro] = math.sqrt(max(0.0, h @ self.covariance[own, own][np.ix_(counts, counts)] @ h))
        return Drift(drift, residual, determined)


def signed_axis(name: str) -> Array:
    """The unit vector of "+x", "-z" ... Raises ValueError."""
    if len(name) != 2 or name[0] not in "+-" or name[1] not in "xyz":
        raise ValueError(f"axis: found {name!r}, expected a sign and x, y or z, such as \"+y\"")
    axis = np.zeros(3)
    axis["xyz".index(name[1])] = 1.0 if name[0] == "+" else -1.0
    return axis


def up_in_platform(attitude_deg: Sequence[float], up: str) -> Array:
    """The vertical in platform axes, (3,), at gimbal angles outer, inner, azimuth:
    Rz(azimuth) Ry(inner) Rx(outer) up, with right-handed turns of vectors."""
    a, b, g = (math.radians(angle) for angle in attitude_deg)
    ca, sa, cb, sb, cg, sg = math.cos(a), math.sin(a), math.cos(b), math.sin(b), math.cos(g), math.sin(g)
    rx = np.array([[1, 0, 0], [0, ca, -sa], [0, sa, ca]])
    ry = np.array([[cb, 0, sb], [0, 1, 0], [-sb, 0, cb]])
    rz = np.array([[cg, -sg, 0], [sg, cg, 0], [0, 0, 1]])
    vertical: Array = rz @ ry @ rx @ signed_axis(up)
    return vertical
