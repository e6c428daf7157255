"""A recorded campaign: its HDF5 files (campaign.h5, campaign-2.h5 ...) joined, as `vibrig` itself joins them."""
from __future__ import annotations

import contextlib
import hashlib
import json
import os
import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Iterator, Mapping, Sequence, Union

import h5py
import numpy as np
import numpy.typing as npt

from vibrig._coefficients import NAMES, Coefficients, Drift, up_in_platform

try:
    import tomllib
except ImportError:  # before Python 3.11
    tomllib = None  # type: ignore[assignment]

FORMAT_VERSION = 2
CONTINUED = "continued"  # the state of a part behind which there is another
DIGEST = "configuration_sha256"
UNWRITTEN = np.iinfo(np.int64).min  # a row that never reached the disk
SECOND = 10**9
PIECE = 2**20  # rows looked at in one go
FEW = 2**20  # so many values may have no place in a file that is being written
COMPRESSED = 1100  # times, at most
ATTRIBUTES: Mapping[str, Any] = {"format_version": int, "part": int, "restart": bool, "dwells_before": int, "utc_offset_ns": int,
                                 "started_utc_ns": int, "name": str, "campaign": str, "started_by": str, "state": str, "version": str}
TABLES = ("samples", "orders", "dwells", "estimates", "conditions", "events", "gaps")
TIMES = {"time_ns", "announced_ns", "from_ns", "to_ns"}
LABELS: dict[str, Sequence[str]] = {
    "angle_rad": ("outer", "inner", "azimuth"), "innovation_arcsec": ("outer", "inner", "azimuth"),
    "force_g": "xyz", "zero_g": "xyz", "noise_walk": "xyz", "sensor_c": ("case", "gyro_x", "gyro_y", "gyro_z"),
    "quality": ("outer", "inner", "azimuth", "accel_x", "accel_y", "accel_z", "table"),
    "value": NAMES, "sigma": NAMES, "observable": NAMES}

CHANNELS = ("outer", "inner", "azimuth", "accel_x", "accel_y", "accel_z", "table_accel")
UNBOUND = 5  # quality of a channel that there is not

PathLike = Union[str, "os.PathLike[str]"]


class FormatError(ValueError):
    """A file that is not what was expected: place, what was found, what was expected."""


@dataclass
class _Segment:
    """Rows of one file's table; its times move by `shift_ns` to those of the first file."""

    path: Path
    rows: int
    keep: npt.NDArray[np.bool_]
    shift_ns: int = 0


class Table(Mapping[str, npt.NDArray[Any]]):
    """Columns by name, (rows, ...) each, read when asked for. Times are those of the campaign's first file.

    `units` and `descriptions`: by column, as the file states them.
    """

    def __init__(self, name: str, utc_offset_ns: int, labels: Mapping[str, Sequence[str]]) -> None:
        self.name = name
        self.units: dict[str, str] = {}
        self.descriptions: dict[str, str] = {}
        self._segments: list[_Segment] = []
        self._utc_offset_ns = utc_offset_ns
        self._labels = labels
        self._read: dict[str, npt.NDArray[Any]] = {}

    def __getitem__(self, column: str) -> npt.NDArray[Any]:
        if column not in self.units:
            expected = f"one of {', '.join(self.units)}" if self.units else "none: the recording has no such table"
            raise KeyError(f"{self.name}: found no column {column!r}, expected {expected}")
        if column not in self._read:
            parts = []
            for segment in self._segments:
                with _reading(segment.path), _open_file(segment.path) as file:
                    dataset = _dataset(file[self.name], column, segment.path)
                    values = dataset[:segment.rows][segment.keep]
                    if (self.name, column) == ("samples", "quality"):
                        values = _by_channel(values, _places_of(dataset, segment.path))
                    if values.dtype.kind == "S":
                        values = np.array([v.decode("utf-8", "replace") for v in values], dtype=object)
                    parts.append(values + segment.shift_ns if column in TIMES else values)
            with _reading(self._segments[0].path):
                self._read[column] = np.concatenate(parts)
        return self._read[column]

    def __iter__(self) -> Iterator[str]:
        return iter(self.units)

    def __len__(self) -> int:
        return len(self.units)

    def __repr__(self) -> str:
        return f"<vibrig.Table {self.name}: {self.rows} rows of {', '.join(self.units)}>"

    @property
    def rows(self) -> int:
        return int(sum(np.count_nonzero(segment.keep) for segment in self._segments))

    def utc(self, column: str = "") -> npt.NDArray[np.datetime64]:
        """Times of a column as UTC, datetime64[ns]; without a name those of the table's first column of times, none where the
        recording has no such table."""
        if not column and not self.units:
            return np.zeros(0, dtype="datetime64[ns]")
        column = column or next((name for name in ("time_ns", "from_ns") if name in self.units), "")
        if column in self.units and column not in TIMES:
            raise KeyError(f"{self.name}: found column {column!r}, expected one of times: "
                           f"{', '.join(name for name in self.units if name in TIMES)}")
        values = self[column]
        with _reading(self._segments[0].path):
            stamps: npt.NDArray[np.datetime64] = (values + self._utc_offset_ns).astype("datetime64[ns]")
        return stamps

    def frame(self) -> Any:
        """A pandas.DataFrame, index UTC. Columns of several numbers become several, as angle_rad_outer; matrices, such
        as the dwells' covariance, stay out."""
        import pandas

        columns: dict[str, Any] = {}
        for name in self.units:
            values = self[name]
            if values.ndim == 1:
                columns[name] = values
            elif values.ndim == 2:
                labels = self._labels.get(name, range(values.shape[1]))
                for label, one in zip(labels, values.T):
                    columns[f"{name}_{label}"] = one
        return pandas.DataFrame(columns, index=pandas.DatetimeIndex(self.utc(), tz="UTC", name="utc"))


