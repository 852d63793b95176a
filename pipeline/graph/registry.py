"""Names to stage classes: built in, installed by others, named in the environment, or given by their full path.

A third party's stage is named `role.name`, as `match.gradient`; a value of which omninav has a folder is named alike:

* installed: an entry point of the group `omninav.stages`, `"match.gradient" = "package.module:GradientMatch"`;
* not installed: `OMNINAV_STAGES="match.gradient=path/to/gradient.py:GradientMatch"` (several with commas);
* in a config file or on the command line: `_target_: package.module.GradientMatch`, or
  `path/to/gradient.py:GradientMatch`.

The working directory is on Python's path only while such a name is resolved that is not installed. What a run's folder
names is resolved only where the stage is listed, or its name was typed (see `only_listed`); a program that it names is
run only where it was typed (`refuse_untyped`).
"""

import functools
import importlib
import importlib.metadata
import importlib.util
import inspect
import os
import pkgutil
import re
import shlex
import sys
import tokenize
import traceback
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, replace
from pathlib import Path
from types import ModuleType
from typing import Any, TypeGuard

from omninav.pipeline.files import digest_text, user_path

from .parameters import BadStage, first_line
from .problems import BadInput, cut
from .signature import signature
from .stage import Source, Stage
from .value import Value

BUILT_IN = "omninav.stages"
ENVIRONMENT = "OMNINAV_STAGES"
ENTRY_POINTS = "omninav.stages"
SOURCE = "__omninav_source__"
"""The name under which a module that is loaded from a file keeps its text: the file may change afterwards."""
OF_A_FILE = "omninav_plugin_"
"""Beginning of the name of a module that is loaded from a file; the file's name and a digest of its path follow."""
SETTING = re.compile(r"[+~]*[\w./]+=")
"""The beginning of a word that sets something."""


class UnknownStage(Exception):
    """A name behind which there is no stage class. The message states what is there instead."""


@dataclass(frozen=True)
class Entry:
    """A row of the registry: a stage, or what is wrong with a plugin.

    `name` is `role.name`; `target` what `_target_` would hold; `origin` is "built in", "installed" or "environment".
    """

    name: str
    target: str
    origin: str
    summary: str = ""
    problem: str = ""

    @property
    def role(self) -> str:
        """The folder, or the plugin name's first part: which config group the stage belongs to."""
        return self.name.partition(".")[0]


def resolve(target: str) -> type[Stage]:
    """The stage class behind a `_target_`.

    Raises `UnknownStage` where the module cannot be imported, the name is not in it, or it is not a stage. Whatever
    the name leads to is looked at, never called. Raises `BadInput` for what is not to be imported (`only_listed`).
    """
    thing = _thing(target)
    if not _is_stage(thing):
        raise UnknownStage(f"'{target}' is not a Stage; only stages can be nodes")
    return thing


def module_of(target: str) -> str:
    """The module, or the file, that a target's class is in; empty where it names none."""
    return target.rpartition(":" if ":" in target else ".")[0]


def _thing(target: str) -> Any:
    named = {entry.name: entry.target for entry in plugins() if not entry.problem}
    target = named.get(target, target)
    module_name = module_of(target)
    if not module_name:
        raise UnknownStage(f"'{target}' is no full name; write package.module.Class or path/to/file.py:Class")
    typed = _TYPED.get()
    if typed is not None and not {target, module_name} & {*typed} and not is_listed(target):
        again = f"if you trust it, name it behind the folder: … FOLDER {module_name}"
        raise BadInput(f"{cut(target)} is code that `omninav stages` does not list, and is not run unasked; {again}")
    module, class_name = _load(module_name), target[len(module_name) + 1 :]
    thing = getattr(module, class_name, None)
    if thing is None:
        here = [name for name, value in vars(module).items() if _is_stage(value)]
        raise UnknownStage(f"module '{module_name}' has no '{class_name}'; its stages: {', '.join(here) or 'none'}")
    return thing


_TYPED: ContextVar[Collection[str] | None] = ContextVar("typed", default=None)


