"""`figurine live` in time: latency, dropped and late frames, poses over VMC, hostile packets.

    scripts/run python3 scripts/experiments/live.py BUILD [OUTPUT] [--seconds 600]
        [--fuzz-runs 10000000] [--rates 30 60] [--vivid GUEST]

BUILD is a build folder with figurine, vmc_send and what they need; the build type is for the caller
to choose (RelWithDebInfo or Release, for figures that are quoted). Each run: vmc_send plays the
shipped walk as a performer at the rate of the frames, bundles over UDP on the loopback; figurine
draws the shipped person at 512x512 with two threads into a FIFO; `cat` drains it at full speed. All
of them on the first two CPUs that this process may use, once by themselves and once beside a
process that does nothing but count. Latency is from a datagram's arrival until the frame's last
byte was taken. The shipped motions go through motion -> VMC -> pose for the error in degrees, and
Clang's libFuzzer, which this script builds with the address sanitizer, runs the OSC parser from the
seeds in tests/fuzz/seeds/osc.

With --vivid the frames and errors of a virtual video device are rows too: GUEST is vivid_guest of
the preset aarch64, the kernel that of `scripts/setup vivid` (tests/ports/v4l2/vivid_test.py).

Writes OUTPUT (docs/results/live.json): "summary", "targets", and "rows", a run each. Shorter runs
(--seconds, --fuzz-runs) are for trying; the file says how long they were. A run that misses a
target is written like every other.
"""

import argparse
import json
import os
import pathlib
import re
import subprocess
import sys
import tempfile

import neighbours
import results

PERSON, BODY = "samples/packages/person.fgn", "samples/packages/body-128.fgn"
WALK, DANCE = "samples/packages/walk.fgn", "samples/packages/dance.fgn"
SIZE, THREADS = "512x512", 2
SEEDS = "tests/fuzz/seeds/osc"
FUZZED = ("tests/fuzz/osc_fuzz.cpp", "ports/vmc/osc.cpp", "ports/vmc/vmc_state.cpp",
          "ports/vmc/humanoid.cpp", "formats/src/pose.cpp", "formats/src/status.cpp",
          "formats/src/check.cpp")
# Of ten minutes: the issue asks for these.
TARGETS = {
    "dropped_frames_30hz": 0,
    "dropped_frames_60hz": 60,
    "latency_p99_ms": 33,
    "vmc_round_trip_deg": 0.5,
    "osc_fuzz_executions": 10_000_000,
}


def two_cpus():
    cpus = sorted(os.sched_getaffinity(0))[:2]
    os.sched_setaffinity(0, cpus)  # for every child too
    return cpus


def wait_for_port(process, errors):
    """The port on which figurine listens, as it says on standard error."""
    while process.poll() is None:
        found = re.search(r"listening on vmc://127\.0\.0\.1:(\d+)", errors.read_text())
        if found:
            return found.group(1)
        try:
            process.wait(0.05)
        except subprocess.TimeoutExpired:
            pass
    sys.exit(f"live.py: figurine ended: {errors.read_text()}")


def draw_live(tools, rate, seconds, fifo, summary, errors):
    """Sender, `figurine live` and a reader of its FIFO, until the seconds are over."""
    others = [subprocess.Popen(["cat", str(fifo)], stdout=subprocess.DEVNULL)]
    try:
        with open(errors, "w") as log:
            live = subprocess.Popen(
                [tools["figurine"], "live", PERSON, "--pose", "vmc://:0", "-o", str(fifo),
                 "--size", SIZE, "--threads", str(THREADS), "--fps", str(rate),
                 "--seconds", str(seconds), "--json", str(summary)], stderr=log)
        others.append(live)
        port = wait_for_port(live, errors)
        others.append(subprocess.Popen(
            [tools["vmc_send"], BODY, WALK, "--to", f"127.0.0.1:{port}", "--fps", str(rate)]))
        if live.wait() != 0:
            sys.exit(f"live.py: {errors.read_text()}")
    finally:
        for process in others:
            process.kill()
            process.wait()


def live_run(tools, rate, seconds, neighbour, folder):
    """One run; its row."""
    fifo, summary, errors = folder / "fifo", folder / "live.json", folder / "errors"
    fifo.unlink(missing_ok=True)
    os.mkfifo(fifo)
    with neighbours.busy(1 if neighbour else 0):
        draw_live(tools, rate, seconds, fifo, summary, errors)
    said = json.loads(summary.read_text())
    return {
        "rate_hz": rate,
        "neighbour": "counts on one core" if neighbour else "none",
        "seconds": said["seconds"],
        "frames": said["frames"],
        "dropped_frames": said["dropped_frames"],
        "late_frames": said["late_frames"],
        "latency_ms": said["latency_ms"],
        "rendering_ms": said["rendering_ms"],
        "poses": said["poses"],
        "machine": said["machine"],
    }