@dataclass(frozen=True)
class Campaign:
    """All parts of a recorded campaign. Made by `vibrig.open`."""

    folder: Path
    parts: tuple[Path, ...]
    name: str
    started_by: str
    state: str
    """finished, aborted, ...; "running": not closed."""
    reason: str
    mark: str
    """Why the campaign is marked; empty: it is not."""
    utc_offset_ns: int
    """UTC minus the times of the tables, ns."""
    started_utc: np.datetime64
    version: str
    """Of the vibrigd that recorded it."""
    configuration_text: str
    """Effective configuration, TOML."""
    dbc: str
    plan: Mapping[str, Any]
    result: Mapping[str, Any]
    """As result.json; empty while the campaign runs, or without one."""
    interlocks: Sequence[Mapping[str, Any]]
    """Rows of the interlock's table: name, condition, unit, limit; the second dimension of
    conditions["interlock_value"]."""
    tables: Mapping[str, Table] = field(repr=False, default_factory=dict)

    @property
    def samples(self) -> Table:
        return self.tables["samples"]

    @property
    def orders(self) -> Table:
        """Dwells as they were ordered."""
        return self.tables["orders"]

    @property
    def dwells(self) -> Table:
        """Dwells done, with coefficients and covariance after each."""
        return self.tables["dwells"]

    @property
    def estimates(self) -> Table:
        """The filter while it works, once a second."""
        return self.tables["estimates"]

    @property
    def conditions(self) -> Table:
        """Temperatures, shaker, platform and interlock, once a second. Empty in recordings made before there were
        any."""
        return self.tables["conditions"]

    @property
    def events(self) -> Table:
        return self.tables["events"]

    @property
    def gaps(self) -> Table:
        """What is missing in the recording."""
        return self.tables["gaps"]

    @property
    def configuration(self) -> Mapping[str, Any]:
        """The effective configuration, parsed. Raises ImportError before Python 3.11."""
        if tomllib is None:
            raise ImportError("tomllib: found Python before 3.11, expected 3.11; configuration_text has the text")
        with _reading(self.parts[0]):
            return tomllib.loads(self.configuration_text)

    @property
    def verdict(self) -> Mapping[str, Any] | None:
        """Level, word and reasons as in result.json; None: the result has none."""
        verdict: Mapping[str, Any] | None = self.result.get("verdict")
        return verdict

    @property
    def coefficients(self) -> Coefficients:
        """Of the result, with its combined covariance; without one the filter's after the last dwell, which is of noise alone
        (`u` is NaN). Raises ValueError when there is no dwell."""
        dwells = self.dwells
        if dwells.rows == 0:
            raise ValueError(f"{self.parts[0]}: found no finished dwell, expected one")
        with _reading(self.parts[-1]):
            if self.result and self.result.get("covariance_combined"):
                return Coefficients.of_result(self.result)
            return Coefficients(dwells["value"][-1], dwells["sigma"][-1], dwells["covariance"][-1],
                                dwells["observable"][-1] != 0)

    def compensation(self, attitude_deg: Sequence[float], *, table_g: float | None = None,
                     platform_g: float | None = None) -> Drift:
        """What the gyros drift at an attitude under vibration, and what compensation leaves; as `vibrig compensate`.

        `attitude_deg`: gimbal angles outer, inner, azimuth (no encoder readings); peak at the table or at the platform, g, neither: at rest.
        Raises ValueError, also where the quadratic coefficients depend on the frequency and the level is not 0.
        """
        if table_g is not None and platform_g is not None:
            raise ValueError("table_g: found it beside platform_g, expected one of them")
        attitude = _numbers(attitude_deg)
        if attitude.shape != (3,) or not np.all(np.isfinite(attitude)):
            raise ValueError(f"attitude_deg: found {attitude_deg!r}, expected three angles, deg")
        for name, given in (("table_g", table_g), ("platform_g", platform_g)):
            if given is not None and not (_numbers(given).shape == () and 0 <= _numbers(given) <= 1000):
                raise ValueError(f"{name}: found {given!r}, expected 0 to 1000 g")
        with _reading(self.parts[0]):
            settings = self.configuration
            level = platform_g or (table_g or 0.0) * settings["vibration"]["transmission"]
            platform = settings["platform"]
            up = up_in_platform(attitude, platform["up"])
            axes = [platform[f"gyro_{g}_axes"] for g in "xyz"]
        if not 0 <= level <= 1000:
            raise ValueError(f"level: found {level:g}, expected 0 to 1000 g")
        with _reading(self.parts[-1]):
            spectrum = self.result.get("spectrum") or {}
            depends = spectrum and (spectrum.get("model") != "flat" or spectrum.get("refusal") or
                                    (spectrum.get("flat") or {}).get("alarm"))
        if level > 0 and depends:
            raise ValueError(f"{self.parts[0]}: found quadratic coefficients that depend on the frequency, expected a level "
                             "of 0 (vibrig predict has the drift under a vibration)")
        with _reading(self.parts[0]):
            return self.coefficients.drift(up, 1 + level**2 / 2, axes)

    def of_dwell(self, index: int) -> slice:
        """Rows of `samples` that belong to a finished dwell (0 is the first), by its order's times and, where it was
        cut short, by the samples that the filter saw. Raises IndexError."""
        with _reading(self.parts[0]):
            rows = self._dwell_rows()
        if not -len(rows) <= index < len(rows):
            expected = f"{-len(rows)} to {len(rows) - 1}" if rows else "none: no dwell is finished"
            raise IndexError(f"dwell: found {index}, expected {expected}")
        return rows[index]

    def _dwell_rows(self) -> list[slice]:
        times, orders, dwells = self.samples["time_ns"], self.orders, self.dwells
        back = np.flatnonzero(times[1:] < times[:-1])
        if len(back):   # the search in them would find anything
            row = int(back[0]) + 1
            raise FormatError(f"{self.parts[0]}: /samples/time_ns: found {times[row]} behind {times[row - 1]} in row {row}, "
                              "expected growing times")
        begin = np.searchsorted(times, orders["from_ns"])
        end = np.searchsorted(times, orders["to_ns"])
        found: list[slice] = []
        for i in range(orders.rows):
            done = len(found)
            if orders["cancel"][i] or done == dwells.rows:
                continue
            if (dwells["run"][done], dwells["position"][done]) != (orders["run"][i], orders["position"][i]):
                continue
            count = int(end[i] - begin[i])
            if i + 1 < orders.rows and orders["cancel"][i + 1]:
                count = min(count, int(dwells["samples"][done]))
            found.append(slice(int(begin[i]), int(begin[i]) + count))
        return found


