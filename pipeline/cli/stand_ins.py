"""Options that another option replaces where a setting is null, as `conf/stand_ins.yaml` states.

Which one it is follows from settings, and Hydra composes options before it sets any. So the node is exchanged in the
composed configuration; what was changed of it stays changed.
"""

from collections.abc import Iterator, Mapping
from typing import Any

from omegaconf import OmegaConf

from omninav.pipeline.graph.problems import Problem

from .config_groups import node_option, option_content, stand_ins


def take_stand_ins(config: Any) -> None:
    """Exchange the nodes of a composed configuration, in place."""
    for group, node in exchanged(config):
        config.nodes[group] = node


def exchanged(config: Any) -> Iterator[tuple[str, dict[str, Any]]]:
    """The nodes that others replace, and those, with all that was changed."""
    for group, option, rule in stand_ins():
        listed, given = node_option(group, option) or {}, _node(config, group)
        is_option = given.get("_target_") == listed["_target_"] and listed.keys() <= given.keys()
        if is_option and config.get(rule["where_null"]) is None:
            changed = {key: value for key, value in given.items() if key not in listed or value != listed[key]}
            yield group, _stand_in(group, rule) | changed


def contradictions(config: Any) -> Iterator[Problem]:
    """A problem for each setting that is given beside an option which does not read it, and the other one would."""
    for group, _, rule in stand_ins():
        setting, typed = rule["where_null"], f"{group}={rule['take']}"
        if _node(config, group).get("_target_") != _stand_in(group, rule)["_target_"]:
            continue
        if config.get(setting):
            yield Problem(setting, f"{typed} does not read it", f"leave {typed} or {setting}=… out")
            continue
        for name, hint in rule["alone"].items():
            if config.get(name) is not None:
                yield Problem(name, f"without {setting}=… nothing reads it", hint)


def decisive_settings() -> set[str]:
    """The settings that decide which option is taken."""
    return {rule["where_null"] for _, _, rule in stand_ins()}


def _node(config: Any, group: str) -> dict[str, Any]:
    node = (config.get("nodes") or {}).get(group)
    plain: Any = {} if not isinstance(node, Mapping) else OmegaConf.to_container(node, resolve=False)
    return dict(plain)


def _stand_in(group: str, rule: Mapping[str, Any]) -> dict[str, Any]:
    return dict(option_content(group, rule["take"])["nodes"][group])
