"""A small HTML table, for notebooks."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape


def html_table(caption: str, header: Sequence[str], rows: Sequence[Sequence[str]], *, max_rows: int) -> str:
    """The table as HTML with all text escaped, and after `max_rows` rows the number of those left out."""
    head = "".join(f"<th>{escape(text)}</th>" for text in header)
    body = "".join(
        f"<tr>{''.join(f'<td>{escape(text)}</td>' for text in row)}</tr>" for row in rows[:max_rows]
    )
    if len(rows) > max_rows:
        body += f'<tr><td colspan="{len(header)}">… and {len(rows) - max_rows:,} more</td></tr>'
    top = f"<caption>{escape(caption)}</caption><thead><tr>{head}</tr></thead>"
    return f"<table>{top}<tbody>{body}</tbody></table>"
