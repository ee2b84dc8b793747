"""Boots emulated ARM machines that draw the shipped person, and reports what they executed.

    arm_instructions.py ARM_COUNT COUNTING_PLUGIN FOLDER OUTPUT

Called by arm_instructions.sh in the environment of scripts/run. FOLDER holds the kernel, vmlinuz,
and takes the machines' files.
"""

import json
import os
import pathlib
import re
import statistics
import subprocess
import sys

import results

FRAMES = 3
BOOTS = 2
AVATAR, BODY = "samples/packages/person.fgn", "samples/packages/body-128.fgn"
# The target is of a person with more texels than the shipped one. What is done for every texel is
# taken to grow with them, what is done for every cell of the network and every pixel not.
WANTED_TEXELS = 9832
OF_EVERY_TEXEL = ("decode", "skin", "project", "bin", "sort", "blend")
# What turns counts into rates. Instructions a cycle are what such cores reach on this kind of code,
# not measured here; caches and memory are in them as well as they can be.
CORES = {
    "cortex-a76": {"ghz": 2.4, "instructions_per_cycle": 2.0, "wanted_fps": 40},
    "cortex-a53": {"ghz": 1.4, "instructions_per_cycle": 0.9, "wanted_fps": 12},
}
LIBRARY_FOLDERS = [
    pathlib.Path(os.environ["FIGURINE_SYSROOT"], "usr/lib/aarch64-linux-gnu"),
    pathlib.Path("/usr/aarch64-linux-gnu/lib"),
]


def needed(file):
    command = ["readelf", "--dynamic", "--program-headers", str(file)]
    text = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    loader = re.findall(r"program interpreter: .*/(.*)\]", text)
    return loader + re.findall(r"\(NEEDED\).*\[(.*)\]", text)


def libraries_of(program):
    """{name: file} of all that the program needs, and all that those need."""
    found, queue = {}, needed(program)
    while queue:
        name = queue.pop()
        if name in found:
            continue
        found[name] = next(f / name for f in LIBRARY_FOLDERS if (f / name).exists())
        queue += needed(found[name])
    return found


def archive(entries):
    """What Linux unpacks into memory: cpio, "newc". Entries are (name, mode, bytes, device)."""
    parts = []
    for number, (name, mode, content, device) in enumerate([*entries, ("TRAILER!!!", 0, b"", 0)]):
        fields = [number, mode, 0, 0, 1, 0, len(content), 0, 0, device >> 8, device & 255]
        fields += [len(name) + 1, 0]
        head = "070701" + "".join(f"{field:08x}" for field in fields) + name + "\0"
        parts += [head.encode(), bytes(-len(head) % 4), content, bytes(-len(content) % 4)]
    return b"".join(parts)


def initial_files(program):
    """The machine's files: the program, its libraries, the packages, and a console to write to."""
    files = {"arm_count": program, "person.fgn": AVATAR, "body.fgn": BODY}
    files |= {f"lib/{name}": file for name, file in libraries_of(program).items()}
    entries = [(name, 0o040755, b"", 0) for name in ("dev", "lib", "proc", "sys")]
    entries += [("dev/console", 0o020600, b"", 5 << 8 | 1)]
    for name, file in files.items():
        entries.append((name, 0o100755, pathlib.Path(file).read_bytes(), 0))
    return archive(entries)


def boot(core, plugin, folder):
    """What the program printed: a line about the build, and one for each frame and counter."""
    ram = folder / "ram"
    command = ["qemu-system-aarch64", "-machine", "virt,memory-backend=ram", "-cpu", core]
    command += ["-accel", "tcg,thread=single", "-smp", "1", "-m", "512M", "-nic", "none"]
    command += ["-object", f"memory-backend-file,id=ram,size=512M,share=on,mem-path={ram}"]
    command += ["-display", "none", "-monitor", "none", "-serial", "stdio", "-no-reboot"]
    command += ["-kernel", str(folder / "vmlinuz"), "-initrd", str(folder / "files")]
    command += ["-append", "console=ttyAMA0 quiet panic=-1 norandmaps rdinit=/arm_count"]
    command[-1] += f" -- person.fgn {FRAMES}"
    command += ["-plugin", f"{plugin},ram={ram}"]
    text = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    ram.unlink()
    lines = text.replace("\r", "").splitlines()
    if "begin" not in lines or "end" not in lines:
        sys.exit(f"arm_instructions: {core} did not draw:\n" + "\n".join(lines[-20:]))
    return [json.loads(line) for line in lines[lines.index("begin") + 1 : lines.index("end")]]


def median_of(values):
    return int(statistics.median(values))


def medians(dicts):
    """{key: median} of dicts of the same keys."""
    return {key: median_of([entry[key] for entry in dicts]) for key in dicts[0]}


