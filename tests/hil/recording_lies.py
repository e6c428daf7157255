"""Lies about a recorded campaign: what can be changed in its HDF5 file, its raw logs and its dwells.csv. Each takes an
open file and a source of chance, and says what it did; nothing: there is nothing of that kind to change."""
import hashlib
import os
import re
import subprocess

import h5py
import numpy as np

import rig as r

NUMBERS = [np.nan, np.inf, -np.inf, -1.0, 0.0, 1e300, -1e300, 5e-324, 2.0**63, -2.0**63, 2.0**31, 1e9]
INTEGERS = [0, 1, -1, 2, 7, 255, 2**31, -2**31, 2**32 + 1, 2**53, 2**59, 2**62, 2**63 - 1, -2**63, -2**63 + 1]
TEXTS = [b"", b"a\0b", b"\x1b[31mred\x07\r", b"\xff\xfe\xc0\x80", b"x" * 2**20, b"<script>alert(1)</script>", b"%s%n{}{0}",
         b"../../../../etc/passwd", "\u202eright \u0085".encode(), b"a\nb\n", b"'\"; DROP TABLE campaign; --"]
VALUES = ["nan", "inf", "-1", "0", "1e300", "1e-300", '""', "[]", "true", "99999999999999999999", '"x"', "{}", "1e999", "null", "[[]]", '"\\u001b[31m"']
TYPES = ["S8", "f4", "i1", "u8", "f8", ">i2", "V5", "c16", [("a", "f8"), ("b", "S3")], ("f8", (2,)), h5py.string_dtype(),
         h5py.vlen_dtype(np.int32), h5py.enum_dtype({"A": 1, "B": 9}), h5py.ref_dtype]
TABLES = ["samples", "samples", "orders", "orders", "dwells", "dwells", "estimates", "events", "conditions", "gaps"]
LONG = ["configuration", "configuration", "configuration", "result", "plan", "interlocks", "proof", "head", "dbc"]


def a_set(file, c, kinds="fiubOScV", least=0):
    """A column, or one of the long texts."""
    table = c.choice([*TABLES, ""])
    names = [f"{table}/{name}".strip("/") for name, item in file[table or "/"].items() if isinstance(item, h5py.Dataset)]
    names = [name for name in names if file[name].dtype.kind in kinds and (file[name].size or 0) > least]
    return c.choice(names) if names else a_set(file, c, kinds, least)


def replaced(file, name, data=None, **how):
    attributes = dict(file[name].attrs)
    del file[name]
    file.create_dataset(name, data=data, **how)
    file[name].attrs.update(attributes)


def numbers(file, c):
    name = a_set(file, c, "fiu")
    values = np.atleast_1d(file[name][()])
    at, many, rows = c.randrange(len(values)), c.randrange(1, 50), range(len(values))
    rows = c.choice([rows[at:at + 1], rows[at:at + many], rows[at:], rows])
    number = c.choice(NUMBERS) if values.dtype.kind == "f" else int(np.clip(c.choice(INTEGERS), *(
        int(limit) for limit in (np.iinfo(values.dtype).min, np.iinfo(values.dtype).max))))
    values[rows] = number
    replaced(file, name, values)
    return f"{name}: {number} in {len(rows)} rows from {rows[0]}"


def times(file, c):
    name = c.choice(["samples/time_ns"] * 4 + ["orders/from_ns", "orders/to_ns", "dwells/time_ns", "estimates/time_ns", "conditions/time_ns"])
    values = file[name][()]
    at, how = c.randrange(1, len(values)), c.choice(["back", "repeat", "jump", "reversed", "constant", "dense", "shuffled"])
    if how == "back":
        values[at:] -= values[at] - values[0] + c.choice([1, 10**9])
    elif how == "jump":
        values[at:] += c.choice([10**10, 10**15, 2**59, 2**62])
    elif how == "dense":
        values[at:at + 1000] = values[at] + np.arange(len(values[at:at + 1000]))
    else:
        values[at:] = {"repeat": values[at - 1], "reversed": values[:at - 1:-1].copy(), "constant": values[0],
                       "shuffled": np.array(c.sample(list(values[at:]), len(values) - at))}[how]
    file[name][...] = values
    return f"{name}: {how} from {at} on"


