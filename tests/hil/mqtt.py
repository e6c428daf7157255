#!/usr/bin/python3
"""vibrigd tells a real mosquitto broker, over TLS with certificates on both sides, what a Sparkplug B host expects: births,
data, deaths, sequence numbers, rebirth. The payloads are read with field numbers written down here a second time.

usage: mqtt.py PROGRAMS
"""
import os
import signal
import ssl
import subprocess
import sys
import tempfile
import threading
import time

import paho.mqtt.client as mqtt
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import live_page  # noqa: E402
import rig as r  # noqa: E402

GROUP, NODE = "lab", "rig-7"
INT64, UINT64, DOUBLE, BOOLEAN, STRING = 4, 8, 10, 11, 12
PATIENCE_S = 30


def sparkplug_payload():
    """Eclipse Sparkplug 3.0, section 6.4.1: name, number, type of the fields that are looked at."""
    kind = descriptor_pb2.FieldDescriptorProto
    messages = {
        "Value": [("type", 1, kind.TYPE_UINT32), ("string_value", 8, kind.TYPE_STRING)],
        "Set": [("keys", 1, kind.TYPE_STRING), ("values", 2, "Value")],
        "Metric": [("name", 1, kind.TYPE_STRING), ("alias", 2, kind.TYPE_UINT64), ("timestamp", 3, kind.TYPE_UINT64),
                   ("datatype", 4, kind.TYPE_UINT32), ("is_null", 7, kind.TYPE_BOOL), ("properties", 9, "Set"),
                   ("int_value", 10, kind.TYPE_UINT32), ("long_value", 11, kind.TYPE_UINT64), ("float_value", 12, kind.TYPE_FLOAT),
                   ("double_value", 13, kind.TYPE_DOUBLE), ("boolean_value", 14, kind.TYPE_BOOL), ("string_value", 15, kind.TYPE_STRING)],
        "Payload": [("timestamp", 1, kind.TYPE_UINT64), ("metrics", 2, "Metric"), ("seq", 3, kind.TYPE_UINT64)]}
    file = descriptor_pb2.FileDescriptorProto(name="judge.proto", package="judge", syntax="proto2")
    for name, fields in messages.items():
        message = file.message_type.add(name=name)
        for field, number, is_a in fields:
            label = kind.LABEL_REPEATED if field in ("keys", "values", "metrics") else kind.LABEL_OPTIONAL
            added = message.field.add(name=field, number=number, label=label)
            if isinstance(is_a, str):
                added.type, added.type_name = kind.TYPE_MESSAGE, ".judge." + is_a
            else:
                added.type = is_a
    pool = descriptor_pool.DescriptorPool()
    pool.Add(file)
    return message_factory.MessageFactory(pool).GetPrototype(pool.FindMessageTypeByName("judge.Payload"))


Payload = sparkplug_payload()
VALUES = {INT64: "long_value", UINT64: "long_value", DOUBLE: "double_value", BOOLEAN: "boolean_value", STRING: "string_value"}


def value_of(metric):
    return None if metric.is_null else getattr(metric, VALUES[metric.datatype])


def named(payload):
    return {m.name: m for m in payload.metrics}


class Host:
    """What reads along: every message of the node, in order."""

    def __init__(self, port, pki):
        self.heard, self.changed = [], threading.Condition()
        self.client = mqtt.Client("host")
        self.client.tls_set(os.path.join(pki, "authority.crt"), os.path.join(pki, "wall.crt"), os.path.join(pki, "wall.key"),
                            tls_version=ssl.PROTOCOL_TLS_CLIENT)
        self.client.reconnect_delay_set(1, 1)
        self.subscribed = threading.Event()
        self.client.on_connect = lambda client, *_: client.subscribe("spBv1.0/#", 1)
        self.client.on_subscribe = lambda *_: self.subscribed.set()
        self.client.on_disconnect = lambda *_: self.subscribed.clear()
        self.client.on_message = self.take
        self.client.connect("127.0.0.1", port)
        self.client.loop_start()

    def take(self, _client, _data, message):
        if "/NCMD/" in message.topic:   # our own
            return
        with self.changed:
            self.heard.append((message.topic, Payload.FromString(message.payload), message.retain, message.payload))
            self.changed.notify_all()

    def kind(self, kind):
        return [p for topic, p, _, _ in self.heard if topic == f"spBv1.0/{GROUP}/{kind}/{NODE}"]

    def until(self, condition, timeout_s=PATIENCE_S):
        with self.changed:
            return self.changed.wait_for(condition, timeout_s)

    def more(self, kind, than, timeout_s=PATIENCE_S):
        """The newest message of a kind, once there are more than `than`; None: there were not."""
        return self.kind(kind)[-1] if self.until(lambda: len(self.kind(kind)) > than, timeout_s) else None

    def command(self, payload):
        self.client.publish(f"spBv1.0/{GROUP}/NCMD/{NODE}", payload, 1)

    def ask_for_birth(self):
        payload = Payload()
        metric = payload.metrics.add(name="Node Control/Rebirth", datatype=BOOLEAN)
        metric.boolean_value = True
        self.command(payload.SerializeToString())


