"""Every option of the command line has its keyword, and every keyword its option or its reason."""

from __future__ import annotations

import inspect
import json

import ffid
import pytest
from ffid import _ffid

TABLE = json.loads(_ffid.options_table())

# What a program in memory has no use for: printing.
NEVER = {"json", "quiet"}

# The functions that stand for a command together, options without a keyword (files in place of objects), and keywords that are objects in
# place of options.
COMMANDS: dict[str, tuple[list[object], set[str], set[str]]] = {
    "check": ([ffid.Mission.load], set(), {"path"}),
    "init": ([ffid.Mission.from_urdf], set(), {"urdf"}),
    "modes": ([ffid.Mission.modes, ffid.Mission.load], set(), {"q", "path"}),
    "simulate": ([ffid.Mission.simulate, ffid.Mission.load], {"out", "force"}, {"q", "name", "path"}),
    "predict": ([ffid.Result.predict, ffid.Mission.load], {"out", "force"}, {"q", "path"}),
    "excite": ([ffid.plan_excitation], {"out", "force", "png"}, {"mission", "progress", "cost", "candidates"}),
    "plan": ([ffid.preflight, ffid.Mission.load], {"out", "force", "png"}, {"mission", "q", "path"}),
    "doctor": ([ffid.doctor, ffid.Record.read], {"record"}, {"mission", "records", "path"}),
    "identify": (
        [ffid.identify, ffid.Record.read, ffid.Result.save],
        {"record", "out"},
        {"mission", "progress", "path", "folder", "uncertain"},
    ),
    "validate": (
        [ffid.Result.validate, ffid.Record.read],
        {"out", "force", "png"},
        {"progress", "path", "mission"},
    ),
    "show": ([ffid.Mission.show, ffid.Mission.load], {"out", "force"}, {"path"}),
    "selfcheck": ([ffid.Mission.selfcheck, ffid.Mission.load], set(), {"path"}),
    "convert": ([ffid.convert], set(), {"source", "to"}),
}
# Words for a shell, and a schema, which has no options.
BARE = {"completions", "schema"}


def test_every_command_has_its_function() -> None:
    assert {o["command"] for o in TABLE} - set(COMMANDS) - BARE == set()
    assert callable(ffid.schema)


def keywords(functions: list[object]) -> set[str]:
    names = {p for f in functions for p in inspect.signature(f).parameters}  # type: ignore[arg-type]
    return {n.rstrip("_").replace("_", "-") for n in names - {"self", "cls"}}


@pytest.mark.parametrize("command", COMMANDS)
def test_options_and_keywords_are_the_same(command: str) -> None:
    functions, files, objects = COMMANDS[command]
    options = {o["option"] for o in TABLE if o["command"] == command} - NEVER - files
    assert options, command
    given = keywords(functions) - objects
    assert options - given == set(), "options without a keyword"
    assert given - options == set(), "keywords without an option"


def test_an_option_of_several_functions_is_the_same_in_each() -> None:
    """Type, default and words of an option are given where a function takes it; they agree wherever it means one thing."""
    judge = [ffid.identify, ffid.doctor, ffid.Result.validate]
    shared = {o["option"] for o in TABLE if o["command"] == "doctor"} & {o["option"] for o in TABLE if o["command"] == "validate"}
    shared = {o.replace("-", "_") for o in shared} & set(inspect.signature(ffid.doctor).parameters)
    assert len(shared) == 10
    for name in shared:
        kinds = {(p.annotation, p.default) for f in judge for p in [inspect.signature(f).parameters[name]]}
        assert len(kinds) == 1, name


def test_one_name_stands_for_a_list_of_one(mission: ffid.Mission) -> None:
    file = mission.file
    assert ffid.Mission.load(file, allow="stuck")._core.allow == ["stuck"]


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
    assert "'starts <N>'" in str(e.value) and e.value.next_step == "see `ffid identify --help`"