def _places_of(quality: h5py.Dataset, path: Path) -> list[int]:
    """Of each number in a row its place in CHANNELS, by the names that the file gives; without them the first so many."""
    def refuse(found: str, expected: str) -> None:
        raise FormatError(f"{path}: {quality.name}: found {found}, expected {expected}")

    if quality.ndim != 2:
        refuse(f"{quality.ndim} dimensions", "2: rows and numbers in a row")
    width, most = quality.shape[1], f"{len(CHANNELS)} ({' '.join(CHANNELS)})"
    found = list(CHANNELS)
    if "names" in quality.attrs:
        found = _text(quality.attrs["names"]).split()
        if len(found) != width:
            refuse(f"{width} numbers in a row", f"{len(found)} by its names {' '.join(found)}")
    if width == 0:
        refuse("0 numbers in a row", f"1 to {most}")
    if width > len(found):
        refuse(f"{width} numbers in a row without names", f"{len(found)} at most")
    for name in found:
        if name not in CHANNELS:
            refuse(f"{width} numbers in a row, one of them {name}", f"at most {most}; a newer vibrigd wrote it")
        if found.count(name) > 1:
            refuse(f"{name} twice among its names", "it once")
    return [CHANNELS.index(name) for name in found[:width]]


def _by_channel(values: npt.NDArray[Any], places: Sequence[int]) -> npt.NDArray[Any]:
    quality = np.full((len(values), len(CHANNELS)), UNBOUND, dtype=values.dtype)
    quality[:, places] = values
    return quality


