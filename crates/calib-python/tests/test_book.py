"""The blocks of the book's page, from top to bottom in one session."""

from conftest import ROOT

PAGE = ROOT / "book/src/python.md"


def blocks() -> list[tuple[int, str]]:
    """Line and text of every Python block."""
    found, start, lines = [], 0, []
    for number, line in enumerate(PAGE.read_text().splitlines(), 1):
        if line == "```python":
            start, lines = number, []
        elif line == "```" and start:
            found.append((start, "\n".join(lines)))
            start = 0
        elif start:
            lines.append(line)
    return found


def test_the_page_is_a_session() -> None:
    session: dict[str, object] = {"__name__": "page"}
    all_blocks = blocks()
    assert len(all_blocks) >= 10
    for start, text in all_blocks:
        # Lines as in the page, for the traceback.
        exec(compile("\n" * start + text, str(PAGE), "exec"), session)
    assert len(session["stages"]) > 5  # type: ignore[arg-type]
