"""Nodes and wires, checked: `build(config)` gives a graph that will run, or every problem at once."""

import dataclasses
from collections.abc import Iterable, Mapping
from contextlib import suppress
from typing import Any

from .graph import ARTIFACTS, LIFETIMES, Graph, Lifetime, Node, Wire, node_of
from .ground_truth import truth_in_the_loop
from .ordering import Following
from .parameters import BadStage
from .ports import compatible, convert_fields, type_name
from .problems import Problem, ProblemsFound, nearest, suggest
from .registry import BUILT_IN, UnknownStage, entries, resolve
from .signature import Port, signature
from .value import Tick


def build(
    config: Mapping[str, Any],
    artifact_types: Mapping[str, Any] | None = None,
    prefix: str = "",
    shared: Iterable[str] = (),
) -> Graph:
    """The graph that a configuration describes.

    `config` holds `nodes` (name -> `_target_` and parameters) and `wires` (node -> port -> wire). `artifact_types`
    states which artifacts there are and of which type. `prefix` goes before all config paths of problems, except
    those of `shared` nodes. Raises `ProblemsFound` with all problems; nothing has been run or read by then.
    """
    builder = _Builder(config, dict(artifact_types or {}), prefix, frozenset(shared))
    graph = builder.build()
    if builder.problems:
        raise ProblemsFound(dict.fromkeys(builder.problems))
    return graph


WIRE_OPTIONS = ("from", "delay", "initial", "hold", "collect", "optional")
"""Options of a wire. One that is `optional` is left out where the graph has not both its ends, and so is a node that
needs it."""


