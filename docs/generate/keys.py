"""The pages about the keys of a scenario, one for each table of the file, from its JSON Schema."""

from __future__ import annotations

import re
from collections.abc import Iterator
from itertools import cycle
from typing import Any

from examples import Example, examples

from multicor_cli.scenario.documents import in_line
from multicor_cli.scenario.tables import scenario_schema

SINCE = "0.1"
"""Version of keys that say none (``json_schema_extra={"since": "0.2"}`` of a field does)."""

FOLDER = "reference/scenario"
SHARED = "functions"
"""Page of the functions of time, which several tables use."""

_SIGNALS = ("RampSignal", "SineSignal", "SineWave", "TableSignal")
_UNIT = re.compile(r"\[((?:1|K|k?g|m|s|N|Pa|J|W|rad|Ω|degrees)[² ³/().mskKNrad]*)\]")
_TITLES = {
    "scenario": "[scenario]", "variables": "[variables]", "domain": "[domain]",
    "materials": "[materials.NAME]",
    "contacts": "[[contacts]]", "start": "[start]", "particles": "[[particles]]",
    "walls": "[[walls]]", "outlets": "[[outlets]]",
    "loading": "[[loading]]", "heat": "[heat]", "solver": "[solver]", "output": "[output]",
}  # fmt: skip

Node = dict[str, Any]


def key_pages() -> dict[str, str]:
    """The pages, as Markdown by their paths in the documentation."""
    schema = scenario_schema()
    tables: dict[str, Node] = schema["properties"]
    homes = _homes(schema)
    shown = examples()
    pages = {f"{FOLDER}/index.md": _index(tables, schema)}
    for table, node in tables.items():
        models = [model for model, home in homes.items() if home == table]
        pages[f"{FOLDER}/{table}.md"] = _page(
            _TITLES[table], node["description"], table, models, schema["$defs"], homes, shown
        )
    text = (
        "what moves a wall, heats it or turns gravity is a number, or a function of the time "
        "since the start of the stage"
    )
    models = [model for model, home in homes.items() if home == SHARED]
    pages[f"{FOLDER}/{SHARED}.md"] = _page(
        "Functions of time", text, SHARED, models, schema["$defs"], homes, shown
    )
    return pages


def _homes(schema: Node) -> dict[str, str]:
    """The page of each model: that of the first table from which it is reached."""
    homes = dict.fromkeys(_SIGNALS, SHARED)
    for table, node in schema["properties"].items():
        waiting = list(_references(node))
        while waiting:
            model = waiting.pop(0)
            if model not in homes:
                homes[model] = table
                waiting += _references(schema["$defs"][model])
    return homes


def _references(node: Any) -> Iterator[str]:
    if isinstance(node, dict):
        if "$ref" in node:
            yield node["$ref"].rpartition("/")[2]
        for value in node.values():
            yield from _references(value)
    elif isinstance(node, list):
        for value in node:
            yield from _references(value)


def _index(tables: dict[str, Node], schema: Node) -> str:
    required = {*schema["required"], "particles"}
    rows = [
        (
            f"| [`{_TITLES[table]}`]({table}.md) | {_text(node['description'])} | "
            f"{'yes' if table in required else ''} |"
        )
        for table, node in tables.items()
    ]
    return f"""# Keys of a scenario

A scenario is a TOML file of these tables. All numbers are SI, angles are in radians unless a key
says degrees, indices count from 0. Wherever a number stands, so can an
[expression](../scenario-language.md), and often a [function of time]({SHARED}.md).

| table | what it is about | required |
|---|---|---|
{chr(10).join(rows)}

`[[particles]]` may be left out with `[start]`. `multicor validate FILE` reports every problem at
once with its line; `multicor schema` prints all this as a JSON Schema for your editor.
"""


def _page(
    title: str,
    about: str,
    table: str,
    models: list[str],
    definitions: dict[str, Node],
    homes: dict[str, str],
    shown: dict[tuple[str, str], Example],
) -> str:
    lines = [
        f"# {f'`{title}`' if title.startswith('[') else title}",
        "",
        _sentence(_text(about)),
        "",
    ]
    if len(models) > 1:
        lines += [*_overview(models, definitions), ""]
    for place, model in enumerate(models):
        node = definitions[model]
        own = place == 0 and table != SHARED and _TITLES[table] in node["description"]
        if not own:
            lines += [f"## {_heading(model, node)}", ""]
        lines += [_about(node, own), ""]
        if len(models) == 1 and len(node["properties"]) > 1:
            lines += [f"Keys: {_links(model, node)}.", ""]
        for key, value in node["properties"].items():
            lines += _key(
                model,
                key,
                value,
                key in node.get("required", ()),
                homes,
                table,
                definitions,
                shown.get((model, key)),
            )
    return "\n".join(lines)


def _overview(models: list[str], definitions: dict[str, Node]) -> list[str]:
    """A table of all keys of a page, which may be long."""
    rows = []
    for model in models:
        heading = _heading(model, definitions[model])
        rows.append(f"| {heading} | {_links(model, definitions[model])} |")
    return ["| table | keys |", "|---|---|", *rows]


