"""The schema for editors and the templates of new scenarios."""

import json
import tomllib

import pytest
from places import ROOT

from multicor_cli.scenario import parse_scenario
from multicor_cli.scenario.tables import ScenarioModel, scenario_schema
from multicor_cli.scenario.templates import COOKBOOK, TEMPLATES, new_scenario, template_table

SCHEMA_FILE = ROOT / "schema" / "multicor.schema.json"


def test_the_schema_file_is_fresh():
    stored = json.loads(SCHEMA_FILE.read_text(encoding="utf-8"))
    assert stored == scenario_schema(), (
        "write it again: multicor schema > schema/multicor.schema.json"
    )


def test_the_schema_says_what_the_models_say():
    schema = json.loads(json.dumps(scenario_schema()))
    assert schema == scenario_schema()
    assert set(schema["properties"]) == {
        field.alias or key for key, field in ScenarioModel.model_fields.items()
    }
    assert schema["additionalProperties"] is False
    rough = schema["$defs"]["RoughGeometry"]
    assert {"from", "to"} <= set(rough["properties"])
    assert rough["required"] == ["kind", "from", "to", "side"]
    material = schema["$defs"]["Material"]["properties"]
    assert (material["density"]["minimum"], material["young"]["minimum"]) == (1.0, 1e3)


def test_every_key_is_described_and_none_may_be_null():
    assert '"null"' not in json.dumps(scenario_schema())
    for name, table in scenario_schema()["$defs"].items():
        for key, value in table["properties"].items():
            assert "description" in value or key == "kind", f"{name}.{key}"


def nodes(node):
    yield node
    for value in (
        node.values() if isinstance(node, dict) else node if isinstance(node, list) else ()
    ):
        yield from nodes(value)


def test_paragraphs_of_descriptions_are_lines_whatever_the_width_of_the_source():
    def texts(node):
        for key, value in (
            node.items()
            if isinstance(node, dict)
            else enumerate(node)
            if isinstance(node, list)
            else ()
        ):
            yield from [value] if key == "description" and isinstance(value, str) else texts(value)

    described = list(texts(scenario_schema()))
    assert len(described) > 200
    assert any("\n\n" in text for text in described)
    assert not [text for text in described if "\n" in text.replace("\n\n", "")]


def test_editors_take_expressions_wherever_numbers_stand():
    """Bounds concern numbers, the pattern strings, so that neither gets in the way of the other."""
    tables = [
        node
        for node in nodes(scenario_schema())
        if isinstance(node, dict) and isinstance(node.get("type"), str | list)
    ]
    assert not [node for node in tables if node["type"] in ("number", "integer")]
    numbers = [(node["type"], node["pattern"]) for node in tables if isinstance(node["type"], list)]
    assert len(numbers) > 100
    assert all(
        kind in (["number", "string"], ["integer", "string"]) and pattern == "^="
        for kind, pattern in numbers
    )
    assert scenario_schema()["$defs"]["Material"]["properties"]["density"]["minimum"] == 1.0


@pytest.mark.parametrize("template", TEMPLATES)
def test_each_template_is_a_right_scenario_that_explains_itself(template, tmp_path):
    text = new_scenario("my-run.2", template)
    table = template_table(template)
    if table is not None:
        (tmp_path / "my-run.2.csv").write_text(table, encoding="utf-8")
    scenario = parse_scenario(text, tmp_path / "my-run.2.toml")
    assert scenario.name == "my-run.2"
    assert scenario.description
    assert text.count("#") >= 10
    assert "NAME" not in tomllib.loads(text)["scenario"].values()
    assert parse_scenario(scenario.resolved_toml(), "resolved.toml") == scenario


@pytest.mark.parametrize("name", COOKBOOK)
def test_scenarios_of_the_cookbook_are_their_templates(name):
    text = (ROOT / "configs" / f"{name}.toml").read_text(encoding="utf-8")
    # Without the line for editors
    shipped = text.partition("\n")[2].replace(f"configs/{name}.toml", f"{name}.toml")
    assert new_scenario(name, name) == shipped
    table = ROOT / "configs" / f"{name}.csv"
    assert template_table(name) == (table.read_text(encoding="utf-8") if table.exists() else None)


@pytest.mark.parametrize(
    ("name", "template"),
    [("a", "sheer"), ("../a", "shear"), ("", "shear"), ("a b", "drum"), (".a", "drum")],
)
def test_bad_names_are_refused(name, template):
    with pytest.raises(ValueError, match=r"use "):
        new_scenario(name, template)
