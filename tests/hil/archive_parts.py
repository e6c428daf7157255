"""What tests of an archive have in common: the archive by its commands, campaigns made of another, a PostgreSQL of one's own,
TLS as somebody else speaks it."""
import glob
import http.client
import json
import os
import shutil
import signal
import ssl
import subprocess
import time

import h5py
import numpy
import recording_faults
import rig as r

DAY_NS = 86_400 * 10**9
POSTGRES = sorted(glob.glob("/usr/lib/postgresql/*/bin"))[-1:]


class SickArchive(recording_faults.SickDisk):
    """A folder that is as large as one likes."""

    def __init__(self, folder):
        self.folder, self.control = os.path.join(folder, "disk"), os.path.join(folder, "control")
        self.library = os.path.join(folder, "sick_disk.so")
        os.makedirs(self.folder)
        self.set("-")
        subprocess.run(["c++", "-shared", "-fPIC", "-O1", "-o", self.library,
                        os.path.join(os.path.dirname(os.path.abspath(__file__)), "sick_disk.cpp")], check=True)


class Archive:
    def __init__(self, programs, folder, index=""):
        self.program, self.folder, self.index = os.path.join(programs, "vibrig"), folder, index
        os.makedirs(folder, exist_ok=True)

    def where(self):
        return ["--archive", self.folder] + (["--index", self.index] if self.index else [])

    def run(self, *words, environment=None, timeout=60):
        return subprocess.run([self.program, *words, *self.where()], stdin=subprocess.DEVNULL, capture_output=True, text=True,
                              timeout=timeout, env={**os.environ, **(environment or {})})

    def as_nobody(self, *words, where=True):
        """As somebody who may only read, in the archive's folder."""
        return subprocess.run(["setpriv", "--reuid=65534", "--regid=65534", "--clear-groups", self.program, *words,
                               *(self.where() if where else [])], stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=60,
                              cwd=self.folder)

    def incoming(self):
        """Folders below .incoming: what was begun and not ended."""
        return [path for path in glob.glob(os.path.join(self.folder, ".incoming", "*")) if os.path.isdir(path)]

    def add(self, folder, rig, **more):
        return self.run("archive", "add", folder, "--rig", rig, **more)

    def campaigns(self, *words):
        run = self.run("list", "--json", *words)
        return json.loads(run.stdout)["campaigns"] if run.returncode == 0 else None

    def verify(self, *words):
        run = self.run("archive", "verify", "--json", *words)
        return json.loads(run.stdout or "{}").get("findings", [{"what": "error", "text": run.stderr}])

    def half(self):
        """Folders that look like a campaign and are not whole, by their own manifests."""
        wrong = []
        for folder in glob.glob(os.path.join(self.folder, "*", "*")):
            try:
                with open(os.path.join(folder, "archive.json"), encoding="utf-8") as file:
                    wanted = {f["name"]: f["bytes"] for f in json.load(file)["files"]}
            except (OSError, ValueError) as error:
                wrong.append(f"{folder}: {error}")
                continue
            there = {name: os.path.getsize(os.path.join(folder, name)) for name in os.listdir(folder) if name != "archive.json"}
            if there != wanted:
                wrong.append(f"{folder}: {there}, {wanted}")
        return wrong


def asked_by_nobody(checks, rec, campaigns, serial, when):
    run = rec.as_nobody("list", "--json")
    found = json.loads(run.stdout or '{"campaigns": []}')["campaigns"]
    checks.check(run.returncode == 0 and sorted(c["campaign"] for c in found) == sorted(campaigns) and all(c["hash"] for c in found),
                 f"who may only read lists a rig's campaigns with their results, {when}", run.stdout[-500:] + run.stderr)
    run = rec.as_nobody("trend", serial, "--simulated")
    checks.check(run.returncode == 0, f"and the unit's trend, {when}", run.stderr)
    run = rec.as_nobody("archive", "verify", "--json")
    checks.check(run.returncode in (0, 1) and json.loads(run.stdout or "{}").get("campaigns") == len(campaigns), f"and verifies, {when}",
                 run.stderr)
    run = rec.as_nobody("replay", campaigns[0], where=False)
    checks.check("missing raw-0009.log.zst" in run.stderr and run.returncode in (0, 1), f"and replays by name what is not whole, {when}",
                 run.stderr)