def _links(model: str, node: Node) -> str:
    return ", ".join(f"[`{key}`](#{_anchor(model, key)})" for key in node["properties"])


def _anchor(model: str, key: str) -> str:
    return f"{re.sub(' ', '-', _heading(model, {'properties': {}}))}-{key}"


def _about(node: Node, own: bool) -> str:
    """The docstring of a model; of the table of the page what its first line adds to the page's
    title is known.
    """
    paragraphs = node["description"].replace("``", "`").split("\n\n")
    return "\n\n".join(paragraphs[1:] if own else paragraphs)


def _heading(model: str, node: Node) -> str:
    kind = node["properties"].get("kind", {}).get("const")
    words = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", model).lower()
    return f'{words}: `kind = "{kind}"`' if kind else words


def _key(
    model: str,
    key: str,
    value: Node,
    required: bool,
    homes: dict[str, str],
    table: str,
    definitions: dict[str, Node],
    example: Example | None,
) -> list[str]:
    description = value.get("description", "which of the kinds this is")
    # Of a number that may be a table, too, the unit stands before what the table is.
    unit = ", ".join(dict.fromkeys(_UNIT.findall(description.partition(", or a")[0])))
    facts = [_type(value, homes, table, definitions)]
    if unit and facts != ["string"]:
        facts.append(f"[{unit}]")
    if bounds := _range(value):
        facts.append(bounds)
    if required:
        facts.append("**required**")
    elif "default" in value and value["default"] not in ([], {}):
        facts.append(f"default `{in_line(value['default'])}`")
    facts.append(f"since {value.get('since', SINCE)}")
    heading = f"### `{key}` {{ #{_anchor(model, key)} }}"
    lines = [heading, "", " · ".join(facts), "", _sentence(_text(description)), ""]
    if example:
        lines += [f'```toml title="{example.file}"', example.text, "```", ""]
    return lines


def _type(value: Node, homes: dict[str, str], table: str, definitions: dict[str, Node]) -> str:
    choices = value.get("oneOf") or value.get("anyOf") or [value]
    return " or ".join(
        dict.fromkeys(_one_type(choice, homes, table, definitions) for choice in choices)
    )


def _one_type(value: Node, homes: dict[str, str], table: str, definitions: dict[str, Node]) -> str:
    if "$ref" in value:
        model = value["$ref"].rpartition("/")[2]
        heading = _heading(model, definitions[model])
        anchor = re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-")
        kind = definitions[model]["properties"].get("kind", {}).get("const")
        page = "" if homes[model] == table else f"{homes[model]}.md"
        is_table = (
            homes[model] in _TITLES and _TITLES[homes[model]] in definitions[model]["description"]
        )
        return (
            f"[{kind or heading}]({page}#{anchor})"
            if not is_table
            else f"[{heading}]({homes[model]}.md)"
        )
    if "enum" in value:
        return " or ".join(f'`"{word}"`' for word in value["enum"])
    if "const" in value:
        return f"`{in_line(value['const'])}`"
    kind = value.get("type")
    if isinstance(kind, list):
        kind = kind[0]
    if kind == "array":
        return f"array{_length(value)} of {_elements(value, homes, table, definitions)}"
    if kind == "object":
        inner = next(iter(value.get("patternProperties", {}).values()), None) or value.get(
            "additionalProperties"
        )
        return (
            "table of " + _type(inner, homes, table, definitions) + " by name"
            if isinstance(inner, dict)
            else "table"
        )
    if kind is None:
        return "table"
    names = {"integer": "whole number", "boolean": "true or false"}
    return names.get(str(kind), str(kind))


def _elements(value: Node, homes: dict[str, str], table: str, definitions: dict[str, Node]) -> str:
    inner = value.get("items") or value.get("prefixItems", [{}])[0]
    return _type(inner, homes, table, definitions)


def _length(value: Node) -> str:
    return (
        f" of {value['minItems']}"
        if value.get("minItems") == value.get("maxItems") and "minItems" in value
        else ""
    )


def _range(value: Node) -> str:
    """Bounds of a number, or of those in an array or among the choices."""
    for node in [
        value,
        *value.get("oneOf", []),
        *value.get("anyOf", []),
        *value.get("prefixItems", []),
        value.get("items", {}),
    ]:
        low = node.get("minimum", node.get("exclusiveMinimum"))
        high = node.get("maximum", node.get("exclusiveMaximum"))
        if low is not None and high is not None:
            opening = "above " if "exclusiveMinimum" in node else ""
            closing = "below " if "exclusiveMaximum" in node else ""
            return f"{opening}{low:g} to {closing}{high:g}"
    return ""


def _text(description: str) -> str:
    """A description as Markdown: code stays code, and what looks like markup is none."""
    parts = description.replace("``", "`").split("`")
    return "`".join(
        part if is_code else re.sub(r"([<>*|\[\]])", r"\\\1", part)
        for is_code, part in zip(cycle((False, True)), parts)
    )


def _sentence(text: str) -> str:
    is_word = re.match(r"[a-z]+[ ,:;]", text) is not None
    text = text[:1].upper() + text[1:] if is_word else text
    return text if text.endswith((".", ")")) else text + "."
