"""vibrig.open on recordings, good and bad."""
import hashlib
import pathlib
import re
import shutil

import h5py
import numpy as np
import pytest

import vibrig
from conftest import SECOND, STEP

ROOT = pathlib.Path(__file__).parents[2]


def test_version_is_that_of_the_project():
    project = re.search(r"project\(vibrig VERSION ([0-9.]+)", (ROOT / "CMakeLists.txt").read_text())
    assert vibrig.__version__ == project[1]


def test_arrays_have_shapes_and_units(campaign):
    assert campaign.samples["force_g"].shape == (400, 3)
    assert campaign.samples.units["force_g"] == "g"
    assert campaign.samples.descriptions["force_g"] == "what force_g is"
    assert campaign.events["text"][0] == "Umlaut \xe4"
    assert campaign.conditions["interlock_value"].shape == (10, len(campaign.interlocks))
    assert campaign.state == "finished" and campaign.verdict is None
    with pytest.raises(KeyError, match="found no column 'force', expected one of"):
        campaign.samples["force"]


def test_frames_have_utc_and_a_column_for_each_number(campaign):
    frame = campaign.conditions.frame()
    assert list(frame.columns) == ["interlock_value_hot", "interlock_value_stuck", "temperature_c", "time_ns"]
    assert str(frame.index[0]) == "2023-11-14 22:13:30+00:00"
    assert {"force_g_x", "force_g_y", "force_g_z"} <= set(campaign.samples.frame().columns)
    assert "value_D_OSz" in campaign.dwells.frame().columns


def test_coefficients_with_covariance(campaign):
    found = campaign.coefficients
    one = found["D_Fx"]
    assert (one.name, one.value, one.sigma, one.unit, one.observable) == ("D_Fx", -1.0, found.sigma[0], "deg/h", True)
    # No result: the filter's covariance, which is noise alone and no uncertainty.
    assert np.isnan(one.u) and np.all(np.isnan(found.u)) and np.allclose(np.diag(found.covariance)[:29], found.sigma[:29]**2)
    assert not found["D_OSz"].observable and np.isnan(found["D_OSz"].value)
    assert np.all(np.isnan(found.covariance[29])) and np.all(np.isnan(found.covariance[:, 29]))
    assert np.allclose(np.diag(found.correlation)[:29], 1)
    assert found.frame().loc["D_IIy", "unit"] == "deg/h/g^2"
    with pytest.raises(KeyError, match="expected one of D_Fx"):
        found["D_t"]


def of_result(key):
    parameters = [{"name": name, "value": 1.0, "sigma": 0.1, "observable": name != "D_OSz"} for name in vibrig.Coefficients.names]
    covariance = [[0.04 if i == j < 29 else None if 29 in (i, j) else 0.0 for i in range(30)] for j in range(30)]
    return vibrig.Coefficients.of_result({"parameters": parameters, key: covariance})


def test_uncertainty_is_the_results_alone():
    assert np.allclose(of_result("covariance_combined").u[:29], 0.2) and np.isnan(of_result("covariance_combined").u[29])
    live = of_result("covariance")   # as /api/v1/parameters has it
    assert np.all(np.isnan(live.u)) and np.isnan(live["D_Fx"].u) and live["D_Fx"].sigma == 0.1
    assert live.covariance[0, 0] == 0.04 and live.correlation[0, 0] == pytest.approx(1)


def test_what_is_not_determined_foretells_nothing():
    # D_OSz is null: where output or spin axis of gyro z lies level it does not count, else neither number is known.
    axes = [["+x", "+y", "+z"], ["+y", "+z", "+x"], ["+z", "+x", "+y"]]
    found = of_result("covariance_combined")
    level = found.drift(np.array([0.0, 1.0, 0.0]), 19.0, axes)
    assert level.determined.all() and level.drift_dph[2] == pytest.approx(1 + 1 + 19)
    assert level.residual_dph[2] == pytest.approx(0.2 * np.sqrt(1 + 1 + 19**2))
    leaning = found.drift(np.array([0.6, 0.8, 0.0]), 19.0, axes)
    assert list(leaning.determined) == [True, True, False] and np.all(np.isfinite(leaning.residual_dph[:2]))
    assert np.isnan(leaning.drift_dph[2]) and np.isnan(leaning.residual_dph[2])


