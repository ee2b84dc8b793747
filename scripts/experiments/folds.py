"""Writes docs/results/folds.json: what the folds of the pose are worth in the captures' own
pictures, and what a capture costs.

    scripts/run python3 scripts/experiments/folds.py [FOLDER]

FOLDER (default out/folds) keeps the captures; from preset dev.

Folds: the same people, poses and cameras with the folds of every pose (the truth), with those of
the rest pose and without any; PSNR over the pixels whose true alpha exceeds 0.5, on stored values,
pooled (docs/numerics.md, "Picture quality"). The outline is the same in all three, so the
background cancels. JPEG's own error (quality 97) is in all of them.
Cost: CPU seconds of one identity of 300 images, start-up included.
"""

import datetime
import math
import os
import pathlib
import platform
import re
import resource
import subprocess
import sys

import results

TOOL = "build/dev/toolchain/cli/figurine-train"
SEEDS = [38, 41, 7]
SHOTS = ["--frames", "8", "--views", "3", "--size", "512x512"]


def text_of(*command):
    return subprocess.run(command, check=True, text=True, stdout=subprocess.PIPE).stdout


def run_tool(*options):
    subprocess.run([TOOL, *options], check=True, stdout=subprocess.DEVNULL)


def capture(body, folder, *options):
    """Seconds of CPU. A folder that is there already is kept and costs nothing."""
    about = results.read(folder / "000000/figurine.json")
    if about and about["complete"]:
        return 0.0
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    run_tool("capture", "--body", body, "--threads", "1", "--resume", "-o", folder, "--bust-views",
             "0", *options)  # whole people, whose pictures all have one size
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def pixels(pattern, kind):
    command = ["ffmpeg", "-loglevel", "error", "-pattern_type", "glob", "-i", pattern]
    command += ["-f", "rawvideo", "-pix_fmt", kind, "-"]
    return subprocess.run(command, check=True, stdout=subprocess.PIPE).stdout


def squared_error(truth, other):
    total = count = 0
    for camera in sorted(path.name for path in (truth / "000000/images_lr").iterdir()):
        masks = pixels(f"{truth}/000000/fmask_lr/{camera}/*.png", "gray")
        images = f"000000/images_lr/{camera}/*.jpg"
        wanted, seen = (pixels(f"{folder}/{images}", "rgb24") for folder in (truth, other))
        for i, alpha in enumerate(masks):
            if alpha > 127:
                for c in range(3 * i, 3 * i + 3):
                    total += (wanted[c] - seen[c]) ** 2
                count += 3
    return total, count


def psnr_db(total, count):
    return round(10 * math.log10(255 ** 2 * count / total), 2) if total else None


def cpu():
    match = re.search(r"model name\s*: (.*)", pathlib.Path("/proc/cpuinfo").read_text())
    return match.group(1) if match else platform.processor()


def main():
    folder = pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else "out/folds")
    folder.mkdir(parents=True, exist_ok=True)
    body = folder / "body.fgn"
    if not body.exists():
        run_tool("body", "--makehuman", "--uv", "128", "-o", body)
    people, pooled = [], {"rest": [0, 0], "off": [0, 0]}
    for seed in SEEDS:
        for mode in ("pose", "rest", "off"):
            capture(body, folder / f"{seed}_{mode}", "--seed", str(seed), "--folds", mode, *SHOTS)
        truth = folder / f"{seed}_pose"
        person = results.read(truth / "000000/figurine.json")["person"]
        row = {"seed": seed, "garment": person["garment"]}
        for mode in ("rest", "off"):
            error = squared_error(truth, folder / f"{seed}_{mode}")
            pooled[mode] = [a + b for a, b in zip(pooled[mode], error)]
            row[f"psnr_{mode}_folds_db"] = psnr_db(*error)
        people.append(row)
    cost = {}
    person = ["--seed", "38", "--frames", "25", "--views", "12"]
    for name, size in (("edge", "512x512"), ("nano", "128x128")):
        seconds = capture(body, folder / f"cost_{name}", *person, "--size", size)
        if seconds:
            cost[f"{name}_25_poses_12_views_cpu_s"] = round(seconds, 1)
    result = {
        "psnr_rest_folds_db": psnr_db(*pooled["rest"]),
        "psnr_no_folds_db": psnr_db(*pooled["off"]),
        "people": people,
        "shots": " ".join(SHOTS),
        "cost": cost,
        "command": "scripts/run python3 scripts/experiments/folds.py",
        "commit": text_of("git", "-c", "safe.directory=*", "rev-parse", "HEAD").strip(),
        "machine": {
            "architecture": platform.machine(),
            "cores": os.cpu_count(),
            "cpu": cpu(),
            "load": round(os.getloadavg()[0], 1),
        },
        "date": datetime.datetime.now(datetime.timezone.utc).strftime("%Y-%m-%dT%H:%M:%SZ"),
    }
    results.write(pathlib.Path("docs/results/folds.json"), result)


if __name__ == "__main__":
    main()