def _open_file(path: Path) -> h5py.File:
    """Of one that is being written, too: of such a one what does not fit together is read again, for minutes."""
    try:
        try:
            return h5py.File(path, "r")
        except OSError:
            return h5py.File(path, "r", swmr=True)
    except (OSError, ValueError) as error:
        raise FormatError(f"{path}: found no HDF5 file that can be read ({error}), expected a campaign's; after a "
                          "crash `vibrig recover` mends it") from error


def _dataset(group: h5py.Group, name: str, path: Path) -> h5py.Dataset:
    """Of this file itself: a link may lead to any other, and a few bytes may say that they are any number of values."""
    def refuse(found: str) -> None:
        raise FormatError(f"{path}: {group.name.rstrip('/')}/{name}: found {found}")

    if not isinstance(group.get(name, getlink=True), h5py.HardLink):
        refuse("a link, expected what it leads to")
    found = group[name]
    if not isinstance(found, h5py.Dataset) or found.shape is None:
        refuse("no values, expected a dataset")
    if found.external or found.is_virtual:
        refuse("values of another file, expected them in this")
    if found.size > FEW and found.size / COMPRESSED > found.id.get_storage_size():
        refuse(f"{found.size} values in {found.id.get_storage_size()} bytes, expected as many as they hold")
    return found


def _columns(file: h5py.File, table: str, path: Path) -> dict[str, h5py.Dataset]:
    """By name; none where the file has no such table."""
    if file.get(table, getlink=True) is None:
        return {}
    if not isinstance(file.get(table, getlink=True), h5py.HardLink) or not isinstance(file[table], h5py.Group):
        raise FormatError(f"{path}: /{table}: found no group, expected one with columns")
    # HDF5 1.10 ends the process where it goes through a group that is damaged: the head of the file says what is in it.
    head = _json(_long_text(file, "head", path), f"{path}: /head") or {}
    names = head.get("units", {}).get(table) or file[table]
    columns = {name: _dataset(file[table], name, path) for name in names if name in file[table]}
    for name, column in columns.items():
        if column.ndim == 0:
            raise FormatError(f"{path}: /{table}/{name}: found one value, expected rows")
    return columns


def _long_bytes(file: h5py.File, name: str, path: Path) -> bytes:
    if file.get(name, getlink=True) is None:
        return b""
    found = _dataset(file, name, path)
    if found.ndim > 0 or found.dtype.kind not in "SO":
        raise FormatError(f"{path}: /{name}: found no text, expected one")
    value = found[()]
    return value if isinstance(value, bytes) else str(value).encode()


def _long_text(file: h5py.File, name: str, path: Path) -> str:
    return _text(_long_bytes(file, name, path))


