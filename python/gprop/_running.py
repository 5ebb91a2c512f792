"""Running the program as a child process. Its options are keyword arguments: `no_simulate=True` is `--no-simulate`."""

import contextlib
import difflib
import importlib.metadata
import inspect
import json
import os
import pathlib
import shutil
import signal
import subprocess
import sys
import sysconfig
import threading
import typing
import warnings
from collections.abc import Callable, Iterator, Mapping
from typing import TYPE_CHECKING, Any, Optional, TypeVar

from ._errors import KINDS, BugError, SceneWarning
from ._options import AuditOptions, ExportOptions, MaterialsOptions, Options, Path, RunOptions
from ._results import Result, load

if TYPE_CHECKING:
    from typing import Unpack  # novermin: Python has it since 3.11

Progress = Optional[Callable[[str], object]]
_Function = TypeVar("_Function", bound=Callable[..., Any])

# How the program's lines on stderr begin.
_ERROR, _WARNING = "error: ", " WARN "

# Everything was done; a check found something wrong.
_WITH_RESULT = (0, 1)

# An interrupt ends the program at once, unless it is deep in the system.
_PATIENCE_S = 10

# From the place of a warning to the caller of a public function; each of these calls `_program` itself.
_TO_CALLER = 3


def _takes(options: type) -> Callable[[_Function], _Function]:
    """Gives a function with `**options` the signature and the documentation of each of these options."""

    def documented(function: _Function) -> _Function:
        hints = _hints(options)
        lines = (f"{name}: {hint.__metadata__[0]}" for name, hint in hints.items())
        function.__doc__ = f"{inspect.cleandoc(function.__doc__ or '')}\n\nOptions:\n" + "\n".join(lines)
        plain = inspect.signature(function)
        kept = [parameter for parameter in plain.parameters.values() if parameter.kind is not parameter.VAR_KEYWORD]
        added = [
            inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=None, annotation=hint.__origin__)
            for name, hint in hints.items()
        ]
        setattr(function, "__signature__", plain.replace(parameters=kept + added))
        return function

    return documented


def _hints(options: type) -> dict[str, Any]:
    return typing.get_type_hints(options, include_extras=True)


@_takes(RunOptions)
def run(scene: Path, *, progress: Progress = None, **options: "Unpack[RunOptions]") -> Result:
    """Runs a scene, as `gprop run` does, and returns the result. What earlier runs did is used again.

    `scene` is a folder with a splat, cameras and photos, or a mesh. `progress` is called with each line of progress, such as
    ``print``; without it there is none. A scene that shows several objects is refused: name one with ``object=N``, or use
    `run_all`. An interrupt (Ctrl-C) ends the run and keeps what is done. Raises an `Error` of the kind of the failure.
    """
    _check_stage(options)
    flags = _flags("run", RunOptions, options)
    works = _program(["run", "--for-python=one", *flags, "--", os.fspath(scene)], progress)
    return load(works[0][1])


@_takes(RunOptions)
def run_all(scene: Path, *, progress: Progress = None, **options: "Unpack[RunOptions]") -> dict[str, Result]:
    """Runs each object of a capture that shows several, or each link of a URDF or MJCF, and returns the results by name.

    All else is as in `run`. If some objects fail, the others are run, and `BatchError` is raised.
    """
    _check_stage(options)
    flags = _flags("run_all", RunOptions, options)
    works = _program(["run", "--for-python=all", *flags, "--", os.fspath(scene)], progress)
    return {name: load(work) for name, work in works}


@_takes(ExportOptions)
def export(
    scene: Path, out: Path, *, progress: Progress = None, **options: "Unpack[ExportOptions]"
) -> list[pathlib.Path]:
    """Writes the result in the format of another program into the folder `out`, and returns the files.

    Stages that have not run yet are run first; `gprop.export("mug", "model", format=["mjcf", "usda"])`.
    """
    flags = _flags("export", ExportOptions, options)
    out_flag = f"--out={os.fspath(out)}"
    written = _program(["export", "--json", out_flag, *flags, "--", os.fspath(scene)], progress)
    return [pathlib.Path(file["path"]) for file in written["files"]]


@_takes(AuditOptions)
def audit(*paths: Path, **options: "Unpack[AuditOptions]") -> dict[str, Any]:
    """Checks what the URDF, MJCF, USD and glTF files in these files and folders claim, and returns the findings.

    `files` lists the files with their `links` and the `problems` of each; a finding is no error.
    """
    flags = _flags("audit", AuditOptions, options)
    report: dict[str, Any] = _program(["audit", "--json", *flags, "--", *(os.fspath(path) for path in paths)], None)
    return report


@_takes(MaterialsOptions)
def materials(**options: "Unpack[MaterialsOptions]") -> list[dict[str, Any]]:
    """The materials of the library: name, family, density and Young's modulus as ranges [low, high].

    ``gprop.call("materials show", "oak")`` returns all properties of one.
    """
    flags = _flags("materials", MaterialsOptions, options)
    listed: list[dict[str, Any]] = _program(["materials", "list", "--json", *flags], None)
    return listed


