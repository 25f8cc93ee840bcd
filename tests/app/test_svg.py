"""Parts of SVG plots: ends of axes are round, and words can't break the drawing."""

from xml.etree import ElementTree

import pytest

from app import svg


@pytest.mark.parametrize(
    ("value", "end"), [(0.0, 1e-9), (0.021, 0.03), (0.3, 0.3), (1.0, 1.0), (1.2, 1.5), (8.1, 10.0), (420.0, 500.0)]
)
def test_an_axis_ends_at_the_next_round_value(value: float, end: float) -> None:
    assert svg.round_up(value) == pytest.approx(end)


def test_words_and_titles_are_shown_as_they_are() -> None:
    words = 'black & red <"10 mm">'
    parts = [svg.text(1, 2, words, opacity=0.5), svg.upright(1, 2, words), svg.dot((1, 2), 3, svg.BLUE, words)]
    text, upright, dot = ElementTree.fromstring(f"<svg>{''.join(parts)}</svg>")
    assert text.text == upright.text == dot[0].text == words
    assert text.get("opacity") == "0.5"


def test_a_line_goes_through_its_points() -> None:
    line = ElementTree.fromstring(svg.line([(0, 1), (2.04, 3)], svg.GREY, 2, stroke_dasharray="5 3"))
    assert (line.get("points"), line.get("stroke-width"), line.get("stroke-dasharray")) == (
        "0.0,1.0 2.0,3.0",
        "2",
        "5 3",
    )
