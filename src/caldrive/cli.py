"""The command line: parses, runs one command, prints what it found or what went wrong.

Exit codes: 0 for success, 2 for an error, 130 after Ctrl-C; 1 where what was looked at is not as it should be (a
damaged recording, a drive that goes otherwise than before, with --strict a goal that was not reached), or nobody reads
the answer.
"""

from __future__ import annotations

import errno
import json
import os
import re
import sys
from collections.abc import Sequence
from contextlib import suppress
from difflib import get_close_matches
from pathlib import Path
from typing import Any

import tyro
from tyro import _errors  # its one way to hear of a mistake before it is printed in a box; pinned in pyproject.toml

from caldrive import __version__
from caldrive.commands import GROUPS, VERBS, Answer, command_type, verb_kind, verb_words
from caldrive.config import from_toml
from caldrive.progress import only_answers_on_stdout, progress_bar, readable_width

DESCRIPTION = (
    "Conditional Affordance Learning for urban driving: one camera, six affordances, one controller. "
    "caldrive --version says which caldrive this is."
)
SHARED = "apt-get install libgl1 libxext6 libxrender1 libatomic1"  # on Debian, what SUMO needs and containers lack
FULL = (errno.ENOSPC, errno.EDQUOT)
FAILED, STOPPED = 2, 130  # exit codes
LONGEST_WORD = 1000  # letters of it that an error shows
STYLE = (tyro.conf.FlagCreatePairsOff, tyro.conf.DisallowNone)  # --json and no --no-json; --cap 20 and no --cap None


@readable_width()
def main(arguments: Sequence[str] | None = None) -> int:
    """Runs one command and returns its exit code."""
    words = sys.argv[1:] if arguments is None else list(arguments)
    if words == ["--version"]:
        return _answered(Answer({"version": __version__}, f"caldrive {__version__}"), as_json=False)
    try:
        command = parse(words)
        with only_answers_on_stdout(), progress_bar() as progress:
            answer: Answer = command.run(progress)
        return _answered(answer, command.json)
    except KeyboardInterrupt:
        _say("caldrive: stopped by Ctrl-C")
        return STOPPED
    except BrokenPipeError:  # whoever read the answer has gone
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1
    except Exception as error:  # the last door: nothing but one sentence gets through it
        if os.environ.get("CALDRIVE_TRACEBACK"):  # for those who look for the cause in the code
            raise
        return _failed(_sentence(error), "--json" in words)


def _answered(answer: Answer, as_json: bool) -> int:
    _print(answer, as_json)
    sys.stdout.flush()
    return answer.code


def _failed(sentence: str, as_json: bool) -> int:
    """Says what went wrong, to people and, where JSON was asked for, to programs. What stands in a file may have no
    end, and letters that change a terminal's colours, or that nobody can print."""
    sentence = re.sub(rf"(\S{{{LONGEST_WORD}}})\S+", r"\1...", sentence)
    sentence = "".join(letter if letter.isprintable() else repr(letter)[1:-1] for letter in sentence)
    _say(f"caldrive: {sentence}")
    if as_json:
        print(json.dumps({"error": sentence}))
    return FAILED


def _say(text: str) -> None:
    """A line on stderr, if anybody can hear it."""
    with suppress(OSError, ValueError, AttributeError):  # it may be closed, or not there at all
        print(text, file=sys.stderr)


def parse(arguments: Sequence[str]) -> Any:
    """The command that the words stand for. Raises ValueError with one sentence where they stand for none."""
    if unusable := [word for word in arguments if "\0" in word]:
        raise ValueError(f"found {unusable[0]!r}, wanted words without a null byte: type another")
    verb = verb_words(arguments)
    kinds = {verb: verb_kind(verb, _value(arguments, "--agent"))} if verb in VERBS else {}
    defaults = {verb: _defaults(kind, arguments) for verb, kind in kinds.items()}
    with _errors.on_parse_error(lambda event: _refuse(event, verb)):
        return tyro.cli(
            command_type(kinds, defaults), prog="caldrive", description=DESCRIPTION, args=arguments, config=STYLE
        )


