"""Every command of README.md must exist, take the options that it is shown with, and work.

    readme_test.py FIGURINE FIGURINE_INSPECT FIGURINE_TRAIN

Runs the tools' commands in the order of the page, in a folder of their own, made small (see
SMALLER): a nano network for a few iterations from a few small pictures. What sets up, builds or
tests is only looked at: this test runs inside of it.
"""
import os
import pathlib
import re
import shlex
import subprocess
import sys
import tempfile
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
TOOLS = {}
SMALLER = [(r"--preset edge", "--preset nano"), (r"--(uv|network-size) 128", r"--\1 32"),
           (r"--minutes \d+", "--iterations 20"), (r"--size 512x512", "--size 64x64"),
           (r"(figurine-train capture.*)", r"\1 --views 6 --frames 10 --size 64x64"),
           (r"(figurine-train body.*)", r"\1 --shape-samples 30"),
           (r"(figurine bench.*)", r"\1 --frames 3"), (r"(figurine report.*)", r"\1 --frames 2"),
           (r"(figurine report samples/samplers.*)", r"\1 --seeds 1"),
           (r"(figurine render .*)(-o out/walk)", r"\1--frames 0:4 \2"),
           (r"(evaluate parity.*)", r"\1 --views 2")]


def commands():
    """The shell commands of the page, comments left out."""
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    lines = [
        line for block in re.findall(r"```sh\n(.*?)```", text, re.DOTALL)
        for line in block.replace("\\\n", " ").splitlines()
    ]
    return [
        command for command in (re.sub(r"(^|\s)#.*", "", line).strip() for line in lines) if command
    ]


def tool_commands():
    return [
        command.removeprefix("scripts/run ") for command in commands()
        if command.startswith("scripts/run figurine")
    ]


def help_of(words):
    run = subprocess.run([TOOLS[words[0]], *words[1:], "--help"], capture_output=True, text=True,
                         check=False)
    return run.stdout if run.returncode == 0 else ""


class Readme(unittest.TestCase):
    def test_shows_every_tool_and_both_commands(self):
        shown = "\n".join(commands())
        for words in [
                "scripts/demo", "scripts/test", "figurine-inspect",
                *(f"figurine {name}"
                  for name in "sample render splat export bench report selftest".split()),
                *(f"figurine-train {name}"
                  for name in "body motion capture avatar pack evaluate".split())
        ]:
            self.assertIn(words, shown)

    def test_scripts_and_linked_files_exist(self):
        text = (ROOT / "README.md").read_text(encoding="utf-8")
        for command in commands():
            script = ROOT / command.split()[0]
            self.assertTrue(os.access(script, os.X_OK), command)
        for link in re.findall(r"\]\(([^)#:]+)\)", text):
            self.assertTrue((ROOT / link).exists(), f"README.md links {link}")
        presets = (ROOT / "CMakePresets.json").read_text(encoding="utf-8")
        for preset in re.findall(r"--preset (dev|release|asan|tsan)\b", text):
            self.assertIn(f'"name": "{preset}"', presets)

    def test_tools_take_the_options_they_are_shown_with(self):
        for command in tool_commands():
            words = shlex.split(command)
            names = [word for word in words[1:] if re.fullmatch(r"[a-z]+", word)][:2]
            if words[0] == "figurine-inspect":
                names = []
            text = help_of([words[0], *names]) or help_of([words[0], *names[:1]])
            self.assertTrue(text, f"no help for: {command}")
            for option in [word for word in words if word.startswith("-")]:
                self.assertRegex(text, rf"(?<![\w-]){re.escape(option)}(?![\w-])",
                                 f"{option} of: {command}")

    def test_commands_work_in_the_order_of_the_page(self):
        with tempfile.TemporaryDirectory() as folder:
            for name in ("samples", "tests"):
                os.symlink(ROOT / name, pathlib.Path(folder, name))
            os.mkdir(pathlib.Path(folder, "out"))
            for command in tool_commands():
                small = command
                for pattern, replacement in SMALLER:
                    small = re.sub(pattern, replacement, small)
                words = shlex.split(small)
                run = subprocess.run([TOOLS[words[0]], *words[1:]], cwd=folder, capture_output=True,
                                     text=True, check=False)
                self.assertEqual(run.returncode, 0, f"{small}\n{run.stderr[-2000:]}")
                if "-o" in words:
                    output = pathlib.Path(folder, words[words.index("-o") + 1])
                    self.assertTrue(list(output.parent.glob(re.sub(r"%\d*d", "*", output.name))),
                                    f"{small}: wrote no {output.name}")


if __name__ == "__main__":
    TOOLS.update({pathlib.Path(path).name: path for path in sys.argv[1:4]})
    if sorted(TOOLS) != ["figurine", "figurine-inspect", "figurine-train"]:
        sys.exit("usage: readme_test.py FIGURINE FIGURINE_INSPECT FIGURINE_TRAIN")
    unittest.main(argv=sys.argv[:1])
