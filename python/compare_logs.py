#!/usr/bin/env python3
"""Compares gyrogen's reading of autopilots' logs with that of pyulog and pymavlink.

    cargo build --release --example record_rows
    pip install pyulog pymavlink
    python python/compare_logs.py FOLDER [--reader target/release/examples/record_rows]

Every .ulg and .bin below FOLDER is read by both, gyro by gyro and axis by axis. The rows are means over one second,
counted from power-on, as the manual says; they are made here from the other reader's samples alone. A row of gyrogen's has
to be within 1e-9 of that (relative to the largest value of its column); a row that only the other reader has is to be told:
an end of a stretch, or a warning with its count. Exit status 1: a difference.
"""

import argparse
import contextlib
import io
import math
import pathlib
import re
import subprocess
import sys

DEGREES = 180.0 / math.pi
GRAVITY = 9.80665
TOLERANCE = 1e-9
AXES = "xyz"


def rows_of(times_us, values):
    """Means of the finite values over each second: {second: (mean, count)}."""
    sums = {}
    for time, value in zip(times_us, values):
        if not math.isfinite(value):
            continue
        total = sums.setdefault(int(time) // 1_000_000, [0.0, 0])
        total[0] += value
        total[1] += 1
    return {row: (total / count, count) for row, (total, count) in sums.items()}


def ulog_sources(path, axis):
    """{(column, source, instance): (times, values)} of a PX4 log, and the numbers of its gyros."""
    from pyulog import ULog

    with contextlib.redirect_stdout(io.StringIO()):
        log = ULog(str(path))
    letter, found, gyros = AXES[axis], {}, set()
    for topic in log.data_list:
        data, name, instance = topic.data, topic.name, topic.multi_id
        times = data["timestamp"]

        def put(column, source, values):
            found[column, source, instance] = (times, values)
            if column == "rate_out_dps" and name != "sensor_combined":
                gyros.add(instance)

        def field(column, source, factor):
            if source in data:
                put(column, f"{name}.{source}", [float(v) * factor for v in data[source]])

        if name == "sensor_gyro":
            field("rate_out_dps", letter, DEGREES)
            field("die_degc", "temperature", 1.0)
        elif name == "vehicle_imu_status":
            field("die_degc", "temperature_gyro", 1.0)
        elif name == "sensor_accel":
            field("accel_g", letter, 1.0 / GRAVITY)
        elif name == "sensor_combined":
            field("rate_out_dps", f"gyro_rad[{axis}]", DEGREES)
            field("accel_g", f"accelerometer_m_s2[{axis}]", 1.0 / GRAVITY)
        elif name == "battery_status" and instance == 0:
            field("supply_v", "voltage_v", 1.0)
        elif name == "system_power" and instance == 0:
            field("supply_v", "voltage5v_v", 1.0)
        elif name == "vehicle_imu":
            for column, what, factor in [
                ("rate_out_dps", "delta_angle", DEGREES * 1e6),
                ("accel_g", "delta_velocity", 1e6 / GRAVITY),
            ]:
                source, over = f"{what}[{axis}]", f"{what}_dt"
                if source in data and over in data:
                    pairs = zip(data[source], data[over])
                    put(column, f"{name}.{source}", [float(a) * factor / float(t) if t else math.nan for a, t in pairs])
        elif name == "sensor_gyro_fifo":
            all_times, values = [], []
            for k, time in enumerate(times):
                count, dt = int(data["samples"][k]), float(data["dt"][k])
                for i in range(count):
                    counts = float(data[f"{letter}[{i}]"][k]) * float(data["scale"][k])
                    values.append(counts * DEGREES)
                    all_times.append(int(time) - int(dt * (count - 1 - i)))
            found["rate_out_dps", f"{name}.{letter}", instance] = (all_times, values)
            gyros.add(instance)
    return found, gyros or {0}


def dataflash_sources(path, axis):
    """The same of an ArduPilot log."""
    from pymavlink import DFReader

    letter, found, gyros = AXES[axis].upper(), {}, set()
    with contextlib.redirect_stderr(io.StringIO()), contextlib.redirect_stdout(io.StringIO()):
        log = DFReader.DFReader_binary(str(path), zero_time_base=True)
    while True:
        message = log.recv_match(type=["IMU", "IMU2", "IMU3", "POWR", "BAT"])
        if message is None:
            return found, gyros or {0}
        kind = message.get_type()
        fields = message.to_dict()
        time = fields.get("TimeUS", fields.get("TimeMS", 0) * 1000)
        instance = fields.get("I", fields.get("Inst", fields.get("Instance", {"IMU2": 1, "IMU3": 2}.get(kind, 0))))

        def put(column, source, value):
            times, values = found.setdefault((column, source, instance), ([], []))
            times.append(time)
            values.append(value)

        if kind.startswith("IMU"):
            gyros.add(instance)
            put("rate_out_dps", f"IMU.Gyr{letter}", fields[f"Gyr{letter}"] * DEGREES)
            put("accel_g", f"IMU.Acc{letter}", fields[f"Acc{letter}"] / GRAVITY)
            heat = fields.get("T", fields.get("Temp"))
            if heat is not None:
                put("die_degc", "IMU.T", heat)
        elif kind == "POWR" and instance == 0 and "Vcc" in fields:
            vcc = fields["Vcc"]
            put("supply_v", "POWR.Vcc", vcc * 1e-3 if isinstance(vcc, int) else vcc)
        elif kind == "BAT" and instance == 0 and "Volt" in fields:
            put("supply_v", "BAT.Volt", fields["Volt"])


def read_rows(reader, path, instance, axis):
    """gyrogen's rows {column: {second: value}}, the source of each column, its warnings; or the refusal."""
    command = [reader, str(path), str(instance), AXES[axis]]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        return None, None, done.stderr.strip().splitlines()[:1]
    lines = done.stdout.splitlines()
    warnings = [line[2:] for line in lines if line.startswith("# ")]
    header, *body = [line for line in lines if not line.startswith("# ")]
    names = header.split(",")
    columns = {name: {} for name in names}
    for line in body:
        cells = dict(zip(names, map(float, line.split(","))))
        second = math.floor(cells["time_since_power_on_s"] + 1e-12)
        for name, value in cells.items():
            columns[name][second] = value
    told = next(w for w in warnings if w.startswith("log_averaged"))
    sources = dict(re.findall(r"(\w+) from (\S+?)(?:,|$)", told.split(": ", 2)[-1]))
    return columns, sources, warnings


def compare(path, reader):
    """Lines of differences, and how many columns and rows were compared."""
    ulog = path.suffix.lower() == ".ulg"
    read = ulog_sources if ulog else dataflash_sources
    differences, series, rows = [], 0, 0
    for axis in range(3):
        sources, gyros = read(path, axis)
        for instance in sorted(gyros):
            columns, named, warnings = read_rows(reader, path, instance, axis)
            if columns is None:
                if axis == 0:
                    print(f"  gyro {instance}: refused: {warnings}")
                continue
            for column, source in named.items():
                candidates = [k for k in sources if k[:2] == (column, source)]
                own = [k for k in candidates if k[2] == instance] or candidates
                if column in ("die_degc", "accel_g"):
                    own = candidates  # Joined by device, so the instance may be another.
                best = None
                for key in own:
                    expected = rows_of(*sources[key])
                    largest = max((abs(v) for v, _ in expected.values()), default=1.0) or 1.0
                    off = [
                        abs(value - expected[row][0]) / largest if row in expected else math.inf
                        for row, value in columns[column].items()
                        if not math.isnan(value)
                    ]
                    worst = max(off, default=0.0)
                    best = min(best, (worst, key)) if best else (worst, key)
                series += 1
                rows += len(columns[column])
                changed = any(w.startswith("error_values") for w in warnings) and column in ("die_degc", "supply_v")
                if best is None or (best[0] > TOLERANCE and not changed):
                    differences.append(f"{path.name} gyro {instance} {AXES[axis]} {column} ({source}): {best}")
            expected = rows_of(*sources[next(k for k in sources if k[:2] == ("rate_out_dps", named["rate_out_dps"]))])
            seconds = sorted(columns["rate_out_dps"])
            missing = [r for r in expected if r not in columns["rate_out_dps"] and seconds[0] < r < seconds[-1]]
            told = [w for w in warnings if w.startswith(("rows_left_out", "record_split", "gyro_replaced", "wrong_times"))]
            if missing and not told:
                differences.append(f"{path.name} gyro {instance}: {len(missing)} rows are missing and not told")
    return differences, series, rows


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("--reader", default="target/release/examples/record_rows")
    arguments = parser.parse_args()
    logs = [p for p in sorted(arguments.folder.rglob("*")) if p.suffix.lower() in (".ulg", ".bin")]
    differences, series, rows = [], 0, 0
    for path in logs:
        print(path.relative_to(arguments.folder))
        try:
            found = compare(path, arguments.reader)
        except Exception as error:  # pylint: disable=broad-except
            print(f"  the other reader fails: {type(error).__name__}: {error}")
            continue
        differences += found[0]
        series += found[1]
        rows += found[2]
    for difference in differences:
        print("differs:", difference)
    print(f"{len(logs)} logs, {series} series of {rows} values in all, {len(differences)} differences")
    sys.exit(bool(differences))


if __name__ == "__main__":
    main()
