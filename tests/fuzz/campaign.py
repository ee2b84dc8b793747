#!/usr/bin/env python3
"""Runs the fuzzers of this folder with Clang's libFuzzer, for a time or a number of executions.

    tests/fuzz/campaign.py [--targets ply,bvh,...] [--seconds S | --executions N] [--jobs J]
                           [--folder FOLDER] [--output docs/results/fuzz.json]

A target's corpus lives in FOLDER (by default ~/.cache/figurine/fuzz, outside of every checkout) and
is what a later campaign starts from, with the seeds that stand here and the findings that were
mended. Nine tenths of the executions run without a sanitizer's run-time library, fast, with checks
that trap (undefined behaviour, the standard library's assertions, FIG_DCHECK); the rest under
address and undefined-behaviour sanitizers. Then the corpus is reduced to what covers something,
replayed under the sanitizers, and the regions of the reader's own files that it covers are counted
by llvm-cov (scripts/setup fuzz).

What is found is minimised and told apart by its stack; an earlier finding that no longer fails is
mended. The results add up over campaigns: executions of all of them, coverage of the last. Exit
code 1 if a finding is open. Runs in the reference environment: scripts/run tests/fuzz/campaign.py.
"""
import argparse
import concurrent.futures
import hashlib
import json
import os
import pathlib
import re
import shutil
import subprocess
import sys
import time

REPOSITORY = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(REPOSITORY / "scripts/experiments"))
import results  # noqa: E402

SEEDS = "tests/fuzz/seeds"
PACKAGE = "formats/src/package"
# Target: the files whose regions count, folder of seeds, dictionary, largest input in bytes.
TARGETS = {
    "package": ([f"{PACKAGE}/{name}.cpp" for name in (
        "avatar", "body", "checksum", "container", "content", "package", "population",
        "reading_bytes", "refusal", "sampler", "text")], "tests/golden/packages", None, 65536),
    "ply": ([f"ports/gaussians/{name}.cpp" for name in (
        "ply", "ply_format", "ply_comments", "compressed_ply", "cloud_builder")],
            f"{SEEDS}/ply", "ply", 8192),
    "splat": (["ports/gaussians/splat.cpp"], f"{SEEDS}/splat", None, 4096),
    "spz": (["ports/gaussians/spz.cpp", "ports/gaussians/spz_unpack.cpp"], f"{SEEDS}/spz", None,
            4096),
    "bvh": (["ports/motion/bvh.cpp", "ports/motion/bvh_tree.cpp"], f"{SEEDS}/bvh", "bvh", 8192),
    "npz": (["ports/motion/npz.cpp", "ports/motion/smpl.cpp"], f"{SEEDS}/npz", None, 8192),
    "glb": ([f"ports/motion/{name}.cpp" for name in ("gltf", "gltf_json", "gltf_tree")],
            f"{SEEDS}/glb", "json", 8192),
    "cameras": (["samples/common/camera_file.cpp"], f"{SEEDS}/cameras", "json", 4096),
    "poses": (["samples/common/pose_json.cpp"], f"{SEEDS}/poses", "json", 4096),
    "osc": (["ports/vmc/osc.cpp", "ports/vmc/vmc_state.cpp"], f"{SEEDS}/osc", None, 4096),
    "safetensors": (["toolchain/train/tensor_file.cpp"], f"{SEEDS}/safetensors", "json", 4096),
    "camera_scale": (["toolchain/dataset/pickle.cpp"], f"{SEEDS}/camera_scale", None, 2048)}
SHARE_WITHOUT_SANITIZERS = 0.9
MOST_FINDINGS = 5  # of a target in one campaign: then it is for people first

