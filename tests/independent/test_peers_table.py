"""What the comparison with other simulators says of its trials."""

from typing import Any

from benchmarks.peers.report import MARKS, Results
from benchmarks.peers.search import Trial, best

CASES = [
    {"name": name, "family": "plane", "uncertainty": 1e-5, "check": 2e-5, "stretch": None}
    for name in ("plane, first", "plane, second")
]
VERSIONS = {
    "machine": {"processor": "P", "Python": "3", "commit": "c"},
    "versions": {"mujoco-core": "4"},
    "budget": 1.0,
}


def trial(peer: str, case: str, error: float | None, seconds: float) -> dict[str, Any]:
    times = {"seconds": seconds, "setup": 0.002, "repeats": 3}
    return {"peer": peer, "case": case, "setting": {"n": 1}, "error": error, "final": error, "rms": error, **times}


def results() -> Results:
    """Return results where MuJoCo's chain wins one case at 10 mm and reaches 1 mm in the other case only."""
    first, second = "plane, first", "plane, second"
    ours = [trial("dlocore march", case, 2e-4, 1e-3) for case in (first, second)]
    peers = [trial("MuJoCo chain", first, 5e-4, 5e-4), trial("MuJoCo chain", second, 8e-3, 4e-3)]
    blown = [trial("MuJoCo chain", first, None, 1e-4)]
    winners = [
        {"tolerance": tolerance} | t
        for t in ours + peers
        for tolerance in (1e-2, 3e-3, 1e-3, 3e-4)
        if t["error"] <= tolerance
    ]
    names = ["dlocore march", "MuJoCo chain", "PyElastica"]
    return Results(VERSIONS | {"cases": CASES, "peers": names, "trials": ours + peers + blown, "winners": winners})


def test_a_cell_is_the_median_time_with_the_median_ratio_or_says_what_is_missing():
    rows = {line.split("|")[2].strip(): line for line in results().table(families=True).splitlines()[2:]}
    assert [cell.strip() for cell in rows["10"].split("|")[3:6]] == ["1 ms (1x)", "2.25 ms (2.2x)", "left out"]
    assert "not reached (1 of 2)" in rows["1"]
    assert "not reached (2 of 2)" in rows["0.3"]


def test_where_a_peer_is_faster_the_text_says_so():
    text = results().text()
    assert "MuJoCo chain is faster than dlocore in 3 of 8: 1 at 10 mm, 1 at 3 mm, 1 at 1 mm" in text
    assert "PyElastica is faster than dlocore in 0 of 8; it is below 10x in 0." in text


def test_where_dlocore_is_not_as_many_times_faster_as_it_is_meant_to_be_the_text_says_so():
    assert "1 at 1 mm; it is below 10x in 4." in results().text()  # that one, and the other case at 10 mm


def test_a_simulation_that_blew_up_never_wins():
    trials: list[Trial] = results().trials
    assert best([t for t in trials if t.peer == "MuJoCo chain" and t.case == "plane, first"], 1.0).seconds == 5e-4


def test_publishing_replaces_what_lies_between_the_marks_only(tmp_path):
    page = tmp_path / "peers.md"
    page.write_text(f"before\n\n{MARKS[0]}\nold\n{MARKS[1]}\n\nafter\n")
    results().publish(page, tmp_path / "peers.png")
    first = page.read_text()
    results().publish(page, tmp_path / "peers.png")
    assert page.read_text() == first  # once more changes nothing
    assert first.startswith("before\n")
    assert first.endswith("after\n")
    assert "old" not in first
    assert (tmp_path / "peers.png").read_bytes().startswith(b"\x89PNG")
