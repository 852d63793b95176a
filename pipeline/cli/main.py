"""The command line. Only the parser is loaded at the start; what is heavy is imported by the command that needs it."""

import copy
import functools
import os
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from omninav.pipeline.experiment.runner import ExperimentRun
    from omninav.pipeline.graph.problems import Problem

CONF = "omninav.conf"
INPUTS = ("log", "tour", "map", "grid", "goal")
"""Settings that name what a run is of; a variant reads some of them."""
OUTCOMES = "OMNINAV_OUTCOMES"
"""Names the file in which the jobs of a sweep, also those in other processes, leave their exit codes."""

HELP = """\
omninav: finding the way with an omnidirectional camera

  omninav                                        the built-in world: a map, a drive, a report
  omninav variant=omniview_mcl tour=T log=L      learn the map from a tour, localise a drive with it
  omninav variant=omniview_mcl map=M log=L       the same with a map that was saved before
  omninav -m match=selective,l2 seed=0,1,2       a sweep: every combination, one page
  omninav +experiment=omniview_mcl/table_1       a paper's table, its figures beside ours (profile=quick: small)
  omninav resume runs/latest                     go on with a run that was stopped
  omninav compare runs/A runs/B                  figures side by side

  check [overrides]       say everything that is wrong with a configuration, and run nothing
  graph [overrides]       draw the graph: SVG and Mermaid (out=FOLDER)
  stages [role]           all stages with ports, parameters and source; third parties' too
  variants                what variant= can be
  simulate [overrides]    write a log of the built-in world (world=… route=… day=… log=out.mcap)
  report [run]            a run's results and where its report lies
  compare RUN RUN …       several runs side by side
  resume RUN              go on with a run that was stopped
  doctor                  versions, plugins, and what may be missing

A log is an .mcap file, a rosbag2 folder, a ROS 1 .bag, LAYOUT:FOLDER for images with CSVs (antworld:path), or a
recording's .yaml. Any parameter can be set: nodes.match.headings=72; any stage swapped: match=l2.
Hydra's own flags work as ever: --config-dir, --cfg job, --multirun, --info, --hydra-help.
"""


def main(argv: Sequence[str] | None = None) -> int:
    """Run a command and return its exit code: 0 well, 1 a stage failed, 2 the configuration or an input is wrong."""
    arguments = list(sys.argv[1:] if argv is None else argv)
    if arguments and arguments[0] in ("-h", "--help", "help"):
        print(HELP, end="")
        return 0
    if arguments and arguments[0] == "--version":
        import importlib.metadata

        print(f"omninav {importlib.metadata.version('omninav')}")
        return 0
    if os.getcwd() not in sys.path:
        sys.path.append(os.getcwd())  # so that `_target_: my_stages.MyMatch` finds my_stages.py here
    command = COMMANDS.get(arguments[0]) if arguments else None
    if command is None and arguments and arguments[0].isidentifier():
        return _unknown_command(arguments[0])
    from omninav.pipeline.graph.problems import BadInput, ProblemsFound, unreadable_yaml

    try:
        _refuse_null_groups(arguments)
        return command(arguments[1:]) if command else _launch(arguments)
    except ProblemsFound as found:
        print(found, file=sys.stderr)
        return 2
    except BadInput as error:
        print(error, file=sys.stderr)
        return 2
    except BrokenPipeError:
        return 0
    except KeyboardInterrupt:
        print("stopped; `omninav resume runs/latest` goes on", file=sys.stderr)
        return 130
    except Exception as error:
        bad = unreadable_yaml(error)
        if bad is None:
            raise
        print(bad, file=sys.stderr)
        return 2


def _refuse_null_groups(arguments: Sequence[str]) -> None:
    """`match=null`, on which Hydra stumbles without a word about what to type."""
    from importlib.resources import files

    from omninav.pipeline.graph.problems import Problem, ProblemsFound

    for word in arguments:
        name, _, value = word.partition("=")
        if value == "null" and name.isidentifier() and files(CONF).joinpath(name).is_dir():
            hint = f"to take the node out, type '~nodes.{name}' '~wires.{name}'"
            raise ProblemsFound([Problem(name, "a stage cannot be swapped for nothing", hint)])


