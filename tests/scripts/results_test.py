"""What scripts/experiments/results.py makes of a report: short lines, six digits, quantiles, CSV;
and that the files of docs/results are small enough to be read in a review."""
import json
import pathlib
import sys
import tempfile
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "scripts/experiments"))
sys.dont_write_bytecode = True

import generation_files
import population_report
import results

MAX_BYTES = 128 << 10
MAX_LIST = 40  # more entries of numbers than that are quantiles, or a CSV file


def lists_of(value):
    if isinstance(value, (dict, list)):
        if isinstance(value, list):
            yield value
        for entry in value.values() if isinstance(value, dict) else value:
            yield from lists_of(entry)


class Results(unittest.TestCase):
    def test_keep_values_in_lines_that_fit(self):
        report = {
            "psnr_db": 29.512345678,
            "bytes": 17427776,
            "rows": [{"name": "row", "mean": 1 / 3, "missing": None}] * 3,
            "series": [k / 7 for k in range(200)],
            "deep": {"er": {"words": [], "none": {}, "numbers": {str(k): k for k in range(60)}}},
        }
        text = results.text(results.rounded(report))
        back = json.loads(text)
        self.assertEqual(back, results.rounded(report))
        self.assertEqual((back["psnr_db"], back["bytes"]), (29.5123, 17427776))
        self.assertLessEqual(max(map(len, text.splitlines())), results.COLUMNS)
        self.assertIn('{"name": "row", "mean": 0.333333, "missing": null}', text)

    def test_quantiles_of_a_line(self):
        found = results.quantiles([*range(100, -1, -1), None])
        expected = {"min": 0, "p5": 5, "p25": 25, "median": 50, "p75": 75, "p95": 95, "max": 100}
        self.assertEqual(found, expected | {"mean": 50, "count": 101})
        self.assertEqual(results.quantiles([7])["p95"], 7)
        self.assertIsNone(results.quantiles([]))

    def test_rows_come_back_from_csv(self):
        with tempfile.TemporaryDirectory() as folder:
            path = pathlib.Path(folder, "rows.csv")
            rows = [{"name": "a, b", "value": 2 / 3}, {"name": "c", "value": None}]
            results.write_rows(path, rows)
            expected = [{"name": "a, b", "value": "0.666667"}, {"name": "c", "value": ""}]
            self.assertEqual(results.read_rows(path), expected)
            results.write_rows(path, [])
            self.assertEqual((path.exists(), results.read_rows(path)), (False, []))

    def test_spectrum_keeps_what_the_first_directions_hold(self):
        part = {"variance_share": [0.5, 0.25, 0.125, 0.0625]}
        spectrum = {"tokens": [{"name": "shape", "variance_share": [0.75]}], "whole": part}
        rows = population_report.shortened_spectrum(spectrum)
        self.assertEqual(part, {"variance_of_first": {"1": 0.5, "2": 0.75, "4": 0.9375}})
        self.assertEqual(rows[0], {"direction": 1, "shape": "0.75", "whole": "0.5"})
        self.assertEqual(rows[3], {"direction": 4, "shape": None, "whole": "0.0625"})

    def test_spectrum_has_kinds_and_quantiles_of_patches(self):
        patch = {"entries": 30, "directions_for": {"90": 4}, "participation_ratio": 2.5}
        names = ("static.0.1.2", "static.0.1.3")
        patches = [patch | {"name": name, "variance_share": [0.5, 0.5]} for name in names]
        spectrum = {
            "tokens": [{"name": "shape", "variance_share": [1.0]}, *patches],
            "by_kind": {"map": {"variance_share": [0.75, 0.25]}},
            "whole": {"variance_share": [0.625, 0.25]},
        }
        rows = population_report.shortened_spectrum(spectrum)
        self.assertEqual(rows[1], {"direction": 2, "shape": None, "map": "0.25", "whole": "0.25"})
        self.assertEqual([token["name"] for token in spectrum["tokens"]], ["shape"])
        self.assertEqual(spectrum["by_kind"]["map"]["variance_of_first"], {"1": 0.75, "2": 1.0})
        self.assertEqual(spectrum["patches"]["count"], 2)
        self.assertEqual(spectrum["patches"]["directions_for_90"]["median"], 4)

    def test_population_means_are_there_where_they_were_measured(self):
        quality = {"psnr_db": 20.0, "flat_psnr_db": 15.0, "head_psnr_db": 18.0}
        groups = ("views", "poses", "poses_interleaved", "poses_block")
        row = {"quality": {"held_out_" + group: dict(quality) for group in groups}}
        row["quality"]["difference_psnr_db"] = 19.0
        old = population_report.spread([row])
        self.assertEqual(population_report.mean_of(old, "above_flat_db"), 5.0)
        self.assertIsNone(population_report.mean_of(old, "bust_head_psnr_db"))
        poses = {"bust_head_psnr_db": 22.0, "highpass_correlation": 0.5}
        row["quality"]["held_out_poses"] |= poses
        row["quality"]["held_out_views"]["highpass_ratio"] = 0.25
        new = population_report.spread([row])
        self.assertEqual(population_report.mean_of(new, "bust_head_psnr_db"), 22.0)
        self.assertEqual(population_report.mean_of(new, "highpass_correlation"), 0.5)
        self.assertEqual(new["view_highpass_ratio"]["mean"], 0.25)
        self.assertLessEqual(set(population_report.MEANS), set(new))

    def test_entropy_of_runs_that_were_not_judged_again_stays(self):
        with tempfile.TemporaryDirectory() as folder:
            output = pathlib.Path(folder)
            level = {"dimension_snr": 1.0, "nats": 2.0}

            def write(population, **levels):
                entropies = {name: {"undecided_nats": 3.0} | more for name, more in levels.items()}
                runs = [{"name": n, "posterior_entropy": e} for n, e in entropies.items()]
                generation_files.write_generation(output, {population: {"runs": runs}})

            write("edge", a={"levels": [level]}, b={})
            write("other", c={"levels": [level]})
            write("edge", a={}, b={"levels": [level] * 2})
            rows = results.read_rows(output / "generation_entropy.csv")
            self.assertEqual([row["run"] for row in rows], ["a", "b", "b", "c"])
            self.assertNotIn("levels", (output / "generation.json").read_text())

    def test_every_population_but_that_of_the_shipped_sampler_has_a_file(self):
        with tempfile.TemporaryDirectory() as folder:
            output = pathlib.Path(folder)
            for name in ("edge", "other", "shipped"):
                generation_files.write_generation(output, {name: {"is": name}})
            generation_files.write_generation(output, {"other": {"is": "new"}})
            self.assertEqual(results.read(output / "generation.json"),
                             {"edge": {"is": "edge"}, "shipped": {"is": "shipped"}})
            self.assertEqual(results.read(output / "generation_other.json"),
                             {"other": {"is": "new"}})
            self.assertEqual(set(generation_files.read_generation(output)),
                             {"edge", "other", "shipped"})

    def test_files_are_small_enough_to_review(self):
        files = sorted((ROOT / "docs/results").glob("*.json"))
        self.assertTrue(files)
        for file in files:
            self.assertLess(file.stat().st_size, MAX_BYTES, file.name)
            for entries in lists_of(json.loads(file.read_text())):
                if all(isinstance(entry, (int, float)) for entry in entries):
                    self.assertLessEqual(len(entries), MAX_LIST, f"{file.name}: {entries[:3]}...")


if __name__ == "__main__":
    unittest.main()
