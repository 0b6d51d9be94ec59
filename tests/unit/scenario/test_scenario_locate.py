"""Positions of keys: against documents whose writer knows where it put each key."""

import json
import random
import tomllib

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scenario_problems import places

from multicor_cli.scenario import problems

KEYS = st.one_of(
    st.text("abc019_-", min_size=1, max_size=4),
    st.sampled_from(["a b", "x.y", "#", "", "[", "'", '"', "=", "é", "\t", "a\nb", "]]"]),
)
TEXTS = st.text("ab'\"#\\[]{}=,.\n\té ", max_size=8)
SCALARS = st.one_of(
    TEXTS,
    st.integers(-99, 99),
    st.booleans(),
    st.sampled_from([1.5, 1e-9, float("inf")]),
    st.sampled_from(
        ["1979-05-27 07:32:00", "1979-05-27T07:32:00Z", "07:32:00", "0x1F", "1_000", "-inf"]
    ).map(lambda t: ("raw", t)),
)
VALUES = st.recursive(
    SCALARS,
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(KEYS, inner, max_size=3),
    max_leaves=8,
)
DOCUMENTS = st.dictionaries(KEYS, VALUES, max_size=4)


class Writer:
    """Writes a document in one of many styles and notes where keys begin."""

    def __init__(self, seed):
        self.choice = random.Random(seed)
        self.text = ""
        self.offsets = {}
        self.in_table = True

    def maybe(self):
        return self.choice.random() < 0.5

    def blank(self):
        self.text += self.choice.choice(["", "", " ", "\t "])

    def filling(self):
        self.text += self.choice.choice(["", "", "\n", ' # it\'s a "comment" [ { =\n', "\n\n  "])

    def key(self, part):
        bare = part and all(c in "abcdefghijklmnopqrstuvwxyz0123456789_-" for c in part)
        if bare and self.maybe():
            return part
        literal = "'" not in part and "\n" not in part
        return f"'{part}'" if literal and self.maybe() else json.dumps(part)

    def dotted(self, parts):
        return self.choice.choice([".", " . ", "\t."]).join(self.key(part) for part in parts)

    def string(self, text):
        styles = [json.dumps(text)]
        if "'" not in text and "\n" not in text:
            styles.append(f"'{text}'")
        if "'''" not in text and not text.endswith("'''"):
            styles.append(
                f"'''\n{text}'''" if len(text) - len(text.rstrip("'")) <= 2 else styles[0]
            )
        if "\\" not in text and '"""' not in text and len(text) - len(text.rstrip('"')) <= 2:
            styles.append(f'"""{text}"""')
        return self.choice.choice(styles)

    def value(self, path, value):
        if isinstance(value, list):
            self.array(path, value)
        elif isinstance(value, dict):
            self.inline(path, value)
        elif isinstance(value, tuple):
            self.text += value[1]
        elif isinstance(value, bool):
            self.text += str(value).lower()
        elif isinstance(value, str):
            self.text += self.string(value)
        else:
            self.text += repr(value)

    def array(self, path, value):
        self.text += "["
        for k, element in enumerate(value):
            self.filling()
            self.offsets[(*path, k)] = len(self.text)
            self.value((*path, k), element)
            self.filling()
            self.text += "," if k < len(value) - 1 or self.maybe() else ""
        self.filling()
        self.text += "]"

    def inline(self, path, value):
        self.text += "{"
        for k, (key, inner) in enumerate(value.items()):
            self.blank()
            self.pair(path, (key,), inner)
            self.blank()
            self.text += "," if k < len(value) - 1 else ""
        self.text += "}"

    def pair(self, path, key, value):
        # a dotted key for each of its entries
        if isinstance(value, dict) and value and self.maybe():
            for k, (inner_key, inner) in enumerate(value.items()):
                self.text += ", " if k and not self.in_table else ""
                self.pair(path, (*key, inner_key), inner)
            return
        start = len(self.text)
        for end in range(1, len(key)):
            self.offsets.setdefault(path + key[:end], start)
        self.offsets[path + key] = start
        self.text += self.dotted(key)
        self.text += self.choice.choice(["=", " = ", "\t="])
        was_in_table, self.in_table = self.in_table, False
        self.value(path + key, value)
        self.in_table = was_in_table
        if self.in_table:
            self.blank()
            self.text += self.choice.choice(["\n", " # end\n"])

    def table(self, path, names, table):
        later = []
        for key, value in table.items():
            is_array = (
                isinstance(value, list)
                and value
                and all(isinstance(element, dict) for element in value)
            )
            if (isinstance(value, dict) or is_array) and self.maybe():
                later.append((key, value))
            else:
                self.filling_lines()
                self.pair(path, (key,), value)
        for key, value in later:
            for k, element in enumerate(value if isinstance(value, list) else [value]):
                inner = (*path, key, k) if isinstance(value, list) else (*path, key)
                self.filling_lines()
                start = len(self.text)
                for end in range(1, len(inner)):
                    self.offsets.setdefault(inner[:end], start)
                self.offsets[inner] = start
                header = self.dotted((*names, key))
                self.text += f"[[{header}]]\n" if isinstance(value, list) else f"[ {header} ]\n"
                self.table(inner, (*names, key), element)

    def filling_lines(self):
        self.text += self.choice.choice(["", "\n", "# [x] = {\n", "  \n"])


@settings(max_examples=300, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(DOCUMENTS, st.integers(0, 10**6))
def test_all_keys_are_found_where_they_were_written(document, seed):
    writer = Writer(seed)
    writer.table((), (), document)
    data = tomllib.loads(writer.text)
    offsets = problems.locate_keys(writer.text)
    assert set(offsets) == set(places(data))
    assert offsets == writer.offsets


def test_headers_lines_and_columns_are_found():
    text = "[a.b]\nc = 1\n[a]\nd = 2\n"
    offsets = problems.locate_keys(text)
    assert offsets[("a",)] == text.index("[a]")
    assert offsets[("a", "b", "c")] == text.index("c")
    lines = problems.Lines("ab\nçd\r\n\nx")
    ends = [(1, 1), (1, 3), (2, 1), (2, 2), (3, 1), (4, 1)]
    assert [lines.position(offset) for offset in (0, 2, 3, 4, 7, 8)] == ends
    assert lines.line(2) == "çd"
    assert lines.line(9) == ""


@pytest.mark.parametrize(
    ("text", "is_deep"),
    [
        ("a = " + "[" * problems.MAX_NESTING + "]" * problems.MAX_NESTING, False),
        ("a = " + "[" * (problems.MAX_NESTING + 1), True),
        ("a = [" + "[1]," * 1000 + "]", False),
        ("a = '" + "[" * 100 + "'", False),
        ("# " + "{" * 100, False),
        ('a = """' + "[\n" * 100 + '"""', False),
        ("a" + ".a" * (problems.MAX_NESTING - 1) + " = 1", False),
        ("a" + ' . "a b"' * problems.MAX_NESTING + " = 1", True),
        ("a = '" + "[" * 100, False),
    ],
)
def test_deep_nesting_is_found_before_parsing(text, is_deep):
    assert (problems.find_deep_nesting(text) is not None) == is_deep


def test_a_key_ends_at_the_equals_sign():
    assert problems.parse_key('a . "b=c".0 = 1') == (("a", "b=c", "0"), 12)
    for text in ("", "a", "= 1", "a. = 1", '"a = 1', "a b = 1", '"\\q" = 1'):
        with pytest.raises(ValueError):  # noqa: PT011 - the caller words the message
            problems.parse_key(text)