def _unknown_command(name: str) -> int:
    from omninav.pipeline.graph.problems import suggest

    print(f"'{name}' is no command. {suggest(name, COMMANDS, 'commands', prefix='omninav ')}", file=sys.stderr)
    return 2


# running


def _launch(arguments: list[str]) -> int:
    """Hand over to Hydra, which composes the configuration and calls `_job`, once or once per job of a sweep."""
    import tempfile

    import hydra
    from hydra.errors import HydraException

    words, folders = _words(arguments)
    listed = _listed(words, folders)
    arguments = [listed[words.index(word)] if word in words else word for word in arguments]
    words = listed
    of_conditions = _words_of_conditions(words)

    def job(config: Any) -> None:
        _job(config, arguments, of_conditions)

    _offer_plugins()
    if {"-m", "--multirun"} & set(arguments):
        _refuse_misspelled_sweep(words, folders)
    with tempfile.TemporaryDirectory() as place:
        outcomes = Path(place) / "outcomes"
        os.environ[OUTCOMES] = str(outcomes)
        os.environ["HYDRA_FULL_ERROR"] = "1"  # what Hydra does not understand is raised, and said by us
        sys.argv = ["omninav", *(word for word in arguments if word not in of_conditions)]
        try:
            hydra.main(config_path=f"pkg://{CONF}", config_name="config", version_base="1.3")(job)()
        except SystemExit as stop:  # a flag that Hydra does not know
            if stop.code:
                return 2
        except HydraException as error:
            from hydra import initialize_config_module

            from omninav.pipeline.graph.problems import ProblemsFound

            from .overrides import misfits

            with initialize_config_module(CONF, version_base="1.3"):
                raise ProblemsFound(misfits(words, folders, str(error))) from None
        codes = [int(line) for line in outcomes.read_text().split()] if outcomes.exists() else []
    return max(codes, default=0)


def _listed(words: Sequence[str], folders: Sequence[str]) -> list[str]:
    from hydra import initialize_config_module

    from .overrides import with_unlisted_parameters

    if not any(word.startswith("nodes.") for word in words):
        return list(words)
    with initialize_config_module(CONF, version_base="1.3"):
        return with_unlisted_parameters(words, folders)


def _words_of_conditions(words: Sequence[str]) -> list[str]:
    """Where an experiment is asked for, the words that are for each of its conditions and not for the experiment."""
    own = ("experiment", "profile", "runs", "cache", "hydra")
    keys = [word.lstrip("+~").partition("=")[0].replace("/", ".").partition(".")[0] for word in words]
    return [word for word, key in zip(words, keys, strict=True) if key not in own] if "experiment" in keys else []


def _refuse_misspelled_sweep(words: Sequence[str], folders: Sequence[str]) -> None:
    """Hydra makes a sweep's folder before it reads the words; so they are read before."""
    from hydra import initialize_config_module

    from .overrides import jobs_to_try

    with initialize_config_module(CONF, version_base="1.3"):
        jobs = list(jobs_to_try(words, folders))
    for job in jobs:
        with _composed([*job, *(f"--config-dir={folder}" for folder in folders)], offer=False):
            pass


def _words(arguments: Sequence[str]) -> tuple[list[str], list[str]]:
    """The overrides among arguments that may hold Hydra's flags, and the folders of `--config-dir`."""
    from hydra._internal.utils import get_args_parser

    from omninav.pipeline.graph.problems import BadInput

    read = get_args_parser().parse_args(list(arguments))
    if read.config_dir and not Path(read.config_dir).is_dir():
        raise BadInput(
            f"--config-dir: there is no folder {read.config_dir}; it holds groups, as FOLDER/match/mine.yaml"
        )
    return read.overrides, [read.config_dir] if read.config_dir else []


