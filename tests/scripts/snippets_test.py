"""The C and C++ that pages show compiles against the public headers.

    snippets_test.py CC CXX

A block of ```c or ```cpp stands for a file of its own; one that a page goes on with includes again
what it needs. Looks at every page of the repository.
"""
import pathlib
import re
import subprocess
import sys
import tempfile
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
INCLUDES = [f"-I{ROOT / folder}" for folder in ("runtime/include", "formats/include")]
COMPILERS = {}  # language: command
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]


def snippets():
    """(page, line, language, text) of every block."""
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        for match in re.finditer(r"^```(c|cpp)\n(.*?)^```$", text, re.DOTALL | re.MULTILINE):
            line = text.count("\n", 0, match.start()) + 2
            yield page.relative_to(ROOT), line, match.group(1), match.group(2)


def compile_text(language, text):
    """What the compiler complains about."""
    with tempfile.NamedTemporaryFile("w", suffix=f".{language}", encoding="utf-8") as file:
        file.write(text)
        file.flush()
        run = subprocess.run([*COMPILERS[language], "-fsyntax-only", *INCLUDES, file.name],
                             capture_output=True, text=True, check=False)
    return run.stderr if run.returncode != 0 else ""


class Snippets(unittest.TestCase):
    def test_every_snippet_compiles(self):
        for page, line, language, text in snippets():
            with self.subTest(page=page, line=line):
                self.assertEqual(compile_text(language, text), "")

    def test_the_front_door_shows_both_languages(self):
        shown = {(str(page), language) for page, _, language, _ in snippets()}
        for page in ("README.md", "docs/embedding.md"):
            for language in ("c", "cpp"):
                self.assertIn((page, language), shown)

    def test_a_wrong_snippet_is_found(self):
        self.assertIn("fig_fly", compile_text("c", '#include "figurine.h"\nint f = fig_fly();\n'))
        self.assertIn("fly", compile_text("cpp", '#include "figurine/renderer.h"\n'
                                                 "void f(figurine::Renderer& r) { r.fly(); }\n"))


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit("usage: snippets_test.py CC CXX")
    strict = ["-Wall", "-Wextra", "-Werror", "-Wno-unused-parameter"]
    COMPILERS = {"c": [sys.argv[1], "-std=c11", "-pedantic", *strict],
                 "cpp": [sys.argv[2], "-std=c++20", *strict, "-Wno-missing-field-initializers"]}
    del sys.argv[1:]
    unittest.main()