def test_compensation_by_hand(campaign):
    # Levelled, gyro x: the vertical is its output axis (+y).
    value, covariance = campaign.dwells["value"][-1], campaign.dwells["covariance"][-1]
    level = 9 * 0.6667
    h = np.zeros(10)
    h[[0, 2, 5]] = 1, 1, 1 + level**2 / 2
    drift = campaign.compensation([0, 0, 0], table_g=9)
    assert drift.drift_dph[0] == pytest.approx(h @ value[:10])
    assert drift.residual_dph[0] == pytest.approx(np.sqrt(h @ covariance[:10, :10] @ h))
    assert drift.determined.all()
    # D_OSz is not determined; it counts only where output and spin axis of gyro z are both inclined.
    assert not campaign.compensation([30, 30, 45], platform_g=6).determined[2]
    with pytest.raises(ValueError, match="expected one of them"):
        campaign.compensation([0, 0, 0], table_g=9, platform_g=6)
    for wrong in ([0, 0], [0, 0, float("nan")]):
        with pytest.raises(ValueError, match="expected three angles"):
            campaign.compensation(wrong)
    with pytest.raises(ValueError, match="expected 0 to 1000 g"):
        campaign.compensation([0, 0, 0], table_g=float("nan"))


@pytest.mark.parametrize("spectrum, refused", [
    ({"model": "resonance"}, True), ({"model": "groups"}, True), ({"model": "flat"}, False), (None, False),
    ({"model": "flat", "flat": {"alarm": True}, "refusal": None}, True), ({"model": "flat", "flat": None, "refusal": "two"}, True),
    ({"model": "flat", "flat": {"alarm": False}, "refusal": None}, False)])
def test_compensation_over_frequency(recording, spectrum, refused):
    recording.part(1, 10 * SECOND, [1, 2, 3], 2, result={"spectrum": spectrum})
    campaign = vibrig.open(recording.folder)
    assert campaign.compensation([0, 0, 0]).determined.all()
    if refused:
        with pytest.raises(ValueError, match="depend on the frequency, expected a level of 0"):
            campaign.compensation([0, 0, 0], platform_g=3)
    else:
        assert campaign.compensation([0, 0, 0], platform_g=3).determined.all()


def test_rows_of_a_dwell(campaign):
    assert campaign.of_dwell(0) == slice(0, 100)
    assert campaign.of_dwell(1) == slice(100, 200)
    with pytest.raises(IndexError):
        campaign.of_dwell(2)


def test_a_restart_takes_the_place_of_what_was_not_finished(recording):
    # The second dwell was not in the journal, and the clock that of another boot.
    recording.part(1, 10 * SECOND, [1, 2, 3], 2, state="running")
    recording.part(2, SECOND, [2, 3], 2, restart=True, before=1, offset_s=1_700_002_000)
    joined = vibrig.open(recording.folder.parent)
    assert [p.name for p in joined.parts] == ["campaign.h5", "campaign-2.h5"]
    assert list(joined.dwells["position"]) == [1, 2, 3] and list(joined.orders["position"]) == [1, 2, 3]
    times = joined.samples["time_ns"]
    assert len(times) == 800 and np.all(np.diff(times) > 0) and times[400] == 2001 * SECOND
    assert joined.of_dwell(1) == slice(400, 500)
    assert joined.state == "finished"


def test_a_disk_that_refused_after_a_restart(recording):
    recording.part(1, 5000 * SECOND, [1], 1, state="running")
    recording.part(2, SECOND, [2, 3], 1, state="continued", restart=True, before=1, offset_s=1_700_009_000)
    recording.part(3, SECOND + 400 * STEP, [4], 1, offset_s=1_700_009_000)
    joined = vibrig.open(recording.folder)
    assert np.all(np.diff(joined.samples["time_ns"]) > 0) and joined.samples.rows == 1200
    assert list(joined.dwells["position"]) == [1, 2, 4]


def test_what_both_files_have_is_there_once(recording):
    recording.part(1, 10 * SECOND, [1, 2], 1, state="continued")
    recording.part(2, 10 * SECOND + 100 * STEP, [2, 3], 2)
    joined = vibrig.open(recording.folder)
    assert joined.samples.rows == 500
    assert list(joined.orders["position"]) == [1, 2, 3] and list(joined.dwells["position"]) == [1, 2, 3]


def test_a_last_part_that_is_missing_is_named(recording, tmp_path):
    recording.part(1, 10 * SECOND, [1], 1, state="continued")
    last = recording.part(2, 10 * SECOND + 400 * STEP, [2], 1, state="continued")
    for path in (recording.folder, last):
        with pytest.raises(vibrig.FormatError, match=r"campaign-2.h5: attribute state: found continued, expected campaign-3.h5 beside it"):
            vibrig.open(path)
    # A file of another name stands for itself.
    assert vibrig.open(shutil.copy(last, tmp_path / "alone.h5")).state == "continued"
    recording.part(3, 10 * SECOND + 800 * STEP, [3], 1)
    assert vibrig.open(recording.folder).state == "finished"


