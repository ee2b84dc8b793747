#!/usr/bin/env python3
"""Every call that changes a file fails once, in a row of commands; and the other faults that a
machine has: a lost standard output, a full disk, a folder that cannot be written, a pipe as input,
an input that is cut short, two processes with one output, a link as output.

    injected.py INJECTOR.so FIGURINE INSPECT REPOSITORY [TRAIN] [--programs capture,...]
                [--most N] [--output docs/results/faults.json]

Of every failed run: exit code 1 and one line on standard error, an older output untouched to the
byte, no half output and no temporary. Of short and interrupted calls: exit code 0 and the output
of an undisturbed run. Of a process that is killed at a call: no half output, and the next run ends
as an undisturbed one and leaves no temporary. Exit code 1 if anything is otherwise.

--programs: those of the trainer whose calls fail too (capture, avatar, pack, sampler, population;
none by default: they take an hour of a core); --most: of every kind of fault, so many calls of a
program of the trainer's, spread evenly.
"""
import argparse
import collections
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile
import time

import kills

OLD = b"what was there before"
KINDS = ("enospc", "eio", "eintr", "short", "kill")
COUNTS = ("runs", "half_files", "lost_files", "other_ends", "not_one_line", "temporaries_left")
NOBODY = 65534  # the user who may write nowhere