class _Builder:
    def __init__(
        self, config: Mapping[str, Any], artifacts: dict[str, Any], prefix: str, shared: frozenset[str]
    ) -> None:
        self.artifacts, self.prefix, self.shared = artifacts, prefix, shared
        self.problems: list[Problem] = []
        stages = "expected a mapping from names to stages", "write nodes: {match: {_target_: …}}"
        origins = "expected a mapping: node -> port -> where it comes from", "write wires: {node: {port: other.output}}"
        self.given_nodes = self._block("nodes", config.get("nodes"), *stages)
        self.given_wires = self._block("wires", config.get("wires"), *origins)
        self.nodes: dict[str, Node] = {}
        self.broken: set[str] = set()
        self.left_out: set[str] = set()
        self.wires: list[Wire] = []

    def build(self) -> Graph:
        self._read_nodes()
        self._leave_out()
        self._read_wires()
        self._check_missing()
        graph = Graph(self.nodes, self.wires, self.artifacts)
        if not self.problems:
            lifetimes = self._lifetimes()
            graph = self._ordered(lifetimes)
            for where, what, hint in truth_in_the_loop(graph):
                self._problem(where, what, hint)
        return graph

    def _problem(self, where: str, what: str, hint: str = "") -> None:
        self.problems.append(Problem(self.prefix + where, what, hint))

    def _block(self, name: str, given: Any, expected: str, hint: str) -> Mapping[Any, Any]:
        if given and not isinstance(given, Mapping):
            self._problem(name, expected, hint)
            return {}
        return given or {}

    # nodes

    def _read_nodes(self) -> None:
        for name, spec in self.given_nodes.items():
            if spec is None:  # a node taken out of a variant
                continue
            node = self._read_node(str(name), spec)
            if node is None:
                self.broken.add(str(name))
            else:
                self.nodes[str(name)] = node

    def _read_node(self, name: str, spec: Any) -> Node | None:
        where = f"nodes.{name}"
        if name == ARTIFACTS or "." in name:
            self._problem(where, f"'{name}' cannot be the name of a node", "choose another name")
            return None
        if not isinstance(spec, Mapping) or not isinstance(spec.get("_target_"), str):
            instead = "" if isinstance(spec, Mapping) else " in place of it"
            self._problem(where, "a node needs `_target_`", f"type ++{where}._target_=omninav.stages.…{instead}")
            return None
        target = spec["_target_"]
        try:
            cls = resolve(target)
            read = signature(cls)
        except UnknownStage as error:
            known = [entry.target for entry in entries() if not entry.problem]
            near = nearest(target, known)
            hint = f"did you mean '{near}'?" if near else "`omninav stages` lists all stages"
            self._problem(f"{where}._target_", str(error), hint)
            return None
        except BadStage as error:
            self._problem(f"{where}._target_", str(error))
            return None
        path = where if name in self.shared else self.prefix + where
        parameters, found = convert_fields(spec, cls, path, skip=("_target_",))
        if found and not target.startswith(f"{BUILT_IN}.") and found[0].what.startswith(f"{cls.__name__} has no"):
            of_option = f"if an option of its own sets it, write `override /{name}: null` below `defaults:`"
            found[0] = dataclasses.replace(found[0], hint=f"{found[0].hint}; {of_option}".removeprefix("; "))
        self.problems += found
        if found:  # with default parameters, where each has one, so that its wires are checked too
            needed = any(parameter.default is dataclasses.MISSING for parameter in read.parameters.values())
            return None if needed else Node(name, target, cls(), read, {})
        try:
            stage = cls(**parameters)
        except (ValueError, TypeError) as error:  # what __post_init__ reports of parameters that do not go together
            self.problems.append(Problem(path, str(error)))
            return None
        except (Exception, SystemExit) as error:
            self.problems.append(Problem(path, f"{target} cannot be made: {type(error).__name__}: {error}"))
            return None
        plain = {key: value for key, value in spec.items() if key != "_target_"}
        return Node(name, target, stage, read, plain)

    # wires

    def _leave_out(self) -> None:
        """Leave out nodes with a needed input whose optional wire comes from nowhere, and so on behind them."""
        while lacking := {name for name, node in self.nodes.items() if self._lacks(node, self.given_wires.get(name))}:
            self.left_out |= lacking
            for name in lacking:
                del self.nodes[name]

    def _lacks(self, node: Node, wires: Any) -> bool:
        """Tells whether an input that a node needs is wired, optionally, to what the graph has not."""
        return isinstance(wires, Mapping) and any(
            _is_optional(spec) and not self._given(spec)
            for name, spec in wires.items()
            if (port := node.signature.inputs.get(str(name))) is not None and not port.optional
        )

    def _read_wires(self) -> None:
        for name, ports in self.given_wires.items():
            if ports is None or name in self.left_out:
                continue
            if not isinstance(ports, Mapping):
                self._problem(
                    f"wires.{name}",
                    "expected a mapping from ports to where they come from",
                    f"write wires: {{{name}: {{port: node.port}}}}",
                )
            elif name not in self.nodes:
                if name not in self.broken and not all(map(_is_optional, ports.values())):
                    near = nearest(str(name), self.nodes, 0.7)
                    hint = f"did you mean 'wires.{near}'? " if near else ""
                    hint += f"if the node was taken out, type '~wires.{name}' too"
                    self._problem(f"wires.{name}", f"this feeds the node '{name}', and there is none", hint)
            else:
                for port, spec in ports.items():
                    if spec is not None:
                        self._read_wire(self.nodes[name], str(port), spec)

    def _read_wire(self, node: Node, port_name: str, spec: Any) -> None:
        where = f"wires.{node.name}.{port_name}"
        port = node.signature.inputs.get(port_name)
        if _is_optional(spec) and (port is None or not self._given(spec)):
            return
        if port is None:
            hint = suggest(port_name, node.signature.inputs, "input ports", prefix=f"wires.{node.name}.")
            hint += f"; to take the wire out, type '~{where}'" if not self.prefix else ""
            self._problem(where, f"{type(node.stage).__name__} has no input port '{port_name}'", hint)
            return
        options = {"from": spec} if isinstance(spec, str) else spec
        if not isinstance(options, Mapping) or not isinstance(options.get("from"), str):
            self._problem(
                where, f"{spec!r} is no wire", "write node.port, or {from: node.port, delay: 1, initial: node.port}"
            )
            return
        for key in (key for key in options if key not in WIRE_OPTIONS):
            self._problem(f"{where}.{key}", "a wire has no such option", suggest(str(key), WIRE_OPTIONS, "options"))
        delay, initial = options.get("delay", 0), options.get("initial")
        hold, collect = options.get("hold", False), options.get("collect", False)
        if not isinstance(delay, int) or isinstance(delay, bool) or delay < 0:
            self._problem(f"{where}.delay", f"{delay!r}, expected a whole number of ticks >= 0")
            return
        if not isinstance(hold, bool) or not isinstance(collect, bool):
            self._problem(where, "hold and collect are true or false")
            return
        given = self._output(where, options["from"], port)
        if given is None:
            return
        self._check_types(where, options["from"], given, node, port)
        if delay and "initial" not in options:
            hint = f"type +{where}.initial={'null, or node.port' if port.optional else 'node.port'}"
            self._problem(where, f"a wire with delay {delay} needs a first value", hint)
        if delay and initial is None and "initial" in options and not port.optional:
            what = f"{type(node.stage).__name__} needs '{port_name}' at every tick, and the first value is null"
            self._problem(f"{where}.initial", what, self._producers(port))
        if initial is not None and not delay:
            self._problem(where, "only a delayed wire has an initial value", f"add delay: 1 to {where}")
        if initial is not None:
            first = self._output(f"{where}.initial", initial, port)
            if first is not None:
                self._check_types(f"{where}.initial", initial, first, node, port)
        if port.collects != collect:
            what = "takes a whole sequence" if port.collects else "takes one value, not a sequence"
            hint = "write {from: …, collect: true}" if port.collects else "leave collect out"
            self._problem(where, f"port '{port_name}' of {type(node.stage).__name__} {what}", hint)
        if collect and (delay or hold):
            self._problem(where, "a collect wire has neither delay nor hold")
        source_node, _, source_port = options["from"].partition(".")
        self.wires.append(Wire(node.name, port_name, source_node, source_port, delay, hold, collect, initial))

    def _given(self, options: Mapping[str, Any]) -> bool:
        """Tells whether what an optional wire comes from is there; one that is no wire is judged like any other."""
        node, _, port = str(options.get("from")).partition(".")
        if node == ARTIFACTS:
            return port in self.artifacts
        return node in self.broken or (node in self.nodes and port in self.nodes[node].signature.outputs)

    def _output(self, where: str, origin: Any, wanted: Port) -> Port | None:
        if not isinstance(origin, str) or origin.count(".") != 1:
            self._problem(where, f"{origin!r} is not of the form node.port", self._producers(wanted))
            return None
        node, _, port = origin.partition(".")
        if node in self.broken:
            return None
        if node == ARTIFACTS:
            if port in self.artifacts:
                return Port(port, self.artifacts[port])
            self._problem(
                where, f"there is no artifact '{port}'", suggest(port, self.artifacts, "artifacts", prefix="artifacts.")
            )
            return None
        if node not in self.nodes:
            near = nearest(node, self.nodes, 0.7)
            hint = f"did you mean '{near}.{port}'? " if near else ""
            hint += f"type '~{where}' to leave this input out; " if wanted.optional and not near else ""
            self._problem(where, f"this reads {origin}, and there is no node '{node}'", hint + self._producers(wanted))
            return None
        outputs = self.nodes[node].signature.outputs
        if port not in outputs:
            hint = suggest(port, outputs, f"outputs of {node}", prefix=f"{node}.")
            hint += f"; type '~{where}' to leave this input out" if wanted.optional and not self.prefix else ""
            self._problem(
                where,
                f"node '{node}' ({type(self.nodes[node].stage).__name__}) has no output '{port}'",
                f"{hint}; {self._producers(wanted)}",
            )
            return None
        return outputs[port]

    def _producers(self, wanted: Port) -> str:
        """Which outputs of the graph would fit a port, else which stages: what to type instead of a wrong name."""
        found, kind = self._fitting(wanted), type_name(wanted.type)
        if found:
            return f"outputs of type {kind}: {', '.join(found)}"
        stages = ", ".join(stages_that_give(wanted.type))
        return f"no output here is of type {kind}" + (f"; stages that give it: {stages}" if stages else "")

    def _fitting(self, wanted: Port) -> list[str]:
        """The outputs and artifacts of the graph that fit a port."""
        kinds = {f"{ARTIFACTS}.{name}": kind for name, kind in self.artifacts.items() if kind is not Any}
        kinds |= {f"{n.name}.{p.name}": p.type for n in self.nodes.values() for p in n.signature.outputs.values()}
        return sorted(origin for origin, kind in kinds.items() if compatible(kind, wanted.type))

    def _to_wire(self, where: str, port: Port) -> str:
        """Text to type for a port that nothing is wired to."""
        own = f"{where.split('.')[1]}."
        fitting = [] if port.collects or self.prefix else self._fitting(port)
        found = [origin for origin in fitting if not origin.startswith(own)]
        if not found:
            return self._producers(port)
        more = f" (or {', '.join(found[1:])})" if len(found) > 1 else ""
        return f"type +{where}={found[0]}{more}"

    def _check_types(self, where: str, origin: str, given: Port, node: Node, port: Port) -> None:
        if not compatible(given.type, port.type):
            taker = f"{node.name}.{port.name} ({type(node.stage).__name__})"
            what = f"{origin} is of type {type_name(given.type)}, {taker} expects {type_name(port.type)}"
            self._problem(where, what, self._producers(port))

    def _check_missing(self) -> None:
        attempted = {
            (str(name), str(port))
            for name, ports in self.given_wires.items()
            if isinstance(ports, Mapping)
            for port, spec in ports.items()
            if spec is not None and not _is_optional(spec)
        } | {(wire.to_node, wire.to_port) for wire in self.wires}
        read = {wire.from_node for wire in self.wires}
        for node in self.nodes.values():
            ports = [port for port in node.signature.inputs.values() if not port.optional]
            if (
                len(ports) > 1
                and node.name not in read | {name for name, _ in attempted}
                and not any(map(self._fitting, ports))
            ):
                what = f"{type(node.stage).__name__} has no place in this graph: nothing feeds it, and nothing reads it"
                self._problem(f"nodes.{node.name}", what, f"leave {node.name}=… out")
                continue
            for port in ports:
                if (node.name, port.name) not in attempted:
                    where = f"wires.{node.name}.{port.name}"
                    wanted = f"{type_name(port.type)} on '{port.name}'"
                    what = f"{type(node.stage).__name__} needs {wanted}, and nothing is wired to it"
                    self._problem(where, what, self._to_wire(where, port))
        sources = [node.name for node in self.nodes.values() if node.signature.is_source]
        if len(sources) > 1:
            self._problem(
                "nodes",
                f"there are several sources ({', '.join(sources)}); a graph has one",
                "take all but one out: '~nodes.…'",
            )
        for name in sources:
            tick = self.nodes[name].signature.outputs.get("tick")
            if tick is None or tick.type is not Tick:
                self._problem(f"nodes.{name}", "a source needs an output `tick: Tick`")

    # order

    def _lifetimes(self) -> dict[str, Lifetime]:
        flow = Following(self.nodes)
        for wire in self.wires:
            for name in map(node_of, wire.origins):
                if name != ARTIFACTS:
                    flow.add(name, wire.to_node)
        after_roots = {wire.to_node for wire in self.wires if wire.collect}
        tick_roots = {name for name, node in self.nodes.items() if node.signature.is_source}
        tick_roots |= {wire.to_node for wire in self.wires if wire.delay}
        after = after_roots | flow.after(*after_roots)
        ticking = tick_roots | flow.after(*tick_roots)
        for wire in self.wires:
            if wire.to_node in after and wire.delay:
                self._problem(
                    wire.where,
                    f"'{wire.to_node}' runs after the loop (something collects a sequence): no tick is before it",
                    "leave delay out",
                )
        for name in sorted(after & tick_roots):
            if self.nodes[name].signature.is_source:
                self._problem(f"nodes.{name}", "a source cannot wait for what is collected until the end")
        if ticking - after and not any(node.signature.is_source for node in self.nodes.values()):
            self._problem("nodes", "there is a loop but no source that makes ticks", "add a source: source=log")
        return {name: "after" if name in after else "tick" if name in ticking else "before" for name in self.nodes}

    def _ordered(self, lifetimes: dict[str, Lifetime]) -> Graph:
        order = Following(self.nodes)
        for wire in self.wires:
            for name in map(node_of, wire.origins[1:] if wire.delay else wire.origins):
                if name != ARTIFACTS:
                    order.add(name, wire.to_node)
        cycle = order.circle()
        if cycle:
            path = " -> ".join([*cycle, cycle[0]])
            around = zip(cycle, [*cycle[1:], cycle[0]], strict=True)
            edges = {(start, end) for start, end in around}
            wire = next((w for w in self.wires if (w.from_node, w.to_node) in edges and not w.delay), self.wires[0])
            hint = f"break the loop with a delay: {wire.where}={{from: {wire.origin}, delay: 1, initial: …}}"
            self._problem(wire.where, f"the nodes wait for each other: {path}", hint)
            return Graph(self.nodes, self.wires, self.artifacts)
        self._order_in_place(order, lifetimes)
        listed = {name: number for number, name in enumerate(self.nodes)}

        def early(name: str) -> tuple[int, bool, int, int]:
            first = listed[name]
            if lifetimes[name] == "tick":  # in time for the first listed of those that wait for it
                first = min(listed[later] for later in (name, *order.after(name)) if lifetimes[later] == "tick")
            own = self.nodes[name].signature
            return LIFETIMES.index(lifetimes[name]), not own.is_source, first, listed[name]

        running = order.ordered(early)
        nodes = {name: dataclasses.replace(self.nodes[name], lifetime=lifetimes[name]) for name in running}
        return Graph(nodes, self.wires, self.artifacts)

    def _order_in_place(self, order: Following, lifetimes: dict[str, Lifetime]) -> None:
        """Readers of the delayed value run before the stage that updates it; whatever cannot be so is a problem."""
        firsts: dict[str, str | None] = {}
        for wire in self.wires:
            given = (
                self.nodes[wire.from_node].signature.outputs[wire.from_port] if wire.from_node in self.nodes else None
            )
            if given is None or not getattr(given.type, "in_place", False):
                continue
            kind = type_name(given.type)
            again = [
                port.name for port in self.nodes[wire.to_node].signature.outputs.values() if port.type is given.type
            ]
            if again and not wire.delay and (lifetimes[wire.from_node], lifetimes[wire.to_node]) == ("before", "tick"):
                self._problem(
                    wire.where,
                    f"'{wire.to_node}' updates the {kind} of '{wire.from_node}', and a resumed run would not know how",
                    f"write {wire.where}={{from: {wire.to_node}.{again[0]}, delay: 1, initial: {wire.origin}}}",
                )
            if wire.collect or wire.hold or wire.delay > 1:
                self._problem(
                    wire.where,
                    f"{kind} is updated in place: read it undelayed or with delay 1; it cannot be collected or held",
                    "collect small events instead",
                )
            if wire.delay == 1:
                if firsts.setdefault(wire.origin, wire.initial) != wire.initial:
                    self._problem(
                        f"{wire.where}.initial",
                        f"{wire.origin} is one {kind}: all its delayed wires need the same initial value",
                        f"write initial: {firsts[wire.origin]}",
                    )
                if wire.to_node != wire.from_node:
                    order.add(wire.to_node, wire.from_node)
                    cycle = order.circle()
                    if cycle:
                        order.remove(wire.to_node, wire.from_node)
                        self._problem(
                            wire.where,
                            f"'{wire.to_node}' must read {kind} before '{wire.from_node}' updates it, "
                            f"but runs after it ({' -> '.join(cycle)})",
                            f"read it undelayed: {wire.where}={wire.origin}",
                        )


def stages_that_give(kind: Any) -> list[str]:
    """The stages, by their names, of which an output fits a port of this type."""
    found = set()
    for entry in entries():
        with suppress(UnknownStage, BadStage):
            given = [] if entry.problem else signature(resolve(entry.target)).outputs.values()
            if any(compatible(port.type, kind) for port in given):
                found.add(entry.name)
    return sorted(found)


def _is_optional(spec: Any) -> bool:
    return isinstance(spec, Mapping) and spec.get("optional") is True