def start_broker(folder, port, pki):
    configuration = os.path.join(folder, "mosquitto.conf")
    with open(configuration, "w", encoding="utf-8") as file:
        file.write(f"listener {port} 127.0.0.1\ncafile {pki}/authority.crt\ncertfile {pki}/server.crt\nkeyfile {pki}/server.key\n"
                   "require_certificate true\nuse_identity_as_username true\nallow_anonymous false\npersistence false\n"
                   f"user {'root' if os.geteuid() == 0 else 'mosquitto'}\n")
    broker = r.Child("mosquitto", ["/usr/sbin/mosquitto", "-c", configuration], folder)
    end = time.monotonic() + PATIENCE_S
    while "running" not in broker.text() and broker.running() and time.monotonic() < end:
        time.sleep(0.05)
    return broker


def check_birth(checks, host, rig):
    birth = host.more("NBIRTH", 0)
    if not checks.check(birth is not None, "a birth comes", rig.logs()):
        return None
    metrics = named(birth)
    checks.equal(birth.seq, 0, "its sequence number is 0")
    checks.check("bdSeq" in metrics and metrics["bdSeq"].datatype == INT64, "it names its session, bdSeq")
    checks.check("Node Control/Rebirth" in metrics and value_of(metrics["Node Control/Rebirth"]) is False, "it offers a rebirth")
    others = [m for m in birth.metrics if m.HasField("alias")]
    checks.equal(len({m.alias for m in others}), len(birth.metrics) - 2, "every other metric has an alias of its own")
    checks.equal(len(metrics), len(birth.metrics), "no name stands twice")
    wrong = [m.name for m in birth.metrics if m.datatype not in VALUES or (not m.is_null and not m.HasField(VALUES[m.datatype]))]
    checks.equal(wrong, [], "values are of the types they are said to be")
    checks.equal(value_of(metrics["Campaign/Name"]), "fleet", "the campaign's name is published")
    checks.check(value_of(metrics["Coefficients/D_Fx/Value"]) is None, "what is not known is null")
    unit = dict(zip(metrics["Shaker/Command"].properties.keys, metrics["Shaker/Command"].properties.values))
    checks.equal(unit["engUnit"].string_value, "g", "units come along")
    checks.check(abs(birth.timestamp - time.time() * 1000) < 60_000, "times are milliseconds of UTC", str(birth.timestamp))
    checks.check(not any(retain for _, _, retain, _ in host.heard), "nothing is retained")
    return birth


def check_data(checks, host, rig, birth):
    names = {m.alias: m for m in birth.metrics if m.HasField("alias")}
    start = len(host.kind("NDATA"))
    if not checks.check(host.more("NDATA", start + 4) is not None, "data come", rig.logs()):
        return
    # From the newest birth on: each next number, by alias, as born.
    last = max(i for i, (topic, *_) in enumerate(host.heard) if "/NBIRTH/" in topic)
    data = [p for topic, p, _, _ in host.heard[last:] if "/NDATA/" in topic]
    checks.equal([p.seq for p in data], [(1 + i) % 256 for i in range(len(data))], "sequence numbers follow each other")
    strange = [m.alias for p in data for m in p.metrics if m.alias not in names or m.datatype != names[m.alias].datatype]
    checks.equal(strange, [], "data name the birth's aliases, with its types")
    checks.check(all(not m.name for p in data for m in p.metrics), "and not the names again")
    checks.check(rig.tool("arm", "--by", "fleet test").returncode == 0 and rig.tool("start", "--by", "fleet test").returncode == 0,
                 "a campaign starts", rig.logs())
    state = next(m.alias for m in birth.metrics if m.name == "Campaign/State")
    checks.check(host.until(lambda: any(m.alias == state and m.string_value == "recording"
                                        for p in host.kind("NDATA")[-20:] for m in p.metrics)),
                 "its state is reported when it changes", rig.logs())
    rig.order("speed 2")   # so fast that a stop is measured as it is also where the machine is busy
    gone = rig.tool("abort", "--by", "fleet test")
    checks.check(gone.returncode == 0, "it is aborted", gone.stderr)
    rig.wait_for_state(("aborted", "idle", "tripped"), 30)
    rig.order("speed 50")


