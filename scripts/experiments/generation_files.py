"""What samplers were found to be worth, in docs/results: a population an object, by its name.

generation.json has those of the sampler that ships ("shipped", and the population it learnt from),
generation_NAME.json, likewise under its name, that of every other population: a file each, small
enough to be read in a review. generation_entropy.csv has the posterior entropies of all runs, level
by level.
"""

import results

MAIN = ("edge", "shipped")  # the others have files of their own


def path_of(output, name):
    return output / ("generation.json" if name in MAIN else f"generation_{name}.json")


def read_generation(output):
    """All objects of the folder."""
    generation = {}
    for path in sorted(output.glob("generation*.json")):
        generation |= results.read(path)
    return generation


def write_generation(output, generation):
    """The files of these objects, sorted; others stay. A run whose levels are not in its report
    keeps the rows that it had, and so do populations that are not among these."""
    path = output / "generation_entropy.csv"
    earlier = results.read_rows(path)
    rows = []
    for population in sorted({row["population"] for row in earlier} | set(generation)):
        if population not in generation:
            rows += [row for row in earlier if row["population"] == population]
            continue
        for run in generation[population].get("runs", []):
            entropy = run.get("posterior_entropy")
            if entropy is None:
                continue
            key = {"population": population, "run": run["name"]}
            levels = entropy.pop("levels", None)
            if levels is None:
                rows += [row for row in earlier if key.items() <= row.items()]
            else:
                rows += [key | level for level in levels]
    results.write_rows(path, rows)
    files = {}
    for name, report in generation.items():
        files.setdefault(path_of(output, name), {})[name] = report
    for file, own in files.items():
        results.write(file, sorted_keys((results.read(file) or {}) | own))


def sorted_keys(value):
    if isinstance(value, dict):
        return {key: sorted_keys(value[key]) for key in sorted(value)}
    return [sorted_keys(entry) for entry in value] if isinstance(value, list) else value