def clone(campaign, to, days, serial=None, shift=None, scatter=None):
    """The same recording as of another day: of another unit, with the first coefficient elsewhere, or all of them scattered by
    `scatter(u)`."""
    shutil.copytree(campaign, to, ignore=shutil.ignore_patterns("raw-*"))
    with h5py.File(os.path.join(to, "campaign.h5"), "r+") as file:
        for name in ("started_utc_ns", "ended_utc_ns"):
            file.attrs[name] += days * DAY_NS
        file.attrs["campaign"] = numpy.bytes_(os.path.basename(to))
        if serial:
            r.reconfigure(file, '"0017"', f'"{serial}"')
        if shift is not None:
            result = json.loads(file["result"][()])
            result["parameters"][0]["value"] += shift
            replace(file, "result", json.dumps(result))
        if scatter is not None:
            result = json.loads(file["result"][()])
            for of in result["parameters"]:
                of["value"] += scatter(of["u"])
            result["verdict"]["word"] = "valid"
            replace(file, "result", json.dumps(result))
    return to


def replace(file, name, text):
    del file[name]
    file[name] = numpy.bytes_(text.encode())   # of fixed length, as vibrigd writes it


def result_in(campaign):
    with h5py.File(os.path.join(campaign, "campaign.h5")) as file:
        return json.loads(file["result"][()])


def asked(port, pki, name, path, method="GET", version=None, authority="authority.crt"):
    """Over TLS, by Python's own; what came, or the name of what went wrong."""
    context = ssl.create_default_context(cafile=os.path.join(pki, authority))
    if version is not None:
        context.set_ciphers("ALL:@SECLEVEL=0")
        context.minimum_version = context.maximum_version = version
    if name:
        context.load_cert_chain(os.path.join(pki, name + ".crt"), os.path.join(pki, name + ".key"))
    try:
        connection = http.client.HTTPSConnection("127.0.0.1", port, context=context, timeout=20)
        connection.request(method, path, body=b"{}" if method == "POST" else None)
        answer = connection.getresponse()
        return answer.status, answer.read()
    except (OSError, http.client.HTTPException) as error:
        return type(error).__name__, b""


def without_role(pki):
    """A certificate of the same authority, for somebody whose role it does not say."""
    key, request, out = (os.path.join(pki, "guest" + end) for end in (".key", ".csr", ".crt"))
    subprocess.run(["openssl", "req", "-new", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:P-256", "-nodes", "-keyout", key,
                    "-out", request, "-subj", "/OU=guest/CN=guest"], check=True, capture_output=True)
    subprocess.run(["openssl", "x509", "-req", "-in", request, "-CA", os.path.join(pki, "authority.crt"), "-CAkey",
                    os.path.join(pki, "authority.key"), "-CAcreateserial", "-days", "2", "-out", out], check=True, capture_output=True)


class Postgres:
    """A server of its own in a folder, as an unprivileged user where this one is root."""

    def __init__(self, folder):
        self.folder, self.process = folder, None
        self.data, self.bin = os.path.join(folder, "data"), POSTGRES[0]
        os.makedirs(folder)
        self.user = ["setpriv", "--reuid=65534", "--regid=65534", "--clear-groups"] if os.getuid() == 0 else []
        if self.user:
            os.chown(folder, 65534, 65534)
        self.run("initdb", "-D", self.data, "-U", "vibrig", "--auth=trust", "--no-sync", "--locale=C", "-E", "UTF8")
        self.url = f"postgresql://vibrig@/postgres?host={folder}"

    def run(self, program, *words):
        subprocess.run([*self.user, os.path.join(self.bin, program), *words], check=True, capture_output=True, timeout=60, cwd=self.folder)

    def start(self):
        self.process = subprocess.Popen([*self.user, os.path.join(self.bin, "postgres"), "-D", self.data, "-k", self.folder, "-c",
                                         "listen_addresses=", "-c", "fsync=off"], stdin=subprocess.DEVNULL,
                                        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, cwd=self.folder,
                                        preexec_fn=r.die_with_parent)
        end = time.monotonic() + 20
        while time.monotonic() < end:
            if subprocess.run([os.path.join(self.bin, "pg_isready"), "-q", "-h", self.folder]).returncode == 0:
                return
            time.sleep(0.1)
        raise RuntimeError("postgres does not start")

    def kill(self, number=signal.SIGKILL):
        self.process.send_signal(number)
        self.process.wait()
        time.sleep(0.3)   # its children see that they are alone