@contextmanager
def only_listed(typed: Collection[str]) -> Iterator[None]:
    """Resolve only names of stages that are listed (`is_listed`), and those whose module or file the user `typed`.

    For configurations from elsewhere, as in a run's folder: their code is not imported unasked. Raises `BadInput` for a
    setting, which would change nothing.
    """
    for word in typed:
        if SETTING.match(word):
            raise BadInput(f"{cut(word)}: a run that was started keeps its settings; leave it out, or start another")
    token = _TYPED.set(typed)
    try:
        yield
    finally:
        _TYPED.reset(token)


def refuse_untyped(command: str) -> None:
    """Raise `BadInput` for a program that a configuration from elsewhere names (`only_listed`) and nobody typed.

    Call it where the program is only named, too: workers of an experiment no longer know where it came from.
    """
    typed = _TYPED.get()
    if typed is not None and command not in typed:
        again = f"if you trust it, type it again: omninav resume FOLDER {shlex.quote(command)}"
        raise BadInput(f"{cut(command)} is a program, and is not run unasked; {again}")


def is_listed(target: str) -> bool:
    """Tells whether a target is of omninav itself, or one that an entry point or the environment offers."""
    own = target.startswith(f"{BUILT_IN}.") and all(part.isidentifier() for part in target.replace(":", ".").split("."))
    return own or any(target in (entry.name, entry.target) for entry in plugins() if not entry.problem)


def _is_stage(thing: Any) -> TypeGuard[type[Stage]]:
    return inspect.isclass(thing) and issubclass(thing, Stage) and thing not in (Stage, Source)


def _load(module_name: str) -> ModuleType:
    try:
        if module_name.endswith(".py"):
            with _here_on_the_path():
                return _load_file(Path(module_name))
        if module_name in sys.modules or importlib.util.find_spec(module_name.partition(".")[0]) is not None:
            return importlib.import_module(module_name)
        with _here_on_the_path():
            return importlib.import_module(module_name)
    except (UnknownStage, KeyboardInterrupt):
        raise
    except BaseException as error:  # a plugin may raise anything while it is imported
        files = {module_name, str(user_path(module_name).resolve())}
        lines = [frame.lineno for frame in traceback.extract_tb(error.__traceback__) if frame.filename in files]
        what = f"cannot be imported{f', line {lines[-1]}' if lines else ''}: {type(error).__name__}: {error}"
        if "relative import" in str(error):
            what += f"; outside of omninav write absolute imports, as `from {BUILT_IN}.… import …`"
        raise UnknownStage(f"module '{module_name}' {what}") from None


@contextmanager
def _here_on_the_path() -> Iterator[None]:
    """The working directory as the last place where modules are found."""
    here = os.getcwd()
    if here in sys.path:
        yield
        return
    sys.path.append(here)
    importlib.invalidate_caches()
    try:
        yield
    finally:
        sys.path.remove(here)


def _load_file(path: Path) -> ModuleType:
    path = user_path(path).resolve()
    if not path.is_file():
        raise UnknownStage(f"there is no file {path}")
    with tokenize.open(path) as file:
        source = file.read()
    name = f"{OF_A_FILE}{path.stem}_{digest_text(str(path))[:8]}"
    before = sys.modules.get(name)
    if before is None or getattr(before, SOURCE) != source:
        spec = importlib.util.spec_from_file_location(name, path)
        if spec is None:
            raise UnknownStage(f"{path} cannot be read as a Python module")
        module = importlib.util.module_from_spec(spec)
        setattr(module, SOURCE, source)
        sys.modules[name] = module
        try:
            exec(compile(source, path, "exec"), vars(module))
        except BaseException:
            del sys.modules[name]
            raise
    return sys.modules[name]


@functools.cache
def _installed(path: tuple[str, ...]) -> tuple[Entry, ...]:
    """Stages of installed distributions; looking through them takes as long as everything else, so once will do."""
    points = sorted(importlib.metadata.entry_points(group=ENTRY_POINTS), key=lambda point: point.name)
    targets = {point.name: sorted({each.value for each in points if each.name == point.name}) for point in points}
    found = []
    for name, several in targets.items():
        entry = _plugin(name, several[0], "installed")
        if "." not in name:
            entry = replace(
                entry, problem=f"entry point '{name}': its package must name it role.name, as in match.{name}"
            )
        elif len(several) > 1:
            both = " and ".join(several)
            entry = replace(entry, problem=f"'{name}' is offered by several packages ({both}); uninstall all but one")
        found.append(entry)
    return tuple(found)