def _refuse_changed_configuration(file: h5py.File, attributes: Mapping[str, Any], path: Path) -> None:
    """What it says of unit and instruments nothing else in the recording knows. Files of an older vibrigd have no digest."""
    if DIGEST not in attributes:
        return
    expected = _text(attributes[DIGEST])
    found = hashlib.sha256(_long_bytes(file, "configuration", path)).hexdigest()
    if found != expected:
        raise FormatError(f"{path}: /configuration: found SHA-256 {found}, expected {expected:.64} of attribute {DIGEST}: "
                          "it is not what was recorded")


@contextlib.contextmanager
def _reading(path: Path) -> Iterator[None]:
    """What h5py and numpy say of a file that lies becomes a FormatError."""
    try:
        yield
    except FormatError:
        raise
    except (ArithmeticError, AttributeError, LookupError, MemoryError, OSError, RuntimeError, TypeError, ValueError) as error:
        raise FormatError(f"{path}: found what cannot be read ({str(error) or type(error).__name__}), expected a "
                          "campaign's HDF5 file") from error


def _numbers(value: Any) -> npt.NDArray[np.float64]:
    """Of a caller; what is none becomes NaN."""
    try:
        numbers = np.asarray(value)
        return numbers.astype(float) if numbers.dtype.kind in "iuf" else np.array(np.nan)
    except (TypeError, ValueError):
        return np.array(np.nan)


def _text(value: Any) -> str:
    return value.decode("utf-8", "replace") if isinstance(value, bytes) else str(value)


def part_name(part: int) -> str:
    return "campaign.h5" if part == 1 else f"campaign-{part}.h5"


def _part_files(folder: Path) -> dict[int, Path]:
    parts = {}
    for path in folder.iterdir():
        number = re.fullmatch(r"campaign(?:-([2-9]|[1-9][0-9]+))?\.h5", path.name)
        if number:
            parts[int(number[1] or 1)] = path
    return dict(sorted(parts.items()))


def _parts_of(argument: Path) -> list[Path]:
    if not argument.exists():
        raise FileNotFoundError(f"{argument}: found nothing, expected a campaign's HDF5 file or its folder")
    folder = argument if argument.is_dir() else argument.parent
    parts = _part_files(folder)
    if argument.is_dir():
        if not parts:
            inside = sorted(path for path in argument.iterdir() if path.is_dir() and _part_files(path))
            if len(inside) == 1:
                return _parts_of(inside[0])
            found = "several: " + ", ".join(path.name for path in inside) if inside else "none"
            raise FileNotFoundError(f"{argument}: found {found}, expected one campaign.h5")
    elif argument not in parts.values():
        return [argument]  # a file of another name stands for itself
    missing = [part_name(i) for i in range(1, max(parts) + 1) if i not in parts]
    if missing:
        raise FileNotFoundError(f"{folder}: missing {', '.join(missing)}, expected all {max(parts)} parts")
    return list(parts.values())


@dataclass
class _Part:
    path: Path
    attributes: dict[str, Any]
    texts: dict[str, str]
    segments: dict[str, _Segment]
    columns: dict[str, dict[str, tuple[str, str]]]
    """Of each table, by name: unit, description."""
    few: dict[str, dict[str, npt.NDArray[Any]]]
    """What joining needs."""

    def move(self, by_ns: int) -> None:
        for segment in self.segments.values():
            segment.shift_ns = by_ns


def _rows_of(columns: Mapping[str, h5py.Dataset]) -> int:
    """Of a group that may be growing: what every column has."""
    rows = min((column.shape[0] for column in columns.values()), default=0)
    for column in columns.values():
        if column.dtype != np.int64:
            continue
        for begin in range(0, rows, PIECE):   # recordings may be larger than memory
            piece = column[begin:min(begin + PIECE, rows)] == UNWRITTEN
            unwritten = np.flatnonzero(piece.reshape(len(piece), -1).any(axis=1))
            if len(unwritten):
                rows = begin + int(unwritten[0])
                break
    return int(rows)


