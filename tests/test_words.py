"""Words of documents and docstrings: first lines, words that no reader of the field knows, length of sentences."""

import ast
import re
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
DOCUMENTS = [
    ROOT / "README.md",
    ROOT / "CONTRIBUTING.md",
    ROOT / "paper" / "paper.md",
    *sorted((ROOT / "docs").glob("*.md")),
    *sorted((ROOT / "docs").glob("*/*.md")),
]
TUTORIALS = sorted((ROOT / "docs" / "tutorials").glob("*.py"))
CODE = [path for folder in ("descentflow", "scripts", "tests", "docs/_ext") for path in (ROOT / folder).rglob("*.py")]
NO_NOUN = re.compile(r"(What|How|Whether|Which|Who|Whose|When|Where|Why)\b|\.\.\.")
WORDS = r"told|says|works? out|worked out|ways|gives? way|held against|shows? of flights|what is left out of"
NOT_OF_THE_FIELD = re.compile(rf"\b({WORDS})\b", re.IGNORECASE)
MOST_WORDS = 19_500
"""Of README, CONTRIBUTING and the pages, with their code; the changelog, the records and the paper do not count."""
MEAN_SENTENCE = 20


def docstrings(path: Path) -> Iterator[tuple[int, str]]:
    """Line and text of every docstring, those below constants and fields too."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        body = getattr(node, "body", None)
        if not isinstance(body, list):
            continue
        holds = isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef)
        before = ast.Assign() if holds else ast.Pass()
        for one, after in pairwise([before, *body]):
            if not isinstance(one, ast.Assign | ast.AnnAssign) or not isinstance(after, ast.Expr):
                continue
            if isinstance(after.value, ast.Constant) and isinstance(after.value.value, str):
                yield after.lineno, after.value.value.strip()


def prose(text: str) -> str:
    """Text without code, formulas, tables, links' targets and names of arguments."""
    text = re.sub(r"```.*?```|\$\$.*?\$\$|<!--.*?-->|^ *(>>>|\.\.\.) .*(\n(?! *\n).*)*", "", text, flags=re.S | re.M)
    text = re.sub(r"``[^`]*``|`[^`]*`|\$[^$]*\$", "x", text)
    return re.sub(r"^\||\]\([^)]*\)|^ *\w+:(?= )", "", text, flags=re.M)


def sentences(text: str) -> list[str]:
    """Sentences of the running text of a page, without headings, tables and figures."""
    no_code = re.sub(r"```.*?```", "\n\n", text, flags=re.S)
    running = re.sub(r"^(#|\||:|!|>).*$|^ *[-*] ", "\n\n", no_code, flags=re.M)
    parts = []
    for paragraph in re.split(r"\n\s*\n", prose(running)):
        parts += [part for part in re.split(r"(?<=[.!?])\s+", " ".join(paragraph.split())) if len(part.split()) > 2]
    return parts


def test_the_first_line_of_a_docstring_is_a_noun_phrase_or_an_imperative() -> None:
    others = [
        f"{path.relative_to(ROOT)}:{line}: {text.splitlines()[0]}"
        for path in CODE
        for line, text in docstrings(path)
        if NO_NOUN.match(text) or (text.endswith("...") and ">>>" not in text)
    ]
    assert others == []


def test_docstrings_have_words_of_the_field() -> None:
    others = [
        f"{path.relative_to(ROOT)}:{line}: {word[0]}"
        for path in CODE
        for line, text in docstrings(path)
        for word in NOT_OF_THE_FIELD.finditer(prose(text))
    ]
    assert others == []


@pytest.mark.parametrize("path", DOCUMENTS, ids=lambda path: str(path.relative_to(ROOT)))
def test_pages_have_words_of_the_field(path: Path) -> None:
    assert NOT_OF_THE_FIELD.findall(prose(path.read_text(encoding="utf-8"))) == []


@pytest.mark.parametrize("path", TUTORIALS, ids=lambda path: path.stem)
def test_tutorials_have_words_of_the_field(path: Path) -> None:
    comments = re.findall(r"^# .*", path.read_text(encoding="utf-8"), re.MULTILINE)
    assert len(comments) > 10
    texts = [" ".join(comments), *(text for _, text in docstrings(path))]
    assert [word[0] for text in texts for word in NOT_OF_THE_FIELD.finditer(prose(text))] == []


def test_sentences_of_the_pages_are_short() -> None:
    lengths = [len(sentence.split()) for path in DOCUMENTS for sentence in sentences(path.read_text(encoding="utf-8"))]
    assert len(lengths) > 500
    assert sum(lengths) / len(lengths) < MEAN_SENTENCE


def test_the_pages_are_few_words() -> None:
    pages = [path for path in DOCUMENTS if path.parent.name not in ("records", "paper")]
    words = [word for path in pages for word in path.read_text(encoding="utf-8").split() if re.search(r"\w", word)]
    assert len(words) <= MOST_WORDS