def _job(config: Any, arguments: Sequence[str], of_conditions: Sequence[str]) -> None:
    """One run. Never raises and never exits: in a sweep the other jobs go on, and the exit code is left in a file."""
    from omninav.pipeline.engine.engine import StageFailed
    from omninav.pipeline.graph.problems import BadInput, ProblemsFound, unreadable_yaml

    sweep = _sweep_folder()
    code, error = 0, ""
    try:
        if config.get("experiment") is not None:
            code = _experiment(config, arguments, of_conditions, sweep)
        else:
            _run(config, sweep)
    except ProblemsFound as found:
        code, error = 2, str(found)
    except BadInput as bad:
        code, error = 2, str(bad)
    except StageFailed as failed:
        code, error = 1, str(failed)
    except KeyboardInterrupt:
        on = "the same command" if config.get("experiment") is not None else "`omninav resume runs/latest`"
        code, error = 130, f"stopped; {on} goes on"
    except Exception as unknown:  # a defect of ours: one line here, the trace in run.log
        no_yaml = unreadable_yaml(unknown)
        code, error = (2, str(no_yaml)) if no_yaml else (1, f"{type(unknown).__name__}: {unknown}")
        if no_yaml is None and sweep is None and not isinstance(unknown, OSError):
            import traceback

            traceback.print_exc()
    if error:
        print(f"job {sweep[1]}: {error}" if sweep else error, file=sys.stderr, flush=True)
        if code == 1:
            folder = sweep[0] / sweep[1] if sweep else Path(str(config.get("runs", "runs"))) / "latest"
            print(f"the traceback is in {folder / 'run.log'}", file=sys.stderr, flush=True)
    if sweep is not None:
        _note_job(sweep, code, error)
    if OUTCOMES in os.environ:
        with open(os.environ[OUTCOMES], "a") as file:
            file.write(f"{code}\n")


def _run(config: Any, sweep: tuple[Path, str, str] | None) -> None:
    from omninav.pipeline.report.progress import Progress
    from omninav.pipeline.report.terminal_tables import results_table
    from omninav.pipeline.run.run import execute, plan, start

    planned = plan(complete(config))
    folder = sweep[0] / sweep[1] if sweep else None
    argv = ["omninav", *(sweep[2].split() if sweep else sys.argv[1:])]
    run = start(planned, argv, folder)
    with Progress() as progress:
        metrics = execute(run, planned, progress)
    if sweep is None:
        _print(results_table(metrics))
    print(f"report: {_shown(run.folder / 'report.html')}", flush=True)


def _experiment(
    config: Any, arguments: Sequence[str], of_conditions: Sequence[str], sweep: tuple[Path, str, str] | None
) -> int:
    """An experiment: every condition and repetition of its file, and its page. 1 where a job failed."""
    from omninav.pipeline.graph.problems import BadInput

    if sweep is not None:
        raise BadInput("an experiment has its own sweep: leave out -m, and write what varies into its file")
    run = _planned_experiment(config, arguments, of_conditions)
    well = run.run()
    print(f"page: {_shown(run.folder / (run.experiment.name + '.html'))}", flush=True)
    return 0 if well else 1


def _planned_experiment(
    config: Any, arguments: Sequence[str], of_conditions: Sequence[str], place: Sequence[str] = ()
) -> "ExperimentRun":
    """The experiment of a composed configuration, with every condition checked. Raises `ProblemsFound`.

    `place` says where configurations are looked for, where Hydra was not started with `--config-dir`.
    """
    from hydra import compose
    from hydra.errors import HydraException
    from omegaconf import OmegaConf

    from omninav.pipeline.experiment.runner import plan_experiment
    from omninav.pipeline.graph.problems import ProblemsFound

    from .overrides import misfits, with_unlisted_parameters

    plain: dict[str, Any] = OmegaConf.to_container(config, resolve=True)  # type: ignore[assignment]
    folders = _words(arguments)[1]
    variants = _configured_variants(place)

    def composed(words: Sequence[str]) -> dict[str, Any]:
        try:
            return complete(compose("config", overrides=[*place, *with_unlisted_parameters(words, folders)]), variants)
        except HydraException as error:
            raise ProblemsFound(misfits(words, folders, str(error))) from None

    words = [*of_conditions, f"cache={plain['cache'] or 'null'}"]
    return plan_experiment(plain, composed, words, ["omninav", *arguments])


def _print(renderable: Any) -> None:
    from rich.console import Console

    Console(width=None if sys.stdout.isatty() else 120).print(renderable)