def plugins() -> list[Entry]:
    """Stages that others offer, from installed entry points and from the environment; none is imported for this."""
    found = list(_installed(tuple(sys.path)))
    given = [text.strip() for text in os.environ.get(ENVIRONMENT, "").split(",")]
    for item in filter(None, given):
        name, equals, target = item.partition("=")
        if not equals or "." not in name or ":" not in target:
            wanted = "write role.name=package.module:Class or role.name=path/to/file.py:Class"
            found.append(
                Entry(item, "", "environment", problem=f"'{item}' in {ENVIRONMENT} is not understood; {wanted}")
            )
            continue
        entry = _plugin(name, target, "environment")
        others = sorted({other.partition("=")[2] for other in given if other.partition("=")[0] == name} - {target})
        if others:
            both = " and ".join([target, *others])
            entry = replace(entry, problem=f"'{name}' is {both} in {ENVIRONMENT}; leave all but one out")
        found.append(entry)
    return found


def _plugin(name: str, target: str, origin: str) -> Entry:
    """The row of a plugin, with a problem where omninav has a file of its name, which would be taken in its place."""
    role, _, own = name.partition(".")
    taken = _own_module(role, own) is not None
    problem = f"'{name}' is of omninav itself; give the {origin} one another name" if taken else ""
    return Entry(name, target, origin, problem=problem)


def entries() -> Iterator[Entry]:
    """All stages that can be used now, built in and third parties'; a broken plugin is a row with its problem."""
    yield from built_in()
    yield from map(_imported, plugins())


def offered(role: str) -> list[Entry]:
    """Import what others offer under the name of a folder of omninav, stages or values; a row for each."""
    return [_imported(entry) for entry in plugins() if entry.role == role]


def _imported(entry: Entry) -> Entry:
    """A plugin with its class's description, or with its problem."""
    if entry.problem:
        return entry
    try:
        thing = _thing(entry.target)
        is_value = inspect.isclass(thing) and issubclass(thing, Value)  # as a folder may hold in place of stages
        summary = first_line(thing) if is_value else signature(resolve(entry.target)).summary
        return Entry(entry.name, entry.target, entry.origin, summary)
    except (UnknownStage, BadStage) as error:
        return Entry(entry.name, entry.target, entry.origin, problem=str(error))


def built_in() -> Iterator[Entry]:
    """The stages of omninav itself, in the order of folders and files."""
    package = importlib.import_module(BUILT_IN)
    for module_info in sorted(pkgutil.walk_packages(package.__path__, BUILT_IN + "."), key=lambda info: info.name):
        if not module_info.ispkg:
            yield from _entries_of(module_info.name)


def is_role(name: str) -> bool:
    """Tells whether omninav itself has stages of that role."""
    return name.isidentifier() and importlib.util.find_spec(f"{BUILT_IN}.{name}") is not None


def of_role(role: str) -> Iterator[Entry]:
    """The built-in stages of a role, of each file that holds one: `role.name` leaves no doubt which is meant."""
    package = importlib.import_module(f"{BUILT_IN}.{role}")
    for module_info in sorted(pkgutil.iter_modules(package.__path__), key=lambda info: info.name):
        entry = built_in_stage(role, module_info.name)
        if entry is not None:
            yield entry


def built_in_stage(role: str, name: str) -> Entry | None:
    """The stage `role.name` of omninav itself; None where the file does not exist or holds none, or several."""
    module = _own_module(role, name)
    found = [] if module is None else list(_entries_of(module))
    return found[0] if len(found) == 1 else None


def _own_module(role: str, name: str) -> str | None:
    """The module of omninav itself for `role.name`; None where there is none."""
    module = f"{BUILT_IN}.{role}.{name}"
    there = name.isidentifier() and is_role(role) and importlib.util.find_spec(module) is not None
    return module if there else None


def _entries_of(module_name: str) -> Iterator[Entry]:
    module = importlib.import_module(module_name)
    role, name = module_name.removeprefix(BUILT_IN + ".").split(".", 1)[0], module_name.rpartition(".")[2]
    for cls in vars(module).values():
        if _is_stage(cls) and cls.__module__ == module.__name__ and not inspect.isabstract(cls):
            yield Entry(f"{role}.{name}", f"{module.__name__}.{cls.__qualname__}", "built in", first_line(cls))
