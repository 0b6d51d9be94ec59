"""The long description: README.md as it reads where no repository is around it. All else is in
pyproject.toml.
"""

import re
from pathlib import Path

from setuptools import setup


def long_description(readme: str) -> str:
    """The README without its pictures and with the texts of links in place of those to files: a
    package index has none of these.
    """
    without_pictures = re.sub(r"^!\[.*\n(\n\(.*picture\.\)\n)?\n", "", readme, flags=re.MULTILINE)
    return re.sub(r"\[([^\]]+)\]\((?!\w+://)[^)]*\)", r"\1", without_pictures)


setup(
    long_description=long_description(
        Path(__file__).with_name("README.md").read_text(encoding="utf-8")
    ),
    long_description_content_type="text/markdown",
)