TRAPS = "-fsanitize=fuzzer-no-link,undefined -fno-sanitize=vptr -fsanitize-trap=undefined"
BUILDS = {
    "fast": ["-DFIGURINE_FUZZER=ON", f"-DCMAKE_CXX_FLAGS={TRAPS} -D_GLIBCXX_ASSERTIONS"],
    "checked": ["-DFIGURINE_FUZZER=ON", "-DCMAKE_CXX_FLAGS=-fsanitize=fuzzer-no-link",
                "-DFIGURINE_SANITIZE=address,undefined", "-DFIGURINE_UNVECTORISED=ON"],
    "coverage": ["-DCMAKE_CXX_FLAGS=-fprofile-instr-generate -fcoverage-mapping"]}


def build(folder, targets, jobs):
    for name, options in BUILDS.items():
        where = folder / "build" / name
        subprocess.run(
            ["cmake", "-S", REPOSITORY, "-B", where, "-G", "Ninja", "-DCMAKE_C_COMPILER=clang",
             "-DCMAKE_CXX_COMPILER=clang++", "-DCMAKE_BUILD_TYPE=RelWithDebInfo",
             "-DFIGURINE_TOOLCHAIN=OFF", "-DFIGURINE_WINDOW=OFF", *options],
            check=True, stdout=subprocess.DEVNULL)
        subprocess.run(["cmake", "--build", where, f"-j{jobs}", "--target",
                        *(f"{target}_fuzz" for target in targets)],
                       check=True, stdout=subprocess.DEVNULL)