def _read_part(path: Path) -> _Part:
    with _reading(path), _open_file(path) as file:
        attributes = {name: _text(v) if isinstance(v, bytes) else v for name, v in file.attrs.items()}
        if attributes.get("format") != "vibrig-campaign":
            raise FormatError(f"{path}: attribute format: found {attributes.get('format', 'nothing')}, expected "
                              "vibrig-campaign")
        missing = [name for name in ATTRIBUTES if name not in attributes]
        if missing:
            raise FormatError(f"{path}: attribute {missing[0]}: found nothing, expected it")
        for name, kind in ATTRIBUTES.items():
            value = attributes[name]
            kinds = "U" if kind is str else "iub"
            if isinstance(value, h5py.Empty) or np.ndim(value) > 0 or np.asarray(value).dtype.kind not in kinds:
                raise FormatError(f"{path}: attribute {name}: found {value!r:.40}, expected one value of its kind")
            attributes[name] = kind(value)
        if attributes["format_version"] != FORMAT_VERSION:
            raise FormatError(f"{path}: format_version: found {attributes['format_version']}, expected "
                              f"{FORMAT_VERSION}")
        _refuse_changed_configuration(file, attributes, path)
        texts = {name: _long_text(file, name, path) for name in ("configuration", "dbc", "plan", "result", "interlocks")}
        segments, columns = {}, {}
        for table in TABLES:
            there = _columns(file, table, path)
            rows = _rows_of(there)
            segments[table] = _Segment(path, rows, np.ones(rows, dtype=bool))
            columns[table] = {name: (_text(column.attrs.get("unit", "")), _text(column.attrs.get("description", "")))
                              for name, column in there.items()}
        if "quality" in columns["samples"]:
            _places_of(file["samples"]["quality"], path)
        few = {table: {name: file[table][name][:segments[table].rows] for name in names} for table, names in
               (("samples", ("time_ns",)), ("orders", ("announced_ns", "cancel", "run", "position")),
                ("dwells", ("time_ns", "samples", "run", "position")))}
    return _Part(path, attributes, texts, segments, columns, few)


def _cut_back(parts: list[_Part], dwells_before: int) -> None:
    """Forgets the dwells, and their orders, behind the first ones that the filter went on with after a restart."""
    kept = left = 0
    dwells = [(part, i) for part in parts for i in np.flatnonzero(part.segments["dwells"].keep)]
    while kept < len(dwells) and left < dwells_before:
        part, i = dwells[kept]
        left += int(part.few["dwells"]["samples"][i] > 0)
        kept += 1
    for part, i in dwells[kept:]:
        part.segments["dwells"].keep[i] = False
    orders = [(part, i) for part in parts for i in np.flatnonzero(part.segments["orders"].keep)]
    last = done = 0
    for at, (part, i) in enumerate(orders):
        if done == kept:
            break
        own, (of, k) = part.few["orders"], dwells[done]
        if own["cancel"][i] or any(own[c][i] != of.few["dwells"][c][k] for c in ("run", "position")):
            continue
        done, last = done + 1, at + 1
        if last < len(orders) and orders[last][0].few["orders"]["cancel"][orders[last][1]]:
            last += 1
    for part, i in orders[last:]:
        part.segments["orders"].keep[i] = False


def _kept_times(part: _Part, table: str, column: str) -> npt.NDArray[np.int64]:
    segment = part.segments[table]
    times: npt.NDArray[np.int64] = part.few[table][column][segment.keep] + segment.shift_ns
    return times


def _join(parts: list[_Part], part: _Part) -> None:
    """`part` behind those that are there, as daemon/record/campaign_parts.cpp does it."""
    before = np.concatenate([_kept_times(p, "samples", "time_ns") for p in parts])
    last = int(before[-1]) if len(before) else 0
    own = part.few["samples"]["time_ns"]
    if part.attributes["restart"]:
        shift = int(part.attributes["utc_offset_ns"]) - int(parts[0].attributes["utc_offset_ns"])
        # UTC may have been set back meanwhile; dwells only know differences.
        if len(own) and len(before) and int(own[0]) + shift <= last:
            shift = last + SECOND - int(own[0])
        part.move(shift)
        _cut_back(parts, int(part.attributes["dwells_before"]))
    else:
        # The disk refused meanwhile: of what was kept for this file some may be in the other, too. It is of the same
        # life of the daemon, so its clock is the same.
        part.move(parts[-1].segments["samples"].shift_ns)
        if len(before):
            part.segments["samples"].keep &= _kept_times(part, "samples", "time_ns") > last
        known = {(int(t), bool(c)) for p in parts for t, c in zip(
            _kept_times(p, "orders", "announced_ns"), p.few["orders"]["cancel"][p.segments["orders"].keep])}
        orders = part.few["orders"]
        part.segments["orders"].keep &= np.array([(int(t), bool(c)) not in known for t, c in zip(
            _kept_times(part, "orders", "announced_ns"), orders["cancel"])], dtype=bool)
        done = np.concatenate([_kept_times(p, "dwells", "time_ns") for p in parts])
        if len(done):
            part.segments["dwells"].keep &= _kept_times(part, "dwells", "time_ns") > done[-1]
    parts.append(part)


