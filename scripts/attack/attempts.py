"""A number and a seed give an attempt, always the same: by turns one made by hand, while there are any, and one that is
drawn."""

from __future__ import annotations

import random
from collections.abc import Sequence

from scripts.attack import by_hand, words
from scripts.attack.attempt import Attempt
from scripts.attack.formats import of_file
from scripts.attack.good import needed
from scripts.attack.oracles import why_bad
from scripts.attack.uses import USES

KINDS = (words.KIND, *dict.fromkeys(use.kind for use in USES), by_hand.CODE)
JSON_SHARE = 0.3  # of the command lines that ask for JSON
TRIES = 20  # until a change has changed something


class Attempts:
    """All attempts of some kinds by number, without end."""

    def __init__(self, seed: int, good: dict[str, bytes], kinds: Sequence[str] = KINDS) -> None:
        self.seed, self.good, self.kinds = seed, good, tuple(kinds)
        self._by_hand = [attempt for attempt in by_hand.attempts(good) if attempt.kind in kinds]
        random.Random(seed).shuffle(self._by_hand)  # a campaign that is cut short has seen some of each

    def __getitem__(self, number: int) -> Attempt:
        if number % 2 == 0 and number // 2 < len(self._by_hand):
            return self._by_hand[number // 2]
        rng = random.Random(f"{self.seed} {number}")
        attempt = self._random(rng.choice(self.kinds), rng)
        more = ("--json",) if rng.random() < JSON_SHARE else ()
        return Attempt(attempt.kind, (*attempt.arguments, *more), attempt.files, attempt.bad)

    def _random(self, kind: str, rng: random.Random) -> Attempt:
        if kind == words.KIND:
            return words.random_words(rng, self.good)
        if kind == by_hand.CODE:
            return by_hand.random_code(rng)
        use = rng.choice([use for use in USES if use.kind == kind])
        files = needed(use, self.good)
        targets = use.targets(list(files))
        ending = rng.choice(sorted({name.rpartition(".")[2] for name in targets}))  # else pictures crowd the rest out
        name = rng.choice([name for name in targets if name.endswith(ending)])
        for _ in range(TRIES):
            changed = of_file(name, files[name], rng)
            if changed != files[name]:
                break
        mends = use.line.startswith("collect") and name.endswith(".parquet")  # damaged episodes are recorded again
        return Attempt(kind, use.arguments, files | {name: changed}, "" if mends else why_bad(name, changed))