class Target:
    def __init__(self, folder, name):
        self.name = name
        self.files, seeds, dictionary, self.max_bytes = TARGETS[name]
        self.seeds = [REPOSITORY / seeds]
        mended = REPOSITORY / "tests/fuzz/findings" / name
        if mended.exists():
            self.seeds.append(mended)
        self.dictionary = (pathlib.Path(__file__).parent / f"dictionaries/{dictionary}.dict"
                           if dictionary else None)
        self.corpus = folder / "corpus" / name
        self.findings = folder / "findings" / name
        self.scratch = folder / "scratch" / name
        for made in (self.corpus, self.findings, self.scratch):
            made.mkdir(parents=True, exist_ok=True)
        self.programs = {kind: folder / "build" / kind / "tests/fuzz" / f"{name}_fuzz"
                         for kind in BUILDS}
        self.executions, self.seconds = 0, 0.0
        self.stacks = {}  # of findings, by their file

    def run(self, kind, *words, timeout=None):
        environment = {**os.environ, "ASAN_OPTIONS": "allocator_may_return_null=1",
                       "UBSAN_OPTIONS": "print_stacktrace=1"}
        return subprocess.run([self.programs[kind], *map(str, words)], capture_output=True,
                              errors="replace", env=environment, timeout=timeout)

    def options(self):
        words = [f"-max_len={self.max_bytes}", "-timeout=20", "-rss_limit_mb=3072", "-reload=0",
                 "-print_final_stats=1", "-use_value_profile=1",
                 f"-artifact_prefix={self.findings}/"]
        return words + ([f"-dict={self.dictionary}"] if self.dictionary else [])

    def fuzz(self, kind, seconds, executions):
        """Until the time or the executions are used up, findings or not."""
        found = 0
        begun = time.monotonic()
        done = 0
        while found < MOST_FINDINGS:
            left_s = seconds - (time.monotonic() - begun) if seconds else 0
            left = executions - done if executions else 0
            if (seconds and left_s < 1) or (executions and left < 1):
                break
            limit = [f"-max_total_time={int(left_s)}"] if seconds else [f"-runs={left}"]
            before = set(self.findings.iterdir())
            result = self.run(kind, *self.options(), *limit, self.corpus, *self.seeds)
            match = re.search(r"stat::number_of_executed_units: (\d+)", result.stderr)
            # Of a run that traps there are no last figures, but the last line that counts.
            counts = re.findall(r"^#(\d+)\t", result.stderr, re.MULTILINE)
            done += int(match.group(1)) if match else int(counts[-1]) if counts else 0
            if result.returncode == 0:
                break
            fresh = set(self.findings.iterdir()) - before
            if not fresh:
                sys.exit(f"campaign: {self.name}: {result.stderr[-4000:]}")
            found += len(fresh)
            for artifact in fresh:
                self.minimise(kind, artifact)
        self.executions += done
        self.seconds += time.monotonic() - begun

    def minimise(self, kind, artifact):
        if artifact.name.startswith(("oom-", "timeout-", "slow-unit-")):
            return
        smaller = self.scratch / "smaller"
        smaller.unlink(missing_ok=True)
        self.run(kind, "-minimize_crash=1", "-max_total_time=60", "-runs=100000",
                 f"-exact_artifact_path={smaller}", artifact)
        if smaller.exists() and smaller.stat().st_size < artifact.stat().st_size:
            shutil.move(smaller, artifact)

    def fails(self, artifact):
        """The stack of a finding that still fails, under the sanitizers; else none."""
        for kind in ("checked", "fast"):
            try:
                result = self.run(kind, "-timeout=20", "-rss_limit_mb=3072", artifact, timeout=120)
            except subprocess.TimeoutExpired:
                return "no end"
            if result.returncode == 0:
                continue
            ours = [match.group(1) for match in re.finditer(
                r"#\d+ 0x\w+ in .*? (\S+:\d+)(?::\d+)?$", result.stderr, re.MULTILINE)
                    if str(REPOSITORY) in match.group(1) and "_fuzz." not in match.group(1)]
            lines = [line.rpartition(f"{REPOSITORY}/")[2] for line in ours[:3]]
            error = re.search(r"(runtime error|ERROR|SUMMARY): .*", result.stderr)
            return " < ".join(lines) or (error.group(0)[:120] if error else "trap")
        return None

    def triage(self):
        """Findings by their stacks, one each; those that no longer fail are removed."""
        by_stack = {}
        for artifact in sorted(self.findings.iterdir(), key=lambda path: path.stat().st_size):
            stack = self.fails(artifact)
            if stack is None or stack in by_stack:
                artifact.unlink()
                continue
            by_stack[stack] = artifact
        return by_stack

    def reduce(self):
        small = self.scratch / "reduced"
        shutil.rmtree(small, ignore_errors=True)
        small.mkdir()
        result = self.run("fast", "-merge=1", f"-max_len={self.max_bytes}", small, self.corpus,
                          *self.seeds)
        if result.returncode != 0:
            return  # with an open finding in the seeds; the corpus stays as it is
        shutil.rmtree(self.corpus)
        small.rename(self.corpus)

    def replay(self):
        result = self.run("checked", "-runs=0", "-timeout=60", "-rss_limit_mb=3072",
                          f"-artifact_prefix={self.findings}/", self.corpus, *self.seeds)
        return result.returncode == 0

    def cover(self):
        """Share of the regions of the reader's files, and the lines of those that are missed."""
        profile = self.scratch / "profile"
        subprocess.run([self.programs["coverage"], self.corpus, *self.seeds], check=True,
                       stdout=subprocess.DEVNULL,
                       env={**os.environ, "LLVM_PROFILE_FILE": f"{profile}.raw"})
        subprocess.run([tool("llvm-profdata"), "merge", "-sparse", f"{profile}.raw", "-o",
                        profile], check=True)
        files = [REPOSITORY / file for file in self.files]
        exported = json.loads(subprocess.run(
            [tool("llvm-cov"), "export", self.programs["coverage"], f"-instr-profile={profile}",
             *files], check=True, capture_output=True).stdout)["data"][0]["files"]
        regions = sum(file["summary"]["regions"]["count"] for file in exported)
        covered = sum(file["summary"]["regions"]["covered"] for file in exported)
        misses = {}
        for file in exported:
            # A segment: line, column, count, has count, starts a region, is a gap.
            lines = sorted({line for line, _, count, has, starts, gap in file["segments"]
                            if has and starts and not gap and count == 0})
            if lines:
                name = str(pathlib.Path(file["filename"]).relative_to(REPOSITORY))
                misses[name] = " ".join(map(str, lines))
        return covered / regions, regions, misses