def check_commands(checks, host, rig, birth):
    births = len(host.kind("NBIRTH"))
    host.command(b"\xff\xff\xff no payload")
    other = Payload()
    other.metrics.add(name="Campaign/State", datatype=STRING).string_value = "recording"
    host.command(other.SerializeToString())
    host.ask_for_birth()
    again = host.more("NBIRTH", births)
    checks.check(again is not None, "a rebirth is answered", rig.logs())
    if again is not None:
        checks.equal((again.seq, value_of(named(again)["bdSeq"])), (0, value_of(named(birth)["bdSeq"])),
                     "with number 0, in the same session")
        checks.equal(sorted(named(again)), sorted(named(birth)), "and the same metrics")
    host.until(lambda: len(host.kind("NBIRTH")) > births + 1, 1)
    checks.equal(len(host.kind("NBIRTH")), births + 1, "noise and other commands are not")
    checks.check(rig.status()["campaign"]["state"] in ("aborted", "idle"), "and nothing else can be commanded over the broker",
                 r.state_of(rig.status()))


def check_deaths(checks, host, rig):
    deaths, births = len(host.kind("NDEATH")), len(host.kind("NBIRTH"))
    session = value_of(named(host.kind("NBIRTH")[-1])["bdSeq"])
    rig.daemon.end(signal.SIGKILL)
    death = host.more("NDEATH", deaths)
    checks.check(death is not None and value_of(named(death)["bdSeq"]) == session and not death.HasField("seq"),
                 "a daemon that is killed has a death, of its session", str(death))
    rig.start_daemon()
    birth = host.more("NBIRTH", births)
    checks.check(birth is not None, "a restarted one has a birth", rig.logs())
    rig.wait_for(r.measuring, PATIENCE_S)
    checks.equal(rig.daemon.end(), 0, "it ends in order")
    death = host.more("NDEATH", deaths + 1)
    checks.check(death is not None and value_of(named(death)["bdSeq"]) == value_of(named(birth)["bdSeq"]),
                 "one that ends has a death too", str(death))


def check_broker_lost(checks, host, rig, broker, again):
    """`again` starts the broker."""
    births, n = len(host.kind("NBIRTH")), r.number
    rig.start_daemon()
    checks.check(host.more("NBIRTH", births) is not None, "another start, another birth", rig.logs())
    before = rig.wait_for(lambda s: s["mqtt"]["connected"] and n(s["mqtt"]["messages"]) > 1, PATIENCE_S)
    session = value_of(named(host.kind("NBIRTH")[-1])["bdSeq"])
    broker.process.send_signal(signal.SIGSTOP)
    frozen = rig.wait_for(lambda s: n(s["assembler"]["samples"]) > n(before["assembler"]["samples"]) + 400, PATIENCE_S)
    checks.check(n(frozen["assembler"]["samples"]) > n(before["assembler"]["samples"]) + 400 and n(frozen["estimator_ring"]["dropped"]) == 0,
                 "a broker that hangs holds nothing up", str(frozen["mqtt"]))
    broker.process.send_signal(signal.SIGCONT)
    broker.end()
    lost = rig.wait_for(lambda s: not s["mqtt"]["connected"], PATIENCE_S)
    checks.check(not lost["mqtt"]["connected"] and lost["mqtt"]["note"], "a lost broker is reported, with the cause", str(lost["mqtt"]))
    checks.check("DOWN" in rig.tool("status").stdout, "and shown by `vibrig status`")
    metrics = live_page.get(rig.page_address(), "/metrics")[2]
    checks.check("\nvibrig_mqtt_up 0\n" in metrics, "and by the metrics", metrics[-1500:])
    later = rig.wait_for(lambda s: n(s["assembler"]["samples"]) > n(lost["assembler"]["samples"]) + 400, PATIENCE_S)
    checks.check(n(later["assembler"]["samples"]) > n(lost["assembler"]["samples"]) + 400, "measuring goes on")
    broker = again()
    back = rig.wait_for(lambda s: s["mqtt"]["connected"], PATIENCE_S)
    checks.check(back["mqtt"]["connected"] and n(back["mqtt"]["connections"]) == 2, "the daemon finds it again by itself", str(back["mqtt"]))
    checks.check(host.subscribed.wait(PATIENCE_S), "so does the host")
    births = len(host.kind("NBIRTH"))
    host.ask_for_birth()
    birth = host.more("NBIRTH", births)
    # Attempts that failed had sessions too.
    checks.check(birth is not None and value_of(named(birth)["bdSeq"]) > session, "with a later session", str(birth and named(birth)["bdSeq"]))
    events = rig.tool("events").stdout
    checks.check(events.count("no broker at") >= 1 and events.count(": connected") == 2, "both are in the events", events[-2000:])
    return broker