def test_older_recordings_have_no_conditions(recording):
    recording.part(1, 0, [1], 1, conditions=False)
    conditions = vibrig.open(recording.folder).conditions
    assert conditions.rows == 0
    assert len(conditions.utc()) == 0 and conditions.utc().dtype == "datetime64[ns]"
    assert conditions.frame().shape == (0, 0)
    with pytest.raises(KeyError, match="conditions: found no column 'command_g', expected none: the recording has no such table"):
        conditions["command_g"]


def test_a_mistake_of_the_caller_is_not_the_recordings(campaign):
    for attitude in ([0, 0, "x"], "abc", None, 3, [[1], [2], [3]], [0, 0], [0, 0, np.nan]):
        with pytest.raises(ValueError, match="attitude_deg: found .*, expected three angles, deg"):
            campaign.compensation(attitude)
    for level in ("9", [9], np.nan, -1, 2000):
        with pytest.raises(ValueError, match="table_g: found .*, expected 0 to 1000 g"):
            campaign.compensation([0, 0, 0], table_g=level)
    with pytest.raises(ValueError, match="platform_g: found 'x', expected 0 to 1000 g"):
        campaign.compensation([0, 0, 0], platform_g="x")
    with pytest.raises(KeyError, match="samples: found no column 'foo', expected one of force_g, time_ns"):
        campaign.samples.utc("foo")
    with pytest.raises(KeyError, match="samples: found column 'force_g', expected one of times: time_ns"):
        campaign.samples.utc("force_g")
    with pytest.raises(IndexError, match="dwell: found 2, expected -2 to 1"):
        campaign.of_dwell(2)
    with pytest.raises(FileNotFoundError, match="path: found nothing"):
        vibrig.open("")


@pytest.mark.parametrize(("change", "words"), [
    (lambda f: f.attrs.__setitem__("format_version", 2.5), "attribute format_version: found 2.5, expected one value of its kind"),
    (lambda f: f.attrs.__setitem__("utc_offset_ns", np.nan), "attribute utc_offset_ns: found nan, expected one value of its kind")])
def test_attributes_that_lie_are_refused(recording, change, words):
    path = recording.part(1, 0, [1], 1)
    with h5py.File(path, "r+") as file:
        change(file)
    with pytest.raises(vibrig.FormatError, match=words):
        vibrig.open(path)


def test_a_configuration_that_was_changed_since_is_refused(recording):
    path = recording.part(1, 0, [1], 1)
    with h5py.File(path, "r+") as file:
        text = file["configuration"][()]
        file.attrs["configuration_sha256"] = np.bytes_(hashlib.sha256(text).hexdigest())
    assert vibrig.open(path).configuration_text == text.decode()
    with h5py.File(path, "r+") as file:
        del file["configuration"]
        file["configuration"] = np.bytes_(text.replace(b"0.6667", b"0.6668"))
    with pytest.raises(vibrig.FormatError, match="campaign.h5: /configuration: found SHA-256 [0-9a-f]{64}, expected [0-9a-f]{64} of "
                                                 "attribute configuration_sha256"):
        vibrig.open(path)


def test_times_that_go_back_have_no_dwells(recording):
    path = recording.part(1, 0, [1], 1)
    with h5py.File(path, "r+") as file:
        file["samples/time_ns"][50] = 0
    with pytest.raises(vibrig.FormatError, match="/samples/time_ns: found 0 behind 1225000000 in row 50, expected growing times"):
        vibrig.open(path).of_dwell(0)


def with_quality(path, row, names=None):
    """All 400 samples of a part say so of their channels; without names as recordings did before they had any."""
    with h5py.File(path, "r+") as file:
        if "quality" in file["samples"]:
            del file["samples/quality"]
        values = np.tile(np.array(row, np.uint8), (400, *[1] * np.ndim(row)))
        file["samples"].create_dataset("quality", data=values)
        if names is not None:
            file["samples/quality"].attrs["names"] = np.bytes_(names)
    return path


NAMES = "outer inner azimuth accel_x accel_y accel_z table_accel"


