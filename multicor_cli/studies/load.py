"""Reading study files: everything that is wrong is found at once, with its position, as in scenarios."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from multicor_cli.scenario.load import parse_toml, read_text
from multicor_cli.scenario.problems import KeyPath, Refused, ScenarioError
from multicor_cli.scenario.sources import Sources
from multicor_cli.scenario.translate import translate
from multicor_cli.studies.schema import StudyModel


@dataclass(frozen=True)
class Study:
    """A study file that is right by itself.

    Attributes:
        model: What it says.
        path: Its path.
        sources: Its text, to give problems their positions.
        document: The parsed file.
    """

    model: StudyModel
    path: Path
    sources: Sources
    document: dict[str, Any]

    @property
    def name(self) -> str:
        """Name of the study."""
        return self.model.study.name

    @property
    def scenario(self) -> Path:
        """Path of its scenario."""
        return self.path.parent / self.model.study.scenario

    @property
    def fixed(self) -> list[str]:
        """Arguments of ``--set`` for all cases."""
        return arguments(self.model.set)

    def refuse(self, *findings: Refused) -> ScenarioError:
        """The error that tells these findings, with their positions in the file."""
        return ScenarioError(self.sources.problems([place(self.document, finding) for finding in findings]))


def arguments(values: Mapping[str, Any]) -> list[str]:
    """Arguments of ``--set`` that give keys these values."""
    return [f"{key}={json.dumps(value, ensure_ascii=False)}" for key, value in values.items()]


def load_study(path: str | Path) -> Study:
    """Load and check a study file; its scenario and cases are looked at by `multicor_cli.studies.axes`.

    Raises:
        ScenarioError: The file cannot be read or is wrong; its ``problems`` say all that is wrong.
    """
    path = Path(path)
    text = read_text(path, kind="study")
    document = parse_toml(text, str(path))
    sources = Sources(str(path), text)
    try:
        model = StudyModel.model_validate(document)
    except ValidationError as error:
        findings = [place(document, finding) for finding in translate(StudyModel, error.errors(include_url=False))]
        raise ScenarioError(sources.problems(findings)) from None
    return Study(model, path, sources, document)


def place(document: dict[str, Any], finding: Refused) -> Refused:
    """The finding at its place in the document: ``vary.keys.KEY`` stands there as ``vary."KEY"`` or, without quotes, as tables."""
    path = finding.where
    if path[:2] == ("vary", "keys") and len(path) > 2:
        table, key, rest = "vary", str(path[2]), path[3:]
    elif path[:1] == ("set",) and len(path) > 1:
        table, key, rest = "set", str(path[1]), path[2:]
    else:
        return finding
    written: KeyPath = (key,) if key in document.get(table, {}) else tuple(key.split("."))
    return Refused((table, *written, *rest), finding.what, finding.remedy)