class Faults:
    def __init__(self, injector):
        self.injector = injector
        self.found = []
        self.rows = collections.defaultdict(lambda: dict.fromkeys(COUNTS, 0))
        self.row = None

    def begin(self, program, fault):
        self.row = self.rows[program, fault]

    def run(self, command, environment=None, **options):
        self.row["runs"] += 1
        options = {"timeout": 300, "stdin": subprocess.DEVNULL, **options}
        if "stdout" not in options:
            options["capture_output"] = True
        return subprocess.run([str(word) for word in command],
                              env={**os.environ, **(environment or {})}, **options)

    def inject(self, command, at, kind, count=None):
        environment = {"LD_PRELOAD": self.injector, "FAULT_AT": str(at), "FAULT_KIND": kind}
        if count:
            environment["FAULT_COUNT"] = str(count)
        return self.run(command, environment)

    def expect(self, holds, what, kind="other_ends"):
        if not holds:
            self.row[kind] += 1
            self.found.append(what)
            print(f"injected: {what}", file=sys.stderr, flush=True)

    def expect_lost(self, result, what):
        """Behind what was said of the work, which was done: its files are there."""
        error = result.stderr.decode(errors="replace")
        self.expect(result.returncode == 1, f"{what}: exit code {result.returncode}: {error}")
        self.expect("standard output: what was printed is lost" in error.rstrip().split("\n")[-1],
                    f"{what}: not said: {error!r}", "not_one_line")

    def expect_line(self, result, what):
        error = result.stderr.decode(errors="replace")
        self.expect(result.returncode == 1, f"{what}: exit code {result.returncode}: {error}")
        self.expect(error.count("\n") == 1, f"{what}: not one line: {error!r}", "not_one_line")

    def expect_no_temporaries(self, folder, what):
        left = [path.name for path in folder.rglob("*.figurine.tmp")]
        self.expect(not left, f"{what}: leaves {left}", "temporaries_left")

    def every_call(self, name, command, outputs, folder):
        """command writes `outputs` (names) into `folder`."""
        def contents():
            return {p.name: p.read_bytes() for p in folder.iterdir() if p.is_file()}

        def restore(old):
            for path in folder.iterdir():
                path.unlink()
            for output in outputs if old else []:
                (folder / output).write_bytes(OLD)

        self.begin(name, "none")
        restore(False)
        count = folder.parent / "count"
        result = self.inject(command, 0, "", count)
        self.expect(result.returncode == 0, f"{name}: {result.stderr.decode()}")
        whole = contents()
        calls = int(count.read_text())
        self.expect(calls > 0, f"{name}: changes nothing")
        for kind in KINDS:
            self.begin(name, kind)
            for at in range(1, calls + 1):
                what = f"{name}, call {at} of {calls}, {kind}"
                old = at % 2 == 1
                restore(old)
                result = self.inject(command, at, kind)
                now = contents()
                if kind in ("eintr", "short"):
                    self.expect(result.returncode == 0, f"{what}: {result.stderr.decode()}")
                    self.expect(now == whole, f"{what}: another result")
                    continue
                # What was given its name before the call that failed is whole; what was not is old.
                for output in now:
                    if kind == "kill" and output.endswith(".figurine.tmp"):
                        continue
                    self.expect(output in outputs, f"{what}: leaves {output}", "temporaries_left")
                    self.expect(now[output] in (whole.get(output), OLD), f"{what}: half {output}",
                                "half_files")
                if old:
                    self.expect(set(outputs) <= set(now), f"{what}: lost an older file",
                                "lost_files")
                if kind == "kill":
                    again = self.run(command)
                    self.expect(again.returncode == 0, f"{what}, again: {again.stderr.decode()}")
                    self.expect(contents() == whole, f"{what}, again: another result")
                elif result.returncode != 0:
                    self.expect_line(result, what)
        return calls

    def every_call_of_training(self, name, program, tools, most):
        """program: one of kills.py, whose output is a folder."""
        reference = tools.top / f"{name}_whole"
        count = tools.top / "count"
        command = [tools.train, *program.command(reference, False)]
        self.begin(name, "none")
        if isinstance(program, kills.Pack):
            program.command(reference, False)
        result = self.inject(command, 0, "", count)
        self.expect(result.returncode == 0, f"{name}: {result.stderr.decode()}")
        calls = int(count.read_text())
        places = range(1, calls + 1)
        if most and calls > most:
            places = sorted({1 + i * (calls - 1) // (most - 1) for i in range(most)})
        for kind in KINDS:
            self.begin(name, kind)
            for at in places:
                what = f"{name}, call {at} of {calls}, {kind}"
                folder = tools.top / f"{name}_{kind}"
                shutil.rmtree(folder, ignore_errors=True)
                result = self.inject([tools.train, *program.command(folder, False)], at, kind)
                files = [path for path in folder.rglob("*") if path.is_file()
                         and not path.name.endswith(".figurine.tmp")]
                for path in files:
                    self.expect(kills.is_whole(path, tools), f"{what}: {path.name} is half",
                                "half_files")
                if isinstance(program, kills.Pack):
                    self.expect((folder / "person.fgn").exists(), f"{what}: lost the older package",
                                "lost_files")
                if kind in ("eintr", "short"):
                    self.expect(result.returncode == 0, f"{what}: {result.stderr.decode()}")
                elif kind != "kill" and result.returncode != 0:
                    error = result.stderr.decode(errors="replace")
                    self.expect(result.returncode == 1, f"{what}: code {result.returncode}")
                    # A population names every member that failed.
                    one = isinstance(program, kills.Population) or error.count("\n") == 1
                    self.expect(one, f"{what}: not one line: {error!r}", "not_one_line")
                if result.returncode != 0:
                    again = self.run([tools.train, *program.command(folder, True)])
                    self.expect(again.returncode == 0, f"{what}, again: {again.stderr.decode()}")
                if folder.exists():
                    self.expect(program.same(folder, reference), f"{what}: ends otherwise")
                    self.expect_no_temporaries(folder, what)
        return calls


class Capture:
    """As the programs of kills.py: pictures, masks, cameras."""

    def __init__(self, tools):
        self.tools = tools

    def command(self, folder, resume):
        if resume:
            shutil.rmtree(folder, ignore_errors=True)  # captures are made anew
        return ["capture", "--body", self.tools.body, "--identities", 1, "--views", 2,
                "--bust-views", 0, "--frames", 2, "--size", "32x32", "--motion", self.tools.walk,
                "--threads", 1, "-o", folder]

    def same(self, folder, other):
        def contents(of):
            return {path.relative_to(of): path.read_bytes() for path in of.rglob("*")
                    if path.is_file() and not path.name.endswith(".lock")}
        return contents(folder) == contents(other)


def lost_outputs(faults, commands):
    for command in commands:
        what = " ".join(pathlib.Path(word).name for word in command)
        faults.begin(pathlib.Path(command[0]).name, "lost standard output")
        with open("/dev/full", "wb") as lost:
            result = faults.run(command, stdout=lost, stderr=subprocess.PIPE)
        faults.expect_lost(result, f"{what} > /dev/full")
        result = faults.run(["sh", "-c", 'exec "$@" >&-', "sh", *command])
        faults.expect_lost(result, f"{what} >&-")


def pipes_as_input(faults, top, commands):
    """commands: of a path, the words of a command that reads it."""
    for ending, command in commands:
        pipe = top / f"pipe{ending}"
        if not pipe.exists():
            os.mkfifo(pipe)
        words = [str(word) for word in command(pipe)]
        faults.begin(pathlib.Path(words[0]).name, "pipe as input")
        what = " ".join(pathlib.Path(word).name for word in words)
        try:
            faults.expect_line(faults.run(words, timeout=30), what)
        except subprocess.TimeoutExpired:
            faults.expect(False, f"{what}: waits for the pipe")


def full_disk(faults, top, figurine, person):
    """A disk of 64 KiB where one may be mounted; otherwise the limit of a file's size alone."""
    faults.begin("export", "full disk")
    disk = top / "disk"
    disk.mkdir()
    script = f'mount -t tmpfs -o size=64k none "{disk}" || exit 77; exec 3>&2; "$@"; ' \
             f'code=$?; ls -A "{disk}"; exit $code'
    result = faults.run(["unshare", "--mount", "sh", "-c", script, "sh", figurine, "export", person,
                         "-o", disk / "big.ply"])
    if result.returncode == 77:
        print("injected: no disk can be mounted here: a limit of the file size stands for it")
    else:
        faults.expect_line(result, "a full disk")
        faults.expect(result.stdout == b"", f"a full disk: leaves {result.stdout.decode()}",
                      "temporaries_left")
    faults.begin("export", "limit of the file size")
    limited = faults.run(["sh", "-c", 'ulimit -f 1; exec "$@"', "sh", figurine, "export", person,
                          "-o", top / "big.ply"])
    faults.expect_line(limited, "a limit of the file size")
    faults.expect(not any(top.glob("*big.ply*")), "a limit of the file size: leaves a file",
                  "half_files")


def forbidden_folder(faults, top, command):
    user = {"user": NOBODY} if os.getuid() == 0 else {}
    faults.begin("render", "folder that may not be written")
    folder = top / "forbidden"
    folder.mkdir(mode=0o555)
    result = faults.run([*command, "-o", folder / "b.png"], **user)
    faults.expect_line(result, "a folder that may not be written")
    faults.expect(not (folder / "b.png").exists(), "a forbidden folder: leaves a file",
                  "half_files")


def links_and_rivals(faults, top, command):
    faults.begin("render", "link as output")
    target, link = top / "target.png", top / "link.png"
    target.write_bytes(OLD)
    link.symlink_to(target.name)
    result = faults.run([*command, "-o", link])
    whole = target.read_bytes()
    faults.expect(result.returncode == 0 and link.is_symlink() and whole != OLD,
                  f"a link as output: {result.stderr.decode()}")
    loop = top / "loop.png"
    loop.symlink_to(loop.name)
    faults.expect_line(faults.run([*command, "-o", loop]), "a link to itself as output")

    faults.begin("render", "two processes with one output")
    shared = top / "rivals"
    shared.mkdir()
    for _ in range(10):
        faults.row["runs"] += 2
        rivals = [subprocess.Popen([str(word) for word in [*command, "-o", shared / "a.png"]],
                                   stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
                  for _ in range(2)]
        for rival in rivals:
            error = rival.communicate()[1].decode()
            faults.expect(rival.returncode == 0, f"two processes with one output: {error}")
        faults.expect((shared / "a.png").read_bytes() == whole,
                      "two processes with one output: it is neither's", "half_files")
        faults.expect_no_temporaries(shared, "two processes with one output")


def cut_inputs(faults, top, figurine, person, walk):
    """Mapped files are cut short while they are read: at moments all through the run."""
    faults.begin("render", "input cut short")
    out = top / "cut"
    out.mkdir()
    copy = top / "cut.fgn"
    body = pathlib.Path(person).parent / "body-coarse.fgn"
    words = [figurine, "render", copy, "--motion", walk, "--frames", "0:40", "--size", "32x32",
             "--background", "black", "-o", out / "a.y4m"]
    if body.exists():
        words += ["--body", body]
    for delay_ms in range(0, 60, 4):
        shutil.copy(person, copy)
        (out / "a.y4m").write_bytes(OLD)
        faults.row["runs"] += 1
        process = subprocess.Popen([str(word) for word in words], stdout=subprocess.DEVNULL,
                                   stderr=subprocess.PIPE)
        time.sleep(delay_ms / 1000)
        os.truncate(copy, 0)
        error = process.communicate(timeout=120)[1].decode()
        what = f"an input cut short after {delay_ms} ms"
        if process.returncode == 0:
            continue
        faults.expect(process.returncode == 1, f"{what}: exit code {process.returncode}: {error}")
        faults.expect(error.count("\n") == 1, f"{what}: not one line: {error!r}", "not_one_line")
        faults.expect((out / "a.y4m").read_bytes() == OLD, f"{what}: the older output is lost",
                      "lost_files")


def write(arguments, faults):
    """Beside what kills.py has written there."""
    sys.path.insert(0, str(pathlib.Path(arguments.repository) / "scripts/experiments"))
    import results
    path = pathlib.Path(arguments.output)
    old = results.read(path) or {}
    rows = {(row["program"], row["fault"]): row for row in old.get("injected", {}).get("rows", [])}
    rows.update({(program, fault): {"program": program, "fault": fault, **row}
                 for (program, fault), row in faults.rows.items()})
    command = f"tests/faults/injected.py --programs {arguments.programs} --most {arguments.most}"
    totals = {key: sum(row[key] for row in rows.values()) for key in COUNTS}
    old["injected"] = {**results.head(command), **totals, "rows": list(rows.values())}
    results.write(path, old)


def device(faults, top, arguments):
    figurine, inspect, train = arguments.figurine, arguments.inspect, arguments.train
    repository = pathlib.Path(arguments.repository)
    packages, data = repository / "samples/packages", repository / "tests"
    person, walk = packages / "person-coarse.fgn", packages / "walk.fgn"
    clip = data / "data/cases/bvh-reference/in.bvh"
    scene = data / "fuzz/seeds/ply/plain.ply"
    body = packages / "body-128.fgn"
    sampler = repository / "samples/samplers/edge.fgn"
    out = top / "out"
    out.mkdir()
    render = [figurine, "render", person, "--motion", walk, "--size", "32x32"]
    commands = {
        "picture": ([*render, "-o", out / "a.png"], ["a.png"]),
        "pictures": ([*render, "--frames", "0:3", "-o", out / "f_%03d.png"],
                     ["f_000.png", "f_001.png", "f_002.png"]),
        "video": ([*render, "--frames", "0:3", "--background", "black", "-o", out / "a.y4m"],
                  ["a.y4m"]),
        "export": ([figurine, "export", person, "-o", out / "a.ply"], ["a.ply"]),
        "splat": ([figurine, "splat", scene, "--size", "32x32", "-o", out / "s.png"], ["s.png"]),
        "motion": ([figurine, "motion", clip, "--body", body, "-o", out / "m.fgn"], ["m.fgn"]),
        "pose": ([figurine, "pose", "--from", walk, "-o", out / "p.json"], ["p.json"])}
    if sampler.exists():
        commands["sample"] = ([figurine, "sample", sampler, "--seed", "1", "--steps", "2", "-o",
                               out / "x.fgn"], ["x.fgn"])
    if train:
        commands["body"] = ([train, "body", "--mannequin", "--uv", "32", "-o", out / "b.fgn"],
                            ["b.fgn"])
    calls = {name: faults.every_call(name, command, outputs, out)
             for name, (command, outputs) in commands.items()}

    lost = [[inspect, person], [inspect, "--json", person], [figurine, "--help"],
            [figurine, "--version"], [inspect, "--help"], [figurine, "pose", "--from", walk]]
    if train:
        lost += [[train, "--version"],
                 [train, "body", "--mannequin", "--uv", "32", "-o", top / "c.fgn"]]
    lost_outputs(faults, lost)

    x = top / "x.png"
    read = [(".fgn", lambda pipe: [inspect, pipe]),
            (".fgn", lambda pipe: [inspect, person, "--diff", pipe]),
            (".fgn", lambda pipe: [figurine, "render", pipe, "-o", x]),
            (".fgn", lambda pipe: [figurine, "render", person, "--body", pipe, "-o", x]),
            (".fgn", lambda pipe: [figurine, "render", person, "--motion", pipe, "-o", x]),
            (".json", lambda pipe: [figurine, "render", person, "--pose", pipe, "-o", x]),
            (".json", lambda pipe: [figurine, "render", person, "--camera", pipe, "-o", x]),
            (".fgn", lambda pipe: [figurine, "export", pipe, "-o", top / "x.ply"]),
            (".fgn", lambda pipe: [figurine, "pose", "--from", pipe]),
            (".fgn", lambda pipe: [figurine, "sample", pipe, "--seed", "1", "-o", top / "x.fgn"]),
            (".fgn", lambda pipe: [figurine, "selftest", pipe])]
    read += [(ending, lambda pipe: [figurine, "splat", pipe, "-o", x])
             for ending in (".ply", ".splat", ".spz")]
    read += [(ending, lambda pipe: [figurine, "motion", pipe, "--body", body, "-o",
                                    top / "x.fgn"])
             for ending in (".bvh", ".glb", ".gltf", ".npz")]
    read += [(".fgn", lambda pipe: [figurine, "motion", clip, "--body", pipe, "-o",
                                    top / "x.fgn"]),
             (".json", lambda pipe: [figurine, "motion", clip, "--body", body, "--map", pipe, "-o",
                                     top / "x.fgn"])]
    if train:
        read += [(".npz", lambda pipe: [train, "body", "--smplx", pipe, "--uv", "32", "-o",
                                        top / "x.fgn"]),
                 (".bvh", lambda pipe: [train, "motion", pipe, "--body", body, "-o",
                                        top / "x.fgn"]),
                 (".fgn", lambda pipe: [train, "capture", "--body", pipe, "-o", top / "x"]),
                 (".json", lambda pipe: [train, "population", pipe, "-o", top / "x"]),
                 (".fgn", lambda pipe: [train, "sampler", "--population", pipe, "-o", top / "x"])]
    pipes_as_input(faults, top, read)

    faults.begin("render", "input that is gone")
    faults.expect_line(faults.run([figurine, "render", top / "gone.fgn", "-o", x]),
                       "an input that is gone")
    full_disk(faults, top, figurine, person)
    forbidden_folder(faults, top, render)
    links_and_rivals(faults, top, render)
    cut_inputs(faults, top, figurine, person, walk)
    return calls


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("injector")
    parser.add_argument("figurine")
    parser.add_argument("inspect")
    parser.add_argument("repository")
    parser.add_argument("train", nargs="?")
    parser.add_argument("--programs", default="")
    parser.add_argument("--most", type=int, default=0)
    parser.add_argument("--output")
    arguments = parser.parse_args()
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    faults = Faults(arguments.injector)
    with tempfile.TemporaryDirectory(prefix="figurine_faults_") as temporary:
        top = pathlib.Path(temporary)
        top.chmod(0o755)  # for the user who may write nowhere
        calls = device(faults, top, arguments)
        names = [name for name in arguments.programs.split(",") if name]
        if names:
            tools = kills.Tools(arguments.train, arguments.inspect, arguments.repository,
                                top / "trainer")
            tools.top.mkdir()
            tools.prepare()
        for name in names:
            program = {**kills.PROGRAMS, "capture": Capture}[name](tools)
            calls[name] = faults.every_call_of_training(name, program, tools, arguments.most)
            if arguments.output:
                write(arguments, faults)  # a campaign that is stopped has done something
    if arguments.output:
        write(arguments, faults)
    runs = sum(row["runs"] for row in faults.rows.values())
    print(f"injected: {runs} runs, calls that change files: {calls}, {len(faults.found)} findings")
    return 1 if faults.found else 0


if __name__ == "__main__":
    sys.exit(main())
