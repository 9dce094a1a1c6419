"""Every option of the command line has its keyword, and every keyword its option or its reason."""

from __future__ import annotations

import inspect
import json

import ffid
import pytest
from ffid import _ffid

TABLE = json.loads(_ffid.options_table())

# What a program in memory has no use for: printing, and files in place of objects.
NEVER = {"json", "quiet"}
READING = {"resample", "gaps", "drop-repeated", "ignore", "topic", "stamps", "max-rows", "max-bytes"}

# The functions that stand for a command together, options without a keyword, and keywords that are objects in place of options.
COMMANDS = {
    "check": ([ffid.Mission.load], set(), {"path"}),
    "init": ([ffid.Mission.from_urdf], set(), {"urdf"}),
    "modes": ([ffid.Mission.modes, ffid.Mission.load], set(), {"q", "path"}),
    "simulate": ([ffid.Mission.simulate, ffid.Mission.load], {"out", "force"}, {"q", "name", "path"}),
    "predict": ([ffid.Result.predict, ffid.Mission.load], {"out", "force"}, {"q", "path"}),
    "excite": ([ffid.plan_excitation], {"out", "force", "png"}, {"mission", "progress"}),
    "plan": ([ffid.preflight, ffid.Mission.load], {"out", "force", "png"}, {"mission", "q", "path"}),
    "identify": (
        [ffid.identify, ffid.Record.read, ffid.Result.save],
        # Records in memory have no files to be named by.
        {"record", "out", "without"},
        {"mission", "progress", "path", "folder"},
    ),
    "validate": (
        [ffid.Result.validate, ffid.Record.read],
        {"out", "force", "png"},
        {"progress", "path", "mission"},
    ),
}


def keywords(functions: list[object]) -> set[str]:
    names = {p for f in functions for p in inspect.signature(f).parameters}  # type: ignore[arg-type]
    return {n.replace("_", "-") for n in names - {"self", "cls"}}


@pytest.mark.parametrize("command", COMMANDS)
def test_options_and_keywords_are_the_same(command: str) -> None:
    functions, files, objects = COMMANDS[command]
    options = {o["option"] for o in TABLE if o["command"] == command} - NEVER - files
    assert options, command
    given = keywords(functions) - objects
    assert options - given == set(), "options without a keyword"
    assert given - options == set(), "keywords without an option"


def test_choices_of_the_command_line_are_those_of_the_annotations() -> None:
    hints = inspect.signature(ffid.identify).parameters
    for option in ("method", "loss", "clocks", "compare"):
        row = next(o for o in TABLE if o["command"] == "identify" and o["option"] == option)
        assert row["choices"], option
        for choice in row["choices"]:
            assert f"'{choice}'" in hints[option].annotation.replace('"', "'"), (option, choice)


def test_an_option_that_is_refused_names_itself(mission: ffid.Mission, record: ffid.Record) -> None:
    with pytest.raises(ffid.ConfigError) as e:
        ffid.identify(mission, record, starts=0)
    assert (e.value.code, e.value.exit_code) == ("Config::Option", 2)
    assert "--starts" in str(e.value)