def check_refusals(checks, rig, broker, folder, settings, campaign):
    other = os.path.join(folder, "other")
    subprocess.run([rig.program("vibrig"), "pki", "init", "--folder", other, "--operator", "eve"], check=True, capture_output=True)
    checks.equal(rig.daemon.end(), 0, "it ends in order")
    broker.process.send_signal(signal.SIGSTOP)
    rig.start_daemon()
    rig.wait_for(r.measuring, PATIENCE_S)
    checks.equal(rig.daemon.end(), 0, "also in the middle of connecting to a broker that hangs")
    broker.process.send_signal(signal.SIGCONT)
    strangers = {"certificate": os.path.join(other, "eve.crt"), "key": os.path.join(other, "eve.key")}
    for what, changed in (("a broker of another authority is not believed", {"ca": os.path.join(other, "authority.crt")}),
                          ("without a certificate the broker lets nobody in", {"certificate": "", "key": ""}),
                          ("nor with a stranger's", strangers),
                          ("a broker whose name nobody knows", {"host": "no-broker.invalid"})):
        rig.configure(campaign, mqtt={**settings, **changed})
        rig.start_daemon()
        found = rig.wait_for(lambda s: s["mqtt"]["note"], PATIENCE_S)
        checks.check(found is not None and not found["mqtt"]["connected"] and found["mqtt"]["note"] and not int(found["mqtt"]["births"]),
                     f"{what}: {found['mqtt']['note'] if found else ''}", rig.logs())
        rig.daemon.end()
    for changed, expected in (({"host": "broker.lab", "tls": False}, "mqtt.tls: found false with the broker at broker.lab"),
                              ({"key": ""}, "mqtt.certificate: found one of mqtt.certificate and mqtt.key"),
                              ({"node": "a/b"}, "mqtt.node: found"), ({"period_s": 0}, "mqtt.period_s: found"),
                              ({"nod": "x"}, "mqtt.nod")):
        rig.configure(campaign, mqtt={**settings, **changed})
        run = subprocess.run([rig.program("vibrigd"), "--config", rig.configuration, "--check"], capture_output=True, text=True, timeout=30)
        checks.check(run.returncode == 2 and expected in run.stderr, f"refused: {changed}", run.stderr)
    rig.configure(campaign, mqtt={**settings, "ca": os.path.join(folder, "nothing.crt")})
    run = subprocess.run([rig.program("vibrigd"), "--config", rig.configuration], capture_output=True, text=True, timeout=30)
    checks.check(run.returncode == 2 and "mqtt.ca: found" in run.stderr, "a file that is not there is named", run.stderr)


def main():
    programs = r.programs_from_command_line(__doc__)
    checks = r.Checks()
    with tempfile.TemporaryDirectory(prefix="vibrig-mqtt-") as folder:
        rig = r.Rig(programs, "seqpacket", "rig", folder, poll_s=0.1)
        pki, port = os.path.join(folder, "pki"), live_page.free_port()
        subprocess.run([rig.program("vibrig"), "pki", "init", "--folder", pki, "--host", "127.0.0.1", "--operator", "rig",
                        "--viewer", "wall"], check=True, capture_output=True)
        broker = start_broker(folder, port, pki)
        host = None
        try:
            host = Host(port, pki)
            checks.check(host.subscribed.wait(PATIENCE_S), "mosquitto takes a host over TLS", broker.text())
            rig.start_plant("--speed", "50", "--warm-up", "1")
            campaign = {"name": "fleet", "identify": "what-it-can", "dwell_s": 20.0}
            settings = {"host": "127.0.0.1", "port": port, "ca": os.path.join(pki, "authority.crt"), "group": GROUP, "node": NODE,
                        "certificate": os.path.join(pki, "rig.crt"), "key": os.path.join(pki, "rig.key"), "period_s": 0.1,
                        "backoff_max_s": 1.0}
            rig.configure(campaign, mqtt=settings, server={"page": "127.0.0.1:0"})
            rig.start_daemon()
            rig.wait_for(r.measuring, PATIENCE_S)
            birth = check_birth(checks, host, rig)
            if birth is not None:
                check_data(checks, host, rig, birth)
                check_commands(checks, host, rig, birth)
                check_deaths(checks, host, rig)
                broker = check_broker_lost(checks, host, rig, broker, lambda: start_broker(folder, port, pki))
                check_refusals(checks, rig, broker, folder, settings, campaign)
        finally:
            if host is not None:
                host.client.loop_stop()
            rig.stop()
            broker.end(signal.SIGKILL)
    return checks.end()


if __name__ == "__main__":
    sys.exit(main())