def rate(core, instructions):
    speed = CORES[core]
    return speed["ghz"] * 1e9 * speed["instructions_per_cycle"] / instructions


def at_wanted_texels(instructions, stages, texels):
    grow = sum(stages[stage]["instructions"] for stage in OF_EVERY_TEXEL)
    return int(instructions + grow * (WANTED_TEXELS / texels - 1))


def transposed(by_counter):
    """{name: {counter: count}} of {counter: {name: count}}, without zeros."""
    return {
        name: {counter: counts[name] for counter, counts in by_counter.items() if counts[name]}
        for name in by_counter["instructions"]
    }


def summarise_tier(core, texels, rows):
    """Medians over the frames of one tier."""
    plain = [row["total"] for row in rows if not row["clock"]]
    counted = {}  # by counter
    for row in rows:
        if row["clock"]:
            counted.setdefault(row["counter"], []).append(row)
    instructions = median_of(plain)
    frames = {counter: median_of([r["total"] for r in group]) for counter, group in counted.items()}
    stages = transposed(
        {counter: medians([r["stages"] for r in group]) for counter, group in counted.items()}
    )
    more = at_wanted_texels(instructions, stages, texels)
    return {
        "instructions": instructions,
        "fps": rate(core, instructions),
        "least": min(plain),
        "most": max(plain),
        "with_clock": frames["instructions"],
        "kinds": {name: count for name, count in frames.items() if name != "instructions"},
        "stages": stages,
        "work": medians([row["work"] for row in counted["instructions"]]),
        "estimate": {"texels": WANTED_TEXELS, "instructions": more, "fps": rate(core, more)},
    }


def layers_of(rows):
    """The network's layers, medians over frames by counter."""
    counts = {}  # counter: a list of counts by layer for each frame
    for row in rows:
        if "layers" in row:
            counts.setdefault(row["counter"], []).append([e["count"] for e in row["layers"]])
            named = row["layers"]
    return [
        {"layer": layer["name"], "macs": layer["macs"]}
        | {
            counter: median_of([frame[i] for frame in frames])
            for counter, frames in counts.items()
            if any(frame[i] for frame in frames)
        }
        for i, layer in enumerate(named)
    ]


def summarise(core, lines):
    """A core's entry of the report, from the lines of one boot."""
    build, rows = lines[0], lines[1:]
    tiers = {}
    for row in rows:
        tiers.setdefault(row["tier"], []).append(row)
    report = CORES[core] | {"isa": build["isa"], "texels": build["texels"]}
    report["tiers"] = {
        tier: summarise_tier(core, build["texels"], own) for tier, own in tiers.items()
    }
    report["layers"] = layers_of(tiers["exact"])
    return report


def numbers(value):
    """All integers in it, in order."""
    if isinstance(value, dict):
        value = list(value.values())
    if isinstance(value, list):
        return [number for entry in value for number in numbers(entry)]
    return [value] if isinstance(value, int) else []


def largest_difference(boots):
    """Between any two counts of the same thing in two boots."""
    return max(abs(a - b) for other in boots[1:] for a, b in zip(numbers(boots[0]), numbers(other)))


def main():
    if len(sys.argv) != 5:
        sys.exit("usage: arm_instructions.py ARM_COUNT COUNTING_PLUGIN FOLDER OUTPUT")
    program, plugin, folder, output = map(pathlib.Path, sys.argv[1:])
    (folder / "files").write_bytes(initial_files(program))
    version = subprocess.run(
        ["qemu-system-aarch64", "--version"], capture_output=True, text=True, check=True
    ).stdout.splitlines()[0]
    cores, differences, summary, library = {}, {}, {}, None
    for core in CORES:
        boots = [boot(core, plugin, folder) for _ in range(BOOTS)]
        library = boots[0][0]["library"]
        differences[core] = largest_difference(boots)
        cores[core] = summarise(core, boots[0])
        for tier, found in cores[core]["tiers"].items():
            name = f"arm_{core.removeprefix('cortex-')}_fps" + ("" if tier == "exact" else "_fast")
            summary[name] = found["fps"]
            millions = found["instructions"] / 1e6
            print(f"{core} {tier}: {millions:.1f} million, {found['fps']:.1f} frames a second")
    report = results.head("scripts/experiments/arm_instructions.sh")
    report |= {
        "machine": {"emulator": version, "library": library},
        "avatar": AVATAR,
        "frames": FRAMES,
        "size": [512, 512],
        "precision": "q8",
        "threads": 1,
        "boots": BOOTS,
        "largest_difference_between_boots": differences,
        "summary": summary,
        "cores": cores,
    }
    results.write(output, report)


if __name__ == "__main__":
    main()