def tool(name):
    for found in (name, f"{name}-19"):
        if shutil.which(found):
            return found
    sys.exit(f"campaign: there is no {name}: scripts/setup fuzz")


def campaign(target, seconds, executions):
    share = SHARE_WITHOUT_SANITIZERS
    target.fuzz("fast", share * seconds, int(share * executions))
    target.fuzz("checked", (1 - share) * seconds, executions - int(share * executions))
    rate = target.executions / max(target.seconds, 1e-9)
    target.reduce()
    replayed = target.replay()
    found = target.triage()
    coverage, regions, misses = target.cover()
    return {"executions": target.executions, "executions_per_second": rate,
            "coverage": coverage, "regions": regions, "misses": misses,
            "corpus": len(list(target.corpus.iterdir())), "replayed": replayed,
            "open": {stack: hashlib.sha256(path.read_bytes()).hexdigest()[:16]
                     for stack, path in found.items()}}


def add_up(old, name, fresh):
    before = old.get(name, {})
    known = {**before.get("findings", {}), **fresh["open"]}
    total = before.get("executions", 0) + fresh["executions"]
    return {"executions": total, "executions_per_second": fresh["executions_per_second"],
            "coverage": fresh["coverage"], "regions": fresh["regions"],
            "corpus": fresh["corpus"], "replayed_under_sanitizers": fresh["replayed"],
            "findings": known, "open": sorted(fresh["open"]), "misses": fresh["misses"]}


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--targets", default=",".join(TARGETS))
    parser.add_argument("--seconds", type=float, default=0)
    parser.add_argument("--executions", type=int, default=0)
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--folder", type=pathlib.Path,
                        default=pathlib.Path.home() / ".cache/figurine/fuzz")
    parser.add_argument("--output", type=pathlib.Path)
    options = parser.parse_args()
    names = options.targets.split(",")
    unknown = [name for name in names if name not in TARGETS]
    if unknown:
        parser.error(f"--targets: there is no {', '.join(unknown)}; there are {', '.join(TARGETS)}")
    if (options.seconds > 0) == (options.executions > 0):
        parser.error("either --seconds or --executions")
    folder = options.folder.resolve()
    if folder.is_relative_to(REPOSITORY):
        parser.error("--folder: must be outside of the checkout")
    build(folder, names, options.jobs)
    old = (results.read(options.output) or {}) if options.output else {}
    written = dict(old)
    with concurrent.futures.ThreadPoolExecutor(options.jobs) as pool:
        runs = {name: pool.submit(campaign, Target(folder, name), options.seconds,
                                  options.executions) for name in names}
        for name, run in runs.items():
            fresh = run.result()
            written[name] = add_up(old, name, fresh)
            print(f"{name:13} {fresh['executions']:>11,} executions, "
                  f"{fresh['executions_per_second']:9,.0f} a second, regions "
                  f"{100 * fresh['coverage']:5.1f} %, findings open: {len(fresh['open'])}",
                  flush=True)
            for stack in fresh["open"]:
                print(f"  {stack}", flush=True)
    of_targets = {name: written[name] for name in TARGETS if name in written}
    limit = (f"--seconds {options.seconds:g}" if options.seconds
             else f"--executions {options.executions}")
    summary = {**results.head(f"scripts/run tests/fuzz/campaign.py --targets {options.targets} "
                              f"{limit}"),
               "executions": sum(entry["executions"] for entry in of_targets.values()),
               "findings": sum(len(entry["findings"]) for entry in of_targets.values()),
               "findings_open": sum(len(entry["open"]) for entry in of_targets.values()),
               **of_targets}
    if options.output:
        results.write(options.output, summary)
    return 1 if summary["findings_open"] else 0


if __name__ == "__main__":
    sys.exit(main())
