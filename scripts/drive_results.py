"""Drives everything that docs/results.md tells of, and keeps each run's lines and each suite's report in docs/results.

    python -m scripts.drive_results [--only unseen/oracle nocrash] [--workers 2] [--keep]

A run that was stopped goes on, also on another machine of the same kind from the lines that are kept; an episode that
one suite shares with another is driven once. `--keep` drives nothing and keeps what is there. The HTML reports stay in
out/results.
"""

from __future__ import annotations

import argparse
import gzip
import json
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

from caldrive.agents.rows import MODELS
from caldrive.commands.baselines import TRAININGS
from caldrive.files import write_whole
from caldrive.provenance import code_version

ROOT = Path(__file__).parents[1]
OUT, KEPT = Path("out/results"), ROOT / "docs" / "results"
ORACLE = ["--agent", "oracle"]
AGENTS = {"oracle": ORACLE, "cal": ["--agent", "cal"]}
FAST = "scripts/begins_at_60.toml"  # who sees no sign drives as fast as before the first one
WITHOUT = {  # drivers who know the truth but for something
    "oracle-without-hazards": [*ORACLE, "--blind", "hazard_stop"],
    "oracle-without-distance": [*ORACLE, "--blind", "vehicle_distance"],
    "oracle-without-hazards-and-distance": [*ORACLE, "--blind", "hazard_stop", "--blind", "vehicle_distance"],
    "oracle-without-lights": [*ORACLE, "--blind", "red_light"],
    "oracle-without-signs": [*ORACLE, "--blind", "speed_sign", "--signs", "--controller", FAST],
    "oracle-with-signs": [*ORACLE, "--signs"],
}
# The paper's other systems: the network of each kind that ships, and every variant and seed that `caldrive baselines`
# makes.
SHIPPED = {kind: ["--agent", kind] for kind in ("mp", "cil", "rl")}
VARIANTS = {
    "cil-avoid-stopping": ["--agent", "cil", "--variant", "avoid-stopping"],
    "mp-auxiliary-camera": ["--agent", "mp", "--variant", "auxiliary-camera"],
}
TRAINED = {
    name: ["--agent", name.partition("-")[0], "--model", f"out/baselines/{name}/model.safetensors"]
    for name in TRAININGS
}
BY_THE_TRUTH = {
    f"{name}-by-the-truth": ["--agent", "rl-oracle", *words[2:]]
    for name, words in TRAINED.items()
    if name.startswith("rl-affordances")
}
SYSTEMS = {**AGENTS, **SHIPPED}
ALL_SYSTEMS = {**SYSTEMS, **VARIANTS, **TRAINED, **BY_THE_TRUTH}
SUITES = {  # who drives in each; those that come first are known to the later ones
    "dynamic": {**AGENTS, **WITHOUT},
    "unseen": {**AGENTS, **WITHOUT, **SHIPPED, **VARIANTS, **TRAINED, **BY_THE_TRUTH},
    "unseen-wide": AGENTS,
    "corl2017": SYSTEMS,
    "nocrash": AGENTS,
    "traffic-school": AGENTS,
    "corl2017-once": ALL_SYSTEMS,
    "nocrash-once": SYSTEMS,
}
KNOWN = {
    "corl2017": ("dynamic",), "traffic-school": ("nocrash",), "corl2017-once": ("corl2017", "dynamic"),
    "nocrash-once": ("nocrash",),
}  # fmt: skip


def chosen(only: list[str]) -> Iterator[tuple[str, str]]:
    """The suites and drivers that words such as `unseen/oracle` or `nocrash` name; all for none. Raises SystemExit for
    a word that names nothing."""
    known = {*SUITES, *(f"{suite}/{driver}" for suite, drivers in SUITES.items() for driver in drivers)}
    if unknown := sorted(set(only) - known):
        raise SystemExit(f"found --only {unknown[0]}, wanted a suite ({', '.join(SUITES)}) or SUITE/DRIVER: type one")
    for suite, drivers in SUITES.items():
        for driver in drivers:
            if not only or suite in only or f"{suite}/{driver}" in only:
                yield suite, driver


def network(suite: str, driver: str) -> Path | None:
    """The file of the network of one of the paper's other systems, None for another driver."""
    words = SUITES[suite][driver]
    if "--model" in words:
        return Path(words[words.index("--model") + 1])
    return MODELS / f"{words[1]}.safetensors" if words[1] in SHIPPED else None


def drive(suite: str, driver: str, workers: str) -> None:
    """Drives a suite, or what is left of it."""
    for name in (suite, *KNOWN.get(suite, ())):
        take_up(name, driver)
    known = [OUT / other / driver for other in KNOWN.get(suite, ()) if (OUT / other / driver).exists()]
    words = ["benchmark", "--suite", suite, *SUITES[suite][driver], "--workers", workers]
    words += ["--out", str(OUT / suite / driver), *(["--known", *map(str, known)] if known else [])]
    print("caldrive", *words, flush=True)
    subprocess.run([sys.executable, "-m", "caldrive", *words], check=True)


def take_up(suite: str, driver: str) -> None:
    """Unpacks the lines that are kept of a run of today's code, where there is no folder of it."""
    kept, folder = KEPT / suite / driver, OUT / suite / driver
    if folder.exists() or not (kept / "run.json").exists():
        return
    run = (kept / "run.json").read_bytes()
    if json.loads(run)["code"] == code_version():
        folder.mkdir(parents=True)
        write_whole(folder / "results.jsonl", gzip.decompress((kept / "results.jsonl.gz").read_bytes()))
        write_whole(folder / "run.json", run)


def keep(suite: str, drivers: list[str]) -> None:
    """Writes a suite's report, and keeps it with the lines of its drivers."""
    folders = [str(OUT / suite / driver) for driver in drivers]
    command = [sys.executable, "-m", "caldrive", "report", *folders, "--out", str(OUT / suite)]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    kept = KEPT / suite
    kept.mkdir(parents=True, exist_ok=True)
    report = (OUT / suite / "report.md").read_text()
    write_whole(kept / "report.md", report.replace(f"{ROOT}/", "").encode())  # as it is typed
    for driver in drivers:
        (kept / driver).mkdir(exist_ok=True)
        write_whole(kept / driver / "run.json", (OUT / suite / driver / "run.json").read_bytes())
        lines = gzip.compress((OUT / suite / driver / "results.jsonl").read_bytes(), mtime=0)
        write_whole(kept / driver / "results.jsonl.gz", lines)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--only", nargs="*", default=[])
    parser.add_argument("--workers", default="2")
    parser.add_argument("--keep", action="store_true")
    options = parser.parse_args()
    runs = list(chosen(options.only))
    for suite, driver in [] if options.keep else runs:
        if (file := network(suite, driver)) and not file.is_file():
            print(f"left out {suite}/{driver}: there is no {file}, see caldrive baselines", flush=True)
        else:
            drive(suite, driver, options.workers)
    for suite in dict.fromkeys(suite for suite, _ in runs):
        if drivers := [name for name in SUITES[suite] if (OUT / suite / name / "results.jsonl").exists()]:
            keep(suite, drivers)
    return 0


if __name__ == "__main__":
    sys.exit(main())
