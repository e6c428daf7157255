#!/usr/bin/python3
"""Moves the files of a checkout into the rooms of the second design and rewrites what names them."""
import os, re, subprocess, sys
root = sys.argv[1]
os.chdir(root)
def git(*a): return subprocess.run(["git", *a], capture_output=True, text=True, check=True).stdout
files = [f for f in git("ls-files").split("\n") if f]

STEM = {}   # "drivers/clock" -> folder
def room(folder, old, names):
    for n in names.split(): STEM[f"{old}/{n}"] = folder
room("drivers/base", "drivers", "clock units")
room("drivers/can", "drivers", "can_pending_operations can_port can_port_base can_port_seqpacket can_port_socketcan receive_batch")
room("drivers/sample", "drivers", "assembler frame_plan sample signal_binding sync_clock")
room("drivers/gimbal", "drivers", "gimbal torquer")
room("drivers/shaker", "drivers", "modbus_link modbus_shaker shaker shaker_image shaker_orders")
room("drivers/annunciator", "drivers", "annunciator horn page_command")
room("estimator/filter", "estimator", "drift_filter drift_model instruction_set kinematics linear_algebra measurement parameters settings settings_check second_moment ud_filter ud_kernel ud_kernel_avx2 ud_kernel_avx512 ud_kernel_baseline ud_memory")
room("estimator/level", "estimator", "hann lock_in loop_response paper_level ring_down saturation_detector stuck_detector vibration_level vibration_moment sync_motion growing_tensor")
room("estimator/identification", "estimator", "batch_solver crlb dwell_row dwell_buffer dwell_record dwell_residual identification identification_impl identification_result observability plan_report predicted_rate two_step")
room("daemon/interlock", "daemon/rt", "amplitude_witness interlock interlock_motion interlock_table lock_in mean_motion rest_monitor")
room("daemon/domain", "daemon", "status upgrade")
room("daemon/app", "daemon", "campaign_forecast daemon daemon_checks daemon_commands daemon_outside daemon_real_time daemon_record daemon_unattended rig_lock vibrigd watchdog")
room("daemon/results", "daemon/tool", "result_json result_table")
room("daemon/results", "daemon/tool", "progress assessment_json")
room("daemon/tool/live", "daemon/tool", "remote remote_events remote_watch pki")
room("daemon/tool/recordings", "daemon/tool", "campaign_argument mat_file recording_commands replay report_commands certificate journal journal_commands")
room("daemon/tool/analysis", "daemon/tool", "allan allan_analysis allan_json allan_plot allan_table column_file identify level zero uncertainty calibrate reproduce")
room("daemon/tool/design", "daemon/tool", "plan plan_output plan_plot plan_study")

SPECIAL = {"daemon/tool/reproduce.hpp": "daemon/papers/reproduce.hpp", "drivers/shaker_latest.hpp": "drivers/base/latest.hpp", "daemon/rt/snapshot.hpp": "drivers/base/snapshot.hpp",
           "daemon/rt/event_fd.hpp": "drivers/base/event_fd.hpp", "daemon/rt/event_fd.cpp": "drivers/base/event_fd.cpp"}
ANY = [(r"daemon/tool/(reproduce[_.].*)", r"daemon/papers/\1"), (r"daemon/tool/plot/(.*)", r"daemon/plot/\1"),
       (r"daemon/(daemon_[a-z_]+\.[ch]pp)", r"daemon/app/\1")]
DIRS = {"tests/unit/shaker": "tests/unit/drivers/shaker", "tests/unit/annunciator": "tests/unit/drivers/annunciator"}

for n in ("allan", "levelling", "zeros", "uncertainty", "commissioning"): DIRS[f"tests/unit/{n}"] = f"tests/unit/estimator/{n}"
for n in ("app", "campaign", "configuration", "fleet", "guard", "journal", "log", "noise", "plan", "record", "report", "rt", "serve", "tool", "upgrade"):
    DIRS[f"tests/unit/{n}"] = f"tests/unit/daemon/{n}"

moves, left = {}, []
for f in files:
    if f in SPECIAL: moves[f] = SPECIAL[f]; continue
    base = re.sub(r"\.(cpp|hpp|inc)$", "", f)
    if base in STEM and base != f: moves[f] = f"{STEM[base]}/{os.path.basename(f)}"; continue
    for pattern, new in ANY:
        if re.fullmatch(pattern, f): moves[f] = re.sub(pattern, new, f); break
    else:
        d = next((d for d in DIRS if f.startswith(d + "/")), None)
        if d: moves[f] = DIRS[d] + f[len(d):]
        elif re.fullmatch(r"(drivers|estimator|daemon)/[^/]+\.(cpp|hpp|inc)", f): left.append(f)
if left: print("NOT PLACED:", left); sys.exit(1)
for old, new in moves.items():
    os.makedirs(os.path.dirname(new), exist_ok=True)
    git("mv", old, new)

names = {o: n for o, n in moves.items()}
files = [f for f in git("ls-files").split("\n") if f]
texts = [f for f in files if f.endswith((".cpp", ".hpp", ".inc", ".txt", ".py", ".md", ".json", ".in", ".cmake", ".cc")) or "." not in os.path.basename(f)]
word = re.compile(r"(?<![\w/.])(?:proto|drivers|estimator|daemon|tests)/[\w./-]*\w")
def swap(m):
    s = m[0]
    if s in names: return names[s]
    for d in DIRS:
        if s == d or s.startswith(d + "/"): return DIRS[d] + s[len(d):]
    return s
for f in texts:
    if f in ("docs/changelog.md",): continue
    try: t = open(f, encoding="utf-8").read()
    except UnicodeDecodeError: continue
    n = re.sub(r'(?<=[" /}(<`])' + r"((?:drivers|estimator|daemon|tests)/[\w./-]*\w)", lambda m: swap(m), t)
    n = re.sub(r'(?m)^((?:drivers|estimator|daemon|tests)/[\w./-]*\w)', lambda m: swap(m), n)
    if n != t: open(f, "w", encoding="utf-8").write(n)
print(len(moves), "moved")
