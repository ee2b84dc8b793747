"""The schema may only grow: old packages stay readable, and old readers are not misled.

    schema_evolution_test.py FLATC

Holds formats/schema/package.fbs against every frozen schema of formats/schema/released: by flatc
--conform, and by a stricter rule, because flatc lets pass what changes a struct's bytes or what a
reader demands. Declarations stay as they were; only tables, enums and unions grow, at their end.
"""
import pathlib
import re
import subprocess
import sys
import tempfile
import unittest

SCHEMAS = pathlib.Path(__file__).resolve().parents[2] / "formats" / "schema"
FROZEN = sorted((SCHEMAS / "released").glob("*.fbs"))
FLATC = "flatc"

# What was changed, the text of it in today's schema, and what it becomes.
BREACHES = [
    ("a field removed", "  gaussians:uint;\n", ""),
    ("a field renumbered", "  gaussians:uint;", "  triangles:uint;\n  gaussians:uint;"),
    ("a field's type", "  gaussians:uint;", "  gaussians:ulong;"),
    ("a default other than zero", "  gaussians:uint;", "  gaussians:uint = 5;"),
    ("an enum value renumbered", "Validation = 1, Test = 2", "Validation = 2, Test = 1"),
    ("a kind renumbered", "Motion = 3", "Motion = 7"),
    ("an enum value removed", ", Upsample2 = 2", ""),
    ("a field that is required now", "  tool:string;  ", "  tool:string (required);  "),
    ("a field that may be absent now", "  noise:NoiseSchedule (required);",
     "  noise:NoiseSchedule;"),
    ("a struct that grew", "y:float; z:float; }", "y:float; z:float; w:float; }"),
    ("a longer array in a struct", "view_from_world:[float:12]", "view_from_world:[float:16]"),
    ("another root", "root_type Index", "root_type Blob"),
]


def declarations(text):
    """Declaration -> its members in order, without comments and spacing."""
    bare = re.sub(r"//[^\n]*", "", text)
    found = {"root": re.findall(r"root_type\s+(\w+)", bare)}
    pattern = r"\b(table|struct|enum|union)\s+(\w+)([^{]*)\{([^}]*)\}"
    for kind, name, base, members in re.findall(pattern, bare):
        lines = [re.sub(r"\s+", "", member) for member in re.split("[;,]", members)]
        found[f"{kind} {name}{base.strip()}"] = [line for line in lines if line]
    return found


def objections(frozen, schema):
    """Why this schema is no evolution of the frozen one; empty if it is."""
    command = [FLATC, "--conform", str(frozen), str(schema)]
    flatc = subprocess.run(command, capture_output=True, text=True, check=False)
    found = [] if flatc.returncode == 0 else [f"flatc: {flatc.stdout} {flatc.stderr}"]
    now = declarations(schema.read_text(encoding="utf-8"))
    for name, members in declarations(frozen.read_text(encoding="utf-8")).items():
        grows = name.startswith(("table ", "enum ", "union "))
        if (now.get(name, [])[:len(members)] if grows else now.get(name)) != members:
            found.append(f"{name} is not what {frozen.name} says")
    return found


class SchemaEvolution(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.changed = pathlib.Path(folder.name, "package.fbs")
        self.today = (SCHEMAS / "package.fbs").read_text(encoding="utf-8")

    def objections_to(self, before, after):
        self.assertEqual(self.today.count(before), 1, before)
        self.changed.write_text(self.today.replace(before, after), encoding="utf-8")
        return [objection for frozen in FROZEN for objection in objections(frozen, self.changed)]

    def test_todays_schema_grew_from_every_released_one(self):
        self.assertTrue(FROZEN)
        for frozen in FROZEN:
            self.assertEqual(objections(frozen, SCHEMAS / "package.fbs"), [])

    def test_growing_is_allowed(self):
        grown = self.objections_to("  gaussians:uint;\n", "  gaussians:uint;\n  triangles:uint;\n")
        self.assertEqual(grown, [])
        self.assertEqual(self.objections_to("Concat = 3 }", "Concat = 3, Add = 4 }"), [])

    def test_flatc_refuses_a_renumbered_field(self):
        found = self.objections_to("  gaussians:uint;", "  triangles:uint;\n  gaussians:uint;")
        self.assertIn("offsets differ for field: figurine.schema.Budget.gaussians", found[0])

    def test_refuses_what_breaks_a_reader(self):
        for what, before, after in BREACHES:
            with self.subTest(what):
                self.assertTrue(self.objections_to(before, after))


if __name__ == "__main__":
    FLATC = sys.argv.pop(1)
    unittest.main()