def call(command: str, *arguments: Path, progress: Progress = None, **options: Any) -> Any:
    """Runs any command of the program and returns what it prints with `--json`.

    ``gprop.call("evaluate mass", "mug", weights="weights.csv")``. A command that only checks raises no error for what it finds.
    """
    words = command.split()
    return _program([*words, "--json", *_rendered(options), "--", *(os.fspath(argument) for argument in arguments)], progress)


def _check_stage(options: RunOptions) -> None:
    stages: tuple[str, ...] = typing.get_args(_hints(RunOptions)["to"].__origin__)
    to = options.get("to") or stages[-1]
    if to in stages[: stages.index("vote")]:
        raise ValueError(f"there is no result after the stage {to!r}; end with a later one, or use gprop.call(\"run\", ..., to={to!r})")


def _flags(function: str, kind: type, options: Mapping[str, object]) -> list[str]:
    """The options as the command line has them."""
    known = _hints(kind)
    for name in options:
        if name not in known:
            close = difflib.get_close_matches(name, known, n=1)
            hint = f"; did you mean {close[0]!r}?" if close else ""
            raise TypeError(f"{function}() got an unexpected keyword argument {name!r}{hint}")
    return list(_rendered(options))


def _rendered(options: Mapping[str, object]) -> Iterator[str]:
    for name, given in options.items():
        flag = "--" + name.removesuffix("_").replace("_", "-")
        for value in given if isinstance(given, (list, tuple)) else [given]:
            if isinstance(value, bool) and name in _TRUE_OR_FALSE:
                yield f"{flag}={str(value).lower()}"
            elif value is True:
                yield flag
            elif value is not None and value is not False:
                yield f"{flag}={os.fspath(value) if isinstance(value, os.PathLike) else value}"


# The options that are given as `true` or `false`; others are given or not.
_TRUE_OR_FALSE = {name for name, hint in _hints(RunOptions).items() if len(hint.__metadata__) > 1}


def _program(arguments: list[str], progress: Progress) -> Any:
    """Runs the program and returns what it prints as JSON. To be called by the public functions, as warnings name their caller."""
    quiet = [] if progress else ["--quiet"]
    # In a session of its own, an interrupt at the terminal reaches it once: from here. It has a pipe as stdin, which closes if this
    # process dies; a run ends then.
    process = subprocess.Popen(
        [_path(), *quiet, *arguments],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        env=os.environ | {"NO_COLOR": "1"},
        encoding="utf-8",
        errors="replace",
        start_new_session=True,
    )
    printed: list[str] = []
    error: list[str] = []
    with process:
        assert process.stdout and process.stderr
        reader = threading.Thread(target=lambda stdout: printed.append(stdout.read()), args=[process.stdout])
        reader.start()
        try:
            for line in process.stderr:
                line = line.rstrip("\n")
                if error or line.startswith(_ERROR):
                    error.append(line)
                elif line.startswith(_WARNING):
                    warnings.warn(line.removeprefix(_WARNING), SceneWarning, stacklevel=_TO_CALLER)
                elif progress:
                    progress(line)
                else:
                    # What is sent, and what it costs.
                    print(line, file=sys.stderr)
            reader.join()
            process.wait()
        except BaseException:
            _end(process)
            raise
    return _outcome(process.returncode, "".join(printed), "\n".join(error))


def _end(process: "subprocess.Popen[str]") -> None:
    """Ends the program and what it started, and waits for it."""
    with contextlib.suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGINT)
        try:
            process.wait(_PATIENCE_S)
        except BaseException:
            os.killpg(process.pid, signal.SIGKILL)
            process.wait()
            raise


def _outcome(code: int, printed: str, error: str) -> Any:
    """What was printed, or the error of the kind that the exit code says."""
    result = None
    with contextlib.suppress(json.JSONDecodeError):
        result = json.loads(printed)
    if code in _WITH_RESULT and result is not None:
        return result
    # Of wrong usage, clap also prints the usage.
    message = error.removeprefix(_ERROR).partition("\n\nUsage:")[0].partition("\n\nFor more information")[0]
    if code < 0:
        name = signal.Signals(-code).name
        message = message or f"{name} ended gprop; if nobody sent it, the machine may have been short of memory"
    raise KINDS.get(code, BugError)(message or f"gprop ended with exit code {code} and printed {printed[:80]!r}", code, result)


def _path() -> str:
    """The program that was installed together with this module, or else the one on the PATH."""
    candidates: list[Path] = [pathlib.Path(sysconfig.get_path("scripts"), "gprop")]
    with contextlib.suppress(importlib.metadata.PackageNotFoundError):
        files = importlib.metadata.files("gprop") or []
        candidates[:0] = [file.locate() for file in files if file.name == "gprop" and file.suffix == ""]
    for candidate in candidates:
        if os.path.isfile(candidate) and os.access(candidate, os.X_OK):
            return os.fspath(candidate)
    if found := shutil.which("gprop"):
        return found
    raise FileNotFoundError("the program gprop is neither in this Python environment nor on the PATH; `pip install` its wheel")