def _json(text: str, what: str) -> Any:
    try:
        return json.loads(text) if text else None
    except ValueError as error:
        raise FormatError(f"{what}: {error}, expected JSON") from error


def open_campaign(path: PathLike) -> Campaign:
    """Opens a campaign's folder (or the folder around it, or one of its files): all parts, in their order.

    While it is written, too; then it is what there is at this moment. Raises FileNotFoundError, FormatError.
    """
    if not os.fspath(path):   # Path would take it for the folder where one is
        raise FileNotFoundError("path: found nothing, expected a campaign's HDF5 file or its folder")
    argument = Path(path)
    parts: list[_Part] = []
    for number, file in enumerate(_parts_of(argument), start=1):
        part = _read_part(file)
        if parts and (part.attributes["part"] != number
                      or part.attributes["campaign"] != parts[0].attributes["campaign"]):
            raise FormatError(f"{file}: found part {part.attributes['part']} of {part.attributes['campaign']}, expected "
                              f"part {number} of {parts[0].attributes['campaign']}")
        with _reading(file):
            if parts:
                _join(parts, part)
            else:
                parts.append(part)
    _refuse_missing_end(parts)
    with _reading(parts[0].path):
        return _made_of(parts)


def _refuse_missing_end(parts: list[_Part]) -> None:
    """A part is called continued once the next file is there, which may have come since the files were looked for."""
    last, following = parts[-1], part_name(len(parts) + 1)
    if last.path.name != part_name(len(parts)) or last.attributes["state"] != CONTINUED:
        return   # a file of another name stands for itself
    if not last.path.with_name(following).exists():
        raise FormatError(f"{last.path}: attribute state: found {CONTINUED}, expected {following} beside it, in which the campaign "
                          "goes on: it is missing")


def _made_of(parts: list[_Part]) -> Campaign:
    first, last = parts[0], parts[-1]
    head, offset = first.attributes, int(first.attributes["utc_offset_ns"])
    interlocks = _json(first.texts["interlocks"], f"{first.path}: interlocks") or []
    rows = [str(row["name"]) for row in interlocks]
    labels: dict[str, Sequence[str]] = {**LABELS, "interlock_value": rows, "interlock_raised": rows}
    tables = {}
    for name in TABLES:
        table = tables[name] = Table(name, offset, labels)
        # A part recorded by an older vibrigd may lack a table: then there is less of it, not nothing.
        there = [part for part in parts if part.columns[name]]
        common = [c for c in (there[0].columns[name] if there else ()) if all(c in p.columns[name] for p in there)]
        for column in common:
            table.units[column], table.descriptions[column] = there[0].columns[name][column]
        table._segments = [part.segments[name] for part in there]
    return Campaign(
        folder=first.path.parent, parts=tuple(part.path for part in parts), name=head["name"],
        started_by=head["started_by"], state=last.attributes["state"], reason=last.attributes.get("reason", ""),
        mark=last.attributes.get("mark", ""), utc_offset_ns=offset,
        started_utc=np.datetime64(int(head["started_utc_ns"]), "ns"), version=head["version"],
        configuration_text=first.texts["configuration"], dbc=first.texts["dbc"],
        plan=_json(first.texts["plan"], f"{first.path}: plan") or {},
        result=_json(last.texts["result"], f"{last.path}: result") or {}, interlocks=interlocks, tables=tables)