def _defaults(kind: type[Any], arguments: Sequence[str]) -> Any:
    """A verb's options before the command line changes them: a preset's, and those in a TOML file. kind: its class."""
    presets = getattr(kind, "PRESETS", {})
    name = _value(arguments, "--preset") if presets else None
    file = _value(arguments, "--config") if hasattr(kind, "config") else None
    if name is not None and name not in presets:
        raise ValueError(
            f"found preset {name!r}, wanted one of {', '.join(presets)}: type --preset {next(iter(presets))}"
        )
    if name is not None:
        presets = dict.fromkeys(presets, presets[name])  # what the command line says goes before what a file says
    if file is None:
        return presets.get(name)
    return from_toml(Path(file), presets, presets.get(name, kind()))


def _value(arguments: Sequence[str], option: str) -> str | None:
    """What stands behind an option, if it is there; where it is there twice, the last counts, as for all options."""
    found = None
    for word, following in zip(arguments, [*arguments[1:], None], strict=True):
        if word == option:
            found = following
        elif word.startswith(f"{option}="):
            found = word.partition("=")[2]
    return found


def _refuse(event: Any, verb: str) -> None:
    """Raises ValueError with what the parser could not understand, in one sentence."""
    group = verb.partition(" ")[0]
    place = verb if verb in VERBS else group if group in GROUPS else ""
    mistake = _mistake(event, verb)
    raise ValueError(
        mistake if ": type " in mistake else f"{mistake}: type {' '.join(['caldrive', *place.split(), '--help'])}"
    )


def _mistake(event: Any, verb: str) -> str:
    name = event.argument.display_name() if getattr(event, "argument", None) is not None else "an option"
    match event:
        case _errors.UnrecognizedArgs() if verb not in VERBS:
            near = get_close_matches(" ".join(event.tokens[:1]), list(VERBS), 1)
            return f"found {event.tokens[0]!r}, wanted a verb" + (f" such as {near[0]}" if near else "")
        case _errors.UnrecognizedArgs():
            return f"found {' '.join(event.tokens)!r}, which is no option of caldrive {verb}, wanted one that it has"
        case _errors.MissingSubcommand():
            return f"found no verb, wanted one of {', '.join(VERBS)}"
        case _errors.MissingArgs():
            missing = ", ".join(one.arg.display_name() for one in event.missing_arguments)
            return f"found no {missing} behind caldrive {verb}, wanted it"
        case _errors.BadValue():
            return f"found {name} without a value, wanted one"
        case _errors.InstantiationFailure():
            reason = " ".join(str(event.message).split())
            if reason.startswith("found"):  # a whole sentence of the settings' own
                return reason
            return f"found that {name} cannot be ({reason}), wanted another value"
        case _errors.InvalidChoice():
            return f"found {name} {event.value}, wanted one of {', '.join(event.choices)}"
    return "found options that do not go together, wanted those that do"


def _sentence(error: Exception) -> str:
    """An error in one line."""
    text = " ".join(str(error).split())
    if isinstance(error, OSError) and error.errno in FULL:
        return f"found no room on the disk for {error.filename or 'a file'}, wanted some: make room, and type it again"
    if isinstance(error, OSError) and error.strerror:
        name = error.filename or "a file or folder"
        return f"found that {name} is no use ({error.strerror.lower()}), wanted one that is: give another"
    if isinstance(error, ImportError) and (missing := re.match(r"(\S+): cannot open shared object file", text)):
        how = f"on Debian type {SHARED}" if "sumo" in (error.name or "") else "install it"
        return f"found no {missing[1]} on this machine, wanted it for {error.name or 'a library'}: {how}"
    if isinstance(error, MemoryError):
        return "found too little memory for this, wanted more: ask for less, or close other programs"
    if isinstance(error, RuntimeError) and text.startswith("Symlink loop"):  # before Python 3.13
        return f"found a {text[0].lower()}{text[1:]}, wanted a path that leads somewhere: give another"
    of_libraries = isinstance(error, UnicodeError | RecursionError)
    if isinstance(error, ValueError | OSError | RuntimeError) and text and not of_libraries:
        return text
    kind = type(error).__name__
    return f"found a fault of the program ({kind}: {text}), wanted none: set CALDRIVE_TRACEBACK=1 to see where it is"


def _print(answer: Answer, as_json: bool) -> None:
    if as_json:
        print(json.dumps(answer.values, allow_nan=False))
        return
    from rich.console import Console

    console = Console()
    if not console.is_terminal:
        console.width = 200  # a table takes what it needs; at the 80 columns that a file gets it would lose digits
    console.print(answer.shown, highlight=False, soft_wrap=isinstance(answer.shown, str))
