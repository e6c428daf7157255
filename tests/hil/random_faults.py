"""Rows of the fault matrix for a table that shakes at random: what is lost, broken or reported otherwise under a profile has to end as
it does under a sine, and what only a random control can do wrong has a name of its own."""
import json
import os

import random_campaign as c
import rig as r

# No dwell ends by itself; the sine is there because the coefficients at the reference frequency need one.
CAMPAIGN = {"name": "faulty", "identify": "what-it-can", "dwell_s": 80000.0, "settle_s": 2.0, "ramp_s": 0.5,
            "temperature_window_s": 0.0}
TRUTH = {**c.TRUTH, "isolator": {"hard": True, "cross_axis": [0.01, 0.0]}}
# Six decibels too much is found by whoever looks first: the accelerometers, the controller's reading, or its own bands.
TOO_MUCH = {"amplitude_witness", "over_amplitude", "over_armed_level", "amplitude_off_command", "shaker_fault"}


def start(rig, seed):
    plan = os.path.join(rig.folder, "plan.json")
    with open(plan, "w", encoding="utf-8") as file:
        json.dump({"runs": [c.random_run([0, 0, 0], "identify"),
                            {"position": [0, 0, 0], "table_g": 5.0, "frequency_hz": 15}]}, file)
    rig.start(seed, c.CONFIGURATION, campaign={**CAMPAIGN, "plan": plan}, truth=TRUTH, spectrum={"mount": "hard", "mode": "mixed"},
              threads=r.NO_PRIORITY,
              **{f"shaker.registers.{role}": keys for role, keys in c.REGISTERS.items()})
    rig.wait_for(r.measuring, 60)


def rows_of(matrix):
    """`matrix`: the module with the rows under a sine."""
    named = {row[0]: row for row in matrix.ROWS}
    same = [named[name] for name in (
        "frame loss 1 %", "silence 5 s", "emergency stop", "interface down 1 s", "Modbus: reset mid-reply", "Modbus: cable out 5 s",
        "rig stopped for 30 s")]
    own = [
        ("6 dB too much", matrix.plant("profile-level-wrong=6"), 5, matrix.nothing, TOO_MUCH),
        ("6 dB too little", matrix.plant("profile-level-wrong=-6"), 8, matrix.nothing, {"amplitude_witness", "amplitude_off_command"}),
        ("another profile of the same rms", matrix.plant("wrong-profile=5"), 3, matrix.nothing, {"read_back_mismatch"}),
        ("abort bands let go", matrix.plant("no-abort-bands"), 3, matrix.nothing, {"abort_bands"}),
    ]
    return [("random: " + name, *rest) for name, *rest in same + own]