def _shown(path: Path) -> str:
    try:
        return str(path.resolve().relative_to(Path.cwd()))
    except ValueError:
        return str(path)


def _sweep_folder() -> tuple[Path, str, str] | None:
    """In a sweep: its folder, this job's number, and what this job overrides; None in a single run."""
    from hydra.core.hydra_config import HydraConfig
    from hydra.types import RunMode

    settings = HydraConfig.get()
    if settings.mode != RunMode.MULTIRUN:
        return None
    return Path(settings.sweep.dir).resolve(), str(settings.job.num), " ".join(settings.overrides.task)


def _note_job(sweep: tuple[Path, str, str], code: int, error: str) -> None:
    """Put a job's end on the sweep's page at once. Jobs in other processes wait for each other here."""
    import fcntl
    import json

    from omninav.pipeline.files import write_whole
    from omninav.pipeline.report.sweep_page import write_sweep_page

    folder, number, overrides = sweep
    own = folder / number
    own.mkdir(parents=True, exist_ok=True)
    manifest = (
        json.loads((own / "manifest.json").read_text()) if (own / "manifest.json").exists() else {"status": "refused"}
    )
    manifest |= {"job": number, "overrides": overrides} | ({"error": error} if error else {})
    write_whole(own / "manifest.json", json.dumps(manifest, indent=1) + "\n")
    with (folder / ".page.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        write_sweep_page(folder, list(_sweep_rows(folder)))


def _sweep_rows(folder: Path) -> Iterator[dict[str, Any]]:
    import json

    from omninav.pipeline.run.metrics_files import read_metrics

    for own in sorted((path for path in folder.iterdir() if path.name.isdigit()), key=lambda path: int(path.name)):
        if (own / "manifest.json").exists():
            manifest = json.loads((own / "manifest.json").read_text())
            metrics = read_metrics(own) if (own / "metrics.json").exists() else None
            yield {"job": own.name, "folder": own, "manifest": manifest, "metrics": metrics}


# configurations


def _configured_variants(place: Sequence[str] = ()) -> Callable[[str], Any]:
    """Gives the configuration of a variant as its file has it, composed once. `place` as in `_planned_experiment`."""
    from hydra import compose

    @functools.cache
    def of(variant: str) -> Any:
        return compose("config", overrides=[*place, f"variant={variant}"])

    return lambda variant: copy.deepcopy(of(variant))


def complete(config: Any, variants: Callable[[str], Any] | None = None) -> dict[str, Any]:
    """A composed configuration, resolved, with the graphs of its artifacts composed too: plain dicts, all said.

    An artifact's graph is its variant's, with the nodes that it shares taken from this configuration, and all top-level
    settings too; its log is the artifact's. `variants` gives variants where Hydra was not started with `--config-dir`.
    """
    from omegaconf import OmegaConf
    from omegaconf.errors import OmegaConfBaseException

    from omninav.pipeline.graph.problems import Problem, ProblemsFound
    from omninav.pipeline.run.run import without_absent

    of_variant = variants or _configured_variants()
    graph_keys = {
        "variant",
        "nodes",
        "wires",
        "artifacts",
        "saves",
        "log",
        "tour",
        "map",
        "route",
        "day",
        "kidnappings",
        "cuts",
    }
    if unread := list(_unread(config)):
        raise ProblemsFound(unread)
    runs = Path(str(config.get("runs", "runs"))).resolve()
    for key in INPUTS:  # what lies among the runs may be named by way of their link
        file = config.get(key)
        if isinstance(file, str) and Path(file).is_file() and Path(file).resolve().is_relative_to(runs):
            config[key] = _past_links(file)
    try:
        plain: dict[str, Any] = OmegaConf.to_container(config, resolve=True)  # type: ignore[assignment]
        for name, spec in (plain.get("artifacts") or {}).items():
            if not isinstance(spec, Mapping) or spec.get("variant") is None:
                continue
            if spec.get("file") is not None:
                if spec.get("log") is not None:
                    hint = f"leave one of them away: {name}=FILE uses a saved one, tour=LOG makes one"
                    raise ProblemsFound([Problem(str(name), "both a file and a log to make it from are given", hint)])
                plain["artifacts"][name]["file"] = _past_links(str(spec["file"]))
                continue
            if spec.get("log") is not None and plain.get("log") is None:
                raise ProblemsFound([Problem("log", "a tour is given, but no log to localise", "type log=LOG")])
            if spec.get("log") is None and plain.get("log") is not None:
                continue  # a log of one's own, but nothing to make the artifact from: `plan` says what is missing
            other = of_variant(str(spec["variant"]))
            OmegaConf.set_struct(other, False)
            for key in config:
                if str(key) not in graph_keys:
                    other[key] = config._get_node(key)
            other.update({"tour": None, "map": None} | {key: spec.get(key) for key in ("log", "route", "day")})
            for lift in ("kidnappings", "cuts"):  # who lifts the robot on its drive does not lift it on its tour
                other[lift] = spec.get(lift) or []
            for node in spec.get("share") or ():
                if config.nodes.get(node) is not None:
                    other.nodes[node] = OmegaConf.to_container(config.nodes[node], resolve=False)
            for node, changes in (spec.get("nodes") or {}).items():
                other.nodes[node] = OmegaConf.merge(other.nodes.get(node) or {}, changes)
            made: dict[str, Any] = OmegaConf.to_container(other, resolve=True)  # type: ignore[assignment]
            made = dict(without_absent(made))  # what makes an artifact begins without those that it can do without
            plain["artifacts"][name]["graph"] = {key: made.get(key) for key in ("nodes", "wires", "saves")}
    except OmegaConfBaseException as error:
        where = getattr(error, "full_key", None) or "config"
        raise ProblemsFound([Problem(str(where), str(error).split("\n")[0])]) from None
    return plain


def _past_links(file: str) -> str:
    """A file's own path where it is named by way of a link: one like runs/latest will soon point elsewhere."""
    path = Path(file)
    return file if path.resolve() == path.absolute() else str(path.resolve())


def _unread(config: Any) -> "Iterator[Problem]":
    """What is given to this variant and read by nothing in it: its figures would be of something else."""
    from omegaconf import OmegaConf

    from omninav.pipeline.graph.problems import Problem

    graph = "".join(OmegaConf.to_yaml(config[part]) for part in ("nodes", "artifacts"))
    read = [key for key in INPUTS if f"${{{key}}}" in graph or f"${{oc.select:{key}," in graph]
    for key in INPUTS:
        if config.get(key) is not None and key not in read:
            what = f"nothing in variant={config.get('variant')} reads it"
            yield Problem(
                key, what, f"leave {key}=… away; it reads {', '.join(read) or 'none of ' + ', '.join(INPUTS)}"
            )


@contextmanager
def _composed(arguments: Sequence[str], offer: bool = True) -> Iterator[Any]:
    """The configuration that overrides (and --config-dir) describe, for commands that run nothing."""
    from hydra import compose, initialize_config_module
    from hydra.errors import HydraException

    from omninav.pipeline.graph.problems import ProblemsFound

    from .overrides import misfits, search, with_unlisted_parameters

    words, folders = _words(arguments)
    if offer:
        _offer_plugins()
    with initialize_config_module(CONF, version_base="1.3"):
        try:
            config = compose("config", overrides=[*search(folders), *with_unlisted_parameters(words, folders)])
        except HydraException as error:
            raise ProblemsFound(misfits(words, folders, str(error))) from None
        yield config


def _offer_plugins() -> None:
    """Let `match=gradient` find a third party's stage `match.gradient`, as if it had a file in conf/match."""
    from hydra.core.config_store import ConfigStore

    from omninav.pipeline.graph.registry import plugins

    for entry in plugins():
        if entry.problem:
            print(f"plugin left out: {entry.problem}", file=sys.stderr)
            continue
        name = entry.name.partition(".")[2]
        ConfigStore.instance().store(name, {"_target_": entry.target}, group=entry.role, package=f"nodes.{entry.role}")


# commands


def _check(arguments: list[str]) -> int:
    from omninav.pipeline.graph.graph import LIFETIMES
    from omninav.pipeline.graph.ground_truth import truth_readers
    from omninav.pipeline.run.run import input_digests, plan

    from .overrides import search

    words, folders = _words(arguments)
    of_conditions = _words_of_conditions(words)
    with _composed([word for word in arguments if word not in of_conditions]) as config:
        if config.get("experiment") is not None:
            return _check_experiment(_planned_experiment(config, arguments, of_conditions, search(folders)))
        planned = plan(complete(config, _configured_variants(search(folders))))
    input_digests(planned)  # opens every log and map
    graph = planned.graph
    before, tick, after = (len(graph.of_lifetime(kind)) for kind in LIFETIMES)
    print(f"{planned.variant}: nothing wrong with it. {len(graph.nodes)} nodes, {len(graph.wires)} wires")
    print(f"{before} stages run before the loop, {tick} every tick, {after} after it")
    readers = truth_readers(graph)
    print(f"ground truth is read by: {', '.join(readers) or 'nobody'}")
    return 0


def _check_experiment(run: "ExperimentRun") -> int:
    """What an experiment would run. Its conditions are composed and checked by now."""
    from omninav.pipeline.experiment.conditions import open_inputs
    from omninav.pipeline.graph.ground_truth import truth_readers

    experiment = run.experiment
    open_inputs(run.all_runs)
    factors = ", ".join(f"{len(experiment.labels(factor))} {factor}" for factor in experiment.sweep)
    runs = sum(len(each.seeds) for each in run.all_runs)
    print(f"{experiment.name}, profile {run.profile}: nothing wrong with it")
    over = f" in each of {len(experiment.scenarios)} scenarios" if experiment.scenarios else ""
    conditions = len(experiment.conditions())
    print(f"{conditions} conditions ({factors}), each with {experiment.repetitions} repetitions{over}")
    references = len(run.all_runs) - len(run.conditions)
    print(f"{runs} runs in all" + (f", {references} of them reference runs" if references else ""))
    print(f"claims to be judged: {len(experiment.claims)}")
    readers = sorted({name for each in run.conditions if each.planned for name in truth_readers(each.planned.graph)})
    print(f"ground truth is read by: {', '.join(readers) or 'nobody'}")
    return 0


def _graph(arguments: list[str]) -> int:
    from omninav.pipeline.files import write_whole
    from omninav.pipeline.report.graph_svg import svg
    from omninav.pipeline.report.mermaid import mermaid
    from omninav.pipeline.run.run import plan

    from .overrides import search

    out = next((Path(word.partition("=")[2]) for word in arguments if word.startswith("out=")), Path("."))
    with _composed([word for word in arguments if not word.startswith("out=")]) as config:
        planned = plan(complete(config, _configured_variants(search(_words(arguments)[1]))))
    drawn = {planned.variant: planned.graph} | {
        f"{planned.variant}.{a.name}": a.graph for a in planned.artifacts if a.graph
    }
    for name, graph in drawn.items():
        write_whole(out / f"{name}.svg", svg(graph))
        write_whole(out / f"{name}.mmd", mermaid(graph))
        print(f"{name}.svg and {name}.mmd (Mermaid), {len(graph.nodes)} nodes, written to {out.resolve()}")
    return 0


def _stages(arguments: list[str]) -> int:
    from .commands.stages import command

    return command(arguments)


def _variants(arguments: list[str]) -> int:
    from importlib.resources import files

    for file in sorted(files(CONF).joinpath("variant").iterdir(), key=lambda path: path.name):
        if file.name.endswith(".yaml"):
            comments = (
                line for line in file.read_text().split("\n") if line.startswith("# ") and "@package" not in line
            )
            first = next(comments, "").lstrip("# ")
            print(f"{file.name.removesuffix('.yaml'):22} {first}")
    return 0


def _simulate(arguments: list[str]) -> int:
    from omninav.pipeline.report.progress import Progress

    with Progress(unit="pictures") as progress:
        progress.say("reading the configuration")
        from omninav.pipeline.engine.engine import Engine
        from omninav.pipeline.run.run import plan

        with _composed(["variant=simulate", *arguments]) as config:
            planned = plan(complete(config))  # of no artifacts

        def step(done: int, total: int | None) -> None:
            progress.update("simulate", done, total)

        Engine(planned.graph, {}, planned.seed, progress=step, doing=progress.say).run()
    return 0


def _report(arguments: list[str]) -> int:
    from omninav.pipeline.graph.problems import BadInput
    from omninav.pipeline.report.terminal_tables import results_table
    from omninav.pipeline.run.metrics_files import read_metrics

    folder = Path(arguments[0] if arguments else "runs/latest")
    if not (folder / "report.html").is_file():
        raise BadInput(f"{folder}: no report.html in it; `omninav resume {folder}` goes on with a run that did not end")
    _print(results_table(read_metrics(folder)))
    print(f"report: {folder / 'report.html'}")
    return 0


def _compare(arguments: list[str]) -> int:
    import json

    import yaml

    from omninav.pipeline.graph.problems import BadInput
    from omninav.pipeline.report.terminal_tables import compare_table
    from omninav.pipeline.run.metrics_files import read_metrics

    if len(arguments) < 2:
        raise BadInput("compare: give two or more run folders: omninav compare runs/A runs/B")
    runs = []
    for word in arguments:
        folder = Path(word)
        metrics = read_metrics(folder)
        config = yaml.safe_load((folder / "config.yaml").read_text())
        manifest = json.loads((folder / "manifest.json").read_text())
        runs.append(
            {
                "name": word.rstrip("/"),
                "metrics": metrics,
                "config": config,
                "manifest": manifest,
            }
        )
    _print(compare_table(runs))
    return 0


def _resume(arguments: list[str]) -> int:
    from omninav.pipeline.engine.engine import StageFailed
    from omninav.pipeline.graph.problems import BadInput
    from omninav.pipeline.report.progress import Progress
    from omninav.pipeline.report.terminal_tables import results_table
    from omninav.pipeline.run.run import resume, status

    if len(arguments) != 1:
        raise BadInput("resume: give one run folder: omninav resume runs/latest")
    here, folder = Path.cwd(), Path(arguments[0]).resolve()
    if (folder / "experiment.json").is_file():
        return _resume_experiment(folder)
    ended = status(folder) == "complete"
    try:
        with Progress() as progress:
            run, metrics = resume(folder, progress)
    except StageFailed as failed:
        print(f"{failed}\nthe traceback is in {folder / 'run.log'}", file=sys.stderr)
        return 1
    finally:
        os.chdir(here)  # a run goes on where it was started
    if ended:
        print(f"{arguments[0]} was complete: there was nothing to go on with. Its results:")
    _print(results_table(metrics))
    print(f"report: {_shown(run.folder / 'report.html')}")
    return 0


def _resume_experiment(folder: Path) -> int:
    """An experiment goes on when its command is typed again, where it was typed."""
    import json
    import shlex

    manifest = json.loads((folder / "experiment.json").read_text())
    words, place = manifest["argv"][1:], Path(manifest["cwd"])
    print(f"{shlex.join(['omninav', *words])}   (in {place})", flush=True)
    os.chdir(place)
    return main(words)


def _doctor(arguments: list[str]) -> int:
    import platform

    from omninav.pipeline.graph.registry import entries
    from omninav.pipeline.run.run import LIBRARIES, version

    print(f"omninav {version('omninav')}, Python {platform.python_version()}, {os.cpu_count()} cores")
    rows = list(entries())
    for name in LIBRARIES:
        print(f"  {name:26} {version(name)}")
    broken = [entry for entry in rows if entry.problem]
    others = [entry for entry in rows if entry.origin != "built in" and not entry.problem]
    print(f"{len(rows) - len(others) - len(broken)} built-in stages, {len(others)} from others, {len(broken)} unusable")
    for entry in broken:
        print(f"  {entry.name} [{entry.origin}]: {entry.problem}")
    print(
        f"results go to {Path('runs').resolve()}"
        + ("" if os.access(".", os.W_OK) else ", which cannot be written: change to another folder")
    )
    return 1 if broken else 0


COMMANDS: dict[str, Callable[[list[str]], int]] = {
    "check": _check,
    "graph": _graph,
    "stages": _stages,
    "variants": _variants,
    "simulate": _simulate,
    "report": _report,
    "compare": _compare,
    "resume": _resume,
    "doctor": _doctor,
}