def round_trips(tools):
    rows = []
    for motion in (WALK, DANCE):
        said = subprocess.run([tools["vmc_send"], BODY, motion, "--round-trip"], check=True,
                              capture_output=True, text=True).stdout
        rows.append({"motion": motion, **json.loads(said)})
    return rows


def fuzz(runs, folder):
    """The parser under libFuzzer; how many inputs it took. A finding ends this script."""
    program = folder / "osc_fuzz"
    subprocess.run(["clang++", "-std=c++20", "-O1", "-g", "-fsanitize=fuzzer,address,undefined",
                    "-fno-sanitize-recover=all", "-I.", "-Itests", "-Iformats/include", *FUZZED,
                    "-o", str(program)], check=True)
    corpus = folder / "corpus"
    corpus.mkdir()
    done = subprocess.run([str(program), f"-runs={runs}", "-seed=1", "-print_final_stats=1",
                           f"-artifact_prefix={folder}/", str(corpus), SEEDS],
                          capture_output=True, text=True)
    if done.returncode != 0:
        sys.exit(f"live.py: the fuzzer found something:\n{done.stderr[-4000:]}")
    found = re.search(r"stat::number_of_executed_units:\s*(\d+)", done.stderr)
    units = {"executions": int(found.group(1)), "corpus": len(list(corpus.iterdir()))}
    rate = re.search(r"stat::average_exec_per_sec:\s*(\d+)", done.stderr)
    return {**units, "executions_per_second": int(rate.group(1))}


def vivid(guest):
    """What the kernel's virtual video device did with our frames, a line a check."""
    done = subprocess.run([sys.executable, "tests/ports/v4l2/vivid_test.py", str(guest),
                           os.environ["FIGURINE_VIVID"]], capture_output=True, text=True)
    if done.returncode != 0:
        sys.exit(f"live.py: vivid: {done.stdout[-4000:]}{done.stderr}")
    checks = re.findall(r"^ok +(.*?)\r?$", done.stdout, re.MULTILINE)
    return {"passed": len(checks), "checks": checks}


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("build", type=pathlib.Path)
    parser.add_argument("output", type=pathlib.Path, nargs="?",
                        default=pathlib.Path("docs/results/live.json"))
    parser.add_argument("--seconds", type=float, default=600)
    parser.add_argument("--fuzz-runs", type=int, default=TARGETS["osc_fuzz_executions"])
    parser.add_argument("--rates", type=int, nargs="+", default=[30, 60])
    parser.add_argument("--vivid", type=pathlib.Path)
    options = parser.parse_args()
    tools = {"figurine": options.build / "samples/figurine/figurine",
             "vmc_send": options.build / "tests/ports/vmc_send"}
    for name, path in tools.items():
        if not path.exists():
            sys.exit(f"live.py: {path}: there is no {name} in this build")
    cpus = two_cpus()
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        rows = [live_run(tools, rate, options.seconds, neighbour, folder)
                for neighbour in (False, True) for rate in options.rates]
        trips = round_trips(tools)
        fuzzed = fuzz(options.fuzz_runs, folder)
    video_device = vivid(options.vivid) if options.vivid else None
    machine = rows[0]["machine"]
    for row in rows:
        del row["machine"]
    alone = {row["rate_hz"]: row for row in rows if row["neighbour"] == "none"}
    fastest = alone[max(alone)]
    summary = {
        "latency_p50_ms": fastest["latency_ms"]["p50"],
        "latency_p99_ms": fastest["latency_ms"]["p99"],
        # Late ones too: shown, but not in their time.
        **{f"dropped_frames_{rate}hz": row["dropped_frames"] + row["late_frames"]
           for rate, row in alone.items()},
        "vmc_round_trip_deg": max(trip["worst_deg"] for trip in trips),
        "osc_fuzz_executions": fuzzed["executions"],
    }
    arguments = [f"--seconds {options.seconds:g}", f"--fuzz-runs {options.fuzz_runs}"]
    report = {
        **results.head("scripts/experiments/live.py BUILD " + " ".join(arguments)),
        "machine": {**machine, "cpus_used": len(cpus)},
        "summary": summary,
        "targets": TARGETS,
        "what": f"{PERSON} at {SIZE}, VMC in, y4m to a FIFO that is drained at full speed; "
                f"summary: no neighbour, latency at {max(alone)} Hz",
        "rows": rows,
        "round_trips": trips,
        "fuzzer": fuzzed,
        **({"vivid": video_device} if video_device else {}),
    }
    results.write(options.output, report)
    print(json.dumps(summary, indent=1))


if __name__ == "__main__":
    main()
