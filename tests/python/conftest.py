"""Recordings as vibrigd writes them, made without it: the format of docs/python.md a second time."""
import json
import pathlib

import h5py
import numpy as np
import pytest

import vibrig

SECOND = 10**9
STEP = 25_000_000
CONFIGURATION = """vibration.transmission = 0.6667  # 1  default
platform.up = "+y"
platform.gyro_x_axes = ["+x", "+y", "+z"]
platform.gyro_y_axes = ["+y", "+z", "+x"]
platform.gyro_z_axes = ["+z", "+x", "+y"]
platform.encoder_sign = [1, 1, 1]
platform.encoder_zero_deg = [0.0, 0.0, 0.0]
"""
INTERLOCKS = [{"name": "hot", "condition": "temperature", "unit": "degC", "limit": 60.0},
              {"name": "stuck", "condition": "stuck", "unit": "", "limit": None}]


def column(group, name, values, unit=""):
    data = group.create_dataset(name, data=values, maxshape=(None, *np.shape(values)[1:]), chunks=True)
    data.attrs["description"] = np.bytes_("what " + name + " is")
    if unit:
        data.attrs["unit"] = np.bytes_(unit)


class Recording:
    """Files of one campaign; each has 400 samples and dwells of 100 of them."""

    def __init__(self, folder: pathlib.Path):
        self.folder = folder
        folder.mkdir(parents=True)

    def part(self, part, start, orders, done, *, state="finished", restart=False, before=0, offset_s=1_700_000_000,
             result=None, conditions=True, campaign="test-1"):
        path = self.folder / ("campaign.h5" if part == 1 else f"campaign-{part}.h5")
        with h5py.File(path, "w", libver="latest") as file:
            for name, value in {"format": "vibrig-campaign", "name": "test", "started_by": "A. Person",
                                "version": "0.1.0", "campaign": campaign, "state": state, "reason": "",
                                "mark": ""}.items():
                file.attrs[name] = np.bytes_(value)
            for name, value in {"format_version": 2, "part": part, "restart": int(restart), "dwells_before": before,
                                "started_utc_ns": (offset_s + 5) * SECOND, "utc_offset_ns": offset_s * SECOND}.items():
                file.attrs[name] = value
            for name, text in {"configuration": CONFIGURATION, "dbc": "VERSION", "plan": "{}",
                               "result": json.dumps(result or {}), "interlocks": json.dumps(INTERLOCKS)}.items():
                file[name] = np.bytes_(text)
            self._tables(file, start, orders, done, conditions)
        return path

    @staticmethod
    def _tables(file, start, orders, done, conditions):
        samples = file.create_group("samples")
        times = start + STEP * np.arange(400)
        column(samples, "time_ns", times, "ns")
        column(samples, "force_g", np.tile([0.0, 1.0, 0.0], (400, 1)), "g")
        group = file.create_group("orders")
        begin = start + 100 * STEP * np.arange(len(orders))
        for name, values in {"announced_ns": begin, "from_ns": begin, "to_ns": begin + 100 * STEP}.items():
            column(group, name, values.astype(np.int64), "ns")
        for name, values in {"run": np.ones(len(orders), np.int32), "position": np.array(orders, np.int32),
                             "cancel": np.zeros(len(orders), np.uint8)}.items():
            column(group, name, values)
        group = file.create_group("dwells")
        column(group, "time_ns", (begin[:done] + 100 * STEP).astype(np.int64), "ns")
        for name, values in {"run": np.ones(done, np.int32), "position": np.array(orders[:done], np.int32),
                             "samples": np.full(done, 100, np.uint32)}.items():
            column(group, name, values)
        random = np.random.default_rng(1)
        half = random.normal(size=(30, 30))
        covariance = half @ half.T * 1e-4
        column(group, "value", np.tile(np.linspace(-1, 1, 30), (done, 1)), "deg/h, deg/h/g, deg/h/g^2")
        column(group, "sigma", np.tile(np.sqrt(np.diag(covariance)), (done, 1)))
        column(group, "covariance", np.tile(covariance, (done, 1, 1)))
        column(group, "observable", np.tile(np.arange(30) != 29, (done, 1)).astype(np.uint8))
        group = file.create_group("events")
        column(group, "time_ns", np.array([start], np.int64), "ns")
        column(group, "text", np.array(["Umlaut \xe4".encode()], dtype="S320"))
        for name in ("estimates", "gaps"):
            group = file.create_group(name)
            column(group, "time_ns" if name == "estimates" else "from_ns", np.zeros(0, np.int64), "ns")
        if conditions:
            group = file.create_group("conditions")
            column(group, "time_ns", start + SECOND * np.arange(10), "ns")
            column(group, "temperature_c", np.full(10, 44.5), "degC")
            column(group, "interlock_value", np.tile([45.0, np.nan], (10, 1)), "see /interlocks")


@pytest.fixture
def recording(tmp_path):
    return Recording(tmp_path / "recordings" / "test-1")


@pytest.fixture
def campaign(recording):
    recording.part(1, 10 * SECOND, [1, 2, 3], 2)
    return vibrig.open(recording.folder)
