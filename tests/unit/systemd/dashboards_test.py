#!/usr/bin/python3
"""The Grafana dashboards as Grafana 9 to 11 takes them: structure, layout, variables, PromQL, metrics that exist.

usage: dashboards_test.py ROOT      exit status 77: promtool is not there

Grafana itself is no Debian package. Its own schema (@grafana/schema) is asked by tests/hil/live_page.py; here is what that
does not say and Grafana would take silently and show wrongly: overlaps, unknown variables and units, refIds.
"""
import glob
import itertools
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile

KINDS = {"state-timeline", "gauge", "stat", "timeseries", "heatmap", "bargauge", "table", "text", "row"}
UNITS = {"none", "short", "s", "ms", "percentunit", "percent", "celsius", "accMS2", "rothz", "hertz", "degree", "arcsec",
         "radian", "ops", "reqps", "bool", "bool_on_off", "dtdurations", "cps", "wps", "rps"}
TOP = {"title": str, "uid": str, "schemaVersion": int, "version": int, "panels": list, "templating": dict, "time": dict,
       "tags": list}


def faults_of(dashboard):
    """In words, each with its place."""
    for key, kind in TOP.items():
        if not isinstance(dashboard.get(key), kind):
            yield f"{key}: found {dashboard.get(key)!r}, expected a {kind.__name__}"
            return
    if not re.fullmatch(r"[A-Za-z0-9_-]{1,40}", dashboard["uid"]):
        yield f"uid: found {dashboard['uid']!r}, expected up to 40 letters, digits, - and _"
    if not {"from", "to"} <= dashboard["time"].keys():
        yield "time: expected from and to"
    variables = {v.get("name") for v in dashboard["templating"].get("list", [])}
    panels = dashboard["panels"]
    ids = [panel.get("id") for panel in panels]
    if len(set(ids)) != len(ids) or not all(isinstance(i, int) and i > 0 for i in ids):
        yield f"panels: found ids {ids}, expected each once"
    for panel in panels:
        for fault in faults_of_panel(panel, variables):
            yield f"panel \"{panel.get('title')}\": {fault}"
    for a, b in itertools.combinations(panels, 2):
        p, q = a["gridPos"], b["gridPos"]
        if p["x"] < q["x"] + q["w"] and q["x"] < p["x"] + p["w"] and p["y"] < q["y"] + q["h"] and q["y"] < p["y"] + p["h"]:
            yield f"panels \"{a['title']}\" and \"{b['title']}\" overlap"


def faults_of_panel(panel, variables):
    if panel.get("type") not in KINDS:
        yield f"type: found {panel.get('type')!r}, expected one of {', '.join(sorted(KINDS))}"
    if not panel.get("title"):
        yield "title: found nothing"
    grid = panel.get("gridPos", {})
    if not all(isinstance(grid.get(k), int) for k in "xywh") or not 0 <= grid["x"] or grid["x"] + grid["w"] > 24 or \
            grid["w"] < 1 or grid["h"] < 1 or grid["y"] < 0:
        yield f"gridPos: found {grid}, expected whole numbers within 24 columns"
    if panel.get("datasource", {}).get("type") != "prometheus":
        yield "datasource: expected prometheus"
    unit = panel.get("fieldConfig", {}).get("defaults", {}).get("unit", "none")
    if unit not in UNITS and not re.match(r"(suffix|prefix|si):.", unit):
        yield f"unit: found {unit!r}, expected one that Grafana has"
    refs = [target.get("refId") for target in panel.get("targets", [])]
    if panel.get("type") not in ("text", "row") and (not refs or len(set(refs)) != len(refs) or None in refs):
        yield f"targets: found refIds {refs}, expected some, each once"
    for step in panel.get("fieldConfig", {}).get("defaults", {}).get("thresholds", {}).get("steps", []):
        if not {"color", "value"} <= step.keys():
            yield f"thresholds: found {step}, expected color and value"
    for name in re.findall(r"\$\{?(\w+)", json.dumps(panel)):
        if name not in variables and not name.startswith("__"):
            yield f"found variable ${name}, expected one of {', '.join(sorted(variables))}"


def expressions(dashboard):
    return [target["expr"] for panel in dashboard["panels"] for target in panel.get("targets", [])]


def promql_faults(dashboards):
    """By the parser of Prometheus itself; variables as Grafana fills them in."""
    rules = [{"record": f"check:{i}", "expr": re.sub(r"\$\{?instance\}?", ".*", e)} for i, e in enumerate(dashboards)]
    with tempfile.NamedTemporaryFile("w", suffix=".yml") as file:
        json.dump({"groups": [{"name": "dashboards", "rules": rules}]}, file)   # JSON is YAML
        file.flush()
        run = subprocess.run(["promtool", "check", "rules", file.name], capture_output=True, text=True)
    return run.stdout + run.stderr if run.returncode else ""


def spoilt(dashboard, spoil):
    copy = json.loads(json.dumps(dashboard))
    spoil(copy)
    return list(faults_of(copy))


def main(root):
    failed = []

    def check(good, what, words=""):
        print(("ok" if good else "NOT ok") + f" - {what}" + ("" if good else f": {words}"))
        if not good:
            failed.append(what)

    known = {"up"}
    for source in ("daemon/serve/metrics.cpp", "daemon/status/values.cpp"):
        with open(os.path.join(root, source), encoding="utf-8") as file:
            known |= set(re.findall(r"\"(vibrig_\w+)\"", file.read()))
    uids, all_expressions = [], []
    for path in sorted(glob.glob(os.path.join(root, "systemd/prometheus/*dashboard.json"))):
        name = os.path.basename(path)
        with open(path, encoding="utf-8") as file:
            dashboard = json.load(file)
        faults = list(faults_of(dashboard))
        check(not faults, f"{name} is as Grafana takes it", "; ".join(faults))
        used = {re.sub(r"_(bucket|sum|count)$", "", m) for e in expressions(dashboard) for m in re.findall(r"vibrig_\w+", e)}
        check(used <= known, f"{name} asks for metrics that there are", str(sorted(used - known)))
        uids.append(dashboard["uid"])
        all_expressions += expressions(dashboard)
    check(len(set(uids)) == len(uids) == 2, "a dashboard for a rig and one for the fleet", str(uids))
    # The check itself, on dashboards that are wrong.
    with open(os.path.join(root, "systemd/prometheus/vibrig-dashboard.json"), encoding="utf-8") as file:
        good = json.load(file)
    for what, spoil in {"overlap": lambda d: d["panels"][1]["gridPos"].update(d["panels"][0]["gridPos"]),
                        "each once": lambda d: d["panels"][1].update(id=1),
                        "type": lambda d: d["panels"][0].update(type="graphh"),
                        "24 columns": lambda d: d["panels"][0]["gridPos"].update(w=25),
                        "variable $rig": lambda d: d["panels"][0]["targets"][0].update(expr="up{instance=\"$rig\"}"),
                        "refIds": lambda d: d["panels"][0]["targets"][0].pop("refId"),
                        "unit": lambda d: d["panels"][0]["fieldConfig"]["defaults"].update(unit="furlong"),
                        "schemaVersion": lambda d: d.pop("schemaVersion")}.items():
        check(any(what in fault for fault in spoilt(good, spoil)), f"a wrong dashboard is found: {what}")
    if shutil.which("promtool") is None:
        print("promtool: not there")
        return 77 if not failed else 1
    check(not promql_faults(all_expressions), "Prometheus parses every expression", promql_faults(all_expressions))
    check(promql_faults(["sum(rate(x[5m])"]), "a wrong expression is found")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
