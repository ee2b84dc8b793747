#!/usr/bin/env python3
"""Every call that changes a file fails once, in a row of commands; and the other faults that a
machine has: a lost standard output, a full disk, a folder that cannot be written, a pipe as input.

    injected.py INJECTOR.so FIGURINE INSPECT REPOSITORY [TRAIN]

Of every failed run: exit code 1 and one line on standard error, an older output untouched to the
byte, no half output and no temporary. Of short and interrupted calls: exit code 0 and the output
of an undisturbed run. Exit code 1 if anything is otherwise.
"""
import os
import pathlib
import subprocess
import sys
import tempfile

OLD = b"what was there before"


class Faults:
    def __init__(self, injector):
        self.injector = injector
        self.found = []
        self.runs = 0

    def run(self, command, environment=None, **options):
        self.runs += 1
        return subprocess.run(command, env={**os.environ, **(environment or {})}, timeout=120,
                              capture_output="stdout" not in options,
                              stdin=subprocess.DEVNULL, **options)

    def expect(self, holds, what):
        if not holds:
            self.found.append(what)
            print(f"injected: {what}", file=sys.stderr)

    def expect_line(self, result, what):
        error = result.stderr.decode(errors="replace")
        self.expect(result.returncode == 1, f"{what}: exit code {result.returncode}: {error}")
        self.expect(error.count("\n") == 1, f"{what}: not one line: {error!r}")

    def every_call(self, name, command, outputs, folder):
        """command writes `outputs` (names) into `folder`."""
        def contents():
            return {p.name: p.read_bytes() for p in folder.iterdir() if p.is_file()}

        def restore(old):
            for path in folder.iterdir():
                path.unlink()
            for output in outputs if old else []:
                (folder / output).write_bytes(OLD)

        restore(False)
        count = folder.parent / "count"
        result = self.run(command, {"LD_PRELOAD": self.injector, "FAULT_COUNT": str(count)})
        self.expect(result.returncode == 0, f"{name}: {result.stderr.decode()}")
        whole = contents()
        calls = int(count.read_text())
        self.expect(calls > 0, f"{name}: changes nothing")
        for at in range(1, calls + 1):
            for kind in ("enospc", "eio", "eintr", "short"):
                what = f"{name}, call {at} of {calls}, {kind}"
                old = at % 2 == 1
                restore(old)
                result = self.run(command, {"LD_PRELOAD": self.injector, "FAULT_AT": str(at),
                                            "FAULT_KIND": kind})
                now = contents()
                if kind in ("eintr", "short"):
                    self.expect(result.returncode == 0, f"{what}: {result.stderr.decode()}")
                    self.expect(now == whole, f"{what}: another result")
                    continue
                # What was given its name before the call that failed is whole; what was not is old.
                for output in now:
                    self.expect(output in outputs, f"{what}: leaves {output}")
                    self.expect(now[output] in (whole.get(output), OLD), f"{what}: half {output}")
                if old:
                    self.expect(set(now) == set(outputs), f"{what}: lost an older file")
                if result.returncode != 0:
                    self.expect_line(result, what)
        return calls


def main():
    injector, figurine, inspect, repository = sys.argv[1:5]
    train = sys.argv[5] if len(sys.argv) > 5 else None
    packages = pathlib.Path(repository) / "samples/packages"
    person, walk = str(packages / "person-coarse.fgn"), str(packages / "walk.fgn")
    faults = Faults(injector)
    with tempfile.TemporaryDirectory(prefix="figurine_faults_") as temporary:
        top = pathlib.Path(temporary)
        out = top / "out"
        out.mkdir()
        render = [figurine, "render", person, "--motion", walk, "--size", "32x32"]
        calls = {
            "picture": faults.every_call("picture", [*render, "-o", str(out / "a.png")],
                                         ["a.png"], out),
            "pictures": faults.every_call(
                "pictures", [*render, "--frames", "0:3", "-o", str(out / "f_%03d.png")],
                ["f_000.png", "f_001.png", "f_002.png"], out),
            "video": faults.every_call(
                "video", [*render, "--frames", "0:3", "--background", "black",
                          "-o", str(out / "a.y4m")], ["a.y4m"], out),
            "export": faults.every_call(
                "export", [figurine, "export", person, "-o", str(out / "a.ply")], ["a.ply"], out)}
        if train:
            calls["body"] = faults.every_call(
                "body", [train, "body", "--mannequin", "--uv", "32", "-o", str(out / "b.fgn")],
                ["b.fgn"], out)

        full = [[inspect, person], [inspect, "--json", person], [figurine, "--help"],
                [figurine, "--version"], [inspect, "--help"],
                [figurine, "pose", "--from", walk]]
        if train:
            full += [[train, "--version"],
                     [train, "body", "--mannequin", "--uv", "32", "-o", str(top / "c.fgn")]]
        for command in full:
            what = " ".join(pathlib.Path(word).name for word in command)
            with open("/dev/full", "wb") as lost:
                result = faults.run(command, stdout=lost, stderr=subprocess.PIPE)
            faults.expect_line(result, f"{what} > /dev/full")
            result = faults.run(["sh", "-c", 'exec "$@" >&-', "sh", *command])
            faults.expect_line(result, f"{what} >&-")

        pipe = top / "pipe.fgn"
        os.mkfifo(pipe)
        for command in ([inspect, str(pipe)], [*render[:2], str(pipe), "-o", str(top / "x.png")]):
            faults.expect_line(faults.run(command), f"{pathlib.Path(command[0]).name} of a pipe")
        vanished = faults.run([*render[:2], str(top / "gone.fgn"), "-o", str(top / "x.png")])
        faults.expect_line(vanished, "an input that is gone")
        limited = faults.run(["sh", "-c", 'ulimit -f 1; exec "$@"', "sh", figurine, "export",
                              person, "-o", str(top / "big.ply")])
        faults.expect_line(limited, "a limit of the file size")
        faults.expect(not any(top.glob("*big.ply*")), "a limit of the file size: leaves a file")
    print(f"injected: {faults.runs} runs, calls that change files: {calls}, "
          f"{len(faults.found)} findings")
    return 1 if faults.found else 0


if __name__ == "__main__":
    sys.exit(main())
