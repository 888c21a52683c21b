"""What each affordance is worth: drives the suite `dynamic` with all of them, and blind to some.

    python -m scripts.blind_drivers --out out/blind [--agent oracle] [--workers 2]

Each driver is a run of its own, and a run that was stopped goes on. Prints the table of docs/results.md.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

from caldrive.benchmark.metrics import red_light_counts, speeding, succeeded, touch_rates
from caldrive.benchmark.report.runs import load_run
from caldrive.benchmark.suites import TrialResult
from caldrive.results import InfractionKind

# What each driver is blind to, and whether it obeys the signs instead of a cap.
DRIVERS: dict[str, tuple[tuple[str, ...], bool]] = {
    "sees": ((), False),
    "hazards": (("hazard_stop",), False),
    "distance": (("vehicle_distance",), False),
    "hazards-and-distance": (("hazard_stop", "vehicle_distance"), False),
    "lights": (("red_light",), False),
    "signs": (("speed_sign",), True),
    "sees-signs": ((), True),
}
HEAD = (
    "| driver | town | km | goals | person touched every km | car touched every km (own fault) | object | "
    "red lights run | too fast % of time |\n|---|---|---|---|---|---|---|---|---|"
)


def row(name: str, town: str, results: Sequence[TrialResult]) -> str:
    """A row of the table: a driver in a town."""
    rates = {rate.kind: rate for rate in touch_rates(results)}
    person, car, thing = (
        rates[kind]
        for kind in (InfractionKind.COLLISION_PERSON, InfractionKind.COLLISION_CAR, InfractionKind.COLLISION_OBJECT)
    )
    met, run = red_light_counts(results)
    share, worst = speeding(results)
    goals = f"{sum(map(succeeded, results))} of {len(results)}"
    cells = (
        name, town, f"{person.km:.0f}", goals, f"{person.km_between} ({person.count})",
        f"{car.km_between} ({car.count}, {car.own} own)", f"{thing.count}", f"{run} of {met}",
        f"{100 * share:.1f} (at most {worst:.0f} km/h)",
    )  # fmt: skip
    return f"| {' | '.join(cells)} |"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--agent", default="oracle")
    parser.add_argument("--suite", default="dynamic")
    parser.add_argument("--workers", default="2")
    parser.add_argument("--only", nargs="*", default=list(DRIVERS))
    options = parser.parse_args()
    print(HEAD)
    for name in options.only:
        blind, signs = DRIVERS[name]
        words = ["benchmark", "--suite", options.suite, "--agent", options.agent, "--workers", options.workers]
        words += [word for affordance in blind for word in ("--blind", affordance)] + ["--signs"] * signs
        command = [sys.executable, "-m", "caldrive", *words, "--out", str(options.out / name)]
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
        results = load_run(options.out / name).results
        for town in dict.fromkeys(result.trial.scenario.town for result in results):
            print(row(name, town, [result for result in results if result.trial.scenario.town == town]), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