def test_a_channel_that_an_older_recording_lacks_is_unbound(recording):
    path = recording.part(1, 0, [1], 1)
    for row, names, expected in (([0, 1, 2, 3, 4, 0], "outer inner azimuth accel_x accel_y accel_z", [0, 1, 2, 3, 4, 0, 5]),
                                 ([0, 1, 2, 3, 4, 0], None, [0, 1, 2, 3, 4, 0, 5]),
                                 ([0, 1, 2, 3, 4, 0, 1], None, [0, 1, 2, 3, 4, 0, 1]),
                                 ([0, 1, 2, 3, 4, 0, 1], NAMES, [0, 1, 2, 3, 4, 0, 1]),
                                 ([1, 0], "accel_z inner", [5, 0, 5, 5, 5, 1, 5])):
        quality = vibrig.open(with_quality(path, row, names)).samples["quality"]
        assert quality.shape == (400, 7) and list(quality[399]) == expected and quality.dtype == np.uint8


def test_parts_with_more_and_fewer_channels_are_joined(recording):
    with_quality(recording.part(1, 10 * SECOND, [1, 2], 2, state="continued"), [1, 0], "accel_z inner")
    with_quality(recording.part(2, 10 * SECOND + 400 * STEP, [3], 1), [0, 1, 2, 3, 4, 0, 1], NAMES)
    joined = vibrig.open(recording.folder)
    assert list(joined.samples["quality"][0]) == [5, 0, 5, 5, 5, 1, 5]
    assert list(joined.samples["quality"][-1]) == [0, 1, 2, 3, 4, 0, 1]
    assert "quality_table" in joined.samples.frame().columns


@pytest.mark.parametrize(("row", "names", "words"), [
    ([0] * 8, NAMES + " humidity", r"campaign.h5: /samples/quality: found 8 numbers in a row, one of them humidity, expected at most 7 "
     r"\(outer .*\); a newer vibrigd wrote it"),
    ([0] * 7, NAMES.replace("inner", "humidity"), "one of them humidity"),
    ([0] * 8, None, "found 8 numbers in a row without names, expected 7 at most"),
    ([0] * 6, NAMES, "found 6 numbers in a row, expected 7 by its names outer"),
    ([0, 0], "outer outer", "found outer twice among its names, expected it once"),
    ([], None, "found 0 numbers in a row, expected 1 to 7"),
    (0, None, "found 1 dimensions, expected 2"),
    ([[0]] * 7, None, "found 3 dimensions, expected 2")])
def test_qualities_of_a_newer_build_or_that_lie_are_refused(recording, row, names, words):
    path = with_quality(recording.part(1, 0, [1], 1), row, names)
    with pytest.raises(vibrig.FormatError, match=words):
        vibrig.open(path)


@pytest.mark.parametrize("piece", [1, 7, 2**20])   # rows looked at in one go
def test_rows_that_never_reached_the_disk_are_left_out(recording, monkeypatch, piece):
    monkeypatch.setattr("vibrig._campaign.PIECE", piece)
    path = recording.part(1, 0, [1], 1, state="running")
    with h5py.File(path, "r+") as file:
        file["samples/time_ns"][390:] = np.iinfo(np.int64).min
    assert vibrig.open(path).samples["force_g"].shape == (390, 3)


def test_what_is_missing_or_foreign_is_named(recording, tmp_path):
    with pytest.raises(FileNotFoundError, match="found nothing, expected a campaign's"):
        vibrig.open(tmp_path / "nowhere")
    with pytest.raises(FileNotFoundError, match="found none, expected one campaign.h5"):
        vibrig.open(recording.folder)
    recording.part(2, 0, [1], 1)
    with pytest.raises(FileNotFoundError, match="missing campaign.h5, expected all 2 parts"):
        vibrig.open(recording.folder)
    recording.part(1, 0, [1], 1, campaign="other-1")
    with pytest.raises(vibrig.FormatError, match="found part 2 of test-1, expected part 2 of other-1"):
        vibrig.open(recording.folder)
    for name, content in {"empty.h5": b"", "foreign.h5": b"time_s,run\n",
                          "cut.h5": (recording.folder / "campaign.h5").read_bytes()[:2000]}.items():
        (tmp_path / name).write_bytes(content)
        with pytest.raises(vibrig.FormatError, match=f"{name}: found no HDF5 file that can be read"):
            vibrig.open(tmp_path / name)
    path = recording.part(1, 0, [1], 1)
    with h5py.File(path, "r+") as file:
        file.attrs["format_version"] = 9
    with pytest.raises(vibrig.FormatError, match="format_version: found 9, expected 2"):
        vibrig.open(path)


def test_a_campaign_without_a_finished_dwell_has_no_coefficients(recording):
    recording.part(1, 0, [1], 0, state="aborted")
    with pytest.raises(ValueError, match="found no finished dwell"):
        vibrig.open(recording.folder).coefficients
