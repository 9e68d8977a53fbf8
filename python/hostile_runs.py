#!/usr/bin/env python3
"""Runs gyrogen where it is interrupted, cannot write, or is told to write over its own input, and looks what is left.

    cargo build --release
    python python/hostile_runs.py --runs 3000 [--seed S] [--binary target/release/gyrogen]

Each run has a folder of its own with inputs and with results of an earlier run, a command, and one hostility: a signal at a
random moment (INT, TERM, KILL), a file system that is full after some KiB (a tmpfs; as root), one that is read-only (a
bind mount as root, else a folder without the right to write), a full standard output, results in the folder of the inputs,
a damaged input. Afterwards:

- every input is byte for byte what it was;
- the exit status is 0, 1, 2 or the signal's; never a panic's 101 or another signal's;
- with status 0 all results are there; with 2 the results are those of before, or none; a result that is there at all is a
  whole one: of the earlier run, or what an undisturbed run writes;
- after INT or TERM no temporary file is left, after KILL such as the next run removes;
- no run takes more memory than --most-mib (default 64).

Exit status 1: something of this does not hold; the folder is kept and named.
"""

import argparse
import collections
import contextlib
import hashlib
import math
import os
import pathlib
import random
import resource
import shutil
import signal
import struct
import subprocess
import sys
import tempfile
import time

RECORD = "\n".join(
    ["time_s,rate_out_dps,die_degc"]
    + [
        f"{10 * k},{0.5 - 0.02 * (20 + 0.3 * (k if k < 90 else 180 - k)) + 0.01 * math.sin(7.7 * k * k):.5f},"
        f"{20 + 0.3 * (k if k < 90 else 180 - k):.2f}"
        for k in range(180)
    ]
    + [""]
)


def codes(rows):
    turns = [2 * math.pi * k / 128 for k in range(rows)]
    return [(round(9000 * math.sin(t - math.pi / 2)), round(4000 * math.cos(t) + 20 * math.sin(91.3 * t))) for t in turns]


def inputs(folder):
    """Writes all inputs that a command may want."""
    rows = codes(2048)
    keys = "fs_hz = 224000.0\nftw = 33554432\nadc_bits = 16\n"
    comments = "".join(f"# {line}\n" for line in keys.splitlines())
    table = "".join(f"{d},{s}\n" for d, s in rows)
    volts = "".join(f"{k / 224000.0:.9f},{d * 1e-4:.5f},{s * 1e-4:.5f}\n" for k, (d, s) in enumerate(rows))
    header = "{'descr': '<i2', 'fortran_order': False, 'shape': (%d, 2), }\n" % len(rows)
    raw = b"".join(struct.pack("<hh", d, s) for d, s in rows)
    files = {
        "design.toml": b'name = "gyro"\n',
        "record.csv": RECORD.encode(),
        "c.csv": (comments + "drive_code,sense_code\n" + table).encode(),
        "scope.csv": ("Model,X\n\nTIME,CH1,CH2\n" + volts).encode(),
        "scope.toml": (keys + 'drive_column = "CH1"\nsense_column = "CH2"\nvolts_per_code = 1e-4\n').encode(),
        "n.npy": b"\x93NUMPY\x01\x00" + struct.pack("<H", len(header)) + header.encode() + raw,
        "n.toml": keys.encode(),
        "s.raw": raw,
        "s.toml": (keys + 'item = "int16"\n').encode(),
    }
    for name, content in files.items():
        (folder / name).write_bytes(content)
    return files


APPROX = "--function=-x^2 --domain=-1,1 --input Q1.9 --output Q2.10 --degree 2 --coefficients Q2.14".split()
BUNDLE = ["closure.json", "report.html"]
# The command, its input, what it writes below OUT; of a bundle one name tells.
COMMANDS = {
    "approx": (["approx", *APPROX, "--out", "OUT"], None, ["approx.json"]),
    "emit": (["emit", "design.toml", "--lang", "c", "--out", "OUT"], "design.toml", ["manifest.json"]),
    "emit rust": (["emit", "--lang", "rust", "--out", "OUT"], None, ["manifest.json"]),
    "check": (["check", "design.toml", "--out", "OUT"], "design.toml", ["check.json"]),
    "init": (["init", "OUT/new.toml"], None, ["new.toml"]),
    "replay": (["replay", "design.toml", "--capture", "c.csv", "--out", "OUT/rows.csv"], "c.csv", ["rows.csv"]),
    "replay npy": (["replay", "--capture", "n.npy", "--out", "OUT/rows.npy"], "n.npy", ["rows.npy"]),
    "replay scope": (["replay", "--capture", "scope.csv", "--out", "OUT/rows.csv"], "scope.csv", ["rows.csv"]),
    "replay raw": (["replay", "--capture", "s.raw", "--out", "OUT/rows.csv"], "s.raw", ["rows.csv"]),
    "close": (["close", "--record", "record.csv", "--out", "OUT"], "record.csv", BUNDLE),
    "close capture": (["close", "--capture", "c.csv", "--out", "OUT"], "c.csv", BUNDLE),
    "simulate": (["simulate", "--duration", "0.02", "--out", "OUT"], None, ["simulate.json"]),
}
# Commands whose results stand in files of their own name: an earlier one may stay, or be refused.
ALONE = {"init", "replay", "replay npy", "replay scope", "replay raw"}
HOSTILITIES = ["INT", "TERM", "KILL", "full", "read-only", "stdout", "same folder", "damaged", "none"]
STALE = b"earlier\n"