def rows_of_a_table(file, c):
    table = c.choice(TABLES)
    names = [f"{table}/{name}" for name in file[table]]
    rows, how = min(len(file[name]) for name in names), c.choice(["reversed", "doubled", "none", "first", "shuffled", "many times"])
    order = {"reversed": range(rows)[::-1], "doubled": [*range(rows)] * 2, "none": [], "first": range(rows)[:1],
             "shuffled": c.sample(range(rows), rows), "many times": [*range(rows)] * (5000 // max(rows, 50))}[how]
    for name in names:
        replaced(file, name, file[name][()][list(order)])
    return f"{table}: rows {how}"


def orders(file, c):
    begin, end, by = file["orders/from_ns"], file["orders/to_ns"], c.choice([10**9, 10**10, 10**12, 2**58, 2**61])
    how = c.choice(["overlap", "beyond the end", "end before they begin", "are cancelled", "one long"])
    if how == "overlap":
        begin[...] = begin[()] - by
    elif how == "beyond the end":
        end[...] = end[()] + by
    elif how == "end before they begin":
        begin[...], end[...] = end[()], begin[()]
    elif how == "are cancelled":
        file["orders/cancel"][...] = 1
    else:
        begin[...], end[...] = 0, by
    return f"orders {how}, {by}"


def shape(file, c):
    name = a_set(file, c)
    data = np.asarray(file[name][()])
    flat, how = data.reshape(-1), c.choice(["scalar", "flat", "deep", "turned", "short", "long", "none", "null", "vast", "wide"])
    if how == "vast":
        replaced(file, name, shape=(c.choice([2**28, 2**40, 2**61 // 3]), *data.shape[1:]), dtype=data.dtype, chunks=True)
    else:
        replaced(file, name, {"scalar": flat[0] if len(flat) else 0, "flat": flat, "deep": data[..., None, None], "turned": data.T,
                              "short": data[:len(data) // 2] if data.ndim else flat, "none": flat[:0], "null": h5py.Empty(data.dtype),
                              "long": np.concatenate([flat, flat]), "wide": np.stack([data, data], axis=-1)}[how])
    return f"{name}: {how}"


def kind(file, c):
    name, to = a_set(file, c), c.choice(TYPES)
    replaced(file, name, shape=file[name].shape, dtype=to)
    return f"{name}: as {to}"


def stored(file, c):
    name = a_set(file, c, "fiu", 1)
    how = c.choice([{"compression": "gzip"}, {"shuffle": True, "fletcher32": True}, {"compression": "lzf"}, {"scaleoffset": 2}, {}])
    replaced(file, name, file[name][()], chunks=tuple(max(1, d // 3) for d in file[name].shape), maxshape=file[name].shape, **how)
    return f"{name}: stored as {how}"


def link(file, c):
    name, other = c.choice([a_set(file, c), c.choice(TABLES)]), os.path.join(os.path.dirname(file.filename), "other")
    how = c.choice(["gone", "renamed", "group", "set", "soft", "nowhere", "itself", "cycle", "external", "pipe", "outside", "virtual"])
    rows, of = getattr(file[name], "shape", ()), getattr(file[name], "dtype", "f8")
    if how == "cycle":
        file[name.split("/")[0] + "/cycle" if "/" in name else "cycle"] = file["/"]
    elif how == "renamed":
        file.move(name, name + c.choice(["_", "2", " "]))
    else:
        del file[name]
    if how == "group":
        file.create_group(name + "/inside")
    elif how == "set":
        file[name] = np.arange(3)
    elif how in ("soft", "nowhere", "itself"):
        file[name] = h5py.SoftLink({"soft": "/samples/time_ns", "nowhere": "/nowhere/at/all", "itself": "/" + name}[how])
    elif how in ("external", "pipe"):
        if how == "pipe":
            os.mkfifo(other)
        file[name] = h5py.ExternalLink(other if how == "pipe" else c.choice(["campaign.h5", "nowhere.h5"]), "/" + name)
    elif how == "outside":
        file.create_dataset(name, shape=rows, dtype=of, external=[("/etc/passwd", 0, h5py.h5f.UNLIMITED)])
    elif how == "virtual":
        layout = h5py.VirtualLayout(shape=rows, dtype=of)
        layout[...] = h5py.VirtualSource("/etc/passwd", "x", shape=rows)
        file.create_virtual_dataset(name, layout)
    return f"{name}: {how}"


def attribute(file, c):
    of = file if c.random() < 0.8 else file[c.choice([a_set(file, c), "samples/quality"])]
    name, how = c.choice(sorted(of.attrs)), c.choice(["gone", "array", "compound", "number", "number", "text", "text", "null", "real", "many"])
    del of.attrs[name]
    if how != "gone":
        of.attrs[name] = {"array": np.arange(5), "compound": np.array((1, 2.0), dtype=[("a", "i4"), ("b", "f8")]), "number": c.choice(INTEGERS),
                          "text": np.bytes_(c.choice(TEXTS)[:60000]), "null": h5py.Empty("f8"), "real": c.choice(NUMBERS), "many": np.zeros((3, 3))}[how]
    return f"attribute {name} of {of.name}: {how}"


def words(file, c):
    """Texts of a table, or one that is long."""
    name, text = a_set(file, c, "S"), c.choice(TEXTS)
    if file[name].ndim == 0:
        replaced(file, name, np.bytes_(text or b"\0"))
    else:
        file[name][...] = np.full(file[name].shape, text[:file[name].dtype.itemsize], dtype=file[name].dtype)
    return f"{name}: {text[:20]!r}"


def value(file, c):
    """One value of the configuration, or of what is JSON."""
    name = c.choice(LONG)
    text = file[name][()].decode()
    places = [place for place in re.finditer(r"(?<=[=:,\[ ])(-?[\d.]+(e[+-]?\d+)?|true|false)\b|\"[^\"\n]*\"(?![\":])", text)
              if "#" not in text[text.rfind("\n", 0, place.start()) + 1:place.start()]]
    if not places or c.random() < 0.1:
        text, said = c.choice(["[" * 200000, '{"a":' * 100000, "null", "{}", "[]", "1", '{"identified_anew":{"noise":5}}']), "another"
    else:
        place, to = c.choice(places), c.choice(VALUES)
        said = f"{text[max(0, place.start() - 40):place.end()]!r} is {to}"
        text = text[:place.start()] + to + text[place.end():]
    replaced(file, name, np.bytes_(text))
    if name == "configuration" and c.random() < 0.8:   # else it is refused unread
        file.attrs.create("configuration_sha256", hashlib.sha256(text.encode()).hexdigest().encode(), dtype="S64")
    return f"{name}: {said}"


def another_part(file, c):
    path = os.path.join(os.path.dirname(file.filename), "campaign-2.h5")
    with h5py.File(path, "w", libver="latest") as other:
        for name in file:
            file.copy(name, other)
        other.attrs.update({**file.attrs, "part": 2, "restart": c.choice([0, 1]), "dwells_before": c.choice([0, 1, 2, 10**6, -1])})
        other.attrs["utc_offset_ns"] = c.choice([file.attrs["utc_offset_ns"], *INTEGERS])
        return f"a second part; in it {c.choice([numbers, times, rows_of_a_table, orders, attribute])(other, c)}"


def state(file, c):
    file.attrs["state"] = np.bytes_(c.choice([b"running", b"running", b"recovered", b"x"]))
    return f"state {file.attrs['state']}"


IN_HDF5 = [numbers, numbers, numbers, times, times, rows_of_a_table, orders, shape, shape, kind, stored, link, link, attribute,
           attribute, words, value, value, another_part, state]


def lie_in_bytes(path, c):
    with open(path, "rb") as file:
        data = bytearray(file.read())
    at, how = c.randrange(len(data)), c.choice(["cut off", "zeros", "noise", "bits", "twice", "page moved"])
    if how == "cut off":
        data = data[:at]
    elif how == "bits":
        for _ in range(20):
            data[c.randrange(len(data))] ^= 1 << c.randrange(8)
    elif how == "twice":
        data = data + data
    else:
        size = len(data[at:at + 4096])
        data[at:at + size] = {"zeros": bytes(size), "noise": c.randbytes(size), "page moved": data[:size]}[how]
    with open(path, "wb") as file:
        file.write(data)
    return f"{os.path.basename(path)}: {how} at {at}"


def left_open(path):
    """As by a writer that died."""
    child = os.fork()
    if child == 0:
        h5py.File(path, "r+", libver="latest").swmr_mode = True
        os._exit(0)
    return [f"left open, {os.waitpid(child, 0)[1]}"]


def changed_lines(data, c):
    """Of a raw log, or of dwells.csv."""
    lines = data.split(b"\n")
    at, how = c.randrange(len(lines)), c.choice(["long", "foreign", "late", "early", "fields", "doubled", "reversed", "shuffled", "sent", "none", "start"])
    if how == "long":
        lines[at] = b"(" + b"1" * 10**7
    elif how == "foreign":
        lines[at] = c.choice([*TEXTS[1:], b"(99999999999999999999.1) vcan0 001#", b"(1.5) vcan0 7FF#112233445566778899", c.randbytes(300)])
    elif how in ("late", "early"):
        lines[at] = lines[at].replace(b"(1", b"(9" if how == "late" else b"(0").replace(b",1", b",9" if how == "late" else b",-1")
    elif how == "fields":
        lines[at] = re.sub(rb"\d+(?=[,#])", lambda _: c.choice([b"nan", b"-1", b"1e300", b"", b"99999999999"]), lines[at], count=c.randrange(1, 9))
    else:
        lines = {"doubled": lines * 2, "reversed": lines[::-1], "shuffled": c.sample(lines, len(lines)), "none": [],
                 "sent": [line.replace(b" R", b" T") for line in lines], "start": lines[:at] + [b"# vibrigd starts"] + lines[at:]}[how]
    return b"\n".join(lines), f"lines {how} at {at}"


def lie_in_frames(folder, c):
    logs = r.raw_logs(folder)
    path, how = c.choice([*logs, os.path.join(folder, "dwells.csv")]), c.choice(["bytes", "lines", "lines", "lines", "again", "exchanged", "frames", "bomb"])
    if how == "bytes":
        return lie_in_bytes(path, c)
    if how == "exchanged":
        os.rename(logs[0], logs[0] + "-"), os.rename(logs[1], logs[0]), os.rename(logs[0] + "-", logs[1])
        return "two segments exchanged"
    with open(path, "rb") as file:
        data = file.read()
    packed = path.endswith(".zst")
    if how == "again":
        path = os.path.join(folder, f"raw-{len(logs) + 1:04d}.log" + (".zst" if packed else ""))
    elif how == "frames":   # of zstd, behind one another; a skippable one, and one that begins and no more
        data += c.choice([data, data[:20], b"\x50\x2a\x4d\x18\x04\0\0\0skip", b"\x28\xb5\x2f\xfd", bytes(100)])
    else:
        text = subprocess.run(["zstd", "-dc"], input=data, capture_output=True, check=True).stdout if packed else data
        text, how = changed_lines(text, c) if how == "lines" else (c.choice([b"\n", b"#", b"# x\n"]) * 5 * 10**7, how)
        data = subprocess.run(["zstd", "-c"], input=text, capture_output=True, check=True).stdout if packed else text
    with open(path, "wb") as file:
        file.write(data)
    return f"{os.path.basename(path)}: {how}"


def tell(folder, c):
    """One to three lies. What was done, and whether it is about frames alone."""
    path, done, last = os.path.join(folder, "campaign.h5"), [], c.random()
    if last < 0.15:
        return [lie_in_frames(folder, c)], True
    if last < 0.25:
        return (left_open(path) if last < 0.18 else []) + [lie_in_bytes(path, c)], False
    with h5py.File(path, "r+", libver="latest") as file:
        wanted, tries = c.choice([1, 1, 2, 3]), 0
        while len(done) < wanted and (tries := tries + 1) < 20:
            try:
                done.append(c.choice(IN_HDF5)(file, c))
            except (KeyError, IndexError, ValueError, TypeError, OSError, RuntimeError, AttributeError):
                continue   # there is nothing of that kind, or an earlier lie took it
    return done + (left_open(path) if last < 0.28 else [lie_in_frames(folder, c)] if last > 0.93 else []), False