def digests(folder, but=()):
    out = {}
    for path in sorted(folder.rglob("*")):
        name = str(path.relative_to(folder))
        if path.is_file() and name not in but and not name.endswith("timing.json"):
            out[name] = hashlib.sha256(path.read_bytes()).hexdigest()
    return out


def started(binary, arguments, folder, environment, stdout):
    process = subprocess.Popen(
        [binary, *arguments], cwd=folder, env=environment, stdout=stdout, stderr=subprocess.PIPE, start_new_session=True
    )
    return process


def ended(process):
    """Status, what it said on stderr, the most memory that it had, MiB."""
    said = process.stderr.read()
    process.stderr.close()
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    return process.returncode, said.decode(errors="replace"), usage.ru_maxrss / 1024


class Bench:
    def __init__(self, binary, top, seed):
        self.binary, self.top, self.random = binary, top, random.Random(seed)
        self.root = os.geteuid() == 0
        self.references, self.seconds = {}, {}
        self.counts = collections.Counter()
        self.most_mib = 0.0
        self.stderr = ""

    def reference(self, name):
        """What an undisturbed run writes, and how long it takes, s."""
        if name not in self.references:
            folder = pathlib.Path(tempfile.mkdtemp(dir=self.top))
            inputs(folder)
            (folder / "out").mkdir()
            arguments = [a.replace("OUT", "out") for a in COMMANDS[name][0]]
            start = time.monotonic()
            status, said, mib = ended(started(self.binary, arguments, folder, os.environ, subprocess.DEVNULL))
            self.seconds[name] = time.monotonic() - start
            if status != 0:
                sys.exit(f"{name}: an undisturbed run ends with {status}: {said}")
            self.references[name] = digests(folder / "out")
            self.most_mib = max(self.most_mib, mib)
            shutil.rmtree(folder)
        return self.references[name]

    @contextlib.contextmanager
    def mounted(self, folder, hostility):
        """The folder of the results on a file system that is full or read-only."""
        if hostility == "full" and self.root:
            kib = self.random.choice([4, 8, 12, 16, 32, 64, 128, 256])
            subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={kib}k", "tmpfs", folder], check=True)
            (folder / "stale").write_bytes(STALE)
            try:
                yield
            finally:
                kept = self.top / "kept"
                shutil.rmtree(kept, ignore_errors=True)
                shutil.copytree(folder, kept)
                subprocess.run(["umount", folder], check=True)
                shutil.copytree(kept, folder, dirs_exist_ok=True)
        elif hostility == "read-only" and self.root:
            subprocess.run(["mount", "--bind", folder, folder], check=True)
            subprocess.run(["mount", "-o", "remount,bind,ro", folder], check=True)
            try:
                yield
            finally:
                subprocess.run(["umount", folder], check=True)
        elif hostility == "read-only":
            folder.chmod(0o555)
            try:
                yield
            finally:
                folder.chmod(0o755)
        else:
            yield

    def damaged(self, path):
        content = bytearray(path.read_bytes())
        for _ in range(self.random.randint(1, 4)):
            at = self.random.randrange(len(content))
            match self.random.randrange(4):
                case 0:
                    del content[max(at, 1) :]
                case 1:
                    del content[at : at + self.random.randint(1, 64)]
                case 2:
                    content[at] ^= 1 << self.random.randrange(8)
                case _:
                    content[at:at] = content[at : at + 200]
            content = content or bytearray(b"x")
        path.write_bytes(content)

    def run(self, name, hostility):
        """What is wrong, a list of sentences, and the folder."""
        arguments, own_input, files = COMMANDS[name]
        reference = self.reference(name)
        folder = pathlib.Path(tempfile.mkdtemp(dir=self.top))
        inputs(folder)
        temporary = folder / "tmp"
        temporary.mkdir()
        out = folder / "out"
        out.mkdir()
        (out / "stale").write_bytes(STALE)
        if hostility == "damaged" and own_input:
            self.damaged(folder / own_input)
        before = digests(folder, {"out"})
        where = "." if hostility == "same folder" else "out"
        if self.random.random() < 0.3 and hostility not in ("same folder", "full", "read-only"):
            where = "out/new/er" if name not in ALONE else "out"
        stale_first = self.random.random() < 0.3 and name != "init" and where == "out"
        if stale_first:
            (out / files[0]).write_bytes(STALE)
        arguments = [a.replace("OUT", where) for a in arguments]
        results = folder / where
        existed = set(digests(results)) if results.exists() else set()
        before = digests(folder)
        environment = {**os.environ, "TMPDIR": str(temporary)}
        full = hostility == "stdout"
        with self.mounted(out, hostility):
            with open("/dev/full", "wb") as sink:
                process = started(self.binary, arguments, folder, environment, sink if full else subprocess.DEVNULL)
                if hostility in ("INT", "TERM", "KILL"):
                    time.sleep(self.random.uniform(0, 1.1 * self.seconds[name]))
                    with contextlib.suppress(ProcessLookupError):
                        os.kill(process.pid, getattr(signal, "SIG" + hostility))
                status, self.stderr, mib = ended(process)
        self.most_mib = max(self.most_mib, mib)
        self.counts[hostility, status] += 1
        wrong = []
        allowed = {0, 1, 2}
        if hostility in ("INT", "TERM", "KILL"):
            allowed.add(-getattr(signal, "SIG" + hostility))
        if status not in allowed or "panicked" in self.stderr:
            wrong.append(f"status {status}")
        if status == 2 and not self.stderr.strip():
            wrong.append("status 2 without a word")
        # A file of the user's own in a result's place is not written over, nor one that is none of a bundle in a bundle's.
        refused = ("no result of an earlier", "files here were edited")
        guarded = (stale_first or hostility == "same folder") and any(text in self.stderr for text in refused)
        if hostility in ("none", "same folder") and status == 2 and not guarded:
            wrong.append("status 2 of a run that nothing disturbs")
        if hostility == "read-only" and status != 2:
            wrong.append(f"status {status} where nothing can be written")
        after = digests(folder)
        left = [n for n in after if ".tmp" in n or n.startswith("tmp/")]
        for input_name, digest in before.items():
            is_result = input_name in {str((pathlib.Path(where) / f)) for f in files}
            if after.get(input_name) != digest and not is_result:
                wrong.append(f"{input_name} is not what it was")
        stale = hashlib.sha256(STALE).hexdigest()
        if results.exists():
            fresh = {n: d for n, d in digests(results).items() if n in reference}
            fresh = {n: d for n, d in fresh.items() if before.get(str(pathlib.Path(where) / n)) != d or d == stale}
            for n, digest in fresh.items():
                whole = digest == reference[n] or (n in existed and digest == stale)
                # What a damaged input or another folder's name makes is another whole file.
                if not whole and hostility != "damaged" and n not in ("report.html",) and not n.endswith(".json"):
                    wrong.append(f"{n} is neither the earlier result nor a whole new one")
            new = [n for n in fresh if fresh[n] != stale]
            if status == 2 and hostility != "stdout" and new and name != "init" and len(new) < len(reference):
                wrong.append(f"status 2, and {len(new)} of {len(reference)} results are there")
            if status == 0 and any(f not in fresh or fresh[f] == stale for f in files):
                wrong.append("status 0, and a result is missing")
        elif status == 0:
            wrong.append("status 0, and no results")
        if hostility != "KILL" and left:
            wrong.append(f"left behind: {left}")
        if hostility == "KILL" and left:
            again, said, _ = ended(started(self.binary, arguments, folder, environment, subprocess.DEVNULL))
            still = [n for n in digests(folder) if ".tmp" in n or n.startswith("tmp/")]
            if again not in (0, 1, 2) or still:
                wrong.append(f"the next run ({again}) leaves {still}")
            self.counts["left by KILL, swept", 0] += not still
        return wrong, folder


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--binary", default="target/release/gyrogen")
    parser.add_argument("--runs", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", choices=HOSTILITIES)
    parser.add_argument("--most-mib", type=float, default=64.0)
    options = parser.parse_args()
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    top = pathlib.Path(tempfile.mkdtemp(prefix="hostile-"))
    bench = Bench(os.path.abspath(options.binary), top, options.seed)
    failures = 0
    for k in range(options.runs):
        name = bench.random.choice(list(COMMANDS))
        hostility = options.only or bench.random.choice(HOSTILITIES)
        if hostility == "full" and not bench.root:
            continue
        wrong, folder = bench.run(name, hostility)
        if wrong:
            failures += 1
            print(f"run {k}: {name}, {hostility}: {'; '.join(wrong)}: {folder}\n    {bench.stderr.strip()[:300]}", flush=True)
        else:
            shutil.rmtree(folder)
    for (hostility, status), count in sorted(bench.counts.items(), key=str):
        print(f"{hostility}: status {status}: {count}")
    print(f"{options.runs} runs, {failures} wrong; the most memory of a run: {bench.most_mib:.1f} MiB")
    if bench.most_mib > options.most_mib:
        print(f"more than {options.most_mib} MiB")
        failures += 1
    if failures == 0:
        shutil.rmtree(top, ignore_errors=True)
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
